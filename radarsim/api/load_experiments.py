"""Several configs loaded and checked together, before any of them runs."""

import os
import unicodedata
from collections.abc import Sequence

from radarsim.api.configs import Overrides, load
from radarsim.config.experiment import Experiment
from radarsim.config.overrides import override_texts
from radarsim.errors import ConfigError
from radarsim.report import atomic_files


def load_all(sources: Sequence[str | os.PathLike[str]], overrides: Sequence[str] = ()) -> list[Experiment]:
    """Load and check every config before any runs. Raises one ConfigError with the faults of all."""
    loaded: list[Experiment] = []
    faults: list[str] = []
    for source in sources:
        try:
            loaded.append(load(source, overrides))
        except ConfigError as error:
            faults += error.lines
    faults += name_clashes(loaded)
    if faults:
        raise ConfigError(*faults)
    return loaded


def user_code_lines(experiments: Sequence[Experiment]) -> list[str]:
    """A line for each user filter that experiments name as code; imports it. Raises ConfigError where that fails."""
    user_filters = [
        user_filter
        for experiment in experiments
        for case in experiment.cases
        for user_filter in case.user_filters
        if user_filter.written
    ]
    filters = {f"{user_filter.object_name} in {user_filter.file}": user_filter for user_filter in user_filters}
    for user_filter in filters.values():
        user_filter.target  # noqa: B018  (imports it)
    return list(filters)


def name_clashes(experiments: Sequence[Experiment]) -> list[str]:
    """A line for each config whose results would overwrite those of another: folders have the config's name.

    Names that differ in case or in Unicode composition are one name to some file systems."""
    paths_by_name: dict[str, str] = {}
    faults = []
    for experiment in experiments:
        name = unicodedata.normalize("NFC", experiment.stem).casefold()
        first_path = paths_by_name.setdefault(name, str(experiment.path))
        if first_path != str(experiment.path) and not atomic_files.same_file(first_path, str(experiment.path)):
            faults.append(
                f"{experiment.path}: its results would overwrite those of {first_path}: rename one, or run them apart"
            )
    return faults


def combine_overrides(
    overrides: Overrides, realisations: float | None = None, seed: int | None = None
) -> tuple[str, ...]:
    """Overrides as texts, with realisations and seed, if given, as two more."""
    options = {"realisations": realisations, "seed": seed}
    return (*override_texts(overrides), *(f"{key}={value}" for key, value in options.items() if value is not None))

"""Configs read with all studies that are installed."""

import os
from collections.abc import Mapping, Sequence
from functools import cache, partial
from pathlib import Path
from typing import Any

from radarsim.config import find_files, overrides
from radarsim.config import load as config_loading
from radarsim.config.experiment import Case, Experiment
from radarsim.errors import ConfigError, UnknownConfig
from radarsim.extensions import extensions
from radarsim.language import current
from radarsim.language.translate import tr
from radarsim.studies import registry

Config = str | os.PathLike[str] | Mapping[str, Any] | Experiment
Overrides = overrides.Overrides
find_files.further_folders = registry.folders
current.packages = registry.packages


def load(source: Config, overrides: Overrides = ()) -> Experiment:
    """The experiment that a config describes, fully checked.

    source is a path, the stem of a config (here, in ./configs, or shipped), a mapping like the YAML, or an experiment
    loaded with these overrides; overrides are as in config.load.texts. Raises ConfigError, one line for each fault,
    also in the claims of an installed package's study."""
    if isinstance(source, Experiment):
        return source
    try:
        experiment = config_loading.load(source, overrides, registry)
    except UnknownConfig as error:
        raise ConfigError(_unknown_config_text(error)) from None
    if experiment.study not in registry.SHIPPED and (faults := _extension_faults(experiment.study)):
        raise ConfigError(*faults)
    return experiment


def _unknown_config_text(error: UnknownConfig) -> str:
    """The message that no config has a name, in the language in use."""
    if error.meant:
        return tr("{name}: no such config; did you mean {meant}?", name=error.name, meant=error.meant)
    return tr(
        "{name}: no such config; the nearest: {nearest}; `radarsim list configs` has all {count}",
        name=error.name,
        nearest=", ".join(error.nearest),
        count=error.count,
    )


@cache
def _extension_faults(name: str) -> Sequence[str]:
    """Faults in what a package's study declares for extensions, such as unknown names in its claims."""
    faults = (registry.call_study(name, partial(extension.study_faults, shipped=shipped)) for extension in extensions())
    return tuple(dict.fromkeys(line for lines in faults for line in lines))


@cache
def shipped(stem: str) -> tuple[Case, ...] | None:
    """The cases of the shipped config of a stem; None where there is none.

    A user's file of that name is never read: claims are judged by the shipped config."""
    file = shipped_file(stem)
    return None if file is None else config_loading.load(file, (), registry).cases


def shipped_file(stem: str) -> Path | None:
    """The file of the shipped config of a stem."""
    files = (folder / "configs" / f"{stem}.yaml" for folder in (find_files.SHIPPED, *registry.folders()))
    return next((file for file in files if stem and file.is_file()), None)


def config_stems() -> tuple[str, ...]:
    """The stems of all available configs: in the working directory, shipped, and in installed packages."""
    return find_files.available_stems("configs")


def config_path(stem: str) -> Path | None:
    """The file of the config that a stem names; None where there is none."""
    return find_files.config_file(stem)


def shipped_stem(experiment: Experiment) -> str:
    """The stem of the shipped config behind an experiment, whatever was overridden; empty for a user's config."""
    if experiment.like and shipped_file(experiment.like):
        return experiment.like
    file = shipped_file(experiment.stem)
    is_shipped = file and experiment.path and Path(experiment.path).resolve() == file.resolve()
    return experiment.stem if is_shipped else ""


def shadow_warnings(experiment: Experiment) -> list[str]:
    """A warning where an experiment comes from a user's file although a config of its name is shipped."""
    if not experiment.path or shipped_stem(experiment) or not shipped_file(experiment.stem):
        return []
    file = Path(experiment.path).resolve()
    if file.is_relative_to(Path(__file__).parents[1].resolve()):  # of the self-test
        return []
    return [tr("{file}: used in place of the shipped config {config}", file=file.name, config=experiment.stem)]


def schema_json() -> str:
    """JSON Schema of the YAML of all studies, as text."""
    from radarsim.config import json_schema  # pydantic's part takes a tenth of a second to load

    return json_schema.json_schema_text(registry)

"""The config that a result keeps: config.yaml, and the data files that it names."""

from collections.abc import Iterable, Sequence

from radarsim.api.configs import shipped_stem
from radarsim.config.complete_config import CONFIG_FILE, complete_config
from radarsim.config.experiment import Experiment
from radarsim.engine.results import CaseResult
from radarsim.studies import registry


def config_files(
    experiment: Experiment, results: Sequence[CaseResult] | None = None, taken_paths: Iterable[str] = ()
) -> dict[str, bytes]:
    """config.yaml with the realisations of these results, by default those of the experiment, and its data files, by
    their paths in a folder; taken_paths: paths that others have there. Empty where no text describes the experiment, or
    where a data file is gone."""
    done = {case.name: case.realisations for case in experiment.cases}
    if results is not None:
        done = {result.name: result.count for result in results}
    try:
        kept_config = complete_config(
            experiment, done, shipped_stem(experiment), registry.keys(experiment.study), taken_paths
        )
    except OSError:
        return {}
    return {} if kept_config is None else {CONFIG_FILE: kept_config.text.encode(), **kept_config.files}


def config_text(experiment: Experiment, results: Sequence[CaseResult] | None = None) -> str:
    """The text of config.yaml; empty where no text describes the experiment."""
    return config_files(experiment, results).get(CONFIG_FILE, b"").decode()

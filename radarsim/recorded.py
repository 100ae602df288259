"""The filters of an experiment over recorded plots."""

import os

from numpy.linalg import LinAlgError

from radarsim import plots, studies
from radarsim.config.load import Case, Experiment
from radarsim.engine.results import Track
from radarsim.errors import ConfigError


def track(experiment: Experiment, source: str | os.PathLike) -> tuple[Case, Track]:
    """The filters of an experiment's one case over the recorded plots in a CSV file.

    Raises ConfigError for an experiment of several cases, a study without recorded plots, and faults in the file.
    """
    place = experiment.path or experiment.stem
    if len(experiment.cases) > 1:
        count = len(experiment.cases)
        raise ConfigError(f"{place}: must be one case to track with, got {count}; choose: --set sweep.KEY=[VALUE]")
    (case,) = experiment.cases
    study = studies.study(case.study)
    if not hasattr(study, "track"):
        raise ConfigError(f"{place}: study: {case.study} has no filters for recorded plots")
    recorded = plots.read(source, study.PLOT_COLUMNS(case.spec))
    try:
        return case, study.track(case, recorded)
    except LinAlgError as error:
        raise ConfigError(
            f"{source}: t_s: intervals so different leave a filter's equations without solution"
        ) from error

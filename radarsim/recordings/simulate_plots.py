"""Simulate the plots of realisations, exactly those of a run."""

from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np

from radarsim.config.common_keys import LARGEST_REALISATIONS
from radarsim.config.experiment import Case, Experiment
from radarsim.config.seeds import TRAINING, other_seed
from radarsim.errors import ConfigError, argument
from radarsim.recordings.study_part import recording_interface, refuse_inherited_part, single_case
from radarsim.studies.plot_arrays import SimulatedPlots
from radarsim.studies.registry import study
from radarsim.studies.user_filters import plots as user_filters_plots

JUDGING = "judging"  # the purpose of plots that are those of a run


def simulate_realisation(experiment: Experiment, realisation: int = 0) -> dict[str, np.ndarray]:
    """The plots of one realisation of an experiment's one case, exactly those of a run, and the truth as true_….
    Columns have equal length, with NaN where a plot is missed. Raises ConfigError for a realisation that no run has."""
    if not 0 <= realisation < LARGEST_REALISATIONS:
        raise ConfigError(f"realisation: must be from 0 to {LARGEST_REALISATIONS - 1}, got {realisation}")
    case = case_with_plots(experiment)
    return dict(recording_interface(case).simulated(case, realisation))


def case_with_plots(experiment: Experiment) -> Case:
    """The only case of an experiment, of a study that draws plots; raises ConfigError."""
    case = single_case(experiment, "simulate", "radarsim simulate {} -o PLOTS.csv")
    refuse_inherited_part(case, "simulated")
    refuse_inherited_part(case, "drawing")
    return case


def plot_batches(
    experiment: Experiment, n: int, first: int = 0, chunk: int | None = None, purpose: str = JUDGING
) -> Iterator[SimulatedPlots]:
    """The plots of n realisations of an experiment's one case from number `first` on, chunk by chunk, in flat memory.
    Raises ConfigError, at once, for realisations that no run has.

    purpose: `training` draws with another seed than that of a run."""
    if purpose not in (JUDGING, TRAINING):
        raise ConfigError(f"{argument('purpose')}: must be {JUDGING} or {TRAINING}, got {purpose!r}")
    counts = {"n": (n, 1), "first": (first, 0), "chunk": (n if chunk is None else chunk, 1)}
    n, first, size = (_whole_number(name, *count) for name, count in counts.items())
    if first + n > LARGEST_REALISATIONS:
        argument_name = argument("first + n", "--realisations: STOP")
        raise ConfigError(f"{argument_name}: must be at most {LARGEST_REALISATIONS}, got {first + n}")
    case = case_with_plots(experiment)
    if purpose == TRAINING:
        case = replace(case, seed=other_seed(case.seed, TRAINING))
    plots, last, case_study = recording_interface(case), first + n, study(case.study)
    world = cache(
        lambda: user_filters_plots.make_world(
            case_study, case, plots.draw_plots(case, first, 1), case_study.prepare(case).axes.components
        )
    )
    shared_fields: dict[str, Any] = {"seed": case.seed, "make_world": world}
    return (replace(plots.draw_plots(case, i, min(size, last - i)), **shared_fields) for i in range(first, last, size))


def _whole_number(name: str, value: Any, minimum: int) -> int:
    """A value as a whole number, which may be given as a float; raises ConfigError."""
    is_number = isinstance(value, int | float | np.number) and not isinstance(value, bool)
    if not is_number or not float(value).is_integer() or value < minimum:
        raise ConfigError(f"{name}: must be a whole number >= {minimum}, got {value!r}")
    return int(value)

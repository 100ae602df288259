"""The plots of a case as user filters see them."""

from copy import deepcopy
from dataclasses import replace
from operator import attrgetter
from typing import TYPE_CHECKING, Any

import numpy as np

from radarsim.config.experiment import Case
from radarsim.errors import ConfigError
from radarsim.studies.noise import noise_key
from radarsim.studies.plot_arrays import World
from radarsim.studies.random_numbers import RandomSource
from radarsim.studies.user_filters.filters import Plots

if TYPE_CHECKING:
    from radarsim.studies.interface import Study
    from radarsim.studies.plot_arrays import DrawPlots, SimulatedPlots


RANDOM_STREAM = "user filters"  # of the numbers that filters draw


def drawing_setup(study: "Study", case: Case, inner: Any) -> tuple["DrawPlots", World, np.ndarray]:
    """The function that draws a case's plots, its `World`, and the indices (K,) of the axes' scans among all scans.

    Raises ConfigError where errors of a user filter cannot be paired with the study's."""
    draw, axes = prepare_drawing(study, case), inner.axes
    if "paired" not in inner.layout.shapes:
        raise ConfigError(
            f"{case.name}: its trackers find tracks of their own, in other realisations each: there is no estimate in "
            "every one that a filter from outside could be paired with"
        )
    first = draw(0, 1)
    scans = np.asarray(axes.k) - 1
    if first.several or scans[-1] >= len(first.t_s) or not np.allclose(first.t_s[scans] - first.t_s[0], axes.t_s):
        raise ConfigError(f"{case.name}: its plots do not stand at the scans of its errors")
    return draw, make_world(study, case, first, axes.components), scans


def first_plots(study: "Study", case: Case, count: int) -> Plots:
    """The plots of a case's first realisations as a filter sees them, before there is a plan for it."""
    draw, world, _ = drawing_setup(study, case, study.prepare(case))
    return plots_for_filter(world, draw(0, count))


def prepare_drawing(study: "Study", case: Case) -> "DrawPlots":
    """The function that draws a case's plots; raises ConfigError for a study without plots."""
    interface = study.recording_interface()
    if interface is None:
        raise ConfigError(f"{case.name}: study {study.name} draws no plots that a filter from outside could take")
    return interface.drawing(case)


def make_world(study: "Study", case: Case, plots: "SimulatedPlots", components: tuple[tuple[str, str], ...]) -> World:
    """What a filter may know beforehand about these plots and a state with these components."""
    interface = study.recording_interface()
    keys = {} if interface is None else interface.sigmas(case.spec)
    keys_by_number = {key.rpartition("sigma_")[2]: key for key_names in keys.values() for key in key_names}
    sigma = {name: attrgetter(keys_by_number[name])(case.spec) for name in plots.columns if name in keys_by_number}
    random = RandomSource(noise_key(case, RANDOM_STREAM))
    return World(plots.t_s, tuple(plots.columns), sigma, components, case.keys, case.name, random)


def plots_for_filter(world: World, plots: "SimulatedPlots") -> Plots:
    """Plots as a filter sees them: copies of arrays and keys, which it may change."""
    columns = {name: np.array(values, order="C") for name, values in plots.columns.items()}  # as C code takes them
    random = None if world.random is None else RandomSource(world.random.key)
    world = replace(world, t_s=np.array(world.t_s), keys=deepcopy(world.keys), random=random)
    return Plots(np.array(plots.t_s), columns, world, plots.first, plots.n)

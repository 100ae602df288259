"""Plots of a step study's realisations: as its filters take them, and as arrays with the truth."""

from typing import TYPE_CHECKING

import numpy as np

from radarsim.studies.plot_arrays import DrawPlots, SimulatedPlots, true_column

if TYPE_CHECKING:
    from radarsim.studies.step_plan import Plan
    from radarsim.studies.stepwise import StepStudy

MAX_ROWS = 20_000  # rows of plots and errors at once, 1.3 MB: fits a processor's cache


def draw_plots(plan: "Plan", first: int, groups: int) -> np.ndarray:
    """Truth and plots (groups × K × rows × 8, flat) of realisations from `first` on, see `radarsim.kernels.steps`."""
    from radarsim.kernels.compiler import aligned_zeros
    from radarsim.kernels.lanes import WIDTH
    from radarsim.kernels.steps import STRIP

    scene = plan.scene
    rows = scene.rows, STRIP * scene.pairs, STRIP * scene.pairs, 2, 2 * scene.uniform_pairs
    room = [aligned_zeros(n * WIDTH) for n in rows]
    plots = aligned_zeros(groups * plan.axes.k.size * scene.plot_rows * WIDTH)
    plan.draw(plan.keys, first, groups, plan.known_quantities, plan.width, plan.numbers, plan.detection, *room, plots)
    return plots


def prepare_drawing(study: "StepStudy", plan: "Plan") -> DrawPlots:
    """The function that draws the plots of realisations of a plan."""
    from radarsim.kernels.lanes import WIDTH

    scans, rows, numbers = plan.axes.k.size, plan.scene.plot_rows, len(study.measured)
    components, places = len(study.components), plan.scene.false
    known_quantities = plan.known_quantities.reshape(scans, -1)[:, 1 : 1 + len(study.known_columns)].T
    size = max(1, MAX_ROWS // (scans * rows))

    def draw(first: int, count: int) -> SimulatedPlots:
        groups = -(-count // WIDTH)
        plots = np.empty((rows, scans, groups, WIDTH))
        for start in range(0, groups, size):
            group_count = min(size, groups - start)
            block = draw_plots(plan, first + start * WIDTH, group_count).reshape(group_count, scans, rows, WIDTH)
            plots[:, :, start : start + group_count] = block.transpose(2, 1, 0, 3)
        values = plots.reshape(rows, scans, -1)[..., :count].swapaxes(1, 2)
        truth = values[1 + numbers : 1 + numbers + components].transpose(1, 2, 0)
        measured, false = values[: 1 + numbers], values[1 + numbers + components :]
        if places:
            measured = all_plots(np.stack([measured, *np.split(false, places)], axis=-1))
        measured[1:, measured[0] < 0.5] = np.nan
        columns = dict(zip((number.column for number in study.measured), measured[1:], strict=True))
        columns |= {
            name: np.broadcast_to(row.reshape(-1, *(1,) * bool(places)), measured[0].shape)
            for name, row in zip(study.known_columns, known_quantities, strict=True)
        }
        names = [true_column(*component) for component in plan.axes.components] if places else []
        true_columns = dict(zip(names, np.moveaxis(truth, -1, 0), strict=False))
        return SimulatedPlots(plan.axes.t_s, columns, plan.axes.components, truth, true_columns, first)

    return draw


def all_plots(plots: np.ndarray) -> np.ndarray:
    """The places for plots (1 + measured, n, K, M), with the plots first, by their first number: nothing tells that of
    the target; without places that no scan needs."""
    order = np.argsort(np.where(plots[0] > 0.5, plots[1], np.inf), axis=-1)[..., : int(plots[0].sum(axis=-1).max())]
    return np.take_along_axis(plots, order[None], axis=-1)

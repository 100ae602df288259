"""What one update of each filter takes by the clock: a pass over the study's own plots of eight realisations."""

import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from radarsim.kernels.lanes import WIDTH, rows
from radarsim.studies.multimodel.kernels import plots
from radarsim.studies.multimodel.kernels import strip as strips
from radarsim.studies.multimodel.kernels.hypothesis import OUTPUT, PLOT, work_arrays
from radarsim.studies.multimodel.kernels.sums import START

MOST_SCANS, PASSES = 4096, 5


def seconds_per_update(plan) -> dict[str, float]:
    """CPU seconds of one update of one realisation by filter, outputs included, noise, plots and sums not.

    The least of some passes over the first scans of the flight, in a thread of a pool as kernels run.
    """
    world = plan.world
    count = min(len(world.truth), MOST_SCANS)
    found = rows(count * PLOT)
    plots.fill_plots(world.keys, world.frame, world.plot_truth[:count], START, 0, rows(plots.RANDOM), found)
    with ThreadPoolExecutor(1) as pool:
        seconds = [
            min(pool.submit(_pass, plan, f, found, count).result() for _ in range(PASSES))
            for f in range(len(plan.axes.filters))
        ]
    return {name: s / (WIDTH * (count - START)) for name, s in zip(plan.axes.filters, seconds, strict=True)}


def _pass(plan, f: int, found: np.ndarray, count: int) -> float:
    """CPU seconds of filter f over the scans after the start of its track."""
    world, banks, (work, numbers) = plan.world, plan.banks, work_arrays()
    size = banks.numbers[f, 4]
    strips.start_strip(work, numbers, found, world.weights, banks.probabilities[f, :size])
    out, scans = rows(count * OUTPUT), (found, START, count)
    models, transitions = banks.models[f, : 3 * size], banks.transitions[f]
    started = time.thread_time()
    strips.filter_strip(
        *(work, numbers, *scans, models, transitions, world.intervals, world.times, banks.numbers[f], world.frame),
        *(world.everything, out),
    )
    return time.thread_time() - started

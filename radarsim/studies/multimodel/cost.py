"""The cost of one update of each filter: arithmetic operations counted, and seconds measured by the clock."""

import time
from collections.abc import Sequence
from functools import partial

import numpy as np

from radarsim.studies.multimodel import model_bank
from radarsim.studies.multimodel.config import Filter
from radarsim.studies.multimodel.kernels.layout import MODEL_NUMBERS, OUTPUT, PLOT, SIZE, START
from radarsim.studies.multimodel.study import Plan
from radarsim.system.threads import mapping

# Additions, subtractions, multiplications, divisions, roots and exponentials of one step, all three axes, counted on
# the formulas of `radarsim.kernels.kalman_algebra` and `kernels.hypothesis` (a test counts them again); PREDICT,
# UPDATE by whether the model accelerates: the zeros of one that does not are left out.
PREDICT, UPDATE = {True: 282, False: 99}, {True: 456, False: 267}
LIKELIHOOD, MERGE, MERGE_ONCE = 8, 208, -9

MAX_SCANS, PASSES = 4096, 5  # of the measurement by the clock


def model_counts(family: str, transition: np.ndarray, merged_first: bool = True) -> tuple[np.ndarray, np.ndarray]:
    """Predictions and updates (M,) of each model in a scan, by the changes that transition (M, M) allows.

    merged_first: in the family imm hypotheses are merged before a model predicts them, not after."""
    sources, single = np.count_nonzero(transition, axis=1), np.ones(len(transition), dtype=int)
    if family == "gpb2":
        return sources, sources
    return (sources if family == "imm" and not merged_first else single), single


def operations(
    family: str, transition: np.ndarray, accelerates: Sequence[bool], merged_first: bool = True
) -> tuple[float, float, float]:
    """Arithmetic operations of one scan: fixed ones, those per merged hypothesis, and those per merge.

    transition (M, M); accelerates (M,): whether each model has an acceleration. A merge of a single hypothesis is a
    copy and costs nothing."""
    size, (predictions, updates) = len(transition), model_counts(family, transition, merged_first)
    models = zip(predictions, updates, accelerates, strict=True)
    prediction_and_update = sum(m * PREDICT[bool(a)] + n * UPDATE[bool(a)] for m, n, a in models)
    mixing = size * (2 * size - 1) if size > 1 else 0
    likelihoods = updates.sum() * LIKELIHOOD if size > 1 else 0
    return float(prediction_and_update + likelihoods + mixing), MERGE, MERGE_ONCE


def operations_of(options: Filter, merged_first: bool = True) -> tuple[float, float, float]:
    """`operations` of a filter of a config."""
    accelerates = [model_bank.MOTIONS[model.motion][1] > 0 for model in options.models]
    return operations(options.family, model_bank.transition_matrix(options.transition), accelerates, merged_first)


def seconds_per_update(plan: Plan) -> dict[str, float]:
    """CPU seconds of one update of one realisation by each filter, with outputs, without noise, plots and sums.

    The smallest of several passes over the first scans of the flight, in a thread of a pool, as kernels run, or in the
    current one if threads are forbidden."""
    from radarsim.kernels.lanes import WIDTH, rows
    from radarsim.studies.multimodel.kernels import plots as kernels_plots

    world = plan.world
    count = min(len(world.truth), MAX_SCANS)
    plots = rows(count * PLOT)
    kernels_plots.fill_plots(
        world.keys, world.frame, world.plot_truth[:count], START, 0, rows(kernels_plots.RANDOM), plots
    )
    with mapping(1) as parallel_map:
        seconds = [
            min(parallel_map(partial(_seconds, plan, f, plots), [count] * PASSES))
            for f in range(len(plan.axes.filters))
        ]
    return {name: s / (WIDTH * (count - START)) for name, s in zip(plan.axes.filters, seconds, strict=True)}


def _seconds(plan: Plan, f: int, plots: np.ndarray, count: int) -> float:
    """CPU seconds of filter f over the scans after the start of its track."""
    from radarsim.kernels.lanes import rows
    from radarsim.studies.multimodel.kernels import filter_strip, hypothesis

    world, banks, (work, numbers) = plan.world, plan.banks, hypothesis.work_arrays()
    size = banks.numbers[f, SIZE]
    filter_strip.start_strip(work, numbers, plots, world.weights, banks.probabilities[f, :size])
    out, scans = rows(count * OUTPUT), (plots, START, count)
    models, transitions = banks.models[f, : MODEL_NUMBERS * size], banks.transitions[f]
    start_time = time.thread_time()
    filter_strip.filter_strip(
        *(work, numbers, *scans, models, transitions, world.intervals, world.times, banks.numbers[f], world.frame),
        *(world.reported, out),
    )
    return time.thread_time() - start_time

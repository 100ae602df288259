"""A block of realisations of the multimodel study: plots, all filters on them, and the sums of what they estimate."""

from typing import NamedTuple

import numpy as np

from radarsim.kernels.compile import inline, kernel, part
from radarsim.kernels.lanes import WIDTH, address, full, get, put, row, rows, total, where_greater
from radarsim.kernels.symmetric import dot, factored, scaled, whitened
from radarsim.studies.multimodel.kernels.hypothesis import (
    INNOVATION,
    MERGES,
    MODELS,
    MOST,
    OUTPUT,
    PLOT,
    POSITION,
    VARIANCE,
    WORK,
)
from radarsim.studies.multimodel.kernels.plots import RANDOM, STRIP, draw_strip, make_plots
from radarsim.studies.multimodel.kernels.strip import run_strip, start

START = 3  # plots that a track is started from
STAGE = 14  # rows of a stage: sums of nine squared errors, NEES, NIS, hypotheses merged, merges; number of plots
MEANS, NEES, NIS, PLOTS = 13, 9, 10, 13


@inline
def believed_error(out, e):
    """e' P⁻¹ e of the position (3), with the covariance that the filter believes."""
    p = (
        get(out, VARIANCE),
        get(out, POSITION),
        get(out, POSITION + 1),
        get(out, VARIANCE + 3),
        get(out, POSITION + 2),
        get(out, VARIANCE + 6),
    )
    lower, i, _ = factored(p)
    e = whitened(e, lower)
    return dot(scaled(e, i), e)


@part
def add_scan(out, base, truth, counted, kept, error, paired, probability, believed):
    """Add a reported scan of eight realisations to the sums, all by addresses of that filter and scan.

    out, base: outputs of the filter and of the baseline; truth (9,); counted (lanes): 1 for the realisations that
    count.
    """
    for c in range(9):
        e, b = counted * (get(out, c) - truth[c]), get(base, c) - truth[c]
        e2 = e * e
        error[4 * c] += total(e)
        error[4 * c + 1] += total(e2)
        error[4 * c + 2] += total(e2 * e)
        error[4 * c + 3] += total(e2 * e2)
        paired[c] += total(e2 * (b * b))
    for i in range(kept):
        p = counted * get(out, MODELS + i)
        probability[2 * i] += total(p)
        probability[2 * i + 1] += total(p * p)
    e = get(out, 0) - truth[0], get(out, 3) - truth[3], get(out, 6) - truth[6]
    q = counted * believed_error(out, e)
    believed[0] += total(q)
    believed[1] += total(q * q)


@part
def add_to_stage(out, plot, truth, everything, stage):
    """Add a scan to the rows of its stage: squared errors and NIS; NEES where `everything` is known."""
    for c in range(9):
        e = get(out, c) - truth[c]
        put(stage, c, get(stage, c) + e * e)
    detected = get(plot, 9)
    put(stage, NIS, get(stage, NIS) + detected * get(out, INNOVATION))
    put(stage, PLOTS, get(stage, PLOTS) + detected)
    for i in range(2):
        put(stage, NIS + 1 + i, get(stage, NIS + 1 + i) + get(out, MERGES + i))
    if everything:
        e = get(out, 0) - truth[0], get(out, 3) - truth[3], get(out, 6) - truth[6]
        put(stage, NEES, get(stage, NEES) + believed_error(out, e))


@part
def close_stages(stages, filters, count, lengths, counted, sums, pairs):
    """Add each realisation's means over each stage to the sums, and the products of all pairs of filters.

    stages: rows of all filters, STAGE for each stage; lengths (count, 2): scans of a stage, and those with covariances;
    sums (F, S, MEANS, 2): of nine squared errors, NEES, NIS, hypotheses merged, merges; pairs (F, F, S, 9).
    """
    for s in range(count):
        for f in range(filters):
            own = row(stages, (f * count + s) * STAGE)
            for c in range(MEANS):
                length = full(max(lengths[2 * s + (1 if c == NEES else 0)], 1.0))
                if c == NIS:
                    length = where_greater(get(own, PLOTS), full(0.5), get(own, PLOTS), full(1.0))
                put(own, c, get(own, c) / length)
        for f in range(filters):
            own, at = row(stages, (f * count + s) * STAGE), f * count + s
            for c in range(MEANS):
                x = counted * get(own, c)
                sums[(at * MEANS + c) * 2] += total(x)
                sums[(at * MEANS + c) * 2 + 1] += total(x * x)
            for g in range(filters):
                other, at = row(stages, (g * count + s) * STAGE), (f * filters + g) * count + s
                for c in range(9):
                    pairs[at * 9 + c] += total(counted * get(own, c) * get(other, c))


@inline
def clear(rows, count):
    """Set `count` rows to zero."""
    for n in range(count):
        put(rows, n, full(0.0))


class World(NamedTuple):
    """What all filters share, K scans.

    keys (2, 2)            streams of noise and of detections
    frame                  sensor, see `multimodel_plots.frame`
    plot_truth (K, 8)      see `multimodel_plots.make_plots`; truth (K, 9): the state
    intervals (K,)         number of each scan's interval since the last one; times (U,): the intervals, s
    everything, place (K,) whether a scan is reported, and its place among those
    stage (K,)             stage of a scan; lengths (S, 2): see `close_stages`
    weights (9,)           start of the track, see `multimodel_strip.start`
    """

    keys: np.ndarray
    frame: np.ndarray
    plot_truth: np.ndarray
    truth: np.ndarray
    intervals: np.ndarray
    times: np.ndarray
    everything: np.ndarray
    place: np.ndarray
    stage: np.ndarray
    lengths: np.ndarray
    weights: np.ndarray


class Banks(NamedTuple):
    """The filters, rows padded to eights.

    numbers (F, 8)         family, merging rule, output rule, covariance at the prediction, number of models
    models (F, 16), transitions (F, …), probabilities (F, 8): see `multimodel_strip.run_strip`
    """

    numbers: np.ndarray
    models: np.ndarray
    transitions: np.ndarray
    probabilities: np.ndarray


class Memory(NamedTuple):
    """Memory of one thread: rows, and whole numbers."""

    works: np.ndarray
    random: np.ndarray
    plots: np.ndarray
    out: np.ndarray
    stages: np.ndarray
    counted: np.ndarray
    numbers: np.ndarray
    listed: np.ndarray


class MultimodelSums(NamedTuple):
    """Sums over realisations, K' reported scans, S stages.

    error (F, K', 9, 4): e, e², e³, e⁴; paired (F, K', 9): with the baseline's e²; probability (F, K', MOST, 2);
    believed (F, K', 2): NEES; stage (F, S, MEANS, 2): means over the stage of nine squared errors, NEES, NIS,
    hypotheses merged, merges; pairs (F, F, S, 9): of the mean squares of two filters.
    """

    error: np.ndarray
    paired: np.ndarray
    probability: np.ndarray
    believed: np.ndarray
    stage: np.ndarray
    pairs: np.ndarray


def memory(filters: int, stages: int) -> Memory:
    """Memory for a number of filters and of stages."""
    return Memory(
        rows(filters * WORK),
        rows(RANDOM),
        rows(STRIP * PLOT),
        rows(filters * STRIP * OUTPUT),
        rows(filters * stages * STAGE),
        rows(1),
        np.zeros((filters, 8), dtype=np.int64),
        np.zeros(MOST, dtype=np.int64),
    )


@kernel
def simulate_block(world, banks, memory, sums, baseline, first, count):
    """Add the realisations first … first + count - 1 to the sums; gains are against the filter `baseline`."""
    filters, scans, stages = banks.numbers.shape[0], world.truth.shape[0], world.lengths.shape[0]
    padded = banks.transitions.shape[1] // WIDTH
    for group in range(0, count, WIDTH):
        for n in range(WIDTH):
            memory.counted[n] = 1.0 if group + n < count else 0.0
        clear(address(memory.stages), filters * stages * STAGE)
        for k in range(0, scans, STRIP):
            length, begin = min(STRIP, scans - k), START if k == 0 else 0
            draw_strip(world.keys, first + group, k // STRIP, memory.random)
            plots, frame, held = address(memory.plots), address(world.frame), address(memory.numbers)
            make_plots(address(memory.random), frame, address(world.plot_truth), k, length, START, plots)
            for f in range(filters):
                work, size = row(address(memory.works), f * WORK), banks.numbers[f, 4]
                if k == 0:
                    chances = row(address(banks.probabilities), f)
                    start(work, row(held, f), size, plots, address(world.weights), chances)
                run_strip(
                    work,
                    row(held, f),
                    address(memory.listed),
                    plots,
                    begin,
                    length,
                    size,
                    row(address(banks.models), 2 * f),
                    row(address(banks.transitions), padded * f),
                    address(world.intervals[k:]),
                    address(world.times),
                    row(address(banks.numbers), f),
                    frame,
                    address(world.everything[k:]),
                    row(address(memory.out), f * STRIP * OUTPUT),
                )
            add_strip(world, banks, memory, sums, baseline, k, begin, length)
        close_stages(
            address(memory.stages),
            filters,
            stages,
            address(world.lengths),
            get(address(memory.counted), 0),
            address(sums.stage),
            address(sums.pairs),
        )


@inline
def add_strip(world, banks, memory, sums, baseline, k, begin, length):
    """Add the outputs of all filters over a strip that starts at scan k."""
    stages = world.lengths.shape[0]
    base = row(address(memory.out), baseline * STRIP * OUTPUT)
    counted = get(address(memory.counted), 0)
    for f in range(banks.numbers.shape[0]):
        for n in range(begin, length):
            out, truth = row(address(memory.out), (f * STRIP + n) * OUTPUT), address(world.truth[k + n])
            stage = row(address(memory.stages), (f * stages + world.stage[k + n]) * STAGE)
            add_to_stage(out, row(address(memory.plots), n * PLOT), truth, world.everything[k + n] == 1, stage)
            if world.everything[k + n] == 1:
                place = world.place[k + n]
                add_scan(
                    out,
                    row(base, n * OUTPUT),
                    truth,
                    counted,
                    banks.numbers[f, 4],
                    address(sums.error[f, place]),
                    address(sums.paired[f, place]),
                    address(sums.probability[f, place]),
                    address(sums.believed[f, place]),
                )

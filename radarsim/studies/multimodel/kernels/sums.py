"""A block of realisations of the multimodel study: plots, all filters on them, and the sums of what they estimate.

Letters, each of eight lanes:

    e          error of an estimate, by state (9), or of its position (3)
    e0         the same of the baseline filter
    p          probability of a model
    q          e' P⁻¹ e of the position, with the covariance that the filter believes
    counted    1 for the realisations that count, 0 for those beyond the block's last

Arrays and their shapes: `records.World`, `Banks`, `Sums`; arguments that are not these are addresses or numbers.
"""

from typing import NamedTuple

import numpy as np

from radarsim.kernels.algebra import dot, factored, scaled, whitened
from radarsim.kernels.compile import inline, kernel, part
from radarsim.kernels.lanes import WIDTH, address, full, get, put, row, rows, total, where_greater
from radarsim.studies.multimodel.kernels import records as rec
from radarsim.studies.multimodel.kernels import strip
from radarsim.studies.multimodel.kernels.plots import RANDOM, STRIP, draw_strip, make_plots
from radarsim.studies.multimodel.kernels.strip import Filter, Scans, rules_of, run_strip, start


class Memory(NamedTuple):
    """Memory of one thread for eight realisations: rows, and whole numbers.

    works      WORK rows of each filter; numbers (F, 8), listed (MOST,): its whole numbers, see `strip.Memory`
    random     RANDOM rows; plots: PLOT rows a scan of a strip; out: OUTPUT rows a filter and scan of a strip
    stages     STAGE rows a filter and stage
    counted    one row
    """

    works: np.ndarray
    random: np.ndarray
    plots: np.ndarray
    out: np.ndarray
    stages: np.ndarray
    counted: np.ndarray
    numbers: np.ndarray
    listed: np.ndarray


class ScanSums(NamedTuple):
    """The sums of one filter and scan, by addresses: see `records.Sums`."""

    error: np.ndarray
    paired: np.ndarray
    probability: np.ndarray
    believed: np.ndarray


def memory(filters: int, stages: int) -> Memory:
    """Memory for a number of filters and of stages."""
    return Memory(
        works=rows(filters * rec.WORK),
        random=rows(RANDOM),
        plots=rows(STRIP * rec.PLOT),
        out=rows(filters * STRIP * rec.OUTPUT),
        stages=rows(filters * stages * rec.STAGE),
        counted=rows(1),
        numbers=np.zeros((filters, 8), dtype=np.int64),
        listed=np.zeros(rec.MOST, dtype=np.int64),
    )


@inline
def position_error(out, truth):
    """Error of the estimated position (3)."""
    return get(out, 0) - truth[0], get(out, 3) - truth[3], get(out, 6) - truth[6]


@inline
def believed_error(out, e):
    """q = e' P⁻¹ e of the position (3), with the covariance that the filter believes."""
    P = (
        get(out, rec.VARIANCE),
        get(out, rec.POSITION_COVARIANCE),
        get(out, rec.POSITION_COVARIANCE + 1),
        get(out, rec.VARIANCE + 3),
        get(out, rec.POSITION_COVARIANCE + 2),
        get(out, rec.VARIANCE + 6),
    )
    L, i, _ = factored(P)  # P = L D L', i: the diagonal of D⁻¹
    e = whitened(e, L)
    return dot(scaled(e, i), e)


@part
def add_scan(out, base, truth, counted, size, sums):
    """Add a reported scan of eight realisations to the sums of that filter and scan (`ScanSums`).

    out, base: outputs of the filter and of the baseline; truth (9,); size: number of models.
    """
    for c in range(rec.STATES):
        e, e0 = counted * (get(out, c) - truth[c]), get(base, c) - truth[c]
        e2 = e * e
        sums.error[4 * c] += total(e)
        sums.error[4 * c + 1] += total(e2)
        sums.error[4 * c + 2] += total(e2 * e)
        sums.error[4 * c + 3] += total(e2 * e2)
        sums.paired[c] += total(e2 * (e0 * e0))
    for i in range(size):
        p = counted * get(out, rec.MODELS + i)
        sums.probability[2 * i] += total(p)
        sums.probability[2 * i + 1] += total(p * p)
    q = counted * believed_error(out, position_error(out, truth))
    sums.believed[0] += total(q)
    sums.believed[1] += total(q * q)


@part
def add_to_stage(out, plot, truth, reported, stage):
    """Add a scan to the rows of its stage: squared errors, NIS and merges; NEES where `reported`."""
    for c in range(rec.STATES):
        e = get(out, c) - truth[c]
        put(stage, c, get(stage, c) + e * e)
    detected = get(plot, rec.DETECTED)
    put(stage, rec.NIS, get(stage, rec.NIS) + detected * get(out, rec.INNOVATION))
    put(stage, rec.PLOTS, get(stage, rec.PLOTS) + detected)
    for i in range(2):
        put(stage, rec.MERGED + i, get(stage, rec.MERGED + i) + get(out, rec.MERGING + i))
    if reported:
        put(stage, rec.NEES, get(stage, rec.NEES) + believed_error(out, position_error(out, truth)))


@part
def close_stages(stages, filters, count, lengths, counted, sums, pairs):
    """Add each realisation's means over each stage to the sums, and the products of all pairs of filters.

    stages: rows of all filters, STAGE for each of `count` stages; lengths (count, 2): scans of a stage, and the
    reported ones; sums (F, S, MEANS, 2); pairs (F, F, S, 9).
    """
    for s in range(count):
        for f in range(filters):
            own = row(stages, (f * count + s) * rec.STAGE)
            for c in range(rec.MEANS):
                length = full(max(lengths[2 * s + (1 if c == rec.NEES else 0)], 1.0))
                if c == rec.NIS:
                    length = where_greater(get(own, rec.PLOTS), full(0.5), get(own, rec.PLOTS), full(1.0))
                put(own, c, get(own, c) / length)
        for f in range(filters):
            own, at = row(stages, (f * count + s) * rec.STAGE), f * count + s
            for c in range(rec.MEANS):
                x = counted * get(own, c)
                sums[(at * rec.MEANS + c) * 2] += total(x)
                sums[(at * rec.MEANS + c) * 2 + 1] += total(x * x)
            for g in range(filters):
                other, at = row(stages, (g * count + s) * rec.STAGE), (f * filters + g) * count + s
                for c in range(rec.STATES):
                    pairs[at * rec.STATES + c] += total(counted * get(own, c) * get(other, c))


@inline
def clear(first, count):
    """Set `count` rows from the address `first` on to zero."""
    for n in range(count):
        put(first, n, full(0.0))


@kernel
def simulate_block(world, banks, memory, sums, baseline, first, count):
    """Add the realisations first … first + count - 1 to the sums; gains are against the filter `baseline`."""
    filters, scans, stages = banks.numbers.shape[0], world.truth.shape[0], world.lengths.shape[0]
    padded = banks.transitions.shape[1] // WIDTH
    for group in range(0, count, WIDTH):
        for n in range(WIDTH):
            memory.counted[n] = 1.0 if group + n < count else 0.0
        clear(address(memory.stages), filters * stages * rec.STAGE)
        for k in range(0, scans, STRIP):
            length, begin = min(STRIP, scans - k), rec.START if k == 0 else 0
            draw_strip(world.keys, first + group, k // STRIP, memory.random)
            plots, frame = address(memory.plots), address(world.frame)
            make_plots(address(memory.random), frame, address(world.plot_truth), k, length, rec.START, plots)
            # This loop is written out: as a function of its own it makes LLVM fuse the products in GPB2's merges in
            # another order, and the last bits of the results change.
            for f in range(filters):
                work, numbers = row(address(memory.works), f * rec.WORK), row(address(memory.numbers), f)
                size = banks.numbers[f, rec.SIZE]
                if k == 0:
                    start(work, numbers, size, plots, address(world.weights), row(address(banks.probabilities), f))
                rules = rules_of(row(address(banks.numbers), f), size)
                design = Filter(rules, row(address(banks.models), 2 * f), row(address(banks.transitions), padded * f))
                intervals, reported = address(world.intervals[k:]), address(world.reported[k:])
                span = Scans(begin, length, intervals, address(world.times), reported)
                own = strip.Memory(work, numbers, address(memory.listed))
                run_strip(own, design, span, plots, frame, row(address(memory.out), f * STRIP * rec.OUTPUT))
            add_strip(world, banks, memory, sums, baseline, k, begin, length)
        lengths, counted = address(world.lengths), get(address(memory.counted), 0)
        close_stages(
            address(memory.stages), filters, stages, lengths, counted, address(sums.stage), address(sums.pairs)
        )


@inline
def add_strip(world, banks, memory, sums, baseline, k, begin, length):
    """Add the outputs of all filters over a strip that starts at scan k."""
    stages = world.lengths.shape[0]
    base = row(address(memory.out), baseline * STRIP * rec.OUTPUT)
    counted = get(address(memory.counted), 0)
    for f in range(banks.numbers.shape[0]):
        for n in range(begin, length):
            out, truth = row(address(memory.out), (f * STRIP + n) * rec.OUTPUT), address(world.truth[k + n])
            stage = row(address(memory.stages), (f * stages + world.stage[k + n]) * rec.STAGE)
            reported = world.reported[k + n] == 1
            add_to_stage(out, row(address(memory.plots), n * rec.PLOT), truth, reported, stage)
            if reported:
                place = world.place[k + n]
                places = ScanSums(
                    address(sums.error[f, place]),
                    address(sums.paired[f, place]),
                    address(sums.probability[f, place]),
                    address(sums.believed[f, place]),
                )
                add_scan(out, row(base, n * rec.OUTPUT), truth, counted, banks.numbers[f, rec.SIZE], places)

"""A block of realisations: plots, all filters on them, and the sums of their estimates.

Letters, each of eight lanes:

    e          error of an estimate, by state (9), or of its position (3)
    e0         the same of the baseline filter
    p          probability of a model
    q          e' P⁻¹ e of the position, with the filter's own covariance
    active     1 for realisations of the block, 0 for those beyond its last

Arrays and their shapes: `layout.World`, `layout.Banks`, `layout.Sums`; other arguments are addresses or numbers."""

from typing import NamedTuple

import numpy as np

from radarsim.kernels.compiler import inline, kernel, kernel_part
from radarsim.kernels.kalman_algebra import dot, factorise, scale_row, whiten
from radarsim.kernels.lanes import WIDTH, address, full, get, put, row, rows, total, where_greater
from radarsim.studies.multimodel.kernels import layout
from radarsim.studies.multimodel.kernels.filter_strip import Scans, make_rules, run_strip, start_track
from radarsim.studies.multimodel.kernels.plots import RANDOM, STRIP, draw_strip, make_plots


class BlockMemory(NamedTuple):
    """Memory of one thread for eight realisations: rows, and whole numbers."""

    works: np.ndarray  #: WORK rows of each filter
    random: np.ndarray  #: RANDOM rows
    plots: np.ndarray  #: PLOT rows a scan of a strip
    out: np.ndarray  #: OUTPUT rows a filter and scan of a strip
    stages: np.ndarray  #: STAGE rows a filter and stage
    active: np.ndarray  #: one row
    numbers: np.ndarray  #: (F, 8) whole numbers of each filter, see `run_strip`
    listed: np.ndarray  #: (MAX_MODELS,) see `run_strip`
    errors: np.ndarray  #: (F, K', 9, n or 0) errors of all realisations of a block, n a multiple of eight


def block_memory(filters: int, stages: int, scans: int = 0, kept_realisations: int = 0) -> BlockMemory:
    """Allocate memory for filters and stages, and for the errors of realisations at reported scans if they are kept."""
    return BlockMemory(
        works=rows(filters * layout.WORK),
        random=rows(RANDOM),
        plots=rows(STRIP * layout.PLOT),
        out=rows(filters * STRIP * layout.OUTPUT),
        stages=rows(filters * stages * layout.STAGE),
        active=rows(1),
        numbers=np.zeros((filters, 8), dtype=np.int64),
        listed=np.zeros(layout.MAX_MODELS, dtype=np.int64),
        errors=rows(filters * scans * layout.STATES * (-(-kept_realisations // WIDTH))).reshape(
            filters, scans, layout.STATES, -1
        ),
    )


@inline
def position_error(out, truth):
    """Error of the estimated position (3)."""
    return get(out, 0) - truth[0], get(out, 3) - truth[3], get(out, 6) - truth[6]


@inline
def believed_error(out, e):
    """q = e' P⁻¹ e of the position (3), with the filter's own covariance."""
    P = (
        get(out, layout.VARIANCE),
        get(out, layout.POSITION_COVARIANCE),
        get(out, layout.POSITION_COVARIANCE + 1),
        get(out, layout.VARIANCE + 3),
        get(out, layout.POSITION_COVARIANCE + 2),
        get(out, layout.VARIANCE + 6),
    )
    L, i, _ = factorise(P)  # P = L D L', i: the diagonal of D⁻¹
    e = whiten(e, L)
    return dot(scale_row(e, i), e)


@kernel_part
def add_scan(out, baseline, truth, active, size, sums):
    """Add a reported scan of eight realisations to the sums of a filter and scan.

    sums: addresses of error, paired, probability, believed; out, baseline: outputs of the filter and of the baseline;
    truth (9,); size: number of models."""
    error, paired, probability, believed = sums
    for c in range(layout.STATES):
        e, e0 = active * (get(out, c) - truth[c]), get(baseline, c) - truth[c]
        e2 = e * e
        error[4 * c] += total(e)
        error[4 * c + 1] += total(e2)
        error[4 * c + 2] += total(e2 * e)
        error[4 * c + 3] += total(e2 * e2)
        paired[c] += total(e2 * (e0 * e0))
    for i in range(size):
        p = active * get(out, layout.MODELS + i)
        probability[2 * i] += total(p)
        probability[2 * i + 1] += total(p * p)
    q = active * believed_error(out, position_error(out, truth))
    believed[0] += total(q)
    believed[1] += total(q * q)


@kernel_part
def add_to_stage(out, plot, truth, reported, stage):
    """Add a scan to the rows of its stage: squared errors, NIS and merges; NEES where `reported`."""
    for c in range(layout.STATES):
        e = get(out, c) - truth[c]
        put(stage, c, get(stage, c) + e * e)
    detected = get(plot, layout.DETECTED)
    put(stage, layout.NIS, get(stage, layout.NIS) + detected * get(out, layout.INNOVATION))
    put(stage, layout.PLOTS, get(stage, layout.PLOTS) + detected)
    for i in range(2):
        put(stage, layout.MERGED + i, get(stage, layout.MERGED + i) + get(out, layout.MERGING + i))
    if reported:
        put(stage, layout.NEES, get(stage, layout.NEES) + believed_error(out, position_error(out, truth)))


@kernel_part
def close_stages(stages, filters, count, lengths, active, sums, pairs):
    """Add each realisation's means over each stage to the sums, and the products of all pairs of filters.

    stages: rows of all filters, STAGE for each of `count` stages; lengths (count, 2): scans of a stage, and the
    reported ones; sums (F, S, MEANS, 2); pairs (F, F, S, 9)."""
    for s in range(count):
        for f in range(filters):
            stage = row(stages, (f * count + s) * layout.STAGE)
            for c in range(layout.MEANS):
                length = full(max(lengths[2 * s + (1 if c == layout.NEES else 0)], 1.0))
                if c == layout.NIS:
                    length = where_greater(get(stage, layout.PLOTS), full(0.5), get(stage, layout.PLOTS), full(1.0))
                put(stage, c, get(stage, c) / length)
        for f in range(filters):
            stage, offset = row(stages, (f * count + s) * layout.STAGE), f * count + s
            for c in range(layout.MEANS):
                x = active * get(stage, c)
                sums[(offset * layout.MEANS + c) * 2] += total(x)
                sums[(offset * layout.MEANS + c) * 2 + 1] += total(x * x)
            for g in range(filters):
                other_stage, offset = row(stages, (g * count + s) * layout.STAGE), (f * filters + g) * count + s
                for c in range(layout.STATES):
                    pairs[offset * layout.STATES + c] += total(active * get(stage, c) * get(other_stage, c))


@inline
def clear_rows(first, count):
    """Set `count` rows from the address `first` on to zero."""
    for n in range(count):
        put(first, n, full(0.0))


@kernel
def simulate_block(world, banks, memory, sums, baseline, first, count):
    """Add the realisations first … first + count - 1 to the sums; gains are relative to the filter `baseline`."""
    filters, scans, stages = banks.numbers.shape[0], world.truth.shape[0], world.lengths.shape[0]
    padded = banks.transitions.shape[1] // WIDTH
    for group in range(0, count, WIDTH):
        for n in range(WIDTH):
            memory.active[n] = 1.0 if group + n < count else 0.0
        clear_rows(address(memory.stages), filters * stages * layout.STAGE)
        for k in range(0, scans, STRIP):
            length, begin = min(STRIP, scans - k), layout.START if k == 0 else 0
            draw_strip(world.keys, first + group, k // STRIP, memory.random)
            plots, frame = address(memory.plots), address(world.frame)
            make_plots(address(memory.random), frame, address(world.plot_truth), k, length, layout.START, plots)
            # This loop is not a function: as one, LLVM fuses the products in GPB2's merges in another order, which
            # changes the last bits of the results.
            for f in range(filters):
                work, numbers = row(address(memory.works), f * layout.WORK), row(address(memory.numbers), f)
                size = banks.numbers[f, layout.SIZE]
                if k == 0:
                    start_track(
                        work, numbers, size, plots, address(world.weights), row(address(banks.probabilities), f)
                    )
                rules = make_rules(row(address(banks.numbers), f), size)
                filter_arrays = rules, row(address(banks.models), 2 * f), row(address(banks.transitions), padded * f)
                intervals, reported = address(world.intervals[k:]), address(world.reported[k:])
                strip_scans = Scans(begin, length, intervals, address(world.times), reported)
                out = row(address(memory.out), f * STRIP * layout.OUTPUT)
                run_strip(work, numbers, address(memory.listed), *filter_arrays, strip_scans, plots, frame, out)
            add_strip(world, banks, memory, sums, baseline, k, begin, length)
            if memory.errors.shape[3] > 0:
                keep_errors(world, memory, k, begin, length, group // WIDTH)
        lengths, active = address(world.lengths), get(address(memory.active), 0)
        close_stages(address(memory.stages), filters, stages, lengths, active, address(sums.stage), address(sums.pairs))


@inline
def add_strip(world, banks, memory, sums, baseline, k, begin, length):
    """Add the outputs of all filters over a strip that starts at scan k."""
    stages = world.lengths.shape[0]
    baseline_outputs = row(address(memory.out), baseline * STRIP * layout.OUTPUT)
    active = get(address(memory.active), 0)
    for f in range(banks.numbers.shape[0]):
        for n in range(begin, length):
            out, truth = row(address(memory.out), (f * STRIP + n) * layout.OUTPUT), address(world.truth[k + n])
            stage = row(address(memory.stages), (f * stages + world.stage[k + n]) * layout.STAGE)
            reported = world.reported[k + n] == 1
            add_to_stage(out, row(address(memory.plots), n * layout.PLOT), truth, reported, stage)
            if reported:
                s, size = world.report_index[k + n], banks.numbers[f, layout.SIZE]
                error_sums = address(sums.error[f, s]), address(sums.paired[f, s])
                scan_sums = *error_sums, address(sums.probability[f, s]), address(sums.believed[f, s])
                add_scan(out, row(baseline_outputs, n * layout.OUTPUT), truth, active, size, scan_sums)


@kernel_part
def keep_errors(world, memory, k, begin, length, group):
    """Store the errors of all filters at the reported scans of a strip from scan k on, for eight realisations."""
    filters, scans, states, padded_count = memory.errors.shape
    for f in range(filters):
        for n in range(begin, length):
            if world.reported[k + n] == 1:
                out, truth = row(address(memory.out), (f * STRIP + n) * layout.OUTPUT), address(world.truth[k + n])
                first_row = (f * scans + world.report_index[k + n]) * states * (padded_count // WIDTH) + group
                for c in range(states):
                    put(address(memory.errors), first_row + c * (padded_count // WIDTH), get(out, c) - truth[c])

"""A strip of scans with one filter: the track's start, models over the real interval, missed plots, outputs.

Letters, each of eight lanes but for the numbers i, j of models:

    dt            time of a prediction, s: since the previous plot
    F, Q          a model over it, eq. (11); F (5) and Q (6) of one axis, the same for all three
    T[i, j]       probability of passing from model j to model i over it, eq. (8)
    a, b, g (3)   weights of a track's start: x = Σ a z, v = Σ b z, and errors of the states by an acceleration
    R             covariance of a plot (6)

`work`, `plots`, `out` and the like are addresses."""

from typing import NamedTuple

import numpy as np

from radarsim.kernels import lanes
from radarsim.kernels.compiler import inline, kernel, kernel_part
from radarsim.kernels.lane_matrices import get3, put3
from radarsim.kernels.lanes import address, full, get, put, row, where_greater
from radarsim.studies.multimodel.kernels import layout
from radarsim.studies.multimodel.kernels.hypothesis import merge, mixed_mean
from radarsim.studies.multimodel.kernels.layout import Rules
from radarsim.studies.multimodel.kernels.merging_rules import put_shares
from radarsim.studies.multimodel.kernels.multimodel_filters import merge_gpb1, step
from radarsim.studies.multimodel.kernels.plots import noise_at_prediction


class Scans(NamedTuple):
    """The scans first … stop - 1 of a strip."""

    first: int
    stop: int
    intervals: np.ndarray  #: address, (scans,): number of each scan's interval since the previous scan
    times: np.ndarray  #: address, (U,): the intervals, s
    reported: np.ndarray  #: address, (scans,): 1 where covariances are needed


@inline
def prepare_model(work, first_row, moves, accelerates, sigma, dt):
    """Write F and Q = G sigma² G' over dt from row `first_row` on (eq. 11), G = (dt² / 2, moves dt, accelerates)'.

    moves, accelerates (0 or 1): whether the model has a velocity, an acceleration; sigma of it per step, m/s²."""
    half_square, variance = 0.5 * dt * dt, sigma * sigma
    g0, g1 = half_square, moves * dt
    put3(work, first_row, (g1, accelerates * half_square, full(moves)))
    put(work, first_row + 3, accelerates * dt)
    put(work, first_row + 4, full(accelerates))
    first_row += layout.MODEL_Q
    put3(work, first_row, (variance * (g0 * g0), variance * (g0 * g1), (variance * accelerates) * g0))
    put3(work, first_row + 3, (variance * (g1 * g1), (variance * accelerates) * g1, full(variance * accelerates)))


@kernel_part
def prepare_step(work, size, models, transitions, interval, dt, none_waiting):
    """Write models and transition probabilities over the time since each lane's previous plot.

    interval is the number of the interval dt since the previous scan; if lanes still wait for a plot,
    T(a + b) = T(a) T(b), eq. (8)."""
    first = interval * size * size
    wait = full(dt)
    if not none_waiting:
        wait = wait + get(work, layout.WAIT)
    put(work, layout.WAIT, wait)
    for i in range(size):
        m = layout.MODEL_NUMBERS * i
        prepare_model(work, layout.MODEL + layout.MODEL_ROWS * i, models[m], models[m + 1], models[m + 2], wait)
    for j in range(size):
        for i in range(size):
            c = full(transitions[first + i * size + j])
            if not none_waiting:
                c = full(0.0)
                for n in range(size):
                    c = c + transitions[first + i * size + n] * get(work, layout.TRANSITION + n * layout.MAX_MODELS + j)
            put(work, layout.WEIGHT + i, c)
        for i in range(size):
            put(work, layout.TRANSITION + i * layout.MAX_MODELS + j, get(work, layout.WEIGHT + i))


@kernel_part
def keep_missed(work, old, new, size, detected):
    """Keep the old bank and its wait where the plot was missed: the next prediction starts again from the previous
    plot."""
    threshold = full(0.5)
    for i in range(size):
        for r in range(i * layout.HYPOTHESIS, i * layout.HYPOTHESIS + layout.PROBABILITY + 1):
            put(work, new + r, where_greater(detected, threshold, get(work, new + r), get(work, old + r)))
        for j in range(size):
            r = layout.TRANSITION + i * layout.MAX_MODELS + j
            put(work, r, where_greater(detected, threshold, full(1.0 if i == j else 0.0), get(work, r)))
    put(work, layout.WAIT, where_greater(detected, threshold, full(0.0), get(work, layout.WAIT)))


@kernel_part
def put_output(work, listed, bank, rules, reported, out):
    """Merge a bank by the output rule into the rows at `out`, see OUTPUT.

    Variances, covariances and probabilities are written only if `reported`; the rows from MERGING on are written at the
    end of the scan."""
    size = rules.size
    for j in range(size):
        put(work, layout.WEIGHT + j, get(work, bank + j * layout.HYPOTHESIS + layout.PROBABILITY))
    count = put_shares(work, listed, bank, size, full(1.0), full(0.0), rules.output)
    put(out, layout.INNOVATION, get(work, layout.MAIN_INNOVATION))
    if not reported:
        for axis in range(3):
            put3(out, 3 * axis, mixed_mean(listed, count, row(work, layout.SHARE), row(work, layout.MEAN + 3 * axis)))
        return
    merge(work, listed, count, row(work, layout.SPARE))
    for axis in range(3):
        block = layout.SPARE + layout.OWN + 6 * axis
        put3(out, 3 * axis, get3(work, layout.SPARE + layout.MEAN + 3 * axis))
        put3(out, layout.VARIANCE + 3 * axis, (get(work, block), get(work, block + 3), get(work, block + 5)))
        put(out, layout.POSITION_COVARIANCE + axis, get(work, layout.SPARE + layout.CROSS + 9 * axis))
    for j in range(size):
        put(out, layout.MODELS + j, get(work, bank + j * layout.HYPOTHESIS + layout.PROBABILITY))


@kernel_part
def start_track(work, numbers, size, plots, weights, probabilities):
    """Write the first bank, the same hypothesis for all models, from the plots of the first START scans.

    weights (9,): a (3) and b (3), by which the coordinate and the velocity at the third plot follow from the three
    coordinates; g (3), the errors that an acceleration of one standard deviation causes in the three states.
    probabilities (size,): of the models at the start."""
    for e in range(6):
        start_block(work, e, plots, weights)
    for axis in range(3):
        x, v = full(0.0), full(0.0)
        for k in range(layout.START):
            z = get(plots, k * layout.PLOT + axis)
            x, v = x + weights[k] * z, v + weights[3 + k] * z
        put3(work, layout.MEAN + 3 * axis, (x, v, full(0.0)))
    for i in range(size):
        put(work, i * layout.HYPOTHESIS + layout.PROBABILITY, full(probabilities[i]))
        for r in range(layout.PROBABILITY):
            put(work, i * layout.HYPOTHESIS + r, get(work, r))
    for r in range(layout.STATES):
        put(work, layout.ESTIMATE + r, get(work, layout.MEAN + r))
    numbers[layout.CURRENT], numbers[layout.PREPARED], numbers[layout.NONE_WAITING] = 0, -1, 1


@inline
def start_block(work, e, plots, weights):
    """Write the block of the first covariance for element e of R (xx, xy, xz, yy, yz, zz).

    It is Σ (a, b)' (a, b) R, plus g g' on the diagonal."""
    aa, ab, bb = full(0.0), full(0.0), full(0.0)
    for k in range(layout.START):
        R = get(plots, k * layout.PLOT + layout.COVARIANCE + e)
        aa = aa + (weights[k] * weights[k]) * R
        ab = ab + (weights[k] * weights[3 + k]) * R
        bb = bb + (weights[3 + k] * weights[3 + k]) * R
    if e == 0 or e == 3 or e == 5:
        block, g0, g1, g2 = layout.OWN + (0 if e == 0 else (6 if e == 3 else 12)), weights[6], weights[7], weights[8]
        put3(work, block, (aa + g0 * g0, ab + g0 * g1, full(g0 * g2)))
        put3(work, block + 3, (bb + g1 * g1, full(g1 * g2), full(g2 * g2)))
    else:
        block, zero = layout.CROSS + 9 * (e - 1 if e < 3 else 2), full(0.0)
        put3(work, block, (aa, ab, zero))
        put3(work, block + 3, (ab, bb, zero))
        put3(work, block + 6, (zero, zero, zero))


@kernel_part
def run_strip(work, numbers, listed, rules, models, transitions, scans, plots, frame, out):
    """Run one filter over scans, see `Scans`; all arguments are addresses.

    work: rows (WORK,); numbers: CURRENT … NONE_WAITING; listed: MAX_MODELS whole numbers; models (size * 3,): moves,
    accelerates (0 or 1), sigma of the acceleration per step in m/s²; transitions (U * size * size,): T over each
    distinct interval between scans, row by row; plots: PLOT rows a scan; frame: of the sensor, for the covariance at
    the prediction; out: OUTPUT rows a scan."""
    for k in range(scans.first, scans.stop):
        plot, interval, output = row(plots, k * layout.PLOT), scans.intervals[k], row(out, k * layout.OUTPUT)
        noise, detected = row(plot, layout.COVARIANCE), get(plot, layout.DETECTED)
        if numbers[layout.PREPARED] != interval or numbers[layout.NONE_WAITING] == 0:
            dt, none_waiting = scans.times[interval], numbers[layout.NONE_WAITING] == 1
            prepare_step(work, rules.size, models, transitions, interval, dt, none_waiting)
            numbers[layout.PREPARED] = interval
        if rules.at_prediction == 1:
            noise = row(work, layout.NOISE)
            noise_at_prediction(
                frame, row(work, layout.ESTIMATE), get(work, layout.WAIT), row(plot, layout.COVARIANCE), noise
            )
        put(work, layout.MERGE_COUNTS, full(0.0))
        put(work, layout.MERGE_COUNTS + 1, full(0.0))
        old, new = numbers[layout.CURRENT] * layout.BANK, (1 - numbers[layout.CURRENT]) * layout.BANK
        step(work, listed, old, new, rules, plot, noise)
        put_output(work, listed, new, rules, scans.reported[k] == 1, output)
        if rules.family == layout.GPB1:
            merge_gpb1(work, listed, old, new, rules.size, rules.merge)
        put(output, layout.MERGING, get(work, layout.MERGE_COUNTS))
        put(output, layout.MERGING + 1, get(work, layout.MERGE_COUNTS + 1))
        if rules.at_prediction == 1:
            for i in range(layout.STATES):
                x = get(output, layout.ESTIMATED + i)
                put(work, layout.ESTIMATE + i, where_greater(detected, full(0.5), x, get(work, layout.ESTIMATE + i)))
        if lanes.any_greater(full(0.5), detected):
            keep_missed(work, old, new, rules.size, detected)
            numbers[layout.NONE_WAITING] = 0
        elif numbers[layout.NONE_WAITING] == 0:
            numbers[layout.PREPARED], numbers[layout.NONE_WAITING] = -1, 1
        numbers[layout.CURRENT] = 1 - numbers[layout.CURRENT]


@inline
def make_rules(numbers, size):
    """The rules of a filter from its numbers (FAMILY, MERGE, OUTPUT_RULE, AT_PREDICTION)."""
    return Rules(
        numbers[layout.FAMILY], numbers[layout.MERGE], numbers[layout.OUTPUT_RULE], numbers[layout.AT_PREDICTION], size
    )


@kernel
def filter_strip(work, numbers, plots, first, stop, models, transitions, intervals, times, rules, frame, reported, out):
    """Run one filter over scans, with arrays instead of addresses; see `run_strip`."""
    memory = address(work), address(numbers), address(np.zeros(layout.MAX_MODELS, dtype=np.int64))
    design = make_rules(rules, models.size // layout.MODEL_NUMBERS), address(models), address(transitions)
    scans = Scans(first, stop, address(intervals), address(times), address(reported))
    run_strip(*memory, *design, scans, address(plots), address(frame), address(out))


@kernel
def start_strip(work, numbers, plots, weights, probabilities):
    """Write the first bank, with arrays instead of addresses; see `start_track`."""
    start_track(
        address(work), address(numbers), probabilities.size, address(plots), address(weights), address(probabilities)
    )

"""A strip of scans with one filter: the track's start, models over the real interval, missed plots, outputs."""

import numpy as np

from radarsim.kernels.compile import inline, kernel, part
from radarsim.kernels.lanes import address, any_greater, full, get, put, row, where_greater
from radarsim.studies.multimodel.kernels.filters import GPB1, merge_gpb1, shared, step
from radarsim.studies.multimodel.kernels.hypothesis import (
    BANK,
    CROSS,
    ESTIMATE,
    HYPOTHESIS,
    INNOVATION,
    MEAN,
    MERGED,
    MERGES,
    MODEL,
    MODELS,
    MOST,
    NOISE,
    OUTPUT,
    OWN,
    PLOT,
    POSITION,
    PROBABILITY,
    SHARE,
    SPARE,
    SURPRISE,
    TRANSITION,
    VARIANCE,
    WAIT,
    WEIGHT,
    get3,
    merged,
    mixed_mean,
    put3,
)
from radarsim.studies.multimodel.kernels.plots import noise_at_prediction


@inline
def prepare_model(work, at, moves, bends, sigma, dt):
    """F and Q of eq. (11) over dt (lanes); moves, bends (0 or 1): with velocity, acceleration; sigma of it per step."""
    half, variance = 0.5 * dt * dt, sigma * sigma
    g0, g1 = half, moves * dt
    put3(work, at, (g1, bends * half, full(moves)))
    put3(work, at + 3, (bends * dt, full(bends), variance * (g0 * g0)))
    put3(work, at + 6, (variance * (g0 * g1), (variance * bends) * g0, variance * (g1 * g1)))
    put(work, at + 9, (variance * bends) * g1)
    put(work, at + 10, full(variance * bends))


@part
def prepare_step(work, size, models, transitions, transition, dt, settled):
    """Models and transition probabilities over the time since each lane's last plot.

    The matrix at transitions[transition …] holds over the interval dt since the last scan; where plots were missed
    since (not settled), P(a + b) = P(a) P(b), eq. (8).
    """
    wait = full(dt)
    if not settled:
        wait = wait + get(work, WAIT)
    put(work, WAIT, wait)
    for i in range(size):
        prepare_model(work, MODEL + 11 * i, models[3 * i], models[3 * i + 1], models[3 * i + 2], wait)
    for j in range(size):
        for i in range(size):
            c = full(transitions[transition + i * size + j])
            if not settled:
                c = full(0.0)
                for n in range(size):
                    c = c + transitions[transition + i * size + n] * get(work, TRANSITION + n * MOST + j)
            put(work, WEIGHT + i, c)
        for i in range(size):
            put(work, TRANSITION + i * MOST + j, get(work, WEIGHT + i))


@part
def keep_missed(work, old, new, size, detected):
    """Where the plot was missed keep the old bank, and its wait: the next prediction starts from the last plot
    again."""
    half = full(0.5)
    for i in range(size):
        for at in range(i * HYPOTHESIS, i * HYPOTHESIS + PROBABILITY + 1):
            put(work, new + at, where_greater(detected, half, get(work, new + at), get(work, old + at)))
        for j in range(size):
            at = TRANSITION + i * MOST + j
            put(work, at, where_greater(detected, half, full(1.0 if i == j else 0.0), get(work, at)))
    put(work, WAIT, where_greater(detected, half, full(0.0), get(work, WAIT)))


@part
def output(work, listed, bank, size, rule, everything, out):
    """Merge a bank by the output rule into the rows at `out`.

    Mean (9); where `everything`: variances (9) from VARIANCE, position covariances xy, xz, yz from POSITION,
    probabilities from MODELS; at INNOVATION the normalised innovation squared of what was thought most probable
    before the plot. (The rows from MERGES on, hypotheses merged and merges, are written at the end of the scan.)
    """
    for j in range(size):
        put(work, WEIGHT + j, get(work, bank + j * HYPOTHESIS + PROBABILITY))
    count = shared(work, listed, bank, size, full(1.0), full(0.0), rule)
    put(out, INNOVATION, get(work, SURPRISE))
    if not everything:
        for axis in range(3):
            put3(out, 3 * axis, mixed_mean(listed, count, row(work, SHARE), row(work, MEAN + 3 * axis)))
        return
    merged(work, listed, count, row(work, SPARE))
    for axis in range(3):
        own = SPARE + OWN + 6 * axis
        put3(out, 3 * axis, get3(work, SPARE + MEAN + 3 * axis))
        put3(out, VARIANCE + 3 * axis, (get(work, own), get(work, own + 3), get(work, own + 5)))
        put(out, POSITION + axis, get(work, SPARE + CROSS + 9 * axis))
    for j in range(size):
        put(out, MODELS + j, get(work, bank + j * HYPOTHESIS + PROBABILITY))


@part
def start(work, numbers, size, plots, weights, probabilities):
    """The first bank, the same hypothesis for all models, from the plots of the first three scans.

    weights (9,): how the coordinate and the velocity at the third plot are made of the three coordinates, a (3) and
    b (3); how an acceleration of one standard deviation would err the three states, g (3). probabilities (size,): to
    start with.
    """
    for e in range(6):
        aa, ab, bb = full(0.0), full(0.0), full(0.0)
        for k in range(3):
            r = get(plots, k * PLOT + 3 + e)
            aa = aa + (weights[k] * weights[k]) * r
            ab = ab + (weights[k] * weights[3 + k]) * r
            bb = bb + (weights[3 + k] * weights[3 + k]) * r
        axis = 0 if e == 0 else (1 if e == 3 else 2)
        if e == 0 or e == 3 or e == 5:
            at, g, h, d = OWN + 6 * axis, weights[6], weights[7], weights[8]
            put3(work, at, (aa + g * g, ab + g * h, full(g * d)))
            put3(work, at + 3, (bb + h * h, full(h * d), full(d * d)))
        else:
            at, zero = CROSS + 9 * (e - 1 if e < 3 else 2), full(0.0)
            put3(work, at, (aa, ab, zero))
            put3(work, at + 3, (ab, bb, zero))
            put3(work, at + 6, (zero, zero, zero))
    for axis in range(3):
        x, v = full(0.0), full(0.0)
        for k in range(3):
            z = get(plots, k * PLOT + axis)
            x, v = x + weights[k] * z, v + weights[3 + k] * z
        put3(work, MEAN + 3 * axis, (x, v, full(0.0)))
    for i in range(size):
        put(work, i * HYPOTHESIS + PROBABILITY, full(probabilities[i]))
        for at in range(PROBABILITY):
            put(work, i * HYPOTHESIS + at, get(work, at))
    for at in range(9):
        put(work, ESTIMATE + at, get(work, MEAN + at))
    numbers[0], numbers[1], numbers[2] = 0, -1, 1


@part
def run_strip(
    work,
    numbers,
    listed,
    plots,
    first,
    stop,
    size,
    models,
    transitions,
    intervals,
    times,
    rules,
    frame,
    everything,
    out,
):
    """Run one filter over the scans first … stop - 1 of a strip; all arrays by their addresses.

    work, numbers  its memory, see `work_arrays`: numbers are the bank in use, the interval that the rows MODEL and
                   TRANSITION hold for (-1: none), and 1 where no lane waits for a plot that it missed
    listed         memory for MOST whole numbers
    plots          rows: PLOT of them a scan
    models         (size * 3,): moves, accelerates (0 or 1), sigma of the acceleration per step in m/s²
    transitions    (U * size * size,): over each different interval between scans, columns: from
    intervals      (scans,) number of each scan's interval; times (U,) in s
    rules          family, merging rule, output rule, 1 to evaluate the measurement covariance at the prediction
    frame          antenna, for the latter: see `multimodel_plots.frame`
    everything     (scans,): 1 where covariances are wanted
    out            rows: OUTPUT of them a scan
    """
    family, rule = rules[0], rules[1]
    for k in range(first, stop):
        plot, interval, to = row(plots, k * PLOT), intervals[k], row(out, k * OUTPUT)
        noise, detected = row(plot, 3), get(plot, 9)
        if numbers[1] != interval or numbers[2] == 0:
            prepare_step(work, size, models, transitions, interval * size * size, times[interval], numbers[2] == 1)
            numbers[1] = interval
        if rules[3] == 1:
            noise = row(work, NOISE)
            noise_at_prediction(frame, row(work, ESTIMATE), get(work, WAIT), row(plot, 3), noise)
        put(work, MERGED, full(0.0))
        put(work, MERGED + 1, full(0.0))
        old, new = numbers[0] * BANK, (1 - numbers[0]) * BANK
        step(work, listed, old, new, size, family, rule, plot, noise)
        output(work, listed, new, size, rules[2], everything[k] == 1, to)
        if family == GPB1:
            merge_gpb1(work, listed, old, new, size, rule)
        put(to, MERGES, get(work, MERGED))
        put(to, MERGES + 1, get(work, MERGED + 1))
        if rules[3] == 1:
            for i in range(9):
                put(work, ESTIMATE + i, where_greater(detected, full(0.5), get(to, i), get(work, ESTIMATE + i)))
        if any_greater(full(0.5), detected):
            keep_missed(work, old, new, size, detected)
            numbers[2] = 0
        elif numbers[2] == 0:
            numbers[1], numbers[2] = -1, 1
        numbers[0] = 1 - numbers[0]


@kernel
def filter_strip(
    work, numbers, plots, first, stop, models, transitions, intervals, times, rules, frame, everything, out
):
    """`run_strip` of arrays."""
    run_strip(
        address(work),
        address(numbers),
        address(np.zeros(MOST, dtype=np.int64)),
        address(plots),
        first,
        stop,
        models.size // 3,
        address(models),
        address(transitions),
        address(intervals),
        address(times),
        address(rules),
        address(frame),
        address(everything),
        address(out),
    )


@kernel
def start_strip(work, numbers, plots, weights, probabilities):
    """`start` of arrays."""
    start(address(work), address(numbers), probabilities.size, address(plots), address(weights), address(probabilities))

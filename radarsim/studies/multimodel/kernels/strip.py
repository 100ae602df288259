"""A strip of scans with one filter: the track's start, models over the real interval, missed plots, outputs.

Letters, each of eight lanes but for the numbers i, j of models:

    dt            time that a prediction is over, s: since the last plot
    F, Q          a model over it, eq. (11); F (5) and Q (6) of one axis, the same for all three
    T[i, j]       probability of passing from model j to model i over it, eq. (8)
    a, b, g (3)   weights of a track's start: x = Σ a z, v = Σ b z, and how an acceleration errs the states
    R             covariance of a plot (6)

`work`, `plots`, `out` and the like are addresses.
"""

from typing import NamedTuple

import numpy as np

from radarsim.kernels.compile import inline, kernel, part
from radarsim.kernels.lanes import address, any_greater, full, get, get3, put, put3, row, where_greater
from radarsim.studies.multimodel.kernels import records as rec
from radarsim.studies.multimodel.kernels.filters import merge_gpb1, shares_by_rule, step
from radarsim.studies.multimodel.kernels.hypothesis import merge, mixed_mean
from radarsim.studies.multimodel.kernels.plots import noise_at_prediction
from radarsim.studies.multimodel.kernels.records import Rules


class Filter(NamedTuple):
    """A filter, by addresses.

    rules          what it is, see `records.Rules`
    models         (size * 3,): moves, accelerates (0 or 1), sigma of the acceleration per step in m/s²
    transitions    (U * size * size,): T over each different interval between scans, row by row
    """

    rules: Rules
    models: np.ndarray
    transitions: np.ndarray


class Memory(NamedTuple):
    """A filter's memory, by addresses: rows (WORK,), numbers CURRENT … SETTLED, and room for MOST whole numbers."""

    work: np.ndarray
    numbers: np.ndarray
    listed: np.ndarray


class Scans(NamedTuple):
    """The scans first … stop - 1 of a strip.

    intervals      address, (scans,): number of each scan's interval since the last one
    times          address, (U,): the intervals, s
    reported       address, (scans,): 1 where covariances are wanted
    """

    first: int
    stop: int
    intervals: np.ndarray
    times: np.ndarray
    reported: np.ndarray


@inline
def prepare_model(work, at, moves, accelerates, sigma, dt):
    """F and Q = G sigma² G' over dt into the rows at `at` (eq. 11), G = (dt² / 2, moves dt, accelerates)'.

    moves, accelerates (0 or 1): whether the model has a velocity, an acceleration; sigma of it per step, m/s².
    """
    half, variance = 0.5 * dt * dt, sigma * sigma
    g0, g1 = half, moves * dt
    put3(work, at, (g1, accelerates * half, full(moves)))
    put(work, at + 3, accelerates * dt)
    put(work, at + 4, full(accelerates))
    at += rec.MODEL_Q
    put3(work, at, (variance * (g0 * g0), variance * (g0 * g1), (variance * accelerates) * g0))
    put3(work, at + 3, (variance * (g1 * g1), (variance * accelerates) * g1, full(variance * accelerates)))


@part
def prepare_step(work, design, interval, dt, settled):
    """Models and transition probabilities over the time since each lane's last plot.

    interval is the number of the interval dt since the last scan; where plots were missed since then (not settled),
    T(a + b) = T(a) T(b), eq. (8).
    """
    size, models = design.rules.size, design.models
    first = interval * size * size
    wait = full(dt)
    if not settled:
        wait = wait + get(work, rec.WAIT)
    put(work, rec.WAIT, wait)
    for i in range(size):
        m = rec.MODEL_NUMBERS * i
        prepare_model(work, rec.MODEL + rec.MODEL_ROWS * i, models[m], models[m + 1], models[m + 2], wait)
    for j in range(size):
        for i in range(size):
            c = full(design.transitions[first + i * size + j])
            if not settled:
                c = full(0.0)
                for n in range(size):
                    c = c + design.transitions[first + i * size + n] * get(work, rec.TRANSITION + n * rec.MOST + j)
            put(work, rec.WEIGHT + i, c)
        for i in range(size):
            put(work, rec.TRANSITION + i * rec.MOST + j, get(work, rec.WEIGHT + i))


@part
def keep_missed(work, old, new, size, detected):
    """Where the plot was missed keep the old bank, and its wait: the next prediction starts from the last plot
    again."""
    half = full(0.5)
    for i in range(size):
        for at in range(i * rec.HYPOTHESIS, i * rec.HYPOTHESIS + rec.PROBABILITY + 1):
            put(work, new + at, where_greater(detected, half, get(work, new + at), get(work, old + at)))
        for j in range(size):
            at = rec.TRANSITION + i * rec.MOST + j
            put(work, at, where_greater(detected, half, full(1.0 if i == j else 0.0), get(work, at)))
    put(work, rec.WAIT, where_greater(detected, half, full(0.0), get(work, rec.WAIT)))


@part
def output(work, listed, bank, rules, reported, out):
    """Merge a bank by the output rule into the rows at `out`, see OUTPUT.

    Variances, covariances and probabilities only where `reported`; the rows from MERGING on are written at the end of
    the scan.
    """
    size = rules.size
    for j in range(size):
        put(work, rec.WEIGHT + j, get(work, bank + j * rec.HYPOTHESIS + rec.PROBABILITY))
    count = shares_by_rule(work, listed, bank, size, full(1.0), full(0.0), rules.output)
    put(out, rec.INNOVATION, get(work, rec.SURPRISE))
    if not reported:
        for axis in range(3):
            put3(out, 3 * axis, mixed_mean(listed, count, row(work, rec.SHARE), row(work, rec.MEAN + 3 * axis)))
        return
    merge(work, listed, count, row(work, rec.SPARE))
    for axis in range(3):
        own = rec.SPARE + rec.OWN + 6 * axis
        put3(out, 3 * axis, get3(work, rec.SPARE + rec.MEAN + 3 * axis))
        put3(out, rec.VARIANCE + 3 * axis, (get(work, own), get(work, own + 3), get(work, own + 5)))
        put(out, rec.POSITION_COVARIANCE + axis, get(work, rec.SPARE + rec.CROSS + 9 * axis))
    for j in range(size):
        put(out, rec.MODELS + j, get(work, bank + j * rec.HYPOTHESIS + rec.PROBABILITY))


@part
def start(work, numbers, size, plots, weights, probabilities):
    """The first bank, the same hypothesis for all models, from the plots of the first START scans.

    weights (9,): a (3) and b (3), by which the coordinate and the velocity at the third plot are made of the three
    coordinates; g (3), the errors that an acceleration of one standard deviation makes in the three states.
    probabilities (size,): of the models at the start.
    """
    for e in range(6):
        start_block(work, e, plots, weights)
    for axis in range(3):
        x, v = full(0.0), full(0.0)
        for k in range(rec.START):
            z = get(plots, k * rec.PLOT + axis)
            x, v = x + weights[k] * z, v + weights[3 + k] * z
        put3(work, rec.MEAN + 3 * axis, (x, v, full(0.0)))
    for i in range(size):
        put(work, i * rec.HYPOTHESIS + rec.PROBABILITY, full(probabilities[i]))
        for at in range(rec.PROBABILITY):
            put(work, i * rec.HYPOTHESIS + at, get(work, at))
    for at in range(rec.STATES):
        put(work, rec.ESTIMATE + at, get(work, rec.MEAN + at))
    numbers[rec.CURRENT], numbers[rec.PREPARED], numbers[rec.SETTLED] = 0, -1, 1


@inline
def start_block(work, e, plots, weights):
    """The block of the first covariance for element e of R (xx, xy, xz, yy, yz, zz): Σ (a, b)' (a, b) R, and g g' on
    the diagonal."""
    aa, ab, bb = full(0.0), full(0.0), full(0.0)
    for k in range(rec.START):
        R = get(plots, k * rec.PLOT + rec.COVARIANCE + e)
        aa = aa + (weights[k] * weights[k]) * R
        ab = ab + (weights[k] * weights[3 + k]) * R
        bb = bb + (weights[3 + k] * weights[3 + k]) * R
    if e == 0 or e == 3 or e == 5:
        at, g0, g1, g2 = rec.OWN + (0 if e == 0 else (6 if e == 3 else 12)), weights[6], weights[7], weights[8]
        put3(work, at, (aa + g0 * g0, ab + g0 * g1, full(g0 * g2)))
        put3(work, at + 3, (bb + g1 * g1, full(g1 * g2), full(g2 * g2)))
    else:
        at, zero = rec.CROSS + 9 * (e - 1 if e < 3 else 2), full(0.0)
        put3(work, at, (aa, ab, zero))
        put3(work, at + 3, (ab, bb, zero))
        put3(work, at + 6, (zero, zero, zero))


@part
def run_strip(memory, design, scans, plots, frame, out):
    """Run one filter over scans; see `Memory`, `Filter`, `Scans`.

    plots: PLOT rows a scan; frame: of the sensor, for the covariance at the prediction; out: OUTPUT rows a scan.
    """
    work, numbers, listed = memory.work, memory.numbers, memory.listed
    rules = design.rules
    for k in range(scans.first, scans.stop):
        plot, interval, to = row(plots, k * rec.PLOT), scans.intervals[k], row(out, k * rec.OUTPUT)
        noise, detected = row(plot, rec.COVARIANCE), get(plot, rec.DETECTED)
        if numbers[rec.PREPARED] != interval or numbers[rec.SETTLED] == 0:
            prepare_step(work, design, interval, scans.times[interval], numbers[rec.SETTLED] == 1)
            numbers[rec.PREPARED] = interval
        if rules.at_prediction == 1:
            noise = row(work, rec.NOISE)
            noise_at_prediction(frame, row(work, rec.ESTIMATE), get(work, rec.WAIT), row(plot, rec.COVARIANCE), noise)
        put(work, rec.COUNTED, full(0.0))
        put(work, rec.COUNTED + 1, full(0.0))
        old, new = numbers[rec.CURRENT] * rec.BANK, (1 - numbers[rec.CURRENT]) * rec.BANK
        step(work, listed, old, new, rules, plot, noise)
        output(work, listed, new, rules, scans.reported[k] == 1, to)
        if rules.family == rec.GPB1:
            merge_gpb1(work, listed, old, new, rules.size, rules.merge)
        put(to, rec.MERGING, get(work, rec.COUNTED))
        put(to, rec.MERGING + 1, get(work, rec.COUNTED + 1))
        if rules.at_prediction == 1:
            for i in range(rec.STATES):
                x = get(to, rec.ESTIMATED + i)
                put(work, rec.ESTIMATE + i, where_greater(detected, full(0.5), x, get(work, rec.ESTIMATE + i)))
        if any_greater(full(0.5), detected):
            keep_missed(work, old, new, rules.size, detected)
            numbers[rec.SETTLED] = 0
        elif numbers[rec.SETTLED] == 0:
            numbers[rec.PREPARED], numbers[rec.SETTLED] = -1, 1
        numbers[rec.CURRENT] = 1 - numbers[rec.CURRENT]


@inline
def rules_of(numbers, size):
    """The rules of a filter from its numbers (FAMILY, MERGE, OUTPUT_RULE, AT_PREDICTION)."""
    return Rules(numbers[rec.FAMILY], numbers[rec.MERGE], numbers[rec.OUTPUT_RULE], numbers[rec.AT_PREDICTION], size)


@kernel
def filter_strip(work, numbers, plots, first, stop, models, transitions, intervals, times, rules, frame, reported, out):
    """`run_strip` of arrays."""
    memory = Memory(address(work), address(numbers), address(np.zeros(rec.MOST, dtype=np.int64)))
    design = Filter(rules_of(rules, models.size // rec.MODEL_NUMBERS), address(models), address(transitions))
    scans = Scans(first, stop, address(intervals), address(times), address(reported))
    run_strip(memory, design, scans, address(plots), address(frame), address(out))


@kernel
def start_strip(work, numbers, plots, weights, probabilities):
    """`start` of arrays."""
    start(address(work), address(numbers), probabilities.size, address(plots), address(weights), address(probabilities))

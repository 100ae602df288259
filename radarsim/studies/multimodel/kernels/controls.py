"""Controls of the multimodel study: Kalman filters of shared gains beside the realisations, and what they explain.

A control is a linear filter whose gains are computed once, from the covariances of the plots at the truth. It is fed
with the same noise as the plots, linearised at the truth, so that its error has known moments: a square of it, less its
expectation, may be subtracted from a filter's squared error without changing the mean.

Letters, each of eight lanes:

    d          a control's error less its mean (9)
    n, w       standard normals of a plot (3), and the error G n that they make in the local frame (3)
    v          innovation less its mean (3)
    y          squared error of a filter's estimate, or its mean over a stage
    p, h       probability that a plot comes; the mean error of the predicted position, see `follow`
    x          regressors of y: d and d² - E d² of each model's control, or their sums over the parts of a stage
    level      the mean of y in the pilot
    explained  Σ slope · x; rho: y - explained - level

`memory.errors` holds d of each control and scan of a strip, STATES rows each; what is not a record is an address or a
number. Arrays and their shapes: `records.Controls`, `ControlSums`, `Products`.
"""

from typing import NamedTuple

import numpy as np

from radarsim.kernels.compile import inline, part
from radarsim.kernels.lanes import add_totals, address, full, get, put, row, rows, total, where_greater
from radarsim.kernels.symmetric import predicted_axis
from radarsim.studies.multimodel.kernels.hypothesis import get3, put9
from radarsim.studies.multimodel.kernels.plots import NORMALS, STRIP
from radarsim.studies.multimodel.kernels.records import (
    COLLECTED,
    CONTROL,
    CONTROL_STEP,
    CONTROLLED,
    DETECTION,
    EXPECTED,
    MEAN_ERROR,
    MOMENTS,
    MOST,
    OUTPUT,
    PARTS,
    PILOT,
    SIZE,
    STAGE,
    START,
    STATES,
    Controls,
    ControlSums,
    Products,
)

MOST_REGRESSORS = MOST * PARTS * COLLECTED


class ControlMemory(NamedTuple):
    """Rows of one thread.

    errors (C, STRIP, 9), states (C, 9)   d of each control: of each scan of a strip, and the last
    parts (C, S PARTS, 9, COLLECTED)      sums over the parts of the stages
    residuals (F, 9)                      rho of a scan or stage
    x (1 + MOST_REGRESSORS)               y and its regressors
    """

    errors: np.ndarray
    states: np.ndarray
    parts: np.ndarray
    residuals: np.ndarray
    x: np.ndarray


def memory(controls: int, filters: int, stages: int) -> ControlMemory:
    """Memory for numbers of controls, filters and stages."""
    return ControlMemory(
        errors=rows(controls * STRIP * STATES),
        states=rows(controls * STATES),
        parts=rows(controls * stages * PARTS * STATES * COLLECTED),
        residuals=rows(filters * STATES),
        x=rows(1 + MOST_REGRESSORS),
    )


class Beside(NamedTuple):
    """All that the controls of a block take, as arrays."""

    controls: Controls
    memory: ControlMemory
    sums: ControlSums
    products: Products


class Control(NamedTuple):
    """A control by addresses: its gains and steps, and which of them each scan has; G; its sums over parts of stages.

    interval, row, part (K,): of each scan, see `records.World` and `Controls`
    """

    gains: np.ndarray
    steps: np.ndarray
    interval: np.ndarray
    row: np.ndarray
    part: np.ndarray
    noise: np.ndarray
    parts: np.ndarray


class Span(NamedTuple):
    """The scans begin … length - 1 of the strip that starts at scan k."""

    k: int
    begin: int
    length: int


# ---- the controls themselves --------
@inline
def plot_error(random, n, noise, at):
    """w = G n of scan n of a strip (3); G: nine numbers from `at` on."""
    a, b, c = get(random, 3 * n), get(random, 3 * n + 1), get(random, 3 * n + 2)
    return (
        noise[at] * a + noise[at + 1] * b + noise[at + 2] * c,
        noise[at + 3] * a + noise[at + 4] * b + noise[at + 5] * c,
        noise[at + 6] * a + noise[at + 7] * b + noise[at + 8] * c,
    )


@part
def start_control(state, random, noise, weights):
    """d at the third scan, from the errors of the first START plots; weights: a and b of `strip.start`."""
    for i in range(STATES):
        put(state, i, full(0.0))
    for k in range(START):
        w = plot_error(random, k, noise, k * STATES)
        for axis in range(3):
            put(state, 3 * axis, get(state, 3 * axis) + weights[k] * w[axis])
            put(state, 3 * axis + 1, get(state, 3 * axis + 1) + weights[3 + k] * w[axis])


@inline
def updated(x, v, gains, at):
    """x + K v of one axis (3); three rows of the gain from `at` on."""
    return (
        x[0] + gains[at] * v[0] + gains[at + 1] * v[1] + gains[at + 2] * v[2],
        x[1] + gains[at + 3] * v[0] + gains[at + 4] * v[1] + gains[at + 5] * v[2],
        x[2] + gains[at + 6] * v[0] + gains[at + 7] * v[1] + gains[at + 8] * v[2],
    )


@inline
def innovation(w, x, detected, p, h):
    """v of one coordinate: the plot's innovation less its mean, v = detected (w - H F d - h) + p h.

    Where plots are missed, at random, the mean error h of the prediction is taken off in p of all cases only.
    """
    return detected * (w - x - h) + p * h


@inline
def collect(parts, d, mean, at, place):
    """Add d² and d times its mean error, of one axis (3), to the rows `place` … of a part of a stage."""
    for i in range(3):
        to = place + COLLECTED * i
        put(parts, to, get(parts, to) + d[i] * d[i])
        put(parts, to + 1, get(parts, to + 1) + mean[at + i] * d[i])


@part
def follow(state, errors, of, random, frame, span):
    """Run a control over the scans of a strip; put d into `errors`, and what a stage takes into its parts."""
    p, one, zero, gains = frame[DETECTION], full(1.0), full(0.0), of.gains
    x, y, z = get3(state, 0), get3(state, 3), get3(state, 6)
    for n in range(span.begin, span.length):
        k = span.k + n
        w, at, step = plot_error(random, n, of.noise, k * STATES), of.row[k] * CONTROL, of.interval[k] * CONTROL_STEP
        detected = where_greater(full(p), get(random, NORMALS + n), one, zero)
        f = (of.steps[step], of.steps[step + 1], of.steps[step + 2], of.steps[step + 3], of.steps[step + 4])
        x, y, z, h = predicted_axis(x, f), predicted_axis(y, f), predicted_axis(z, f), at + EXPECTED
        v = (
            innovation(w[0], x[0], detected, p, gains[h]),
            innovation(w[1], y[0], detected, p, gains[h + 1]),
            innovation(w[2], z[0], detected, p, gains[h + 2]),
        )
        x, y, z = updated(x, v, gains, at), updated(y, v, gains, at + 9), updated(z, v, gains, at + 18)
        put9(errors, n * STATES, x + y + z)
        place, mean = of.part[k] * STATES * COLLECTED, at + MEAN_ERROR
        collect(of.parts, x, gains, mean, place)
        collect(of.parts, y, gains, mean + 3, place + 3 * COLLECTED)
        collect(of.parts, z, gains, mean + 6, place + 6 * COLLECTED)
    put9(state, 0, x + y + z)


# ---- what they explain --------
class Rows(NamedTuple):
    """By addresses: y and its regressors x (1 + count rows); which realisations count (8,), and how many do."""

    x: np.ndarray
    count: int
    counted: np.ndarray
    number: float


class Places(NamedTuple):
    """Where the numbers of one filter lie, by addresses, and how many controls it has, one a model.

    own (MOST,): the controls of its models; errors: their d at the scan; parts: their sums over the first part of the
    stage, `width` rows a control; variances: what is expected of squares, at the scan or over the parts, `stride`
    numbers a control, from `first` on.
    """

    own: np.ndarray
    size: int
    errors: np.ndarray
    parts: np.ndarray
    width: int
    variances: np.ndarray
    stride: int
    first: int


@inline
def put_scan(x, c, places):
    """The regressors of a squared error of state c at a scan: d and d² - E d² of each model's control."""
    for j in range(places.size):
        i = places.own[j]
        d = get(places.errors, i * STRIP * STATES + c)
        put(x, 1 + 2 * j, d)
        put(x, 2 + 2 * j, d * d - places.variances[places.first + i * places.stride + c])


@inline
def put_stage(x, c, places):
    """The regressors of the mean over a stage: both sums over each part of it, of each model's control."""
    for j in range(places.size):
        first, expected = places.own[j] * places.width, places.first + places.own[j] * places.stride
        for p in range(PARTS):
            to, at = 1 + (j * PARTS + p) * COLLECTED, first + (p * STATES + c) * COLLECTED
            put(x, to, get(places.parts, at) - places.variances[expected + p * STATES + c])
            put(x, to + 1, get(places.parts, at + 1))


@part
def add_residual(of, slopes, at, sums, to, residual):
    """Add what the controls leave of y to the MOMENTS sums from `to` on, and put rho into `residual`.

    The level stands at `at` of slopes, the slopes behind it.
    """
    level, found = slopes[at], full(0.0)
    for j in range(1, 1 + of.count):
        found = found + slopes[at + j] * get(of.x, j)
    counted = get(of.counted, 0)
    rho, found = counted * (get(of.x, 0) - found - level), counted * found
    square = rho * rho
    put(residual, 0, rho)
    sums[to] += of.number * level
    add_totals(sums, to + 1, rho, square, square * square, found * found)


@inline
def product(own, other, c):
    """The product of two residuals of state c."""
    return get(own, c) * get(other, c)


@part
def add_pairs(own, other, sums, to):
    """Add the products of the residuals of two filters, by state, to nine sums from `to` on."""
    for c in range(0, STATES - 1, 4):
        a, b = product(own, other, c), product(own, other, c + 1)
        add_totals(sums, to + c, a, b, product(own, other, c + 2), product(own, other, c + 3))
    sums[to + 8] += total(product(own, other, 8))


@part
def add_products(of, sums, at):
    """Add y and its regressors, and then the products of any two, to sums from `at` on."""
    counted = get(of.counted, 0)
    for i in range(1 + of.count):
        sums[at + i] += total(counted * get(of.x, i))
    at += 1 + of.count
    for i in range(1 + of.count):
        own = counted * get(of.x, i)
        for j in range(i, 1 + of.count):
            sums[at] += total(own * get(of.x, j))
            at += 1


# ---- a strip, and the end of a realisation --------
@inline
def follow_controls(world, random, beside, span):
    """Run all controls over a strip; random: the address of its noise."""
    controls, memory = beside.controls, beside.memory
    width = world.lengths.shape[0] * PARTS * STATES * COLLECTED
    for i in range(controls.gains.shape[0]):
        state, parts = row(address(memory.states), i * STATES), row(address(memory.parts), i * width)
        if span.k == 0:
            start_control(state, random, address(controls.noise), address(world.weights))
        own = Control(
            address(controls.gains[i]),
            address(controls.steps[i]),
            address(world.intervals),
            address(controls.row),
            address(controls.part),
            address(controls.noise),
            parts,
        )
        follow(state, row(address(memory.errors), i * STRIP * STATES), own, random, address(world.frame), span)


class Outcome(NamedTuple):
    """Where the sums of a scan, or of a stage, of all filters lie: addresses, with the rows of the residuals (F, 9).

    slopes, `width` numbers a state; residual sums, MOMENTS a state; products, `many` a state; pilot: 1 where these are
    made, else 0
    """

    residuals: np.ndarray
    slopes: np.ndarray
    width: int
    sums: np.ndarray
    products: np.ndarray
    many: int
    pilot: int


@part
def add_scan(of, places, out, truth, to, at, f):
    """Add a scan of filter f; out: its outputs; truth (9,); at: its place in the sums, counted in states."""
    for c in range(STATES):
        e = get(out, c) - truth[c]
        put(of.x, 0, e * e)
        put_scan(of.x, c, places)
        add_one(of, to, at + c, f * STATES + c)


@part
def add_stage(of, places, means, to, at, f):
    """Add a realisation's means over a stage, squared errors of filter f; as `add_scan`."""
    for c in range(STATES):
        put(of.x, 0, get(means, c))
        put_stage(of.x, c, places)
        add_one(of, to, at + c, f * STATES + c)


@inline
def add_one(of, to, at, residual):
    """Add y of one state: `at` counts states in the sums, `residual` in the rows of the residuals."""
    if to.pilot == 1:
        add_products(of, to.products, at * to.many)
    else:
        add_residual(of, to.slopes, at * to.width, to.sums, at * MOMENTS, row(to.residuals, residual))


@inline
def outcome(beside, slopes, sums, products):
    """Where the sums of scans, or of stages, lie: arrays by filter, scan or stage, and state."""
    pilot = 1 if beside.controls.mode[0] == PILOT else 0
    residuals = address(beside.memory.residuals)
    width, many = slopes.shape[3], products.shape[3]
    return Outcome(residuals, address(slopes), width, address(sums), address(products), many, pilot)


@inline
def add_controlled_scan(world, banks, beside, outputs, counted, baseline, k, n):
    """Add scan n of a strip, the reported scan k of the track, of all filters; outputs, counted: addresses."""
    controls, memory, sums = beside.controls, beside.memory, beside.sums
    filters, scans, place = banks.numbers.shape[0], controls.scans.shape[1], world.place[k]
    x, number = address(memory.x), total(get(counted, 0))
    to = outcome(beside, controls.scans, sums.controlled, beside.products.scans)
    errors, truth = row(address(memory.errors), n * STATES), address(world.truth[k])
    variances, stride = address(controls.variances), scans * STATES
    for f in range(filters):
        size, own = banks.numbers[f, SIZE], row(address(controls.own), f)
        places = Places(own, size, errors, x, 0, variances, stride, place * STATES)
        of = Rows(x, 2 * size, counted, number)
        add_scan(of, places, row(outputs, (f * STRIP + n) * OUTPUT), truth, to, (f * scans + place) * STATES, f)
    if controls.mode[0] == CONTROLLED:
        for f in range(filters):
            own, base = row(to.residuals, f * STATES), row(to.residuals, baseline * STATES)
            add_pairs(own, base, address(sums.controlled_pairs), (f * scans + place) * STATES)


@inline
def close_controls(banks, beside, stages, counted, count):
    """Add a realisation's means over its stages, of all filters; counted: an address.

    stages: address of the means, as `sums.close_stages` leaves them; count: number of stages.
    """
    controls, memory, sums = beside.controls, beside.memory, beside.sums
    filters, step = banks.numbers.shape[0], PARTS * STATES * COLLECTED
    x, number = address(memory.x), total(get(counted, 0))
    to = outcome(beside, controls.stages, sums.controlled_stage, beside.products.stages)
    for s in range(count):
        parts, expected = row(address(memory.parts), s * step), address(controls.sums)
        for f in range(filters):
            size, own = banks.numbers[f, SIZE], row(address(controls.own), f)
            places = Places(own, size, x, parts, count * step, expected, count * PARTS * STATES, s * PARTS * STATES)
            of = Rows(x, PARTS * COLLECTED * size, counted, number)
            add_stage(of, places, row(stages, (f * count + s) * STAGE), to, (f * count + s) * STATES, f)
        if controls.mode[0] == CONTROLLED:
            for f in range(filters):
                for g in range(filters):
                    own, other = row(to.residuals, f * STATES), row(to.residuals, g * STATES)
                    at = ((f * filters + g) * count + s) * STATES
                    add_pairs(own, other, address(sums.controlled_stage_pairs), at)

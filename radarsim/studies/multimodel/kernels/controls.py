"""Controls of the multimodel study: Kalman filters of shared gains beside the realisations.

A control is a linear filter whose gains are computed once, from the covariances of the plots at the truth. It is fed
with the same noise as the plots, linearised at the truth, so that its error has known moments: a square of it, less its
expectation, may be subtracted from a filter's squared error without changing the mean.

Letters, each of eight lanes:

    d          a control's error less its mean (9)
    n, w       standard normals of a plot (3), and the error G n that they make in the local frame (3)
    v          innovation less its mean (3)
    p, h       probability that a plot comes; the mean error of the predicted position, see `follow`

What they explain of the filters' squared errors: `kernels.residuals`. What is not a record is an address or a number.
Arrays and their shapes: `records.Controls`.
"""

from typing import NamedTuple

import numpy as np

from radarsim.kernels.compile import inline, part
from radarsim.kernels.lanes import address, full, get, put, row, rows, where_greater
from radarsim.kernels.symmetric import predicted_axis
from radarsim.studies.multimodel.kernels.hypothesis import get3, put3, put9
from radarsim.studies.multimodel.kernels.plots import NORMALS, STRIP
from radarsim.studies.multimodel.kernels.records import (
    COLLECTED,
    CONTROL,
    CONTROL_STEP,
    DETECTION,
    EXPECTED,
    MEAN_ERROR,
    MOST,
    PARTS,
    START,
    STATES,
    Controls,
    ControlSums,
    Products,
)

MOST_REGRESSORS = MOST * PARTS * COLLECTED
CAME = 3  # after w: 1 where the plot came, else 0
HEARD = 4  # rows of a scan that all controls hear: w, CAME


class ControlMemory(NamedTuple):
    """Rows of one thread.

    heard (STRIP, HEARD)                  w and CAME of each scan of a strip
    errors (C, STRIP, 9), states (C, 9)   d of each control: of each scan of a strip, and the last
    parts (C, S PARTS, 9, COLLECTED)      sums over the parts of the stages
    residuals (F, 9)                      rho of a scan or stage, see `kernels.residuals`
    x (1 + MOST_REGRESSORS)               y and its regressors
    """

    heard: np.ndarray
    errors: np.ndarray
    states: np.ndarray
    parts: np.ndarray
    residuals: np.ndarray
    x: np.ndarray


def memory(controls: int, filters: int, stages: int) -> ControlMemory:
    """Memory for numbers of controls, filters and stages."""
    return ControlMemory(
        heard=rows(STRIP * HEARD),
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
    """A control by addresses: its gains and steps, and which of them each scan has; d of each scan of a strip.

    interval, row (K,): of each scan, see `records.World` and `Controls`
    """

    gains: np.ndarray
    steps: np.ndarray
    interval: np.ndarray
    row: np.ndarray
    errors: np.ndarray


class Span(NamedTuple):
    """The scans begin … length - 1 of the strip that starts at scan k, or of a part of it."""

    k: int
    begin: int
    length: int


# ---- the controls themselves --------
@part
def hear(random, noise, p, span, heard):
    """Put w = G n of the scans of a strip, and whether their plots came, into `heard`; noise: G of all scans."""
    for n in range(span.length):
        a, b, c = get3(random, 3 * n)
        at = (span.k + n) * STATES
        for i in range(3):
            w = noise[at + 3 * i] * a + noise[at + 3 * i + 1] * b + noise[at + 3 * i + 2] * c
            put(heard, n * HEARD + i, w)
        put(heard, n * HEARD + CAME, where_greater(full(p), get(random, NORMALS + n), full(1.0), full(0.0)))


@part
def start_control(state, heard, weights):
    """d at the third scan, from the errors of the first START plots; weights: a and b of `strip.start`."""
    for i in range(STATES):
        put(state, i, full(0.0))
    for k in range(START):
        w = get3(heard, k * HEARD)
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


@part
def follow(state, of, heard, p, span):
    """Run a control over the scans of a strip, and put d into its errors."""
    gains = of.gains
    x, y, z = get3(state, 0), get3(state, 3), get3(state, 6)
    for n in range(span.begin, span.length):
        k = span.k + n
        at, step = of.row[k] * CONTROL, of.interval[k] * CONTROL_STEP
        w, detected, h = get3(heard, n * HEARD), get(heard, n * HEARD + CAME), at + EXPECTED
        f = (of.steps[step], of.steps[step + 1], of.steps[step + 2], of.steps[step + 3], of.steps[step + 4])
        x, y, z = predicted_axis(x, f), predicted_axis(y, f), predicted_axis(z, f)
        v = (
            innovation(w[0], x[0], detected, p, gains[h]),
            innovation(w[1], y[0], detected, p, gains[h + 1]),
            innovation(w[2], z[0], detected, p, gains[h + 2]),
        )
        x, y, z = updated(x, v, gains, at), updated(y, v, gains, at + 9), updated(z, v, gains, at + 18)
        put9(of.errors, n * STATES, x + y + z)
    put9(state, 0, x + y + z)


@part
def collect(parts, of, place, span):
    """Add d² and d times its mean error over scans of one part of a stage to the rows from `place` on."""
    for i in range(0, STATES, 3):
        to = place + COLLECTED * i
        a, b = get3(parts, to), get3(parts, to + 3)
        for n in range(span.begin, span.length):
            d, mean = get3(of.errors, n * STATES + i), of.row[span.k + n] * CONTROL + MEAN_ERROR + i
            a = (a[0] + d[0] * d[0], a[1] + of.gains[mean] * d[0], a[2] + d[1] * d[1])
            b = (b[0] + of.gains[mean + 1] * d[1], b[1] + d[2] * d[2], b[2] + of.gains[mean + 2] * d[2])
        put3(parts, to, a)
        put3(parts, to + 3, b)


@inline
def follow_controls(world, random, beside, span):
    """Run all controls over a strip; random: the address of its noise."""
    controls, memory, p = beside.controls, beside.memory, world.frame[DETECTION]
    width, heard = world.lengths.shape[0] * PARTS * STATES * COLLECTED, address(memory.heard)
    hear(random, address(controls.noise), p, span, heard)
    for i in range(controls.gains.shape[0]):
        state, parts = row(address(memory.states), i * STATES), row(address(memory.parts), i * width)
        if span.k == 0:
            start_control(state, heard, address(world.weights))
        own = Control(
            address(controls.gains[i]),
            address(controls.steps[i]),
            address(world.intervals),
            address(controls.row),
            row(address(memory.errors), i * STRIP * STATES),
        )
        follow(state, own, heard, p, span)
        begin = span.begin
        while begin < span.length:
            part, end = controls.part[span.k + begin], begin + 1
            while end < span.length and controls.part[span.k + end] == part:
                end += 1
            collect(parts, own, part * STATES * COLLECTED, Span(span.k, begin, end))
            begin = end

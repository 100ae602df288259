"""What the controls leave of the squared errors of the multimodel study's filters, and the sums of it.

Letters, each of eight lanes:

    d          a control's error less its mean (9), see `kernels.controls`
    y          squared error of a filter's estimate, or its mean over a stage
    x          regressors of y: d and d² - E d² of each model's control, or their sums over the parts of a stage
    level      the mean of y in the pilot
    explained  Σ slope · x; rho: y - explained - level

`memory.errors` holds d of each control and scan of a strip, STATES rows each; what is not a record is an address or a
number. Arrays and their shapes: `records.Controls`, `ControlSums`, `Products`.
"""

from typing import NamedTuple

import numpy as np

from radarsim.kernels.compile import inline, part
from radarsim.kernels.lanes import add_totals, address, full, get, put, row, total
from radarsim.studies.multimodel.kernels.hypothesis import get3, put3
from radarsim.studies.multimodel.kernels.plots import STRIP
from radarsim.studies.multimodel.kernels.records import (
    COLLECTED,
    MOMENTS,
    OUTPUT,
    PARTS,
    PILOT,
    SIZE,
    STAGE,
    STATES,
)


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


@inline
def leave(y, found, level, of, sums, to):
    """rho of one state: what was found and the level taken off y. Add to its MOMENTS sums from `to` on."""
    counted = get(of.counted, 0)
    rho, found = counted * (y - found - level), counted * found
    square = rho * rho
    sums[to] += of.number * level
    add_totals(sums, to + 1, rho, square, square * square, found * found)
    return rho


@inline
def more(found, d, variance, slopes, at):
    """What is explained of one state, with one control more: d and d² - E d², times the slopes from `at` on."""
    return found + slopes[at] * d + slopes[at + 1] * (d * d - variance)


@inline
def squared(e):
    """e²."""
    return e * e


@part
def leave_scan(of, places, out, truth, to, f):
    """Take off the squared errors of filter f at a scan what the controls explain; as `add_scan`, but of no pilot.

    Three states at a time stay in registers, and no regressor is written down: one state after the other, as in
    `add_stage`, took twice as long.
    """
    residual, slopes, width = row(to.residuals, f * STATES), to.slopes, to.width
    for c in range(0, STATES, 3):
        x, y, z = full(0.0), full(0.0), full(0.0)
        i = (f * STATES + c) * width
        j, k = i + width, i + 2 * width
        for m in range(places.size):
            v = places.first + places.own[m] * places.stride + c
            d, at = get3(places.errors, places.own[m] * STRIP * STATES + c), 1 + 2 * m
            x = more(x, d[0], places.variances[v], slopes, i + at)
            y = more(y, d[1], places.variances[v + 1], slopes, j + at)
            z = more(z, d[2], places.variances[v + 2], slopes, k + at)
        e, sums = get3(out, c), (to.first + f * to.stride + c) * MOMENTS
        x = leave(squared(e[0] - truth[c]), x, slopes[i], of, to.sums, sums)
        y = leave(squared(e[1] - truth[c + 1]), y, slopes[j], of, to.sums, sums + MOMENTS)
        z = leave(squared(e[2] - truth[c + 2]), z, slopes[k], of, to.sums, sums + 2 * MOMENTS)
        put3(residual, c, (x, y, z))


@part
def leave_stage(of, places, means, to, f):
    """Take off a realisation's means over a stage, squared errors of filter f, what the controls explain."""
    residual = row(to.residuals, f * STATES)
    for c in range(STATES):
        put_stage(of.x, c, places)
        at, found = (f * STATES + c) * to.width, full(0.0)
        for j in range(of.count):
            found = found + to.slopes[at + 1 + j] * get(of.x, 1 + j)
        sums = (to.first + f * to.stride + c) * MOMENTS
        put(residual, c, leave(get(means, c), found, to.slopes[at], of, to.sums, sums))


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


class Outcome(NamedTuple):
    """Where the sums of a scan, or of a stage, of all filters lie: addresses, with the rows of the residuals (F, 9).

    slopes (F, 9, width), products (F, 9, many): of this scan or stage
    sums     residual sums, MOMENTS a state: its states are `first` …, and those of the next filter `stride` on
    pilot    1 where products are made, else 0
    """

    residuals: np.ndarray
    slopes: np.ndarray
    width: int
    products: np.ndarray
    many: int
    sums: np.ndarray
    first: int
    stride: int
    pilot: int


@part
def add_scan(of, places, out, truth, to, f):
    """Add a pilot's scan of filter f to the products; out: its outputs; truth (9,)."""
    for c in range(STATES):
        put(of.x, 0, squared(get(out, c) - truth[c]))
        put_scan(of.x, c, places)
        add_products(of, to.products, (f * STATES + c) * to.many)


@part
def add_stage(of, places, means, to, f):
    """Add a pilot's means over a stage, squared errors of filter f, to the products."""
    for c in range(STATES):
        put(of.x, 0, get(means, c))
        put_stage(of.x, c, places)
        add_products(of, to.products, (f * STATES + c) * to.many)


@inline
def outcome(beside, slopes, sums, products, at):
    """Where the sums of scan or stage `at` lie: arrays by scan or stage, filter, and state; sums by filter first."""
    pilot = 1 if beside.controls.mode[0] == PILOT else 0
    count, width, many = slopes.shape[0], slopes.shape[3], products.shape[3]
    own, made = address(slopes[at:]), address(products[at:])
    residuals, first, stride = address(beside.memory.residuals), at * STATES, count * STATES
    return Outcome(residuals, own, width, made, many, address(sums), first, stride, pilot)


@inline
def add_controlled_scan(world, banks, beside, outputs, counted, baseline, k, n):
    """Add scan n of a strip, the reported scan k of the track, of all filters; outputs, counted: addresses."""
    controls, memory, sums = beside.controls, beside.memory, beside.sums
    filters, place = banks.numbers.shape[0], world.place[k]
    x, number = address(memory.x), total(get(counted, 0))
    to = outcome(beside, controls.scans, sums.controlled, beside.products.scans, place)
    errors, truth = row(address(memory.errors), n * STATES), address(world.truth[k])
    variances = address(controls.variances[place])
    for f in range(filters):
        size, own = banks.numbers[f, SIZE], row(address(controls.own), f)
        places = Places(own, size, errors, x, 0, variances, STATES, 0)
        of, out = Rows(x, 2 * size, counted, number), row(outputs, (f * STRIP + n) * OUTPUT)
        if to.pilot == 1:
            add_scan(of, places, out, truth, to, f)
        else:
            leave_scan(of, places, out, truth, to, f)
    if to.pilot == 0:
        base = row(to.residuals, baseline * STATES)
        for f in range(filters):
            own, at = row(to.residuals, f * STATES), to.first + f * to.stride
            add_pairs(own, base, address(sums.controlled_pairs), at)


@inline
def close_controls(banks, beside, stages, counted, count):
    """Add a realisation's means over its stages, of all filters; counted: an address.

    stages: address of the means, as `sums.close_stages` leaves them; count: number of stages.
    """
    controls, memory, sums = beside.controls, beside.memory, beside.sums
    filters, step = banks.numbers.shape[0], PARTS * STATES * COLLECTED
    x, number = address(memory.x), total(get(counted, 0))
    for s in range(count):
        to = outcome(beside, controls.stages, sums.controlled_stage, beside.products.stages, s)
        parts, expected = row(address(memory.parts), s * step), address(controls.sums)
        for f in range(filters):
            size, own = banks.numbers[f, SIZE], row(address(controls.own), f)
            places = Places(own, size, x, parts, count * step, expected, count * PARTS * STATES, s * PARTS * STATES)
            of, means = Rows(x, PARTS * COLLECTED * size, counted, number), row(stages, (f * count + s) * STAGE)
            if to.pilot == 1:
                add_stage(of, places, means, to, f)
            else:
                leave_stage(of, places, means, to, f)
        if to.pilot == 0:
            for f in range(filters):
                for g in range(filters):
                    own, other = row(to.residuals, f * STATES), row(to.residuals, g * STATES)
                    at = ((f * filters + g) * count + s) * STATES
                    add_pairs(own, other, address(sums.controlled_stage_pairs), at)

"""The log likelihood of recorded plots that may be outliers, under a filter that merges by moments.

An outlier is the whole plot or one of its numbers alone, all equally likely, and never two of these at once. Its error
follows one of the laws of `radarsim.kernels.likelihood`, in four strips of eight lanes, a law each. In the first strip,
of the whole plot, lane 0 has the configured σ and lane 1 near outliers; in the others, of a number each, these two have
near outliers to either side. The rest of all are far ones of one width each.

All laws share what a model predicts. They differ by the inverse N of the innovation's covariance and by g = N e of an
innovation e. Merged by moments, the laws of weights w, Σ w = 1, are one update of the prediction, with Σ w g in place
of g and Σ w N less the spread of g in place of N. All three are in the units in which S, the covariance of the stated
law, is the unit matrix.

    v            innovation in these units (3)
    y            of a number: how far an error of one σ moves v (3)
    N            inverse of 1 + Σ a y y' (6), with a in σ² by which a law's variance exceeds the stated one"""

from typing import NamedTuple

import numpy as np

from radarsim.kernels.compiler import inline, kernel, kernel_part
from radarsim.kernels.kalman_algebra import (
    add_outer,
    add_scaled,
    dot,
    factorise,
    inverse_of_factors,
    scale_row,
    times,
    whiten,
)
from radarsim.kernels.lane_matrices import get6
from radarsim.kernels.lanes import WIDTH, address, exponential, full, get, put, row, square_root, total, where_greater
from radarsim.kernels.likelihood import FAR, FAR_COUNT, FAR_WIDTH, NEAR, OFFSET, SPREAD
from radarsim.studies.multimodel.kernels import layout
from radarsim.studies.multimodel.kernels.filter_strip import make_rules, prepare_step
from radarsim.studies.multimodel.kernels.hypothesis import (
    innovation_covariance,
    merge,
    mix_hypotheses,
    predict,
    put_updated,
    whitened_columns,
)
from radarsim.studies.multimodel.kernels.merging_rules import put_shares
from radarsim.studies.multimodel.kernels.multimodel_filters import merge_gpb1, minimum, predict_weights

STRIPS = 4  # of laws: those of outliers that are the whole plot, and those of each of its three numbers
CHANCE = 0  # rows of the laws: the chances of each strip
WHOLE = CHANCE + STRIPS  # of each number, the excess of its variance where the whole plot is an outlier, in σ²
ALONE = WHOLE + 3  # the same where the number alone is one
SHIFT = ALONE + 3  # mean of its error, in σ
LAW_ROWS = SHIFT + 1
IMPOSSIBLE = -1e300  # stands for the logarithm of zero
MIN_WEIGHT = 1e-300  # of a strip
LOG_WEIGHT, SOUNDNESS, UPDATE = 0, 1, 4  # of an update of a hypothesis by all laws; soundness of each number


class PlotLaws(NamedTuple):
    """The laws of outliers that are the whole plot: g (3), N (6), the distance g e, and the determinant of N⁻¹."""

    g: tuple
    N: tuple
    distance: float
    determinant: float


class NumberLaws(NamedTuple):
    """The laws of outliers that are one number alone: what all have of g (3), the multiple of y in it, that of -y y' in
    N, the distance g e, and the determinant of N⁻¹."""

    rest: tuple
    pull: float
    shrink: float
    distance: float
    determinant: float


@kernel
def robust_log_likelihood(
    work, numbers, plots, shifts, models, transitions, intervals, times, rules, outliers, ratios, score, soundness
):
    """Fill score (n,) with the logarithm of each plot's density given the earlier plots, and soundness (n, 3) with the
    probability of each of its numbers to be no outlier; zero and one where there is no plot.

    work, numbers: a filter's memory, started; plots (n, PLOT); shifts (n, 9): of a plot by one σ of each number;
    models, transitions, intervals (n,), times, rules as in `filter_strip`; outliers (4,): their law; ratios (3,): of
    the widest far outliers to the least wide, for each number."""
    laws, listed = np.zeros((LAW_ROWS, WIDTH)), np.zeros(layout.MAX_MODELS, dtype=np.int64)
    updates = np.zeros((layout.MAX_MODELS * layout.MAX_MODELS, UPDATE))
    fill_laws(laws, outliers, ratios)
    filter_rules = make_rules(rules, models.size // layout.MODEL_NUMBERS)
    for k in range(score.size):
        score[k], soundness[k, 0], soundness[k, 1], soundness[k, 2] = 0.0, 1.0, 1.0, 1.0
        interval, none_waiting = intervals[k], numbers[layout.NONE_WAITING] == 1
        if numbers[layout.PREPARED] != interval or not none_waiting:
            dt = times[interval]
            prepare_step(
                address(work), filter_rules.size, address(models), address(transitions), interval, dt, none_waiting
            )
            numbers[layout.PREPARED] = interval if none_waiting else -1
        numbers[layout.NONE_WAITING] = 0
        if plots[k, layout.DETECTED] > 0.5:
            old = numbers[layout.CURRENT] * layout.BANK
            memory = address(work), address(listed), old, layout.BANK - old
            plot = address(plots[k]), address(shifts[k]), address(laws)
            score[k] = take_plot(*memory, filter_rules, *plot, updates, soundness[k])
            numbers[layout.CURRENT], numbers[layout.NONE_WAITING] = 1 - numbers[layout.CURRENT], 1


@kernel
def fill_laws(laws, outliers, ratios):
    """Fill the rows of the laws (LAW_ROWS, WIDTH): the shares are odds of each kind of outlier alone."""
    near, far, offset, spread = outliers[NEAR], outliers[FAR], outliers[OFFSET], outliers[SPREAD]
    for lane in range(WIDTH):
        for strip in range(STRIPS):
            laws[CHANCE + strip, lane] = near / 2.0 if lane < 2 else far / FAR_COUNT
        for i in range(3):
            width = FAR_WIDTH * ratios[i] ** ((lane - 2) / (FAR_COUNT - 1))
            laws[WHOLE + i, lane] = lane * (offset * offset + spread * spread) if lane < 2 else width * width - 1.0
            laws[ALONE + i, lane] = spread * spread if lane < 2 else width * width - 1.0
    laws[CHANCE, 0], laws[CHANCE, 1] = 1.0 - near - far, near
    laws[SHIFT, 0], laws[SHIFT, 1] = offset, -offset
    scale = 1.0 / laws[:STRIPS].sum()
    for strip in range(STRIPS):
        for lane in range(WIDTH):
            laws[CHANCE + strip, lane] *= scale


@kernel_part
def take_plot(work, listed, old, new, rules, plot, shifts, laws, updates, soundness):
    """Compute the new bank from the old one and a plot, and its soundness (3,); returns the logarithm of its density,
    not-a-number if it has none.

    The families are those of `multimodel_filters.step`; updates (…, UPDATE) takes those of this plot."""
    size, family, count = rules.size, rules.family, 0
    for i in range(size):
        hypothesis, model = new + i * layout.HYPOTHESIS, layout.MODEL + layout.MODEL_ROWS * i
        c, first = predict_weights(work, old, size, i), count
        put(work, hypothesis + layout.PROBABILITY, c)
        for j in range(size if family == layout.GPB2 else 1):
            target, weight_row, merged = hypothesis, hypothesis + layout.PROBABILITY, 1
            if family == layout.GPB2:
                target, weight_row = layout.SPARE + j * layout.HYPOTHESIS, layout.WEIGHT + j
                listed[0] = old + j * layout.HYPOTHESIS
            elif family == layout.GPB1:
                listed[0] = old
            else:
                merged = put_shares(work, listed, old, size, c, full(float(i)), layout.MOMENT)
            update = address(updates[count])
            update_by_laws(work, listed, merged, row(work, target), model, plot, shifts, laws, update)
            w = work[weight_row * WIDTH]
            update[LOG_WEIGHT] = update[LOG_WEIGHT] + np.log(w) if w > 0.0 else IMPOSSIBLE
            count += 1
        if family == layout.GPB2:
            merge_pairs(work, listed, size, updates, first, row(work, hypothesis))
    score = log_total(updates, 0, count)
    soundness[:] = 0.0
    for i in range(size):
        p, first = 0.0, i * count // size
        for n in range(first, first + count // size):
            weight = np.exp(updates[n, LOG_WEIGHT] - score)
            p += weight
            for j in range(3):
                soundness[j] += weight * updates[n, SOUNDNESS + j]
        put(work, new + i * layout.HYPOTHESIS + layout.PROBABILITY, full(p))
    if family == layout.GPB1:
        merge_gpb1(work, listed, old, new, size, layout.MOMENT)
    return score if score > 0.1 * IMPOSSIBLE else np.nan


@inline
def log_total(updates, first, stop):
    """The logarithm of the sum of the weights of updates first … stop - 1."""
    top, weight_sum = IMPOSSIBLE, 0.0
    for n in range(first, stop):
        top = max(top, updates[n, LOG_WEIGHT])
    for n in range(first, stop):
        weight_sum += np.exp(updates[n, LOG_WEIGHT] - top)
    return top + np.log(weight_sum)


@kernel_part
def merge_pairs(work, listed, size, updates, first, target):
    """Merge the hypotheses in SPARE … by the weights of their updates, from number `first` on."""
    score = log_total(updates, first, first + size)
    for j in range(size):
        put(work, layout.WEIGHT + j, full(np.exp(updates[first + j, LOG_WEIGHT] - score)))
    count = put_shares(work, listed, layout.SPARE, size, full(1.0), full(0.0), layout.MOMENT)
    merge(work, listed, count, target)


@kernel_part
def update_by_laws(work, listed, count, target, model, plot, shifts, laws, update):
    """Merge the listed hypotheses, predict with the model in row `model`, update with a plot under all laws, write the
    laws' merged hypothesis to `target`, and the logarithm of the plot's density and its soundness to `update`."""
    F = get(work, model), get(work, model + 1), get(work, model + 2), get(work, model + 3), get(work, model + 4)
    Q = get6(work, model + layout.MODEL_Q)
    predicted = predict(mix_hypotheses(work, listed, count), F, Q)
    x, y, z = predicted[0]
    R = plot[3], plot[4], plot[5], plot[6], plot[7], plot[8]
    L, i, determinant = factorise(innovation_covariance(predicted, R))
    root = square_root(i[0]), square_root(i[1]), square_root(i[2])
    v = scale_row(whiten((plot[0] - x[0], plot[1] - y[0], plot[2] - z[0]), L), root)
    units = (
        scale_row(whiten((full(shifts[0]), full(shifts[1]), full(shifts[2])), L), root),
        scale_row(whiten((full(shifts[3]), full(shifts[4]), full(shifts[5])), L), root),
        scale_row(whiten((full(shifts[6]), full(shifts[7]), full(shifts[8])), L), root),
    )
    g, N = merge_laws(work, v, units, laws, update)
    put(work, layout.RESULT, determinant)
    update[LOG_WEIGHT] -= 0.5 * np.log(work[layout.RESULT * WIDTH])
    wx, wy, wz = whitened_columns(predicted, L)
    wx = scale_row(wx[0], root), scale_row(wx[1], root), scale_row(wx[2], root)
    wy = scale_row(wy[0], root), scale_row(wy[1], root), scale_row(wy[2], root)
    wz = scale_row(wz[0], root), scale_row(wz[1], root), scale_row(wz[2], root)
    means = (
        (x[0] + dot(wx[0], g), x[1] + dot(wx[1], g), x[2] + dot(wx[2], g)),
        (y[0] + dot(wy[0], g), y[1] + dot(wy[1], g), y[2] + dot(wy[2], g)),
        (z[0] + dot(wz[0], g), z[1] + dot(wz[1], g), z[2] + dot(wz[2], g)),
    )
    gx = times(N, wx[0]), times(N, wx[1]), times(N, wx[2])
    gy = times(N, wy[0]), times(N, wy[1]), times(N, wy[2])
    gz = times(N, wz[0]), times(N, wz[1]), times(N, wz[2])
    put_updated(target, predicted, means, (gx, gy, gz), (wx, wy, wz))


@inline
def merge_laws(work, v, units, laws, update):
    """Σ w g, and Σ w N less the spread of g, over all laws of an innovation v; units: y of each number. Written to
    `update`: the logarithm of Σ chance · density for S = 1, and the soundness."""
    whole = plot_laws(v, units, laws)
    strips = (
        number_laws(v, units[0], get(laws, ALONE), get(laws, SHIFT)),
        number_laws(v, units[1], get(laws, ALONE + 1), get(laws, SHIFT)),
        number_laws(v, units[2], get(laws, ALONE + 2), get(laws, SHIFT)),
    )
    put_weights(work, laws, whole, strips, update)
    w = get(work, layout.RESULT)
    weight_sum, g = total(w), (full(total(w * whole.g[0])), full(total(w * whole.g[1])), full(total(w * whole.g[2])))
    update[SOUNDNESS] = update[SOUNDNESS + 1] = update[SOUNDNESS + 2] = work[layout.RESULT * WIDTH] - weight_sum
    for i in range(3):
        strip_sum, _, strip_g = strip_means(get(work, layout.RESULT + 1 + i), strips[i], units[i])
        update[SOUNDNESS + i] -= strip_sum
        weight_sum, g = weight_sum + strip_sum, add_scaled(g, strip_sum, strip_g)
    scale = 1.0 / weight_sum
    g = g[0] * scale, g[1] * scale, g[2] * scale
    d = whole.g[0] - g[0], whole.g[1] - g[1], whole.g[2] - g[2]
    N = add_outer(whole.N, -1.0, d)
    N = (
        full(total(w * N[0])), full(total(w * N[1])), full(total(w * N[2])),
        full(total(w * N[3])), full(total(w * N[4])), full(total(w * N[5])),
    )  # fmt: skip
    for i in range(3):
        w = get(work, layout.RESULT + 1 + i)
        strip_sum, pull, strip_g = strip_means(w, strips[i], units[i])
        offset = strips[i].pull - pull
        d = strip_g[0] - g[0], strip_g[1] - g[1], strip_g[2] - g[2]
        N = add_outer(add_outer(N, -strip_sum, d), -total(w * (strips[i].shrink + offset * offset)), units[i])
        N = N[0] + strip_sum, N[1], N[2], N[3] + strip_sum, N[4], N[5] + strip_sum
    for i in range(3):
        update[SOUNDNESS + i] = 1.0 + scale * update[SOUNDNESS + i]
    update[LOG_WEIGHT] += np.log(weight_sum)
    return g, (N[0] * scale, N[1] * scale, N[2] * scale, N[3] * scale, N[4] * scale, N[5] * scale)


@inline
def put_weights(work, laws, whole, strips, update):
    """Put the weights of the laws, chance times density for S = 1, into rows RESULT …, up to a factor, of which
    `update` has the logarithm."""
    zero, distances = full(0.0), (whole.distance, strips[0].distance, strips[1].distance, strips[2].distance)
    determinants = whole.determinant, strips[0].determinant, strips[1].determinant, strips[2].determinant
    least = full(1e300)
    for s in range(STRIPS):
        least = where_greater(get(laws, CHANCE + s), zero, minimum(least, distances[s]), least)
    put(work, layout.RESULT, least)
    min_distance = work[layout.RESULT * WIDTH]
    for lane in range(1, WIDTH):
        min_distance = min(min_distance, work[layout.RESULT * WIDTH + lane])
    for s in range(STRIPS):
        chance = get(laws, CHANCE + s)
        exponent = where_greater(chance, zero, 0.5 * (min_distance - distances[s]), zero)
        put(work, layout.RESULT + s, chance * exponential(exponent) / square_root(determinants[s]))
    update[LOG_WEIGHT] = -0.5 * min_distance - 1.5 * np.log(2.0 * np.pi)


@inline
def plot_laws(v, units, laws):
    """The laws of outliers that are the whole plot, at an innovation v."""
    one, zero = full(1.0), full(0.0)
    M = add_outer((one, zero, zero, one, zero, one), get(laws, WHOLE), units[0])
    M = add_outer(add_outer(M, get(laws, WHOLE + 1), units[1]), get(laws, WHOLE + 2), units[2])
    L, i, determinant = factorise(M)
    N, whitened = inverse_of_factors(L, i), whiten(v, L)
    return PlotLaws(times(N, v), N, dot(scale_row(whitened, i), whitened), determinant)


@inline
def number_laws(v, y, excess, shift):
    """The laws of outliers that are one number alone, at an innovation v: N is 1 less a multiple of y y'."""
    square, along = dot(y, y), dot(y, v)
    inverse = 1.0 / where_greater(square, full(0.0), square, full(1.0))
    determinant = 1.0 + excess * square
    scale, rest = 1.0 / determinant, add_scaled(v, 0.0 - along * inverse, y)
    off = along + shift * square
    pull = off * inverse * scale
    return NumberLaws(rest, pull, excess * scale, dot(rest, rest) + off * pull, determinant)


@inline
def strip_means(w, strip, y):
    """The sum of the weights of a number's laws, and their means of the multiple of y in g and of g."""
    weight_sum = total(w)
    pull = total(w * strip.pull) / max(weight_sum, MIN_WEIGHT)
    return weight_sum, pull, add_scaled(strip.rest, pull, y)

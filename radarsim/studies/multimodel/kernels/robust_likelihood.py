"""The log likelihood of recorded plots whose numbers may be outliers, under a filter that merges by moments.

A plot is taken in one number after the other. The error of each follows one of the laws of
`radarsim.kernels.likelihood`: the stated one, or one of eight of outliers, a lane each: of near ones to either side in
lanes 0 and 1, of far ones in the rest.

All laws share what a model predicts. Merged by moments, they are one update of it: of an innovation e whose covariance
with the state is c, and whose variance is T under a law of weight w, Σ w = 1, the pull Σ w e / T moves the mean along
c, and the shrinkage Σ w / T, less the spread of e / T, takes c c' from the covariance.

    e            innovations of the three numbers (3)
    A            covariance of what is predicted of them (6)
    L            lower factor by which a number, once taken, changes those that follow (3), as of `factorise`
    cx, cy, cz   covariance of an axis with the numbers (3 x 3); wx, wy, wz: of each number when its turn comes"""

import numpy as np

from radarsim.kernels.compiler import inline, kernel, kernel_part
from radarsim.kernels.kalman_algebra import dot, scale_row, whiten
from radarsim.kernels.lane_matrices import get6
from radarsim.kernels.lanes import WIDTH, address, exponential, full, get, put, row, square_root, total, where_greater
from radarsim.kernels.likelihood import FAR, FAR_COUNT, FAR_WIDTH, NEAR, OFFSET, SPREAD
from radarsim.studies.multimodel.kernels import layout
from radarsim.studies.multimodel.kernels.filter_strip import make_rules, prepare_step
from radarsim.studies.multimodel.kernels.hypothesis import merge, mix_hypotheses, position_rows, predict, put_updated
from radarsim.studies.multimodel.kernels.merging_rules import put_shares
from radarsim.studies.multimodel.kernels.multimodel_filters import merge_gpb1, minimum, predict_weights

# Rows of the laws of a number: chance, variance and mean of its error as an outlier; chance and variance as stated.
CHANCE, VARIANCE, SHIFT, STATED_CHANCE, STATED_VARIANCE, LAW_ROWS = range(6)
IMPOSSIBLE = -1e300  # stands for the logarithm of zero
LOG_WEIGHT, SOUNDNESS, UPDATE = 0, 1, 4  # of an update of a hypothesis by all laws; soundness of each number


@kernel
def robust_log_likelihood(
    work, numbers, plots, directions, models, transitions, intervals, times, rules, laws, score, soundness
):
    """Fill score (n,) with the logarithm of each plot's density given the earlier plots, and soundness (n, 3) with the
    probability of each of its numbers to be no outlier; zero and one where there is no plot.

    work, numbers: a filter's memory, started; plots (n, PLOT); directions (n, 9): along which each number is measured,
    whose densities are those of the numbers; models, transitions, intervals (n,), times, rules as in `filter_strip`;
    laws (3, LAW_ROWS, WIDTH) as of `fill_laws`."""
    listed = np.zeros(layout.MAX_MODELS, dtype=np.int64)
    updates = np.zeros((layout.MAX_MODELS * layout.MAX_MODELS, UPDATE))
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
            plot = address(plots[k]), address(directions[k]), address(laws)
            score[k] = take_plot(*memory, filter_rules, *plot, updates, soundness[k])
            numbers[layout.CURRENT], numbers[layout.NONE_WAITING] = 1 - numbers[layout.CURRENT], 1


@kernel
def fill_laws(laws, outliers, sigmas, ratios):
    """Fill the laws (3, LAW_ROWS, WIDTH) of three numbers. outliers (3, 4): the law of outliers of each; sigmas (3,);
    ratios (3,): of the widest far outliers to the least wide."""
    for i in range(3):
        variance, near, far = sigmas[i] * sigmas[i], outliers[i, NEAR], outliers[i, FAR]
        laws[i, STATED_CHANCE], laws[i, STATED_VARIANCE], laws[i, SHIFT] = 1.0 - near - far, variance, 0.0
        laws[i, SHIFT, 0] = outliers[i, OFFSET] * sigmas[i]
        laws[i, SHIFT, 1] = -laws[i, SHIFT, 0]
        for lane in range(WIDTH):
            width = FAR_WIDTH * ratios[i] ** ((lane - 2) / (FAR_COUNT - 1))
            spread = outliers[i, SPREAD]
            laws[i, CHANCE, lane] = near / 2.0 if lane < 2 else far / FAR_COUNT
            laws[i, VARIANCE, lane] = (1.0 + spread * spread if lane < 2 else width * width) * variance


@kernel_part
def take_plot(work, listed, old, new, rules, plot, directions, laws, updates, soundness):
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
            update_by_laws(work, listed, merged, row(work, target), model, plot, directions, laws, update)
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
def update_by_laws(work, listed, count, target, model, plot, directions, laws, update):
    """Merge the listed hypotheses, predict with the model in row `model`, update with a plot under all laws, write the
    laws' merged hypothesis to `target`, and the logarithm of the plot's density and its soundness to `update`."""
    F = get(work, model), get(work, model + 1), get(work, model + 2), get(work, model + 3), get(work, model + 4)
    Q = get6(work, model + layout.MODEL_Q)
    predicted = predict(mix_hypotheses(work, listed, count), F, Q)
    x, y, z = predicted[0]
    D = (
        (full(directions[0]), full(directions[1]), full(directions[2])),
        (full(directions[3]), full(directions[4]), full(directions[5])),
        (full(directions[6]), full(directions[7]), full(directions[8])),
    )
    rows_x, rows_y, rows_z = position_rows(predicted)
    cx = along(rows_x[0], D), along(rows_x[1], D), along(rows_x[2], D)
    cy = along(rows_y[0], D), along(rows_y[1], D), along(rows_y[2], D)
    cz = along(rows_z[0], D), along(rows_z[1], D), along(rows_z[2], D)
    e = along((plot[0] - x[0], plot[1] - y[0], plot[2] - z[0]), D)
    c0, c1, c2 = (cx[0][0], cy[0][0], cz[0][0]), (cx[0][1], cy[0][1], cz[0][1]), (cx[0][2], cy[0][2], cz[0][2])
    A = dot(D[0], c0), dot(D[0], c1), dot(D[0], c2), dot(D[1], c1), dot(D[1], c2), dot(D[2], c2)
    L, pull, shrinkage = take_numbers(work, e, A, laws, update)
    wx = whiten(cx[0], L), whiten(cx[1], L), whiten(cx[2], L)
    wy = whiten(cy[0], L), whiten(cy[1], L), whiten(cy[2], L)
    wz = whiten(cz[0], L), whiten(cz[1], L), whiten(cz[2], L)
    means = (
        (x[0] + dot(wx[0], pull), x[1] + dot(wx[1], pull), x[2] + dot(wx[2], pull)),
        (y[0] + dot(wy[0], pull), y[1] + dot(wy[1], pull), y[2] + dot(wy[2], pull)),
        (z[0] + dot(wz[0], pull), z[1] + dot(wz[1], pull), z[2] + dot(wz[2], pull)),
    )
    gx = scale_row(wx[0], shrinkage), scale_row(wx[1], shrinkage), scale_row(wx[2], shrinkage)
    gy = scale_row(wy[0], shrinkage), scale_row(wy[1], shrinkage), scale_row(wy[2], shrinkage)
    gz = scale_row(wz[0], shrinkage), scale_row(wz[1], shrinkage), scale_row(wz[2], shrinkage)
    put_updated(target, predicted, means, (gx, gy, gz), (wx, wy, wz))


@inline
def along(h, D):
    """The components of h (3) along the directions D (3)."""
    return dot(h, D[0]), dot(h, D[1]), dot(h, D[2])


@inline
def take_numbers(work, e, A, laws, update):
    """L, pull (3) and shrinkage (3) of the three numbers, each taken after those before it. Written to `update`: the
    logarithm of the density of all three, and their soundness."""
    update[LOG_WEIGHT] = -1.5 * np.log(2.0 * np.pi)
    pull_0, shrinkage_0, update[SOUNDNESS] = merge_laws(work, e[0], A[0], row(laws, 0), update)
    l10, l20 = A[1] * shrinkage_0, A[2] * shrinkage_0
    e1, a11, a12 = e[1] - A[1] * pull_0, A[3] - l10 * A[1], A[4] - l10 * A[2]
    pull_1, shrinkage_1, update[SOUNDNESS + 1] = merge_laws(work, e1, a11, row(laws, LAW_ROWS), update)
    l21 = a12 * shrinkage_1
    e2, a22 = e[2] - A[2] * pull_0 - a12 * pull_1, A[5] - l20 * A[2] - l21 * a12
    pull_2, shrinkage_2, update[SOUNDNESS + 2] = merge_laws(work, e2, a22, row(laws, 2 * LAW_ROWS), update)
    return (l10, l20, l21), (pull_0, pull_1, pull_2), (shrinkage_0, shrinkage_1, shrinkage_2)


@inline
def merge_laws(work, e, a, laws, update):
    """Pull and shrinkage of a number with innovation e, of whose variance a is that of its prediction; and its
    soundness. The logarithm of its density but for the factor 1/√2π is added to that in `update`."""
    zero, chance = full(0.0), get(laws, CHANCE)
    T, stated_T, off = a + get(laws, VARIANCE), a + get(laws, STATED_VARIANCE), e - get(laws, SHIFT)
    pulls, stated_pull = off / T, e / stated_T
    distances, stated_distance = off * pulls, e * stated_pull
    put(work, layout.RESULT, where_greater(chance, zero, minimum(distances, stated_distance), stated_distance))
    min_distance = work[layout.RESULT * WIDTH]
    for lane in range(1, WIDTH):
        min_distance = min(min_distance, work[layout.RESULT * WIDTH + lane])
    least = full(min_distance)
    exponents = where_greater(chance, zero, 0.5 * (least - distances), zero)
    weights = chance * exponential(exponents) / square_root(T)
    stated = get(laws, STATED_CHANCE) * exponential(0.5 * (least - stated_distance)) / square_root(stated_T)
    weight_sum = full(total(weights)) + stated
    scale = 1.0 / weight_sum
    pull = (full(total(weights * pulls)) + stated * stated_pull) * scale
    d, stated_d = pulls - pull, stated_pull - pull
    stated_part = stated * (1.0 / stated_T - stated_d * stated_d)
    shrinkage = (full(total(weights * (1.0 / T - d * d))) + stated_part) * scale
    put(work, layout.RESULT, weight_sum)
    put(work, layout.RESULT + 1, stated * scale)
    update[LOG_WEIGHT] += np.log(work[layout.RESULT * WIDTH]) - 0.5 * min_distance
    return pull, shrinkage, work[(layout.RESULT + 1) * WIDTH]

"""A filter of one order over recorded plots, with its hypotheses on the folds, row by row.

Letters: x (3, n) states of n hypotheses, w (n,) logarithms of their weights, P (6,) their common covariance, packed as
in `radarsim.kernels.kalman_algebra`; e innovations, S their variance, D span of velocity."""

import math

import numpy as np

from radarsim.kernels.compiler import kernel, summing_kernel
from radarsim.kernels.kalman_algebra import (
    add_outer,
    add_scaled,
    add_spread,
    factorise,
    predict_covariance,
    predict_state,
    scale_row,
    take_rate,
    take_value,
    whiten,
)
from radarsim.kernels.lanes import exponential_series
from radarsim.kernels.likelihood import FAR, LAW_COUNT, LOG_DENSITY, MEAN, NEAR, OFFSET, SPREAD, VARIANCE, fill_laws

FARTHEST = 9.0  # standard deviations of the velocity's innovation within which folds are tried
START_RANGES = 3  # of a track, among which gross errors are left out
SHIFT = 1.5 * 2.0**52  # added to a number, leaves it whole
ROUNDING = 1e-9  # of the logarithm of a ratio
SMALLEST_MASS = 1e-300  # of the laws of a number
FLAT_VARIANCE = 0.45  # of a folded velocity, in squares of the span: its density is even, to 2 exp(-2 pi² 0.45) = 3e-4
MAX_SEQUENCES = 10_000_000  # sequences of folds at a row: states of 240 MB, seconds


@kernel
def take_exponentials(x):
    """Replace numbers x (n,) of at most 0 by their exponentials, to 3 units in the last place; below -700 as at -700.

    As `radarsim.kernels.lanes.exponential`, in loops that run in vector registers."""
    powers = np.empty(x.size)
    exponents = powers.view(np.int64)
    for i in range(x.size):
        a = x[i] if x[i] > -700.0 else -700.0
        shifted = a * 1.4426950408889634 + SHIFT
        n = shifted - SHIFT
        r = a - n * 0.693147180369123816 - n * 1.90821492927058770e-10
        x[i], powers[i] = exponential_series(r), shifted
    for i in range(x.size):
        exponents[i] = (exponents[i] << 52) + (1023 << 52)  # the last bits of a shifted number are those of n
    for i in range(x.size):
        x[i] *= powers[i]


@summing_kernel
def sum_of(x):
    """The sum of numbers x (n,)."""
    total = 0.0
    for i in range(x.size):
        total += x[i]
    return total


@kernel
def log_sum_exp(w):
    """The logarithm of Σ exp(w), of logarithms of weights w (…)."""
    greatest = w.max()
    weights = w.ravel() - greatest
    take_exponentials(weights)
    return greatest + np.log(sum_of(weights))


@kernel
def extrapolate(x, P, F, Q, variance):
    """Predict states and covariance over an interval, in place; F (5,), Q (6,) of unit variance."""
    f = F[0], F[1], F[2], F[3], F[4]
    predicted_P = predict_covariance(P, f, (Q[0] * variance, Q[1] * variance, Q[2] * variance, Q[3] * variance,
                                     Q[4] * variance, Q[5] * variance))  # fmt: skip
    for i in range(6):
        P[i] = predicted_P[i]
    for i in range(x.shape[1]):
        x[0, i], x[1, i], x[2, i] = predict_state((x[0, i], x[1, i], x[2, i]), f)


@kernel
def take_range(x, w, P, R, z):
    """Update with a range z of variance R, in place; returns the logarithm of its density over all hypotheses."""
    updated_P, gain, S = take_value((P[0], P[1], P[2], P[3], P[4], P[5]), R, 1.0)
    prior_log_weight = log_sum_exp(w)
    for i in range(w.size):
        e = z - x[0, i]
        x[0, i], x[1, i], x[2, i] = add_scaled((x[0, i], x[1, i], x[2, i]), e, gain)
        w[i] -= e * e / (2.0 * S)
    for i in range(6):
        P[i] = updated_P[i]
    return log_sum_exp(w) - prior_log_weight - 0.5 * np.log(2.0 * np.pi * S)


@kernel
def take_range_of_laws(x, w, P, R, z, outliers, span, laws):
    """As `take_range`, of a range that may be an outlier, whose laws are those of `radarsim.kernels.likelihood`; merged
    by moments. Returns the logarithm of its density and the probability that it is no outlier. outliers (4,): the law
    of these; laws: a work array (3, LAW_COUNT)."""
    p, S = (P[0], P[1], P[2]), P[0] + R
    prior_log_weight, chances, greatest = log_sum_exp(w), np.zeros(LAW_COUNT), -np.inf
    fill_laws(laws, 0.0, S, R, outliers, span)
    laws[LOG_DENSITY] += 0.5 * laws[MEAN] * laws[MEAN] / laws[VARIANCE]
    posterior = np.empty((LAW_COUNT, w.size))
    for law in range(LAW_COUNT):
        for i in range(w.size):
            d = z - x[0, i] - laws[MEAN, law]
            posterior[law, i] = w[i] + laws[LOG_DENSITY, law] - 0.5 * d * d / laws[VARIANCE, law]
        greatest = max(greatest, posterior[law].max())
    posterior -= greatest
    w[:] = 0.0
    for law in range(LAW_COUNT):
        if laws[LOG_DENSITY, law] > -np.inf:
            take_exponentials(posterior[law])
            chances[law] = sum_of(posterior[law])
            w += posterior[law]
    total = chances.sum()
    chances /= total
    gain = (chances / laws[VARIANCE]).sum()
    drift = (chances * laws[MEAN] / laws[VARIANCE]).sum()
    # The mean over laws of ((e - mean) / variance)², as a polynomial of e.
    squares = chances / (laws[VARIANCE] * laws[VARIANCE])
    c2, c1, c0 = squares.sum(), (squares * laws[MEAN]).sum(), (squares * laws[MEAN] * laws[MEAN]).sum()
    square = 0.0
    for i in range(w.size):
        e, weight = z - x[0, i], w[i] / total
        pull = gain * e - drift
        square += weight * ((c2 * e - 2.0 * c1) * e + c0 - pull * pull)
        w[i] = np.log(weight)
        x[0, i], x[1, i], x[2, i] = add_scaled((x[0, i], x[1, i], x[2, i]), pull, p)
    shrink = gain - max(square, 0.0)
    updated_P = add_outer((P[0], P[1], P[2], P[3], P[4], P[5]), -shrink, p)
    for i in range(6):
        P[i] = updated_P[i]
    return greatest + np.log(total) - prior_log_weight, chances[0]


@kernel
def nearby_folds(S, D):
    """The number of folds to either side that may matter for an innovation of variance S."""
    return int(FARTHEST * math.sqrt(S) / D) + 1


@kernel
def likeliest(w, max_count, min_ratio):
    """The indices of at most `max_count` weights of at least `min_ratio`, in their order; of equal ones the first.

    w (n,) are logarithms, the best one's 0."""
    floor = np.log(min_ratio) if min_ratio > 0.0 else -np.inf
    indices, count = np.empty(w.size, dtype=np.int64), 0
    for i in range(w.size):
        indices[count] = i
        # An exponential only at the very limit, where the logarithm may round to its other side.
        count += w[i] >= floor + ROUNDING or (w[i] >= floor - ROUNDING and np.exp(w[i]) >= min_ratio)
    # Where weights are no numbers, the density, which is none either, shows it.
    if count == 0:
        return np.zeros(1, dtype=np.int64)
    if count <= max_count:
        return indices[:count]
    large = w[indices[:count]]
    threshold = np.partition(large, count - max_count)[count - max_count]
    ties_left, kept = max_count - (large > threshold).sum(), 0
    for k in range(count):
        is_tie = large[k] == threshold
        indices[kept] = indices[k]
        kept += large[k] > threshold or (is_tie and ties_left > 0)
        ties_left -= is_tie
    return indices[: min(max(kept, 1), max_count)]


@kernel
def fold_innovations(x, w, v, D, max_fold, S):
    """The innovations (n, folds) of a velocity v for each hypothesis and fold, and the logarithms of their weights with
    a predicted variance S; max_fold as for `take_velocity`."""
    n, folds = w.size, 2 * max(max_fold, 0) + 1
    e, weight, factor = np.empty((n, folds)), np.empty((n, folds)), 0.5 / S
    for i in range(n):
        innovation = v - x[1, i]
        if max_fold >= 0:
            innovation -= D * np.rint(innovation / D)
        for j in range(folds):
            e[i, j] = innovation + D * (j - folds // 2)
            weight[i, j] = w[i] - e[i, j] * e[i, j] * factor
    return e, weight


@kernel
def weigh_outliers(w, e, weight, R, S, D, max_fold, outliers, span):
    """Weigh the velocity of innovations e (n, folds) for what it may be, in place: all folds of a hypothesis gain by a
    far outlier alike, which says nothing of the fold: were it divided among them, all would live on. e becomes the
    innovations by which a hypothesis moves.

    Returns the logarithm of the density, the probability of no outlier, and by what the variance of the innovation
    changes. Arguments as for `take_velocity`."""
    n, folds = e.shape
    log_norm, nearest_fold = 0.5 * np.log(2.0 * np.pi * S), folds // 2
    T = S + (outliers[OFFSET] * outliers[OFFSET] + outliers[SPREAD] * outliers[SPREAD]) * R
    width = D if max_fold >= 0 else max(span, math.sqrt(T))
    sound, near = 1.0 - outliers[NEAR] - outliers[FAR], outliers[NEAR] * math.sqrt(S / T)
    far, factor = outliers[FAR] * math.exp(log_norm) / width, 0.5 / S
    best, prior_sum, total, sound_sum, pull_sum, spread = w.max(), 0.0, 0.0, 0.0, 0.0, 0.0
    shares = np.empty((n, folds + 2))  # of the folds beside the nearest; of a sound number with that; of a hypothesis
    for i in range(n):
        e2 = e[i, nearest_fold] * e[i, nearest_fold]
        shares[i, folds], shares[i, folds + 1] = -e2 * factor, w[i] - best
        for j in range(folds):
            shares[i, j] = (e2 - e[i, j] * e[i, j]) * factor
    take_exponentials(shares.ravel())
    for i in range(n):
        e2, branches, squares = e[i, nearest_fold] * e[i, nearest_fold], 0.0, 0.0
        for j in range(folds):
            branches += shares[i, j]
            squares += shares[i, j] * e[i, j] * e[i, j]
        regular, close = sound * shares[i, folds], 0.0
        if near > 0.0:
            close = near * math.exp(-0.5 * e2 / T)
        square = regular * squares + close * S / T * e2
        regular *= branches
        mass, prior = max(regular + close + far, SMALLEST_MASS), shares[i, folds + 1]
        pull = (regular + close * S / T) / mass
        shift = math.log(mass / branches) + e2 * factor
        for j in range(folds):
            weight[i, j] += shift
            e[i, j] *= pull
        prior_sum += prior
        total += prior * mass
        sound_sum += prior * regular
        pull_sum += prior * mass * pull
        spread += prior * (1.0 - pull) * square
    return math.log(total / prior_sum) - log_norm, sound_sum / total, (spread - pull_sum * S) / total


@kernel
def take_velocity(x, w, P, R, v, D, max_fold, merge, max_count, min_ratio, outliers, span):
    """Update with a velocity v of variance R; returns states and weights, the logarithm of the density of v over all
    hypotheses and folds, and the probability that v is no outlier. P is updated in place.

    max_fold: folds to either side of the nearest that are tried; -1: none, v is not folded. merge: hypotheses are
    merged into one; else at most `max_count` are kept, of at least `min_ratio` times the weight of the best. outliers
    (4,): near ones are normal, the offset a part of their width, of velocities that are not folded; far ones uniform
    over the span D of folded velocities, or `span` of the data; merged by moments."""
    updated_P, gain, S = take_rate((P[0], P[1], P[2], P[3], P[4], P[5]), R, 1.0)
    e, weight = fold_innovations(x, w, v, D, max_fold, S)
    folds, soundness = e.shape[1], 1.0
    if outliers[NEAR] + outliers[FAR] > 0.0:
        density, soundness, spread = weigh_outliers(w, e, weight, R, S, D, max_fold, outliers, span)
        updated_P = add_outer((P[0], P[1], P[2], P[3], P[4], P[5]), spread, gain)
    else:
        density = log_sum_exp(weight) - log_sum_exp(w) - 0.5 * np.log(2.0 * np.pi * S)
    best = weight.max()
    if merge:
        p = np.exp(weight[0] - best)
        p /= p.sum()
        mean = (p * e[0]).sum()
        updated_P = add_outer(updated_P, (p * (e[0] - mean) ** 2).sum(), gain)
        order, e[0, 0], weight[0, 0] = np.zeros(1, dtype=np.int64), mean, best
    else:
        order = likeliest(weight.ravel() - best, max_count, min_ratio)
    for i in range(6):
        P[i] = updated_P[i]
    states, weights = np.empty((3, order.size)), np.empty(order.size)
    for k in range(order.size):
        i, j = order[k] // folds, order[k] % folds
        states[0, k], states[1, k], states[2, k] = add_scaled((x[0, i], x[1, i], x[2, i]), e[i, j], gain)
        weights[k] = weight[i, j] - best
    return states, weights, density, soundness


@kernel
def visible_share(P, variances, D):
    """The share of a difference between hypotheses that the next range or folded velocity can show: two that differ by
    d standard deviations, and are merged by moments, change its density by about the cube of d times this."""
    even = math.exp(-2.0 * math.pi**2 * (P[3] + variances[1]) / (D * D))
    return max(math.sqrt(P[0] / (P[0] + variances[0])), even ** (1.0 / 3.0))


@kernel
def merge_alike(x, w, P, distance):
    """Merge hypotheses that differ by less than a distance, in standard deviations, by moments: each with the first one
    so near. Returns states and weights; P is updated in place.

    Two that took another fold once, long ago, agree by now, and would be thousands."""
    n, count, mass, limit = w.size, 0, 0.0, distance * distance
    lower, parts, _ = factorise((P[0], P[1], P[2], P[3] if P[3] > 0.0 else 1.0, P[4], P[5] if P[5] > 0.0 else 1.0))
    roots = math.sqrt(parts[0]), math.sqrt(parts[1]), math.sqrt(parts[2])
    group, totals, means = np.empty(n, dtype=np.int64), np.zeros(n), np.zeros((3, n))
    shares = w.copy()
    take_exponentials(shares)
    first0, first1, first2 = np.empty(n), np.empty(n), np.empty(n)
    for i in range(n):
        state = x[0, i], x[1, i], x[2, i]
        y = scale_row(whiten(state, lower), roots)
        k = count  # without a branch in the loop, which looks at eight at a time
        for j in range(count):
            d0, d1, d2 = y[0] - first0[j], y[1] - first1[j], y[2] - first2[j]
            k = min(k, j if d0 * d0 + d1 * d1 + d2 * d2 < limit else count)
        if k == count:
            first0[k], first1[k], first2[k] = y
            count += 1
        share = max(shares[i], SMALLEST_MASS)
        group[i], mass = k, mass + share
        totals[k] += share
        means[0, k], means[1, k], means[2, k] = add_scaled((means[0, k], means[1, k], means[2, k]), share, state)
    means = means[:, :count] / totals[:count]
    if count < n:
        wide_P, none = (P[0], P[1], P[2], P[3], P[4], P[5]), (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        for i in range(n):
            k = group[i]
            d = x[0, i] - means[0, k], x[1, i] - means[1, k], x[2, i] - means[2, k]
            wide_P = add_spread(wide_P, shares[i] / mass, none, d)
        for i in range(6):
            P[i] = wide_P[i]
    return means, np.log(totals[:count])


@kernel
def rate_variances(F, Q, present, prior, variances, manoeuvre_variance, with_velocities):
    """The variances (n,) of the rate at each row, of the ranges up to it and, where asked for, of the velocities before
    it, were all folds known. Arguments as for `log_likelihood`."""
    rates, P, no_states, has_range = np.empty(len(F)), prior.copy(), np.empty((3, 0)), False
    for k in range(len(F)):
        if k > 0:
            extrapolate(no_states, P, F[k], Q[k], manoeuvre_variance)
        if present[k, 0] and has_range:
            P[0], P[1], P[2], P[3], P[4], P[5] = take_value((P[0], P[1], P[2], P[3], P[4], P[5]), variances[0], 1.0)[0]
        elif present[k, 0]:
            P[0], P[1], P[2], has_range = variances[0], 0.0, 0.0, True
        rates[k] = P[3]
        if with_velocities and has_range and present[k, 1]:
            P[0], P[1], P[2], P[3], P[4], P[5] = take_rate((P[0], P[1], P[2], P[3], P[4], P[5]), variances[1], 1.0)[0]
    return rates


@kernel
def count_telling_rows(F, Q, rows, present, prior, variances, manoeuvre_variance):
    """The number of rows up to the last whose folded velocity tells something. The velocity of each later row has an
    even density, even if all folds before it and all ranges were known: ranges after a row tell no more of its rate
    than those before the row that tell most. Arguments as for `log_likelihood`."""
    motion = F, Q, present, prior, variances, manoeuvre_variance
    rates, least, telling = rate_variances(*motion, True), rate_variances(*motion, False).min(), 0
    for k in range(len(rows)):
        known = rates[k] * least / (rates[k] + least) if least > 0.0 else 0.0
        if not variances[1] + known >= FLAT_VARIANCE * rows[k, 2] * rows[k, 2]:
            telling = k + 1
    return telling


@kernel
def log_likelihood(
    F, Q, rows, present, prior, variances, manoeuvre_variance, reach, merge, max_count, min_ratio, merge_distance,
    outliers, span, start_factor, score, soundness
):  # fmt: skip
    """Fill in the log likelihoods of a track of n rows under a filter; false where the filter leaves too many folds.

    F (n, 5), Q (n, 6): motion to each row, of unit variance; rows (n, 3): range, velocity and its span; present (n, 2):
    which of the first two count (a kernel has no not-a-number); prior (6,): covariance before the first plot;
    variances (2,) of range and velocity; reach: 0: velocities are not folded, 1: the nearest fold, 2: all folds that
    matter; merge, max_count, min_ratio as in `take_velocity`; merge_distance: of `merge_alike`, where plots show all of
    a difference; outliers (2, 4): their laws; span (2,): of the data; start_factor: on the variance of the first
    START_RANGES ranges, which are no outliers: they find the state. Filled: score (n, 2), zero where nothing is
    measured, and soundness (n, 2), the probabilities that the numbers are no outliers."""
    x, w, P, ranges, laws = np.zeros((3, 1)), np.zeros(1), prior.copy(), 0, np.empty((3, LAW_COUNT))
    motion = F, Q, rows, present, prior, variances, manoeuvre_variance
    telling_rows = count_telling_rows(*motion) if reach == 2 else len(rows)
    for k in range(len(rows)):
        z, v, D = rows[k, 0], rows[k, 1], rows[k, 2]
        if k > 0:
            extrapolate(x, P, F[k], Q[k], manoeuvre_variance)
        score[k], soundness[k] = 0.0, 1.0
        if present[k, 0]:
            if ranges >= START_RANGES and outliers[0, NEAR] + outliers[0, FAR] > 0.0:
                score[k, 0], soundness[k, 0] = take_range_of_laws(x, w, P, variances[0], z, outliers[0], span[0], laws)
            elif ranges > 0:
                factor = start_factor if ranges < START_RANGES else 1.0
                score[k, 0] = take_range(x, w, P, factor * variances[0], z)
            else:
                x[0, :] = z
                P[0], P[1], P[2] = start_factor * variances[0], 0.0, 0.0
            ranges += 1
        if ranges > 0 and present[k, 1]:
            S, max_fold = P[3] + variances[1], reach - 1
            if not S > 0.0:
                return False
            if reach == 2:
                if k >= telling_rows:
                    score[k, 1] = -math.log(D)
                    continue
                if 2.0 * FARTHEST * math.sqrt(S) / D * w.size > MAX_SEQUENCES:
                    return False
                max_fold = nearby_folds(S, D)
            hypotheses = max_fold, merge, max_count, min_ratio
            x, w, score[k, 1], soundness[k, 1] = take_velocity(
                x, w, P, variances[1], v, D, *hypotheses, outliers[1], span[1]
            )
            if w.size > 1:
                x, w = merge_alike(x, w, P, merge_distance / visible_share(P, variances, D))
    return True

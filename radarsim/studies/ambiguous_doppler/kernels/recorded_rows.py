"""A filter of one order over recorded plots, with its hypotheses on the folds, row by row.

Letters: x (3, n) states of n hypotheses, w (n,) logarithms of their weights, P (6,) their common covariance, packed as
in `radarsim.kernels.kalman_algebra`; e innovations, S their variance, D span of velocity."""

import math

import numpy as np

from radarsim.kernels.compiler import kernel
from radarsim.kernels.kalman_algebra import (
    add_outer,
    add_scaled,
    predict_covariance,
    predict_state,
    take_rate,
    take_value,
)
from radarsim.kernels.likelihood import FAR, LAW_COUNT, LOG_DENSITY, MEAN, NEAR, OFFSET, SPREAD, VARIANCE, fill_laws

FARTHEST = 9.0  # standard deviations of the velocity's innovation within which folds are tried
START_RANGES = 3  # of a track, among which gross errors are left out
NEGLIGIBLE = 80.0  # below the logarithm of the greatest weight
INVISIBLE = 45.0  # the same, in a sum of weights: thousands of such change no digit
MAX_SEQUENCES = 10_000_000  # sequences of folds at a row: states of 240 MB, seconds


@kernel
def log_sum_exp(w):
    """The logarithm of Σ exp(w), of logarithms of weights w (…)."""
    greatest, total = w.max(), 0.0
    for x in w.flat:
        if not x < greatest - INVISIBLE:
            total += np.exp(x - greatest)
    return greatest + np.log(total)


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
    posterior = np.empty((w.size, LAW_COUNT))
    for i in range(w.size):
        e = z - x[0, i]
        for law in range(LAW_COUNT):
            d = e - laws[MEAN, law]
            posterior[i, law] = w[i] + laws[LOG_DENSITY, law] - 0.5 * d * d / laws[VARIANCE, law]
            greatest = max(greatest, posterior[i, law])
    for i in range(w.size):
        w[i] = 0.0
        for law in range(LAW_COUNT):
            if posterior[i, law] > greatest - NEGLIGIBLE:
                chance = np.exp(posterior[i, law] - greatest)
                chances[law] += chance
                w[i] += chance
    total = chances.sum()
    chances /= total
    gain = (chances / laws[VARIANCE]).sum()
    drift = (chances * laws[MEAN] / laws[VARIANCE]).sum()
    square = 0.0
    for i in range(w.size):
        e, weight = z - x[0, i], w[i] / total
        pull = gain * e - drift
        for law in range(LAW_COUNT):
            step = (e - laws[MEAN, law]) / laws[VARIANCE, law]
            square += weight * chances[law] * (step * step - pull * pull)
        w[i] = np.log(weight) if weight > 0.0 else -1e300
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
    """The indices of at most `max_count` weights of at least `min_ratio`, the best first, equal ones in their order.

    w (n,) are logarithms, the best one's 0."""
    threshold, ties_left = w.min(), max_count
    floor = np.log(min_ratio) - 1e-9 if min_ratio > 0.0 else -np.inf  # spares the exponentials of most
    if (w >= floor).sum() > max_count:
        threshold = np.partition(w, w.size - max_count)[w.size - max_count]
        ties_left = max_count - (w > threshold).sum()
    indices, count = np.empty(min(w.size, max_count), dtype=np.int64), 0
    for i in range(w.size):
        if w[i] >= threshold and w[i] >= floor and np.exp(w[i]) >= min_ratio:
            if w[i] == threshold:
                ties_left -= 1
            if (w[i] > threshold or ties_left >= 0) and count < indices.size:
                indices[count] = i
                count += 1
    if count == 0:  # weights that are no numbers: the density, which is none either, shows it
        return np.zeros(1, dtype=np.int64)
    indices = indices[:count].copy()
    return indices[np.argsort(-w[indices], kind="mergesort")]


@kernel
def fold_innovations(x, w, v, D, max_fold, S):
    """The innovations (n, folds) of a velocity v for each hypothesis and fold, and the logarithms of their weights with
    a predicted variance S; max_fold as for `take_velocity`."""
    n, folds = w.size, 2 * max(max_fold, 0) + 1
    e, weight = np.empty((n, folds)), np.empty((n, folds))
    for i in range(n):
        innovation = v - x[1, i]
        if max_fold >= 0:
            innovation -= D * np.rint(innovation / D)
        for j in range(folds):
            e[i, j] = innovation + D * (j - folds // 2)
            weight[i, j] = w[i] - e[i, j] * e[i, j] / (2.0 * S)
    return e, weight


@kernel
def take_velocity(x, w, P, R, v, D, max_fold, merge, max_count, min_ratio, outliers, span):
    """Update with a velocity v of variance R; returns states and weights, the likeliest first, the logarithm of the
    density of v over all hypotheses and folds, and the probability that v is no outlier. P is updated in place.

    max_fold: folds to either side of the nearest that are tried; -1: none, v is not folded. merge: hypotheses are
    merged into one; else at most `max_count` are kept, of at least `min_ratio` times the weight of the best. outliers
    (4,): near ones are normal, the offset a part of their width; far ones uniform over the span D of folded velocities,
    or `span` of the data; merged by moments."""
    updated_P, gain, S = take_rate((P[0], P[1], P[2], P[3], P[4], P[5]), R, 1.0)
    e, weight = fold_innovations(x, w, v, D, max_fold, S)
    n, folds = e.shape
    log_norm, soundness = 0.5 * np.log(2.0 * np.pi * S), 1.0
    if outliers[NEAR] + outliers[FAR] > 0.0:
        T = S + (outliers[OFFSET] * outliers[OFFSET] + outliers[SPREAD] * outliers[SPREAD]) * R
        width = D if max_fold >= 0 else max(span, math.sqrt(T))
        far, near_share = outliers[FAR] * math.exp(log_norm) / width, outliers[NEAR] * math.sqrt(S / T)
        best, total, factor, sound, spread = w.max(), 0.0, 0.0, 0.0, 0.0
        for i in range(n):
            regular, close, square = 0.0, 0.0, 0.0
            for j in range(folds):
                e2 = e[i, j] * e[i, j]
                r = (1.0 - outliers[NEAR] - outliers[FAR]) * math.exp(-0.5 * e2 / S)
                c = near_share * math.exp(-0.5 * e2 / T) if near_share > 0.0 else 0.0
                weight[i, j] = r + c
                regular += r
                close += c
                square += (r + c * S / T) * e2
            # A far outlier says nothing of the fold. Were it divided among the folds, all of them would live on.
            for j in range(folds):
                part = weight[i, j] / (regular + close) if regular + close > 0.0 else (1.0 if j == folds // 2 else 0.0)
                part *= regular + close + far
                weight[i, j] = w[i] + math.log(part) if part > 0.0 else -1e300
            prior, mass = math.exp(w[i] - best), regular + close + far
            pull = (regular + close * S / T) / mass if mass > 0.0 else 0.0
            e[i] *= pull
            total += prior * mass
            sound += prior * regular
            factor += prior * mass * pull
            spread += prior * (1.0 - pull) * square
        soundness = sound / total
        P_before = (P[0], P[1], P[2], P[3], P[4], P[5])
        updated_P = add_outer(P_before, (spread - factor * S) / total, gain)
    density = log_sum_exp(weight) - log_sum_exp(w) - log_norm
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
def log_likelihood(
    F,
    Q,
    rows,
    present,
    prior,
    variances,
    manoeuvre_variance,
    reach,
    merge,
    max_count,
    min_ratio,
    outliers,
    span,
    start_factor,
    score,
    soundness,
):
    """Fill in the log likelihoods of a track of n rows under a filter; false where the filter leaves too many folds.

    F (n, 5), Q (n, 6): motion to each row, of unit variance; rows (n, 3): range, velocity and its span; present (n, 2):
    which of the first two count (a kernel has no not-a-number); prior (6,): covariance before the first plot;
    variances (2,) of range and velocity; reach: 0: velocities are not folded, 1: the nearest fold, 2: all folds that
    matter; merge, max_count, min_ratio as in `take_velocity`; outliers (2, 4): their laws; span (2,): of the data;
    start_factor: on the variance of the first START_RANGES ranges, which are no outliers: they find the state. Filled:
    score (n, 2), zero where nothing is measured, and soundness (n, 2), the probabilities that the numbers are no
    outliers."""
    x, w, P, ranges, laws = np.zeros((3, 1)), np.zeros(1), prior.copy(), 0, np.empty((3, LAW_COUNT))
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
                if variances[1] >= D * D:  # all velocities are equally likely, to 2 exp(-2 pi²): no information
                    score[k, 1] = -math.log(D)
                    continue
                if 2.0 * FARTHEST * math.sqrt(S) / D * w.size > MAX_SEQUENCES:
                    return False
                max_fold = nearby_folds(S, D)
            hypotheses = max_fold, merge, max_count, min_ratio
            x, w, score[k, 1], soundness[k, 1] = take_velocity(
                x, w, P, variances[1], v, D, *hypotheses, outliers[1], span[1]
            )
    return True

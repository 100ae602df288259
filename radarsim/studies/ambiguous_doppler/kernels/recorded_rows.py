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

FARTHEST = 9.0  # standard deviations of the velocity's innovation within which folds are tried
MAX_SEQUENCES = 10_000_000  # sequences of folds at a row: states of 240 MB, seconds


@kernel
def log_sum_exp(w):
    """The logarithm of Σ exp(w), of logarithms of weights w (…)."""
    greatest = w.max()
    return greatest + np.log(np.exp(w - greatest).sum())


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
def nearby_folds(S, D):
    """The number of folds to either side that may matter for an innovation of variance S."""
    return int(FARTHEST * math.sqrt(S) / D) + 1


@kernel
def likeliest(w, max_count, min_ratio):
    """The indices of at most `max_count` weights of at least `min_ratio`, the best first, equal ones in their order.

    w (n,) are logarithms, the best one's 0."""
    threshold, ties_left = w.min(), max_count
    if w.size > max_count:
        threshold = np.partition(w, w.size - max_count)[w.size - max_count]
        ties_left = max_count - (w > threshold).sum()
    indices, count = np.empty(min(w.size, max_count), dtype=np.int64), 0
    for i in range(w.size):
        if w[i] >= threshold and np.exp(w[i]) >= min_ratio:
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
def take_velocity(x, w, P, R, v, D, max_fold, merge, max_count, min_ratio):
    """Update with a velocity v of variance R; returns states and weights, the likeliest first, and the logarithm of the
    density of v over all hypotheses and folds. P is updated in place.

    max_fold: folds to either side of the nearest that are tried; -1: none, v is not folded. merge: hypotheses are
    merged into one; else at most `max_count` are kept, of at least `min_ratio` times the weight of the best."""
    updated_P, gain, S = take_rate((P[0], P[1], P[2], P[3], P[4], P[5]), R, 1.0)
    n, folds = w.size, 2 * max(max_fold, 0) + 1
    e, weight = np.empty((n, folds)), np.empty((n, folds))
    for i in range(n):
        innovation = v - x[1, i]
        if max_fold >= 0:
            innovation -= D * np.rint(innovation / D)
        for j in range(folds):
            e[i, j] = innovation + D * (j - folds // 2)
            weight[i, j] = w[i] - e[i, j] * e[i, j] / (2.0 * S)
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
    return states, weights, density


@kernel
def log_likelihood(
    F, Q, rows, present, prior, variances, manoeuvre_variance, reach, merge, max_count, min_ratio, score
):
    """Fill in the log likelihoods of a track of n rows under a filter; false where the filter leaves too many folds.

    F (n, 5), Q (n, 6): motion to each row, of unit variance; rows (n, 3): range, velocity and its span; present (n, 2):
    which of the first two count (a kernel has no not-a-number); prior (6,): covariance before the first plot;
    variances (2,) of range and velocity; reach: 0: velocities are not folded, 1: the nearest fold, 2: all folds that
    matter; merge, max_count, min_ratio as in `take_velocity`. Filled: score (n, 2), zero where nothing is measured."""
    x, w, P, started = np.zeros((3, 1)), np.zeros(1), prior.copy(), False
    for k in range(len(rows)):
        z, v, D = rows[k, 0], rows[k, 1], rows[k, 2]
        if k > 0:
            extrapolate(x, P, F[k], Q[k], manoeuvre_variance)
        score[k] = 0.0
        if present[k, 0]:
            if started:
                score[k, 0] = take_range(x, w, P, variances[0], z)
            else:
                x[0, :] = z
                P[0], P[1], P[2], started = variances[0], 0.0, 0.0, True
        if started and present[k, 1]:
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
            x, w, score[k, 1] = take_velocity(x, w, P, variances[1], v, D, max_fold, merge, max_count, min_ratio)
    return True

"""A filter of one order over recorded plots, with its hypotheses on the folds: one row after the other.

Letters as in the book: x (3, n) states of n hypotheses, w (n,) logarithms of their weights, P (6,) their common
covariance, packed as in `kernels.algebra`; e innovations, S their variance, D span of velocity."""

import math

import numpy as np

from radarsim.kernels.algebra import add_outer, add_scaled, predicted, predicted_covariance, take_rate, take_value
from radarsim.kernels.compile import kernel

FARTHEST = 9.0  # standard deviations of the velocity's innovation up to which folds are looked at
MOST_LOOKED_AT = 10_000_000  # sequences of folds at a row: states of 240 MB, seconds


@kernel
def total_of(w):
    """The logarithm of Σ exp(w) over logarithms (…) of weights."""
    most = w.max()
    return most + np.log(np.exp(w - most).sum())


@kernel
def extrapolate(x, P, F, Q, variance):
    """States and covariance over an interval, in place; F (5,), Q (6,) of unit variance."""
    f = F[0], F[1], F[2], F[3], F[4]
    of = predicted_covariance(P, f, (Q[0] * variance, Q[1] * variance, Q[2] * variance, Q[3] * variance,
                                     Q[4] * variance, Q[5] * variance))  # fmt: skip
    for i in range(6):
        P[i] = of[i]
    for i in range(x.shape[1]):
        x[0, i], x[1, i], x[2, i] = predicted((x[0, i], x[1, i], x[2, i]), f)


@kernel
def take_range(x, w, P, R, z):
    """Take in a range z of variance R, all in place; the logarithm of its density over all hypotheses."""
    of, gain, S = take_value((P[0], P[1], P[2], P[3], P[4], P[5]), R, 1.0)
    before = total_of(w)
    for i in range(w.size):
        e = z - x[0, i]
        x[0, i], x[1, i], x[2, i] = add_scaled((x[0, i], x[1, i], x[2, i]), e, gain)
        w[i] -= e * e / (2.0 * S)
    for i in range(6):
        P[i] = of[i]
    return total_of(w) - before - 0.5 * np.log(2.0 * np.pi * S)


@kernel
def folds_near(S, D):
    """The number of folds to either side that are near enough to matter, of an innovation of variance S."""
    return int(FARTHEST * math.sqrt(S) / D) + 1


@kernel
def likeliest(w, most, least):
    """Which of weights (n,), logarithms with the best one's 0, are at least `least`, at most `most` of them: the best
    first, of equal ones in their order."""
    bar, equal = w.min(), most
    if w.size > most:
        bar = np.partition(w, w.size - most)[w.size - most]
        equal = most - (w > bar).sum()
    found, count = np.empty(min(w.size, most), dtype=np.int64), 0
    for i in range(w.size):
        if w[i] >= bar and np.exp(w[i]) >= least:
            if w[i] == bar:
                equal -= 1
            if (w[i] > bar or equal >= 0) and count < found.size:
                found[count] = i
                count += 1
    if count == 0:  # weights that are no numbers: whoever asks finds the density to be none
        return np.zeros(1, dtype=np.int64)
    found = found[:count].copy()
    return found[np.argsort(-w[found], kind="mergesort")]


@kernel
def take_velocity(x, w, P, R, v, D, far, merge, most, least):
    """Take in a velocity v of variance R, P in place: states and weights after it, the likeliest first, and the
    logarithm of its density over all hypotheses and folds.

    far: folds to either side of the nearest that are looked at; -1: none, v is as measured. merge: hypotheses into one;
    else at most `most` are kept, of at least `least` times the weight of the best."""
    of, gain, S = take_rate((P[0], P[1], P[2], P[3], P[4], P[5]), R, 1.0)
    n, folds = w.size, 2 * max(far, 0) + 1
    e, weight = np.empty((n, folds)), np.empty((n, folds))
    for i in range(n):
        near = v - x[1, i]
        if far >= 0:
            near -= D * np.rint(near / D)
        for j in range(folds):
            e[i, j] = near + D * (j - folds // 2)
            weight[i, j] = w[i] - e[i, j] * e[i, j] / (2.0 * S)
    density = total_of(weight) - total_of(w) - 0.5 * np.log(2.0 * np.pi * S)
    top = weight.max()
    if merge:
        p = np.exp(weight[0] - top)
        p /= p.sum()
        mean = (p * e[0]).sum()
        of = add_outer(of, (p * (e[0] - mean) ** 2).sum(), gain)
        order, e[0, 0], weight[0, 0] = np.zeros(1, dtype=np.int64), mean, top
    else:
        order = likeliest(weight.ravel() - top, most, least)
    for i in range(6):
        P[i] = of[i]
    after, weights = np.empty((3, order.size)), np.empty(order.size)
    for k in range(order.size):
        i, j = order[k] // folds, order[k] % folds
        after[0, k], after[1, k], after[2, k] = add_scaled((x[0, i], x[1, i], x[2, i]), e[i, j], gain)
        weights[k] = weight[i, j] - top
    return after, weights, density


@kernel
def log_likelihood(F, Q, rows, there, prior, variances, manoeuvre, reach, merge, most, least, score):
    """The logarithm of the likelihood of a track of n rows under a filter; false where it leaves too many folds.

    F (n, 5), Q (n, 6): motion to each row, of unit variance; rows (n, 3): range, velocity and its span; there (n, 2):
    which of the first two count (a kernel knows no not-a-number); prior (6,): covariance before the first plot;
    variances (2,) of range and velocity; manoeuvre: variance; reach: 0: velocities as measured, 1: with the nearest
    fold, 2: with all that matter; merge, most, least as in `take_velocity`. Out: score (n, 2), zero where none is."""
    x, w, P, started = np.zeros((3, 1)), np.zeros(1), prior.copy(), False
    for k in range(len(rows)):
        z, v, D = rows[k, 0], rows[k, 1], rows[k, 2]
        if k > 0:
            extrapolate(x, P, F[k], Q[k], manoeuvre)
        score[k] = 0.0
        if there[k, 0]:
            if started:
                score[k, 0] = take_range(x, w, P, variances[0], z)
            else:
                x[0, :] = z
                P[0], P[1], P[2], started = variances[0], 0.0, 0.0, True
        if started and there[k, 1]:
            S, far = P[3] + variances[1], reach - 1
            if not S > 0.0:
                return False
            if reach == 2:
                if variances[1] >= D * D:  # every velocity is as likely, to 2 exp(-2 pi²): it tells nothing
                    score[k, 1] = -math.log(D)
                    continue
                if 2.0 * FARTHEST * math.sqrt(S) / D * w.size > MOST_LOOKED_AT:
                    return False
                far = folds_near(S, D)
            x, w, score[k, 1] = take_velocity(x, w, P, variances[1], v, D, far, merge, most, least)
    return True

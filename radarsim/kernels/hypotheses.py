"""The logarithm of the likelihood of one recorded track, from the innovations of its Kalman filter (Schweppe 1965).

Letters as in the book: x state, P its covariance, F transition, Q process noise of unit variance, h the row of a number
that was measured, S variance of its innovation e, K = p / S gain with p = P h. A plot is taken in one number after the
other, each with an error of its own.

An outlier is a number whose σ is FACTOR times the stated one; each is one with the probability `share`. What the two
explanations leave of x and P is merged by moments (GPB1).

Errors that last from plot to plot are states of their own (`lasting`), each of the first order: its correlation falls
with time as a power.

Hypotheses on the folds of one realisation: what is branched over folds, and which of the branches are kept.

A hypothesis is a row of numbers, of which a velocity's innovation, folded to -D/2 … D/2, leaves it open by how many
whole spans D it is to be unfolded. Given its folds it is a linear filter, whose number the study holds; what is here
needs of each the logarithm of its weight, that innovation e and its variance S alone. Letters:

    e       innovation of the velocity with the nearest fold; e + n D are those of the other folds
    near    logarithm of the weight with the nearest fold, w - c e²
    w       logarithm of the weight before
    c       1/(2S)
"""

from typing import NamedTuple

import numpy as np

from radarsim.kernels.compile import inline, kernel, part
from radarsim.kernels.lanes import WIDTH, row

# ---- innovations -----------------------------------------------------------------------------------------------------
FACTOR = 10.0


@kernel
def log_likelihood(x, P, F, Q, H, z, variance, present, manoeuvre, share, white, log_densities):
    """The log-likelihood of n rows of m numbers, for a state of d components.

    x (d,) and P (d, d) are what is known at the first row, and are overwritten; F, Q (n, d, d): transition to each row
    and what the manoeuvre of unit variance adds; H (n, m, d), z, variance (n, m): the numbers, where `present`;
    manoeuvre: its variance; share: of outliers; white: 1, or 0 where the errors are states. Out: log_densities (n, m),
    the logarithm of each number's density given those before it, zero where it is missing."""
    product, p = np.zeros_like(P), np.zeros_like(x)
    for k in range(z.shape[0]):
        if k > 0:
            extrapolate(x, P, product, p, F[k], Q[k], manoeuvre)
        for j in range(z.shape[1]):
            log_densities[k, j] = 0.0
            if present[k, j]:
                e, spread = innovation(x, P, H[k, j], z[k, j], p)
                log_densities[k, j] = take(x, P, p, e, spread + white * variance[k, j], variance[k, j], share)


@kernel
def innovation(x, P, h, z, p):
    """The innovation z - h x of a number, and the part h P h' of its variance; p (d,) takes P h'."""
    e, spread, d = z, 0.0, x.size
    for a in range(d):
        e -= h[a] * x[a]
        p[a] = 0.0
        for b in range(d):
            p[a] += P[a, b] * h[b]
    for a in range(d):
        spread += h[a] * p[a]
    return e, spread


@kernel
def extrapolate(x, P, product, predicted_x, F, Q, manoeuvre):
    """x = F x and P = F P F' + manoeuvre Q, in place; product (d, d) and predicted_x (d,) are work arrays.

    P stays symmetric to the last digit, here and in `take`: a difference between its halves grows from row to row."""
    d = x.size
    for a in range(d):
        predicted_x[a] = 0.0
        for b in range(d):
            predicted_x[a] += F[a, b] * x[b]
            product[a, b] = 0.0
            for c in range(d):
                product[a, b] += F[a, c] * P[c, b]
    for a in range(d):
        x[a] = predicted_x[a]
        for b in range(a + 1):
            P[a, b] = manoeuvre * Q[a, b]
            for c in range(d):
                P[a, b] += product[a, c] * F[b, c]
            P[b, a] = P[a, b]


@kernel
def take(x, P, p, e, S, variance, share):
    """Update x and P in place by a number with innovation e of variance S; returns the logarithm of its density.

    variance: of the number's error; that of an outlier is FACTOR² times as large."""
    T = S + (FACTOR * FACTOR - 1.0) * variance
    plain = np.log(1.0 - share) - 0.5 * (np.log(2.0 * np.pi * S) + e * e / S)
    density, w, v = plain, 1.0, 0.0
    if share > 0.0:
        wide = np.log(share) - 0.5 * (np.log(2.0 * np.pi * T) + e * e / T)
        larger = max(plain, wide)
        density = larger + np.log(np.exp(plain - larger) + np.exp(wide - larger))
        w, v = np.exp(plain - density), np.exp(wide - density)
    gain = w / S + v / T
    difference = 1.0 / S - 1.0 / T
    shrink = gain - w * v * e * e * difference * difference
    for a in range(x.size):
        x[a] += gain * e * p[a]
        for b in range(a + 1):
            P[a, b] -= shrink * p[a] * p[b]
            P[b, a] = P[a, b]
    return density


def lasting(x, P, with_errors, F, Q, H, variance, correlation):
    """The arguments x, P, F, Q and H of `log_likelihood`, white 0 and manoeuvre 1, for errors that last: after the d
    components of the state come m errors of the numbers, in their standard deviations.

    x (d,) and P (d, d) at the first row, there with_errors (d, m) their covariance with the errors; F, Q (n, d, d): Q
    of the manoeuvre as it is; H (n, m, d), variance (n, m); correlation (n,): of errors with those of the row before.
    """
    n, m, d = H.shape
    errors, eye = slice(d, d + m), np.eye(m)
    state, wide = np.append(x, np.zeros(m)), np.block([[P, with_errors], [with_errors.T, eye]])
    F_, Q_ = np.zeros((n, d + m, d + m)), np.zeros((n, d + m, d + m))
    F_[:, :d, :d], Q_[:, :d, :d] = F, Q
    F_[:, errors, errors] = correlation[:, None, None] * eye
    Q_[:, errors, errors] = (1 - correlation**2)[:, None, None] * eye
    return state, wide, F_, Q_, np.concatenate([H, np.sqrt(variance)[:, :, None] * eye], axis=2)


# ---- hypotheses ------------------------------------------------------------------------------------------------------
NOTHING = -1e300  # logarithm of the weight of a place that holds no hypothesis
FARTHEST = 80.0  # squared deviations, in variances, up to which folds are looked at: exp(-40) of the nearest's weight
COLUMNS = 11  # of `Lists`
INNOVATION, NEAR, FALL = 0, 1, 2  # columns of e, near and c behind the two lists


class Lists(NamedTuple):
    """Work arrays for hypotheses, by their addresses (`room`, `most`: numbers per column)."""

    #: two lists of four columns, `room` numbers each, the last of them w; then e, near and c of the list that is
    #: branched
    columns: np.ndarray
    #: logarithms of weights and innovations of what branches, then a copy of the weights; `most` numbers each
    children: np.ndarray
    parents: np.ndarray  #: of which hypothesis each is a branch
    room: int
    most: int


@inline
def column(lists, list_index, column_index):
    """Address of a column of one of the lists."""
    return row(lists.columns, (4 * list_index + column_index) * (lists.room // WIDTH))


@inline
def greatest(x):
    """The greatest of eight numbers in memory."""
    maximum = x[0]
    for i in range(1, WIDTH):
        maximum = max(maximum, x[i])
    return maximum


@part
def least_kept(weights, count, copy, limit):
    """The `limit`-th greatest of `count` weights; limit < count. Hoare's selection on a copy.

    The selected weights move to the front of the copy without a branch: the order is as good as random, so the
    processor would predict half of the branches wrongly."""
    for i in range(count):
        copy[i] = weights[i]
    while count > 1:
        pivot, greater, equals, selected = copy[count // 2], 0, 0, 0
        for i in range(count):
            greater += 1 if copy[i] > pivot else 0
            equals += 1 if copy[i] == pivot else 0
        if limit <= greater:
            for i in range(count):
                weight = copy[i]
                copy[selected] = weight
                selected += 1 if weight > pivot else 0
        elif limit <= greater + equals:
            return pivot
        else:
            limit -= greater + equals
            for i in range(count):
                weight = copy[i]
                copy[selected] = weight
                selected += 1 if weight < pivot else 0
        count = selected
    return copy[0]


@part
def keep_greatest(lists, count, limit):
    """Keep the `limit` children with the greatest weights, of equal ones the first; returns the least weight."""
    weights, innovations = lists.children, row(lists.children, lists.most // WIDTH)
    smallest_weight = least_kept(weights, count, row(lists.children, 2 * lists.most // WIDTH), limit)
    greater = 0
    for i in range(count):
        greater += 1 if weights[i] > smallest_weight else 0
    equals_to_keep, written = limit - greater, 0
    for i in range(count):
        take = weights[i] > smallest_weight
        if weights[i] == smallest_weight and equals_to_keep > 0:
            take, equals_to_keep = True, equals_to_keep - 1
        if take:
            weights[written], innovations[written], lists.parents[written] = (
                weights[i],
                innovations[i],
                lists.parents[i],
            )
            written += 1
    return smallest_weight


@part
def branched(lists, list_index, count, D, best, deepest, limit):
    """Branch `count` hypotheses over their folds, down to best - deepest and FARTHEST; returns how many are kept.

    At most the `limit` best are kept."""
    e, near, c = column(lists, 2, INNOVATION), column(lists, 2, NEAR), column(lists, 2, FALL)
    w = column(lists, list_index, 3)
    weights, innovations = lists.children, row(lists.children, lists.most // WIDTH)
    smallest_weight, children = best - deepest, 0
    for i in range(count):
        if near[i] < smallest_weight:
            continue
        weight_floor = max(smallest_weight, near[i] - 0.5 * FARTHEST)
        for n in range(2 * lists.most):
            side = 1.0 if (n & 1) == 1 else -1.0  # folds 0, 1, -1, 2, -2, …
            f = e[i] + side * ((n + 1) // 2) * D
            weight = w[i] - c[i] * f * f
            if weight < weight_floor:
                if side * e[i] <= 0.0:  # the nearer side of the pair: all that follow are farther
                    break
                continue
            if children == lists.most:
                smallest_weight = max(smallest_weight, keep_greatest(lists, children, limit))
                weight_floor, children = max(smallest_weight, weight_floor), limit
                if weight < weight_floor:
                    continue
            weights[children], innovations[children], lists.parents[children] = weight, f, i
            children += 1
    if children > limit:
        keep_greatest(lists, children, limit)
        children = limit
    return children

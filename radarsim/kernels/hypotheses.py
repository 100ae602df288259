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
def log_likelihood(x, P, F, Q, H, z, variance, there, manoeuvre, share, white, score):
    """The log-likelihood of n rows of m numbers, for a state of d components.

    x (d,) and P (d, d) are what is known at the first row, and are overwritten; F, Q (n, d, d): transition to each row
    and what the manoeuvre of unit variance adds; H (n, m, d), z, variance (n, m): the numbers, where `there`;
    manoeuvre: its variance; share: of outliers; white: 1, or 0 where the errors are states. Out: score (n, m), the
    logarithm of each number's density given those before it, zero where it is not there."""
    room, p = np.zeros_like(P), np.zeros_like(x)
    for k in range(z.shape[0]):
        if k > 0:
            extrapolate(x, P, room, p, F[k], Q[k], manoeuvre)
        for j in range(z.shape[1]):
            score[k, j] = 0.0
            if there[k, j]:
                e, spread = innovation(x, P, H[k, j], z[k, j], p)
                score[k, j] = take(x, P, p, e, spread + white * variance[k, j], variance[k, j], share)


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
def extrapolate(x, P, room, moved, F, Q, manoeuvre):
    """x = F x and P = F P F' + manoeuvre Q, in place; room (d, d) and moved (d,) are for the sums. P stays symmetric to
    the last digit, here and in `take`: what its halves differ by grows from row to row."""
    d = x.size
    for a in range(d):
        moved[a] = 0.0
        for b in range(d):
            moved[a] += F[a, b] * x[b]
            room[a, b] = 0.0
            for c in range(d):
                room[a, b] += F[a, c] * P[c, b]
    for a in range(d):
        x[a] = moved[a]
        for b in range(a + 1):
            P[a, b] = manoeuvre * Q[a, b]
            for c in range(d):
                P[a, b] += room[a, c] * F[b, c]
            P[b, a] = P[a, b]


@kernel
def take(x, P, p, e, S, variance, share):
    """Take in a number of innovation e, of variance S: x, P in place; variance: of its error, which that of an outlier
    is FACTOR² times as large as. The logarithm of its density."""
    T = S + (FACTOR * FACTOR - 1.0) * variance
    plain = np.log(1.0 - share) - 0.5 * (np.log(2.0 * np.pi * S) + e * e / S)
    density, w, v = plain, 1.0, 0.0
    if share > 0.0:
        wide = np.log(share) - 0.5 * (np.log(2.0 * np.pi * T) + e * e / T)
        most = max(plain, wide)
        density = most + np.log(np.exp(plain - most) + np.exp(wide - most))
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
    """Room for hypotheses, by addresses (`room`, `most`: numbers per column)."""

    #: two lists of four columns, `room` numbers each, the last of them w; then e, near and c of the list that is
    #: branched
    columns: np.ndarray
    #: logarithms of weights and innovations of what branches, then a copy of the weights; `most` numbers each
    children: np.ndarray
    parents: np.ndarray  #: of which hypothesis each is a branch
    room: int
    most: int


@inline
def column(lists, which, number):
    """Address of column `number` of list `which`."""
    return row(lists.columns, (4 * which + number) * (lists.room // WIDTH))


@inline
def greatest(x):
    """The greatest of eight lanes, as all of them; by a row of memory."""
    most = x[0]
    for i in range(1, WIDTH):
        most = max(most, x[i])
    return most


@part
def least_kept(weights, count, copy, most):
    """The `most`-th greatest of `count` weights; most < count. By halves as in Hoare's selection, on a copy. What is
    kept of it moves to its front without a branch: as good as random, half of the branches would be foretold
    wrongly."""
    for i in range(count):
        copy[i] = weights[i]
    while count > 1:
        pivot, above, equal, kept = copy[count // 2], 0, 0, 0
        for i in range(count):
            above += 1 if copy[i] > pivot else 0
            equal += 1 if copy[i] == pivot else 0
        if most <= above:
            for i in range(count):
                weight = copy[i]
                copy[kept] = weight
                kept += 1 if weight > pivot else 0
        elif most <= above + equal:
            return pivot
        else:
            most -= above + equal
            for i in range(count):
                weight = copy[i]
                copy[kept] = weight
                kept += 1 if weight < pivot else 0
        count = kept
    return copy[0]


@part
def keep_greatest(lists, count, most):
    """Of `count` children keep the `most` with the greatest weights, of equal ones the first; their least weight."""
    weights, found = lists.children, row(lists.children, lists.most // WIDTH)
    least = least_kept(weights, count, row(lists.children, 2 * lists.most // WIDTH), most)
    above = 0
    for i in range(count):
        above += 1 if weights[i] > least else 0
    equal, kept = most - above, 0
    for i in range(count):
        take = weights[i] > least
        if weights[i] == least and equal > 0:
            take, equal = True, equal - 1
        if take:
            weights[kept], found[kept], lists.parents[kept] = weights[i], found[i], lists.parents[i]
            kept += 1
    return least


@part
def branched(lists, which, count, D, best, deepest, most):
    """Branch `count` hypotheses over their folds, down to best - deepest and FARTHEST, the `most` best: how many."""
    e, near, c = column(lists, 2, INNOVATION), column(lists, 2, NEAR), column(lists, 2, FALL)
    w = column(lists, which, 3)
    weights, found = lists.children, row(lists.children, lists.most // WIDTH)
    least, made = best - deepest, 0
    for i in range(count):
        if near[i] < least:
            continue
        floor = max(least, near[i] - 0.5 * FARTHEST)
        for n in range(2 * lists.most):
            side = 1.0 if (n & 1) == 1 else -1.0  # folds 0, 1, -1, 2, -2, …
            f = e[i] + side * ((n + 1) // 2) * D
            weight = w[i] - c[i] * f * f
            if weight < floor:
                if side * e[i] <= 0.0:  # the nearer side of the pair: all that follow are farther
                    break
                continue
            if made == lists.most:
                least = max(least, keep_greatest(lists, made, most))
                floor, made = max(least, floor), most
                if weight < floor:
                    continue
            weights[made], found[made], lists.parents[made] = weight, f, i
            made += 1
    if made > most:
        keep_greatest(lists, made, most)
        made = most
    return made

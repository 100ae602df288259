"""Hypotheses on the folds of one realisation: what is branched over folds, and which of the branches are kept.

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

from radarsim.kernels.compile import inline, part
from radarsim.kernels.lanes import WIDTH, row

NOTHING = -1e300  # logarithm of the weight of a place that holds no hypothesis
FARTHEST = 80.0  # squared deviations, in variances, up to which folds are looked at: exp(-40) of the nearest's weight
COLUMNS = 11  # of `Lists`
INNOVATION, NEAR, FALL = 0, 1, 2  # columns of e, near and c behind the two lists


class Lists(NamedTuple):
    """Room for hypotheses, by addresses (`room`, `most`: numbers per column).

    columns    two lists of four columns, `room` numbers each, the last of them w; then e, near and c of the list that
               is branched
    children   logarithms of weights and innovations of what branches, then a copy of the weights; `most` numbers each
    parents    of which hypothesis each is a branch
    """

    columns: np.ndarray
    children: np.ndarray
    parents: np.ndarray
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
    """The `most`-th greatest of `count` weights; most < count.

    By halves as in Hoare's selection, on a copy. What is kept of it moves to its front without a branch: as good as
    random, half of the branches would be foretold wrongly.
    """
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

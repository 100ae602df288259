"""Hypotheses on the folds of one realisation: how they branch, and which branches are kept.

A hypothesis is a row of numbers, of which a velocity's innovation, folded to -D/2 … D/2, leaves it open by how many
whole spans D it is to be unfolded. Given its folds it is a linear filter, whose number the study holds; the functions
here need of each only the logarithm of its weight, that innovation e and its variance S. Letters: e innovation of the
velocity with the nearest fold, e + n D are those of the other folds; near logarithm of the weight with the nearest
fold, w - c e²; w logarithm of the weight before; c 1/(2S)."""

from typing import NamedTuple

import numpy as np

from radarsim.kernels.compiler import inline, kernel_part
from radarsim.kernels.lanes import WIDTH, row

NO_HYPOTHESIS = -1e300  # logarithm of the weight of a place that holds no hypothesis
MAX_SQUARED_DEVIATION = (
    80.0  # squared deviations, in variances, up to which folds are looked at: exp(-40) of the nearest's weight
)
COLUMNS = 11  # of `HypothesisLists`
INNOVATION, NEAR, FALL = 0, 1, 2  # columns of e, near and c behind the two lists


class HypothesisLists(NamedTuple):
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
def largest_lane(x):
    """The greatest of eight numbers in memory."""
    maximum = x[0]
    for i in range(1, WIDTH):
        maximum = max(maximum, x[i])
    return maximum


@kernel_part
def select_weight(weights, count, copy, limit):
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


@kernel_part
def keep_greatest(lists, count, limit):
    """Keep the `limit` children with the greatest weights, of equal ones the first; returns the least weight."""
    weights, innovations = lists.children, row(lists.children, lists.most // WIDTH)
    smallest_weight = select_weight(weights, count, row(lists.children, 2 * lists.most // WIDTH), limit)
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


@kernel_part
def branch(lists, list_index, count, D, best, deepest, limit):
    """Branch `count` hypotheses over their folds, down to best - deepest and FARTHEST; returns how many are kept.

    At most the `limit` best are kept."""
    e, near, c = column(lists, 2, INNOVATION), column(lists, 2, NEAR), column(lists, 2, FALL)
    w = column(lists, list_index, 3)
    weights, innovations = lists.children, row(lists.children, lists.most // WIDTH)
    smallest_weight, children = best - deepest, 0
    for i in range(count):
        if near[i] < smallest_weight:
            continue
        weight_floor = max(smallest_weight, near[i] - 0.5 * MAX_SQUARED_DEVIATION)
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

"""Merging rules: maps of weights to the shares of a merge.

`work` and its layout are those of `hypothesis`; `c` (lanes) is the sum of the weights of a group, `main` (lanes) the
number of its main hypothesis, `rule` a constant of `layout`."""

from radarsim.kernels.compiler import inline, kernel_part
from radarsim.kernels.lanes import any_greater, full, get, put, where_greater
from radarsim.studies.multimodel.kernels import layout


@inline
def is_number(x, number):
    """1.0 where the whole number in x is `number`, else 0.0."""
    d = x - number
    return where_greater(full(0.25), d * d, full(1.0), full(0.0))


@kernel_part
def put_shares(work, listed, first, size, c, main, rule):
    """Map the weights of a group to shares by a rule, and list the hypotheses whose share is not zero in all lanes.

    Hypothesis j is at row first + j * HYPOTHESIS; `main` (lanes) is the number of the main one, which has the whole
    share if all weights are zero. Filled: `listed`, and the rows SHARE … in its order. Returns their number."""
    zero, unit, min_sum = full(0.0), full(1.0), full(1e-300)
    if any_greater(min_sum, c):
        for j in range(size):
            main_only = is_number(main, float(j))
            put(work, layout.WEIGHT + j, where_greater(min_sum, c, main_only, get(work, layout.WEIGHT + j)))
        c = where_greater(min_sum, c, unit, c)
    if rule != layout.MOMENT:
        c = keep_by_rule(work, size, main, rule)
    scale, count, group_size = 1.0 / c, 0, zero
    for j in range(size):
        w = get(work, layout.WEIGHT + j)
        if any_greater(w, zero):
            put(work, layout.SHARE + count, w * scale)
            listed[count] = first + j * layout.HYPOTHESIS
            count += 1
            group_size = group_size + where_greater(w, zero, unit, zero)
    if count > 1:
        put(
            work,
            layout.MERGE_COUNTS,
            get(work, layout.MERGE_COUNTS) + where_greater(group_size, unit, group_size, zero),
        )
        put(
            work,
            layout.MERGE_COUNTS + 1,
            get(work, layout.MERGE_COUNTS + 1) + where_greater(group_size, unit, unit, zero),
        )
    return count


@inline
def keep_by_rule(work, size, main, rule):
    """Set to zero the weights that a rule other than `moment` drops, and return the sum of those that remain.

    moment keeps all. best: the largest weight. combined: the main hypothesis if it outweighs every other, else all.
    modified: the main one if it does, else the main one and the best. Ties go to the lower number."""
    zero = full(0.0)
    best_weight, best, main_weight, largest_other = get(work, layout.WEIGHT), zero, zero, zero
    for j in range(size):
        w, is_main = get(work, layout.WEIGHT + j), is_number(main, float(j))
        best = where_greater(w, best_weight, full(float(j)), best)
        best_weight = where_greater(w, best_weight, w, best_weight)
        main_weight = where_greater(is_main, zero, w, main_weight)
        other_weight = where_greater(is_main, zero, zero, w)
        largest_other = where_greater(other_weight, largest_other, other_weight, largest_other)
    c = zero
    for j in range(size):
        w, is_main, is_best = get(work, layout.WEIGHT + j), is_number(main, float(j)), is_number(best, float(j))
        if rule == layout.BEST:
            is_kept = is_best
        elif rule == layout.COMBINED:
            is_kept = where_greater(main_weight, largest_other, is_main, full(1.0))
        else:
            is_kept = where_greater(main_weight, largest_other, is_main, where_greater(is_main, zero, is_main, is_best))
        w = where_greater(is_kept, zero, w, zero)
        put(work, layout.WEIGHT + j, w)
        c = c + w
    return c

"""Kalman, GPB1, IMM and GPB2 filters of nine states with any bank of up to five models, eight realisations at a time.

All families are made of three steps: weights are mapped to shares (`shared`, the merging rule), a hypothesis is
merged of others by shares (`merged`), and one is merged, predicted with a model and updated with the plot in one go
(`advanced`). Family, rule and number of models are run-time values: one copy of machine code serves all.
"""

from radarsim.kernels.compile import inline, part
from radarsim.kernels.lanes import any_greater, exponential, full, get, put, root, row, where_greater
from radarsim.studies.multimodel.kernels.hypothesis import (
    HYPOTHESIS,
    MERGED,
    MODEL,
    MOST,
    PROBABILITY,
    RESULT,
    RESULT_GROUP,
    SHARE,
    SPARE,
    SURPRISE,
    TRANSITION,
    WEIGHT,
    advanced,
    merged,
)

KALMAN, GPB1, IMM, GPB2 = range(4)
MOMENT, BEST, COMBINED, MODIFIED = range(4)
CREDIBLE = 1e-100


# ---- merging rules: maps of weights --------
@inline
def is_number(x, number):
    """1.0 where the whole number in x is `number`, else 0.0."""
    d = x - number
    return where_greater(full(0.25), d * d, full(1.0), full(0.0))


@part
def shared(work, listed, first, size, group, main, rule):
    """Map the rows WEIGHT … of a group to shares by a rule; list the hypotheses whose share is not zero in all lanes.

    Hypothesis j lies at row first + j * HYPOTHESIS; `group` is the sum of the weights and `main` (lanes) the number
    of the main one. A group whose weights are all zero is its main hypothesis. The rows SHARE … belong to `listed`,
    in order; returns their number.
    """
    nothing, least = full(0.0), full(1e-300)
    if any_greater(least, group):
        for j in range(size):
            alone = is_number(main, float(j))
            put(work, WEIGHT + j, where_greater(least, group, alone, get(work, WEIGHT + j)))
        group = where_greater(least, group, full(1.0), group)
    if rule != MOMENT:
        group = kept_only(work, size, main, rule)
    scale, count, one, inside = 1.0 / group, 0, full(1.0), nothing
    for j in range(size):
        w = get(work, WEIGHT + j)
        if any_greater(w, nothing):
            put(work, SHARE + count, w * scale)
            listed[count] = first + j * HYPOTHESIS
            count += 1
            inside = inside + where_greater(w, nothing, one, nothing)
    if count > 1:
        put(work, MERGED, get(work, MERGED) + where_greater(inside, one, inside, nothing))
        put(work, MERGED + 1, get(work, MERGED + 1) + where_greater(inside, one, one, nothing))
    return count


@inline
def kept_only(work, size, main, rule):
    """Set to zero the weights that a rule other than `moment` leaves out, and sum the rest; ties go to the lower
    number."""
    nothing = full(0.0)
    top, best, of_main, others = get(work, WEIGHT), nothing, nothing, nothing
    for j in range(size):
        w, is_main = get(work, WEIGHT + j), is_number(main, float(j))
        best, top = where_greater(w, top, full(float(j)), best), where_greater(w, top, w, top)
        of_main = where_greater(is_main, nothing, w, of_main)
        other = where_greater(is_main, nothing, nothing, w)
        others = where_greater(other, others, other, others)
    group = nothing
    for j in range(size):
        w, is_main, is_best = get(work, WEIGHT + j), is_number(main, float(j)), is_number(best, float(j))
        if rule == BEST:
            kept = is_best
        elif rule == COMBINED:
            kept = where_greater(of_main, others, is_main, full(1.0))
        else:
            kept = where_greater(of_main, others, is_main, where_greater(is_main, nothing, is_main, is_best))
        w = where_greater(kept, nothing, w, nothing)
        put(work, WEIGHT + j, w)
        group = group + w
    return group


# ---- families --------
@inline
def foretold(work, bank, size, i):
    """Put P[i, j] p_j into the rows WEIGHT … and return their sum (eq. 7)."""
    c = full(0.0)
    for j in range(size):
        w = get(work, TRANSITION + i * MOST + j) * get(work, bank + j * HYPOTHESIS + PROBABILITY)
        put(work, WEIGHT + j, w)
        c = c + w
    return c


@inline
def smaller(x, y):
    """The smaller of two, lane by lane."""
    return where_greater(x, y, y, x)


@inline
def likelihood(work, least, result):
    """Density of the innovation in rows result, result + 1, relative to exp(-least / 2) (eq. 9).

    `least` is of what had more than a probability of CREDIBLE; what had less may be relatively likelier, up to exp 200.
    So the sum of all weights can neither vanish nor overflow, however far a plot lies from every hypothesis.
    """
    x, most = 0.5 * (least - get(work, result)), full(200.0)
    return exponential(smaller(x, most)) / root(get(work, result + 1))


@part
def step(work, listed, old, new, size, family, rule, plot, noise):
    """From the old bank to the new one by one plot.

    IMM: for each model merge the bank, predict and update once; with one model a Kalman filter. GPB1: predict and
    update the one merged hypothesis, the first of the old bank, with each model. GPB2: predict and update every pair
    of models, then merge those that end in the same model.
    """
    nothing, overall, top, surprise = full(0.0), full(1e300), full(-1.0), full(0.0)
    source = SPARE if family == GPB2 else old
    for i in range(size):
        model, main = MODEL + 11 * i, full(float(i))
        c, least = foretold(work, old, size, i), full(1e300)
        for j in range(size if family == GPB2 else 1):
            w, count, to, result = c, 1, new + i * HYPOTHESIS, RESULT_GROUP + 2 * i
            if family == GPB2:
                w, to, result = get(work, WEIGHT + j), SPARE + j * HYPOTHESIS, RESULT + 2 * j
                if not any_greater(w, nothing):
                    continue
                listed[0] = old + j * HYPOTHESIS
            elif family == GPB1:
                listed[0] = old
            else:
                count = shared(work, listed, source, size, c, main, rule)
            advanced(work, listed, count, row(work, to), model, result, plot, noise)
            q = get(work, result)
            surprise, top = where_greater(w, top, q, surprise), where_greater(w, top, w, top)
            least = where_greater(w, full(CREDIBLE), smaller(least, q), least)
        if family == GPB2:
            c = group_likelihood(work, size, least)
            put(work, RESULT_GROUP + 2 * i, least)
            put(work, RESULT_GROUP + 2 * i + 1, full(1.0))
            count = shared(work, listed, source, size, c, main, rule)
            merged(work, listed, count, row(work, new + i * HYPOTHESIS))
        put(work, new + i * HYPOTHESIS + PROBABILITY, c)
        overall = smaller(overall, least)
    put(work, SURPRISE, surprise)
    weighed(work, new, size, overall)


@inline
def group_likelihood(work, size, least):
    """Multiply the rows WEIGHT … by the likelihoods of their updates, relative to exp(-least / 2); return their sum."""
    c = full(0.0)
    for j in range(size):
        w = get(work, WEIGHT + j)
        if any_greater(w, full(0.0)):
            w = w * likelihood(work, least, RESULT + 2 * j)
            put(work, WEIGHT + j, w)
            c = c + w
    return c


@inline
def weighed(work, bank, size, least):
    """Posterior probabilities of a bank, from the foretold ones and the likelihoods (eq. 9)."""
    weight = full(0.0)
    for i in range(size):
        at = bank + i * HYPOTHESIS + PROBABILITY
        p = get(work, at) * likelihood(work, least, RESULT_GROUP + 2 * i)
        put(work, at, p)
        weight = weight + p
    scale = 1.0 / weight
    for i in range(size):
        at = bank + i * HYPOTHESIS + PROBABILITY
        put(work, at, get(work, at) * scale)


@part
def merge_gpb1(work, listed, old, new, size, rule):
    """Merge the new bank over its own first hypothesis; the main one is of the model that was most probable before
    the plot."""
    top, main = full(-1.0), full(0.0)
    for j in range(size):
        p = get(work, old + j * HYPOTHESIS + PROBABILITY)
        main, top = where_greater(p, top, full(float(j)), main), where_greater(p, top, p, top)
        put(work, WEIGHT + j, get(work, new + j * HYPOTHESIS + PROBABILITY))
    count = shared(work, listed, new, size, full(1.0), main, rule)
    merged(work, listed, count, row(work, new))

"""Kalman, GPB1, IMM and GPB2 filters of nine states with any bank of up to five models, eight realisations at a time.

All families are made of three steps: the merging rule maps weights to shares (`shares_by_rule`), a hypothesis is
merged of others by shares (`merge`), and one is merged, predicted with a model and updated with the plot in one go
(`advance`). Family, rule and number of models are run-time values: one copy of machine code serves all.

Letters, each of eight lanes but for the numbers i, j of models:

    p[j]        probability of model j before the plot; p[i]: of model i, after it
    T[i, j]     probability of passing from model j to model i over the interval
    w[j]        weight of hypothesis j among those that may be merged; in the rows WEIGHT …
    c           Σ w, the normaliser; in eq. (7) the predicted probability of model i, Σ_j T[i, j] p[j]
    q           normalised innovation squared v' S⁻¹ v of a hypothesis
    likelihood  density of the innovation, exp(-q / 2) / sqrt(det S), up to a common factor

`work` is the address of the filter's rows, `listed` that of MOST whole numbers; `old` and `new` are the first rows of
the banks before and after the plot.
"""

from radarsim.kernels.compile import inline, part
from radarsim.kernels.lanes import any_greater, exponential, full, get, put, root, row, where_greater
from radarsim.studies.multimodel.kernels import records as rec
from radarsim.studies.multimodel.kernels.hypothesis import advance, merge

CREDIBLE = 1e-100  # probability above which a hypothesis scales the likelihoods


# ---- merging rules: maps of weights --------
@inline
def is_number(x, number):
    """1.0 where the whole number in x is `number`, else 0.0."""
    d = x - number
    return where_greater(full(0.25), d * d, full(1.0), full(0.0))


@part
def shares_by_rule(work, listed, first, size, c, main, rule):
    """Map the weights of a group to shares by a rule; list the hypotheses whose share is not zero in all lanes.

    Hypothesis j lies at row first + j * HYPOTHESIS; `main` (lanes) is the number of the main one. A group whose
    weights are all zero is its main hypothesis. The rows SHARE … belong to `listed`, in order; returns their number.
    """
    zero, one, least = full(0.0), full(1.0), full(1e-300)
    if any_greater(least, c):
        for j in range(size):
            alone = is_number(main, float(j))
            put(work, rec.WEIGHT + j, where_greater(least, c, alone, get(work, rec.WEIGHT + j)))
        c = where_greater(least, c, one, c)
    if rule != rec.MOMENT:
        c = keep_by_rule(work, size, main, rule)
    scale, count, inside = 1.0 / c, 0, zero
    for j in range(size):
        w = get(work, rec.WEIGHT + j)
        if any_greater(w, zero):
            put(work, rec.SHARE + count, w * scale)
            listed[count] = first + j * rec.HYPOTHESIS
            count += 1
            inside = inside + where_greater(w, zero, one, zero)
    if count > 1:
        put(work, rec.COUNTED, get(work, rec.COUNTED) + where_greater(inside, one, inside, zero))
        put(work, rec.COUNTED + 1, get(work, rec.COUNTED + 1) + where_greater(inside, one, one, zero))
    return count


@inline
def keep_by_rule(work, size, main, rule):
    """Set to zero the weights that a rule other than `moment` leaves out, and return the sum of the rest.

    best: the largest weight. combined: the main hypothesis where it outweighs all others together, else all.
    modified: the main one where it does, else the main one and the best. Ties go to the lower number.
    """
    zero = full(0.0)
    top, best, of_main, others = get(work, rec.WEIGHT), zero, zero, zero
    for j in range(size):
        w, is_main = get(work, rec.WEIGHT + j), is_number(main, float(j))
        best, top = where_greater(w, top, full(float(j)), best), where_greater(w, top, w, top)
        of_main = where_greater(is_main, zero, w, of_main)
        other = where_greater(is_main, zero, zero, w)
        others = where_greater(other, others, other, others)
    c = zero
    for j in range(size):
        w, is_main, is_best = get(work, rec.WEIGHT + j), is_number(main, float(j)), is_number(best, float(j))
        if rule == rec.BEST:
            kept = is_best
        elif rule == rec.COMBINED:
            kept = where_greater(of_main, others, is_main, full(1.0))
        else:
            kept = where_greater(of_main, others, is_main, where_greater(is_main, zero, is_main, is_best))
        w = where_greater(kept, zero, w, zero)
        put(work, rec.WEIGHT + j, w)
        c = c + w
    return c


# ---- families --------
@inline
def predict_weights(work, bank, size, i):
    """Put T[i, j] p[j] into the rows WEIGHT … and return their sum c (eq. 7)."""
    c = full(0.0)
    for j in range(size):
        w = get(work, rec.TRANSITION + i * rec.MOST + j) * get(work, bank + j * rec.HYPOTHESIS + rec.PROBABILITY)
        put(work, rec.WEIGHT + j, w)
        c = c + w
    return c


@inline
def minimum(x, y):
    """The smaller of two, lane by lane."""
    return where_greater(x, y, y, x)


@inline
def likelihood(work, least, result):
    """Density of the innovation of rows result, result + 1, relative to exp(-least / 2) (eq. 9).

    `least` is the smallest q of what had more than a probability of CREDIBLE; what had less may be relatively
    likelier, up to exp 200. So the sum of all weights can neither vanish nor overflow, however far a plot lies from
    every hypothesis.
    """
    x, most = 0.5 * (least - get(work, result)), full(200.0)
    return exponential(minimum(x, most)) / root(get(work, result + 1))


@part
def step(work, listed, old, new, rules, plot, noise):
    """From the old bank to the new one by one plot; rules: `records.Rules`.

    IMM: for each model merge the bank, predict and update once; with one model a Kalman filter. GPB1: predict and
    update the one merged hypothesis, the first of the old bank, with each model. GPB2: predict and update every pair
    of models, then merge those that end in the same model.
    """
    size, family, rule = rules.size, rules.family, rules.merge
    zero, overall, top, surprise = full(0.0), full(1e300), full(-1.0), full(0.0)
    source = rec.SPARE if family == rec.GPB2 else old
    for i in range(size):
        model, main = rec.MODEL + rec.MODEL_ROWS * i, full(float(i))
        c, least = predict_weights(work, old, size, i), full(1e300)
        for j in range(size if family == rec.GPB2 else 1):
            w, count, to, result = c, 1, new + i * rec.HYPOTHESIS, rec.RESULT_GROUP + 2 * i
            if family == rec.GPB2:
                w, to, result = get(work, rec.WEIGHT + j), rec.SPARE + j * rec.HYPOTHESIS, rec.RESULT + 2 * j
                if not any_greater(w, zero):
                    continue
                listed[0] = old + j * rec.HYPOTHESIS
            elif family == rec.GPB1:
                listed[0] = old
            else:
                count = shares_by_rule(work, listed, source, size, c, main, rule)
            advance(work, listed, count, row(work, to), model, result, plot, noise)
            q = get(work, result)
            surprise, top = where_greater(w, top, q, surprise), where_greater(w, top, w, top)
            least = where_greater(w, full(CREDIBLE), minimum(least, q), least)
        if family == rec.GPB2:
            c = weigh_pairs(work, size, least)
            put(work, rec.RESULT_GROUP + 2 * i, least)
            put(work, rec.RESULT_GROUP + 2 * i + 1, full(1.0))
            count = shares_by_rule(work, listed, source, size, c, main, rule)
            merge(work, listed, count, row(work, new + i * rec.HYPOTHESIS))
        put(work, new + i * rec.HYPOTHESIS + rec.PROBABILITY, c)
        overall = minimum(overall, least)
    put(work, rec.SURPRISE, surprise)
    update_probabilities(work, new, size, overall)


@inline
def weigh_pairs(work, size, least):
    """Multiply the weights by the likelihoods of their updates, relative to exp(-least / 2); return their sum c."""
    c = full(0.0)
    for j in range(size):
        w = get(work, rec.WEIGHT + j)
        if any_greater(w, full(0.0)):
            w = w * likelihood(work, least, rec.RESULT + 2 * j)
            put(work, rec.WEIGHT + j, w)
            c = c + w
    return c


@inline
def update_probabilities(work, bank, size, least):
    """Posterior probabilities of a bank, from the predicted ones and the likelihoods (eq. 9)."""
    c = full(0.0)
    for i in range(size):
        at = bank + i * rec.HYPOTHESIS + rec.PROBABILITY
        p = get(work, at) * likelihood(work, least, rec.RESULT_GROUP + 2 * i)
        put(work, at, p)
        c = c + p
    scale = 1.0 / c
    for i in range(size):
        at = bank + i * rec.HYPOTHESIS + rec.PROBABILITY
        put(work, at, get(work, at) * scale)


@part
def merge_gpb1(work, listed, old, new, size, rule):
    """Merge the new bank over its own first hypothesis; the main one is of the model that was most probable before
    the plot."""
    top, main = full(-1.0), full(0.0)
    for j in range(size):
        p = get(work, old + j * rec.HYPOTHESIS + rec.PROBABILITY)
        main, top = where_greater(p, top, full(float(j)), main), where_greater(p, top, p, top)
        put(work, rec.WEIGHT + j, get(work, new + j * rec.HYPOTHESIS + rec.PROBABILITY))
    count = shares_by_rule(work, listed, new, size, full(1.0), main, rule)
    merge(work, listed, count, row(work, new))

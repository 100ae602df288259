"""Kalman, GPB1, IMM and GPB2 filters of nine states with a bank of up to five models, eight realisations at a time.

All families consist of three steps: the merging rule maps weights to shares (`merging_rules.put_shares`), a hypothesis
is merged from others by shares (`hypothesis.merge`), and one is merged, predicted with a model and updated with the
plot in one step (`hypothesis.advance`). Family, rule and number of models are run-time values: one copy of machine code
serves all.

Letters, each of eight lanes but for the numbers i, j of models:

    p[j]        probability of model j before the plot; p[i]: of model i, after it
    T[i, j]     probability of passing from model j to model i over the interval
    w[j]        weight of hypothesis j among those that may be merged; in the rows WEIGHT …
    c           Σ w, the normaliser; in eq. (7) the predicted probability of model i, Σ_j T[i, j] p[j]
    q           normalised innovation squared v' S⁻¹ v of a hypothesis
    likelihood  density of the innovation, exp(-q / 2) / sqrt(det S), up to a common factor

`work` is the address of the filter's rows, `listed` that of MAX_MODELS whole numbers; `old` and `new` are the first
rows of the banks before and after the plot."""

from radarsim.kernels import lanes
from radarsim.kernels.compiler import inline, kernel_part
from radarsim.kernels.lanes import any_greater, exponential, full, get, put, row, where_greater
from radarsim.studies.multimodel.kernels import layout
from radarsim.studies.multimodel.kernels.hypothesis import advance, merge
from radarsim.studies.multimodel.kernels.merging_rules import put_shares

CREDIBLE = 1e-100  # probability above which a hypothesis scales the likelihoods


@inline
def predict_weights(work, bank, size, i):
    """Put T[i, j] p[j] into the rows WEIGHT … and return their sum c (eq. 7)."""
    c = full(0.0)
    for j in range(size):
        w = get(work, layout.TRANSITION + i * layout.MAX_MODELS + j) * get(
            work, bank + j * layout.HYPOTHESIS + layout.PROBABILITY
        )
        put(work, layout.WEIGHT + j, w)
        c = c + w
    return c


@inline
def minimum(x, y):
    """The smaller of two, lane by lane."""
    return where_greater(x, y, y, x)


@inline
def likelihood(work, min_distance, result):
    """Density of the innovation of rows result, result + 1, relative to exp(-min_distance / 2) (eq. 9).

    min_distance is the smallest q of hypotheses more probable than CREDIBLE; less probable ones may be relatively
    likelier, up to exp 200. So the sum of all weights neither vanishes nor overflows, however far a plot is from every
    hypothesis."""
    x, max_exponent = 0.5 * (min_distance - get(work, result)), full(200.0)
    return exponential(minimum(x, max_exponent)) / lanes.square_root(get(work, result + 1))


@kernel_part
def step(work, listed, old, new, rules, plot, noise):
    """Compute the new bank from the old one and a plot; rules: `layout.Rules`.

    IMM: for each model merge the bank, predict and update once; with one model this is a Kalman filter. GPB1: predict
    and update the merged hypothesis, the first of the old bank, with each model. GPB2: predict and update every pair of
    models, then merge those that end in the same model."""
    size, family, rule = rules.size, rules.family, rules.merge
    zero, min_distance, best_weight, main_distance = full(0.0), full(1e300), full(-1.0), full(0.0)
    source = layout.SPARE if family == layout.GPB2 else old
    for i in range(size):
        model, main = layout.MODEL + layout.MODEL_ROWS * i, full(float(i))
        c, model_distance = predict_weights(work, old, size, i), full(1e300)
        for j in range(size if family == layout.GPB2 else 1):
            w, count, target, result = c, 1, new + i * layout.HYPOTHESIS, layout.RESULT_GROUP + 2 * i
            if family == layout.GPB2:
                w, target, result = (
                    get(work, layout.WEIGHT + j),
                    layout.SPARE + j * layout.HYPOTHESIS,
                    layout.RESULT + 2 * j,
                )
                if not any_greater(w, zero):
                    continue
                listed[0] = old + j * layout.HYPOTHESIS
            elif family == layout.GPB1:
                listed[0] = old
            else:
                count = put_shares(work, listed, source, size, c, main, rule)
            advance(work, listed, count, row(work, target), model, result, plot, noise)
            q = get(work, result)
            main_distance = where_greater(w, best_weight, q, main_distance)
            best_weight = where_greater(w, best_weight, w, best_weight)
            model_distance = where_greater(w, full(CREDIBLE), minimum(model_distance, q), model_distance)
        if family == layout.GPB2:
            c = weigh_pairs(work, size, model_distance)
            put(work, layout.RESULT_GROUP + 2 * i, model_distance)
            put(work, layout.RESULT_GROUP + 2 * i + 1, full(1.0))
            count = put_shares(work, listed, source, size, c, main, rule)
            merge(work, listed, count, row(work, new + i * layout.HYPOTHESIS))
        put(work, new + i * layout.HYPOTHESIS + layout.PROBABILITY, c)
        min_distance = minimum(min_distance, model_distance)
    put(work, layout.MAIN_INNOVATION, main_distance)
    update_probabilities(work, new, size, min_distance)


@inline
def weigh_pairs(work, size, min_distance):
    """Multiply the weights by their updates' likelihoods, relative to exp(-min_distance / 2); return their sum."""
    c = full(0.0)
    for j in range(size):
        w = get(work, layout.WEIGHT + j)
        if any_greater(w, full(0.0)):
            w = w * likelihood(work, min_distance, layout.RESULT + 2 * j)
            put(work, layout.WEIGHT + j, w)
            c = c + w
    return c


@inline
def update_probabilities(work, bank, size, min_distance):
    """Compute the posterior probabilities of a bank from the predicted ones and the likelihoods (eq. 9)."""
    c = full(0.0)
    for i in range(size):
        p_row = bank + i * layout.HYPOTHESIS + layout.PROBABILITY
        p = get(work, p_row) * likelihood(work, min_distance, layout.RESULT_GROUP + 2 * i)
        put(work, p_row, p)
        c = c + p
    scale = 1.0 / c
    for i in range(size):
        p_row = bank + i * layout.HYPOTHESIS + layout.PROBABILITY
        put(work, p_row, get(work, p_row) * scale)


@kernel_part
def merge_gpb1(work, listed, old, new, size, rule):
    """Merge the new bank into its first hypothesis; the main one is that of the most probable model before the plot."""
    best_probability, main = full(-1.0), full(0.0)
    for j in range(size):
        p = get(work, old + j * layout.HYPOTHESIS + layout.PROBABILITY)
        main = where_greater(p, best_probability, full(float(j)), main)
        best_probability = where_greater(p, best_probability, p, best_probability)
        put(work, layout.WEIGHT + j, get(work, new + j * layout.HYPOTHESIS + layout.PROBABILITY))
    count = put_shares(work, listed, new, size, full(1.0), main, rule)
    merge(work, listed, count, row(work, new))

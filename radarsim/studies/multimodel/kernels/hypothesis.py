"""A hypothesis of nine states for eight realisations: merged from others, predicted and updated in one step.

A hypothesis (P2 eq. 1) is HYPOTHESIS rows of the work array, see `records`. Letters, each of eight lanes:

    mu           share of a hypothesis in a merge, eq. (4)
    x, y, z      mean of an axis (3)
    P            a block of the covariance: of one axis (6) or between two axes (9), packed as in
                 `radarsim.kernels.algebra`; xx, yy, zz, xy, xz, yz: which block it is
    d, e         mean of a hypothesis minus the merged mean, of one axis (3) and of another
    F, Q         a model over the interval, the same for each axis (5 and 6 elements)
    R            covariance of the plot (6)
    v            whitened innovation L⁻¹ (plot - H x) (3)
    S = L D L'   covariance of the innovation H P H' + R (6); L (3), the diagonal of D⁻¹ is i (3)
    wx, wy, wz   rows of P H' L'⁻¹ of an axis (3 x 3)
    gx, gy, gz   the same times D⁻¹, so that K (plot - H x) = g v and K S K' = g w' (K: the gain)

`work`, `target`, `plot` and all other arguments that are not tuples are addresses. `listed` (count,) are the rows of
the hypotheses to be merged; their shares are in the rows SHARE …

Kalman, GPB1, IMM and GPB2 filters of nine states with any bank of up to five models, eight realisations at a time.

All families consist of three steps: the merging rule maps weights to shares (`put_shares`), a hypothesis is merged
from others by shares (`merge`), and one is merged, predicted with a model and updated with the plot in one step
(`advance`). Family, rule and number of models are run-time values: one copy of machine code serves all.

Letters, each of eight lanes but for the numbers i, j of models:

    p[j]        probability of model j before the plot; p[i]: of model i, after it
    T[i, j]     probability of passing from model j to model i over the interval
    w[j]        weight of hypothesis j among those that may be merged; in the rows WEIGHT …
    c           Σ w, the normaliser; in eq. (7) the predicted probability of model i, Σ_j T[i, j] p[j]
    q           normalised innovation squared v' S⁻¹ v of a hypothesis
    likelihood  density of the innovation, exp(-q / 2) / sqrt(det S), up to a common factor

`work` is the address of the filter's rows, `listed` that of MAX_MODELS whole numbers; `old` and `new` are the first
rows of the banks before and after the plot."""

import numpy as np

from radarsim.kernels import algebra, lanes
from radarsim.kernels.algebra import dot, predicted, predicted_covariance, predicted_cross, scaled, shrunk_own, whitened
from radarsim.kernels.compile import inline, part
from radarsim.kernels.lanes import any_greater, exponential, full, get, get3, get6, put, put6, row, rows, where_greater
from radarsim.studies.multimodel.kernels import records as rec


# ---- hypothesis ------------------------------------------------------------------------------------------------------
def work_arrays() -> tuple[np.ndarray, np.ndarray]:
    """Allocate the memory of a filter for eight realisations: rows (WORK), and numbers CURRENT, PREPARED, SETTLED."""
    numbers = np.zeros(4, dtype=np.int64)
    numbers[rec.CURRENT], numbers[rec.PREPARED], numbers[rec.SETTLED] = 0, -1, 1
    return rows(rec.WORK), numbers


@inline
def put9(pointer, first, x):
    """Write nine consecutive rows, from row `first` on."""
    put6(pointer, first, (x[0], x[1], x[2], x[3], x[4], x[5]))
    lanes.put3(pointer, first + 6, (x[6], x[7], x[8]))


# ---- merging: eq. (4) with the shares of any rule --------
# Axis and block are passed as addresses: a number in the call would be compiled again for each of its values.
@inline
def mixed_mean(listed, count, shares, means):
    """Mean of one axis (3): Σ mu x over the listed hypotheses; means: row of that axis."""
    if count == 1:
        return get3(means, listed[0])
    a, b, c = full(0.0), full(0.0), full(0.0)
    for n in range(count):
        mu, x = get(shares, n), get3(means, listed[n])
        a, b, c = a + mu * x[0], b + mu * x[1], c + mu * x[2]
    return a, b, c


@inline
def offset(means, hypothesis, mean):
    """One axis (3) of a hypothesis' mean minus that of `mean`."""
    x = get3(means, hypothesis)
    return x[0] - mean[0], x[1] - mean[1], x[2] - mean[2]


@inline
def mixed_own(listed, count, shares, block, means, mean):
    """Own block of one axis: Σ mu (P + d d') over the listed hypotheses."""
    if count == 1:
        return get6(block, listed[0])
    p = full(0.0), full(0.0), full(0.0), full(0.0), full(0.0), full(0.0)
    for n in range(count):
        p = algebra.add_spread(p, get(shares, n), get6(block, listed[n]), offset(means, listed[n], mean))
    return p


@inline
def mixed_cross(listed, count, shares, block, means, mean, other_means, other_mean):
    """Block between two axes: Σ mu (P + d e') over the listed hypotheses."""
    if count == 1:
        return get6(block, listed[0]) + get3(block, listed[0] + 6)
    c = full(0.0), full(0.0), full(0.0), full(0.0), full(0.0), full(0.0), full(0.0), full(0.0), full(0.0)
    for n in range(count):
        mu, P = get(shares, n), get6(block, listed[n]) + get3(block, listed[n] + 6)
        d, e = offset(means, listed[n], mean), offset(other_means, listed[n], other_mean)
        c = (
            c[0] + mu * (P[0] + d[0] * e[0]),
            c[1] + mu * (P[1] + d[0] * e[1]),
            c[2] + mu * (P[2] + d[0] * e[2]),
            c[3] + mu * (P[3] + d[1] * e[0]),
            c[4] + mu * (P[4] + d[1] * e[1]),
            c[5] + mu * (P[5] + d[1] * e[2]),
            c[6] + mu * (P[6] + d[2] * e[0]),
            c[7] + mu * (P[7] + d[2] * e[1]),
            c[8] + mu * (P[8] + d[2] * e[2]),
        )
    return c


@inline
def mix_hypotheses(work, listed, count):
    """Mix the listed hypotheses by their shares: means of the three axes, their own blocks, blocks between axes."""
    shares = row(work, rec.SHARE)
    of_x = row(work, rec.MEAN)
    of_y = row(work, rec.MEAN + 3)
    of_z = row(work, rec.MEAN + 6)
    x = mixed_mean(listed, count, shares, of_x)
    y = mixed_mean(listed, count, shares, of_y)
    z = mixed_mean(listed, count, shares, of_z)
    return (
        (x, y, z),
        (
            mixed_own(listed, count, shares, row(work, rec.OWN), of_x, x),
            mixed_own(listed, count, shares, row(work, rec.OWN + 6), of_y, y),
            mixed_own(listed, count, shares, row(work, rec.OWN + 12), of_z, z),
        ),
        (
            mixed_cross(listed, count, shares, row(work, rec.CROSS), of_x, x, of_y, y),
            mixed_cross(listed, count, shares, row(work, rec.CROSS + 9), of_x, x, of_z, z),
            mixed_cross(listed, count, shares, row(work, rec.CROSS + 18), of_y, y, of_z, z),
        ),
    )


@inline
def put_hypothesis(target, means, own_blocks, cross):
    """Write means and packed covariances of the three axes into a hypothesis."""
    put9(target, rec.MEAN, means[0] + means[1] + means[2])
    put6(target, rec.OWN, own_blocks[0])
    put6(target, rec.OWN + 6, own_blocks[1])
    put6(target, rec.OWN + 12, own_blocks[2])
    put9(target, rec.CROSS, cross[0])
    put9(target, rec.CROSS + 9, cross[1])
    put9(target, rec.CROSS + 18, cross[2])


@part
def merge(work, listed, count, target):
    """Merge the listed hypotheses by their shares into the hypothesis at the address `target`."""
    means, own_blocks, cross = mix_hypotheses(work, listed, count)
    put_hypothesis(target, means, own_blocks, cross)


# ---- prediction and update: eqs. (6) and (9) --------
@part
def advance(work, listed, count, target, model, result, plot, noise):
    """Merge the listed hypotheses, predict with the model in row `model`, update with a plot, write to `target`.

    target, plot, noise: addresses of a hypothesis, of the plot (PLOT rows) and of R (6 rows). The rows result and
    result + 1 are set to the normalised innovation squared v' S⁻¹ v and the determinant of S (0, 1 if the plot is
    missed)."""
    F = get(work, model), get(work, model + 1), get(work, model + 2), get(work, model + 3), get(work, model + 4)
    Q, mixture, zero = get6(work, model + rec.MODEL_Q), mix_hypotheses(work, listed, count), full(0.0)
    if any_greater(F[4], zero):
        predict_and_update(work, mixture, F, Q, target, result, plot, noise)
    else:
        # A model without acceleration: with these zeros the compiler leaves out half of the operations.
        F, Q = (F[0], zero, F[2], zero, zero), (Q[0], Q[1], zero, Q[3], zero, zero)
        predict_and_update(work, mixture, F, Q, target, result, plot, noise)


@inline
def predict_and_update(work, mixture, F, Q, target, result, plot, noise):
    """Predict a mixture (means, own blocks, blocks between axes), update it with a plot, write it; see `advance`."""
    means, own_blocks, cross = mixture
    x, y, z = predicted(means[0], F), predicted(means[1], F), predicted(means[2], F)
    xx = predicted_covariance(own_blocks[0], F, Q)
    yy = predicted_covariance(own_blocks[1], F, Q)
    zz = predicted_covariance(own_blocks[2], F, Q)
    xy, xz, yz = predicted_cross(cross[0], F), predicted_cross(cross[1], F), predicted_cross(cross[2], F)

    R = get6(noise, 0)
    S = xx[0] + R[0], xy[0] + R[1], xz[0] + R[2], yy[0] + R[3], yz[0] + R[4], zz[0] + R[5]
    L, i, determinant = algebra.factored(S)  # i: the diagonal of D⁻¹
    detected = get(plot, rec.DETECTED)
    i = i[0] * detected, i[1] * detected, i[2] * detected
    v = whitened(
        (get(plot, rec.POSITION) - x[0], get(plot, rec.POSITION + 1) - y[0], get(plot, rec.POSITION + 2) - z[0]), L
    )
    put(work, result, dot(scaled(v, i), v))
    put(work, result + 1, where_greater(detected, full(0.5), determinant, full(1.0)))

    # Rows of P H', the columns of P that belong to the three coordinates, whitened: P H' S⁻¹ H P is G W'.
    wx = whitened((xx[0], xy[0], xz[0]), L), whitened((xx[1], xy[3], xz[3]), L), whitened((xx[2], xy[6], xz[6]), L)
    wy = whitened((xy[0], yy[0], yz[0]), L), whitened((xy[1], yy[1], yz[3]), L), whitened((xy[2], yy[2], yz[6]), L)
    wz = whitened((xz[0], yz[0], zz[0]), L), whitened((xz[1], yz[1], zz[1]), L), whitened((xz[2], yz[2], zz[2]), L)
    gx = scaled(wx[0], i), scaled(wx[1], i), scaled(wx[2], i)
    gy = scaled(wy[0], i), scaled(wy[1], i), scaled(wy[2], i)
    gz = scaled(wz[0], i), scaled(wz[1], i), scaled(wz[2], i)
    put_hypothesis(
        target,
        (
            (x[0] + dot(gx[0], v), x[1] + dot(gx[1], v), x[2] + dot(gx[2], v)),
            (y[0] + dot(gy[0], v), y[1] + dot(gy[1], v), y[2] + dot(gy[2], v)),
            (z[0] + dot(gz[0], v), z[1] + dot(gz[1], v), z[2] + dot(gz[2], v)),
        ),
        (shrunk_own(xx, gx, wx), shrunk_own(yy, gy, wy), shrunk_own(zz, gz, wz)),
        (algebra.shrunk_cross(xy, gx, wy), algebra.shrunk_cross(xz, gx, wz), algebra.shrunk_cross(yz, gy, wz)),
    )


# ---- filters ---------------------------------------------------------------------------------------------------------
CREDIBLE = 1e-100  # probability above which a hypothesis scales the likelihoods


# ---- merging rules: maps of weights --------
@inline
def is_number(x, number):
    """1.0 where the whole number in x is `number`, else 0.0."""
    d = x - number
    return where_greater(full(0.25), d * d, full(1.0), full(0.0))


@part
def put_shares(work, listed, first, size, c, main, rule):
    """Map the weights of a group to shares by a rule, and list the hypotheses whose share is not zero in all lanes.

    Hypothesis j is at row first + j * HYPOTHESIS; `main` (lanes) is the number of the main one, which has the whole
    share if all weights are zero. Filled: `listed`, and the rows SHARE … in its order. Returns their number."""
    zero, unit, min_sum = full(0.0), full(1.0), full(1e-300)
    if any_greater(min_sum, c):
        for j in range(size):
            main_only = is_number(main, float(j))
            put(work, rec.WEIGHT + j, where_greater(min_sum, c, main_only, get(work, rec.WEIGHT + j)))
        c = where_greater(min_sum, c, unit, c)
    if rule != rec.MOMENT:
        c = keep_by_rule(work, size, main, rule)
    scale, count, group_size = 1.0 / c, 0, zero
    for j in range(size):
        w = get(work, rec.WEIGHT + j)
        if any_greater(w, zero):
            put(work, rec.SHARE + count, w * scale)
            listed[count] = first + j * rec.HYPOTHESIS
            count += 1
            group_size = group_size + where_greater(w, zero, unit, zero)
    if count > 1:
        put(work, rec.MERGE_COUNTS, get(work, rec.MERGE_COUNTS) + where_greater(group_size, unit, group_size, zero))
        put(work, rec.MERGE_COUNTS + 1, get(work, rec.MERGE_COUNTS + 1) + where_greater(group_size, unit, unit, zero))
    return count


@inline
def keep_by_rule(work, size, main, rule):
    """Set to zero the weights that a rule other than `moment` drops, and return the sum of those that remain.

    best: the largest weight. combined: the main hypothesis if it outweighs every other, else all. modified: the main
    one if it does, else the main one and the best. Ties go to the lower number."""
    zero = full(0.0)
    best_weight, best, main_weight, largest_other = get(work, rec.WEIGHT), zero, zero, zero
    for j in range(size):
        w, is_main = get(work, rec.WEIGHT + j), is_number(main, float(j))
        best = where_greater(w, best_weight, full(float(j)), best)
        best_weight = where_greater(w, best_weight, w, best_weight)
        main_weight = where_greater(is_main, zero, w, main_weight)
        other_weight = where_greater(is_main, zero, zero, w)
        largest_other = where_greater(other_weight, largest_other, other_weight, largest_other)
    c = zero
    for j in range(size):
        w, is_main, is_best = get(work, rec.WEIGHT + j), is_number(main, float(j)), is_number(best, float(j))
        if rule == rec.BEST:
            is_kept = is_best
        elif rule == rec.COMBINED:
            is_kept = where_greater(main_weight, largest_other, is_main, full(1.0))
        else:
            is_kept = where_greater(main_weight, largest_other, is_main, where_greater(is_main, zero, is_main, is_best))
        w = where_greater(is_kept, zero, w, zero)
        put(work, rec.WEIGHT + j, w)
        c = c + w
    return c


# ---- families --------
@inline
def predict_weights(work, bank, size, i):
    """Put T[i, j] p[j] into the rows WEIGHT … and return their sum c (eq. 7)."""
    c = full(0.0)
    for j in range(size):
        w = get(work, rec.TRANSITION + i * rec.MAX_MODELS + j) * get(work, bank + j * rec.HYPOTHESIS + rec.PROBABILITY)
        put(work, rec.WEIGHT + j, w)
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
    return exponential(minimum(x, max_exponent)) / lanes.root(get(work, result + 1))


@part
def step(work, listed, old, new, rules, plot, noise):
    """Compute the new bank from the old one and a plot; rules: `records.Rules`.

    IMM: for each model merge the bank, predict and update once; with one model this is a Kalman filter. GPB1: predict
    and update the merged hypothesis, the first of the old bank, with each model. GPB2: predict and update every pair of
    models, then merge those that end in the same model."""
    size, family, rule = rules.size, rules.family, rules.merge
    zero, min_distance, best_weight, main_distance = full(0.0), full(1e300), full(-1.0), full(0.0)
    source = rec.SPARE if family == rec.GPB2 else old
    for i in range(size):
        model, main = rec.MODEL + rec.MODEL_ROWS * i, full(float(i))
        c, model_distance = predict_weights(work, old, size, i), full(1e300)
        for j in range(size if family == rec.GPB2 else 1):
            w, count, target, result = c, 1, new + i * rec.HYPOTHESIS, rec.RESULT_GROUP + 2 * i
            if family == rec.GPB2:
                w, target, result = get(work, rec.WEIGHT + j), rec.SPARE + j * rec.HYPOTHESIS, rec.RESULT + 2 * j
                if not any_greater(w, zero):
                    continue
                listed[0] = old + j * rec.HYPOTHESIS
            elif family == rec.GPB1:
                listed[0] = old
            else:
                count = put_shares(work, listed, source, size, c, main, rule)
            advance(work, listed, count, row(work, target), model, result, plot, noise)
            q = get(work, result)
            main_distance = where_greater(w, best_weight, q, main_distance)
            best_weight = where_greater(w, best_weight, w, best_weight)
            model_distance = where_greater(w, full(CREDIBLE), minimum(model_distance, q), model_distance)
        if family == rec.GPB2:
            c = weigh_pairs(work, size, model_distance)
            put(work, rec.RESULT_GROUP + 2 * i, model_distance)
            put(work, rec.RESULT_GROUP + 2 * i + 1, full(1.0))
            count = put_shares(work, listed, source, size, c, main, rule)
            merge(work, listed, count, row(work, new + i * rec.HYPOTHESIS))
        put(work, new + i * rec.HYPOTHESIS + rec.PROBABILITY, c)
        min_distance = minimum(min_distance, model_distance)
    put(work, rec.MAIN_INNOVATION, main_distance)
    update_probabilities(work, new, size, min_distance)


@inline
def weigh_pairs(work, size, min_distance):
    """Multiply the weights by their updates' likelihoods, relative to exp(-min_distance / 2); return their sum."""
    c = full(0.0)
    for j in range(size):
        w = get(work, rec.WEIGHT + j)
        if any_greater(w, full(0.0)):
            w = w * likelihood(work, min_distance, rec.RESULT + 2 * j)
            put(work, rec.WEIGHT + j, w)
            c = c + w
    return c


@inline
def update_probabilities(work, bank, size, min_distance):
    """Compute the posterior probabilities of a bank from the predicted ones and the likelihoods (eq. 9)."""
    c = full(0.0)
    for i in range(size):
        p_row = bank + i * rec.HYPOTHESIS + rec.PROBABILITY
        p = get(work, p_row) * likelihood(work, min_distance, rec.RESULT_GROUP + 2 * i)
        put(work, p_row, p)
        c = c + p
    scale = 1.0 / c
    for i in range(size):
        p_row = bank + i * rec.HYPOTHESIS + rec.PROBABILITY
        put(work, p_row, get(work, p_row) * scale)


@part
def merge_gpb1(work, listed, old, new, size, rule):
    """Merge the new bank into its first hypothesis; the main one is that of the most probable model before the plot."""
    best_probability, main = full(-1.0), full(0.0)
    for j in range(size):
        p = get(work, old + j * rec.HYPOTHESIS + rec.PROBABILITY)
        main = where_greater(p, best_probability, full(float(j)), main)
        best_probability = where_greater(p, best_probability, p, best_probability)
        put(work, rec.WEIGHT + j, get(work, new + j * rec.HYPOTHESIS + rec.PROBABILITY))
    count = put_shares(work, listed, new, size, full(1.0), main, rule)
    merge(work, listed, count, row(work, new))

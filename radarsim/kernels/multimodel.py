"""Kalman, GPB1, IMM and GPB2 filters of nine states with any bank of up to five models, eight realisations at a time.

All families are made of three steps: weights are mapped to shares (`shared`, the merging rule), a hypothesis is merged of
others by shares (`merged`), and one is merged, predicted with a model and updated with the plot in one go (`advanced`).
Family, rule and number of models are run-time values: one copy of machine code serves all.
"""

import numpy as np

from radarsim.kernels.compile import inline, kernel
from radarsim.kernels.hypothesis import (
    BANK,
    CROSS,
    ESTIMATE,
    HYPOTHESIS,
    INNOVATION,
    MEAN,
    MERGED,
    MERGES,
    MODEL,
    MODELS,
    MOST,
    NOISE,
    OUTPUT,
    OWN,
    PLOT,
    POSITION,
    PROBABILITY,
    RESULT,
    RESULT_GROUP,
    SHARE,
    SPARE,
    SURPRISE,
    TRANSITION,
    VARIANCE,
    WAIT,
    WEIGHT,
    advanced,
    get3,
    merged,
    mixed_mean,
    put3,
)
from radarsim.kernels.lanes import address, any_greater, exponential, full, get, put, root, row, where_greater
from radarsim.kernels.multimodel_plots import noise_at_prediction

KALMAN, GPB1, IMM, GPB2 = range(4)
MOMENT, BEST, COMBINED, MODIFIED = range(4)


# ---- merging rules: maps of weights --------------------------------------------------------------------------------------------
@inline
def is_number(x, number):
    """1.0 where the whole number in x is `number`, else 0.0."""
    d = x - number
    return where_greater(full(0.25), d * d, full(1.0), full(0.0))


@kernel
def shared(work, listed, first, size, group, main, rule):
    """Map the rows WEIGHT … of a group to shares by a rule; list the hypotheses whose share is not zero in all lanes.

    Hypothesis j lies at row first + j * HYPOTHESIS; `group` is the sum of the weights and `main` (lanes) the number of the
    main one. A group whose weights are all zero is its main hypothesis. The rows SHARE … belong to `listed`, in order;
    returns their number.
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
    """Set to zero the weights that a rule other than `moment` leaves out, and sum the rest; ties go to the lower number."""
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


# ---- families ------------------------------------------------------------------------------------------------------------------
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
    return where_greater(x, y, y, x)


@inline
def likelihood(work, least, result):
    """Density of the innovation in rows result, result + 1, relative to exp(-least / 2) (eq. 9)."""
    return exponential(0.5 * (least - get(work, result))) / root(get(work, result + 1))


@kernel
def step(work, listed, old, new, size, family, rule, plot, noise):
    """From the old bank to the new one by one plot.

    IMM: for each model merge the bank, predict and update once; with one model a Kalman filter. GPB1: predict and update
    the one merged hypothesis, the first of the old bank, with each model. GPB2: predict and update every pair of models,
    then merge those that end in the same model.
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
            least = where_greater(w, nothing, smaller(least, q), least)
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


@kernel
def merge_gpb1(work, listed, old, new, size, rule):
    """Merge the new bank over its own first hypothesis; the main one is of the model that was most probable before the plot."""
    top, main = full(-1.0), full(0.0)
    for j in range(size):
        p = get(work, old + j * HYPOTHESIS + PROBABILITY)
        main, top = where_greater(p, top, full(float(j)), main), where_greater(p, top, p, top)
        put(work, WEIGHT + j, get(work, new + j * HYPOTHESIS + PROBABILITY))
    count = shared(work, listed, new, size, full(1.0), main, rule)
    merged(work, listed, count, row(work, new))


# ---- a strip of scans --------------------------------------------------------------------------------------------------
@inline
def prepare_model(work, at, moves, bends, sigma, dt):
    """F and Q of eq. (11) over dt (lanes); moves, bends (0 or 1): with velocity, acceleration; sigma of it per step."""
    half, variance = 0.5 * dt * dt, sigma * sigma
    g0, g1 = half, moves * dt
    put3(work, at, (g1, bends * half, full(moves)))
    put3(work, at + 3, (bends * dt, full(bends), variance * (g0 * g0)))
    put3(work, at + 6, (variance * (g0 * g1), (variance * bends) * g0, variance * (g1 * g1)))
    put(work, at + 9, (variance * bends) * g1)
    put(work, at + 10, full(variance * bends))


@kernel
def prepare_step(work, size, models, transitions, transition, dt, settled):
    """Models and transition probabilities over the time since each lane's last plot.

    The matrix at transitions[transition …] holds over the interval dt since the last scan; where plots were missed since
    (not settled), P(a + b) = P(a) P(b), eq. (8).
    """
    wait = full(dt)
    if not settled:
        wait = wait + get(work, WAIT)
    put(work, WAIT, wait)
    for i in range(size):
        prepare_model(work, MODEL + 11 * i, models[3 * i], models[3 * i + 1], models[3 * i + 2], wait)
    for j in range(size):
        for i in range(size):
            c = full(transitions[transition + i * size + j])
            if not settled:
                c = full(0.0)
                for n in range(size):
                    c = c + transitions[transition + i * size + n] * get(work, TRANSITION + n * MOST + j)
            put(work, WEIGHT + i, c)
        for i in range(size):
            put(work, TRANSITION + i * MOST + j, get(work, WEIGHT + i))


@kernel
def keep_missed(work, old, new, size, detected):
    """Where the plot was missed keep the old bank, and its wait: the next prediction starts from the last plot again."""
    half = full(0.5)
    for i in range(size):
        for at in range(i * HYPOTHESIS, i * HYPOTHESIS + PROBABILITY + 1):
            put(work, new + at, where_greater(detected, half, get(work, new + at), get(work, old + at)))
        for j in range(size):
            at = TRANSITION + i * MOST + j
            put(work, at, where_greater(detected, half, full(1.0 if i == j else 0.0), get(work, at)))
    put(work, WAIT, where_greater(detected, half, full(0.0), get(work, WAIT)))


@kernel
def output(work, listed, bank, size, rule, everything, out):
    """Merge a bank by the output rule into the rows at `out`.

    Mean (9); where `everything`: variances (9) from VARIANCE, position covariances xy, xz, yz from POSITION, probabilities
    from MODELS; at INNOVATION the normalised innovation squared of what was thought most probable before the plot.
    (The rows from MERGES on, hypotheses merged and merges, are written at the end of the scan.)
    """
    for j in range(size):
        put(work, WEIGHT + j, get(work, bank + j * HYPOTHESIS + PROBABILITY))
    count = shared(work, listed, bank, size, full(1.0), full(0.0), rule)
    put(out, INNOVATION, get(work, SURPRISE))
    if not everything:
        for axis in range(3):
            put3(out, 3 * axis, mixed_mean(listed, count, row(work, SHARE), row(work, MEAN + 3 * axis)))
        return
    merged(work, listed, count, row(work, SPARE))
    for axis in range(3):
        own = SPARE + OWN + 6 * axis
        put3(out, 3 * axis, get3(work, SPARE + MEAN + 3 * axis))
        put3(out, VARIANCE + 3 * axis, (get(work, own), get(work, own + 3), get(work, own + 5)))
        put(out, POSITION + axis, get(work, SPARE + CROSS + 9 * axis))
    for j in range(size):
        put(out, MODELS + j, get(work, bank + j * HYPOTHESIS + PROBABILITY))


@kernel
def start(work, numbers, size, plots, weights, probabilities):
    """The first bank, the same hypothesis for all models, from the plots of the first three scans.

    weights (9,): how the coordinate and the velocity at the third plot are made of the three coordinates, a (3) and b (3);
    how an acceleration of one standard deviation would err the three states, g (3). probabilities (size,): to start with.
    """
    for e in range(6):
        aa, ab, bb = full(0.0), full(0.0), full(0.0)
        for k in range(3):
            r = get(plots, k * PLOT + 3 + e)
            aa = aa + (weights[k] * weights[k]) * r
            ab = ab + (weights[k] * weights[3 + k]) * r
            bb = bb + (weights[3 + k] * weights[3 + k]) * r
        axis = 0 if e == 0 else (1 if e == 3 else 2)
        if e == 0 or e == 3 or e == 5:
            at, g, h, d = OWN + 6 * axis, weights[6], weights[7], weights[8]
            put3(work, at, (aa + g * g, ab + g * h, full(g * d)))
            put3(work, at + 3, (bb + h * h, full(h * d), full(d * d)))
        else:
            at, zero = CROSS + 9 * (e - 1 if e < 3 else 2), full(0.0)
            put3(work, at, (aa, ab, zero))
            put3(work, at + 3, (ab, bb, zero))
            put3(work, at + 6, (zero, zero, zero))
    for axis in range(3):
        x, v = full(0.0), full(0.0)
        for k in range(3):
            z = get(plots, k * PLOT + axis)
            x, v = x + weights[k] * z, v + weights[3 + k] * z
        put3(work, MEAN + 3 * axis, (x, v, full(0.0)))
    for i in range(size):
        put(work, i * HYPOTHESIS + PROBABILITY, full(probabilities[i]))
        for at in range(PROBABILITY):
            put(work, i * HYPOTHESIS + at, get(work, at))
    for at in range(9):
        put(work, ESTIMATE + at, get(work, MEAN + at))
    numbers[0], numbers[1], numbers[2] = 0, -1, 1


@kernel
def run_strip(
    work,
    numbers,
    listed,
    plots,
    first,
    stop,
    size,
    models,
    transitions,
    intervals,
    times,
    rules,
    frame,
    everything,
    out,
):
    """Run one filter over the scans first … stop - 1 of a strip; all arrays by their addresses.

    work, numbers  its memory, see `work_arrays`: numbers are the bank in use, the interval that the rows MODEL and
                   TRANSITION hold for (-1: none), and 1 where no lane waits for a plot that it missed
    listed         memory for MOST whole numbers
    plots          rows: PLOT of them a scan
    models         (size * 3,): moves, accelerates (0 or 1), sigma of the acceleration per step in m/s²
    transitions    (U * size * size,): over each different interval between scans, columns: from
    intervals      (scans,) number of each scan's interval; times (U,) in s
    rules          family, merging rule, output rule, 1 to evaluate the measurement covariance at the prediction
    frame          antenna, for the latter: see `multimodel_plots.frame`
    everything     (scans,): 1 where covariances are wanted
    out            rows: OUTPUT of them a scan
    """
    family, rule = rules[0], rules[1]
    for k in range(first, stop):
        plot, interval, to = row(plots, k * PLOT), intervals[k], row(out, k * OUTPUT)
        noise, detected = row(plot, 3), get(plot, 9)
        if numbers[1] != interval or numbers[2] == 0:
            prepare_step(work, size, models, transitions, interval * size * size, times[interval], numbers[2] == 1)
            numbers[1] = interval
        if rules[3] == 1:
            noise = row(work, NOISE)
            noise_at_prediction(frame, row(work, ESTIMATE), get(work, WAIT), noise)
        put(work, MERGED, full(0.0))
        put(work, MERGED + 1, full(0.0))
        old, new = numbers[0] * BANK, (1 - numbers[0]) * BANK
        step(work, listed, old, new, size, family, rule, plot, noise)
        output(work, listed, new, size, rules[2], everything[k] == 1, to)
        if family == GPB1:
            merge_gpb1(work, listed, old, new, size, rule)
        put(to, MERGES, get(work, MERGED))
        put(to, MERGES + 1, get(work, MERGED + 1))
        if rules[3] == 1:
            for i in range(9):
                put(work, ESTIMATE + i, where_greater(detected, full(0.5), get(to, i), get(work, ESTIMATE + i)))
        if any_greater(full(0.5), detected):
            keep_missed(work, old, new, size, detected)
            numbers[2] = 0
        elif numbers[2] == 0:
            numbers[1], numbers[2] = -1, 1
        numbers[0] = 1 - numbers[0]


@kernel
def filter_strip(
    work, numbers, plots, first, stop, models, transitions, intervals, times, rules, frame, everything, out
):
    """`run_strip` of arrays."""
    run_strip(
        address(work),
        address(numbers),
        address(np.zeros(MOST, dtype=np.int64)),
        address(plots),
        first,
        stop,
        models.size // 3,
        address(models),
        address(transitions),
        address(intervals),
        address(times),
        address(rules),
        address(frame),
        address(everything),
        address(out),
    )


@kernel
def start_strip(work, numbers, plots, weights, probabilities):
    """`start` of arrays."""
    start(address(work), address(numbers), probabilities.size, address(plots), address(weights), address(probabilities))

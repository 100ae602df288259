"""Kalman, GPB1, IMM and GPB2 filters of nine states with any bank of up to five models, eight realisations at a time.

All families are made of three steps: weights are mapped to shares (`shared`, the merging rule), a hypothesis is merged of
others by shares (`merged`), and one is merged, predicted with a model and updated with the plot in one go (`advanced`).
Family, rule and number of models are run-time values: one copy of machine code serves all.
"""

from radarsim.kernels.compile import inline, kernel
from radarsim.kernels.hypothesis import (
    BANK,
    CROSS,
    ESTIMATE,
    GROUP,
    HYPOTHESIS,
    INNOVATION,
    MAIN,
    MEAN,
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
    SHARE,
    SPARE,
    TRANSITION,
    VARIANCE,
    WAIT,
    WEIGHT,
    advanced,
    get3,
    get6,
    merged,
    mixed_mean,
    put3,
    put6,
)
from radarsim.kernels.lanes import any_greater, exponential, full, get, put, root, where_greater

KALMAN, GPB1, IMM, GPB2 = range(4)
MOMENT, BEST, COMBINED, MODIFIED = range(4)


# ---- merging rules: maps of weights --------------------------------------------------------------------------------------------
@inline
def is_number(x, number):
    """1.0 where the whole number in x is `number`, else 0.0."""
    d = x - number
    return where_greater(full(0.25), d * d, full(1.0), full(0.0))


@kernel
def shared(work, listed, first, stride, size, main, rule):
    """Map the rows WEIGHT … to shares by a rule; list the hypotheses whose share is not zero in all lanes.

    Hypothesis j lies at row first + j * stride; `main` (lanes) is the number of the main one. A group whose weights are all
    zero is its main hypothesis. The rows SHARE … belong to `listed`, in order; returns their number.
    """
    nothing, one = full(0.0), full(1.0)
    weight = nothing
    for j in range(size):
        weight = weight + get(work, WEIGHT + j)
    if any_greater(full(1e-300), weight):
        for j in range(size):
            alone = is_number(main, float(j))
            put(work, WEIGHT + j, where_greater(full(1e-300), weight, alone, get(work, WEIGHT + j)))
    if rule != MOMENT:
        kept_only(work, size, main, rule)
    weight = nothing
    for j in range(size):
        weight = weight + get(work, WEIGHT + j)
    scale = one / weight
    count = 0
    for j in range(size):
        w = get(work, WEIGHT + j)
        if any_greater(w, nothing):
            put(work, SHARE + count, w * scale)
            listed[count] = first + j * stride
            count += 1
    return count


@inline
def kept_only(work, size, main, rule):
    """Set to zero the weights that a rule other than `moment` leaves out; ties go to the lower number."""
    nothing = full(0.0)
    top, best, of_main, others = get(work, WEIGHT), nothing, nothing, nothing
    for j in range(size):
        w, is_main = get(work, WEIGHT + j), is_number(main, float(j))
        best, top = where_greater(w, top, full(float(j)), best), where_greater(w, top, w, top)
        of_main = where_greater(is_main, nothing, w, of_main)
        other = where_greater(is_main, nothing, nothing, w)
        others = where_greater(other, others, other, others)
    for j in range(size):
        w, is_main, is_best = get(work, WEIGHT + j), is_number(main, float(j)), is_number(best, float(j))
        if rule == BEST:
            kept = is_best
        elif rule == COMBINED:
            kept = where_greater(of_main, others, is_main, full(1.0))
        else:
            kept = where_greater(of_main, others, is_main, where_greater(is_main, nothing, is_main, is_best))
        put(work, WEIGHT + j, where_greater(kept, nothing, w, nothing))


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
def step_imm(work, listed, old, new, size, rule, plots, plot, noises, noise):
    """IMM: for each model merge, predict and update once; with one model a Kalman filter."""
    nothing, least = full(0.0), full(1e300)
    for i in range(size):
        target = new + i * HYPOTHESIS
        c = foretold(work, old, size, i)
        count = shared(work, listed, old, HYPOTHESIS, size, full(float(i)), rule)
        advanced(work, listed, count, target, MODEL + 11 * i, RESULT + 2 * i, plots, plot, noises, noise)
        put(work, target + PROBABILITY, c)
        least = where_greater(c, nothing, smaller(least, get(work, RESULT + 2 * i)), least)
    weighed(work, new, size, least)


@kernel
def step_gpb1(work, listed, old, new, size, rule, plots, plot, noises, noise):
    """GPB1: predict and update the one merged hypothesis with each model, then merge them over the old bank's first."""
    nothing, least, top, main = full(0.0), full(1e300), full(-1.0), full(0.0)
    for j in range(size):
        p = get(work, old + j * HYPOTHESIS + PROBABILITY)
        main, top = where_greater(p, top, full(float(j)), main), where_greater(p, top, p, top)
    for i in range(size):
        target = new + i * HYPOTHESIS
        c = foretold(work, old, size, i)
        listed[0] = old
        advanced(work, listed, 1, target, MODEL + 11 * i, RESULT + 2 * i, plots, plot, noises, noise)
        put(work, target + PROBABILITY, c)
        least = where_greater(c, nothing, smaller(least, get(work, RESULT + 2 * i)), least)
    weighed(work, new, size, least)
    put(work, MAIN, main)


@inline
def weighed(work, bank, size, least):
    """Posterior probabilities of a bank, from the foretold ones and the likelihoods (eq. 9)."""
    weight = full(0.0)
    for i in range(size):
        row = bank + i * HYPOTHESIS + PROBABILITY
        p = get(work, row) * likelihood(work, least, RESULT + 2 * i)
        put(work, row, p)
        weight = weight + p
    scale = 1.0 / weight
    for i in range(size):
        row = bank + i * HYPOTHESIS + PROBABILITY
        put(work, row, get(work, row) * scale)


@kernel
def step_gpb2(work, listed, old, new, size, rule, plots, plot, noises, noise):
    """GPB2: predict and update every pair of models, then merge those that end in the same model."""
    nothing, overall = full(0.0), full(1e300)
    for i in range(size):
        foretold(work, old, size, i)
        least = full(1e300)
        for j in range(size):
            w = get(work, WEIGHT + j)
            if any_greater(w, nothing):
                listed[0] = old + j * HYPOTHESIS
                result = RESULT + 2 * j
                advanced(work, listed, 1, SPARE + j * HYPOTHESIS, MODEL + 11 * i, result, plots, plot, noises, noise)
                least = where_greater(w, nothing, smaller(least, get(work, result)), least)
        c = full(0.0)
        for j in range(size):
            w = get(work, WEIGHT + j)
            if any_greater(w, nothing):
                w = w * likelihood(work, least, RESULT + 2 * j)
                put(work, WEIGHT + j, w)
                c = c + w
        put(work, GROUP + i, least)
        put(work, new + i * HYPOTHESIS + PROBABILITY, c)
        overall = smaller(overall, least)
        count = shared(work, listed, SPARE, HYPOTHESIS, size, full(float(i)), rule)
        merged(work, listed, count, new + i * HYPOTHESIS)
    weight = full(0.0)
    for i in range(size):
        row = new + i * HYPOTHESIS + PROBABILITY
        p = get(work, row) * exponential(0.5 * (overall - get(work, GROUP + i)))
        put(work, row, p)
        weight = weight + p
    scale = 1.0 / weight
    for i in range(size):
        row = new + i * HYPOTHESIS + PROBABILITY
        put(work, row, get(work, row) * scale)


# ---- a strip of scans ------------------------------------------------------------------------------------------------------------
@inline
def prepare_model(work, row, model, dt):
    """F and Q of eq. (11) over dt (lanes); model = (moves, accelerates, sigma of the acceleration per step)."""
    moves, bends, half, variance = model[0], model[1], 0.5 * dt * dt, model[2] * model[2]
    g0, g1 = half, moves * dt
    put3(work, row, (g1, bends * half, full(moves)))
    put(work, row + 3, bends * dt)
    put(work, row + 4, full(bends))
    put3(work, row + 5, (variance * (g0 * g0), variance * (g0 * g1), (variance * bends) * g0))
    put3(work, row + 8, (variance * (g1 * g1), (variance * bends) * g1, full(variance * bends)))


@kernel
def prepare_step(work, numbers, models, transition, dt, interval):
    """Models and transition probabilities over the time since each lane's last plot.

    transition (M, M) over the interval dt since the last scan; where plots were missed since, P(a + b) = P(a) P(b), eq. (8).
    """
    size = models.shape[0]
    if numbers[2] == 1 and numbers[1] == interval:
        return
    wait = get(work, WAIT) + dt if numbers[2] == 0 else full(dt)
    put(work, WAIT, wait)
    for i in range(size):
        prepare_model(work, MODEL + 11 * i, models[i], wait)
    if numbers[2] == 1:
        for i in range(size):
            for j in range(size):
                put(work, TRANSITION + i * MOST + j, full(transition[i, j]))
    else:
        for j in range(size):
            for i in range(size):
                c = full(0.0)
                for n in range(size):
                    c = c + transition[i, n] * get(work, TRANSITION + n * MOST + j)
                put(work, WEIGHT + i, c)
            for i in range(size):
                put(work, TRANSITION + i * MOST + j, get(work, WEIGHT + i))
    numbers[1] = interval


@kernel
def keep_missed(work, old, new, size, family, plots, plot):
    """Where a plot was missed keep the old bank, so that the next prediction starts from the last plot again."""
    detected, half = get(plots, plot + 9), full(0.5)
    if family == GPB1:
        for i in range(size):
            row = i * HYPOTHESIS + PROBABILITY
            put(work, old + row, where_greater(detected, half, get(work, new + row), get(work, old + row)))
        for r in range(PROBABILITY):
            put(work, old + r, where_greater(detected, half, get(work, SPARE + r), get(work, old + r)))
    else:
        for i in range(size):
            for r in range(i * HYPOTHESIS, i * HYPOTHESIS + PROBABILITY + 1):
                put(work, new + r, where_greater(detected, half, get(work, new + r), get(work, old + r)))


@kernel
def settle(work, size, detected):
    """After a scan: lanes that were detected wait from now on, with nothing to catch up."""
    half, nothing = full(0.5), full(0.0)
    put(work, WAIT, where_greater(detected, half, nothing, get(work, WAIT)))
    for i in range(size):
        for j in range(size):
            row = TRANSITION + i * MOST + j
            put(work, row, where_greater(detected, half, full(1.0 if i == j else 0.0), get(work, row)))


@inline
def output(work, listed, bank, size, rule, everything, out, row):
    """Merge a bank by the output rule into rows of `out`.

    Mean (9); where `everything`: variances (9) from VARIANCE, position covariances xy, xz, yz from POSITION, probabilities
    from MODELS.
    """
    for j in range(size):
        put(work, WEIGHT + j, get(work, bank + j * HYPOTHESIS + PROBABILITY))
    count = shared(work, listed, bank, HYPOTHESIS, size, full(0.0), rule)
    if everything:
        target = SPARE + 4 * HYPOTHESIS
        merged(work, listed, count, target)
        for axis in range(3):
            put3(out, row + 3 * axis, get3(work, target + MEAN + 3 * axis))
            for i in range(3):
                put(out, row + VARIANCE + 3 * axis + i, get(work, target + OWN + 6 * axis + (0, 3, 5)[i]))
            put(out, row + POSITION + axis, get(work, target + CROSS + 9 * axis))
        for j in range(size):
            put(out, row + MODELS + j, get(work, bank + j * HYPOTHESIS + PROBABILITY))
    else:
        for axis in range(3):
            put3(out, row + 3 * axis, mixed_mean(work, listed, count, axis))


@kernel
def filter_strip(work, numbers, plots, scans, models, transitions, intervals, times, rules, everything, out):
    """Run one filter over a strip of scans.

    work, numbers  its memory, see `work_arrays`; a bank of hypotheses is in it (`start`)
    plots          rows: PLOT of them a scan
    scans          first and one past the last scan of the strip to filter, within the strip
    models         (M, 3): moves, accelerates (0 or 1), sigma of the acceleration per step, m/s²
    transitions    (U, M, M): over each different interval; intervals (strip,): number of a scan's; times (U,) seconds
    rules          family, merging rule, output rule
    everything     (strip,): 1 where covariances are wanted
    out            rows: OUTPUT of them a scan
    """
    size, family, rule, listed = models.shape[0], rules[0], rules[1], numbers[4:]
    half = full(0.5)
    for k in range(scans[0], scans[1]):
        plot, row, u = k * PLOT, k * OUTPUT, intervals[k]
        prepare_step(work, numbers, models, transitions[u], times[u], u)
        old, new = numbers[0] * BANK, (1 - numbers[0]) * BANK
        missed = any_greater(half, get(plots, plot + 9))
        if family == GPB2:
            step_gpb2(work, listed, old, new, size, rule, plots, plot, plots, plot + 3)
        elif family == GPB1:
            step_gpb1(work, listed, old, new, size, rule, plots, plot, plots, plot + 3)
        else:
            step_imm(work, listed, old, new, size, rule, plots, plot, plots, plot + 3)
        output(work, listed, new, size, rules[2], everything[k], out, row)
        numbers[0] = 1 - numbers[0]

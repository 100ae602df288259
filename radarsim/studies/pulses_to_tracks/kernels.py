"""The arrays that the kernels read and fill.

Letters: K scans, F filters, S laws of the noise (bursts of another signal-to-noise ratio), W windows of all designs.

The classical way to a burst's frequency: the highest line of its spectrum, eight bursts side by side.

A Kalman filter of range, velocity and acceleration, one realisation at a time; plain numbers.

x (3) is the state, P (6) its covariance, packed as in `kernels.algebra`. Numbers are taken one after the other: for
independent errors that is the same as all at once, and needs no inverse.

The bursts of eight realisations: their sums drawn, and what a filter's estimator makes of them.

As in P4's kernels an estimate is its deviation from the truth, in turns over the burst.

Hypotheses on a track's folds, and on which of its bursts locked: the Bayes filter where none is dropped.

Given its folds, and which of its bursts locked, a hypothesis is a Kalman filter of its own (`kernels.steps`). A scan
moves all and weighs them by the range, branches each over the folds that the velocity leaves possible (and, as a
mixture, over a burst that did not lock), and drops what is too far below the best or beyond the number that is kept.
The acceleration is taken before the velocity, so that it weighs a hypothesis and not its folds.

The chain over all scans of a block: range, forecast, burst, estimate, update; and the sums over realisations.

A filter runs over the realisations of a block scan by scan, so that bursts of one entry of its menu are estimated eight
side by side. States are errors: estimate less truth."""

import math
from typing import NamedTuple

import numpy as np

from radarsim.bursts.kernels.lanes import LIVE, PASSES, PRIOR, X, lane, merge, sine_cosine, step
from radarsim.bursts.kernels.lanes import ROWS as WORK
from radarsim.bursts.kernels.scoring import SIZE
from radarsim.bursts.kernels.strip import evaluate, put_drawn, take_window
from radarsim.kernels import algebra
from radarsim.kernels.algebra import NO_NOISE, add_scaled, add_spread, take_rate, take_second_rate, take_value
from radarsim.kernels.compile import inline, kernel, part
from radarsim.kernels.hypotheses import COLUMNS, FALL, INNOVATION, NEAR, NOTHING, Lists, branched, column, keep_greatest
from radarsim.kernels.lanes import WIDTH, address, full, get, put, row, rows, where_greater
from radarsim.kernels.random import LANE_BITS, U, normals, threefry, words_to_normals

# ---- records ---------------------------------------------------------------------------------------------------------
NONE, BOUND, SEQUENCE, SPECTRUM = 0, 1, 2, 3  # how a filter's bursts are estimated
AS_MEASURED, GATED, MIXTURE = 0, 1, 2  # what it does with an estimate
# Counted of the estimates of a scan: within 5 and 3 bounds of the truth; the weight with which they were taken; those
# taken in a fold that is not the truth's.
LOCKED, LOCKED_3, TAKEN, WRONG_FOLD, COUNTS = 0, 1, 2, 3, 4
# Of a filter that keeps hypotheses: realisations whose best one has no wrong fold, whose list holds one that has none,
# hypotheses.
RIGHT, LISTED, NUMBER, FOLDS = 0, 1, 2, 3
AGES = 7  # scans since the last burst that was lost: 0 … 5, then six and more, or none was lost so far

FILTER = np.dtype(
    [
        ("kind", np.int64),  # NONE … SPECTRUM
        ("takes", np.int64),  # numbers of the burst: 0, 1 velocity, 2 acceleration too
        ("use", np.int64),  # AS_MEASURED … MIXTURE
        ("track", np.int64),  # whether its forecast is its own prediction
        ("start", np.int64),  # scans without manoeuvre noise
        ("gate", np.float64),  # largest squared deviation in variances
        ("lock", np.float64),  # probability of lock before an estimate is seen
        ("density", np.float64),  # of an estimate that did not lock
        ("fixed", np.float64, 2),  # standard deviations of a forecast that is not the track's
        ("top", np.float64, 2),  # largest standard deviations of the menu: velocity, acceleration
        ("ratio", np.float64, 2),  # logarithm of the ratio of neighbouring ones
        ("levels", np.int64, 2),  # how many
        ("noise", np.float64, 6),  # Q, packed
        ("kept", np.int64),  # hypotheses kept at most; 1: the nearest fold
        ("deepest", np.float64),  # logarithm of the ratio to the best weight, below which one is dropped
        ("averages", np.int64),  # 1: estimates are the mean of all; 0: the best one
    ],
    align=True,
)


class World(NamedTuple):
    """What is observed."""

    keys: np.ndarray  #: (4, 2) of the streams of ranges, bursts, the designation, fixed forecasts
    missed: np.ndarray  #: (K, 3) see `filters.defects`
    motion: np.ndarray  #: (5,) F, as `kernels.algebra` has it
    sigma_r: float  #: of a range, m
    prior: np.ndarray  #: (2,) standard deviations of the designation
    span: float  #: of velocity, m/s
    physics: np.ndarray  #: (K,) bursts, see `bursts.kernels.scoring.PHYSICS`
    law: np.ndarray  #: (K,) of which law
    mean: np.ndarray  #: (blocks, 4) of the sums drawn
    factor: np.ndarray  #: (S, blocks, 10) roots of their covariances
    tables: tuple[np.ndarray, np.ndarray]  #: two flat arrays, see `bursts.burst.Tables`
    #: (2, 2) of a forecast's errors of velocity and acceleration b₁ and b₂ in turns over the burst
    to_turns: np.ndarray
    measured: np.ndarray  #: (2, 6) of an estimate in turns over the burst velocity and acceleration at its middle
    offset: np.ndarray  #: (K,) of the true Doppler frequency from the spectrum's lines, in lines
    twiddle: np.ndarray  #: (M / 2, 2) cosines and sines of the transform of M points
    reversed: np.ndarray  #: (M,) its order


class Filters(NamedTuple):
    """The filters."""

    filters: np.ndarray  #: (F,) see FILTER
    options: np.ndarray  #: (F,) of their sequences, see `bursts.kernels.sequence.OPTIONS`
    last: np.ndarray  #: (F,) of the last step, which is without forecast
    windows: np.ndarray  #: (W,) of all designs, see `bursts.kernels.sequence.WINDOW`
    first: np.ndarray  #: (F, K, E) where those of an entry of the menu begin
    count: np.ndarray  #: (F, K, E) how many there are
    free: np.ndarray  #: (F, K) the whole burst without forecast
    sigma: np.ndarray  #: (F, K, 2) Fisher bounds of velocity and acceleration
    baseline: int  #: the filter that gains are against


class Hypotheses(NamedTuple):
    """Up to H hypotheses of each of n realisations, H a whole number of lanes."""

    states: np.ndarray  #: (n, H, 9) see `state_of`
    weights: np.ndarray  #: (n, H) logarithms, the best one's 0
    count: np.ndarray  #: (n,) how many there are
    right: np.ndarray  #: (n, H) 1 of those that have taken no velocity in a wrong fold, else 0
    fresh: np.ndarray  #: (H, 10) room for states, and whether they are right
    #: columns, children, parents: see `kernels.hypotheses.Lists`
    columns: np.ndarray
    children: np.ndarray
    parents: np.ndarray


def hypotheses(realisations: int, most: int) -> Hypotheses:
    """Room for so many of each realisation; for none where only the nearest fold is taken."""
    room = -(-most // WIDTH) * WIDTH if most > 1 else 0
    children = 4 * room + 64
    return Hypotheses(
        states=np.zeros((realisations, room, 9)),
        weights=np.zeros((realisations, room)),
        count=np.zeros(realisations, np.int64),
        right=np.zeros((realisations, room)),
        fresh=np.zeros((room, 10)),
        columns=rows(COLUMNS * room // WIDTH),
        children=rows(3 * children // WIDTH),
        parents=np.zeros(children, np.int64),
    )


class Work(NamedTuple):
    """Work arrays for n realisations."""

    #: (n, 9) states and covariances, see `state_of`; of several hypotheses the best before the burst
    tracks: np.ndarray
    forecasts: np.ndarray  #: (n, 2) errors of the forecasts of velocity and acceleration
    entries: np.ndarray  #: (n,) of the menu
    measured: np.ndarray  #: (n, 2) the bursts' velocity and acceleration, less the truth
    ages: np.ndarray  #: (n,) scans since the last burst that was lost
    passes: np.ndarray  #: (n,) passes over a window's data so far
    room: tuple[np.ndarray, ...]  #: see `room_for`
    held: Hypotheses  #: of filters that keep several


class Sums(NamedTuple):
    """Sums over realisations; e = estimate − truth."""

    error: np.ndarray  #: (F, K, 3, 4) e, e², e³, e⁴ of range, velocity, acceleration
    paired: np.ndarray  #: (F, K, 3) e² times the baseline's
    #: (F, K, 2, 2, 2) of the burst's velocity and acceleration e², e⁴: of those that locked, of all
    measured: np.ndarray
    locks: np.ndarray  #: (F, K, COUNTS) see above
    ages: np.ndarray  #: (F, K, AGES) realisations by the scans since the last burst that was lost
    losses: np.ndarray  #: (F, K, AGES, 3, 2) e², e⁴ of these
    passes: np.ndarray  #: (F, 2) passes over a window's data of all bursts of a realisation, and their squares
    folds: np.ndarray  #: (F, K, FOLDS) see above


def shapes(filters: int, scans: int) -> dict[str, tuple[int, ...]]:
    """The shapes of `Sums`, by name."""
    each = (filters, scans)
    return {
        "error": (*each, 3, 4),
        "paired": (*each, 3),
        "measured": (*each, 2, 2, 2),
        "locks": (*each, COUNTS),
        "ages": (*each, AGES),
        "losses": (*each, AGES, 3, 2),
        "passes": (filters, 2),
        "folds": (*each, FOLDS),
    }


# ---- spectrum --------------------------------------------------------------------------------------------------------
@part
def loaded(drawn, pulses, offset, order, work, re, im):
    """The pulses' sums in the transform's order, padded with zeros, turned back by the acceleration in work.

    offset is that of the true frequency from the lines, in lines, so that it lies between them as it would."""
    bend, zero = get(work, X + 2), full(0.0)
    step, lines = 1.0 / pulses, 1.0 / order.size
    for i in range(order.size):
        j = order[i]
        if j >= pulses:
            put(re, i, zero)
            put(im, i, zero)
            continue
        t = j * step
        s, c = sine_cosine(bend * (t * t) + offset * lines * j)
        x, y = get(drawn, 4 * j), get(drawn, 4 * j + 1)
        put(re, i, c * x + s * y)
        put(im, i, c * y - s * x)


@part
def transformed(twiddle, size, re, im):
    """The discrete Fourier transform in place, of values in bit-reversed order (Cooley and Tukey 1965)."""
    half = 1
    while half < size:
        stride = size // (2 * half)
        for begin in range(0, size, 2 * half):
            for j in range(half):
                c, s = twiddle[j * stride, 0], twiddle[j * stride, 1]
                low, high = begin + j, begin + j + half
                x, y = get(re, high), get(im, high)
                u, v = c * x + s * y, c * y - s * x
                x, y = get(re, low), get(im, low)
                put(re, low, x + u)
                put(im, low, y + v)
                put(re, high, x - u)
                put(im, high, y - v)
        half *= 2


@part
def highest_line(drawn, pulses, offset, twiddle, order, work, re, im):
    """Put the frequency of the highest line into work, in turns over the burst, from −half the rate to half of it."""
    size = order.size
    loaded(drawn, pulses, offset, order, work, re, im)
    transformed(twiddle, size, re, im)
    best, found = full(-1.0), full(0.0)
    for m in range(size):
        x, y = get(re, m), get(im, m)
        power = x * x + y * y
        line = float(m if 2 * m < size else m - size)
        found = where_greater(power, best, full(line), found)
        best = where_greater(power, best, power, best)
    put(work, X + 1, (found + offset) * (pulses / size))


# ---- steps -----------------------------------------------------------------------------------------------------------
@inline
def state_of(rows, i):
    """x (3) and P (6) of row i of rows (n, 9); a row cut out of them would be counted, a fifth of the time."""
    return (rows[i, 0], rows[i, 1], rows[i, 2]), (
        rows[i, 3],
        rows[i, 4],
        rows[i, 5],
        rows[i, 6],
        rows[i, 7],
        rows[i, 8],
    )


@inline
def put_state(rows, i, x, P):
    """Write x and P into row i of rows (n, 9)."""
    rows[i, 0], rows[i, 1], rows[i, 2] = x
    rows[i, 3], rows[i, 4], rows[i, 5], rows[i, 6], rows[i, 7], rows[i, 8] = P


@inline
def begun(world, realisation, noise):
    """State and covariance after the first range, which errs by noise, and the designation, which is drawn."""
    v, a = normals(world.keys[2, 0], world.keys[2, 1], realisation, 0)
    x = noise, world.prior[0] * v, world.prior[1] * a
    return x, (world.sigma_r**2, 0.0, 0.0, world.prior[0] ** 2, 0.0, world.prior[1] ** 2)


@inline
def a_scan_later(world, own, k, x, P):
    """State and covariance a scan later, at scan k."""
    Q = own.noise
    q = (Q[0], Q[1], Q[2], Q[3], Q[4], Q[5]) if k >= own.start else NO_NOISE
    x = add_scaled(algebra.predicted(x, world.motion), 1.0, world.missed[k])
    return x, algebra.predicted_covariance(P, world.motion, q)


@inline
def folded(x, span):
    """x, less the nearest whole number of spans."""
    return x - span * np.rint(x / span)


@inline
def scored(sigma, takes, v, a, i, ages, locks, of_measured):
    """Count a burst of realisation i whose estimates err by v and a: whether it locked, and the errors' powers.

    sigma (2,) are the Fisher bounds; ages (n,) scans since a burst was lost."""
    worst = abs(v) / sigma[0]
    if takes == 2:
        worst = max(worst, abs(a) / sigma[1])
    locked = worst < 5.0
    ages[i] = min(ages[i] + 1, AGES - 1) if locked else 0
    locks[LOCKED] += 1.0 if locked else 0.0
    locks[LOCKED_3] += 1.0 if worst < 3.0 else 0.0
    for c in range(takes):
        square = v * v if c == 0 else a * a
        of_measured[c, 1, 0] += square
        of_measured[c, 1, 1] += square * square
        of_measured[c, 0, 0] += square if locked else 0.0
        of_measured[c, 0, 1] += square * square if locked else 0.0


@inline
def lock_weight(distance, determinant, takes, lock, density):
    """Probability that an estimate has locked, by its squared distance in variances from the prediction.

    determinant is that of its innovation's covariance, lock the probability before, density that of one not locked."""
    near = lock * math.exp(-0.5 * distance) / math.sqrt((2.0 * math.pi) ** takes * determinant)
    return near / (near + (1.0 - lock) * density)


@inline
def mixed(x, P, y, Q, w):
    """Mean and covariance of a mixture: (y, Q) with the weight w, (x, P) with the rest."""
    d = add_scaled(y, -1.0, x)
    P = add_spread(NO_NOISE, 1.0 - w, P, (w * d[0], w * d[1], w * d[2]))
    return add_scaled(x, w, d), add_spread(P, w, Q, ((1.0 - w) * d[0], (1.0 - w) * d[1], (1.0 - w) * d[2]))


# ---- estimate --------------------------------------------------------------------------------------------------------
AT_ONCE = 64  # blocks whose normals are drawn before their sums are made: 32 KiB


@part
def draw_pairs(k0, k1, who, pair, a, b):
    """Unit normals of the realisations who (8,) over pairs `pair`, `pair` + 1, …, both even, into flat a and b. As
    `fill_normal_strip`. Who is read so that all but the first loop run in vector registers: five times faster."""
    x, y = a.view(np.uint64), b.view(np.uint64)
    for i in range(a.size // 2):
        x[i] = U(who[i & (WIDTH - 1)])
    for i in range(a.size // 2):
        x[i], y[i] = threefry(x[i], (pair >> U(1)) + (U(i) >> U(LANE_BITS)), k0, k1)
    words_to_normals(a, b)


@kernel
def draw_sums(world, k, who, a, b, drawn):
    """Block sums of scan k of the realisations who (8,) into rows; as `bursts.kernels.strip.draw_strip`."""
    k0, k1 = world.keys[1, 0], world.keys[1, 1]
    blocks, factor = world.mean.shape[0], world.factor[world.law[k]]
    for begin in range(0, blocks, AT_ONCE):
        end = min(begin + AT_ONCE, blocks)
        pair = U(2 * (blocks * k + begin))
        draw_pairs(k0, k1, who, pair, a[: 2 * WIDTH * (end - begin)], b[: 2 * WIDTH * (end - begin)])
        put_drawn(world.mean[begin:end], factor[begin:end], a, b, drawn[4 * WIDTH * begin :])


@part
def put_forecast(world, forecast, work):
    """Errors of the forecast (8, 2) of velocity and acceleration as those of the phase's coefficients."""
    zero, turns = full(0.0), world.to_turns
    for j in range(SIZE):
        put(work, PRIOR + j, zero)
    for n in range(WIDTH):
        v, a = forecast[n, 0], forecast[n, 1]
        work[lane(PRIOR + 1, n)] = turns[0, 0] * v + turns[0, 1] * a
        work[lane(PRIOR + 2, n)] = turns[1, 1] * a
    for j in range(SIZE):
        put(work, X + j, get(work, PRIOR + j))


@part
def ideal(world, k, window, work, sums, drawn):
    """The estimate that the Fisher bound allows: one step from the truth, linear in the noise."""
    zero = full(0.0)
    physics, table = world.physics[k], address(world.tables[0])
    for j in range(SIZE):
        put(work, PRIOR + j, zero)
        put(work, X + j, zero)
    merge(drawn, table, address(world.tables[1]), window.table, window.weights, window.blocks, sums)
    evaluate(physics, work, sums, table, window, 0)
    put(work, LIVE, full(1.0))
    step(work, window, physics.amplitude / physics.sigma**2, False, full(1.0))


@kernel
def estimate(world, filters, f, k, entry, who, forecast, room, found):
    """Velocity and acceleration at the middle of the bursts of scan k, less the true ones, into found (8, 2). By the
    estimator of filter f with windows of an entry of its menu, of the realisations who (8,), whose forecasts err by
    forecast (8, 2). Returns the passes over a window's data of each as the sum over the first eight lanes of work."""
    work_, sums_, drawn_, a, b, re, im = room
    draw_sums(world, k, who, a, b, drawn_)
    work, sums, drawn = address(work_), address(sums_), address(drawn_)
    physics, own, free = world.physics[k], filters.filters[f], filters.windows[filters.free[f, k]]
    put(work, PASSES, full(0.0))
    if own.kind == BOUND:
        ideal(world, k, free, work, sums, drawn)
    else:
        tables = address(world.tables[0]), address(world.tables[1])
        put_forecast(world, forecast, work)
        if own.kind == SEQUENCE:
            first = filters.first[f, k, entry]
            for w in range(filters.count[f, k, entry]):
                window = filters.windows[first + w]
                take_window(physics, drawn, tables, window, filters.options[f], w == 0, work, sums)
        else:
            highest_line(
                *(drawn, physics.pulses, world.offset[k], world.twiddle, world.reversed),
                *(work, address(re), address(im)),
            )
        # What goes to the filter must not hold the forecast once more: the last step is on the likelihood alone.
        take_window(physics, drawn, tables, free, filters.last[f], own.kind != SEQUENCE, work, sums)
    measured = world.measured
    for n in range(WIDTH):
        for c in range(2):
            total = 0.0
            for j in range(SIZE):
                total += measured[c, j] * work[lane(X + j, n)]
            found[n, c] = total


def room_for(blocks: int, lines: int) -> tuple:
    """Work arrays for eight bursts: estimates, sums of a window, sums drawn, normals, a spectrum."""
    return (
        *(rows(WORK), rows(4 * blocks), rows(4 * blocks), rows(2 * AT_ONCE), rows(2 * AT_ONCE)),
        *(rows(lines), rows(lines)),
    )


# ---- folds -----------------------------------------------------------------------------------------------------------
WEIGHT_COLUMN = 3  # of the first list of `kernels.hypotheses.Lists`


@inline
def heaviest(weights, count):
    """The first of the greatest weights."""
    best = 0
    for h in range(1, count):
        best = h if weights[h] > weights[best] else best
    return best


@part
def ranges_to_hypotheses(world, own, k, first, work):
    """Predict all hypotheses to scan k and weigh them by its range; the tracks become those of the best."""
    variance, held = world.sigma_r**2, work.held
    for i in range(held.count.size):
        noise = world.sigma_r * normals(world.keys[0, 0], world.keys[0, 1], first + i, k)[0]
        states, weights = held.states[i], held.weights[i]
        if k == 0:
            held.count[i], held.right[i, 0], weights[0] = 1, 1.0, 0.0
            x, P = begun(world, first + i, noise)
            put_state(states, 0, x, P)
        else:
            for h in range(held.count[i]):
                x, P = state_of(states, h)
                x, P = a_scan_later(world, own, k, x, P)
                P, gain, S = take_value(P, variance, 1.0)
                e = noise - x[0]
                weights[h] -= 0.5 * (e * e / S + math.log(S))
                put_state(states, h, add_scaled(x, e, gain), P)
        x, P = state_of(states, heaviest(weights, held.count[i]))
        put_state(work.tracks, i, x, P)


@part
def branches(own, sigma, measured, span, held, i, lists):
    """Branch the hypotheses of realisation i over the folds of a measured velocity and acceleration: how many. A parent
    below zero, -1 - h, is that of a branch in which the burst did not lock."""
    v, a, best = measured[0], measured[1], NOTHING
    w, e = column(lists, 0, WEIGHT_COLUMN), column(lists, 2, INNOVATION)
    near, c = column(lists, 2, NEAR), column(lists, 2, FALL)
    mixture, lock, lost = own.use == MIXTURE, 0.0, NOTHING
    if mixture:
        lock, lost = math.log(own.lock), math.log((1.0 - own.lock) * own.density)
    states = held.states[i]
    for h in range(held.count[i]):
        x, P = state_of(states, h)
        weight = held.weights[i, h] + lock
        if own.takes == 2:
            off = a - x[2]
            P, gain, S = take_second_rate(P, sigma[1] ** 2, 1.0)
            x = add_scaled(x, off, gain)
            weight -= 0.5 * (off * off / S + math.log(2.0 * math.pi * S))
        S = P[3] + sigma[0] ** 2
        w[h], e[h], c[h] = weight - 0.5 * math.log(2.0 * math.pi * S), folded(v - x[1], span), 0.5 / S
        near[h] = w[h] - c[h] * e[h] * e[h]
        best = max(best, near[h], held.weights[i, h] + lost)
    made = branched(lists, 0, held.count[i], span, best, own.deepest, own.kept)
    if mixture:
        weights, found = lists.children, row(lists.children, lists.most // WIDTH)
        for h in range(held.count[i]):
            if held.weights[i, h] + lost >= best - own.deepest:
                weights[made], found[made], lists.parents[made] = held.weights[i, h] + lost, 0.0, -1 - h
                made += 1
        if made > own.kept:
            keep_greatest(lists, made, own.kept)
            made = own.kept
    return made


@part
def inherited(own, sigma, measured, span, held, i, made, lists):
    """Put `made` branches in the place of realisation i's hypotheses. Gives the weights of those that took the
    velocity, of those that took it in a wrong fold, and of all."""
    weights, found = lists.children, row(lists.children, lists.most // WIDTH)
    best = weights[heaviest(weights, made)]
    states, taken, wrong, whole = held.states[i], 0.0, 0.0, 0.0
    for j in range(made):
        parent, weight = lists.parents[j], math.exp(weights[j] - best)
        h = parent if parent >= 0 else -1 - parent
        x, P = state_of(states, h)
        right = held.right[i, h]
        if parent >= 0:
            if own.takes == 2:
                P, gain, _ = take_second_rate(P, sigma[1] ** 2, 1.0)
                x = add_scaled(x, measured[1] - x[2], gain)
            off = abs(found[j] + x[1]) > 0.5 * span
            P, gain, _ = take_rate(P, sigma[0] ** 2, 1.0)
            x = add_scaled(x, found[j], gain)
            right, taken, wrong = 0.0 if off else right, taken + weight, wrong + (weight if off else 0.0)
        whole += weight
        put_state(held.fresh, j, x, P)
        held.fresh[j, 9] = right
    for j in range(made):
        held.weights[i, j], held.right[i, j] = weights[j] - best, held.fresh[j, 9]
        for n in range(9):
            held.states[i, j, n] = held.fresh[j, n]
    held.count[i] = made
    return taken, wrong, whole


@inline
def put_estimate(own, held, i, best, whole, to):
    """The best hypothesis of realisation i, or the mean of all by their weights, of sum `whole`, into to (3)."""
    for c in range(3):
        to[c] = held.states[i, best, c]
        if own.averages == 1:
            total = 0.0
            for h in range(held.count[i]):
                total += math.exp(held.weights[i, h]) * held.states[i, h, c]
            to[c] = total / whole


@part
def take_folds(world, filters, f, k, work, sums):
    """As `take_estimates`, by hypotheses."""
    own, held, span, sigma = filters.filters[f], work.held, world.span, filters.sigma[f, k]
    locks, folds = sums.locks[f, k], sums.folds[f, k]
    lists = Lists(
        address(held.columns), address(held.children), address(held.parents), held.weights.shape[1], held.parents.size
    )
    for i in range(held.count.size):
        v, a = folded(work.measured[i, 0], span), work.measured[i, 1]
        scored(sigma, own.takes, v, a, i, work.ages, locks, sums.measured[f, k])
        made = branches(own, sigma, (v, a), span, held, i, lists)
        taken, wrong, whole = inherited(own, sigma, (v, a), span, held, i, made, lists)
        best = heaviest(held.weights[i], made)
        put_estimate(own, held, i, best, whole, work.tracks[i])
        locks[TAKEN] += taken / whole
        locks[WRONG_FOLD] += wrong / whole
        folds[RIGHT] += held.right[i, best]
        folds[LISTED] += held.right[i, :made].max()
        folds[NUMBER] += made


# ---- chain -----------------------------------------------------------------------------------------------------------
@part
def take_ranges(world, own, k, first, tracks):
    """Predict all tracks (n, 9) to scan k and take its range; the first sets it, and draws the designation."""
    variance = world.sigma_r**2
    for i in range(tracks.shape[0]):
        noise = world.sigma_r * normals(world.keys[0, 0], world.keys[0, 1], first + i, k)[0]
        if k == 0:
            x, P = begun(world, first + i, noise)
        else:
            x, P = state_of(tracks, i)
            x, P = a_scan_later(world, own, k, x, P)
            P, gain, _ = take_value(P, variance, 1.0)
            x = add_scaled(x, noise - x[0], gain)
        put_state(tracks, i, x, P)


@inline
def level(own, c, sigma):
    """The level of a menu whose standard deviation is the least that is no less than sigma."""
    down = math.floor(math.log(own.top[c] / sigma) / own.ratio[c] + 1e-9)
    return int(min(max(down, 0.0), own.levels[c] - 1.0))


@part
def make_forecasts(world, own, k, first, work):
    """Errors (n, 2) of the forecasts of velocity and acceleration, and entries (n,) of the menu. A burst knows of a
    velocity what is left of whole spans."""
    tracks, forecasts, entries = work.tracks, work.forecasts, work.entries
    for i in range(tracks.shape[0]):
        if own.track:
            forecasts[i, 0], forecasts[i, 1] = folded(tracks[i, 1], world.span), tracks[i, 2]
            v, a = level(own, 0, math.sqrt(tracks[i, 6])), level(own, 1, math.sqrt(tracks[i, 8]))
            entries[i] = a * own.levels[0] + v
        else:
            x, y = normals(world.keys[3, 0], world.keys[3, 1], first + i, k)
            forecasts[i, 0], forecasts[i, 1], entries[i] = own.fixed[0] * x, own.fixed[1] * y, 0


@part
def in_order(entries):
    """The places of the entries (n,) in rising order, equal ones as they come.

    A counting sort, since entries are few: Numba's own takes a second to compile."""
    count, most = entries.size, 0
    for i in range(count):
        most = max(most, entries[i])
    start, order = np.zeros(most + 2, np.int64), np.empty(count, np.int64)
    for i in range(count):
        start[entries[i] + 1] += 1
    for entry in range(most):
        start[entry + 1] += start[entry]
    for i in range(count):
        order[start[entries[i]]] = i
        start[entries[i]] += 1
    return order


@part
def estimate_all(world, filters, f, k, first, work):
    """Estimates (n, 2) of the bursts of scan k, less the truth, an entry at a time; passes are counted."""
    who, eight, found = np.empty(WIDTH, np.int64), np.empty((WIDTH, 2)), np.empty((WIDTH, 2))
    entries, measured, forecasts, passes = work.entries, work.measured, work.forecasts, work.passes
    made = work.room[0]
    order = in_order(entries)
    begin = 0
    while begin < order.size:
        entry, end = entries[order[begin]], begin
        while end < order.size and end - begin < WIDTH and entries[order[end]] == entry:
            end += 1
        for n in range(WIDTH):
            i = order[min(begin + n, end - 1)]  # a strip that is not full repeats its last
            who[n], eight[n, 0], eight[n, 1] = first + i, forecasts[i, 0], forecasts[i, 1]
        estimate(world, filters, f, k, entry, who, eight, work.room, found)
        for n in range(end - begin):
            measured[order[begin + n], 0], measured[order[begin + n], 1] = found[n, 0], found[n, 1]
            passes[order[begin + n]] += made[lane(PASSES, n)]
        begin = end


@part
def take_estimates(world, filters, f, k, work, sums):
    """Take the estimates (n, 2) of a scan into the tracks; counts and errors of them are added to the sums."""
    own, sigma, span, tracks = filters.filters[f], filters.sigma[f, k], world.span, work.tracks
    locks, of_measured, takes = sums.locks[f, k], sums.measured[f, k], own.takes
    measured, ages = work.measured, work.ages
    for i in range(tracks.shape[0]):
        x, P = state_of(tracks, i)
        v, a = measured[i, 0], measured[i, 1]
        e = v - x[1] if own.kind == BOUND else folded(v - x[1], span)
        wrong = 1.0 if abs(e + x[1]) > 0.5 * span else 0.0
        v = v if own.kind == BOUND else folded(v, span)
        scored(sigma, takes, v, a, i, ages, locks, of_measured)
        R, gain, S = take_rate(P, sigma[0] ** 2, 1.0)
        y = add_scaled(x, e, gain)
        distance, determinant = e * e / S, S
        if takes == 2:
            e = a - y[2]
            R, gain, S = take_second_rate(R, sigma[1] ** 2, 1.0)
            y = add_scaled(y, e, gain)
            distance, determinant = distance + e * e / S, determinant * S
        weight = 1.0
        if own.use == GATED:
            weight = 1.0 if distance <= own.gate else 0.0
        elif own.use != AS_MEASURED:
            weight = lock_weight(distance, determinant, takes, own.lock, own.density)
        if weight == 1.0:
            x, P = y, R
        elif weight > 0.0:
            x, P = mixed(x, P, y, R, weight)
        put_state(tracks, i, x, P)
        locks[TAKEN] += weight
        locks[WRONG_FOLD] += wrong * weight


@part
def add_errors(tracks, ages, takes, errors, error, age, loss):
    """Keep the errors (n, 3) of a scan and add their powers to the sums."""
    for i in range(tracks.shape[0]):
        age[ages[i]] += 1.0 if takes else 0.0
        for c in range(3):
            e = tracks[i, c]
            errors[i, c] = e
            error[c, 0] += e
            error[c, 1] += e * e
            error[c, 2] += e * e * e
            error[c, 3] += e * e * e * e
            if takes:
                loss[ages[i], c, 0] += e * e
                loss[ages[i], c, 1] += e * e * e * e


@part
def run_filter(world, filters, f, first, work, errors, sums):
    """A filter over all scans of realisations first, first + 1, …; errors (K, n, 3) are written."""
    own, tracks, ages = filters.filters[f], work.tracks, work.ages
    ages[:], work.passes[:] = AGES - 1, 0.0
    for k in range(world.missed.shape[0]):
        if own.kept > 1:
            ranges_to_hypotheses(world, own, k, first, work)
        else:
            take_ranges(world, own, k, first, tracks)
        if own.takes:
            make_forecasts(world, own, k, first, work)
            estimate_all(world, filters, f, k, first, work)
            if own.kept > 1:
                take_folds(world, filters, f, k, work, sums)
            else:
                take_estimates(world, filters, f, k, work, sums)
        add_errors(tracks, ages, own.takes, errors[k], sums.error[f, k], sums.ages[f, k], sums.losses[f, k])
    for passes in work.passes:
        sums.passes[f, 0] += passes
        sums.passes[f, 1] += passes * passes


@part
def add_pairs(errors, base, paired):
    """Add e² times the baseline's; errors and base (K, n, 3)."""
    for k in range(errors.shape[0]):
        for i in range(errors.shape[1]):
            for c in range(3):
                paired[k, c] += errors[k, i, c] ** 2 * base[k, i, c] ** 2


@kernel
def run_block(world, filters, first, work, errors, sums):
    """`simulate_block` with its work arrays."""
    for f in range(filters.filters.size):
        run_filter(world, filters, f, first, work, errors[f], sums)
    for f in range(filters.filters.size):
        add_pairs(errors[f], errors[filters.baseline], sums.paired[f])


def simulate_block(world, filters, sums, first, count) -> np.ndarray:
    """Add realisations first … first + count − 1 to the sums; gives their errors (F, K, count, 3)."""
    scans = world.missed.shape[0]
    errors = np.zeros((filters.filters.size, scans, count, 3))
    work = Work(
        tracks=np.zeros((count, 9)),
        forecasts=np.zeros((count, 2)),
        entries=np.zeros(count, np.int64),
        measured=np.zeros((count, 2)),
        ages=np.zeros(count, np.int64),
        passes=np.zeros(count),
        room=room_for(world.mean.shape[0], world.reversed.size),
        held=hypotheses(count, int(filters.filters["kept"].max())),
    )
    run_block(world, filters, first, work, errors, sums)
    return errors

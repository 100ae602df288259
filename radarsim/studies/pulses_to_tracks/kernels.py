"""The arrays that the kernels read and fill.

Letters: K scans, F filters, S laws of the noise (bursts of another signal-to-noise ratio), W windows of all designs.

The classical estimate of a burst's frequency: the highest line of its spectrum, for eight bursts side by side.

A Kalman filter of range, velocity and acceleration, one realisation at a time; plain numbers.

x (3) is the state, P (6) its covariance, packed as in `kernels.algebra`. Numbers are taken one after the other: for
independent errors that is the same as all at once, and needs no inverse.

The bursts of eight realisations: their sums are drawn, and estimated by a filter's estimator.

As in P4's kernels an estimate is its deviation from the truth, in turns over the burst.

Hypotheses on a track's folds, and on which of its bursts locked: the Bayes filter if none is dropped.

With its folds and locks given, a hypothesis is a Kalman filter of its own. At each scan all are predicted and weighted
by the range; each branches over the folds that the velocity leaves possible (and, in a mixture, over a burst that did
not lock); those too far below the best, or beyond the number kept, are dropped. The acceleration is taken before the
velocity, so that it weights a hypothesis and not its folds.

A block over all scans: range, forecast, burst, estimate, update; and the sums over realisations.

A filter runs over the realisations of a block scan by scan, so that bursts of the same entry of its menu are estimated
eight at a time. States are errors: estimate minus truth."""

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
AS_MEASURED, GATED, MIXTURE = 0, 1, 2  # how it uses an estimate
# Counts of a scan's estimates: those within 5 and within 3 bounds of the truth; the sum of the weights with which they
# are taken; those taken in a wrong fold.
LOCKED, LOCKED_3, TAKEN, WRONG_FOLD, COUNTS = 0, 1, 2, 3, 4
# Counts of a filter that keeps hypotheses: realisations whose best one has no wrong fold, whose list holds one without;
# the number of hypotheses.
RIGHT, LISTED, NUMBER, FOLDS = 0, 1, 2, 3
AGES = 7  # classes of scans since a burst was lost: 0 … 5, then six and more, or none lost yet

FILTER = np.dtype(
    [
        ("kind", np.int64),  # NONE … SPECTRUM
        ("takes", np.int64),  # numbers that it takes of a burst: 0; 1 velocity; 2 also acceleration
        ("use", np.int64),  # AS_MEASURED … MIXTURE
        ("track", np.int64),  # whether its forecast is the track's prediction
        ("start", np.int64),  # scans without manoeuvre noise
        ("gate", np.float64),  # largest squared deviation in variances
        ("lock", np.float64),  # prior probability of lock
        ("density", np.float64),  # of an estimate that did not lock
        ("fixed", np.float64, 2),  # standard deviations of a forecast that is not the track's
        ("top", np.float64, 2),  # largest standard deviations of the menu: velocity, acceleration
        ("ratio", np.float64, 2),  # logarithm of the ratio of neighbouring standard deviations
        ("levels", np.int64, 2),  # number of standard deviations
        ("noise", np.float64, 6),  # Q, packed
        ("max_hypotheses", np.int64),  # 1: the nearest fold
        ("max_depth", np.float64),  # logarithm of the largest ratio of the best weight to a kept one
        ("averages", np.int64),  # 1: estimates are the mean of all hypotheses; 0: the best one
    ],
    align=True,
)


class World(NamedTuple):
    """The target, its bursts, and how ranges and bursts are drawn."""

    keys: np.ndarray  #: (4, 2) of the streams of ranges, bursts, the designation, fixed forecasts
    model_defects: np.ndarray  #: (K, 3) see `filters.model_defects`
    motion: np.ndarray  #: (5,) F, as `kernels.algebra` has it
    sigma_r: float  #: of a range, m
    prior: np.ndarray  #: (2,) standard deviations of the designation
    span: float  #: of velocity, m/s
    physics: np.ndarray  #: (K,) bursts, see `bursts.kernels.scoring.PHYSICS`
    noise_law: np.ndarray  #: (K,) number of its law
    mean: np.ndarray  #: (blocks, 4) of the sums drawn
    factor: np.ndarray  #: (S, blocks, 10) roots of their covariances
    tables: tuple[np.ndarray, np.ndarray]  #: two flat arrays, see `bursts.burst.Tables`
    #: (2, 2) of a forecast's errors of velocity and acceleration b₁ and b₂ in turns over the burst
    to_turns: np.ndarray
    measured: np.ndarray  #: (2, 6) of an estimate in turns over the burst velocity and acceleration at its middle
    offset: np.ndarray  #: (K,) of the true Doppler frequency from the spectrum's lines, in lines
    twiddle: np.ndarray  #: (M / 2, 2) cosines and sines of the transform of M points
    bit_reversed: np.ndarray  #: (M,) the order of the transform's input


class Filters(NamedTuple):
    """The filters."""

    filters: np.ndarray  #: (F,) see FILTER
    options: np.ndarray  #: (F,) of their sequences, see `bursts.kernels.sequence.OPTIONS`
    last_options: np.ndarray  #: (F,) of their last step, which is without forecast
    windows: np.ndarray  #: (W,) of all designs, see `bursts.kernels.sequence.WINDOW`
    first_window: np.ndarray  #: (F, K, E) index of the first window of an entry of the menu
    window_count: np.ndarray  #: (F, K, E) number of windows of an entry
    whole_burst: np.ndarray  #: (F, K) index of the window of the whole burst without forecast
    sigma: np.ndarray  #: (F, K, 2) Fisher bounds of velocity and acceleration
    baseline: int  #: number of the filter that gains are relative to


class Hypotheses(NamedTuple):
    """Up to H hypotheses of each of n realisations, H a whole number of lanes."""

    states: np.ndarray  #: (n, H, 9) see `state_of`
    weights: np.ndarray  #: (n, H) logarithms, the best one's 0
    count: np.ndarray  #: (n,) number of hypotheses
    right: np.ndarray  #: (n, H) 1 for those that have taken no velocity in a wrong fold, else 0
    child_states: np.ndarray  #: (H, 10) states of the children, and whether they are right
    #: columns, children, parents: see `kernels.hypotheses.Lists`
    columns: np.ndarray
    children: np.ndarray
    parents: np.ndarray


def allocate_hypotheses(realisations: int, capacity: int) -> Hypotheses:
    """Allocate hypotheses, `capacity` for each realisation; none if only the nearest fold is taken."""
    room = -(-capacity // WIDTH) * WIDTH if capacity > 1 else 0
    children = 4 * room + 64
    return Hypotheses(
        states=np.zeros((realisations, room, 9)),
        weights=np.zeros((realisations, room)),
        count=np.zeros(realisations, np.int64),
        right=np.zeros((realisations, room)),
        child_states=np.zeros((room, 10)),
        columns=rows(COLUMNS * room // WIDTH),
        children=rows(3 * children // WIDTH),
        parents=np.zeros(children, np.int64),
    )


class Work(NamedTuple):
    """Work arrays for n realisations."""

    #: (n, 9) states and covariances, see `state_of`; with several hypotheses those of the best before the burst
    tracks: np.ndarray
    forecasts: np.ndarray  #: (n, 2) errors of the forecasts of velocity and acceleration
    entries: np.ndarray  #: (n,) of the menu
    measured: np.ndarray  #: (n, 2) the bursts' velocity and acceleration, minus the truth
    ages: np.ndarray  #: (n,) scans since a burst was lost
    passes: np.ndarray  #: (n,) passes over a window's data
    burst_arrays: tuple[np.ndarray, ...]  #: see `allocate_burst_arrays`
    hypotheses: Hypotheses  #: for filters that keep several


class Sums(NamedTuple):
    """Sums over realisations; e = estimate − truth."""

    error: np.ndarray  #: (F, K, 3, 4) e, e², e³, e⁴ of range, velocity, acceleration
    paired: np.ndarray  #: (F, K, 3) e² times the baseline's
    #: (F, K, 2, 2, 2) e², e⁴ of the burst's velocity and acceleration: over bursts that locked, over all
    measured: np.ndarray
    locks: np.ndarray  #: (F, K, COUNTS) see above
    ages: np.ndarray  #: (F, K, AGES) realisations by the scans since a burst was lost
    losses: np.ndarray  #: (F, K, AGES, 3, 2) e², e⁴ of these realisations
    passes: np.ndarray  #: (F, 2) passes over a window's data in all bursts of a realisation, and their squares
    folds: np.ndarray  #: (F, K, FOLDS) see above


def shapes(filters: int, scans: int) -> dict[str, tuple[int, ...]]:
    """The shapes of `Sums`, by name."""
    scans_shape = (filters, scans)
    return {
        "error": (*scans_shape, 3, 4),
        "paired": (*scans_shape, 3),
        "measured": (*scans_shape, 2, 2, 2),
        "locks": (*scans_shape, COUNTS),
        "ages": (*scans_shape, AGES),
        "losses": (*scans_shape, AGES, 3, 2),
        "passes": (filters, 2),
        "folds": (*scans_shape, FOLDS),
    }


# ---- spectrum --------------------------------------------------------------------------------------------------------
@part
def load_pulses(block_sums, pulses, offset, order, work, re, im):
    """Load the pulses' sums in the transform's order, padded with zeros, with the phase of the acceleration removed.

    offset is the distance of the true frequency from the nearest line, in lines."""
    phase_curvature, zero = get(work, X + 2), full(0.0)
    step, lines = 1.0 / pulses, 1.0 / order.size
    for i in range(order.size):
        j = order[i]
        if j >= pulses:
            put(re, i, zero)
            put(im, i, zero)
            continue
        t = j * step
        s, c = sine_cosine(phase_curvature * (t * t) + offset * lines * j)
        x, y = get(block_sums, 4 * j), get(block_sums, 4 * j + 1)
        put(re, i, c * x + s * y)
        put(im, i, c * y - s * x)


@part
def transform(twiddle, size, re, im):
    """Transform in place (discrete Fourier transform) values in bit-reversed order (Cooley and Tukey 1965)."""
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
def highest_line(block_sums, pulses, offset, twiddle, order, work, re, im):
    """Put the frequency of the highest line into work, in turns over the burst, from −half the rate to half of it."""
    size = order.size
    load_pulses(block_sums, pulses, offset, order, work, re, im)
    transform(twiddle, size, re, im)
    best, highest = full(-1.0), full(0.0)
    for m in range(size):
        x, y = get(re, m), get(im, m)
        power = x * x + y * y
        line = float(m if 2 * m < size else m - size)
        highest = where_greater(power, best, full(line), highest)
        best = where_greater(power, best, power, best)
    put(work, X + 1, (highest + offset) * (pulses / size))


# ---- steps -----------------------------------------------------------------------------------------------------------
@inline
def state_of(rows, i):
    """x (3) and P (6) of row i of rows (n, 9); a slice would be reference-counted, which takes a fifth of the time."""
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
def start_state(world, realisation, noise):
    """State and covariance after the first range, with error `noise`, and the designation, which is drawn."""
    v, a = normals(world.keys[2, 0], world.keys[2, 1], realisation, 0)
    x = noise, world.prior[0] * v, world.prior[1] * a
    return x, (world.sigma_r**2, 0.0, 0.0, world.prior[0] ** 2, 0.0, world.prior[1] ** 2)


@inline
def predict_state(world, options, k, x, P):
    """State and covariance predicted to scan k."""
    Q = options.noise
    q = (Q[0], Q[1], Q[2], Q[3], Q[4], Q[5]) if k >= options.start else NO_NOISE
    x = add_scaled(algebra.predicted(x, world.motion), 1.0, world.model_defects[k])
    return x, algebra.predicted_covariance(P, world.motion, q)


@inline
def fold(x, span):
    """x minus the nearest whole number of spans."""
    return x - span * np.rint(x / span)


@inline
def score_burst(sigma, takes, v, a, i, ages, locks, error_sums):
    """Add a burst of realisation i with errors v and a to the sums: whether it locked, and the powers of its errors.

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
        error_sums[c, 1, 0] += square
        error_sums[c, 1, 1] += square * square
        error_sums[c, 0, 0] += square if locked else 0.0
        error_sums[c, 0, 1] += square * square if locked else 0.0


@inline
def lock_weight(distance, determinant, takes, lock, density):
    """Probability that an estimate has locked, given its squared distance from the prediction in variances.

    determinant: of the innovation's covariance; lock: prior probability; density: of an estimate that did not lock."""
    locked = lock * math.exp(-0.5 * distance) / math.sqrt((2.0 * math.pi) ** takes * determinant)
    return locked / (locked + (1.0 - lock) * density)


@inline
def mix_states(x, P, y, Q, w):
    """Mean and covariance of a mixture: (y, Q) with weight w, (x, P) with weight 1 − w."""
    d = add_scaled(y, -1.0, x)
    P = add_spread(NO_NOISE, 1.0 - w, P, (w * d[0], w * d[1], w * d[2]))
    return add_scaled(x, w, d), add_spread(P, w, Q, ((1.0 - w) * d[0], (1.0 - w) * d[1], (1.0 - w) * d[2]))


# ---- estimate --------------------------------------------------------------------------------------------------------
BLOCKS_AT_ONCE = 64  # blocks whose normals are drawn before their sums are computed: 32 KiB


@part
def draw_pairs(k0, k1, realisations, pair, a, b):
    """Fill flat arrays a and b with unit normals of realisations (8,), for pairs `pair`, `pair` + 1, …

    As `fill_normal_strip`. Realisations are copied first so that the other loops run in vector registers: five times
    faster."""
    x, y = a.view(np.uint64), b.view(np.uint64)
    for i in range(a.size // 2):
        x[i] = U(realisations[i & (WIDTH - 1)])
    for i in range(a.size // 2):
        x[i], y[i] = threefry(x[i], (pair >> U(1)) + (U(i) >> U(LANE_BITS)), k0, k1)
    words_to_normals(a, b)


@kernel
def draw_sums(world, k, realisations, a, b, block_sums):
    """Fill rows with the block sums of scan k of realisations (8,); as `bursts.kernels.strip.draw_strip`."""
    k0, k1 = world.keys[1, 0], world.keys[1, 1]
    blocks, factor = world.mean.shape[0], world.factor[world.noise_law[k]]
    for begin in range(0, blocks, BLOCKS_AT_ONCE):
        end = min(begin + BLOCKS_AT_ONCE, blocks)
        pair = U(2 * (blocks * k + begin))
        draw_pairs(k0, k1, realisations, pair, a[: 2 * WIDTH * (end - begin)], b[: 2 * WIDTH * (end - begin)])
        put_drawn(world.mean[begin:end], factor[begin:end], a, b, block_sums[4 * WIDTH * begin :])


@part
def put_forecast(world, forecast, work):
    """Write the errors of forecasts (8, 2) of velocity and acceleration as errors of the phase's coefficients."""
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
def put_ideal_estimate(world, k, window, work, sums, block_sums):
    """Write the ideal estimate, which reaches the Fisher bound: one step from the truth, linear in the noise."""
    zero = full(0.0)
    physics, table = world.physics[k], address(world.tables[0])
    for j in range(SIZE):
        put(work, PRIOR + j, zero)
        put(work, X + j, zero)
    merge(block_sums, table, address(world.tables[1]), window.table, window.weights, window.blocks, sums)
    evaluate(physics, work, sums, table, window, 0)
    put(work, LIVE, full(1.0))
    step(work, window, physics.amplitude / physics.sigma**2, False, full(1.0))


@kernel
def estimate_bursts(world, filters, f, k, entry, realisations, forecast, work_arrays, estimates):
    """Fill estimates (8, 2) with the errors of velocity and acceleration at the middle of the bursts of scan k.

    For realisations (8,) by the estimator of filter f, with the windows of an entry of its menu; forecast (8, 2) errs
    by its values. The passes over a window's data are left in row PASSES of the first work array."""
    work_array, sums_array, block_sums_array, a, b, re, im = work_arrays
    draw_sums(world, k, realisations, a, b, block_sums_array)
    work, sums, block_sums = address(work_array), address(sums_array), address(block_sums_array)
    physics, options, free = world.physics[k], filters.filters[f], filters.windows[filters.whole_burst[f, k]]
    put(work, PASSES, full(0.0))
    if options.kind == BOUND:
        put_ideal_estimate(world, k, free, work, sums, block_sums)
    else:
        tables = address(world.tables[0]), address(world.tables[1])
        put_forecast(world, forecast, work)
        if options.kind == SEQUENCE:
            first = filters.first_window[f, k, entry]
            for w in range(filters.window_count[f, k, entry]):
                window = filters.windows[first + w]
                take_window(physics, block_sums, tables, window, filters.options[f], w == 0, work, sums)
        else:
            highest_line(
                *(block_sums, physics.pulses, world.offset[k], world.twiddle, world.bit_reversed),
                *(work, address(re), address(im)),
            )
        # The filter must not get its forecast twice: the last step uses the likelihood alone.
        take_window(physics, block_sums, tables, free, filters.last_options[f], options.kind != SEQUENCE, work, sums)
    measured = world.measured
    for n in range(WIDTH):
        for c in range(2):
            total = 0.0
            for j in range(SIZE):
                total += measured[c, j] * work[lane(X + j, n)]
            estimates[n, c] = total


def allocate_burst_arrays(blocks: int, lines: int) -> tuple:
    """Allocate work arrays for eight bursts: estimates, sums of a window, block sums, normals, a spectrum."""
    return (
        *(rows(WORK), rows(4 * blocks), rows(4 * blocks), rows(2 * BLOCKS_AT_ONCE), rows(2 * BLOCKS_AT_ONCE)),
        *(rows(lines), rows(lines)),
    )


# ---- folds -----------------------------------------------------------------------------------------------------------
WEIGHT_COLUMN = 3  # of the first list of `kernels.hypotheses.Lists`


@inline
def best_hypothesis(weights, count):
    """The index of the first of the greatest weights."""
    best = 0
    for h in range(1, count):
        best = h if weights[h] > weights[best] else best
    return best


@part
def take_ranges_in_hypotheses(world, options, k, first, work):
    """Predict all hypotheses to scan k and weigh them by its range; tracks are set to those of the best hypotheses."""
    variance, hypotheses = world.sigma_r**2, work.hypotheses
    for i in range(hypotheses.count.size):
        noise = world.sigma_r * normals(world.keys[0, 0], world.keys[0, 1], first + i, k)[0]
        states, weights = hypotheses.states[i], hypotheses.weights[i]
        if k == 0:
            hypotheses.count[i], hypotheses.right[i, 0], weights[0] = 1, 1.0, 0.0
            x, P = start_state(world, first + i, noise)
            put_state(states, 0, x, P)
        else:
            for h in range(hypotheses.count[i]):
                x, P = state_of(states, h)
                x, P = predict_state(world, options, k, x, P)
                P, gain, S = take_value(P, variance, 1.0)
                e = noise - x[0]
                weights[h] -= 0.5 * (e * e / S + math.log(S))
                put_state(states, h, add_scaled(x, e, gain), P)
        x, P = state_of(states, best_hypothesis(weights, hypotheses.count[i]))
        put_state(work.tracks, i, x, P)


@part
def branch_hypotheses(options, sigma, measured, span, hypotheses, i, lists):
    """Branch the hypotheses of realisation i over the folds of a measured velocity; returns the number of branches.

    A parent below zero, -1 - h, marks a branch of hypothesis h in which the burst did not lock."""
    v, a, best = measured[0], measured[1], NOTHING
    w, e = column(lists, 0, WEIGHT_COLUMN), column(lists, 2, INNOVATION)
    near, c = column(lists, 2, NEAR), column(lists, 2, FALL)
    mixture, log_lock, log_lost = options.use == MIXTURE, 0.0, NOTHING
    if mixture:
        log_lock, log_lost = math.log(options.lock), math.log((1.0 - options.lock) * options.density)
    states = hypotheses.states[i]
    for h in range(hypotheses.count[i]):
        x, P = state_of(states, h)
        weight = hypotheses.weights[i, h] + log_lock
        if options.takes == 2:
            deviation = a - x[2]
            P, gain, S = take_second_rate(P, sigma[1] ** 2, 1.0)
            x = add_scaled(x, deviation, gain)
            weight -= 0.5 * (deviation * deviation / S + math.log(2.0 * math.pi * S))
        S = P[3] + sigma[0] ** 2
        w[h], e[h], c[h] = weight - 0.5 * math.log(2.0 * math.pi * S), fold(v - x[1], span), 0.5 / S
        near[h] = w[h] - c[h] * e[h] * e[h]
        best = max(best, near[h], hypotheses.weights[i, h] + log_lost)
    branch_count = branched(lists, 0, hypotheses.count[i], span, best, options.max_depth, options.max_hypotheses)
    if mixture:
        weights, innovations = lists.children, row(lists.children, lists.most // WIDTH)
        for h in range(hypotheses.count[i]):
            weight = hypotheses.weights[i, h] + log_lost
            if weight >= best - options.max_depth:
                weights[branch_count], innovations[branch_count], lists.parents[branch_count] = weight, 0.0, -1 - h
                branch_count += 1
        if branch_count > options.max_hypotheses:
            keep_greatest(lists, branch_count, options.max_hypotheses)
            branch_count = options.max_hypotheses
    return branch_count


@part
def put_children(options, sigma, measured, span, hypotheses, i, branch_count, lists):
    """Replace the hypotheses of realisation i by its branches.

    Returns the sums of weights of those that took the velocity, of those that took it in a wrong fold, and of all."""
    weights, innovations = lists.children, row(lists.children, lists.most // WIDTH)
    best = weights[best_hypothesis(weights, branch_count)]
    states, taken_weight, wrong_weight, weight_sum = hypotheses.states[i], 0.0, 0.0, 0.0
    for j in range(branch_count):
        parent, weight = lists.parents[j], math.exp(weights[j] - best)
        h = parent if parent >= 0 else -1 - parent
        x, P = state_of(states, h)
        right = hypotheses.right[i, h]
        if parent >= 0:
            if options.takes == 2:
                P, gain, _ = take_second_rate(P, sigma[1] ** 2, 1.0)
                x = add_scaled(x, measured[1] - x[2], gain)
            is_wrong = abs(innovations[j] + x[1]) > 0.5 * span
            P, gain, _ = take_rate(P, sigma[0] ** 2, 1.0)
            x = add_scaled(x, innovations[j], gain)
            taken_weight += weight
            if is_wrong:
                right, wrong_weight = 0.0, wrong_weight + weight
        weight_sum += weight
        put_state(hypotheses.child_states, j, x, P)
        hypotheses.child_states[j, 9] = right
    for j in range(branch_count):
        hypotheses.weights[i, j], hypotheses.right[i, j] = weights[j] - best, hypotheses.child_states[j, 9]
        for n in range(9):
            hypotheses.states[i, j, n] = hypotheses.child_states[j, n]
    hypotheses.count[i] = branch_count
    return taken_weight, wrong_weight, weight_sum


@inline
def put_estimate(options, hypotheses, i, best, weight_sum, target):
    """Write into target (3) the best hypothesis of realisation i, or the weighted mean of all."""
    for c in range(3):
        target[c] = hypotheses.states[i, best, c]
        if options.averages == 1:
            total = 0.0
            for h in range(hypotheses.count[i]):
                total += math.exp(hypotheses.weights[i, h]) * hypotheses.states[i, h, c]
            target[c] = total / weight_sum


@part
def take_folds(world, filters, f, k, work, sums):
    """Take the estimates of a scan into the hypotheses; counts and errors are added to the sums."""
    options, hypotheses, span, sigma = filters.filters[f], work.hypotheses, world.span, filters.sigma[f, k]
    locks, folds = sums.locks[f, k], sums.folds[f, k]
    lists = Lists(
        address(hypotheses.columns),
        address(hypotheses.children),
        address(hypotheses.parents),
        hypotheses.weights.shape[1],
        hypotheses.parents.size,
    )
    for i in range(hypotheses.count.size):
        v, a = fold(work.measured[i, 0], span), work.measured[i, 1]
        score_burst(sigma, options.takes, v, a, i, work.ages, locks, sums.measured[f, k])
        branch_count = branch_hypotheses(options, sigma, (v, a), span, hypotheses, i, lists)
        taken_weight, wrong_weight, weight_sum = put_children(
            options, sigma, (v, a), span, hypotheses, i, branch_count, lists
        )
        best = best_hypothesis(hypotheses.weights[i], branch_count)
        put_estimate(options, hypotheses, i, best, weight_sum, work.tracks[i])
        locks[TAKEN] += taken_weight / weight_sum
        locks[WRONG_FOLD] += wrong_weight / weight_sum
        folds[RIGHT] += hypotheses.right[i, best]
        folds[LISTED] += hypotheses.right[i, :branch_count].max()
        folds[NUMBER] += branch_count


# ---- chain -----------------------------------------------------------------------------------------------------------
@part
def take_ranges(world, options, k, first, tracks):
    """Predict all tracks (n, 9) to scan k and take its range; the first sets it, and draws the designation."""
    variance = world.sigma_r**2
    for i in range(tracks.shape[0]):
        noise = world.sigma_r * normals(world.keys[0, 0], world.keys[0, 1], first + i, k)[0]
        if k == 0:
            x, P = start_state(world, first + i, noise)
        else:
            x, P = state_of(tracks, i)
            x, P = predict_state(world, options, k, x, P)
            P, gain, _ = take_value(P, variance, 1.0)
            x = add_scaled(x, noise - x[0], gain)
        put_state(tracks, i, x, P)


@inline
def menu_level(options, c, sigma):
    """The level of a menu with the smallest standard deviation that is not below sigma."""
    step = math.floor(math.log(options.top[c] / sigma) / options.ratio[c] + 1e-9)
    return int(min(max(step, 0.0), options.levels[c] - 1.0))


@part
def make_forecasts(world, options, k, first, work):
    """Fill in the errors (n, 2) of the forecasts of velocity and acceleration, and the entries (n,) of the menu.

    The velocity's error is folded, as a burst shows a velocity only modulo its span."""
    tracks, forecasts, entries = work.tracks, work.forecasts, work.entries
    for i in range(tracks.shape[0]):
        if options.track:
            forecasts[i, 0], forecasts[i, 1] = fold(tracks[i, 1], world.span), tracks[i, 2]
            v, a = menu_level(options, 0, math.sqrt(tracks[i, 6])), menu_level(options, 1, math.sqrt(tracks[i, 8]))
            entries[i] = a * options.levels[0] + v
        else:
            x, y = normals(world.keys[3, 0], world.keys[3, 1], first + i, k)
            forecasts[i, 0], forecasts[i, 1], entries[i] = options.fixed[0] * x, options.fixed[1] * y, 0


@part
def sorted_indices(entries):
    """The indices that sort entries (n,), equal ones in their order.

    A counting sort, as distinct entries are few: Numba's own takes a second to compile."""
    count, max_entry = entries.size, 0
    for i in range(count):
        max_entry = max(max_entry, entries[i])
    start, order = np.zeros(max_entry + 2, np.int64), np.empty(count, np.int64)
    for i in range(count):
        start[entries[i] + 1] += 1
    for entry in range(max_entry):
        start[entry + 1] += start[entry]
    for i in range(count):
        order[start[entries[i]]] = i
        start[entries[i]] += 1
    return order


@part
def estimate_all(world, filters, f, k, first, work):
    """Estimate the bursts of scan k, entry by entry: fills in errors (n, 2), and counts passes."""
    realisations, forecast_errors, estimates = np.empty(WIDTH, np.int64), np.empty((WIDTH, 2)), np.empty((WIDTH, 2))
    entries, measured, forecasts, passes = work.entries, work.measured, work.forecasts, work.passes
    estimate_work = work.burst_arrays[0]
    order = sorted_indices(entries)
    begin = 0
    while begin < order.size:
        entry, end = entries[order[begin]], begin
        while end < order.size and end - begin < WIDTH and entries[order[end]] == entry:
            end += 1
        for n in range(WIDTH):
            i = order[min(begin + n, end - 1)]  # an incomplete strip repeats its last realisation
            realisations[n], forecast_errors[n, 0], forecast_errors[n, 1] = first + i, forecasts[i, 0], forecasts[i, 1]
        estimate_bursts(world, filters, f, k, entry, realisations, forecast_errors, work.burst_arrays, estimates)
        for n in range(end - begin):
            measured[order[begin + n], 0], measured[order[begin + n], 1] = estimates[n, 0], estimates[n, 1]
            passes[order[begin + n]] += estimate_work[lane(PASSES, n)]
        begin = end


@part
def take_estimates(world, filters, f, k, work, sums):
    """Take the estimates (n, 2) of a scan into the tracks; counts and errors are added to the sums."""
    options, sigma, span, tracks = filters.filters[f], filters.sigma[f, k], world.span, work.tracks
    locks, error_sums, takes = sums.locks[f, k], sums.measured[f, k], options.takes
    measured, ages = work.measured, work.ages
    for i in range(tracks.shape[0]):
        x, P = state_of(tracks, i)
        v, a = measured[i, 0], measured[i, 1]
        e = v - x[1] if options.kind == BOUND else fold(v - x[1], span)
        wrong = 1.0 if abs(e + x[1]) > 0.5 * span else 0.0
        v = v if options.kind == BOUND else fold(v, span)
        score_burst(sigma, takes, v, a, i, ages, locks, error_sums)
        R, gain, S = take_rate(P, sigma[0] ** 2, 1.0)
        y = add_scaled(x, e, gain)
        distance, determinant = e * e / S, S
        if takes == 2:
            e = a - y[2]
            R, gain, S = take_second_rate(R, sigma[1] ** 2, 1.0)
            y = add_scaled(y, e, gain)
            distance, determinant = distance + e * e / S, determinant * S
        weight = 1.0
        if options.use == GATED:
            weight = 1.0 if distance <= options.gate else 0.0
        elif options.use != AS_MEASURED:
            weight = lock_weight(distance, determinant, takes, options.lock, options.density)
        if weight == 1.0:
            x, P = y, R
        elif weight > 0.0:
            x, P = mix_states(x, P, y, R, weight)
        put_state(tracks, i, x, P)
        locks[TAKEN] += weight
        locks[WRONG_FOLD] += wrong * weight


@part
def add_errors(tracks, ages, takes, errors, error, age, loss):
    """Store the errors (n, 3) of a scan and add their powers to the sums."""
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
    """Run a filter over all scans of realisations first, first + 1, …; fills in errors (K, n, 3)."""
    options, tracks, ages = filters.filters[f], work.tracks, work.ages
    ages[:], work.passes[:] = AGES - 1, 0.0
    for k in range(world.model_defects.shape[0]):
        if options.max_hypotheses > 1:
            take_ranges_in_hypotheses(world, options, k, first, work)
        else:
            take_ranges(world, options, k, first, tracks)
        if options.takes:
            make_forecasts(world, options, k, first, work)
            estimate_all(world, filters, f, k, first, work)
            if options.max_hypotheses > 1:
                take_folds(world, filters, f, k, work, sums)
            else:
                take_estimates(world, filters, f, k, work, sums)
        add_errors(tracks, ages, options.takes, errors[k], sums.error[f, k], sums.ages[f, k], sums.losses[f, k])
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
    """Run all filters over a block with the arrays that `simulate_block` allocates."""
    for f in range(filters.filters.size):
        run_filter(world, filters, f, first, work, errors[f], sums)
    for f in range(filters.filters.size):
        add_pairs(errors[f], errors[filters.baseline], sums.paired[f])


def simulate_block(world, filters, sums, first, count) -> np.ndarray:
    """Add realisations first … first + count − 1 to the sums; returns their errors (F, K, count, 3)."""
    scans = world.model_defects.shape[0]
    errors = np.zeros((filters.filters.size, scans, count, 3))
    work = Work(
        tracks=np.zeros((count, 9)),
        forecasts=np.zeros((count, 2)),
        entries=np.zeros(count, np.int64),
        measured=np.zeros((count, 2)),
        ages=np.zeros(count, np.int64),
        passes=np.zeros(count),
        burst_arrays=allocate_burst_arrays(world.mean.shape[0], world.bit_reversed.size),
        hypotheses=allocate_hypotheses(count, int(filters.filters["max_hypotheses"].max())),
    )
    run_block(world, filters, first, work, errors, sums)
    return errors

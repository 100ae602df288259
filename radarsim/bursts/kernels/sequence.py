"""The sequence of discriminators (Uss, Baryshev, Djavad 2010): Fisher scoring over windows that grow, burst by burst.

An estimate x (6,) is the phase's coefficients in turns over the whole burst; a window that is the share r of it sees
b_j = x_j r^j. The step of (6) is (Φ_θ + R_pr⁻¹)⁻¹ ∂P/∂θ; it ends a window when it is shorter than ε, measured in that
matrix. The windows are gone through in lanes: eight bursts known by block sums (`strip`), or here one by its samples.
"""

import math

import numpy as np

from radarsim.bursts.kernels import lanes as at
from radarsim.bursts.kernels.lanes import copy, lane, log_posterior, step
from radarsim.bursts.kernels.scoring import (
    DEMODULATED,
    SAMPLES,
    SIZE,
    STATE,
    TURN,
    demodulate,
    draw_samples,
    score_blocks,
    score_complex_samples,
    score_image,
    score_samples,
)
from radarsim.kernels.compile import inline, kernel, part
from radarsim.kernels.lanes import WIDTH, address, any_greater, full, get, put, where_greater
from radarsim.kernels.random import normals

LEAST_COHERENCE = 0.25  # taken into account; below it the main lobe is lost

WINDOW = np.dtype(
    [
        ("pulses", np.int64),
        ("blocks", np.int64),
        ("table", np.int64),  # where they begin in the tables of `kernels.lanes`, …
        ("weights", np.int64),  # … and their weights
        ("powers", np.float64, SIZE),  # r^j
        ("root", np.float64, (SIZE, SIZE)),  # rows v: their outer products sum to the posterior covariance, …
        ("share", np.float64, SIZE),  # … and along each the data's share of the posterior information
        ("precision", np.float64, SIZE),  # of the prior, in turns of the window
        ("direction", np.float64, SIZE),  # to search along, turns over the burst per radian rms
    ],
    align=True,
)
OPTIONS = np.dtype(
    [
        ("windows", np.int64),
        ("phases", np.int64),  # tried in the first window; 0: in closed form
        ("steps", np.int64),  # of scoring in a window, at most
        ("tolerance", np.float64),  # ε
        ("coherent", np.int64),  # whether steps account for the coherence
        ("search", np.int64),  # points on each side in the search at a hand-over; 0: none
        ("spacing", np.float64),  # of those points, radians rms
        ("margin", np.float64),  # standard errors of the coherence below one that start the search
        ("from_truth", np.int64),
        ("amplitude", np.int64),  # 0: known, 1: estimated by (7), 2: as (7) is printed
        ("forecast", np.int64),  # 0: an estimator that uses none, and is started elsewhere; see `polish`
    ],
    align=True,
)


@kernel
def evaluate(physics, samples, sums, window, state):
    """L, the coherent sum and ∂L/∂ψ τ^j of a window at state.x into state.out."""
    for j in range(SIZE):
        state.b[j] = state.x[j] * window.powers[j]
    share = window.powers[1]
    if physics.mode != SAMPLES:
        score_blocks(sums, window.blocks, 1.0 / share, 0.0, state)
        if physics.image:
            score_image(sums, window.blocks, 1.0 / share, state.amplitude, state)
        return
    for j in range(state.out.size):
        state.out[j] = 0.0
    step = physics.step / share
    for j in range(physics.samples_per_pulse):
        first, offset = j * physics.pulses, j * physics.offset / share
        if physics.complex_samples:
            score_complex_samples(samples, first, window.pulses, step, offset, 0.0, state)
        else:
            score_samples(samples, first, window.pulses, step, offset, state.amplitude, state)


# ---- windows, in lanes: `evaluate` alone tells bursts known by their samples from those known by sums ---------------
# evaluate(physics, work, sums, source, window, state) leaves L, the coherent sum and the gradient at the estimate in
# work. What a burst is known by is all in sums, source and state; of samples there is one burst, in all lanes.
def searching(evaluate):
    """The kernel that searches for a lost main lobe at a hand-over."""

    @part
    def search(physics, amplitude, work, sums, source, state, window, options, needed):
        """Moves the lanes that need it to the best of the points along the direction in which hand-overs err."""
        weight, half, points = amplitude / physics.sigma**2, full(0.5), options.search
        copy(work, at.X, at.BEGUN)
        put(work, at.BEST, log_posterior(work, window, weight))
        put(work, at.CHOSEN, full(0.0))
        for point in range(-points, points + 2):
            last = point > points
            away = options.spacing * get(work, at.CHOSEN) if last else full(options.spacing * point)
            for j in range(SIZE):
                put(work, at.X + j, get(work, at.BEGUN + j) + window.direction[j] * away)
            if point == 0:
                continue
            evaluate(physics, work, sums, source, window, state)
            if not last:
                found, best = log_posterior(work, window, weight), get(work, at.BEST)
                better = where_greater(found, best, needed, full(0.0))
                put(work, at.BEST, where_greater(better, half, found, best))
                put(work, at.CHOSEN, where_greater(better, half, full(float(point)), get(work, at.CHOSEN)))
        put(work, at.PASSES, get(work, at.PASSES) + (2.0 * points + 1.0) * needed)

    return search


def scoring(evaluate):
    """The kernel that scores within a window."""
    search = searching(evaluate)

    @part
    def scored(physics, amplitude, work, sums, source, state, window, options, searches):
        """Scoring within a window until its stop rule; lanes that are done stay where they are."""
        numbers = window.pulses * physics.samples_per_pulse
        share = 1.0 if physics.complex_samples else 0.5
        level, weight = share * numbers * amplitude, amplitude / physics.sigma**2
        error = physics.sigma * math.sqrt(share * numbers) / level
        zero, one, least = full(0.0), full(1.0), full(LEAST_COHERENCE)
        put(work, at.LIVE, one)
        for number in range(options.steps):
            evaluate(physics, work, sums, source, window, state)
            put(work, at.PASSES, get(work, at.PASSES) + get(work, at.LIVE))
            if number == 0 and searches:
                enough = full(1.0 - options.margin * error)
                needed = where_greater(enough, (1.0 / level) * get(work, at.COHERENT), one, zero)
                if any_greater(needed, zero):
                    search(physics, amplitude, work, sums, source, state, window, options, needed)
            coherence = one
            if options.coherent:
                coherence = (1.0 / level) * get(work, at.COHERENT) + 3.0 * error  # with a margin for noise
                coherence = where_greater(one, coherence, coherence, one)
                coherence = where_greater(coherence, least, coherence, least)
            step(work, window, weight, options.coherent, coherence)
            live = where_greater(get(work, at.SQUARED), full(options.tolerance**2), get(work, at.LIVE), zero)
            put(work, at.LIVE, live)
            if not any_greater(live, zero):
                break

    return scored


def following(evaluate, scored):
    """The kernel that takes an estimate through a window, the first one of its estimator or a later one."""

    @part
    def first_phase(physics, work, sums, source, state, window):
        """Puts the phase, the rest as forecast, at the argument of Σ u e^{-jψ}, where the likelihood is largest."""
        evaluate(physics, work, sums, source, window, state)
        # Without the image, L is the real part of the sum and ∂L/∂ψ its imaginary one.
        for n in range(WIDTH):
            work[lane(at.X, n)] += math.atan2(work[lane(at.SLOPES, n)], work[lane(at.COHERENT, n)]) / TURN
        put(work, at.PASSES, get(work, at.PASSES) + 1.0)

    @part
    def best_of_phases(physics, amplitude, work, sums, source, state, window, options):
        """The window scored from equally spaced phases; the end with the largest posterior is kept."""
        copy(work, at.X, at.BEGUN)
        put(work, at.BEST, full(-math.inf))
        for phase in range(options.phases):
            copy(work, at.BEGUN, at.X)
            put(work, at.X, get(work, at.X) + phase / options.phases)
            scored(physics, amplitude, work, sums, source, state, window, options, False)
            evaluate(physics, work, sums, source, window, state)
            put(work, at.PASSES, get(work, at.PASSES) + 1.0)
            found, best = log_posterior(work, window, amplitude / physics.sigma**2), get(work, at.BEST)
            for j in range(SIZE):
                better = where_greater(found, best, get(work, at.X + j), get(work, at.KEPT + j))
                put(work, at.KEPT + j, better)
            put(work, at.BEST, where_greater(found, best, found, best))
        copy(work, at.KEPT, at.X)

    @part
    def follow(physics, amplitude, work, sums, source, state, window, options, first):
        """One window of an estimator: the estimate in work moves."""
        starts = first and not options.from_truth
        if starts and options.phases > 0:
            best_of_phases(physics, amplitude, work, sums, source, state, window, options)
        else:
            if starts:
                first_phase(physics, work, sums, source, state, window)
            searches = not first and options.search > 0
            scored(physics, amplitude, work, sums, source, state, window, options, searches)

    return follow


# ---- one burst, by its samples --------------------------------------------------------------------------------------
@part
def evaluate_in_lanes(physics, work, sums, samples, window, state):
    """`evaluate` of the one burst that is in all lanes."""
    estimate_of(work, state)
    evaluate(physics, samples, sums, window, state)
    for j in range(state.out.size):
        put(work, at.VALUE + j, full(state.out[j]))


@inline
def estimate_of(work, state):
    """Write the estimate of the one burst in all lanes to state.x."""
    for j in range(SIZE):
        state.x[j] = work[lane(at.X + j, 0)]


scored = scoring(evaluate_in_lanes)
follow = following(evaluate_in_lanes, scored)


@inline
def put_errors(work, truth, errors):
    """Write the errors (6,) of the one burst in all lanes, in turns over the burst."""
    for j in range(SIZE):
        error = work[lane(at.X + j, 0)] - truth[j]
        errors[j] = error - np.rint(error) if j == 0 else error


@kernel
def run_sequence(physics, edges, samples, sums, windows, options, state, errors):
    """All windows (K,) of an estimator on one burst; writes errors (K, 6) in turns over the burst, returns passes."""
    room = np.zeros(at.ROWS * WIDTH)
    work, ready = address(room), 0
    for j in range(SIZE):
        put(work, at.PRIOR + j, full(state.prior[j]))
        put(work, at.X + j, full(state.truth[j] if options.from_truth else state.prior[j]))
    estimate_of(work, state)
    for k in range(options.windows):
        window = windows[k]
        if physics.mode == DEMODULATED:
            demodulate(physics, edges, samples, state.x, ready, window.blocks, sums)
            ready = window.blocks
        follow(physics, state.amplitude, work, sums, samples, state, window, options, k == 0)
        estimate_of(work, state)
        put_errors(work, state.truth, errors[k])
    return int(work[lane(at.PASSES, 0)])


@kernel
def draw_prior(key, realisation, sigma, state):
    """The truth and an error of standard deviations sigma (6,), in turns over the burst, into state.prior."""
    for pair in range(SIZE // 2):
        a, b = normals(key[0], key[1], realisation, pair)
        j = 2 * pair
        state.prior[j] = state.truth[j] + sigma[j] * a
        state.prior[j + 1] = state.truth[j + 1] + sigma[j + 1] * b


@kernel
def estimated_amplitude(physics, samples, kind):
    """Amplitude by (7): the root of the mean energy, or, as printed, the mean energy itself."""
    energy = 0.0
    for row in range(samples.shape[0]):
        for j in range(samples.shape[1]):
            energy += samples[row, j] * samples[row, j]
    square = max(2.0 * (energy / samples.size - physics.sigma**2), 1e-6)
    return math.sqrt(square) if kind == 1 else square


@kernel
def estimate_block(physics, edges, clean, blank, windows, options, keys, first, truth, prior_sigma, errors, passes):
    """Bursts first, first + 1, …: errors (n, F, K, 6) in turns over the burst and passes (n, F) are written.

    windows (F, K) and options (F,) are the estimators; blank (ROWS, blocks padded) has the times of the blocks, see
    `block_table`; keys (2, 2) those of noise and prior; truth and prior_sigma (6,) in turns over the burst."""
    samples, sums = np.empty(clean.shape), blank.copy()
    state = np.zeros(1, STATE)[0]
    for j in range(SIZE):
        state.truth[j] = truth[j]
    for i in range(errors.shape[0]):
        draw_prior(keys[1], first + i, prior_sigma, state)
        draw_samples(physics, keys[0], first + i, clean, samples)
        for e in range(options.size):
            if not options[e].forecast:
                continue
            state.amplitude = physics.amplitude
            if options[e].amplitude > 0:
                state.amplitude = estimated_amplitude(physics, samples, options[e].amplitude)
            passes[i, e] = run_sequence(physics, edges, samples, sums, windows[e], options[e], state, errors[i, e])


@kernel
def polish(physics, samples, windows, options, start, truth, errors):
    """Scoring on the samples of a burst in its last window from a start (6,), without prior; as `run_sequence`."""
    state, room, sums = np.zeros(1, STATE)[0], np.zeros(at.ROWS * WIDTH), np.zeros((1, 1))
    work, last = address(room), options.windows - 1
    for j in range(SIZE):
        put(work, at.PRIOR + j, full(start[j]))
        put(work, at.X + j, full(start[j]))
    state.amplitude = physics.amplitude
    scored(physics, physics.amplitude, work, sums, samples, state, windows[last], options, False)
    put_errors(work, truth, errors[last])
    return int(work[lane(at.PASSES, 0)])

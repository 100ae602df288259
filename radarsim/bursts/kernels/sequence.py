"""The sequence of discriminators (Uss, Baryshev, Djavad 2010): Fisher scoring over windows that grow, burst by burst.

An estimate x (6,) is the phase's coefficients in turns over the whole burst; a window that is the share r of it sees
b_j = x_j r^j. The step of (6) is (Φ_θ + R_pr⁻¹)⁻¹ ∂P/∂θ; it ends a window when it is shorter than ε, measured in that
matrix. The windows are gone through in lanes: eight bursts known by block sums (`sequence_lanes`), or here one by its
samples."""

import math

import numpy as np

from radarsim.bursts.kernels import scoring_lanes
from radarsim.bursts.kernels.scoring import (
    SIZE,
    STATE,
    TURN,
    score_blocks,
    score_complex_samples,
    score_image,
    score_samples,
)
from radarsim.bursts.kernels.scoring_lanes import copy, lane, log_posterior, step
from radarsim.bursts.kernels.signal import DEMODULATED, SAMPLES, demodulate, draw_samples
from radarsim.kernels.compiler import inline, kernel, kernel_part
from radarsim.kernels.lanes import WIDTH, address, any_greater, full, get, put, where_greater
from radarsim.kernels.random import normals

MIN_COHERENCE = 0.25  # taken into account; below it the main lobe is lost

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


# The kernels below process windows in lanes, of bursts given by samples or by block sums: only `evaluate` differs.
# evaluate(physics, work, sums, source, window, state) leaves L, the coherent sum and the gradient at the estimate in
# work. The data of a burst are in sums, source and state; if they are samples, one burst is in all lanes.
def search_kernel(evaluate):
    """The kernel that searches for a lost main lobe at a hand-over."""

    @kernel_part
    def search(physics, amplitude, work, sums, source, state, window, options, needed):
        """Moves the lanes that need it to the best of the points along the direction in which hand-overs err."""
        weight, half, points = amplitude / physics.sigma**2, full(0.5), options.search
        copy(work, scoring_lanes.X, scoring_lanes.START)
        put(work, scoring_lanes.BEST, log_posterior(work, window, weight))
        put(work, scoring_lanes.BEST_POINT, full(0.0))
        for point in range(-points, points + 2):
            last = point > points
            distance = options.spacing * get(work, scoring_lanes.BEST_POINT) if last else full(options.spacing * point)
            for j in range(SIZE):
                put(work, scoring_lanes.X + j, get(work, scoring_lanes.START + j) + window.direction[j] * distance)
            if point == 0:
                continue
            evaluate(physics, work, sums, source, window, state)
            if not last:
                value, best = log_posterior(work, window, weight), get(work, scoring_lanes.BEST)
                better = where_greater(value, best, needed, full(0.0))
                put(work, scoring_lanes.BEST, where_greater(better, half, value, best))
                put(
                    work,
                    scoring_lanes.BEST_POINT,
                    where_greater(better, half, full(float(point)), get(work, scoring_lanes.BEST_POINT)),
                )
        put(work, scoring_lanes.PASSES, get(work, scoring_lanes.PASSES) + (2.0 * points + 1.0) * needed)

    return search


def scoring_kernel(evaluate):
    """The kernel that scores within a window."""
    search = search_kernel(evaluate)

    @kernel_part
    def scored(physics, amplitude, work, sums, source, state, window, options, searches):
        """Scoring within a window until its stop rule; lanes that are done stay where they are."""
        numbers = window.pulses * physics.samples_per_pulse
        share = 1.0 if physics.complex_samples else 0.5
        level, weight = share * numbers * amplitude, amplitude / physics.sigma**2
        error = physics.sigma * math.sqrt(share * numbers) / level
        zero, unit, min_coherence = full(0.0), full(1.0), full(MIN_COHERENCE)
        put(work, scoring_lanes.LIVE, unit)
        for number in range(options.steps):
            evaluate(physics, work, sums, source, window, state)
            put(work, scoring_lanes.PASSES, get(work, scoring_lanes.PASSES) + get(work, scoring_lanes.LIVE))
            if number == 0 and searches:
                sufficient_coherence = full(1.0 - options.margin * error)
                needed = where_greater(
                    sufficient_coherence, (1.0 / level) * get(work, scoring_lanes.COHERENT), unit, zero
                )
                if any_greater(needed, zero):
                    search(physics, amplitude, work, sums, source, state, window, options, needed)
            coherence = unit
            if options.coherent:
                coherence = (1.0 / level) * get(work, scoring_lanes.COHERENT) + 3.0 * error  # with a margin for noise
                coherence = where_greater(unit, coherence, coherence, unit)
                coherence = where_greater(coherence, min_coherence, coherence, min_coherence)
            step(work, window, weight, options.coherent, coherence)
            live = where_greater(
                get(work, scoring_lanes.SQUARED), full(options.tolerance**2), get(work, scoring_lanes.LIVE), zero
            )
            put(work, scoring_lanes.LIVE, live)
            if not any_greater(live, zero):
                break

    return scored


def window_kernel(evaluate, scored):
    """The kernel that takes an estimate through a window, the first one of its estimator or a later one."""

    @kernel_part
    def first_phase(physics, work, sums, source, state, window):
        """Puts the phase, the rest as forecast, at the argument of Σ u e^{-jψ}, where the likelihood is largest."""
        evaluate(physics, work, sums, source, window, state)
        # Without the image, L is the real part of the sum and ∂L/∂ψ its imaginary one.
        for n in range(WIDTH):
            work[lane(scoring_lanes.X, n)] += (
                math.atan2(work[lane(scoring_lanes.SLOPES, n)], work[lane(scoring_lanes.COHERENT, n)]) / TURN
            )
        put(work, scoring_lanes.PASSES, get(work, scoring_lanes.PASSES) + 1.0)

    @kernel_part
    def best_of_phases(physics, amplitude, work, sums, source, state, window, options):
        """The window scored from equally spaced phases; the end with the largest posterior is kept."""
        copy(work, scoring_lanes.X, scoring_lanes.START)
        put(work, scoring_lanes.BEST, full(-math.inf))
        for phase in range(options.phases):
            copy(work, scoring_lanes.START, scoring_lanes.X)
            put(work, scoring_lanes.X, get(work, scoring_lanes.X) + phase / options.phases)
            scored(physics, amplitude, work, sums, source, state, window, options, False)
            evaluate(physics, work, sums, source, window, state)
            put(work, scoring_lanes.PASSES, get(work, scoring_lanes.PASSES) + 1.0)
            value, best = log_posterior(work, window, amplitude / physics.sigma**2), get(work, scoring_lanes.BEST)
            for j in range(SIZE):
                better = where_greater(
                    value, best, get(work, scoring_lanes.X + j), get(work, scoring_lanes.BEST_ESTIMATE + j)
                )
                put(work, scoring_lanes.BEST_ESTIMATE + j, better)
            put(work, scoring_lanes.BEST, where_greater(value, best, value, best))
        copy(work, scoring_lanes.BEST_ESTIMATE, scoring_lanes.X)

    @kernel_part
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


@kernel_part
def evaluate_in_lanes(physics, work, sums, samples, window, state):
    """`evaluate` of the one burst that is in all lanes."""
    copy_estimate(work, state)
    evaluate(physics, samples, sums, window, state)
    for j in range(state.out.size):
        put(work, scoring_lanes.VALUE + j, full(state.out[j]))


@inline
def copy_estimate(work, state):
    """Write the estimate of the one burst in all lanes to state.x."""
    for j in range(SIZE):
        state.x[j] = work[lane(scoring_lanes.X + j, 0)]


score_window = scoring_kernel(evaluate_in_lanes)
process_window = window_kernel(evaluate_in_lanes, score_window)


@inline
def put_errors(work, truth, errors):
    """Write the errors (6,) of the one burst in all lanes, in turns over the burst."""
    for j in range(SIZE):
        error = work[lane(scoring_lanes.X + j, 0)] - truth[j]
        errors[j] = error - np.rint(error) if j == 0 else error


@kernel
def run_sequence(physics, edges, samples, sums, windows, options, state, errors):
    """All windows (K,) of an estimator on one burst; writes errors (K, 6) in turns over the burst, returns passes."""
    room = np.zeros(scoring_lanes.ROWS * WIDTH)
    work, ready = address(room), 0
    for j in range(SIZE):
        put(work, scoring_lanes.PRIOR + j, full(state.prior[j]))
        put(work, scoring_lanes.X + j, full(state.truth[j] if options.from_truth else state.prior[j]))
    copy_estimate(work, state)
    for k in range(options.windows):
        window = windows[k]
        if physics.mode == DEMODULATED:
            demodulate(physics, edges, samples, state.x, ready, window.blocks, sums)
            ready = window.blocks
        process_window(physics, state.amplitude, work, sums, samples, state, window, options, k == 0)
        copy_estimate(work, state)
        put_errors(work, state.truth, errors[k])
    return int(work[lane(scoring_lanes.PASSES, 0)])


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
    state, room, sums = np.zeros(1, STATE)[0], np.zeros(scoring_lanes.ROWS * WIDTH), np.zeros((1, 1))
    work, last = address(room), options.windows - 1
    for j in range(SIZE):
        put(work, scoring_lanes.PRIOR + j, full(start[j]))
        put(work, scoring_lanes.X + j, full(start[j]))
    state.amplitude = physics.amplitude
    score_window(physics, physics.amplitude, work, sums, samples, state, windows[last], options, False)
    put_errors(work, truth, errors[last])
    return int(work[lane(scoring_lanes.PASSES, 0)])

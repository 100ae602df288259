"""The sequence of discriminators (Uss, Baryshev, Djavad 2010): Fisher scoring over windows that grow, burst by burst.

An estimate x (6,) is the phase's coefficients in turns over the whole burst; a window that is the share r of it sees
b_j = x_j r^j. The step of (6) is (Φ_θ + R_pr⁻¹)⁻¹ ∂P/∂θ; it ends a window when it is shorter than ε, measured in that
matrix. Block sums drawn by their own law have kernels of their own, `strip`.
"""

import math

import numpy as np

from radarsim.bursts.kernels.data import DEMODULATED, SAMPLES, demodulate, draw_samples
from radarsim.bursts.kernels.scoring import (
    SIZE,
    STATE,
    TURN,
    score_blocks,
    score_complex_samples,
    score_image,
    score_samples,
)
from radarsim.kernels.compile import inline, kernel
from radarsim.kernels.random import U, normal_pair, threefry

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


@inline
def from_nearest_turn(turns):
    """Turns, less the nearest whole number of them."""
    return turns - np.rint(turns)


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


@inline
def from_prior(window, state, j):
    """Component j of prior − estimate in turns of the window, the phase to the nearest turn."""
    d = state.prior[j] - state.x[j]
    return from_nearest_turn(d) if j == 0 else d * window.powers[j]


@inline
def value(physics, window, state):
    """Log posterior (5), up to a constant, from what `evaluate` left."""
    penalty = 0.0
    for j in range(SIZE):
        penalty += window.precision[j] * from_prior(window, state, j) ** 2
    return state.amplitude / physics.sigma**2 * state.out[0] - 0.5 * penalty


@inline
def scoring_step(physics, window, state, coherence):
    """One step (6) from the gradient in state.out; returns its squared length.

    Away from the maximum the data's curvature is the coherence times the Fisher matrix, so the step solves with
    ρ Φ_θ + R_pr⁻¹. (A whole step divided by ρ diverges along directions that the prior alone determines.)
    """
    weight = TURN * state.amplitude / physics.sigma**2
    for j in range(SIZE):
        state.b[j] = weight * state.out[2 + j] + window.precision[j] * from_prior(window, state, j)
    squared = 0.0
    for i in range(SIZE):
        along = 0.0
        for j in range(SIZE):
            along += window.root[i, j] * state.b[j]
        squared += along * along
        state.along[i] = along / (1.0 - (1.0 - coherence) * window.share[i])
    for j in range(SIZE):
        move = 0.0
        for i in range(SIZE):
            move += window.root[i, j] * state.along[i]
        state.x[j] += move / window.powers[j]
    return squared


@inline
def move_along(window, state, radians):
    """Move state.x along the direction of a window by so many radians rms."""
    for j in range(SIZE):
        state.x[j] += radians * window.direction[j]


@kernel
def searched(physics, samples, sums, window, options, state):
    """Moves the estimate to the best of the points along the direction in which hand-overs err. Returns the passes."""
    best, chosen, points = value(physics, window, state), 0, options.search
    move_along(window, state, -points * options.spacing)
    for point in range(-points, points + 1):
        if point != 0:
            evaluate(physics, samples, sums, window, state)
            found = value(physics, window, state)
            if found > best:
                best, chosen = found, point
        move_along(window, state, options.spacing)
    move_along(window, state, (chosen - points - 1) * options.spacing)
    evaluate(physics, samples, sums, window, state)
    return 2 * points + 1


@kernel
def scored(physics, samples, sums, window, options, search, state):
    """Scoring within a window until its stop rule. Returns the passes over the window's data."""
    numbers = window.pulses * physics.samples_per_pulse
    level = (1.0 if physics.complex_samples else 0.5) * numbers * state.amplitude
    error = physics.sigma * math.sqrt((1.0 if physics.complex_samples else 0.5) * numbers) / level
    passes = 0
    for step in range(options.steps):
        evaluate(physics, samples, sums, window, state)
        passes += 1
        if step == 0 and search and state.out[1] / level < 1.0 - options.margin * error:
            passes += searched(physics, samples, sums, window, options, state)
        coherence = 1.0
        if options.coherent:
            coherence = min(max(state.out[1] / level + 3.0 * error, LEAST_COHERENCE), 1.0)  # with a margin for noise
        if scoring_step(physics, window, state, coherence) <= options.tolerance**2:
            break
    return passes


@kernel
def first_phase(physics, samples, sums, window, state):
    """Puts the phase, the rest as forecast, at the argument of Σ u e^{-jψ}, where the likelihood is largest."""
    evaluate(physics, samples, sums, window, state)
    # Without the image, L is the real part of the sum and ∂L/∂ψ its imaginary one.
    state.x[0] += math.atan2(state.out[2], state.out[1]) / TURN
    return 1


@kernel
def best_of_phases(physics, samples, sums, window, options, state):
    """The first window scored from equally spaced phases; the end with the largest posterior is kept."""
    best, passes = -math.inf, 0
    for j in range(SIZE):
        state.begun[j] = state.x[j]
    for phase in range(options.phases):
        for j in range(SIZE):
            state.x[j] = state.begun[j]
        state.x[0] += phase / options.phases
        passes += scored(physics, samples, sums, window, options, False, state) + 1
        evaluate(physics, samples, sums, window, state)
        found = value(physics, window, state)
        if found > best:
            best = found
            for j in range(SIZE):
                state.kept[j] = state.x[j]
    for j in range(SIZE):
        state.x[j] = state.kept[j]
    return passes


@kernel
def run_sequence(physics, edges, samples, sums, windows, options, state, errors):
    """All windows (K,) of an estimator on one burst; writes errors (K, 6) in turns over the burst, returns passes."""
    for j in range(SIZE):
        state.x[j] = state.truth[j] if options.from_truth else state.prior[j]
    passes, ready = 0, 0
    for k in range(options.windows):
        window = windows[k]
        if physics.mode == DEMODULATED:
            demodulate(physics, edges, samples, state.x, ready, window.blocks, sums)
            ready = window.blocks
        if k == 0 and not options.from_truth and options.phases > 0:
            passes += best_of_phases(physics, samples, sums, window, options, state)
        else:
            if k == 0 and not options.from_truth:
                passes += first_phase(physics, samples, sums, window, state)
            passes += scored(physics, samples, sums, window, options, k > 0 and options.search > 0, state)
        for j in range(SIZE):
            errors[k, j] = state.x[j] - state.truth[j]
        errors[k, 0] = from_nearest_turn(errors[k, 0])
    return passes


@kernel
def draw_prior(key, realisation, sigma, state):
    """The truth and an error of standard deviations sigma (6,), in turns over the burst, into state.prior."""
    for pair in range(SIZE // 2):
        x, y = threefry(U(realisation), U(pair), key[0], key[1])
        a, b = normal_pair(x, y)
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
    `block_table`; keys (2, 2) those of noise and prior; truth and prior_sigma (6,) in turns over the burst.
    """
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
    state = np.zeros(1, STATE)[0]
    sums = np.zeros((1, 1))
    state.amplitude = physics.amplitude
    for j in range(SIZE):
        state.x[j] = state.prior[j] = start[j]
        state.truth[j] = truth[j]
    passes = scored(physics, samples, sums, windows[options.windows - 1], options, False, state)
    for j in range(SIZE):
        errors[options.windows - 1, j] = state.x[j] - truth[j]
    errors[options.windows - 1, 0] = from_nearest_turn(errors[options.windows - 1, 0])
    return passes

"""The discriminator's kernels against NumPy: sine, likelihood and gradient, block sums and their law, histograms."""

import numpy as np
import pytest

from radarsim.bursts import block_sums
from radarsim.bursts import burst as model
from radarsim.bursts.kernels import scoring, scoring_lanes, sequence_lanes, signal
from radarsim.bursts.kernels import sequence as kernels
from radarsim.kernels import lanes
from radarsim.kernels.compiler import aligned_zeros, kernel, kernel_part
from radarsim.kernels.random import stream
from radarsim.studies.discriminator.kernels import sums as kernels_sums
from tests.studies.discriminator import naive as naive
from tests.tolerances import assert_rounded, mean_error, rounding

THETA = np.array([0.7, 1e4, 18e4, -75e4, 1e6])
SLOW = np.array([0.7, 300.0, -2e5, 0.0, 0.0])
KEY = stream(7, "test")
SINE = rounding(np.pi + 2)  # the twin's angle, up to π, is rounded twice; a sine to 1.5 units, the library's to one
LARGEST_RAD = 400.0  # of the phase over 600 pulses at THETA and about it: each term of a sum is rounded by so much


def burst_of(pulses=600, complex_samples=False, per_pulse=1):
    return model.Burst(10e9, 1e-5, 1e-6, 1e-6 / per_pulse, pulses, 1.3, 0.5, complex_samples)


def physics_of(burst, mode=signal.SAMPLES, image=True):
    physics = np.zeros(1, signal.PHYSICS)
    physics[0] = (
        *(mode, burst.complex_samples, image and not burst.complex_samples, burst.pulses, burst.samples_per_pulse),
        *(burst.amplitude, burst.noise_variance**0.5, 1 / burst.pulses, burst.sampling_period_s / burst.duration_s),
    )
    return physics[0]


def window_of(burst, pulses, blocks=0):
    window = np.zeros(1, kernels.WINDOW)[0]
    window["pulses"], window["blocks"], window["powers"] = pulses, blocks, (pulses / burst.pulses) ** np.arange(6)
    return window


def rows(samples):
    return (
        np.stack([samples.real.ravel(), samples.imag.ravel()]) if np.iscomplexobj(samples) else samples.reshape(1, -1)
    )


def turns(theta, burst):
    x = np.zeros(6)
    x[: len(theta)] = theta * model.turns_per_parameter(len(theta), burst.duration_s)
    return x


@kernel
def many_sines(u, s, c):
    for i in range(u.size):
        s[i], c[i] = scoring.sincos_turns(u[i])


def test_sine_and_cosine_of_turns():
    rng = np.random.default_rng(1)
    u = np.concatenate([rng.uniform(-3e4, 3e4, 100_000), np.arange(-16, 17) / 8, [0.0, 1e9 + 0.25]])
    s, c = np.empty_like(u), np.empty_like(u)
    many_sines(u, s, c)
    exact = u - np.rint(u)
    assert np.abs(s - np.sin(2 * np.pi * exact)).max() < SINE
    assert np.abs(c - np.cos(2 * np.pi * exact)).max() < SINE


def noisy(burst, theta, seed=1):
    rng = np.random.default_rng(seed)
    t = model.sample_times(burst, burst.pulses)
    clean = model.signal(burst, model.phase_turns(theta, t))
    noise = rng.normal(0, burst.noise_variance**0.5, (2, *clean.shape))
    return t, clean + (noise[0] + 1j * noise[1] if burst.complex_samples else noise[0])


@pytest.mark.parametrize("complex_samples", [False, True])
@pytest.mark.parametrize("per_pulse", [1, 3])
def test_score_of_samples_is_the_likelihood_and_its_gradient(complex_samples, per_pulse):
    """L differences are those of the naive log posterior; the gradient its central differences."""
    burst = burst_of(complex_samples=complex_samples, per_pulse=per_pulse)
    t, u = noisy(burst, THETA)
    physics, pulses = physics_of(burst), 400
    window, state = window_of(burst, pulses), np.zeros(1, scoring.STATE)[0]
    state["amplitude"] = burst.amplitude
    at = THETA * [1.3, 1.001, 1.0, 1.1, 1.0]

    def ours(theta):
        state["x"] = turns(theta, burst)
        kernels.evaluate(physics, rows(u), np.zeros((1, 1)), window, state)
        return burst.amplitude / burst.noise_variance * state["out"][0]

    def theirs(theta):
        part = t[:, :pulses], u[:, :pulses]
        return naive.log_posterior(theta, part[1], part[0], burst.amplitude, burst.noise_variance, theta, 0.0)

    allowed = rounding(LARGEST_RAD, 4) * burst.amplitude / burst.noise_variance * np.abs(u[:, :pulses]).sum()
    assert ours(at) - ours(THETA) == pytest.approx(theirs(at) - theirs(THETA), rel=0, abs=allowed)
    ours(at)
    gradient = 2 * np.pi * burst.amplitude / burst.noise_variance * np.array(state["out"][2:7])
    scale = model.turns_per_parameter(5, pulses * burst.pulse_period_s)
    for j in range(5):
        h = 1e-5  # turns: the difference errs by (2πh)²/6 of a third derivative, which is 4π² of what the sum can be
        step = np.eye(5)[j] * h / scale[j]
        numeric = (theirs(at + step) - theirs(at - step)) / (2 * h)
        size = 2 * np.pi * burst.amplitude / burst.noise_variance * np.abs(u[:, :pulses]).sum()
        assert gradient[j] == pytest.approx(numeric, rel=0, abs=allowed / h + size * (2 * np.pi * h) ** 2 / 6)


@pytest.mark.parametrize("complex_samples", [False, True])
@pytest.mark.parametrize("per_pulse", [1, 3])
def test_the_coherent_sum_of_a_clean_burst_is_its_amplitude(complex_samples, per_pulse):
    """Half of it a sample where samples are real: their image is taken off to the last pulse."""
    burst = burst_of(complex_samples=complex_samples, per_pulse=per_pulse)
    pulses, state = 400, np.zeros(1, scoring.STATE)[0]
    clean = model.signal(burst, model.phase_turns(THETA, model.sample_times(burst, burst.pulses)))
    state["amplitude"], state["x"] = burst.amplitude, turns(THETA, burst)
    kernels.evaluate(physics_of(burst), rows(clean), np.zeros((1, 1)), window_of(burst, pulses), state)
    whole = burst.amplitude * pulses * per_pulse * (1 if complex_samples else 0.5)
    assert_rounded(state["out"][1], whole, condition=LARGEST_RAD, operations=4)


def demodulated(burst, theta, reference, per_block=20, image=True, seed=1):
    t, u = noisy(burst, theta, seed)
    edges = np.arange(0, burst.pulses + 1, per_block)
    physics = physics_of(burst, signal.DEMODULATED, image)
    mean, _ = signal.block_table(physics, edges, model.phase_turns(reference, t), u)
    signal.demodulate(physics, edges, rows(u), turns(reference, burst), 0, len(edges) - 1, mean)
    return t, u, edges, physics, mean


@pytest.mark.parametrize("complex_samples", [False, True])
@pytest.mark.parametrize("per_pulse", [1, 2])
def test_block_sums_are_sums_over_blocks(complex_samples, per_pulse):
    burst = burst_of(complex_samples=complex_samples, per_pulse=per_pulse)
    reference = THETA * 1.01
    t, u, edges, _, sums = demodulated(burst, THETA, reference)
    x = t / burst.duration_s
    naive_sums = naive.block_sums(u, model.phase_turns(reference, t), edges, x)
    # Of 20 pulses a block, by phases of twice the largest for the image; times are within half a burst.
    allowed = rounding(2 * LARGEST_RAD, 2) * 20 * per_pulse * max(np.abs(u).max(), 1)
    for row, expected in zip((scoring.Z0, scoring.Z1, scoring.Z2), naive_sums, strict=True):
        assert sums[row, : len(edges) - 1] == pytest.approx(expected.real, rel=0, abs=allowed)
        assert sums[row + 1, : len(edges) - 1] == pytest.approx(expected.imag, rel=0, abs=allowed)
    if not complex_samples:
        image = naive.block_sums(np.ones_like(u), 2 * model.phase_turns(reference, t), edges, x)
        assert sums[scoring.W0, : len(edges) - 1] == pytest.approx(image[0].real, rel=0, abs=allowed)
        assert sums[scoring.W2 + 1, : len(edges) - 1] == pytest.approx(image[2].imag, rel=0, abs=allowed)


@pytest.mark.parametrize("theta", [THETA, SLOW])
@pytest.mark.parametrize("complex_samples", [False, True])
def test_score_of_blocks_is_nearly_that_of_samples(theta, complex_samples):
    """Near the reference, the image included: likelihood and gradient to the third order of the phase in a block."""
    burst = burst_of(complex_samples=complex_samples)
    _t, u, _edges, physics, sums = demodulated(burst, theta, theta * 1.00001)
    window, state = window_of(burst, 400, 20), np.zeros(1, scoring.STATE)[0]
    state["amplitude"] = burst.amplitude
    found = []
    for shift in (0.0, 0.15):
        state["x"] = turns(theta, burst) + shift * np.array([0.3, 1, 1, 0, 0, 0])
        for mode in (signal.SAMPLES, signal.DEMODULATED):
            physics["mode"] = mode
            kernels.evaluate(physics, rows(u), sums, window, state)
            found.append(np.array(state["out"]))
    assert found[1] == pytest.approx(found[0], abs=0.05)
    assert (found[3] - found[1]) == pytest.approx(found[2] - found[0], abs=0.3)
    assert np.abs(found[2] - found[0]).max() > 20


def test_blocks_keep_the_information_of_the_bend_within_them():
    """Without noise, sixteen blocks: the gradient away from the reference is that of the samples to a few in 10⁴."""
    burst = model.Burst(10e9, 1e-5, 1e-6, 1e-6, 3200, 1.0, 1e-12, True)
    _, u, _, physics, sums = demodulated(burst, THETA, THETA, per_block=200)
    window, state = window_of(burst, 3200, 16), np.zeros(1, scoring.STATE)[0]
    state["amplitude"], found = 1.0, []
    for mode in (signal.SAMPLES, signal.DEMODULATED):
        physics["mode"] = mode
        state["x"] = turns(THETA, burst) + np.array([0, 0, 0, 0, 0.01, 0])
        kernels.evaluate(physics, rows(u), sums, window, state)
        found.append(np.array(state["out"][2:7]))
    assert found[1] == pytest.approx(found[0], rel=6e-4)


@pytest.mark.slow_cases("True-theta1")
@pytest.mark.parametrize(
    ("complex_samples", "theta"),
    [
        (False, THETA),
        (True, SLOW),
        pytest.param(False, SLOW, marks=pytest.mark.slow),
        pytest.param(True, THETA, marks=pytest.mark.slow),
    ],
)
def test_drawn_sums_have_the_law_of_demodulated_samples(theta, complex_samples):
    """Mean and covariance of drawn sums against those of sums made from drawn samples, block by block."""
    burst = burst_of(pulses=60, complex_samples=complex_samples)
    t = model.sample_times(burst, burst.pulses)
    phase = model.phase_turns(theta, t)
    edges = np.array([0, 1, 3, 20, 60])
    physics, clean = physics_of(burst), model.signal(burst, phase)
    mean, factor = signal.block_table(physics, edges, phase, clean)
    n = 40_000
    drawn, made = np.empty((2, n, 4, 4))
    samples, other = np.empty((1 + complex_samples, 60)), mean.copy()
    _, _, sums, a, b = sequence_lanes.allocate_work_arrays(4)
    law = np.ascontiguousarray(mean[scoring.Z0 : scoring.Z0 + 4, :4].T)
    for i in range(n):
        if i % 8 == 0:
            sequence_lanes.draw_strip(KEY, i, law, factor, a, b, sums)
            drawn[i : i + 8] = sums.reshape(4, 4, 8).transpose(2, 0, 1)
        signal.draw_samples(physics, KEY, i, rows(clean), samples)
        signal.demodulate(physics, edges, samples, turns(theta, burst), 0, 4, other)
        made[i] = other[scoring.Z0 : scoring.Z0 + 4, :4].T
    for block in range(4):
        scale = np.maximum(made[:, block].std(axis=0), 1e-6)
        both = [(series[:, block] / scale) for series in (drawn, made)]
        expected = mean[scoring.Z0 : scoring.Z0 + 4, block] / scale
        for series in both:
            # Some are no sums of noise; of those the scale is 10⁻⁶, what is summed 60 samples of up to 100 rad.
            allowed = mean_error(n) + rounding(100, 60) / 1e-6
            assert series.mean(axis=0) == pytest.approx(expected, abs=allowed)
        # Two covariances of unit variances, each of a spread of √2/√n at most.
        assert np.cov(both[0].T) == pytest.approx(np.cov(both[1].T), abs=mean_error(n, 2))
    between = np.corrcoef(drawn[:, 2, 0], drawn[:, 3, 0])[0, 1]
    assert abs(between) < mean_error(n)


@kernel
def many_lanes(u, s, c):
    u, s, c = lanes.address(u), lanes.address(s), lanes.address(c)
    for i in range(2000):
        y, x = scoring_lanes.sine_cosine(lanes.get(u, i))
        lanes.put(s, i, y)
        lanes.put(c, i, x)


def test_sine_and_cosine_of_lanes():
    u = np.concatenate([np.random.default_rng(2).uniform(-50, 50, 16_000 - 33), np.arange(-16, 17) / 8])
    s, c = np.empty_like(u), np.empty_like(u)
    many_lanes(u, s, c)
    exact = u - np.rint(u)
    assert np.abs(s - np.sin(2 * np.pi * exact)).max() < SINE
    assert np.abs(c - np.cos(2 * np.pi * exact)).max() < SINE


@pytest.mark.parametrize("theta", [THETA, SLOW])
@pytest.mark.parametrize("complex_samples", [False, True])
@pytest.mark.parametrize("per_pulse", [1, 2])
def test_merged_blocks_hold_the_same_likelihood(theta, complex_samples, per_pulse):
    """Sums about the truth made from samples, merged to a window's blocks: the score of samples, eight at once."""
    burst = burst_of(complex_samples=complex_samples, per_pulse=per_pulse)
    t = model.sample_times(burst, burst.pulses)
    phase, physics, image = model.phase_turns(theta, t), physics_of(burst), not complex_samples
    edges = block_sums.block_edges([100, 400, 600], 30)
    mean, factor = signal.block_table(physics, edges, phase, model.signal(burst, phase))
    tables = block_sums.WindowTables(edges, mean, 30)
    first, weights, count = tables.window(400)
    assert count < np.searchsorted(edges, 400)  # some are merged indeed
    work, sums, drawn, *_ = sequence_lanes.allocate_work_arrays(len(factor))
    state, window = np.zeros(1, scoring.STATE)[0], window_of(burst, 400)
    state["amplitude"], expected = burst.amplitude, []
    shifts = np.outer(np.linspace(0, 2, 8), [0.3, 1, 1, -0.5, 0.5, 0])
    for lane in range(8):
        _, u = noisy(burst, theta, lane)
        signal.demodulate(physics, edges, rows(u), turns(theta, burst), 0, len(factor), mean)
        drawn.reshape(-1, 4, 8)[:, :, lane] = mean[scoring.Z0 : scoring.Z0 + 4, : len(factor)].T
        state["x"] = turns(theta, burst) + shifts[lane]
        kernels.evaluate(physics, rows(u), np.zeros((1, 1)), window, state)
        expected.append(np.array(state["out"]))
    work.reshape(-1, 8)[scoring_lanes.B : scoring_lanes.B + 6] = (shifts * window["powers"]).T
    evaluate_merged(*tables.arrays(), first, weights, count, image, burst.amplitude, work, sums, drawn)
    found = work.reshape(-1, 8)[scoring_lanes.VALUE : scoring_lanes.VALUE + 8].T
    noise = np.sqrt(burst.noise_variance * 400 * per_pulse)
    assert found == pytest.approx(np.array(expected), abs=0.02 * noise)
    assert np.abs(np.diff(expected, axis=0)).max() > noise


@kernel
def evaluate_merged(table, weights, first, begin, blocks, image, amplitude, work, sums, drawn):
    table, weights = lanes.address(table), lanes.address(weights)
    work, sums, drawn = lanes.address(work), lanes.address(sums), lanes.address(drawn)
    scoring_lanes.merge(drawn, table, weights, first, begin, blocks, sums)
    scoring_lanes.score(work, sums, table, first, blocks, image, amplitude)


def test_noise_of_samples_is_white():
    burst = burst_of(pulses=20_001, complex_samples=True)
    samples = np.empty((2, 20_001))
    signal.draw_samples(physics_of(burst), KEY, 1, np.zeros((2, 20_001)), samples)
    unit = samples / burst.noise_variance**0.5
    n = unit.size
    assert unit.var() == pytest.approx(1, abs=mean_error(n, np.sqrt(2)))
    assert abs(unit.mean()) < mean_error(n)
    for one, other in ((unit[0, :-1], unit[0, 1:]), (unit[0], unit[1]), (unit[0, :10_000], unit[0, 10_001:])):
        assert abs(np.mean(one * other)) < mean_error(len(one))


def test_bins_are_quarter_octaves():
    edges, bin_of = kernels_sums.bin_edges(), kernel(lambda ratio: kernels_sums.bin_index(ratio))
    assert len(edges) == kernels_sums.BINS + 1
    ratios = np.exp(np.random.default_rng(4).uniform(np.log(edges[0]), np.log(edges[-1]), 1000))
    assert np.array_equal([bin_of(r) for r in ratios], np.searchsorted(edges, ratios, side="right") - 1)
    assert bin_of(0.0) == 0
    assert bin_of(1e300) == kernels_sums.BINS - 1


def test_sums_of_errors_against_numpy():
    rng = np.random.default_rng(5)
    n, size = 500, 3
    options = np.zeros(2, kernels.OPTIONS)
    options["windows"] = [4, 2]
    errors = rng.normal(0, 2.5, (n, 2, 4, 6))
    potential, posterior = rng.uniform(0.5, 2, (2, 2, 4, 6))
    error, every = np.zeros((2, 2, 4, size, 4))
    locks, residuals = np.zeros((2, 4, 6)), np.zeros((2, 4, size, kernels_sums.BINS))
    sums = kernels_sums.Sums(error, every, locks, residuals, np.zeros((2, 2)))
    kernels_sums.accumulate(errors, options, potential, posterior, sums)
    for f, windows in enumerate((4, 2)):
        ratio, narrow = errors[:, f, :windows, :size] / potential[f, :windows, :size], None
        narrow = np.abs(errors[:, f, :windows, :size] / posterior[f, :windows, :size]).max(axis=2)
        worst = np.abs(ratio).max(axis=2)
        expected = [worst < 5, worst < 3, narrow < 5, narrow < 3]
        expected += [np.minimum.accumulate(worst < 3, axis=1), np.minimum.accumulate(narrow < 3, axis=1)]
        np.testing.assert_array_equal(locks[f, :windows], np.stack([e.sum(axis=0) for e in expected], axis=1))
        kept = np.where((worst < 5)[..., None], ratio, 0)
        for q in range(4):
            for found, of in ((every, ratio), (error, kept)):
                power = of ** (q + 1)
                assert_rounded(found[f, :windows, :, q], power.sum(axis=0), np.abs(power).sum(axis=0), operations=n)
        np.testing.assert_array_equal(residuals[f, :windows].sum(axis=2), n)
    assert not locks[1, 2:].any()
    assert not residuals[1, 2:].any()


@pytest.mark.parametrize("complex_samples", [False, True])
def test_amplitude_estimate_and_its_misprint(complex_samples):
    """The mean energy of 50 000 samples: its root is the amplitude to 2 %, five times the spread at σ²/A² = 0.3."""
    burst = burst_of(50_000, complex_samples)
    _, u = noisy(burst, THETA)
    measured, printed = (kernels.estimated_amplitude(physics_of(burst), rows(u), kind) for kind in (1, 2))
    # Sums of so many squares, of which σ² takes 0.5 of 1.3²/2 + 0.5.
    numbers = {"condition": 2.0, "operations": u.size}
    assert_rounded(measured, naive.amplitude(burst, u), **numbers)
    assert_rounded(printed, naive.amplitude(burst, u, as_printed=True), **numbers)
    assert_rounded(printed, measured**2, operations=2)
    assert measured == pytest.approx(burst.amplitude, rel=0.02)
    assert_rounded(kernels.estimated_amplitude(physics_of(burst), rows(0 * u), 1), 1e-3)  # a floor, not a root


@kernel_part
def parabolas(physics, work, sums, peaks, window, state):
    """Puts a likelihood in each lane that falls off with the square of the distance from its peak along x₁."""
    away = lanes.get(work, scoring_lanes.X + 1) - lanes.get(lanes.address(peaks), 0)
    lanes.put(work, scoring_lanes.VALUE, lanes.full(0.0) - away * away)


search_of_parabolas = kernels.search_kernel(parabolas)


@kernel
def search(physics, work, peaks, window, options, needed):
    at, wanted = lanes.address(work), lanes.get(lanes.address(needed), 0)
    parabolas(physics, at, needed, peaks, window, needed)
    search_of_parabolas(physics, 1.0, at, needed, peaks, needed, window, options, wanted)


def test_the_search_at_a_hand_over_ends_at_the_best_of_its_points():
    """Of points −3 … 3 at half a unit, and where it began when that is best, in lanes that need a search only."""
    burst, options = burst_of(), np.zeros(1, kernels.OPTIONS)[0]
    options["search"], options["spacing"] = 3, 0.25
    window = window_of(burst, burst.pulses)
    window["direction"][1] = 2.0
    work, peaks, needed = (aligned_zeros(n, lanes.WIDTH) for n in (scoring_lanes.ROWS, 1, 1))
    work[scoring_lanes.X], work[scoring_lanes.X + 1] = 0.7, 10.0
    peaks[0] = 10.0 + np.array([-9.0, -1.4, -0.6, 0.1, 0.3, 1.1, 9.0, 9.0])
    needed[0] = [1, 1, 1, 1, 1, 1, 1, 0]
    search(physics_of(burst), work, peaks, window, options, needed)
    assert list(work[scoring_lanes.X + 1] - 10.0) == [-1.5, -1.5, -0.5, 0.0, 0.5, 1.0, 1.5, 0.0]
    assert (work[scoring_lanes.X] == 0.7).all()
    assert list(work[scoring_lanes.PASSES]) == [7, 7, 7, 7, 7, 7, 7, 0]  # each point, and the end

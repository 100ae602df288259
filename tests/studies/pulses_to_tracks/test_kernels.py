"""The compiled chain: against P4's own kernels on the same samples, and against the textbook, sample by sample."""

import math

import numpy as np
import pytest

from radarsim.bursts.burst import turns_per_parameter
from radarsim.bursts.kernels import scoring_lanes, sequence, sequence_lanes
from radarsim.bursts.kernels.scoring import SIZE, STATE
from radarsim.bursts.kernels.signal import SAMPLES
from radarsim.kernels import lanes
from radarsim.kernels.random import fill_normal_pairs
from radarsim.studies.pulses_to_tracks import scenario, study, window_menu
from radarsim.studies.pulses_to_tracks.kernels import block
from radarsim.studies.pulses_to_tracks.kernels.burst_estimate import allocate_burst_arrays, draw_sums, estimate_bursts
from radarsim.studies.pulses_to_tracks.kernels.layout import LOCKED, Sums
from tests.studies.pulses_to_tracks import naive
from tests.studies.pulses_to_tracks.conftest import CURED, IDEAL, RANGE, SEQUENCE, SPECTRUM, A, make_case
from tests.tolerances import assert_rounded, rounding

WHO = np.array([3, 1, 4, 15, 9, 2, 6, 5])
SCAN = 2
ACCELERATION = {"name": "a", "observes": A, "estimator": "sequence"}
LONG = {"pulses": 64, "repetition_rate_hz": 4e3, "snr_db": 8.0}
SHORT_PRIOR = {"sigma_velocity_mps": 3.0, "sigma_acceleration_mps2": 2.0}


def samples_of(plan, k, realisations):
    """Complex samples (8, pulses) of the bursts of scan k, turned back by the true phase, and the room they are in."""
    room = allocate_burst_arrays(len(plan.world.mean), plan.world.bit_reversed.size)
    draw_sums(plan.world, k, realisations, room[3], room[4], room[2])
    block_sums = room[2].reshape(-1, 4, lanes.WIDTH)
    return (block_sums[:, 0] + 1j * block_sums[:, 1]).T, room


def forecasts(plan, n=8):
    """Errors of forecasts (n, 2) of velocity and acceleration."""
    random = np.random.default_rng(7)
    return random.standard_normal((n, 2)) * plan.world.prior * 0.7


@pytest.fixture(scope="module")
def plan():
    return study.prepare(make_case([CURED, SEQUENCE, SPECTRUM, IDEAL, ACCELERATION], burst=LONG, prior=SHORT_PRIOR))


def windows_of_filter(plan, f):
    """The windows of the first entry of a filter's menu, and the last one, which is without forecast."""
    kernel_filters = plan.filters
    first, count = kernel_filters.first_window[f, SCAN, 0], kernel_filters.window_count[f, SCAN, 0]
    return np.concatenate(
        [
            kernel_filters.windows[first : first + count],
            kernel_filters.windows[kernel_filters.whole_burst[f, SCAN]][None],
        ]
    )


def test_estimator_equals_p4s_on_the_same_sums(plan):
    """Bursts estimated in the chain are those that P4's strips make of the same sums, to the last bit."""
    track_forecasts = forecasts(plan)
    for f in (1, 4):
        _, room = samples_of(plan, SCAN, WHO)
        estimates = np.zeros((8, 2))
        estimate_bursts(plan.world, plan.filters, f, SCAN, 0, WHO, track_forecasts, room, estimates)
        windows, work = windows_of_filter(plan, f), allocate_burst_arrays(len(plan.world.mean), 1)[0]
        for n in range(8):
            b = plan.world.to_turns @ track_forecasts[n]
            work[(scoring_lanes.PRIOR + 1) * lanes.WIDTH + n], work[(scoring_lanes.PRIOR + 2) * lanes.WIDTH + n] = b
        options = plan.filters.options[f].copy()
        options["windows"] = len(windows)
        errors = np.zeros((8, len(windows), SIZE))
        sequence_lanes.run_strip(
            *(plan.world.physics[SCAN], room[2], plan.world.tables, windows, options),
            *(work, np.zeros(room[1].size), errors),
        )
        expected = errors[:, -1] @ plan.world.measured.T
        # One product more, of turns by what they measure.
        size = np.abs(errors[:, -1]) @ np.abs(plan.world.measured.T)
        assert_rounded(estimates, expected, size, operations=SIZE)


@pytest.mark.parametrize("f", [0, 1, 4])
def test_estimator_equals_p4s_on_the_samples(plan, f):
    """On bursts of 64 pulses sums of up to three are within a thousandth of a bound of the samples."""
    track_forecasts = forecasts(plan)
    u, room = samples_of(plan, SCAN, WHO)
    estimates = np.zeros((8, 2))
    estimate_bursts(plan.world, plan.filters, f, SCAN, 0, WHO, track_forecasts, room, estimates)
    physics, windows = plan.world.physics[SCAN].copy(), windows_of_filter(plan, f)
    physics["mode"] = SAMPLES
    state, none = np.zeros(1, STATE)[0], np.zeros((1, 1))
    assert u.shape[1] == physics["pulses"]
    for n in range(8):
        state["prior"][1:3] = plan.world.to_turns @ track_forecasts[n]
        state["amplitude"] = 1.0
        options = plan.filters.options[f].copy()
        options["windows"] = len(windows) - 1
        samples = np.stack([u[n].real, u[n].imag])
        errors = np.zeros((len(windows), SIZE))
        sequence.run_sequence(physics, np.zeros(1, np.int64), samples, none, windows, options, state, errors)
        last, x = plan.filters.last_options[f].copy(), np.zeros((1, SIZE))
        last["windows"] = 1
        sequence.polish(physics, samples, windows[-1:], last, np.array(state["x"]), np.zeros(SIZE), x)
        expected = plan.world.measured @ x[0]
        assert abs(estimates[n] - expected)[0] < 2e-2 * plan.filters.sigma[f, SCAN, 0]


def test_ideal_errors_are_one_scoring_step_from_the_truth(plan):
    f = 3
    u, room = samples_of(plan, SCAN, WHO)
    estimates = np.zeros((8, 2))
    estimate_bursts(plan.world, plan.filters, f, SCAN, 0, WHO, np.zeros((8, 2)), room, estimates)
    tau = np.arange(u.shape[1]) / u.shape[1]
    powers = tau[:, None] ** np.arange(2)
    x = np.linalg.solve(powers.T @ powers, powers.T @ u.imag.T).T / (2 * math.pi)
    np.testing.assert_allclose(estimates[:, 0], x @ plan.world.measured[0, :2], rtol=2e-3)


def test_highest_line_equals_that_of_the_discrete_transform(plan):
    f = 2
    u, room = samples_of(plan, SCAN, WHO)
    track_forecasts, lines = forecasts(plan), plan.world.bit_reversed.size
    estimates = np.zeros((8, 2))
    estimate_bursts(plan.world, plan.filters, f, SCAN, 0, WHO, track_forecasts, room, estimates)
    variance = float(plan.world.physics[SCAN]["sigma"]) ** 2
    for n in range(8):
        b = np.zeros(6)
        b[1:3] = plan.world.to_turns @ track_forecasts[n]
        x = naive.spectrum(u[n], variance, b, 2, lines, plan.world.offset[SCAN])
        assert estimates[n, 0] == pytest.approx(plan.world.measured[0] @ x, abs=2e-2 * plan.filters.sigma[f, SCAN, 0])


def test_offset_of_the_lines_from_the_true_frequency(plan):
    """The true Doppler frequency plus the offset is a whole number of lines."""
    t = plan.axes.t_s
    velocity = -250.0 + 4.0 * t
    lines = 2 * velocity / 0.03 / 4e3 * plan.world.bit_reversed.size + plan.world.offset
    # Of up to some ten thousand lines, by six operations.
    np.testing.assert_allclose(lines, np.rint(lines), rtol=0, atol=rounding(np.abs(lines).max(), 6))


def test_jerk_within_a_burst_appears_as_a_velocity(plan):
    """The number that the page gives of what is left out: j T_p² (3N² − 7)/120, and no acceleration."""
    pulses, period, hard = 64, 1 / 4e3, 40.0
    t = (np.arange(pulses) - (pulses - 1) / 2) * period
    samples = np.exp(2j * math.pi * 2 / 0.03 * hard / 6 * t**3)
    x = naive.score((samples, pulses), 1e-6, np.zeros(6), np.zeros(6), np.zeros(6), 3, True)
    velocity, acceleration = plan.world.measured @ x
    # A phase of this many radians, of which the sine is taken for the angle.
    phase = 2 * math.pi * 2 / 0.03 * hard / 6 * t[-1] ** 3
    expected = hard * period**2 * (3 * pulses**2 - 7) / 120
    assert velocity == pytest.approx(expected, rel=phase**2 / 6 + rounding(operations=pulses) / phase)
    # The sum of odd terms: rounding, in radians, over the acceleration that makes one radian at the ends.
    assert abs(acceleration) < rounding(operations=pulses**2) / (2 * math.pi / 0.03 * t[-1] ** 2)


def normals(plan, stream, pair, n):
    """The two unit normals of a draw pair of realisations 0 … n − 1 of a stream."""
    a, b = np.empty(n), np.empty(n)
    fill_normal_pairs(plan.world.keys[stream], 0, pair, a, b)
    return a, b


def textbook_errors(plan, case, f, count):
    """Errors (K, count, 3) of filter f, one realisation after the other."""
    spec, options = case.spec, case.spec.filters[f]
    size = window_menu.parameter_count(options) if options.takes else 0
    errors = np.zeros((spec.scans, count, 3))
    designation = normals(plan, 2, 0, count)
    noise = [normals(plan, 0, k, count)[0] for k in range(spec.scans)]
    fixed = [normals(plan, 3, k, count) for k in range(spec.scans)]
    bursts = []
    for k in range(spec.scans if options.takes else 0):
        groups = [np.minimum(np.arange(i, i + 8), count - 1) for i in range(0, count, 8)]
        bursts.append(np.concatenate([samples_of(plan, k, group)[0] for group in groups])[:count])
    keys = {"gate": plan.filters.filters[f]["gate"], "lock": plan.filters.filters[f]["lock"]}
    keys["density"] = plan.filters.filters[f]["density"]
    for i in range(count):
        prior = plan.world.prior
        track = naive.Track(50.0, 50.0 * noise[0][i], prior * [designation[0][i], designation[1][i]], prior)
        for k in range(spec.scans):
            if k:
                track.predict(
                    10.0,
                    options.manoeuvre_variance if k >= (2 if options.takes else 3) else 0.0,
                    plan.world.model_defects[k],
                )
                track.take([0], np.array([50.0 * noise[k][i]]) - track.x[:1], [2500.0])
            if options.takes:
                x = textbook_estimate(plan, options, f, k, track, bursts[k][i], [fixed[k][0][i], fixed[k][1][i]], size)
                measured = (plan.world.measured @ x)[: options.takes]
                innovation = measured - track.x[1 : 1 + options.takes]
                innovation[0] -= plan.world.span * round(innovation[0] / plan.world.span)
                rows, sigma = list(range(1, 1 + options.takes)), plan.filters.sigma[f, k, : options.takes]
                track.take(rows, innovation, sigma**2, options.use, **keys)
            errors[k, i] = track.x
    return errors


def textbook_estimate(plan, options, f, k, track, samples, forecast_errors, size):
    """The textbook's estimate of a burst: coefficients (6,), less the truth."""
    burst = scenario.bursts(SPEC[0], np.array([[1e5, 0.0, 0.0]]))[0]
    variance = float(plan.world.physics[k]["sigma"]) ** 2
    forecast = track.x[1:] if plan.filters.filters[f]["track"] else plan.filters.filters[f]["fixed"] * forecast_errors
    b = np.zeros(6)
    b[1:3] = plan.world.to_turns @ forecast
    if options.estimator == "spectrum":
        return naive.spectrum(samples, variance, b, size, plan.world.bit_reversed.size, plan.world.offset[k])
    menu, entry = plan.menus[f], 0
    if options.forecast == "track":
        spreads = [menu.spreads(e) for e in range(len(menu.windows))]
        fits = [e for e, (v, a) in enumerate(spreads) if v >= track.P[1, 1] ** 0.5 * (1 - 1e-9)]
        entry = max(fits) if fits else 0
    sigma = window_menu.theta_spreads(burst, size, menu.spreads(entry))
    precision = np.zeros(6)
    precision[1:size] = (sigma * turns_per_parameter(size, burst.duration_s))[1:] ** -2.0
    return naive.sequence(samples, variance, b, precision, size, menu.windows[entry])


# Of a burst, in units of its σ: sums of 64 pulses whose noise is a tenth of them, by κ = 286 of three powers of time.
LOCKED_OFF = rounding(10 * 286, 64)

SPEC = []  # the case that `estimated` reckons with
FIXED = {"name": "fixed", "forecast": {"sigma_velocity_mps": 10.0, "sigma_acceleration_mps2": 5.0}}
USES = [
    RANGE,
    SEQUENCE,
    SPECTRUM,
    SEQUENCE | {"name": "gated", "use": "gated", "gate_probability": 0.9},
    SEQUENCE | {"name": "mixture", "use": "mixture", "lock_probability": 0.8},
    SEQUENCE | FIXED,
]


@pytest.mark.parametrize("count", [24, pytest.param(200, marks=pytest.mark.slow)])
def test_chain_equals_the_textbook(count):
    """Every filter over all scans, realisation by realisation, sample by sample."""
    case = make_case(USES, scans=4 if count < 200 else 15)
    plan = study.prepare(case)
    SPEC[:] = [case.spec]
    values = np.zeros(plan.layout.size)
    errors = block.simulate_block(plan.world, plan.filters, Sums(**plan.layout.unpack(values)), 0, count)
    assert len(plan.world.mean) == case.spec.pulses  # a block a sample: sums are the samples
    for f in range(len(USES)):
        expected = textbook_errors(plan, case, f, count)
        scale = np.array([50.0, 1.0, 0.1])
        off = (abs(errors[f] - expected) / scale).max(axis=(0, 2))
        # Where a start lies between two maxima a rounding decides: only of bursts that lock the end is defined.
        lost = (count - Sums(**plan.layout.unpack(values)).locks[f, :, LOCKED]).sum() if USES[f] is not RANGE else 0
        assert np.sum(off > LOCKED_OFF) <= lost, USES[f]["name"]
        assert np.median(off) <= LOCKED_OFF, USES[f]["name"]

"""The discriminator study: its lock and accuracy against exact values, its engines against each other and a twin."""

from functools import cache

import numpy as np
import pytest

from radarsim.api.configs import load
from radarsim.bursts import burst as model
from radarsim.bursts import estimators, fisher
from radarsim.bursts.kernels import scoring, sequence_lanes, signal
from radarsim.bursts.kernels import sequence as kernels
from radarsim.errors import ConfigError
from radarsim.studies.discriminator import scenario, study
from tests.studies.discriminator import naive as naive
from tests.tolerances import mean_error, rounding, sigma_error

BASE = {
    "study": "discriminator",
    "burst": {
        **{"carrier_hz": 10e9, "pulse_period_s": 10e-6, "pulse_length_s": 1e-6, "sampling_period_s": 1e-6},
        **{"pulses": 30000, "amplitude": 1.0, "noise_variance": 2.25},
    },
    "truth": {"phase_rad": 0.7, "doppler_derivatives": [10e3, 180e3, -750e3, 1000e3]},
    "prior": {"spread_over_potential": [100.0, 150.0, 500.0, 1000.0, 2000.0]},
    "realisations": 1000,
}
SEQUENCE = {"name": "sequence"}
CURED = {"name": "cured", "coherence_step": True, "search_points": 2, "tolerance": 0.3}
FROM_TRUTH = {"name": "from truth", "schedule": [0.3], "start": "truth"}
CROSSING = {"phase_rad": 0.7, "doppler_derivatives": [300.0, -2000.0, 0.0, 0.0]}


def plan_of(*estimators, engine="block_sums", burst=(), **other):
    config = BASE | {"estimators": list(estimators), "engine": engine, "burst": BASE["burst"] | dict(burst)} | other
    return study.prepare(load(config).cases[0])


def final(plan, first, count):
    """Errors over potential spreads (count, F, size) at the last window, and locks (count, F)."""
    errors, _ = study.estimate(plan, first, count)
    last = plan.options["windows"] - 1
    f = np.arange(len(last))
    size = plan.layout.shapes["error"][2]
    ratio = (errors[:, f, last] / plan.potential[f, last])[..., :size]
    return ratio, np.abs(ratio).max(axis=2) < 5


@cache
def paper():
    return plan_of(
        *(
            SEQUENCE,
            {**SEQUENCE, "name": "five", "steps": 5, "phases": 16},
            {**SEQUENCE, "name": "dense", "density": 2},
        ),
        *({"name": "narrow", "schedule": [0.3]}, FROM_TRUTH, CURED),
    )


def test_from_truth_the_error_is_the_bound():
    n = 6000
    ratio, lock = final(plan_of(FROM_TRUTH), 0, n)
    assert lock.all()
    assert np.sqrt(np.mean(ratio**2, axis=0)) == pytest.approx(1, abs=sigma_error(n))
    assert np.abs(ratio.mean(axis=0)).max() < mean_error(n)


def test_locks_of_the_papers_experiment():
    """Trials: 0.955 to convergence, 0.879 with five steps; dense and cured always; narrow never."""
    n = 3000
    _, lock = final(paper(), 0, n)
    sequence, five, dense, narrow, truth, cured = lock.mean(axis=0)
    assert sequence == pytest.approx(0.955, abs=0.005 + 4 * np.sqrt(0.043 / n))
    assert five == pytest.approx(0.879, abs=0.005 + 4 * np.sqrt(0.106 / n))
    assert dense >= 0.998
    assert cured >= 0.998
    assert truth == 1
    assert narrow < 0.01
    _, passes = study.estimate(paper(), 0, 1000)
    assert passes[:, 5].mean() <= 60  # the cure is cheap


def whole_run(plan, n, batch=2500):
    """Shares locked (F,), rms errors of the locked over the bound (F, size) and mean passes (F,) of n bursts."""
    locked, squares, passes = 0.0, 0.0, 0.0
    for first in range(0, n, batch):
        ratio, lock = final(plan, first, batch)
        locked = locked + lock.sum(axis=0)
        squares = squares + (ratio**2 * lock[..., None]).sum(axis=0)
        passes = passes + study.estimate(plan, first, 100)[1].mean(axis=0) * batch
    return locked / n, np.sqrt(squares / np.maximum(locked, 1)[:, None]), passes / n


@pytest.mark.slow
def test_locks_and_accuracy_of_the_papers_experiment_over_many_bursts():
    ten = {**SEQUENCE, "name": "ten", "steps": 10, "phases": 16}
    five, dense = {**ten, "name": "five", "steps": 5}, {**SEQUENCE, "name": "dense", "density": 2}
    plan = plan_of(SEQUENCE, five, ten, dense, {"name": "narrow", "schedule": [0.3]}, CURED, FROM_TRUTH)
    n = 50_000
    locks, accuracy, passes = whole_run(plan, n)
    assert locks[:3] == pytest.approx([0.955, 0.879, 0.940], abs=0.005)
    assert locks[3] >= 0.995
    assert locks[4] < 0.01
    assert locks[5] >= 0.9995
    assert accuracy[5] == pytest.approx(1, abs=0.01)
    assert passes[5] <= 60
    assert locks[6] == 1
    assert accuracy[6] == pytest.approx(1, abs=sigma_error(n))


@pytest.mark.slow
def test_lock_of_the_cure_at_the_printed_noise():
    prior = {"sigma": [6.1, 67.5, 6.1e3, 183.38e3, 2.426e6]}
    plan = plan_of({**CURED, "main_lobe_threshold": 0.5}, burst={"noise_variance": 9.0}, prior=prior)
    assert list(plan.windows["pulses"][0, :1]) == [179]
    assert plan.options["windows"][0] == 22
    locks, _, _ = whole_run(plan, 20_000)
    assert locks[0] >= 0.99


def test_sums_are_those_of_the_errors():
    plan = paper()
    _, passes = study.estimate(plan, 100, 64)
    sums = plan.layout.unpack(study.simulate(plan, 100, 64))
    np.testing.assert_array_equal(sums["passes"][:, 0], passes.sum(axis=0))
    ratio, lock = final(plan, 100, 64)
    assert sums["locks"][0, 12, 0] == lock[:, 0].sum()
    assert sums["error_all"][0, 12, :, 1] == pytest.approx((ratio[:, 0] ** 2).sum(axis=0), rel=rounding(operations=64))


def test_phase_is_judged_to_the_nearest_turn():
    errors, _ = study.estimate(paper(), 0, 200)
    assert np.abs(errors[..., 0]).max() <= 0.5


def paired_errors(plan, first, count):
    """As `final`, with block sums about the true phase made from the very samples that the samples engine draws."""
    world, last = plan.world, plan.options["windows"] - 1
    blocks, physics = len(world.factor), world.physics.copy()
    samples, made = np.empty(world.clean.shape), world.mean.copy()
    room, errors = sequence_lanes.allocate_work_arrays(blocks), np.zeros((8, plan.windows.shape[1], 6))
    found = np.empty((count, len(plan.options), 6))
    work, sums, drawn = room[:3]
    for start in range(0, count, 8):
        for lane in range(8):
            signal.draw_samples(physics, plan.keys[0], first + start + lane, world.clean, samples)
            signal.demodulate(physics, world.edges, samples, plan.truth, 0, blocks, made)
            drawn.reshape(-1, 4, 8)[:, :, lane] = made[scoring.Z0 : scoring.Z0 + 4, :blocks].T
        sequence_lanes.draw_forecasts(plan.keys[1], first + start, plan.prior_sigma, work)
        for f, options in enumerate(plan.options):
            sequence_lanes.run_strip(physics, drawn, plan.tables, plan.windows[f], options, work, sums, errors)
            found[start : start + 8, f] = errors[: count - start, last[f]]
    size = plan.layout.shapes["error"][2]
    ratio = (found / plan.potential[np.arange(len(last)), last])[..., :size]
    return ratio, np.abs(ratio).max(axis=2) < 5


def compare(n, truth, first=0):
    """Paired differences of the two engines of one likelihood, for the sequence and the cured one."""
    tight = {**CURED, "tolerance": 1e-3}
    plan = plan_of(SEQUENCE, tight, engine="samples", truth=truth)
    direct, lock = final(plan, first, n)
    blocks, block_lock = paired_errors(plan_of(SEQUENCE, tight, truth=truth), first, n)
    both = lock & block_lock
    for f in range(2):
        one, other = direct[both[:, f], f], blocks[both[:, f], f]
        difference = np.sqrt(np.mean((one - other) ** 2, axis=0))
        ratio = np.sqrt(np.mean(other**2, axis=0) / np.mean(one**2, axis=0))
        yield difference, ratio, lock[:, f], block_lock[:, f]


@pytest.mark.parametrize("n", [60, pytest.param(6000, marks=pytest.mark.slow)])
@pytest.mark.parametrize("truth", [BASE["truth"], CROSSING], ids=["paper", "crossing"])
def test_block_sums_and_samples_are_one_likelihood(truth, n):
    for f, (difference, ratio, lock, block_lock) in enumerate(compare(n, truth)):
        assert difference.max() < 0.03
        assert ratio == pytest.approx(1, abs=0.003 + (3 * difference.max() / np.sqrt(n) if n < 1000 else 0))
        # Without the cure a start between two lobes may end in either.
        assert np.sum(lock != block_lock) <= (max(2, 0.01 * n) if f == 0 or n < 1000 else 0)


def test_without_the_image_the_crossing_is_estimated_worse():
    """Why block sums keep W: left out, the same bursts give other estimates."""
    plan = plan_of(FROM_TRUTH, engine="block_sums", truth=CROSSING, prior={"sigma": [9.0, 2.0, 1e4, 1e5, 1e6]})
    assert plan.world.physics["image"]
    ratio, _ = final(plan, 0, 400)
    plan.world.physics["image"] = 0
    blind, _ = final(plan, 0, 400)
    assert np.sqrt(np.mean((ratio - blind) ** 2)) > 0.03


STRONG = {**SEQUENCE, "tail": "exact", "lock_probability": 0.9999}


@pytest.mark.parametrize("variance", [1e-3, 1e-4, 1e-5, 1e-8])
def test_a_strong_echo_is_estimated_to_its_bound(variance):
    """Where the image was left out, as little of it as the samples hold, σ was 1.4 of the bound at 1e-4, and 5 % of the
    bursts were lost at 1e-5."""
    for engine, n in (("auto", 4000), ("samples", 100)):
        plan = plan_of(STRONG, engine=engine, burst={"noise_variance": variance})
        ratio, lock = final(plan, 0, n)
        lost, expected = (~lock).sum(), n * (plan.options["windows"][0] - 1) * (1 - STRONG["lock_probability"])
        assert lost <= expected + 5 * np.sqrt(expected) + 1
        right = ratio[lock[:, 0], 0]
        assert np.sqrt(np.mean(right**2, axis=0)) == pytest.approx(1, abs=sigma_error(n))
        assert np.abs(right.mean(axis=0)).max() < mean_error(n)


def image_biases(plan, spec, n):
    """Biases of the windows (K,) in standard deviations, as `model.image_bias` foretells them and as n bursts have."""
    burst, phase = scenario.configured_burst(spec), scenario.true_phase(spec, scenario.configured_burst(spec))
    sigma, windows = scenario.forecast(spec, burst), [int(one) for one in plan.windows["pulses"][:, 0]]
    size = len(sigma)
    means = study.estimate(plan, 0, n)[0][:, :, 0, :size].mean(axis=0) / model.turns_per_parameter(size, 0.3)
    known = np.diag(fisher.phase_prior(sigma))
    found = [m @ (data + known) @ m for m, data in zip(means, fisher.fisher_sums(burst, size, windows), strict=True)]
    noise = size / n  # of a mean's square
    return fisher.image_bias(burst, sigma, windows, phase.turns), np.sqrt(np.maximum(np.array(found) - noise, 0.0))


def fixed_windows(variance):
    """A case of lone windows, started from the truth, which do not depend on the noise, and its plan."""
    own = [FROM_TRUTH | {"name": f"{end} s", "schedule": [end]} for end in (0.002, 0.006, 0.03, 0.3)]
    burst = BASE["burst"] | {"noise_variance": variance}
    case = load(BASE | {"estimators": own, "engine": "block_sums", "burst": burst}).cases[0]
    return case.spec, study.prepare(case)


def test_the_bias_without_the_image_is_the_one_foretold(monkeypatch):
    monkeypatch.setattr(estimators, "IMAGE_BIAS", np.inf)
    n = 4000
    for variance in (1e-3, 1e-5):
        spec, plan = fixed_windows(variance)
        assert not plan.world.physics["image"]
        foretold, found = image_biases(plan, spec, n)
        assert foretold.max() > 0.5
        assert found == pytest.approx(foretold, abs=mean_error(n), rel=0.02)


def test_the_image_is_taken_where_its_bias_would_pass_the_limit():
    n = 4000
    spec, plan = fixed_windows(1.0)
    at_one = image_biases(plan, spec, 8)[0].max()
    for share, taken in ((0.9, False), (1.1, True)):
        # The forecast is a multiple of the potential spreads, so that all information is by A²/σ².
        spec, plan = fixed_windows((at_one / (share * estimators.IMAGE_BIAS)) ** 2)
        assert bool(plan.world.physics["image"]) is taken
        foretold, found = image_biases(plan, spec, n)
        assert foretold.max() == pytest.approx(share * estimators.IMAGE_BIAS, rel=0.01)
        assert found == pytest.approx(0 if taken else foretold, abs=mean_error(n))


def test_demodulated_samples_are_nearly_as_good():
    n = 60
    every = [plan_of({**CURED, "tolerance": 1e-3}, engine=engine) for engine in ("samples", "demodulated")]
    (one, lock), (other, also) = (final(plan, 0, n) for plan in every)
    assert lock.all()
    assert also.all()
    assert np.sqrt(np.mean((one - other) ** 2, axis=0)).max() < 0.05


def twin_errors(plan, first, count):
    """SciPy's maximum of (5) at full length from the truth, over the potential spreads, beside the kernel's."""
    size = plan.layout.shapes["error"][2]
    unit = 1 / np.concatenate([model.turns_per_parameter(size, 0.3), np.ones(6 - size)])
    theta, world = (plan.truth * unit)[:size], plan.world
    t = np.arange(30000) * 1e-5
    sigma = (plan.prior_sigma * unit)[:size]
    precision = np.where(np.arange(size) == 0, 0.0, sigma**-2.0)
    samples, state = np.empty(world.clean.shape), np.zeros(1, scoring.STATE)[0]
    bound = (plan.potential[0, 0] * unit)[:size]
    found = np.empty((count, size))
    for i in range(count):
        state["truth"] = plan.truth
        kernels.draw_prior(plan.keys[1], first + i, plan.prior_sigma, state)
        signal.draw_samples(world.physics, plan.keys[0], first + i, world.clean, samples)
        prior = (np.array(state["prior"]) * unit)[:size]
        found[i] = naive.maximum(samples[0], t, 1.0, 2.25, prior, precision, theta, bound) - theta
    return found / bound


@pytest.mark.parametrize("n", [8, pytest.param(1000, marks=pytest.mark.slow)])
def test_the_maximum_is_that_of_least_squares(n):
    plan = plan_of({**FROM_TRUTH, "tolerance": 1e-6, "steps": 100}, engine="samples")
    ours, lock = final(plan, 0, n)
    theirs = twin_errors(plan, 0, n)
    both = lock[:, 0] & (np.abs(theirs).max(axis=1) < 5)
    assert both.mean() > 0.99
    assert np.mean(np.abs(ours[both, 0] - theirs[both]).max(axis=1) < 1e-3) >= 0.999


@pytest.mark.parametrize("derivatives", [0, 1, 2, 3, 4])
@pytest.mark.parametrize("samples", ["real", "complex"])
def test_any_number_of_derivatives_reaches_its_bound(derivatives, samples):
    n = 1500
    truth = {"phase_rad": 0.7, "doppler_derivatives": [10e3, 180e3, -750e3, 1000e3, 5e6][: derivatives + 1]}
    prior = {"spread_over_potential": [100.0, 150.0, 500.0, 1000.0, 2000.0, 4000.0][: derivatives + 2]}
    plan = plan_of(CURED, burst={"samples": samples}, truth=truth, prior=prior)
    ratio, lock = final(plan, 0, n)
    assert lock.mean() > 0.995
    assert np.sqrt(np.mean(ratio[lock[:, 0]] ** 2, axis=0)) == pytest.approx(1, abs=sigma_error(n) + 0.02)


def test_several_samples_a_pulse():
    plan = plan_of(CURED, burst={"sampling_period_s": 0.25e-6, "pulses": 8000, "noise_variance": 9.0})
    assert plan.world.physics["samples_per_pulse"] == 4
    ratio, lock = final(plan, 0, 1500)
    assert lock.mean() > 0.97
    assert np.sqrt(np.mean(ratio[lock[:, 0]] ** 2, axis=0)) == pytest.approx(1, abs=sigma_error(1500) + 0.02)


@pytest.mark.parametrize("samples", ["real", "complex"])
@pytest.mark.parametrize("engine", ["samples", "demodulated"])
def test_the_rival_locks_without_a_prior(samples, engine):
    plan = plan_of({"name": "ridge", "method": "ridge"}, engine=engine, burst={"samples": samples})
    ratio, lock = final(plan, 0, 12)
    assert lock.all()
    assert np.sqrt(np.mean(ratio**2)) < 1.6


def test_amplitude_is_estimated_or_misprinted():
    known = {"name": "known", "schedule": [0.3], "start": "truth"}
    others = ({**known, "name": kind, "amplitude": kind} for kind in ("estimated", "as_printed"))
    ratio, lock = final(plan_of(known, *others, engine="auto"), 0, 12)
    assert lock.all()  # the amplitude hardly moves the maximum of the likelihood
    assert np.abs(ratio[:, 1] - ratio[:, 0]).max() < 0.1


def test_auto_takes_samples_where_block_sums_cannot_serve():
    assert plan_of(SEQUENCE, engine="auto").world.physics["mode"] == signal.BLOCK_SUMS
    estimated = {**SEQUENCE, "amplitude": "estimated"}
    assert plan_of(estimated, engine="auto").world.physics["mode"] == signal.SAMPLES
    with pytest.raises(ConfigError, match="block_sums cannot serve"):
        plan_of(estimated, engine="block_sums")


def test_a_profile_breaks_the_model_and_says_so():
    truth = {"phase_rad": 0.7, "times_s": [0.0, 0.1, 0.2, 0.3], "velocities_mps": [0.0, 350.0, 450.0, 475.0]}
    plan = plan_of(SEQUENCE, engine="auto", truth=truth)
    assert plan.axes.model_error_turns > 1
    assert plan.axes.model_error_hz > 100
    straight = plan_of(SEQUENCE, truth=BASE["truth"])
    assert straight.axes.model_error_turns == 0


def test_a_worse_forecast_than_believed_is_drawn_wider():
    plan = plan_of(SEQUENCE, prior=BASE["prior"] | {"error_scale": 3.0})
    assert plan.prior_sigma == pytest.approx(3 * plan_of(SEQUENCE).prior_sigma, rel=rounding(operations=3))
    assert np.array_equal(plan.windows["pulses"], plan_of(SEQUENCE).windows["pulses"])


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"prior": {"sigma": [1.0, 2.0]}}, "must have 5 values"),
        ({"prior": {}}, "either"),
        ({"truth": {"phase_rad": 0.1}}, "either"),
        ({"truth": {"times_s": [0.0, 0.1], "velocities_mps": [0.0, 1.0]}}, "end of the burst"),
        ({"truth": {"times_s": [0.0, 0.2, 0.1], "velocities_mps": [0.0, 1.0, 2.0]}}, "rise"),
        ({"burst": BASE["burst"] | {"pulse_length_s": 2e-5}}, "pulse period"),
        ({"burst": BASE["burst"] | {"noise_variance": 0.0}}, "noise_variance"),
        ({"burst": BASE["burst"] | {"pulses": 1e6, "sampling_period_s": 1e-7}}, "samples"),
        ({"estimators": [{"name": "a", "schedule": [0.2, 0.1]}]}, "rise"),
        ({"estimators": [{"name": "a", "schedule": [0.4]}]}, "beyond"),
        ({"estimators": [{"name": "a", "schedule": [4e-5, 0.3]}]}, "shorter than 5 pulses"),
        ({"estimators": [{"name": "a", "lock_probability": 1.0}]}, "lock_probability"),
        ({"estimators": [{"name": "a"}, {"name": "a"}]}, "differ"),
    ],
)
def test_faults_of_a_config(change, words):
    with pytest.raises(ConfigError, match=words):
        load(BASE | {"estimators": [SEQUENCE]} | change)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"burst": {"noise_variance": 1e12}}, "over 200 windows"),
        ({"truth": {"doppler_derivatives": [0.0, 0.0, 0.0, 0.0]}}, "do not determine"),
    ],
)
def test_faults_that_only_the_schedule_shows(change, words):
    with pytest.raises(ConfigError, match=words):
        plan_of(SEQUENCE, **change)


@pytest.mark.parametrize(
    ("others", "keys"),
    [
        ((), {"burst": {"pulses": 16}}),
        (({"name": "narrow", "schedule": [0.3]},), {"prior": BASE["prior"] | {"error_scale": 10.0}}),
    ],
)
def test_a_burst_of_sixteen_pulses_and_a_truth_far_outside_the_forecast_are_finite(others, keys):
    assert np.isfinite(study.simulate(plan_of(SEQUENCE, CURED, *others, **keys), 0, 256)).all()

"""Rare losses of lock: weights and directions against exact laws, rates against Gaussian integrals and brute force."""

import math
from dataclasses import replace
from unittest import mock

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import ndtr, ndtri

from radarsim.api.configs import load
from radarsim.bursts.kernels import scoring_lanes, sequence_lanes, signal
from radarsim.errors import ConfigError
from radarsim.kernels.random import fill_normal_strip, stream
from radarsim.report import rare_events, statistics
from radarsim.studies.discriminator import importance_sampling, nearest_loss, study
from radarsim.studies.discriminator.kernels import weights as kernels_weights
from radarsim.studies.discriminator.kernels.sums import LOCKS
from tests.studies.discriminator.test_study import BASE, FROM_TRUTH
from tests.tolerances import assert_rounded, rounding

RARELY = {"name": "a", "tail": "exact", "lock_probability": 0.999}


def case_of(*estimators, sought="a", **other):
    """A case whose losses of lock are sought; `sought` None: one of plain bursts."""
    config = BASE | {"estimators": list(estimators)} | other
    config |= {} if sought is None else {"rare": {"estimator": sought}}
    return load(config).cases[0]


def plan_of(*estimators, **other):
    return study.prepare(case_of(*estimators, **other))


def reseeded(plan, seed):
    """The plan under other noise."""
    return replace(plan, keys=np.stack([stream(seed, str(i)) for i in range(len(plan.keys))]))


def losses(plan, n, batch=512):
    """Weights (n,), and whether estimator 0 lost its lock at its last window (n,)."""
    k, weights, lost = int(plan.options[0]["windows"]) - 1, [], []
    for first in range(0, n, batch):
        errors, _, some, _ = importance_sampling.weighted_estimates(plan, first, min(batch, n - first))
        weights.append(some)
        lost.append((np.abs(errors[:, 0, k]) >= 5 * plan.potential[0, k]).any(axis=1))
    return np.concatenate(weights), np.concatenate(lost)


def brute(plan, n, batch=2048):
    """The share of n plain bursts that lost their lock, and its standard error."""
    k, lost = int(plan.options[0]["windows"]) - 1, 0
    for first in range(0, n, batch):
        errors, _ = study.estimate(plan, first, min(batch, n - first))
        lost += (np.abs(errors[:, 0, k]) >= 5 * plan.potential[0, k]).any(axis=1).sum()
    return lost / n, math.sqrt(max(lost, 1)) / n


def share(weights, lost):
    """The weighted share and its standard error."""
    x = weights * lost
    return x.mean(), x.std() / math.sqrt(len(x))


@pytest.fixture(scope="module")
def plan():
    return plan_of(RARELY)


def test_errors_are_linear_in_the_normals_near_the_truth():
    """The rows of the maps have the posterior bound as their length, and take small noise to the errors that follow."""
    plan = plan_of(RARELY, burst=BASE["burst"] | {"samples": "complex"})
    maps = importance_sampling.window_error_maps(plan, 0)
    lengths = np.sqrt((maps.errors**2).sum(axis=2)) / plan.posterior[0, :, :5]
    assert lengths == pytest.approx(1, abs=5e-4)
    small = 1e-3
    z = small * np.random.default_rng(1).standard_normal((8, maps.forecast.shape[1]))
    z[:, 5] = 0.0  # no sixth component
    errors = nearest_loss.BurstWorkspace(plan).errors(0, z)
    expected = np.einsum("kcd,nd->nkc", maps.errors, z)
    assert np.abs((errors[:, :, :5] - expected) / (small * plan.posterior[0, :, :5]))[:, 3:].max() < 0.05


def test_maps_take_both_moments_of_a_block_from_each_of_its_normals(plan):
    """The imaginary parts of a block's Z₀ and Z₁ are rows of its root: each normal turns the phase by both of them."""
    law = plan.world.factor
    low = np.tril_indices(4)

    def errors(of):
        return importance_sampling.window_error_maps(replace(plan, world=replace(plan.world, factor=of)), 0).errors

    def alone(entry):
        return np.where(np.arange(10) == entry, 1.0, 0.0) * np.ones((len(law), 1))

    nothing = errors(np.zeros_like(law))
    zeroth, first = ((errors(alone(entry)) - nothing)[:, :, 6:] for entry in (2, 9))
    drawn = np.random.default_rng(3).standard_normal(law.shape)
    roots = np.zeros((len(law), 4, 4))
    roots[:, low[0], low[1]] = drawn
    of_both = [part.reshape(*part.shape[:2], len(law), 4).sum(axis=3) for part in (zeroth, first)]
    expected = np.einsum("mkib,mbj->kibj", np.stack(of_both), roots[:, [1, 3]].transpose(1, 0, 2))
    found = (errors(drawn) - nothing)[:, :, 6:].reshape(expected.shape)
    # Roots of the posterior covariance and its inverse, of sums over four normals a block.
    condition = max(np.linalg.cond(window["root"][:5, :5]) for window in plan.windows[0]) ** 2
    assert_rounded(
        found, expected, np.abs(expected).max(axis=(0, 1, 3), keepdims=True) * np.ones_like(expected), condition, 10
    )


def test_directions_are_unit_vectors_of_the_hand_overs(plan):
    units = importance_sampling.directions(plan, 0)
    assert len(units) == plan.options[0]["windows"] + 5
    assert_rounded(np.linalg.norm(units, axis=1), np.ones(len(units)), operations=units.shape[1])
    table = plan.tables[0].reshape(-1, scoring_lanes.COLUMNS)
    for k, window in enumerate(plan.windows[0]):
        within = int(table[window["table"] + window["blocks"] - 1, scoring_lanes.END])
        used = np.abs(units[k, 6:].reshape(-1, 4)).sum(axis=1)
        assert used[:within].max() > 0
        assert not used[within:].any()  # what comes after the window is not in its estimate


def mixture_draws(plan, count):
    """Projections (M, n) of shifted draws on the mixture's directions, and their weights (n,)."""
    law, room = plan.mixture, nearest_loss.BurstWorkspace(plan)
    chosen, weights = np.zeros(count, np.int64), np.empty(count)
    kernels_weights.choose(plan.keys[2], 0, law.cumulative, chosen)
    along = np.empty((len(law.shift), count))
    for start in range(0, count, 8):
        sequence_lanes.draw_forecasts(plan.keys[1], start, plan.prior_sigma, room.work)
        fill_normal_strip(plan.keys[0], start, 0, room.a, room.b)
        kernels_weights.move(law, chosen[start : start + 8], room.work, room.a, room.b)
        kernels_weights.weigh(law, room.work, room.a, room.b, room.along, weights[start : start + 8])
        forecasts = room.work[8 * scoring_lanes.PRIOR : 8 * (scoring_lanes.PRIOR + 6)].reshape(6, 8)
        along[:, start : start + 8] = (
            law.weight @ forecasts + law.first @ room.a.reshape(-1, 8) + law.second @ room.b.reshape(-1, 8)
        )
    return along, weights, chosen


def test_weights_bring_back_the_normal_law(plan):
    """The mean weight is one, and P(uᵀz > t) is Φ(−t) along every direction that is shifted to t."""
    along, weights, chosen = mixture_draws(plan, 20_000)
    assert abs(weights.mean() - 1) < 4 * weights.std() / math.sqrt(len(weights))
    assert weights.max() <= 1 / plan.mixture.cumulative[0]
    looked = 0
    for m, shift in enumerate(plan.mixture.shift):
        if np.count_nonzero(chosen == m + 1) < 500:
            continue
        mean, error = share(weights, along[m] > shift)
        assert abs(mean - ndtr(-shift)) < 4 * error
        assert error < 0.2 * ndtr(-shift)
        looked += 1
    assert looked >= 10


@pytest.mark.slow
def test_the_mean_weight_is_one_on_twenty_seeds(plan):
    z = []
    for seed in range(20):
        _, weights, _ = mixture_draws(reseeded(plan, seed), 20_000)
        z.append((weights.mean() - 1) / (weights.std() / math.sqrt(len(weights))))
    assert np.abs(z).max() < 3.5
    assert abs(np.mean(z)) < 3.5 / math.sqrt(20)


def beyond(correlation, limits):
    """P(|x| > a or |y| > b) of unit normals with a correlation: an integral over x of the tails of y given x."""
    a, b = limits
    spread = math.sqrt(1 - correlation**2)

    def outside(x):
        middle = correlation * x
        tails = ndtr((-b - middle) / spread) + ndtr((middle - b) / spread)
        return tails * math.exp(-0.5 * x * x) / math.sqrt(2 * math.pi)

    return 2 * ndtr(-a) + quad(outside, -a, a, points=[0.0], epsabs=1e-14, limit=200)[0]


def lone_window(noise_variance):
    """The plan of one window scored from the truth, of phase and frequency."""
    burst = BASE["burst"] | {"pulses": 2000, "noise_variance": noise_variance, "samples": "complex"}
    keys = {
        "burst": burst,
        "truth": {"doppler_derivatives": [10e3]},
        "prior": {"spread_over_potential": [100.0, 100.0]},
    }
    with mock.patch.dict(study.BLOCKS_PER_WINDOW, {signal.BLOCK_SUMS: 100}):
        return plan_of({**FROM_TRUTH, "name": "a", "schedule": [0.02]}, **keys)


def test_a_lone_window_loses_as_its_gaussian_integral_says():
    """Phase and frequency from the truth on: errors are Gaussian, and five bounds are passed once in a million."""
    plan = lone_window(0.1)
    maps = importance_sampling.window_error_maps(plan, 0).errors[0]
    spread = np.linalg.norm(maps, axis=1)
    correlation = float(maps[0] @ maps[1] / spread.prod())
    assert correlation == pytest.approx(-math.sqrt(3) / 2, rel=1e-3)
    assert spread == pytest.approx(plan.potential[0, 0, :2], rel=1e-3)
    exactly = beyond(correlation, 5 * plan.potential[0, 0, :2] / spread)
    assert exactly == pytest.approx(beyond(-math.sqrt(3) / 2, (5, 5)), rel=0.03)
    mean, error = share(*losses(plan, 20_000))
    assert error < 0.04 * exactly
    assert abs(mean - exactly) < 4 * error


def test_losses_are_those_of_plain_bursts(plan):
    """Once in a thousand, against fifty thousand plain bursts of other noise."""
    mean, error = share(*losses(plan, 4_000))
    plain, plain_error = brute(reseeded(plan, 11), 50_000)
    assert error < 0.1 * mean
    assert abs(mean - plain) < 4 * math.hypot(error, plain_error)


@pytest.mark.slow
@pytest.mark.parametrize(("probability", "bursts"), [(0.999, 100_000), (0.9999, 300_000)])
def test_losses_are_those_of_plain_bursts_on_twenty_seeds(probability, bursts):
    """At 10⁻³ and 10⁻⁴: every difference within three standard errors, and these no wider than they are."""
    plan = plan_of({**RARELY, "lock_probability": probability})
    z, rates = [], []
    for seed in range(20):
        mean, error = share(*losses(reseeded(plan, seed), 20_000))
        plain, plain_error = brute(reseeded(plan, 100 + seed), bursts)
        z.append((mean - plain) / math.hypot(error, plain_error))
        rates.append(mean)
    assert np.abs(z).max() < 3
    assert abs(np.mean(z)) < 3 / math.sqrt(20)


@pytest.mark.slow
def test_a_millionth_is_known_to_a_tenth():
    """From 2000 bursts; the effective events are those that 3·10⁷ plain ones would have."""
    plan = plan_of({**RARELY, "lock_probability": 0.999999})
    weights, lost = losses(plan, 2000)
    mean, error = share(weights, lost)
    assert 2e-6 < mean < 4e-6
    assert error < 0.1 * mean


@pytest.mark.slow
def test_a_millionth_is_known_to_a_twentieth():
    """Twenty runs of 20 000 bursts scatter as their intervals say, by less than 5 %."""
    plan = plan_of({**RARELY, "lock_probability": 0.999999})
    found = np.array([share(*losses(reseeded(plan, seed), 20_000)) for seed in range(20)])
    assert found[:, 0].mean() < 5e-6
    assert found[:, 0].std() < 0.05 * found[:, 0].mean()
    z = (found[:, 0] - found[:, 0].mean()) / found[:, 1]
    assert 0.3 < np.mean(z**2) < 2.5


def test_sums_are_those_of_the_weights_and_add_up(plan):
    case = case_of(RARELY)
    sums = plan.layout.unpack(study.simulate(plan, 100, 64))
    parts = study.simulate(plan, 100, 37) + study.simulate(plan, 137, 27)
    size = {name: np.abs(array) for name, array in sums.items()}
    for name in ("error", "error_all"):  # Σ|e| and Σ|e|³ by Cauchy and Schwarz
        square, fourth = sums[name][..., 1], sums[name][..., 3]
        size[name] = np.stack([np.sqrt(64 * square), square, np.sqrt(square * fourth), fourth], axis=-1)
    # Σe and Σe³ have terms of either sign, of bursts that lock, within five bounds, and of others.
    assert_rounded(plan.layout.pack(**sums), parts, plan.layout.pack(**size), operations=64)
    errors, passes, weights, plain = importance_sampling.weighted_estimates(plan, 100, 64)
    last = int(plan.options[0]["windows"]) - 1
    lost = (np.abs(errors[:, 0, last]) >= 5 * plan.potential[0, last]).any(axis=1)
    assert sums["losses"][0, last, 0] == pytest.approx(
        [weights @ lost, weights**2 @ lost, lost.sum(), weights**4 @ lost], rel=rounding(operations=64 + 3)
    )
    drawn = [plain.sum(), weights.sum(), weights @ weights]
    assert sums["drawn"] == pytest.approx(drawn, rel=rounding(operations=64))
    assert sums["passes"][0, 0] == passes[plain].sum()
    assert sums["locks"][0, last, 0] == (~lost[plain]).sum()
    alone = study.estimate(study.prepare(replace(case, spec=case.spec.model_copy(update={"rare": None}))), 100, 64)[0]
    assert np.array_equal(errors[plain], alone[plain])  # plain bursts have the noise that they would have


def result_of(n, *estimators, **other):
    import radarsim

    config = BASE | {"estimators": list(estimators), "rare": {"estimator": "a"}} | other
    return radarsim.run(config, realisations=n)


@pytest.mark.slow
def test_tables_tell_the_rate_and_how_well_it_is_known():
    result = result_of(3000, RARELY, {"name": "wide", "first_windows": 1})
    table = result.tables["rare"]
    assert list(table.columns[6:13]) == [
        "n",
        "event_rate",
        "event_rate_lo",
        "event_rate_hi",
        "events",
        "n_eff",
        "variance_factor",
    ]
    row = table.iloc[0]
    sums = result.cases[0].sums
    last = int(row["k"]) - 1
    weight, square, number, _ = sums["losses"][0, last, 0]
    assert row["event_rate"] == weight / 3000
    assert row["events"] == number
    assert row["n_eff"] == pytest.approx(weight**2 / square, rel=rounding(operations=3))
    assert row["event_rate_lo"] < row["event_rate"] < row["event_rate_hi"]
    assert row["variance_factor"] > 5
    assert list(table["sought"]) == [True, False]
    locks = result.tables["locks"]
    at = locks[(locks["filter"] == "a") & (locks["k"] == row["k"])].iloc[0]
    assert at["lock_rate"] == pytest.approx(1 - row["event_rate"], rel=rounding(operations=2))
    assert at["lock_hi"] == pytest.approx(1 - row["event_rate_lo"], rel=rounding(operations=2))
    curves = result.curves
    assert curves["n"].max() <= row["n_plain"]
    first, second, *_ = result.answer
    assert "(importance sampling; " in second
    # Not "locked in 100.00 % of 3000 bursts": most are shifted.
    assert "locked in" not in first
    assert "bursts without importance sampling" in first
    assert not any("rare event" in line for line in result.warnings)


def test_an_interval_that_few_heavy_weights_make_is_marked():
    """Forty equal weights are enough; a hundred of which three make the variance are not, though n_eff is over 20.

    Nor are those of which logarithms spread by 3, where the sample lacks the largest: none that it has is heavy.
    """
    equal, mixed = np.ones(40), np.r_[np.ones(97), np.full(3, 6.0)]
    middle = ndtri((np.arange(1000) + 0.5) / 1000)
    spread, closer = (np.exp(by * (middle[middle < 2] - 2)) for by in (3, 1.5))
    every = (equal, mixed, equal[:10], spread, closer)
    sums = np.array([[w.sum(), (w**2).sum(), len(w), (w**4).sum()] for w in every])
    drawn = rare_events.SamplingWeights(10_000, 1000.0, 10_000.0, 10_300.0)
    of_spread = rare_events.rate_columns({}, "loss", np.full(2, True), rare_events.EventWeights(*sums[3:].T), drawn)
    assert min(of_spread["n_eff"]) > 90
    assert min(sums[3:, 1] ** 2 / sums[3:, 3]) > 20  # this alone would mark neither
    assert list(of_spread["note"]) == [rare_events.HEAVY_WEIGHTS, ""]
    made = rare_events.rate_columns({}, "loss", np.full(3, True), rare_events.EventWeights(*sums[:3].T), drawn)
    assert made["n_eff"] == pytest.approx([40, 115**2 / 205, 10], rel=rounding(operations=3))
    assert list(made["note"]) == ["", rare_events.HEAVY_WEIGHTS, rare_events.FEW_EVENTS_NOTE]
    common = rare_events.EventWeights(*np.array([10_000.0 - 19, 10_300.0 - 19, 9981, 1e4]))
    assert rare_events.weight_notes(drawn, common) == rare_events.FEW_EVENTS_NOTE  # nineteen do not have it
    assert rare_events.weight_notes(drawn, common._replace(weight=common.weight - 1, squared=common.squared - 1)) == ""


@pytest.mark.slow
def test_every_window_is_marked_by_its_own_weights():
    """Shifts lead to the last window: before it a few weights of any size make a rate, and its interval."""
    result = result_of(4000, RARELY)
    locks, sums = result.tables["locks"], result.cases[0].sums["losses"][0]
    at = [LOCKS.index(name) for name in ("lock", "always_three", "always_posterior_three")]
    expected = []
    for window in sums[: len(locks)]:
        weight, square, number, fourth = window[at].T
        with np.errstate(invalid="ignore"):
            few, heavy = ~(weight**2 / square >= 20), ~(square**2 / fourth >= 20)
            heavy |= ~((weight**2 / square) ** 2 / number >= 20)
        said = np.where(few, str(rare_events.FEW_EVENTS_NOTE), np.where(heavy, str(rare_events.HEAVY_WEIGHTS), ""))
        always = next((f"always: {words}" for words in said[1:] if words), "")
        expected.append(said[0] or always)
    assert list(locks["note"]) == expected
    assert locks["note"].iloc[0] == str(rare_events.FEW_EVENTS_NOTE)
    assert len(set(expected)) > 1


def test_weights_whose_mean_is_not_one_are_told():
    made = result_of(300, RARELY).tables["rare"]
    assert not any("instead of one" in line for line in rare_events.mean_weight_warnings(made))
    assert any(
        "instead of one" in line
        for line in rare_events.mean_weight_warnings(made.assign(mean_weight=1.5, mean_weight_se=0.1))
    )


def test_the_interval_of_a_weighted_rate_follows_the_weights():
    """A hundredth of the weight for a hundred times the events: an interval a tenth as wide."""
    total, square, n = 25.0, 0.25, 1e5  # 2500 events of weight 0.01
    found = statistics.weighted_rate(total, square, n, 1e4)
    p = total / n
    spread = np.sqrt((square / n - p**2) / (n - 1))
    assert found.value == p
    assert (found.hi - found.lo) / 2 == pytest.approx(statistics.Z95 * spread, rel=2e-3)


def test_a_weighted_rate_is_wilsons_where_all_weights_are_one():
    plain, weighted = statistics.rate(7.0, 1000.0), statistics.weighted_rate(7.0, 7.0, 1000.0, 1000.0)
    assert np.array(weighted) == pytest.approx(np.array(plain), rel=2e-3)  # n for n − 1
    none = statistics.weighted_rate(0.0, 0.0, 1000.0, 100.0)
    assert np.array(none) == pytest.approx(np.array(statistics.rate(0.0, 100.0)), rel=rounding(operations=20))


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ({"rare": {"estimator": "b"}}, "rare.estimator: must be the name of a sequence: a"),
        ({"rare": {"estimator": "a", "shift": 3}}, "rare.shift: unknown key"),
        ({"rare": {"estimator": "a"}, "engine": "samples"}, "rare: needs engine block_sums, got samples"),
        ({"rare": {}}, "rare.estimator: "),
        ({"rare": 3}, "rare: "),
    ],
)
def test_wrong_values_are_told_by_their_key(keys, words):
    with pytest.raises(ConfigError) as error:
        load(BASE | {"estimators": [RARELY]} | keys)
    assert any(words in line for line in error.value.lines), error.value.lines


def test_a_sequence_that_never_loses_its_lock_is_refused():
    """Far better known beforehand than the burst could tell, nothing is lost within eight standard deviations."""
    with pytest.raises(ConfigError, match=r"rare: a loses no lock within 8 σ"):
        plan_of({**FROM_TRUTH, "name": "a"}, prior={"spread_over_potential": [0.01] * 5})

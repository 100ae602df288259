"""The control variate: the same mean, honest intervals, and the factor that it is said to give."""

import math

import numpy as np
import pytest

from radarsim.app.configs import load
from radarsim.report import controlled, statistics
from radarsim.studies.range_doppler import study as range_doppler
from radarsim.studies.sonar import STUDY as sonar
from tests.trust.test_statistics import GAUSSIAN, gaussian, pair, slack

NEAR_LINEAR = [
    "baseline=kalman",
    "scans=20",
    "detectors=[]",
    "uses.at_s=[95]",
    "sweep.target.acceleration_mps2=[0]",
]


def estimates(rng, repetitions, n):
    """σ of 0.7 of a filter correlated to 0.8 with its control, whose σ is 1."""
    base, own = pair(gaussian, rng, repetitions, n)
    sums = [(e**p).sum(axis=-1) for e in (own, base) for p in (2, 4)]
    return statistics.controlled(*sums, (own**2 * base**2).sum(axis=-1), 1.0, n), own, base


@pytest.mark.parametrize(("n", "repetitions"), [(200, 2000), (1000, 1000)])
def test_mean_coverage_and_factor(n, repetitions):
    """Squares of errors correlated to ρ are correlated to ρ²: the factor is 1/(1 − 0.8⁴) = 1.69."""
    (of, factor), own, _ = estimates(np.random.default_rng(n), repetitions, n)
    plain = np.square(own).mean(axis=-1)
    mean, spread = np.square(of.value).mean(), np.square(of.value).std()
    assert abs(mean - 0.49) < 4 * spread / math.sqrt(repetitions) + 0.49 / n
    assert GAUSSIAN[0] - slack(repetitions) / 4 < np.mean((of.lo <= 0.7) & (of.hi >= 0.7)) < GAUSSIAN[1]
    assert np.median(factor) == pytest.approx(1 / (1 - 0.8**4), rel=0.05)
    assert plain.var() / spread**2 == pytest.approx(1 / (1 - 0.8**4), rel=8 / math.sqrt(repetitions))


def test_a_control_that_is_the_error_itself_leaves_no_doubt():
    base = np.random.default_rng(1).normal(size=500)
    square, fourth = (base**2).sum(), (base**4).sum()
    of, factor = statistics.controlled(square, fourth, square, fourth, fourth, 1.0, 500)
    np.testing.assert_allclose(of, 1, atol=1e-6)
    assert factor > 1e12


def test_a_control_that_knows_nothing_costs_little():
    rng = np.random.default_rng(2)
    own, base = rng.normal(size=(2, 5000))
    sums = [(e**p).sum() for e in (own, base) for p in (2, 4)]
    of, factor = statistics.controlled(*sums, (own**2 * base**2).sum(), 1.0, 5000)
    plain = statistics.root_mean_square(sums[0], sums[1], 5000)
    assert factor == pytest.approx(1, abs=0.01)
    assert (of.hi - of.lo) / (plain.hi - plain.lo) == pytest.approx(1, abs=0.01)


def table(study, case, first, count, made):
    """The table of one block of realisations, as a report has it."""
    from radarsim.engine.results import CaseResult

    plan = made or study.prepare(case)
    sums = plan.layout.unpack(study.simulate(plan, first, count))
    result = CaseResult(case.name, case.study, case.spec, case.swept, count, sums, plan.axes)
    return controlled.controlled([result]), result, plan


def covered(repetitions, n):
    case, plan, inside = load("rls2", ["scans=8"]).cases[0], None, []
    for i in range(repetitions):
        rows, _, plan = table(range_doppler, case, i * n, n, plan)
        inside.append(((rows["sigma_lo"] <= rows["exact_sigma"]) & (rows["exact_sigma"] <= rows["sigma_hi"])).mean())
    return float(np.mean(inside))


def test_of_the_first_study_where_both_are_known_exactly():
    assert covered(300, 400) == pytest.approx(0.95, abs=0.015)


@pytest.mark.slow
def test_of_the_first_study_over_two_thousand_repetitions():
    assert GAUSSIAN[0] <= covered(2000, 400) <= GAUSSIAN[1]


def near_linear(blocks):
    """Plain and controlled σ² of the interacting models' range and bearing over blocks of 4096 realisations."""
    case, plan, plain, with_control, factors = load("sonar_manoeuvre", NEAR_LINEAR).cases[0], None, [], [], []
    for i in range(blocks):
        rows, result, plan = table(sonar, case, i * 4096, 4096, plan)
        last = rows[(rows["filter"] == "imm") & (rows["k"] == 20) & rows["component"].isin(["r", "b"])]
        f, c = result.axes.filters.index("imm"), [0, 3]
        plain.append(result.sums["error"][f, -1, c, 1] / 4096)
        with_control.append(np.square(last["sigma"].to_numpy()))
        factors.append(last["variance_factor"].to_numpy())
    return np.array(plain), np.array(with_control), np.median(factors, axis=0)


def unchanged_mean(plain, with_control):
    apart = plain.mean(axis=0) - with_control.mean(axis=0)
    return np.abs(apart) / np.sqrt(plain.var(axis=0, ddof=1) / len(plain))


def test_of_a_filter_without_exact_value():
    """Interacting models on a straight course are a Kalman filter, nearly: ten times the realisations, and more."""
    plain, with_control, factors = near_linear(8)
    assert np.all(factors > [5, 100])
    assert np.all(unchanged_mean(plain, with_control) < 5)


@pytest.mark.slow
def test_of_a_filter_without_exact_value_over_many_blocks():
    """The factor is what the spread over blocks falls by, and the means agree."""
    plain, with_control, factors = near_linear(400)
    assert np.all(unchanged_mean(plain, with_control) < 4)
    gained = plain.var(axis=0) / with_control.var(axis=0)
    np.testing.assert_allclose(gained, factors, rtol=0.3)


def test_the_table_is_made_where_it_is_asked_for(tmp_path):
    import radarsim

    asked = radarsim.run("rls2", realisations=200, overrides=["control_variate=true", "scans=5"])
    assert set(asked.tables["controlled"]["filter"]) == {"r+Vr"}
    plain = radarsim.run("rls2", realisations=200, overrides=["scans=5"])
    assert "controlled" not in plain.tables
    for name in ("curves", "gains"):
        assert asked.tables[name].equals(plain.tables[name])


def test_antithetic_pairs_double_the_variance():
    """Why they are not offered: a linear filter errs on mirrored noise by the same, mirrored: one square for two."""
    from radarsim.kernels import linear

    problem = range_doppler.prepare(load("rls2", ["scans=8"]).cases[0]).problem
    truth, plots = problem.truth, linear.simulate_plots(problem, 0, 20_000)
    error, mirrored = (linear.estimate(problem, p)[:, :, -1] - truth[-1] for p in (plots, 2 * truth[:, :2] - plots))
    scale = error.std(axis=0)
    assert np.abs((error**2 - mirrored**2) / scale**2).max() < 1e-6
    plain = np.square(error).reshape(200, 100, 2, 3).mean(axis=1).var(axis=0)
    paired = ((error**2 + mirrored**2) / 2).reshape(400, 50, 2, 3).mean(axis=1).var(axis=0)
    np.testing.assert_allclose(paired / plain, 2, rtol=8 / math.sqrt(200))

"""The P1 kernels against a textbook twin, their sums against them, any split of a run against the whole."""

import functools
import threading
import tracemalloc

import numpy as np
import pytest

from radarsim.kernels import second_order
from radarsim.kernels.random import stream
from radarsim.studies.range_doppler import filter_design
from tests.studies.range_doppler import naive as naive
from tests.tolerances import assert_rounded, mean_error, rounding, scaled_condition

KEY = stream(2017, "plots")
RADARS = {
    "RLS 1": (25.0, 5.0, 10.0),
    "RLS 2": (250.0, 15.0, 10.0),
    "RLS 3": (250.0, 15.0, 5.0),
    "RLS 4": (50.0, 1.0, 10.0),
    "RLS 5": (50.0, 1.0, 5.0),
}
FILTERS = ((1, 3, 1e-3), (2, 2, 1e-3), (2, 3, 1e-1), (1, 6, 1e-5))  # observes, initial scans, manoeuvre variance
K = 29


def world(radar, scans=K):
    """Truth (K, 3), sigma (2,) and scan period of a radar of the paper."""
    *sigma, dt = RADARS[radar]
    t = np.arange(scans) * dt
    truth = np.stack([1e5 - 250 * t + 2 * t**2, -250 + 4 * t, np.full(scans, 4.0)], axis=1)
    return truth, np.array(sigma), dt


def rounded(observes, start, sigma, dt):
    """Rounding of estimates (3,): ranges of 100 km, by ten operations a scan and the algebra of the start."""
    information = np.linalg.inv(naive.start(np.zeros((start, 2)), observes, start, sigma, dt)[1])
    return (rounding(operations=10 * K) + rounding(scaled_condition(information), 10)) * 1e5 / dt ** np.arange(3)


def problem_of(radar, designs=FILTERS, scans=K, **changes):
    """Several filters on a radar of the paper, parts of the problem changed."""
    truth, sigma, dt = world(radar, scans)
    made = [filter_design.design(observes, start, variance, sigma, dt, scans) for observes, start, variance in designs]
    longest = max(d.start for d in made)
    weights = np.zeros((len(made), 3, 2, longest))
    for f, d in enumerate(made):
        weights[f, :, :, : d.start] = d.weights
    observes, start = [d.observes for d in made], [d.start for d in made]
    gains = np.stack([d.gains for d in made])
    return second_order.Problem(KEY, truth, sigma, dt, observes, start, weights, gains)._replace(**changes)


def filters_alone(dt, observes, start, weights, gains):
    """A problem of which only the filters are of interest."""
    return second_order.Problem(KEY, np.zeros((gains.shape[1], 3)), np.ones(2), dt, observes, start, weights, gains)


def sums_of(problem, first, count):
    """Sums of a block."""
    made = second_order.Sums(*map(np.zeros, second_order.shapes(*problem.gains.shape[:2]).values()))
    second_order.simulate_block(problem, first, count, made)
    return made


def sums(radar, first, count, **changes):
    """Sums of a block of a radar of the paper."""
    return sums_of(problem_of(radar, **changes), first, count)


@pytest.mark.parametrize("radar", RADARS)
def test_estimates_are_the_textbook_filter(radar):
    _, sigma, dt = world(radar)
    problem = problem_of(radar)
    plots = second_order.simulate_plots(problem, 77, 20)
    got = second_order.estimate(problem, plots)
    for f, (observes, start, variance) in enumerate(FILTERS):
        for i in range(len(plots)):
            expected, _ = naive.kalman(plots[i], observes, start, variance, sigma, dt)
            np.testing.assert_array_equal(np.isnan(got[i, f]), np.isnan(expected))
            assert (np.nan_to_num(np.abs(got[i, f] - expected)) <= rounded(observes, start, sigma, dt)).all()


@pytest.mark.parametrize("radar", RADARS)
@pytest.mark.parametrize(("observes", "start", "variance"), FILTERS)
def test_gains_are_the_papers_closed_forms(radar, observes, start, variance):
    """Eqs. (8) and (12), written out in the twin, against the matrix design."""
    _, sigma, dt = world(radar)
    expected = naive.gains(observes, start, variance, sigma, dt, K)
    units = np.array([1.0, 1.0 / dt, 1.0 / dt**2])[:, None] / np.array([1.0, 1.0 / dt])
    got = filter_design.design(observes, start, variance, sigma, dt, K).gains
    # Gains are up to two in these units. An update leaves of a variance what is not cancelled, P − K H P, and divides
    # by the innovation's covariance S: ten operations on each of them.
    _, P = naive.kalman(np.zeros((K, 2)), observes, start, variance, sigma, dt)
    before, H = naive.transition(dt) @ P[start - 1 : -1] @ naive.transition(dt).T, naive.observation(observes)
    before = before + naive.manoeuvre(variance, dt)
    left = (np.diagonal(P[start:], axis1=1, axis2=2) / np.diagonal(before, axis1=1, axis2=2)).min()
    condition = scaled_condition(H @ before @ H.T + np.diag(sigma[:observes] ** 2)).max() / left
    assert_rounded(got / units, expected / units, np.ones(got.shape), condition, operations=10)


def test_plots_are_truth_and_noise():
    truth, sigma, _ = world("RLS 2", 3)
    n = 200_000
    problem = problem_of("RLS 2", ((1, 3, 1e-3),), 3)
    noise = (second_order.simulate_plots(problem, 0, n) - truth[:, :2]) / sigma
    flat = noise.reshape(n, -1)
    assert np.abs(flat.mean(axis=0)).max() < mean_error(n)
    assert np.abs(np.cov(flat.T) - np.eye(6)).max() < mean_error(n, np.sqrt(2))


def test_sums_are_those_of_the_estimates():
    count, radar = 1300, "RLS 3"  # two chunks and a part
    problem = problem_of(radar)
    estimates = second_order.estimate(problem, second_order.simulate_plots(problem, 5, count))
    e = np.nan_to_num(estimates - problem.truth, nan=0.0)
    _, sigma, dt = world(radar)
    off = np.array([rounded(observes, start, sigma, dt) for observes, start, _ in FILTERS])[:, None]
    for baseline in range(len(FILTERS)):
        error, paired, cross = sums(radar, 5, count, baseline=baseline)

        def assert_summed(found, *factors):
            """Sums of products of errors of some components: each is rounded by `off` before, each sum term by term."""
            errors = functools.reduce(np.multiply, [values for values, _ in factors])
            moved = functools.reduce(np.multiply, [abs(values) + rounded for values, rounded in factors])
            allowed = (moved - abs(errors)).sum(axis=0) + rounding(operations=count) * abs(errors).sum(axis=0)
            assert (np.abs(found - errors.sum(axis=0)) <= allowed).all()

        for power in range(4):
            assert_summed(error[..., power], *[(e, off)] * (power + 1))
        assert_summed(paired, (e, off), (e, off), *[(e[:, [baseline]], off[[baseline]])] * 2)
        assert_summed(
            cross, *((e[..., list(of)], off[..., list(of)]) for of in zip(*second_order.COMPONENT_PAIRS, strict=True))
        )


def test_before_the_start_the_plots_are_the_estimates():
    problem = problem_of("RLS 2")
    plots = second_order.simulate_plots(problem, 0, 4)
    got = second_order.estimate(problem, plots)
    for f, (observes, start, _) in enumerate(FILTERS):
        np.testing.assert_array_equal(got[:, f, : start - 1, :observes], plots[:, : start - 1, :observes])
        assert np.isnan(got[:, f, : start - 1, observes:]).all()
        assert np.isfinite(got[:, f, start - 1 :]).all()
    # The quadratic through three points goes through the last of them.
    _, sigma, dt = world("RLS 2")
    assert (np.abs(got[:, 0, 2, 0] - plots[:, 2, 0]) <= rounded(1, 3, sigma, dt)[0]).all()
    error, paired, _ = sums("RLS 2", 0, 4)
    np.testing.assert_array_equal(error[0, :2, 1:], 0.0)
    np.testing.assert_array_equal(paired[1, :2, 1:], 0.0)  # the baseline has no velocity yet
    assert (paired[1, 2:] > 0).all()


@pytest.mark.parametrize("cuts", [(1,), (511, 512, 513), (100, 612, 1124), (3, 4, 999)])
def test_any_split_gives_the_same(cuts):
    total, problem = 1200, problem_of("RLS 4")
    whole_plots = second_order.simulate_plots(problem, 0, total)
    whole = second_order.estimate(problem, whole_plots)
    whole_sums = sums("RLS 4", 0, total)
    added = [np.zeros_like(s) for s in whole_sums]
    for first, last in zip((0, *cuts), (*cuts, total), strict=True):
        plots = second_order.simulate_plots(problem, first, last - first)
        np.testing.assert_array_equal(plots, whole_plots[first:last])
        np.testing.assert_array_equal(second_order.estimate(problem, plots), whole[first:last])
        for total_sum, part in zip(added, sums("RLS 4", first, last - first), strict=True):
            total_sum += part
    # The same errors in another order: Σ|e|ᵖ is at most n times the largest, which is at most the fourth root of Σe⁴.
    largest = whole_sums.error[..., 3] ** 0.25
    for p in range(4):
        assert_rounded(added[0][..., p], whole_sums.error[..., p], total * largest ** (p + 1), operations=total)
    assert_rounded(added[1], whole_sums.paired, operations=total)
    a, b = (largest[..., list(of)] for of in zip(*second_order.COMPONENT_PAIRS, strict=True))
    assert_rounded(added[2], whole_sums.cross, total * a * b, operations=total)


def test_sums_are_added_to_and_repeatable():
    once = sums("RLS 5", 40, 700)
    again = sums("RLS 5", 40, 700)
    for a, b in zip(once, again, strict=True):
        np.testing.assert_array_equal(a, b)
    results, threads = [None] * 4, []
    for i in range(4):
        threads.append(threading.Thread(target=lambda i=i: results.__setitem__(i, sums("RLS 5", 40, 700))))
        threads[-1].start()
    for thread in threads:
        thread.join()
    for result in results:
        for a, b in zip(once, result, strict=True):
            np.testing.assert_array_equal(a, b)


def test_numbers_and_arrays_say_the_same():
    """A scan period may be given per scan, the plots' spread too; the first interval is not read."""
    _, sigma, dt = world("RLS 2")
    intervals = np.full(K, dt)
    intervals[0] = np.inf
    for a, b in zip(
        sums("RLS 2", 0, 100), sums("RLS 2", 0, 100, dt=intervals, sigma=np.tile(sigma, (K, 1))), strict=True
    ):
        np.testing.assert_array_equal(a, b)


@pytest.mark.parametrize("what", ["key", "truth", "sigma", "dt", "gains"])
def test_every_argument_counts(what):
    truth, sigma, dt = world("RLS 2")
    other = {
        "key": stream(2018, "plots"),
        "truth": truth + np.array([0, 0, 1]),
        "sigma": sigma * [1, 1.001],
        "dt": dt * 1.001,
        "gains": problem_of("RLS 2").gains * 1.001,
    }[what]
    before, after = sums("RLS 2", 0, 64)[0], sums("RLS 2", 0, 64, **{what: other})[0]
    assert np.abs(after[:, -1] / before[:, -1] - 1).max() > 1e3 * rounding(operations=64)  # it is of a thousandth


def test_intervals_of_any_length():
    """Unequal intervals, with gains of their own: the twin step by step."""
    rng = np.random.default_rng(4)
    dt, plots = rng.uniform(0.1, 9.0, 12), rng.normal(size=(3, 12, 2)) * 100
    gains, weights = rng.uniform(0, 0.5, (1, 12, 3, 2)), rng.normal(size=(1, 3, 2, 2))
    got = second_order.estimate(filters_alone(dt, [2], [2], weights, gains), plots)
    for i in range(3):
        x = np.einsum("cjs,sj->c", weights[0], plots[i, :2])
        size = np.einsum("cjs,sj->c", np.abs(weights[0]), np.abs(plots[i, :2]))
        for k in range(2, 12):
            x = naive.transition(dt[k]) @ x
            x = x + gains[0, k] @ (plots[i, k] - x[:2])
            # What is summed, and errors carried on: no gain is negative, so that each step is a sum of these terms.
            size = naive.transition(dt[k]) @ size
            size = size + gains[0, k] @ (np.abs(plots[i, k]) + size[:2])
            assert_rounded(got[i, 0, k], x, size, operations=6 * k)


def test_a_filter_of_the_first_order_has_no_third_gain():
    """Value and rate (P3): the same kernels, the third row zero throughout."""
    rng = np.random.default_rng(5)
    plots, gains = rng.normal(size=(2, 40, 2)), np.zeros((1, 40, 3, 2))
    n = np.arange(1, 41)
    gains[0, :, 0, 0], gains[0, :, 1, 0] = 2 * (2 * n - 1) / (n * (n + 1)), 6 / (n * (n + 1)) / 0.5  # P3 eq. (14)
    weights = np.zeros((1, 3, 2, 2))
    weights[0, 0, 0, 1], weights[0, 1, 0] = 1.0, [-2.0, 2.0]
    got = second_order.estimate(filters_alone(0.5, [1], [2], weights, gains), plots)
    np.testing.assert_array_equal(got[:, 0, 1:, 2], 0.0)
    for i in range(2):
        for k in range(1, 40):
            line = np.polynomial.Polynomial.fit(np.arange(k + 1) * 0.5, plots[i, : k + 1, 0], 1)
            # Of plots of a few units, rates of a few in half a second, by six operations a scan.
            allowed = rounding(np.abs(plots).max(), 6 * (k + 1))
            assert got[i, 0, k, 0] == pytest.approx(line(k * 0.5), rel=0, abs=allowed)
            assert got[i, 0, k, 1] == pytest.approx(line.deriv()(k * 0.5), rel=0, abs=2 * allowed / 0.5)


def test_memory_does_not_grow_with_scans_and_count():
    """A hundred thousand scans: beside its sums a block holds its work array alone."""
    scans = 100_000
    truth, gains = np.zeros((scans, 3)), np.tile([[0.5, 0.0], [0.15, 0.0], [0.01, 0.0]], (1, scans, 1, 1))
    filters = [1], [3], np.zeros((1, 3, 2, 3))
    problem = second_order.Problem(KEY, truth, np.ones(2), 1.0, *filters, gains).plain()
    sums_of(second_order.Problem(KEY, truth[:5], np.ones(2), 1.0, *filters, gains[:, :5]), 0, 1)
    added = second_order.Sums(*map(np.zeros, second_order.shapes(1, scans).values()))
    tracemalloc.start()
    try:
        second_order.simulate_block(problem, 0, 600, added)
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert peak < 4 * second_order.CHUNK * 6 * 8
    assert np.isfinite(added.error).all()
    assert added.error[0, -1, 0, 1] > 0


def test_one_type_is_compiled():
    """Lists, numbers, read-only and strided arrays are brought to one type, so nothing is compiled a second time."""
    sums("RLS 1", 0, 8)
    truth, sigma, dt = world("RLS 1")
    frozen = truth.copy()
    frozen.flags.writeable = False
    sums("RLS 1", 0, 8, truth=frozen, sigma=list(sigma), dt=int(dt), key=tuple(KEY.tolist()))
    sums(
        "RLS 1",
        np.int32(0),
        np.uint8(8),
        truth=np.asfortranarray(truth),
        gains=problem_of("RLS 1").gains.astype(np.float32),
    )
    assert len(second_order.add_block.signatures) == 1

"""The truth, the plots of the target and the false plots of the plane, against their laws."""

import copy
import math

import numpy as np
import pytest
from scipy import stats

from radarsim.physics import targets
from radarsim.studies.registry import study
from tests.studies.plane import naive
from tests.studies.plane.cases import STRAIGHT, TURN, case_of, member, plots_of
from tests.tolerances import Z, mean_error, share_error, sigma_error

N, SCANS, DETECTION = 6000, 9, 0.7
RADAR = {
    "detection_probability": DETECTION,
    "repetition_rate_hz": 6500.0,
    "false_plots_per_km2": 0.04,
    "false_plots_from_s": 22.0,
}
IMPROBABLE = 2 * stats.norm.sf(Z)


@pytest.fixture(scope="module")
def case():
    return case_of(
        [member("extended", sigma_start_velocity_mps=100.0), member("converted", doppler=False)], TURN, SCANS, **RADAR
    )


@pytest.fixture(scope="module")
def drawn(case):
    return plots_of(case, N)


def assert_even(numbers):
    """Evenly between 0 and 1: χ² of 20 bins."""
    assert 0 <= numbers.min() < numbers.max() <= 1
    counts = np.histogram(numbers, 20, (0, 1))[0]
    assert stats.chisquare(counts).pvalue > IMPROBABLE


def assert_uncorrelated(*columns):
    """Columns (n,), each with each."""
    n = len(columns[0])
    correlation = np.corrcoef(columns)[np.triu_indices(len(columns), 1)]
    assert np.abs(correlation).max() < mean_error(n)


def plot_errors(case, drawn):
    """Of range, bearing and velocity (n, K, 3), over their σ."""
    radar = case.spec.radar
    _, z, (r, b, speed, course) = *drawn[:2], np.moveaxis(drawn[2], -1, 0)
    v = naive.folded(z[..., 2] - speed * np.cos(course - b), radar.span_mps)
    e = np.stack([z[..., 0] - r, naive.wrapped(z[..., 1] - b), v], axis=-1)
    return e / [radar.sigma_range_m, radar.sigma_bearing_rad, radar.sigma_velocity_mps]


# ---- truth ----------------------------------------------------------------------------------------------------------
def turn_in_space(t):
    names = ("range_m", "speed_mps", "aspect_rad", "acceleration_g", "start_s", "duration_s")
    return targets.turn_in_space(*(TURN[name] for name in names), t)


def positions(truth, bearing):
    """x and y (…, K) of truth, from the first line of sight to the right of it."""
    return truth[..., 0] * np.cos(truth[..., 1] - bearing), truth[..., 0] * np.sin(truth[..., 1] - bearing)


def test_a_turn_is_that_of_physics(drawn):
    t, _, truth, _ = drawn
    flight = turn_in_space(t)
    assert TURN["start_s"] < t[-1]
    x, y = positions(truth, TURN["bearing_rad"])
    size = TURN["range_m"] * 1e-14
    np.testing.assert_allclose(x, np.broadcast_to(flight[:, 0], x.shape), atol=size)
    np.testing.assert_allclose(y, np.broadcast_to(flight[:, 3], y.shape), atol=size)
    heading = np.arctan2(flight[:, 4], flight[:, 1]) + TURN["bearing_rad"]
    np.testing.assert_allclose(naive.wrapped(truth[..., 3] - heading), 0, atol=1e-13)
    assert (truth[..., 2] == TURN["speed_mps"]).all()


def test_a_fly_by_is_that_of_physics_and_a_course_is_spread_evenly():
    fly_by = {"kind": "fly_by", "distance_m": 8e3, "start_range_m": 20e3, "speed_mps": 300.0, "bearing_rad": 3.0}
    t, _, truth, _ = plots_of(case_of([member("extended")], fly_by, 30), 8)
    wanted = targets.fly_by(8e3, 300.0, 20e3, t)[:, 0]
    np.testing.assert_allclose(truth[..., 0], np.broadcast_to(wanted, truth.shape[:2]), rtol=1e-13)
    assert wanted.min() < 8.1e3 < wanted[-1]
    spread = 0.7
    t, _, truth, _ = plots_of(case_of([member("extended")], STRAIGHT | {"course_spread_rad": spread}, 5), N)
    course = naive.wrapped(truth[:, 0, 3] - STRAIGHT["bearing_rad"] - STRAIGHT["aspect_rad"])
    assert_even((course / spread + 1) / 2)
    x, y = positions(truth, 0.0)
    for place, rate in ((x, np.cos), (y, np.sin)):
        moved = place[:, :1] + STRAIGHT["speed_mps"] * t * rate(truth[:, :1, 3])
        np.testing.assert_allclose(place, moved, atol=1e-9)


# ---- plots of the target --------------------------------------------------------------------------------------------
def test_errors_of_plots_have_their_law(case, drawn):
    e = plot_errors(case, drawn)
    e = e[np.isfinite(e[..., 0])]
    n, rho = len(e), case.spec.radar.range_velocity_correlation
    assert np.abs(e.mean(axis=0)).max() < mean_error(n)
    assert np.abs(np.sqrt((e**2).mean(axis=0)) - 1).max() < sigma_error(n)
    assert abs((e[:, 0] * e[:, 2]).mean() - rho) < mean_error(n, math.sqrt(1 + rho**2))
    assert_uncorrelated(e[:, 1], e[:, 0], e[:, 2] - rho * e[:, 0])
    for number in (e[:, 0], e[:, 1], (e[:, 2] - rho * e[:, 0]) / math.sqrt(1 - rho**2)):
        assert_even(stats.norm.cdf(number))


def test_plots_of_scans_are_independent_and_missed_as_often_as_stated(case, drawn):
    e = plot_errors(case, drawn)
    seen = np.isfinite(e[..., 0])
    assert seen[:, 0].all()
    share = seen[:, 1:].mean(axis=0)
    assert np.abs(share - DETECTION).max() < share_error(DETECTION, N).max()
    assert_uncorrelated(*seen[:, 1:].T.astype(float))
    both = seen[:, 1:].all(axis=1)
    assert_uncorrelated(*e[both].reshape(both.sum(), -1).T[1::3])


# ---- false plots ----------------------------------------------------------------------------------------------------
def test_false_plots_are_as_many_as_poissons_law_says(case, drawn):
    t, _, truth, false = drawn
    along, across = study("plane").halves(case.spec)
    expected = 4e-6 * case.spec.radar.false_plots_per_km2 * truth[0, :, 0] * along * across
    number = np.isfinite(false[..., 0]).sum(axis=-1)
    clear = t < case.spec.radar.false_plots_from_s
    assert not number[:, clear].any()
    assert (expected[~clear] > 0.2).all()
    for count, mean in zip(number.T[~clear], expected[~clear], strict=True):
        assert abs(count.mean() - mean) < mean_error(N, math.sqrt(mean))
        assert abs(count.var(ddof=1) - mean) < mean_error(N, math.sqrt(mean + 2 * mean**2))
        most = int(stats.poisson.isf(20 / N, mean))
        seen = np.bincount(np.minimum(count, most), minlength=most + 1)
        law = stats.poisson(mean)
        shares = np.append(law.pmf(range(most)), law.sf(most - 1))
        assert stats.chisquare(seen, N * shares).pvalue > IMPROBABLE
    assert_uncorrelated(*number[:, ~clear].T.astype(float))


def test_false_plots_are_spread_evenly_over_their_window_and_independent_of_the_target(case, drawn):
    """By area in range and bearing, by velocity over its interval."""
    truth, false = drawn[2:]
    along, across = study("plane").halves(case.spec)
    e = plot_errors(case, drawn)
    r, b = truth[..., 0, None], truth[..., 1, None]
    inside = (false[..., 0] ** 2 - (r - along[:, None]) ** 2) / np.maximum(4 * r * along[:, None], 1e-300)
    turn = naive.wrapped(false[..., 1] - b) / np.maximum(2 * across[:, None], 1e-300) + 0.5
    even = np.stack([inside, turn, false[..., 2] / case.spec.radar.span_mps + 0.5], axis=-1)
    there = np.isfinite(even[..., 0])
    for number in even[there].T:
        assert_even(number)
    assert_uncorrelated(*even[there].T)
    first, second = even[..., 0, :], even[..., 1, :]
    both = there[..., 1]
    assert_uncorrelated(*first[both].T, *second[both].T)
    with_target = there[..., 0] & np.isfinite(e[..., 0])
    number = there[with_target].sum(axis=-1).astype(float)
    for error in e[with_target].T:
        assert_uncorrelated(*first[with_target].T, error)
        assert_uncorrelated(number, error)
    both = there[:, -1, 0] & there[:, -2, 0]
    assert_uncorrelated(*first[both, -1].T, *first[both, -2].T)


def gates(case, keys, t):
    """The scans with the plot and covariance S that a filter expects, by its twin, over plots without errors."""
    tracker, false_from = naive.Filter(case.spec.radar, keys, True), case.spec.radar.false_plots_from_s
    for k, (x, vx, _, y, vy, *_) in enumerate(turn_in_space(t)):
        z = naive.seen(np.array([x, y, vx, vy])) + np.array([0, TURN["bearing_rad"], 0])
        z[2] = naive.folded(z[2], tracker.span)
        if k == 0:
            tracker.start(z)
            continue
        tracker.predict(5.0)
        yield k, *tracker.law(tracker.x[0], tracker.P[0])[:2], tracker
        tracker.update([z], True, 1e-6 * case.spec.radar.false_plots_per_km2 * (t[k] >= false_from))


def test_the_window_of_false_plots_is_twice_as_wide_as_the_widest_gate(case):
    """After as many missed plots as one scan in a hundred has before it."""
    t = case.spec.radar.scan_period_s * np.arange(SCANS)
    halves = np.zeros((2, SCANS))
    for keys in case.spec.filters:
        for k, _, _, tracker in gates(case, keys, t):
            states = copy.deepcopy(tracker)
            for later in range(k, min(k + 4, SCANS)):
                S = states.law(states.x[0], states.P[0])[1]
                halves[:, later] = np.maximum(halves[:, later], 2 * np.sqrt(tracker.gate * np.diag(S)[:2]))
                states.predict(5.0)
    assert (1 - DETECTION) ** 4 < 0.01 < (1 - DETECTION) ** 3
    halves[:, t < case.spec.radar.false_plots_from_s] = 0
    np.testing.assert_allclose(study("plane").halves(case.spec), halves, rtol=1e-9)


def test_a_gate_holds_as_many_false_plots_as_its_volume_says(case, drawn):
    """Doppler leaves fewer of them: 4/3 √(γ³ |S₃|) / D of γ √|S₂|, D the velocity interval."""
    t, _, _, false = drawn
    span, means = case.spec.radar.span_mps, []
    for keys in case.spec.filters:
        means.append(0.0)
        for k, mean, S, tracker in gates(case, keys, t):
            if t[k] < case.spec.radar.false_plots_from_s:
                continue
            plots = false[:, k][np.isfinite(false[:, k, :, 0])]
            e = np.array([tracker.apart(z, mean) for z in plots])
            number = (np.einsum("ni,ij,nj->n", e, np.linalg.inv(S), e) < tracker.gate).sum()
            volume = math.sqrt(tracker.gate**tracker.m * np.linalg.det(S))
            volume *= math.pi if tracker.m == 2 else 4 / 3 * math.pi / span
            expected = 1e-6 * case.spec.radar.false_plots_per_km2 * mean[0] * volume
            assert abs(number / N - expected) < mean_error(N, math.sqrt(expected))
            means[-1] += expected
    assert means[0] < 0.5 * means[1]


@pytest.mark.parametrize(
    ("halves", "ranges", "turn"), [((500.0, 0.7), (500, 1500), 0.7), ((1500.0, 4.0), (0, 2500), math.pi)]
)
def test_false_plots_are_even_in_area_near_the_radar(case, halves, ranges, turn):
    """Where a window is wide beside its range, or surrounds the radar, which those that are drawn here are not."""
    plane, x = study("plane"), (800.0, -600.0, 0.0)
    even, world = np.random.default_rng(2).uniform(size=(3, N)), plane.world(case.spec)
    r, b, v = plane.false_plot(x, halves, even, world)
    assert_even((r**2 - ranges[0] ** 2) / (ranges[1] ** 2 - ranges[0] ** 2))
    assert_even(naive.wrapped(b + math.atan2(3, 4)) / turn / 2 + 0.5)
    assert_even(v / case.spec.radar.span_mps + 0.5)
    assert_uncorrelated(r, b, v)
    area = (ranges[1] ** 2 - ranges[0] ** 2) * turn
    assert plane.expected_false_plots(x, halves, world) == pytest.approx(world.density * area, rel=1e-12)

"""Tracks among false plots against exact laws, at 10⁵ realisations within their 99.99 % bounds; faults must show."""

import numpy as np
import pytest
from scipy import stats

from radarsim.api.configs import load
from radarsim.studies.sonar import STUDY
from radarsim.studies.sonar.clutter.kernels import track_sums
from tests.tolerances import Z, assert_rounded, mean_error

N = 100_000
RATE = 5e-5  # of either tail: 99.99 % bounds


def tracker(name, association="nearest", m=3, n=4, gate=0.99, **more):
    rules = {"gate_probability": gate, "initiation": {"m": m, "n": n}, **more}
    return {"name": name, "kind": "kalman", "association": association, **rules}


def config(filters, density=0.0, detection=1.0, scans=10, **sensor):
    return {
        "study": "sonar",
        "sensor": {
            **{"sigma_range_m": 30.0, "sigma_bearing_deg": 1.0, "scan_period_s": 5.0},
            **{"detection_probability": detection, "false_plots_per_km2": density},
            **{"sector": {"range_m": [7e3, 11e3], "bearing_deg": [5, 40]}},
            **sensor,
        },
        "target": "sonar_straight",
        "filters": filters,
        "scans": scans,
        "realisations": N,
    }


def prepared(*of, **more):
    return STUDY.prepare(load(config(*of, **more)).cases[0])


def simulated(plan, count=N):
    return plan.layout.unpack(sum(STUDY.simulate(plan, b, min(4096, count - b)) for b in range(0, count, 4096)))


def assert_binomial(found, n, p):
    """Counts within the binomial's 99.99 % bounds."""
    found, n, p = np.broadcast_arrays(found, n, p)
    assert (found >= stats.binom.ppf(RATE, n, p)).all(), (found / n, p)
    assert (found <= stats.binom.isf(RATE, n, p)).all(), (found / n, p)


def gates_of(plan):
    counts = simulated(plan)["counts"][:, 2:]
    return tuple(
        counts[..., place]
        for place in (
            track_sums.TARGET_PLOT_COUNT,
            track_sums.PLOTS_IN_GATE_COUNT,
            track_sums.FALSE_IN_GATE_COUNT,
            track_sums.EXPECTED_FALSE_COUNT,
        )
    )


def test_gates_hold_target_and_false_plots_as_they_should():
    """Of filters told their plots: the target's with the gate's probability, false ones with density times area."""
    wanted = np.array([0.9, 0.99, 0.999])
    plan = prepared([tracker(f"{p}", "known", gate=p) for p in wanted], density=1.0, scans=6)
    plots, inside, false, expected = gates_of(plan)
    assert (plots == N).all()
    assert_binomial(inside, N, wanted[:, None])
    assert (false >= stats.poisson.ppf(RATE, expected)).all()
    assert (false <= stats.poisson.isf(RATE, expected)).all()
    # The area of the gate is known beforehand, and its centre's mean range is the target's.
    n, truth = np.arange(2, 6), plan.axes.world.truth[2:, 0, 0]
    ahead = 1 + 2 * (2 * n + 1) / (n * (n - 1))
    area = truth * np.pi * -2 * np.log(1 - wanted[:, None]) * 30.0 * np.radians(1) * ahead
    assert (np.abs(expected / (N * 1e-6 * area) - 1) < mean_error(N, 30.0 * np.sqrt(ahead) / truth)).all()


@pytest.mark.parametrize(("m", "n"), [(2, 2), (3, 4), (3, 5), (4, 6)])
def test_initiation_follows_its_exact_law(m, n):
    """No false plots, open gates, P_D < 1, a missed scan: P(confirmed by scan k) by the Markov chain."""
    plan = prepared(
        [tracker("a", "nearest", m, n, 1.0), tracker("b", "pda", m, n, 1.0)], detection=0.7, missed_scans=[6]
    )
    sums, exact = simulated(plan), plan.axes.exact_confirmed
    assert np.isfinite(exact).all()
    assert_binomial(np.cumsum(sums["counts"][:, :, track_sums.FIRST_CONFIRMED_COUNT], axis=1), N, exact)
    assert (sums["begun"] == 0).all()
    assert (sums["ratios"][:, 1, 0] == 0).all()


@pytest.mark.slow_cases("0.5")
@pytest.mark.parametrize("density", [0.05, 0.5, pytest.param(3.0, marks=pytest.mark.slow)])
def test_pairs_of_false_plots_follow_their_exact_law(density):
    """2 of n among false plots alone, sector's edges and all: by quadrature."""
    filters = [
        tracker("a", "nearest", 2, 2),
        tracker("b", "pda", 2, 4),
        tracker("c", "nearest", 2, 3, 0.9, speed_mps=5),
    ]
    plan = prepared(filters, density=density)
    found, exact = simulated(plan)["begun"][:, :, 2], plan.axes.exact_begun
    assert_binomial(np.cumsum(found, axis=1), N, np.cumsum(exact, axis=1))


@pytest.mark.slow
def test_scores_of_false_tracks_keep_within_their_bound():
    """exp(score) is a martingale of mean one on false tracks: at most exp(-threshold) of them reach it (Ville)."""
    plan = prepared([tracker("a"), tracker("b", "pda")], density=1.0, detection=0.8, scans=20)
    scores, T = simulated(plan)["scores"], plan.axes.thresholds
    reached = scores[1, :, :-1]
    assert (scores[1, :, -1] == N).all()
    assert (reached <= stats.binom.isf(RATE, N, np.exp(-T))).all()
    assert (reached[:, T == 2] > 0.3 * N * np.exp(-2)).all()  # and not far below it
    assert (scores[0, :, :-1][:, T == 4] > 0.6 * scores[0, :, -1:]).all()


@pytest.mark.slow
def test_every_track_of_the_target_is_accounted_for():
    """Confirmations less ends are the tracks kept; first confirmations no more than realisations."""
    plan = prepared([tracker("a"), tracker("b", "pda")], density=3.0, detection=0.8, scans=20)
    sums = simulated(plan, 20_000)
    counts = sums["counts"]
    ends = counts[:, :, [track_sums.LOST_COUNT, track_sums.DROPPED_COUNT]].sum(axis=(1, 2))
    assert (sums["ratios"][:, 0, 0] == ends).all()
    assert (sums["ratios"][:, 0, 2] == counts[:, :, track_sums.CONFIRMED_COUNT].sum(axis=1)).all()
    assert (sums["estimates"][:, :, 0] == counts[:, :, track_sums.CONFIRMED_COUNT]).all()
    assert (counts[:, :, track_sums.CONFIRMED_COUNT] + counts[:, :, track_sums.TENTATIVE_COUNT] <= 20_000).all()
    assert (counts[:, :, track_sums.LOST_COUNT].sum(axis=1) > 100).all()
    assert (counts[:, :, track_sums.FIRST_CONFIRMED_COUNT].sum(axis=1) <= 20_000).all()


@pytest.mark.slow
def test_probabilistic_association_keeps_a_track_longer():
    plan = prepared([tracker("a", manoeuvre_variance=1e-4), tracker("b", "pda", manoeuvre_variance=1e-4)], 2.0, 0.9, 40)
    ratios = simulated(plan, 20_000)["ratios"][:, 0]
    ends = ratios[:, 0] / ratios[:, 2]
    assert ends[1] < 0.7 * ends[0]


def test_a_target_outside_the_sector_is_not_seen():
    plan = prepared([tracker("a", "known")], sector={"range_m": [7e3, 8990.0], "bearing_deg": [5, 40]})
    kept = simulated(plan, 512)["counts"][0, :, track_sums.CONFIRMED_COUNT]
    assert plan.axes.detections.certain.tolist() == [0] + [1] * 9  # 9000 m at first, 4 m/s less
    assert kept.tolist() == [0, 0] + [512] * 8


@pytest.mark.parametrize("first", [-360, 0, 360])
def test_whole_turns_of_the_sector_change_nothing(first):
    sector = {"range_m": [7e3, 11e3], "bearing_deg": [first + 5, first + 40]}
    plan = prepared([tracker("a"), tracker("b", "pda")], density=2.0, sector=sector)
    counts = simulated(plan, 512)["counts"]
    false, expected = (
        counts[..., place].sum(axis=1) for place in (track_sums.FALSE_IN_GATE_COUNT, track_sums.EXPECTED_FALSE_COUNT)
    )
    assert (np.abs(false / expected - 1) < Z / np.sqrt(expected)).all()


@pytest.mark.slow_cases("bearing_deg2")
@pytest.mark.parametrize("bearing_deg", [[5, 40], [-180, 180], [20, 380]])
def test_an_open_gate_holds_the_whole_field(bearing_deg):
    """Every false plot of the sector, across the seam of a full circle too, and no likelihood of them is too small."""
    sector = {"range_m": [7e3, 11e3], "bearing_deg": bearing_deg}
    plan = prepared([tracker("a", gate=1), tracker("b", "pda", gate=1)], density=0.3, detection=0.9, sector=sector)
    found = simulated(plan, 1024)
    assert all(np.isfinite(values).all() for values in found.values())
    counts = found["counts"].sum(axis=1)
    area = np.ptp(np.radians(bearing_deg)) * (11e3**2 - 7e3**2) / 2
    expected, looked = counts[:, track_sums.EXPECTED_FALSE_COUNT], counts[:, track_sums.GATE_COUNT]
    assert_rounded(expected, looked * area * 0.3e-6, operations=looked.max() + 10)  # a sum of as many
    assert (np.abs(counts[:, track_sums.FALSE_IN_GATE_COUNT] / expected - 1) < Z / np.sqrt(expected)).all()


def test_a_target_that_passes_close_by_the_sonar_leaves_numbers():
    """Tracks are foretold at negative ranges there, where there is no density of false plots in range and bearing."""
    given = config([tracker("a"), tracker("b", "pda")], density=10.0, detection=0.9, scans=30)
    given["sensor"]["sector"] = {"range_m": [0, 15e3], "bearing_deg": [0, 360]}
    course = {"x_m": 500, "y_m": 0.01, "speed_mps": 10, "course_deg": 180}
    given["target"] = {"kind": "accelerating", **course, "acceleration_mps2": 0, "start_s": 0}
    found = simulated(STUDY.prepare(load(given).cases[0]), 2048)
    assert all(np.isfinite(values).all() for values in found.values())


def test_noise_of_the_target_is_that_of_plain_filters():
    """Density, sector and trackers are no part of the world: the target's plots are the same."""
    one = load(config([tracker("a")], density=2.0)).cases[0]
    plain = config([{"name": "plain", "kind": "kalman"}])
    plain["sensor"].pop("sector")
    other = load(plain).cases[0]
    assert (STUDY.prepare(one).axes.world.plots == STUDY.prepare(other).world.plots).all()

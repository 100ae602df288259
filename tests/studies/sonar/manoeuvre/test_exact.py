"""Laws of manoeuvres: known values, each law against another way to it, by search or by plain simulation."""

import numpy as np
import pytest
from scipy import stats

from radarsim.studies.sonar import closed_forms, least_squares
from radarsim.studies.sonar.manoeuvre import detection_laws, switched_window, track_uses
from tests.studies.sonar.precision import PARABOLA, TERMS
from tests.tolerances import assert_rounded, mean_error, rounding, sigma_error


def test_the_papers_k_of_one():
    """0.683 is no alarm without a manoeuvre; to detect as often takes 1.456 σ_a, and one σ_a gives 0.523 (P3 eq. 3)."""
    assert 1 - detection_laws.false_alarm(1.0) == pytest.approx(0.683, abs=5e-4)
    assert detection_laws.detection(1.0, 1.0) == pytest.approx(0.523, abs=5e-4)
    assert detection_laws.shift_for(1 - detection_laws.false_alarm(1.0), 1.0) == pytest.approx(1.456, abs=5e-4)
    assert detection_laws.shift_for(0.3, 1.0) == 0.0


@pytest.mark.parametrize("coordinates", [1, 2, 3])
def test_thresholds_undo_false_alarms(coordinates):
    p = np.array([0.5, 0.1, 1e-3, 1e-9])
    k = detection_laws.threshold(p, coordinates)
    # An error of k is multiplied by k/2 in an exponential, of its root as well; ten units to a special function.
    assert_rounded(detection_laws.false_alarm(k, coordinates), p, (1 + k) * p, operations=20)
    assert_rounded(detection_laws.detection(k, 0.0, coordinates), p, (1 + k) * p, operations=20)


def test_detection_is_the_noncentral_law():
    k, shift = np.array([[0.5], [4.0], [20.0]]), np.array([0.3, 1.0, 5.0])
    law = stats.ncx2.sf(k, 1, shift**2)
    assert_rounded(
        detection_laws.detection(k, shift), law, (1 + k) * law, operations=100
    )  # as many terms of the series
    # Two coordinates: condition on the second, x = √6 sin θ or beyond, where the first decides nothing.
    nodes, weights = np.polynomial.legendre.leggauss(60)
    sine, cosine = np.sin(np.pi / 2 * nodes), np.cos(np.pi / 2 * nodes)
    inner = (
        detection_laws.detection(6.0 * cosine**2, 1.2)
        * stats.norm.pdf(np.sqrt(6.0) * sine - 0.7)
        * np.sqrt(6.0)
        * cosine
    )
    mixed = np.pi / 2 * weights @ inner + stats.norm.sf(np.sqrt(6.0) - 0.7) + stats.norm.cdf(-np.sqrt(6.0) - 0.7)
    assert_rounded(detection_laws.detection(6.0, np.hypot(1.2, 0.7), 2), mixed, operations=100)


def test_acceleration_of_a_window_has_the_papers_variance():
    for n in (3, 5, 8):
        t = np.arange(n) * 2.0
        weights, _ = least_squares.generalised_least_squares(t, np.eye(n), 3)
        course = 7 - t + 0.3 * t**2 / 2
        mean, variance = detection_laws.acceleration_law(weights[2:], course, 4.0 * np.eye(n), np.zeros((n, 1)))
        size = np.abs(weights[2:]) @ np.abs(course)
        assert_rounded(mean, [0.3], size, condition=np.sqrt(PARABOLA), operations=n * TERMS)
        sigma = 2.0 * closed_forms.sigma_acceleration(n, 2.0)
        assert_rounded(np.sqrt(variance), [sigma], condition=PARABOLA, operations=n * TERMS)


def test_a_random_push_adds_to_the_variance():
    """Pushes are independent: each adds the square of what it moves."""
    weights, pushes = np.array([[1.0, -2.0, 1.0]]), np.array([[0.0, 0.0], [1.0, 0.0], [4.0, 3.0]])
    _, variance = detection_laws.acceleration_law(weights, np.zeros(3), np.eye(3), pushes)
    assert variance == [6 + 2**2 + 3**2]


def test_first_of_independent_tests():
    assert detection_laws.probability_by_then(np.array([0.5, 0.0, 0.5])).tolist() == [0.5, 0.5, 0.75]


# ---- the degree of a window switched by the detector -----------------------------------------------------------------
DT, SIGMA = 5.0, 10.0


def course(acceleration):
    """Range of the shipped accelerating target: 10 m/s towards the sonar, faster from 100 s to 140 s."""
    t = np.arange(45) * DT
    pushed = np.clip(t - 100, 0, 40)
    return 9000 - 10 * t - acceleration * (pushed**2 / 2 + 40 * np.clip(t - 140, 0, None))


@pytest.mark.parametrize(("memory", "plots", "rate"), [(6, 5, 0.3), (6, 6, 0.01), (5, 4, 0.05)])
def test_by_plain_simulation(memory, plots, rate):
    truth, n = course(0.4), 20_000
    k = stats.chi2.isf(rate, 1)
    of = switched_window.switched_window(truth, SIGMA, DT, memory, plots, k)
    z = truth + SIGMA * np.random.default_rng(8).standard_normal((n, len(truth)))
    t, s = DT * np.arange(1 - memory, 1), DT * np.arange(1 - plots, 1)
    fits = [np.linalg.pinv(t[:, None] ** np.arange(d + 1))[0] for d in (1, 2)]
    bend = 2 * np.linalg.pinv(s[:, None] ** np.arange(3))[2]
    for i in range(memory - 1, len(truth)):
        window = z[:, i + 1 - memory : i + 1]
        line, parabola = (window @ fit - truth[i] for fit in fits)
        alarm = (window[:, memory - plots :] @ bend) ** 2 > k * SIGMA**2 * bend @ bend
        switched = np.where(alarm, parabola, line)
        for sampled, law in zip((line, parabola, switched), of, strict=True):
            square = sampled**2
            assert abs(square.mean() - law[i - memory + 1] ** 2) < mean_error(n, square.std())


def test_what_the_papers_own_six_plots_give():
    found = []
    for acceleration in (0.1, 0.8):  # the weakest and the strongest shipped manoeuvre
        of = switched_window.switched_window(course(acceleration), SIGMA, DT, 6, 6, stats.chi2.isf(0.01, 1))
        rms = [np.sqrt(np.mean(one**2)) for one in of]
        found += [rms[0] / rms[2], rms[1] / rms[2]]
    assert found == pytest.approx([0.975, 1.188, 1.867, 1.101], abs=5e-4)  # three digits


# ---- course, speed, position ahead, closest approach -----------------------------------------------------------------
OWN = np.array([200.0, -100.0, 3.0, 4.0])
POLAR = np.array([[[5000.0, -8.0], [0.4, 0.001]], [[3000.0, 2.0], [-2.0, -0.003]]])
P = np.array([[[100.0, 5.0, 1.0], [1e-4, 1e-6, 4e-8]], [[25.0, -1.0, 0.5], [4e-5, -1e-7, 1e-8]]])


def test_flat_states_move_as_their_rates_say():
    dt = 1e-4
    later = POLAR + np.stack([POLAR[..., 1] * dt, np.zeros((2, 2))], axis=-1)
    now, then = (track_uses.cartesian_track(state, True) for state in (POLAR, later))
    (r, vr), (_, vb) = np.abs(np.moveaxis(POLAR, 0, -1))
    # The difference's own error, dt/2 times the acceleration, and rounding of the range.
    allowed = dt / 2 * (2 * vr * vb + r * vb**2) + rounding(operations=4) * r / dt
    assert (np.abs((then - now)[:, :2] / dt - now[:, 2:]) <= allowed[:, None]).all()
    assert track_uses.cartesian_track(np.array([[1.0, 2.0], [3.0, 4.0]]), False).tolist() == [1.0, 3.0, 2.0, 4.0]


def test_closest_approach_is_the_least_distance():
    track = track_uses.cartesian_track(POLAR, True)
    found = track_uses.uses(track, OWN, 60.0)
    t = np.linspace(-3000, 3000, 600_001)
    for one, row in zip(track, found, strict=True):
        apart = one - OWN
        distance = np.hypot(apart[0] + t * apart[2], apart[1] + t * apart[3])
        # The least of the grid's is half a step of 10 ms away at most, and so much farther; the rest is rounding.
        way, size = np.hypot(*apart[2:]) * 0.005, np.hypot(*apart[:2])
        least = distance.min()
        assert abs(row[5] - t[distance.argmin()]) <= 0.005 * (1 + rounding(operations=10) * (size / way) ** 2)
        assert -rounding(operations=10) * size <= least - row[4] <= way**2 / 2 / least + rounding(operations=10) * size
        assert_rounded(row[:2], [np.arctan2(one[3], one[2]), np.hypot(one[2], one[3])], operations=4)
        assert_rounded(row[2:4], one[:2] + 60 * one[2:], np.abs(one[:2]) + 60 * np.abs(one[2:]), operations=2)


def test_gradients_are_derivatives():
    track = track_uses.cartesian_track(POLAR, True)
    found = track_uses.gradients(track, OWN, 60.0)
    distance, speed = np.hypot(*(track - OWN).T[:2]), np.minimum(np.hypot(*track.T[2:]), np.hypot(*(track - OWN).T[2:]))
    reach = np.abs(track[:, :2]).max(axis=1) + 60 * np.abs(track[:, 2:]).max(axis=1)
    size = np.stack([np.full(2, np.pi), 2 * speed, reach, reach, distance, distance / speed], axis=1)
    for i, step in enumerate((1e-2, 1e-2, 1e-5, 1e-5)):
        shift = step * np.eye(4)[i]
        change = track_uses.uses(track + shift, OWN, 60.0) - track_uses.uses(track - shift, OWN, 60.0)
        # Rounding of what is differenced; the third derivative by the speed, of which all are ratios, to the third.
        allowed = rounding(operations=10) * size / step + (size / speed[:, None] ** 3 * step**2 if i > 1 else 0.0)
        assert (np.abs(found[..., i] - change / (2 * step)) <= allowed).all()


@pytest.mark.parametrize("polar", [True, False])
def test_spread_is_that_of_samples(polar):
    state = POLAR if polar else np.array([[[5e3, -8.0], [2e3, 1.0]], [[-3e3, 5.0], [1e3, 2.0]]])
    spread = P if polar else np.broadcast_to(np.array([[100.0, 1.0, 0.02], [400.0, -2.0, 0.04]]), (2, 2, 3))
    if polar:
        spread = spread * 1e-2  # small errors: the first order is all there is
    n, rng = 200_000, np.random.default_rng(5)
    found = track_uses.variances(state, spread, polar, OWN, 60.0)
    for i in range(2):
        xx, xv, vv = np.moveaxis(spread[i], -1, 0)
        factor = np.linalg.cholesky(np.stack([np.stack([xx, xv], -1), np.stack([xv, vv], -1)], -2))
        drawn = state[i] + np.einsum("cij,ncj->nci", factor, rng.standard_normal((n, 2, 2)))
        true = track_uses.uses(track_uses.cartesian_track(state[i], polar), OWN, 60.0)
        e = track_uses.errors(track_uses.uses(track_uses.cartesian_track(drawn, polar), OWN, 60.0), true)
        assert e.std(axis=0) == pytest.approx(np.sqrt(found[i]), rel=sigma_error(n))


def test_the_first_order_fails_on_a_collision_course():
    """Aimed at the own ship the distance is |normal|: its rms is σ, but it is never below zero, its mean above it."""
    state = np.array([[5000.0, -10.0], [0.0, 0.0]])
    n, rng = 200_000, np.random.default_rng(6)
    drawn = state + np.array([[10.0, 0.1], [1e-3, 1e-5]]) * rng.standard_normal((n, 2, 2))
    spread = np.array([[100.0, 0.0, 0.01], [1e-6, 0.0, 1e-10]])
    cpa = track_uses.uses(track_uses.cartesian_track(drawn, True), np.zeros(4), 60.0)[:, 4]
    sigma = np.sqrt(track_uses.variances(state, spread, True, np.zeros(4), 60.0)[4])
    assert np.sqrt((cpa**2).mean()) == pytest.approx(sigma, rel=sigma_error(n))
    assert cpa.mean() == pytest.approx(sigma * np.sqrt(2 / np.pi), abs=mean_error(n, cpa.std()))


def test_courses_differ_by_half_a_turn_at_most():
    off = track_uses.errors(np.array([[3.1, 0, 0, 0, 0, 0]]), np.array([[-3.1, 0, 0, 0, 0, 0]]))
    assert_rounded(off[0, 0], 6.2 - 2 * np.pi, size=2 * np.pi, operations=4)

"""Course, speed, position ahead, closest approach: against the plainest search, and their spread against samples."""

import numpy as np
import pytest

from radarsim.studies.sonar.manoeuvre import exact

OWN = np.array([200.0, -100.0, 3.0, 4.0])
POLAR = np.array([[[5000.0, -8.0], [0.4, 0.001]], [[3000.0, 2.0], [-2.0, -0.003]]])
P = np.array([[[100.0, 5.0, 1.0], [1e-4, 1e-6, 4e-8]], [[25.0, -1.0, 0.5], [4e-5, -1e-7, 1e-8]]])


def test_flat_states_move_as_their_rates_say():
    dt = 1e-4
    later = POLAR + np.stack([POLAR[..., 1] * dt, np.zeros((2, 2))], axis=-1)
    now, then = (exact.flat(state, True) for state in (POLAR, later))
    assert (then - now)[:, :2] / dt == pytest.approx(now[:, 2:], rel=1e-5)
    assert exact.flat(np.array([[1.0, 2.0], [3.0, 4.0]]), False) == pytest.approx([1.0, 3.0, 2.0, 4.0])


def test_closest_approach_is_the_least_distance():
    track = exact.flat(POLAR, True)
    found = exact.uses(track, OWN, 60.0)
    t = np.linspace(-3000, 3000, 6_000_001)
    for one, row in zip(track, found, strict=True):
        apart = one - OWN
        distance = np.hypot(apart[0] + t * apart[2], apart[1] + t * apart[3])
        assert row[4] == pytest.approx(distance.min(), rel=1e-6)
        assert row[5] == pytest.approx(t[distance.argmin()], abs=2e-3)
        assert row[:2] == pytest.approx([np.arctan2(one[3], one[2]), np.hypot(one[2], one[3])])
        assert row[2:4] == pytest.approx(one[:2] + 60 * one[2:])


def test_gradients_are_derivatives():
    track = exact.flat(POLAR, True)
    found = exact.gradients(track, OWN, 60.0)
    for i, step in enumerate((1e-2, 1e-2, 1e-5, 1e-5)):
        shift = step * np.eye(4)[i]
        change = exact.uses(track + shift, OWN, 60.0) - exact.uses(track - shift, OWN, 60.0)
        assert found[..., i] == pytest.approx(change / (2 * step), rel=1e-6, abs=1e-9)


@pytest.mark.parametrize("polar", [True, False])
def test_spread_is_that_of_samples(polar):
    state = POLAR if polar else np.array([[[5e3, -8.0], [2e3, 1.0]], [[-3e3, 5.0], [1e3, 2.0]]])
    spread = P if polar else np.broadcast_to(np.array([[100.0, 1.0, 0.02], [400.0, -2.0, 0.04]]), (2, 2, 3))
    if polar:
        spread = spread * 1e-2  # small errors: the first order is all there is
    n, rng = 200_000, np.random.default_rng(5)
    found = exact.variances(state, spread, polar, OWN, 60.0)
    for i in range(2):
        xx, xv, vv = np.moveaxis(spread[i], -1, 0)
        factor = np.linalg.cholesky(np.stack([np.stack([xx, xv], -1), np.stack([xv, vv], -1)], -2))
        drawn = state[i] + np.einsum("cij,ncj->nci", factor, rng.standard_normal((n, 2, 2)))
        true = exact.uses(exact.flat(state[i], polar), OWN, 60.0)
        e = exact.errors(exact.uses(exact.flat(drawn, polar), OWN, 60.0), true)
        assert e.std(axis=0) == pytest.approx(np.sqrt(found[i]), rel=0.012)


def test_the_first_order_fails_on_a_collision_course():
    """Aimed at the own ship the distance is |normal|: its rms is σ, but it is never below zero, its mean above it."""
    state = np.array([[5000.0, -10.0], [0.0, 0.0]])
    n, rng = 200_000, np.random.default_rng(6)
    drawn = state + np.array([[10.0, 0.1], [1e-3, 1e-5]]) * rng.standard_normal((n, 2, 2))
    spread = np.array([[100.0, 0.0, 0.01], [1e-6, 0.0, 1e-10]])
    cpa = exact.uses(exact.flat(drawn, True), np.zeros(4), 60.0)[:, 4]
    sigma = np.sqrt(exact.variances(state, spread, True, np.zeros(4), 60.0)[4])
    assert np.sqrt((cpa**2).mean()) == pytest.approx(sigma, rel=0.02)
    assert cpa.mean() == pytest.approx(sigma * np.sqrt(2 / np.pi), rel=0.02)


def test_courses_differ_by_half_a_turn_at_most():
    off = exact.errors(np.array([[3.1, 0, 0, 0, 0, 0]]), np.array([[-3.1, 0, 0, 0, 0, 0]]))
    assert off[0, 0] == pytest.approx(6.2 - 2 * np.pi)

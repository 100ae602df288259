"""Targets: derivatives against numerical differences, geometry against a plane picture."""

import numpy as np
import pytest

from radarsim import constants
from radarsim.physics import targets
from radarsim.physics.motion import manoeuvre_covariance, transition, transitions
from tests.tolerances import assert_rounded, rounding

T = np.linspace(0.0, 60.0, 60001)
TRUTHS = {
    "polynomial": (targets.polynomial([1e5, -250.0, 4.0, 0.01], T), []),
    "acceleration_start": (targets.acceleration_start([1e5, -250.0], 12.0, 20.0, T), [20.0]),
    "jerk_pulse": (targets.jerk_pulse([1e5, -250.0, 4.0], 3.0, 20.0, 10.0, T), [20.0, 30.0]),
    "turn": (targets.turn(1e5, 300.0, 2.5, 3.0, 20.0, 10.0, T), [20.0, 30.0]),
    "fly_by": (targets.fly_by(3e3, 250.0, 9e3, T), []),
    "turn of more than a circle": (targets.turn(4e4, 250.0, 3.0, -5.0, 5.0, 45.0, T), [5.0, 50.0]),
}


@pytest.mark.parametrize("name", TRUTHS)
def test_velocity_and_acceleration_are_the_derivatives(name):
    x, breaks = TRUTHS[name]
    inner = np.ones(len(T), dtype=bool)
    inner[[0, -1]] = False
    for t in breaks:
        inner &= np.abs(T - t) > 3e-3
    h = T[1] - T[0]
    for column in (0, 1):
        difference = (x[2:, column] - x[:-2, column]) / (2 * h)
        # Rounding of the differenced numbers, and the central difference's own error, h²/6 times the third derivative.
        third = np.abs(np.diff(x[:, column + 1], 2)[inner[1:-1]]).max() / h**2
        allowed = 4 * np.spacing(np.abs(x[:, column]).max()) / h + third * h**2 / 3
        np.testing.assert_allclose(difference[inner[1:-1]], x[1:-1, column + 1][inner[1:-1]], rtol=0, atol=allowed)


def test_a_turn_keeps_its_speed_and_its_radius():
    """A full circle from and back to a point gives the range it began with."""
    speed, g = 300.0, 3.0
    period = 2 * np.pi * speed / (g * constants.STANDARD_GRAVITY_MPS2)
    t = np.array([0.0, 10.0, 10.0 + period])
    x = targets.turn(1e5, speed, np.pi, g, 10.0, 2 * period, t)
    # Distances of 100 km, turned by angles of up to 2π that are themselves products of a few numbers.
    allowed = np.array([1e5, speed]) * 2 * np.pi
    assert_rounded(x[1, :2], [97000.0, -300.0], allowed, operations=6)
    assert_rounded(x[2, :2], x[1, :2], allowed, operations=12)


def test_turning_starts_at_the_start():
    """Before the turn a straight line; at aspect pi it is radial and without acceleration."""
    t = np.array([0.0, 5.0, 9.999, 10.0])
    x = targets.turn(1e5, 200.0, np.pi, 2.0, 10.0, 5.0, t)
    # v²/r less its radial part, and the lateral acceleration times the cosine of a right angle.
    lateral = 2.0 * constants.STANDARD_GRAVITY_MPS2
    assert_rounded(x[:3, 2], np.zeros(3), 200.0**2 / x[:3, 0], operations=8)
    # Across the line of sight the lateral acceleration is not radial: only its change of direction is.
    assert_rounded(x[3, 2], 0.0, lateral + 200.0**2 / x[3, 0], operations=8)


def test_transition_is_the_papers_matrix():
    dt = 7.0
    np.testing.assert_array_equal(transition(dt), [[1, dt, dt**2 / 2], [0, 1, dt], [0, 0, 1]])
    np.testing.assert_array_equal(transition(2.0) @ transition(5.0), transition(7.0))  # halves: exact in binary


def test_transitions_over_many_times_are_those_over_each():
    times = np.array([0.0, 0.3, 7.0])
    for size in (1, 3, 4):
        expected = np.stack([transition(dt, size) for dt in times])
        assert_rounded(transitions(times, size), expected, operations=6)


def test_manoeuvre_covariance_is_the_papers_matrix():
    """Eq. (6), written out as printed."""
    dt, D = 5.0, 1e-3
    M = [[dt**6 / 36, dt**5 / 12, dt**4 / 6], [dt**5 / 12, dt**4 / 4, dt**3 / 2], [dt**4 / 6, dt**3 / 2, dt**2]]
    assert_rounded(
        manoeuvre_covariance(D, dt), np.array(M) * D, operations=10
    )  # six factors, a quotient, D on each side


def test_a_fly_by_is_closest_when_it_has_flown_the_leg():
    t = np.array([0.0, 4000.0 / 250.0, 8000.0 / 250.0])
    x = targets.fly_by(3000.0, 250.0, 5000.0, t)
    # The leg flown and its square root: some eight operations on numbers of the size of the leg.
    assert_rounded(x[:, 0], [5000, 3000, 5000], operations=8)
    assert_rounded(x[:, 1], [-200, 0, 200], 250.0 * np.ones(3), operations=8)
    assert_rounded(x[1, 2], 250.0**2 / 3000.0, operations=8)


def numbers_of(kind, dt, steps):
    """Q of D_M = 1 by summing over a fine grid what each form of manoeuvre leads to."""
    if kind == "white_jerk":  # ∫ F(s) e₃ e₃ᵀ F(s)ᵀ ds of density dt
        s = (np.arange(steps) + 0.5) * dt / steps
        g = np.stack([s**2 / 2, s, np.ones(steps)])
        return dt * g @ g.T * dt / steps
    effect = np.zeros(3)  # of one number drawn a scan
    h = dt / steps
    if kind == "white_acceleration":
        effect[2] = dt
    for _ in range(steps):
        jerk = 1.0 if kind == "random_jerk" else 0.0
        effect = effect + h * np.array([effect[1] + h * effect[2] / 2, effect[2] + h * jerk / 2, jerk])
    return np.outer(effect, effect)


@pytest.mark.parametrize("kind", ["random_jerk", "white_jerk", "white_acceleration"])
def test_process_noise_is_what_the_manoeuvre_leads_to(kind):
    from radarsim.physics.motion import process_noise

    dt, steps = 3.0, 20_000
    # A step of the loop leaves out h³/6 of a jerk, 1/steps² of the position, twice that of its square; the midpoint
    # rule errs by half a 1/steps². The sum of so many terms has as many roundings.
    allowed = 2 / steps**2 + rounding(operations=steps)
    np.testing.assert_allclose(process_noise(kind, 2.0, dt), 2.0 * numbers_of(kind, dt, steps), rtol=allowed)
    # The acceleration gains the same in all.
    assert_rounded(process_noise(kind, 2.0, dt)[2, 2], 2.0 * dt**2, operations=3)
    assert np.linalg.matrix_rank(process_noise(kind, 2.0, dt)) == (3 if kind == "white_jerk" else 1)

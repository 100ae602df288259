"""Flights against closed forms, laws of conservation, and what is refused."""

import numpy as np
import pytest

from radarsim import constants
from radarsim.studies.multimodel import flight
from radarsim.studies.multimodel.flight import Phase, fly
from tests.tolerances import assert_rounded

T = np.arange(0, 60.01, 0.5)
VACUUM = 1e30  # ballistic coefficient without drag
# Each step of integration errs by TOLERANCE of a state and 10⁻⁶; there are some ten, and velocities grow into ranges.
STEPS = 10


def integrate_commands(size, over_s=1.0):
    """What steps of integration leave of a number of a size, after errors of rates for a time."""
    return STEPS * (flight.TOLERANCE * size + 1e-6) * over_s


def test_without_air_it_is_a_parabola():
    x = fly((1e5, 2e4, 0), (-800, 300, 50), VACUUM, 1.0, [Phase(0)], T)
    g = constants.STANDARD_GRAVITY_MPS2
    assert np.allclose(x[:, 0], 1e5 - 800 * T, rtol=0, atol=integrate_commands(1e5))
    assert np.allclose(
        x[:, 3], 2e4 + 300 * T - g * T**2 / 2, rtol=0, atol=integrate_commands(2e4) + integrate_commands(300, T[-1])
    )
    assert np.allclose(x[:, 4], 300 - g * T, rtol=0, atol=integrate_commands(300))
    assert_rounded(x[:, 2::3], np.tile([0, -g, 0], (len(T), 1)), np.full((len(T), 3), g), operations=8)


def test_trimmed_flight_is_straight():
    x = fly((0, 1e4, 0), (200, 0, 30), 1e4, 1.0, [Phase(0, trimmed=True)], T)
    assert np.allclose(x[:, 0], 200 * T, rtol=0, atol=integrate_commands(200, T[-1]))
    # Drag and gravity, and what is trimmed, cancel.
    assert_rounded(x[:, 2::3], np.zeros((len(T), 3)), np.full((len(T), 3), 2 * 9.81), operations=8)


@pytest.mark.slow
def test_a_steady_turn_to_the_right_is_a_circle():
    x = fly((0, 1e4, 0), (200, 0, 0), 1e4, 5e-3, [Phase(0, lateral=20, trimmed=True)], T)
    radius = 200**2 / 20
    centre = np.array([0, radius])  # to the right of north is east
    assert np.allclose(np.hypot(x[:, 0] - centre[0], x[:, 6] - centre[1]), radius, rtol=1e-3)
    assert np.allclose(np.linalg.norm(x[:, 1::3], axis=1), 200, rtol=0, atol=integrate_commands(200))


def test_commands_are_followed_with_the_lag():
    x = fly((0, 1e4, 0), (300, 0, 0), 1e4, 2.0, [Phase(0, axial=10, trimmed=True)], T)
    assert np.allclose(x[:, 2], 10 * (1 - np.exp(-T / 2)), rtol=0, atol=integrate_commands(10))


def test_drag_is_density_times_speed_squared_over_twice_the_coefficient():
    x = fly((0, 3e4, 0), (1500, 0, 0), 5e3, 1.0, [Phase(0)], np.array([0.0, 1.0]))
    drag = flight.DENSITY_KGPM3 * np.exp(-3e4 / flight.SCALE_HEIGHT_M) * 1500**2 / 1e4
    assert_rounded(x[0, 2], -drag, operations=12)


@pytest.mark.slow
def test_velocity_and_acceleration_are_derivatives_of_position():
    t = np.arange(0, 50, 0.001)
    x = fly((1e5, 4e4, 0), (-900, -200, 100), 8e3, 1.0, [Phase(0), Phase(20, lateral=50, normal=20, period_s=8)], t)
    for axis in range(3):
        # Differences over 2 ms: the interpolation between steps is to the order of their errors, which change slowly.
        assert np.allclose(
            np.gradient(x[:, 3 * axis], t)[1:-1], x[1:-1, 3 * axis + 1], rtol=0, atol=integrate_commands(1e5)
        )
        inner = np.abs(t - 20) > 0.01  # the acceleration of the commands sets in smoothly, its derivative does not
        assert np.allclose(np.gradient(x[:, 3 * axis + 1], t)[inner][1:-1], x[inner, 3 * axis + 2][1:-1], atol=1e-2)


def test_the_ground_and_the_orbit_are_refused():
    with pytest.raises(flight.ImpossibleFlight, match="hits the ground at"):
        fly((1e5, 1e3, 0), (-300, 0, 0), 1e4, 1.0, [Phase(0)], T)
    with pytest.raises(flight.ImpossibleFlight, match="orbit"):
        fly((1e5, 9e4, 0), (-8500, 0, 0), VACUUM, 1.0, [Phase(0)], T)


def test_smoothing_reproduces_a_smooth_flight():
    rng = np.random.default_rng(2)
    times = np.sort(np.concatenate([[0, 60], rng.uniform(0, 60, 150)]))
    true = fly((1e5, 2e4, 0), (-300, 50, 50), VACUUM, 1.0, [Phase(0)], times)
    t = np.linspace(5, 55, 101)
    x = flight.smoothed_states(times, true[:, 0::3] + rng.normal(size=(len(times), 3)), t)
    exact = fly((1e5, 2e4, 0), (-300, 50, 50), VACUUM, 1.0, [Phase(0)], np.concatenate([[0], t]))[1:]
    assert np.abs(x - exact)[:, 0::3].max() < 2
    assert np.abs(x - exact)[:, 1::3].max() < 1.5

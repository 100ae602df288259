"""Motion in the plane against series in exact arithmetic."""

from fractions import Fraction
from math import factorial

import pytest

from radarsim.kernels.planar_motion import turn


@pytest.mark.parametrize("angle", [1e-9, 9.9e-6, 1.1e-5, 1e-4, 1e-3, 9.99e-3, 1.001e-2, 0.1, -0.3, 1.0])
def test_a_turn_and_its_derivatives_are_exact_at_every_rate(angle):
    """Slow ones, where quotients by the rate would lose up to 10⁻⁶, as fast ones."""
    dt, terms = 5.0, range(14)
    a, T = Fraction(angle / dt) * Fraction(dt), Fraction(dt)
    along = T * sum((-1) ** k * a ** (2 * k) / factorial(2 * k + 1) for k in terms)
    across = T * sum((-1) ** k * a ** (2 * k + 1) / factorial(2 * k + 2) for k in terms)
    along_by_rate = T * T * sum((-1) ** k * 2 * k * a ** (2 * k - 1) / factorial(2 * k + 1) for k in terms[1:])
    across_by_rate = T * T * sum((-1) ** k * (2 * k + 1) * a ** (2 * k) / factorial(2 * k + 2) for k in terms)
    moved, rows = turn((0.0, 0.0, 1.0, 0.0, angle / dt), dt)
    found = moved[0], moved[1], rows[0][4], rows[1][4]
    wanted = (along, across, along_by_rate, across_by_rate)
    assert found == pytest.approx([float(number) for number in wanted], rel=1e-11)

"""Banks, transition powers, stationary probabilities, the track start, the count of operations."""

import numpy as np
import pytest
from scipy.linalg import fractional_matrix_power

from radarsim.kernels import algebra
from radarsim.studies.multimodel import cost, world

PRINTED = np.array([[0.996, 0, 0.002], [0, 0.996, 0.002], [0.004, 0.004, 0.996]])
TWO = np.array([[0.995, 0.01], [0.005, 0.99]])


def test_stationary_probabilities():
    assert np.allclose(world.stationary(PRINTED), [0.25, 0.25, 0.5])
    assert np.allclose(world.stationary(TWO), [2 / 3, 1 / 3])
    assert np.allclose(world.stationary(np.eye(4)), 0.25)
    assert np.allclose(world.stationary(np.array([[0.0, 1], [1, 0]])), 0.5)
    assert np.allclose(world.stationary(np.ones((1, 1))), 1)


@pytest.mark.parametrize("T", [PRINTED, TWO])
def test_whole_powers_are_powers(T):
    for m in (1, 2, 20, 1200):
        assert np.allclose(world.transition_powers(T, np.array([m]))[0], np.linalg.matrix_power(T, m), atol=1e-13)


@pytest.mark.parametrize("T", [PRINTED, TWO])
def test_fractional_powers_are_probabilities_near_the_real_power(T):
    m = np.array([1e-6, 0.1, 0.5, 0.9, 0.999, 1.3, 7.77])
    powers = world.transition_powers(T, m)
    assert np.all(powers >= 0)
    assert np.allclose(powers.sum(axis=1), 1, atol=1e-14)
    for power, exponent in zip(powers, m, strict=True):
        assert np.abs(power - fractional_matrix_power(T, exponent)).max() < 1e-5
    assert np.abs(powers[0] - np.eye(len(T))).max() < 1e-7


def test_the_printed_matrix_has_no_markov_root():
    assert fractional_matrix_power(PRINTED, 0.9).min() < -1e-7
    change = np.abs(world.transition_powers(PRINTED, np.array([0.9]))[0] - fractional_matrix_power(PRINTED, 0.9))
    assert change.max() < 5e-6


def test_rates_are_those_of_a_process():
    """The logarithm of the printed matrix has negative rates."""
    Q = world.generator(PRINTED)
    assert (Q - np.diag(np.diag(Q))).min() == 0
    assert np.abs(Q.sum(axis=0)).max() < 1e-16


def test_start_is_least_squares_with_its_covariance():
    t, spread = np.array([0.0, 0.9, 2.1]), 30.0
    a, b, g = world.start_weights(t, spread).reshape(3, 3)
    A = np.stack([np.ones(3), t - t[2]], axis=1)
    assert np.allclose([a, b], np.linalg.pinv(A))
    w = 4.0  # of a target that accelerates the estimate errs by g w / spread
    z = 7 + 3 * (t - t[2]) + w * (t - t[2]) ** 2 / 2
    assert np.allclose([a @ z - 7, b @ z - 3, 0 - w], g * w / spread)


class ExactZero:
    """A zero that the compiler sees: sums with it and products by it are left out."""

    def _sum(self, other):
        return other

    def _product(self, other):
        return self

    __add__ = __radd__ = __sub__ = __rsub__ = _sum
    __mul__ = __rmul__ = _product


class Counted:
    """A number that counts the operations made with it."""

    count = 0

    def _operate(self, other):
        if isinstance(other, ExactZero):
            return NotImplemented
        Counted.count += 1
        return self

    __add__ = __radd__ = __sub__ = __rsub__ = __mul__ = __rmul__ = __truediv__ = __rtruediv__ = _operate


@pytest.mark.parametrize("accelerates", [True, False])
def test_operations_are_those_of_the_formulas(accelerates):
    x = Counted()
    zero = x if accelerates else ExactZero()
    F, Q = (x, zero, x, zero, zero), (x, x, zero, x, zero, zero)
    Counted.count = 0
    for _ in range(3):
        mean = algebra.predicted((x,) * 3, F)
        own = algebra.predicted_covariance((x,) * 6, F, Q)
        cross = algebra.predicted_cross((x,) * 9, F)
    assert Counted.count == cost.PREDICT[accelerates]
    Counted.count = 6 + 3  # S = H P H' + R; the innovation
    algebra.factored((x,) * 6)
    v = algebra.whitened((x,) * 3, (x,) * 3)
    algebra.dot(algebra.scaled(v, (x,) * 3), v)
    for _ in range(3):
        # Rows of P H': the first columns of the axis's own block and of the blocks with the other two.
        rows = [algebra.whitened((own[i], cross[3 * i], cross[3 * i]), (x,) * 3) for i in range(3)]
        scaled = [algebra.scaled(row, (x,) * 3) for row in rows]
        _ = [at + algebra.dot(row, v) for at, row in zip(mean, scaled, strict=True)]
        algebra.shrunk_own(own, scaled, rows)
        algebra.shrunk_cross(cross, scaled, rows)
    assert Counted.count == cost.UPDATE[accelerates]


def test_operations_of_families():
    for accelerates in (True, False):
        one = cost.operations("kalman", np.ones((1, 1)), [accelerates])[0]
        assert one == cost.PREDICT[accelerates] + cost.UPDATE[accelerates]
    imm, gpb2 = (cost.operations(family, PRINTED, [False, True, True])[0] for family in ("imm", "gpb2"))
    cheap, dear = (cost.PREDICT[accelerates] + cost.UPDATE[accelerates] for accelerates in (False, True))
    assert imm == cheap + 2 * dear + 3 * cost.LIKELIHOOD + 15
    assert gpb2 == 2 * cheap + 5 * dear + 7 * cost.LIKELIHOOD + 15

"""Banks, transition powers, stationary probabilities, the track start, the count of operations."""

import numpy as np
import pytest
from scipy.linalg import fractional_matrix_power

from radarsim.kernels import kalman_algebra
from radarsim.studies.multimodel import cost, model_bank
from tests.tolerances import assert_rounded

PRINTED = np.array([[0.996, 0, 0.002], [0, 0.996, 0.002], [0.004, 0.004, 0.996]])
TWO = np.array([[0.995, 0.01], [0.005, 0.99]])


def test_stationary_probabilities():
    """To rounding of what is left of 1 − T where models last long: a thousandth."""
    for T, expected in (
        (PRINTED, [0.25, 0.25, 0.5]),
        (TWO, [2 / 3, 1 / 3]),
        (np.eye(4), np.full(4, 0.25)),
        (np.array([[0.0, 1], [1, 0]]), np.full(2, 0.5)),
        (np.ones((1, 1)), np.ones(1)),
    ):
        assert_rounded(model_bank.stationary(T), expected, condition=1e3, operations=4)


@pytest.mark.parametrize("T", [PRINTED, TWO])
def test_whole_powers_are_powers(T):
    for m in (1, 2, 20, 1200):
        power = np.linalg.matrix_power(T, m)
        # Probabilities of up to one; each of m steps rounds the sums of T once.
        assert_rounded(model_bank.transition_powers(T, np.array([m]))[0], power, np.ones(T.shape), operations=3 + m)


@pytest.mark.parametrize("T", [PRINTED, TWO])
def test_fractional_powers_are_probabilities_near_the_real_power(T):
    m = np.array([1e-6, 0.1, 0.5, 0.9, 0.999, 1.3, 7.77])
    powers = model_bank.transition_powers(T, m)
    assert np.all(powers >= 0)
    assert_rounded(powers.sum(axis=1), np.ones((len(m), len(T))), operations=25)  # products of a few such matrices
    for power, exponent in zip(powers, m, strict=True):
        assert np.abs(power - fractional_matrix_power(T, exponent)).max() < 1e-5
    assert np.abs(powers[0] - np.eye(len(T))).max() < 1e-7


def test_the_printed_matrix_has_no_markov_root():
    assert fractional_matrix_power(PRINTED, 0.9).min() < -1e-7
    change = np.abs(model_bank.transition_powers(PRINTED, np.array([0.9]))[0] - fractional_matrix_power(PRINTED, 0.9))
    assert change.max() < 5e-6


def test_rates_are_those_of_a_process():
    """The logarithm of the printed matrix has negative rates."""
    Q = model_bank.generator(PRINTED)
    assert (Q - np.diag(np.diag(Q))).min() == 0
    assert_rounded(Q.sum(axis=0), np.zeros(3), np.abs(Q).sum(axis=0), operations=3)


def test_start_is_least_squares_with_its_covariance():
    t, spread = np.array([0.0, 0.9, 2.1]), 30.0
    a, b, g = model_bank.start_weights(t, spread).reshape(3, 3)
    A = np.stack([np.ones(3), t - t[2]], axis=1)
    # κ of the three times is some two; weights are up to 1/s.
    inverse = np.linalg.pinv(A)
    largest = np.full(inverse.shape, np.abs(inverse).max())
    assert_rounded([a, b], inverse, largest, np.linalg.cond(A) ** 2, operations=9)
    w = 4.0  # of a target that accelerates the estimate errs by g w / spread
    z = 7 + 3 * (t - t[2]) + w * (t - t[2]) ** 2 / 2
    size = np.abs([a, b, a]) @ np.abs(z) + 7
    assert_rounded([a @ z - 7, b @ z - 3, 0 - w], g * w / spread, size, np.linalg.cond(A) ** 2, operations=9)


class ExactZero:
    """A zero that the compiler sees: sums with it and products by it are left out."""

    def _sum(self, other):
        return other

    def _product(self, other):
        return self

    __add__ = __radd__ = __sub__ = __rsub__ = _sum
    __mul__ = __rmul__ = _product


class CountingNumber:
    """A number that counts the operations made with it."""

    count = 0

    def _operate(self, other):
        if isinstance(other, ExactZero):
            return NotImplemented
        CountingNumber.count += 1
        return self

    __add__ = __radd__ = __sub__ = __rsub__ = __mul__ = __rmul__ = __truediv__ = __rtruediv__ = _operate


@pytest.mark.parametrize("accelerates", [True, False])
def test_operations_are_those_of_the_formulas(accelerates):
    x = CountingNumber()
    zero = x if accelerates else ExactZero()
    F, Q = (x, zero, x, zero, zero), (x, x, zero, x, zero, zero)
    CountingNumber.count = 0
    for _ in range(3):
        mean = kalman_algebra.predict_state((x,) * 3, F)
        covariance = kalman_algebra.predict_covariance((x,) * 6, F, Q)
        cross = kalman_algebra.predict_cross((x,) * 9, F)
    assert CountingNumber.count == cost.PREDICT[accelerates]
    CountingNumber.count = 6 + 3  # S = H P H' + R; the innovation
    kalman_algebra.factorise((x,) * 6)
    v = kalman_algebra.whiten((x,) * 3, (x,) * 3)
    kalman_algebra.dot(kalman_algebra.scale_row(v, (x,) * 3), v)
    for _ in range(3):
        # Rows of P H': the first columns of the axis's own block and of the blocks with the other two.
        rows = [kalman_algebra.whiten((covariance[i], cross[3 * i], cross[3 * i]), (x,) * 3) for i in range(3)]
        scaled = [kalman_algebra.scale_row(row, (x,) * 3) for row in rows]
        _ = [mean_element + kalman_algebra.dot(row, v) for mean_element, row in zip(mean, scaled, strict=True)]
        kalman_algebra.shrink_block(covariance, scaled, rows)
        kalman_algebra.shrink_cross(cross, scaled, rows)
    assert CountingNumber.count == cost.UPDATE[accelerates]


def test_operations_of_families():
    for accelerates in (True, False):
        count = cost.operations("kalman", np.ones((1, 1)), [accelerates])[0]
        assert count == cost.PREDICT[accelerates] + cost.UPDATE[accelerates]
    imm, gpb2 = (cost.operations(family, PRINTED, [False, True, True])[0] for family in ("imm", "gpb2"))
    cheap, dear = (cost.PREDICT[accelerates] + cost.UPDATE[accelerates] for accelerates in (False, True))
    assert imm == cheap + 2 * dear + 3 * cost.LIKELIHOOD + 15
    assert gpb2 == 2 * cheap + 5 * dear + 7 * cost.LIKELIHOOD + 15

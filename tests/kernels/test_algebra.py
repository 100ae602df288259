"""The algebra on tuples against matrices: as Python calls it, on plain numbers in a kernel, and on lanes."""

import numpy as np
import pytest

from radarsim.kernels import kalman_algebra, lane_matrices
from radarsim.kernels.compiler import kernel
from radarsim.kernels.lane_matrices import get3, get6, put3, put6
from radarsim.kernels.lanes import WIDTH, address, full
from radarsim.physics.motion import transition
from tests.tolerances import absolute_product, assert_rounded

COUNT = 8
R = 0.7
RNG = np.random.default_rng(5)
FACTORS = RNG.normal(size=(COUNT, 3, 3))
MATRICES = FACTORS @ FACTORS.swapaxes(1, 2) + 0.1 * np.eye(3)
CONDITION = np.linalg.cond(MATRICES)[:, None, None]  # some hundreds
LARGEST = np.abs(MATRICES).max(axis=(1, 2), keepdims=True)
STATES = RNG.normal(size=(3, COUNT))
NOISE = kalman_algebra.pack(np.diag([0.3, 0.2, 0.1]))
UPPER = np.array([[1.0, 0.4, 0.3], [0.0, 0.9, 0.7], [0.0, 0.0, 0.8]])


def pack(matrices=MATRICES):
    return kalman_algebra.pack(matrices)


def same(found, wanted, size, condition=1.0):
    """Packed matrices against whole ones, to twelve roundings of what is summed: two products of matrices, and sums."""
    assert_rounded(kalman_algebra.unpack(found), wanted, size, condition, operations=12)


def updated(P, component, gain, variance):
    """Joseph's form."""
    left = np.eye(3)
    left[:, component] -= gain
    return left @ P @ left.T + variance * np.outer(gain, gain)


def joseph_size(gains):
    """What Joseph's form sums at most, for gains (n, 3): (1 + |g|)² of the largest element, and R g gᵀ."""
    largest = np.abs(gains).max(axis=1)[:, None, None]
    return (1 + largest) ** 2 * LARGEST + R * largest**2


def test_packing_is_undone():
    assert (kalman_algebra.unpack(pack()) == MATRICES).all()


@pytest.mark.parametrize("F", [UPPER, transition(0.6)], ids=["upper", "constant acceleration"])
def test_prediction(F):
    f = kalman_algebra.pack_transition(F)
    wanted, Q = F @ MATRICES @ F.T + np.diag([0.3, 0.2, 0.1]), np.diag([0.3, 0.2, 0.1])
    same(kalman_algebra.predict_covariance(pack(), f, NOISE), wanted, absolute_product(F, MATRICES, F.T) + Q)
    assert_rounded(kalman_algebra.predict_state(STATES, f), F @ STATES, absolute_product(F, STATES), operations=3)
    cross = tuple(FACTORS.reshape(COUNT, 9).T)
    wanted = (F @ FACTORS @ F.T).reshape(COUNT, 9).T
    size = absolute_product(F, FACTORS, F.T).reshape(COUNT, 9).T
    assert_rounded(kalman_algebra.predict_cross(cross, f), wanted, size, operations=12)


def test_information_is_predicted_as_its_inverse():
    F = transition(0.6)
    assert kalman_algebra.constant_acceleration(0.6) == kalman_algebra.pack_transition(F)
    back = np.linalg.inv(F)
    same(
        kalman_algebra.predict_information(pack(), 0.6),
        back.T @ MATRICES @ back,
        absolute_product(back.T, MATRICES, back),
    )


@pytest.mark.parametrize("component", range(3))
def test_update(component):
    P, gain, S = kalman_algebra.TAKE[component](pack(), R, 1.0)
    assert_rounded(S, MATRICES[:, component, component] + R)
    assert_rounded(gain, MATRICES[:, component].T / S, operations=2)
    # Gains g are below κ(P); terms of Joseph's form are P, g P, g P gᵀ and R g gᵀ.
    joseph = joseph_size(np.transpose(gain))
    same(P, [updated(one, component, g, R) for one, g in zip(MATRICES, np.transpose(gain), strict=True)], joseph)
    other, nothing, _ = kalman_algebra.TAKE[component](pack(), R, 0.0)
    assert np.array_equal(other, pack())
    assert not np.any(nothing)


@pytest.mark.parametrize("component", range(3))
def test_an_update_with_any_gain(component):
    made = kalman_algebra.CORRECT[component](pack(), R, STATES)
    wanted = [updated(one, component, g, R) for one, g in zip(MATRICES, STATES.T, strict=True)]
    same(made, wanted, joseph_size(STATES.T))
    P, gain, _ = kalman_algebra.TAKE[component](pack(), R, 1.0)
    same(kalman_algebra.CORRECT[component](pack(), R, gain), kalman_algebra.unpack(P), joseph_size(np.transpose(gain)))


def test_sums():
    outer = np.einsum("in,jn->nij", STATES, STATES)
    size = np.abs(MATRICES) + 0.4 * np.abs(outer)
    same(kalman_algebra.add_outer(pack(), 0.4, STATES), MATRICES + 0.4 * outer, size)
    spread = MATRICES + 0.4 * (np.eye(3) + outer)
    same(kalman_algebra.add_spread(pack(), 0.4, kalman_algebra.pack(np.eye(3)), STATES), spread, size + 0.4 * np.eye(3))
    product, size = (np.einsum("nij,jn->in", *both) for both in ((MATRICES, STATES), (abs(MATRICES), abs(STATES))))
    assert_rounded(kalman_algebra.times(pack(), STATES), product, size, operations=3)
    assert np.array_equal(kalman_algebra.add_scaled(STATES, 2.0, STATES), 3 * STATES)


def test_inverse_and_factors():
    """To the condition number; in any units to the same digits."""
    inverse = np.linalg.inv(MATRICES)
    same(kalman_algebra.inverse(pack()), inverse, np.abs(inverse).max(axis=(1, 2), keepdims=True), CONDITION)
    unit = np.array([4.0, 1 / 64, 2.0**20])
    scaled = kalman_algebra.inverse(pack(MATRICES * np.outer(unit, unit)))
    assert np.array_equal(scaled, pack(kalman_algebra.unpack(kalman_algebra.inverse(pack())) / np.outer(unit, unit)))
    lower, by, determinant = kalman_algebra.factorise(pack())
    assert_rounded(determinant, np.linalg.det(MATRICES), condition=CONDITION.ravel(), operations=12)
    y = kalman_algebra.whiten(STATES, lower)
    solved = np.linalg.solve(MATRICES, STATES.T[:, :, None])[:, :, 0]
    normalised = (solved * STATES.T).sum(axis=1)
    assert_rounded(
        kalman_algebra.dot(kalman_algebra.scale_row(y, by), y), normalised, condition=CONDITION.ravel(), operations=12
    )


@kernel
def run(x, p, component, dt, out_x, out_p):
    """A prediction and an update by a number, of one realisation a column, eight by eight."""
    at_x, at_p, to_x, to_p = address(x), address(p), address(out_x), address(out_p)
    F = kalman_algebra.constant_acceleration(dt)
    for i in range(x.shape[1] // WIDTH):
        P = kalman_algebra.predict_covariance(get6(at_p, i, 2), F, kalman_algebra.NO_NOISE)
        if component == 0:
            P, g, S = kalman_algebra.take_value(P, R, full(1.0))
        elif component == 1:
            P, g, S = kalman_algebra.take_rate(P, R, full(1.0))
        else:
            P, g, S = kalman_algebra.take_second_rate(P, R, full(1.0))
        put3(to_x, i, kalman_algebra.add_scaled(kalman_algebra.predict_state(get3(at_x, i, 2), F), S, g), 2)
        put6(to_p, i, P, 2)


@kernel
def run_plain(x, p, dt):
    """The same of a rate, on plain numbers."""
    F = kalman_algebra.constant_acceleration(dt)
    P = (p[0], p[1], p[2], p[3], p[4], p[5])
    P, g, S = kalman_algebra.take_rate(kalman_algebra.predict_covariance(P, F, kalman_algebra.NO_NOISE), R, 1.0)
    return kalman_algebra.add_scaled(kalman_algebra.predict_state((x[0], x[1], x[2]), F), S, g), P


@pytest.mark.parametrize("component", range(3))
def test_kernels_calculate_the_same(component):
    """But for fused multiply-adds."""
    many = np.concatenate([MATRICES, MATRICES[::-1] + np.eye(3)])
    x, p = np.tile(STATES, 2), np.array(pack(many))
    out_x, out_p = np.zeros_like(x), np.zeros_like(p)
    run(x, p, component, 0.6, out_x, out_p)
    F = kalman_algebra.constant_acceleration(0.6)
    P, g, S = kalman_algebra.TAKE[component](kalman_algebra.predict_covariance(p, F, kalman_algebra.NO_NOISE), R, 1.0)
    state = kalman_algebra.add_scaled(kalman_algebra.predict_state(x, F), S, g)
    # Sums of a prediction over 0.6 s, below (1 + 0.6 + 0.18)² of the largest, and an update, which P + g gᵀ S bounds;
    # of each twelve terms at most. What is added to the state is S g, no larger.
    largest = 2 * 1.78**2 * np.abs(p).max()
    assert_rounded(out_p, P, largest * np.ones(p.shape), operations=12)
    assert_rounded(out_x, state, (1.78 * np.abs(x).max() + largest) * np.ones(x.shape), operations=12)
    if component == 1:
        for n in range(x.shape[1]):
            one, covariance = run_plain(x[:, n].copy(), p[:, n].copy(), 0.6)
            assert_rounded(covariance, np.array(P)[:, n], largest * np.ones(6), operations=12)
            assert_rounded(one, np.array(state)[:, n], (1.78 * np.abs(x).max() + largest) * np.ones(3), operations=12)


@kernel
def choose(x, y, out):
    a, b = address(x), address(y)
    put6(address(out), 0, lane_matrices.choose6(get3(a, 0)[0], get3(b, 0)[0], get6(a, 0), get6(b, 0)))


def test_rows_are_chosen_lane_by_lane():
    x, y, out = RNG.normal(size=(3, 6 * WIDTH))
    choose(x, y, out)
    one, other = x.reshape(6, WIDTH), y.reshape(6, WIDTH)
    assert np.array_equal(out.reshape(6, WIDTH), np.where(one[0] > other[0], one, other))

"""The algebra on tuples against matrices: as Python calls it, on plain numbers in a kernel, and on lanes."""

import numpy as np
import pytest

from radarsim.kernels import algebra, lanes
from radarsim.kernels.compile import kernel
from radarsim.kernels.lanes import WIDTH, address, full, get3, get6, put3, put6
from radarsim.physics import transition
from tests.tolerances import absolute_product, assert_rounded

COUNT = 8
R = 0.7
RNG = np.random.default_rng(5)
FACTORS = RNG.normal(size=(COUNT, 3, 3))
MATRICES = FACTORS @ FACTORS.swapaxes(1, 2) + 0.1 * np.eye(3)
CONDITION = np.linalg.cond(MATRICES)[:, None, None]  # some hundreds
LARGEST = np.abs(MATRICES).max(axis=(1, 2), keepdims=True)
STATES = RNG.normal(size=(3, COUNT))
NOISE = algebra.pack(np.diag([0.3, 0.2, 0.1]))
UPPER = np.array([[1.0, 0.4, 0.3], [0.0, 0.9, 0.7], [0.0, 0.0, 0.8]])


def pack(matrices=MATRICES):
    return algebra.pack(matrices)


def same(found, wanted, size, condition=1.0):
    """Packed matrices against whole ones, to twelve roundings of what is summed: two products of matrices, and sums."""
    assert_rounded(algebra.unpack(found), wanted, size, condition, operations=12)


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
    assert (algebra.unpack(pack()) == MATRICES).all()


@pytest.mark.parametrize("F", [UPPER, transition(0.6)], ids=["upper", "constant acceleration"])
def test_prediction(F):
    f = algebra.pack_transition(F)
    wanted, Q = F @ MATRICES @ F.T + np.diag([0.3, 0.2, 0.1]), np.diag([0.3, 0.2, 0.1])
    same(algebra.predicted_covariance(pack(), f, NOISE), wanted, absolute_product(F, MATRICES, F.T) + Q)
    assert_rounded(algebra.predicted(STATES, f), F @ STATES, absolute_product(F, STATES), operations=3)
    cross = tuple(FACTORS.reshape(COUNT, 9).T)
    wanted = (F @ FACTORS @ F.T).reshape(COUNT, 9).T
    size = absolute_product(F, FACTORS, F.T).reshape(COUNT, 9).T
    assert_rounded(algebra.predicted_cross(cross, f), wanted, size, operations=12)


def test_information_is_predicted_as_its_inverse():
    F = transition(0.6)
    assert algebra.constant_acceleration(0.6) == algebra.pack_transition(F)
    back = np.linalg.inv(F)
    same(algebra.predicted_information(pack(), 0.6), back.T @ MATRICES @ back, absolute_product(back.T, MATRICES, back))


@pytest.mark.parametrize("component", range(3))
def test_update(component):
    P, gain, S = algebra.TAKE[component](pack(), R, 1.0)
    assert_rounded(S, MATRICES[:, component, component] + R)
    assert_rounded(gain, MATRICES[:, component].T / S, operations=2)
    # Gains g are below κ(P); terms of Joseph's form are P, g P, g P gᵀ and R g gᵀ.
    joseph = joseph_size(np.transpose(gain))
    same(P, [updated(one, component, g, R) for one, g in zip(MATRICES, np.transpose(gain), strict=True)], joseph)
    other, nothing, _ = algebra.TAKE[component](pack(), R, 0.0)
    assert np.array_equal(other, pack())
    assert not np.any(nothing)


@pytest.mark.parametrize("component", range(3))
def test_an_update_with_any_gain(component):
    made = algebra.CORRECT[component](pack(), R, STATES)
    wanted = [updated(one, component, g, R) for one, g in zip(MATRICES, STATES.T, strict=True)]
    same(made, wanted, joseph_size(STATES.T))
    P, gain, _ = algebra.TAKE[component](pack(), R, 1.0)
    same(algebra.CORRECT[component](pack(), R, gain), algebra.unpack(P), joseph_size(np.transpose(gain)))


def test_sums():
    outer = np.einsum("in,jn->nij", STATES, STATES)
    size = np.abs(MATRICES) + 0.4 * np.abs(outer)
    same(algebra.add_outer(pack(), 0.4, STATES), MATRICES + 0.4 * outer, size)
    spread = MATRICES + 0.4 * (np.eye(3) + outer)
    same(algebra.add_spread(pack(), 0.4, algebra.pack(np.eye(3)), STATES), spread, size + 0.4 * np.eye(3))
    product, size = (np.einsum("nij,jn->in", *both) for both in ((MATRICES, STATES), (abs(MATRICES), abs(STATES))))
    assert_rounded(algebra.times(pack(), STATES), product, size, operations=3)
    assert np.array_equal(algebra.add_scaled(STATES, 2.0, STATES), 3 * STATES)


def test_inverse_and_factors():
    """To the condition number; in any units to the same digits."""
    inverse = np.linalg.inv(MATRICES)
    same(algebra.inverse(pack()), inverse, np.abs(inverse).max(axis=(1, 2), keepdims=True), CONDITION)
    unit = np.array([4.0, 1 / 64, 2.0**20])
    scaled = algebra.inverse(pack(MATRICES * np.outer(unit, unit)))
    assert np.array_equal(scaled, pack(algebra.unpack(algebra.inverse(pack())) / np.outer(unit, unit)))
    lower, by, determinant = algebra.factored(pack())
    assert_rounded(determinant, np.linalg.det(MATRICES), condition=CONDITION.ravel(), operations=12)
    y = algebra.whitened(STATES, lower)
    solved = np.linalg.solve(MATRICES, STATES.T[:, :, None])[:, :, 0]
    normalised = (solved * STATES.T).sum(axis=1)
    assert_rounded(algebra.dot(algebra.scaled(y, by), y), normalised, condition=CONDITION.ravel(), operations=12)


@kernel
def run(x, p, component, dt, out_x, out_p):
    """A prediction and an update by a number, of one realisation a column, eight by eight."""
    at_x, at_p, to_x, to_p = address(x), address(p), address(out_x), address(out_p)
    F = algebra.constant_acceleration(dt)
    for i in range(x.shape[1] // WIDTH):
        P = algebra.predicted_covariance(get6(at_p, i, 2), F, algebra.NO_NOISE)
        if component == 0:
            P, g, S = algebra.take_value(P, R, full(1.0))
        elif component == 1:
            P, g, S = algebra.take_rate(P, R, full(1.0))
        else:
            P, g, S = algebra.take_second_rate(P, R, full(1.0))
        put3(to_x, i, algebra.add_scaled(algebra.predicted(get3(at_x, i, 2), F), S, g), 2)
        put6(to_p, i, P, 2)


@kernel
def run_plain(x, p, dt):
    """The same of a rate, on plain numbers."""
    F = algebra.constant_acceleration(dt)
    P = (p[0], p[1], p[2], p[3], p[4], p[5])
    P, g, S = algebra.take_rate(algebra.predicted_covariance(P, F, algebra.NO_NOISE), R, 1.0)
    return algebra.add_scaled(algebra.predicted((x[0], x[1], x[2]), F), S, g), P


@pytest.mark.parametrize("component", range(3))
def test_kernels_calculate_the_same(component):
    """But for fused multiply-adds."""
    many = np.concatenate([MATRICES, MATRICES[::-1] + np.eye(3)])
    x, p = np.tile(STATES, 2), np.array(pack(many))
    out_x, out_p = np.zeros_like(x), np.zeros_like(p)
    run(x, p, component, 0.6, out_x, out_p)
    F = algebra.constant_acceleration(0.6)
    P, g, S = algebra.TAKE[component](algebra.predicted_covariance(p, F, algebra.NO_NOISE), R, 1.0)
    state = algebra.add_scaled(algebra.predicted(x, F), S, g)
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
    put6(address(out), 0, lanes.choose6(get3(a, 0)[0], get3(b, 0)[0], get6(a, 0), get6(b, 0)))


def test_rows_are_chosen_lane_by_lane():
    x, y, out = RNG.normal(size=(3, 6 * WIDTH))
    choose(x, y, out)
    one, other = x.reshape(6, WIDTH), y.reshape(6, WIDTH)
    assert np.array_equal(out.reshape(6, WIDTH), np.where(one[0] > other[0], one, other))

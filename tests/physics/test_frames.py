"""Frames: round trips on random points, Jacobians against differences, the edge of the sector."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from radarsim import physics
from tests.physics.antenna import to_biconical

ANGLE = st.floats(-3.1, 3.1)
SIGMA = np.array([2.5, np.radians(0.1), np.radians(0.1)])


def points(n=500, seed=1, edge=0.97):
    """Random biconical points in front of the antenna, up to 97 % of the way to the edge."""
    rng = np.random.default_rng(seed)
    e = rng.uniform(-1, 1, n) * np.pi / 2 * edge
    a = rng.uniform(-1, 1, n) * (np.pi / 2 * edge - np.abs(e))
    return np.stack([10 ** rng.uniform(1, 6, n), e, a], axis=1)


@given(ANGLE, st.floats(-1.5, 1.5))
def test_rotation_is_a_right_hand_turn(azimuth, elevation):
    R = physics.rotation(azimuth, elevation)
    assert np.allclose(R @ R.T, np.eye(3), atol=1e-14)
    assert np.isclose(np.linalg.det(R), 1)
    assert np.allclose(
        R[:, 0], [np.cos(azimuth) * np.cos(elevation), np.sin(elevation), np.sin(azimuth) * np.cos(elevation)]
    )


def test_the_normal_turns_from_north_to_east_and_up():
    assert np.allclose(physics.rotation(np.pi / 2, 0) @ [1, 0, 0], [0, 0, 1], atol=1e-15)
    assert np.allclose(physics.rotation(0, np.pi / 2) @ [1, 0, 0], [0, 1, 0], atol=1e-15)
    assert np.allclose(physics.rotation(0, 0) @ [0, 0, 1], [0, 0, 1])  # right of an antenna that looks north is east


@given(ANGLE, st.floats(-1.5, 1.5), st.floats(-50, 500))
def test_round_trips(azimuth, elevation, height):
    R, biconical = physics.rotation(azimuth, elevation), points()
    local = physics.to_local(physics.from_biconical(biconical), R, height)
    back = to_biconical(physics.to_antenna(local, R, height))
    assert np.allclose(back, biconical, rtol=1e-8, atol=1e-9)
    assert np.allclose(physics.to_local(physics.to_antenna(local, R, height), R, height), local, rtol=1e-12, atol=1e-9)


def test_jacobian_equals_central_differences():
    biconical = points(edge=0.9)
    J = physics.jacobian(biconical)
    for i, step in enumerate((1e-2, 1e-6, 1e-6)):
        d = np.zeros(3)
        d[i] = step
        numerical = (physics.from_biconical(biconical + d) - physics.from_biconical(biconical - d)) / (2 * step)
        scale = np.abs(J[:, :, i]).max(axis=1, keepdims=True)
        assert np.max(np.abs(numerical - J[:, :, i]) / scale) < 1e-5


@pytest.mark.parametrize(
    "point", [(1e5, np.pi / 4, np.pi / 4), (1e5, np.pi / 2, 0.0), (1e5, 0.9, -0.9), (1e5, 2.0, 2.0), (1e5, 0.1, 3.0)]
)
def test_the_edge_of_the_sector_is_an_error_not_a_nan(point):
    for function in (physics.from_biconical, physics.jacobian, physics.normal_cosine):
        with pytest.raises(physics.OutsideSector, match="90 degrees"):
            function(np.array(point))


def test_plot_covariance_is_that_of_small_errors():
    rng, R = np.random.default_rng(5), physics.rotation(0.4, 0.5)
    biconical = np.array([8e4, 0.2, -0.3])
    noisy = physics.from_biconical(biconical + SIGMA * rng.standard_normal((200_000, 3))) @ R.T
    C = physics.plot_covariance(biconical, SIGMA, R)
    assert np.allclose(np.cov(noisy.T), C, atol=0.01 * np.trace(C))
    assert np.allclose(C, C.T)


def test_unbiased_conversion_takes_the_mean_error_off():
    rng = np.random.default_rng(6)
    sigma, biconical = np.array([2.5, 0.05, 0.05]), np.array([1e5, 0.5, -0.4])
    noise = sigma * rng.standard_normal((400_000, 3))
    noisy = biconical + np.concatenate([noise, -noise])  # antithetic: the odd terms cancel
    true = physics.from_biconical(biconical)
    plain = physics.from_biconical(noisy).mean(axis=0) - true
    mended = physics.unbiased_from_biconical(noisy, sigma).mean(axis=0) - true
    assert np.all(np.abs(mended) < 0.05 * np.abs(plain) + 5)
    assert np.abs(plain).max() > 200

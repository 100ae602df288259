"""Frames: round trips on random points, Jacobians against differences, the edge of the sector."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from radarsim.physics import frames
from tests.physics.antenna import to_biconical
from tests.tolerances import assert_rounded, mean_error, rounding

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
    R = frames.rotation(azimuth, elevation)
    # Elements up to one, each of two factors off by a unit; three terms to an element, six to the determinant.
    assert_rounded(R @ R.T, np.eye(3), np.ones((3, 3)), operations=9)
    assert_rounded(np.linalg.det(R), 1.0, operations=18)
    normal = [np.cos(azimuth) * np.cos(elevation), np.sin(elevation), np.sin(azimuth) * np.cos(elevation)]
    assert_rounded(R[:, 0], normal, operations=3)


def test_the_normal_turns_from_north_to_east_and_up():
    unit = np.ones(3)
    assert_rounded(frames.rotation(np.pi / 2, 0) @ [1, 0, 0], [0, 0, 1], unit)  # π/2 itself is off by ε/4
    assert_rounded(frames.rotation(0, np.pi / 2) @ [1, 0, 0], [0, 1, 0], unit)
    assert_rounded(frames.rotation(0, 0) @ [0, 0, 1], [0, 0, 1], unit)  # right of an antenna that looks north is east


@given(ANGLE, st.floats(-1.5, 1.5), st.floats(-50, 500))
def test_round_trips(azimuth, elevation, height):
    R, biconical = frames.rotation(azimuth, elevation), points()
    local = frames.to_local(frames.from_biconical(biconical), R, height)
    back = to_biconical(frames.to_antenna(local, R, height))
    # Turned there and back, three terms each way, over a height beside the range; angles are lost near the edge of the
    # sector by the cosine to the normal.
    reach, cosine = biconical[:, :1] + np.abs(height), frames.normal_cosine(biconical)[:, None]
    moved = frames.to_local(frames.to_antenna(local, R, height), R, height)
    assert_rounded(moved, local, np.broadcast_to(reach, local.shape), operations=12)
    size = np.hstack([reach, (reach / biconical[:, :1] / cosine**2) * np.ones(2)])
    assert_rounded(back, biconical, size, operations=24)


def test_jacobian_equals_central_differences():
    biconical = points(edge=0.9)
    J = frames.jacobian(biconical)
    cosine = frames.normal_cosine(biconical)[:, None]
    for i, step in enumerate((1e-2, 1e-6, 1e-6)):
        d = np.zeros(3)
        d[i] = step
        numerical = (frames.from_biconical(biconical + d) - frames.from_biconical(biconical - d)) / (2 * step)
        scale = np.abs(J[:, :, i]).max(axis=1, keepdims=True)
        # Rounding of the differenced numbers, and the difference's own error, h²/6 times the third derivative: the
        # cosine is a root, whose third derivative is some five of its first over its fourth power. Range is linear.
        rounded = rounding(operations=12) * biconical[:, :1] / cosine / step
        allowed = rounded + (scale * step**2 / cosine**4 if i else 0.0)
        assert (np.abs(numerical - J[:, :, i]) <= allowed).all()


@pytest.mark.parametrize(
    "point", [(1e5, np.pi / 4, np.pi / 4), (1e5, np.pi / 2, 0.0), (1e5, 0.9, -0.9), (1e5, 2.0, 2.0), (1e5, 0.1, 3.0)]
)
def test_the_edge_of_the_sector_is_an_error_not_a_nan(point):
    for function in (frames.from_biconical, frames.jacobian, frames.normal_cosine):
        with pytest.raises(frames.OutsideSectorError, match="90 degrees"):
            function(np.array(point))


def test_plot_covariance_is_that_of_small_errors():
    rng, R = np.random.default_rng(5), frames.rotation(0.4, 0.5)
    biconical = np.array([8e4, 0.2, -0.3])
    noisy = frames.from_biconical(biconical + SIGMA * rng.standard_normal((200_000, 3))) @ R.T
    C = frames.plot_covariance(biconical, SIGMA, R)
    # A product of two errors has a variance of at most 2 of their variances' product; errors curve by σ of an angle.
    sigma = np.sqrt(np.diagonal(C))
    allowed = mean_error(len(noisy), np.sqrt(2)) + 4 * SIGMA[1]
    assert (np.abs(np.cov(noisy.T) - C) <= allowed * np.outer(sigma, sigma)).all()
    assert_rounded(C, C.T, np.full((3, 3), np.trace(C)), operations=6)


def test_unbiased_conversion_takes_the_mean_error_off():
    rng = np.random.default_rng(6)
    sigma, biconical = np.array([2.5, 0.05, 0.05]), np.array([1e5, 0.5, -0.4])
    noise = sigma * rng.standard_normal((400_000, 3))
    noisy = biconical + np.concatenate([noise, -noise])  # antithetic: the odd terms cancel
    true = frames.from_biconical(biconical)
    plain = frames.from_biconical(noisy).mean(axis=0) - true
    mended = frames.unbiased_from_biconical(noisy, sigma).mean(axis=0) - true
    assert np.all(np.abs(mended) < 0.05 * np.abs(plain) + 5)
    assert np.abs(plain).max() > 200

"""Rotations and biconical coordinates of an antenna, with the covariance of a plot in them.

Source: P2 part 6.

Local: x north, y up, z east, origin at the radar's foot. Antenna: x along the normal, y and z in the aperture, z to the
right. Biconical: range r, elevation e and azimuth a, the complements of the angles to the antenna's y and z axes, so
that y_A = r sin e, z_A = r sin a. Positions are arrays (…, 3); biconical points (…, 3) hold (r, e, a) in m and rad."""

import math

import numpy as np


class OutsideSectorError(ValueError):
    """A point behind the antenna or in its plane, where biconical coordinates say nothing."""


def rotation(azimuth: float, elevation: float) -> np.ndarray:
    """R (3, 3) from antenna to local axes: the normal turned by `azimuth` from north to east, then raised by
    `elevation`."""
    ca, sa, ce, se = math.cos(azimuth), math.sin(azimuth), math.cos(elevation), math.sin(elevation)
    return np.array([[ca * ce, -ca * se, -sa], [se, ce, 0.0], [sa * ce, -sa * se, ca]])


def to_antenna(local: np.ndarray, R: np.ndarray, height: float) -> np.ndarray:
    """Antenna coordinates (…, 3) of local positions (…, 3); height (m) of the phase centre above the origin."""
    return (local - np.array([0.0, height, 0.0])) @ R


def to_local(antenna: np.ndarray, R: np.ndarray, height: float) -> np.ndarray:
    """Local positions (…, 3) of antenna coordinates (…, 3)."""
    return antenna @ R.T + np.array([0.0, height, 0.0])


def normal_cosine(biconical: np.ndarray) -> np.ndarray:
    """Cosine (…) of the angle from the antenna's normal of biconical (…, 3), sqrt(1 - sin² e - sin² a). Raises
    OutsideSectorError where it is not > 0."""
    square = 1.0 - np.sin(biconical[..., 1]) ** 2 - np.sin(biconical[..., 2]) ** 2
    # |e| + |a| >= 90° is no direction in front of the antenna.
    if not np.all((square > 0) & (np.abs(biconical[..., 1:]).sum(axis=-1) < math.pi / 2)):
        raise OutsideSectorError(
            "|elevation| + |azimuth| must be under 90 degrees: the point is not in front of the antenna"
        )
    return np.sqrt(square)


def from_biconical(biconical: np.ndarray) -> np.ndarray:
    """Antenna coordinates (…, 3) of biconical points, eq. (10); raises OutsideSectorError."""
    r, u = biconical[..., 0], normal_cosine(biconical)
    return np.stack([r * u, r * np.sin(biconical[..., 1]), r * np.sin(biconical[..., 2])], axis=-1)


def jacobian(biconical: np.ndarray) -> np.ndarray:
    """Derivatives (…, 3, 3) of the antenna coordinates by (r, e, a): J of eq. (10); raises OutsideSectorError."""
    r, e, a = np.moveaxis(biconical, -1, 0)
    u, zero = normal_cosine(biconical), np.zeros_like(r)
    return np.stack(
        [
            np.stack([u, -r * np.sin(e) * np.cos(e) / u, -r * np.sin(a) * np.cos(a) / u], axis=-1),
            np.stack([np.sin(e), r * np.cos(e), zero], axis=-1),
            np.stack([np.sin(a), zero, r * np.cos(a)], axis=-1),
        ],
        axis=-2,
    )


def plot_covariance(biconical: np.ndarray, sigma: np.ndarray, R: np.ndarray) -> np.ndarray:
    """Covariance (…, 3, 3) in the local frame of plots with errors sigma (3,) in (r, e, a): R J diag(sigma²) J' R'."""
    root = R @ jacobian(biconical) * np.asarray(sigma)
    return root @ np.swapaxes(root, -1, -2)


def unbiased_from_biconical(biconical: np.ndarray, sigma: np.ndarray) -> np.ndarray:
    """Antenna coordinates whose mean, over errors sigma (3,) of the plot, is the true point to the second order in
    sigma.

    sin of a noisy angle has the mean exp(-sigma²/2) sin; for x_A half the trace of the Hessian times the variances is
    taken off."""
    antenna, (_, ve, va) = from_biconical(biconical), np.asarray(sigma) ** 2
    r, u = biconical[..., 0], normal_cosine(biconical)
    bend = 0.0
    for angle, variance in ((biconical[..., 1], ve), (biconical[..., 2], va)):
        s2 = np.sin(angle) ** 2
        bend = bend + variance * (s2 - (1 - s2) - s2 * (1 - s2) / u**2) / u
    return antenna * np.array([1.0, 1 + ve / 2, 1 + va / 2]) - np.stack([r * bend / 2, 0 * r, 0 * r], axis=-1)

"""Tolerances of comparisons: of computed numbers from conditioning, of estimates from the size of the sample.

A number that several operations compute is known to their count, times ε, times its condition: how much a relative
error of what goes in is multiplied in what comes out. Processors differ by that much, as they fuse, order and
approximate operations as they like. A sample's mean is known to z standard errors.
"""

import math

import numpy as np

EPSILON = 2.0**-52  # twice the relative error of an operation: one of each side of a comparison
# Two-sided, exceeded by chance once in 200 million looks: the suite takes thousands, and any seed may be set.
Z = 5.85


def rounding(condition=1.0, operations=1):
    """Largest relative difference of two computations of so many operations each, in any order, fused or not.

    The worst case, in which no errors cancel: that of a sum of n terms grows with n, not with √n.
    """
    return condition * operations * EPSILON


def scaled_condition(matrix):
    """κ₂ of symmetric positive definite matrices in the units in which their diagonals are 1.

    No unit enters what Cholesky's and Kalman's algebra loses (van der Sluis 1969: within a factor n of the best scale).
    A number that is known exactly, of variance zero, is left out.
    """
    variance = np.diagonal(matrix, axis1=-2, axis2=-1)
    scale = np.sqrt(np.where(variance > 0, variance, 1.0))
    known = (variance <= 0)[..., None] * np.eye(variance.shape[-1])
    return np.linalg.cond(matrix / (scale[..., :, None] * scale[..., None, :]) + known)


def polynomial_condition(times, degree=2):
    """κ of the covariance of what least squares through plots at these times know at the last: place, speed, …"""
    powers = np.vander(np.asarray(times, dtype=float) - times[-1], degree + 1)
    return scaled_condition(np.linalg.inv(powers.T @ powers))


def recursion_rounding(scans=15):
    """Largest relative difference of σ of the paper's filters by two recursions.

    A scan takes ten operations; κ is that of what the first three ranges tell.
    """
    return rounding(polynomial_condition([0, 1, 2]), 10 * scans)


def mean_error(count, spread=1.0, z=Z):
    """z standard errors of the mean of so many independent numbers of that spread."""
    return z * spread / math.sqrt(count)


def sigma_error(count, kurtosis=3.0, z=Z):
    """z relative standard errors of σ, from the root mean square of so many independent errors of that kurtosis."""
    return z * np.sqrt((kurtosis - 1.0) / count) / 2.0


def share_error(share, count, z=Z):
    """z standard errors of a share of so many independent trials.

    The normal law is wrong where few are expected: a share is taken to be that of five trials at least.
    """
    share = np.clip(share, min(5 / count, 0.5), 1 - min(5 / count, 0.5))
    return z * np.sqrt(share * (1 - share) / count)


def absolute_product(*matrices):
    """|A| |B| |C| …: what a rounding of each product is relative to, where terms of a product cancel."""
    product = np.abs(matrices[0])
    for matrix in matrices[1:]:
        product = product @ np.abs(matrix)
    return product


def assert_rounded(found, wanted, size=None, condition=1.0, operations=1):
    """Differences are within rounding of numbers of a size: that of what was summed, by default of the wanted ones."""
    found, wanted = np.asarray(found), np.asarray(wanted)
    allowed = rounding(condition, operations) * np.abs(wanted if size is None else size)
    np.testing.assert_array_equal(np.isnan(found), np.isnan(wanted))
    off = np.nan_to_num(np.abs(found - wanted))
    assert (off <= np.nan_to_num(allowed)).all(), (
        f"off by up to {(off / np.where(allowed > 0, allowed, EPSILON)).max():.3g} times what rounding allows, "
        f"{np.max(off):.3g} of {np.max(np.abs(wanted)):.3g}"
    )


def column_sizes(values, count):
    """Sizes of what sums of so many numbers add up, by column: of both signs their sums are smaller by about a root."""
    values = np.abs(np.asarray(values))
    return math.sqrt(count) * values.max(axis=tuple(range(values.ndim - 1)), keepdims=True, initial=0)


def units_off(found, exact):
    """Largest distance in units of the last place of numbers from exact ones, which are in extended precision."""
    return float((np.abs(np.asarray(found) - exact) / np.spacing(np.abs(exact.astype(float)))).max())

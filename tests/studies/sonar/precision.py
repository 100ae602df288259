"""How well the sonar's filters and their twins are known, from the conditioning of what they solve."""

import numpy as np

from tests.tolerances import assert_rounded, scaled_condition

# κ of a straight line and of a parabola through plots of equal intervals, at the last: it grows with their number to
# these, which are (2 + √3)² and 285.
LINE, PARABOLA = 14, 285
TERMS = 10  # operations on an element in a scan: two products of three terms each, with the sums that they enter


def losses(P, errors=0.0):
    """Relative errors (K,), in ε, of covariances (K, n, n) of a recursion: κ of each so far, for every operation.

    A rounding of P by ε, in units of σ, is at most κ ε P in the order of positive matrices, which recursions keep.
    Rows that are not known yet count as one. `errors` is κ of the plots' errors, where these are solved for.
    """
    full = np.isfinite(P).all(axis=(1, 2))
    kappa = np.ones(len(P))
    kappa[full] = scaled_condition(P[full])
    return TERMS * np.cumsum(kappa + errors)


def assert_covariances_rounded(found, wanted, errors=0.0):
    """Covariances (K, n, n) of a recursion, where they are known, within `losses` in units of σ."""
    sigma = np.sqrt(np.diagonal(wanted, axis1=1, axis2=2))
    size = losses(wanted, errors)[:, None, None] * sigma[:, :, None] * sigma[:, None, :]
    known = np.isfinite(wanted)
    assert_rounded(np.where(known, found, np.nan), wanted, size)


def estimate_losses(P, z, sigma, errors=0.0):
    """Errors (K,), in ε of σ, of estimates from plots z (K,) of that σ, whose covariances are P (K, n, n).

    Solutions lose κ of the plots' distances from one another, innovations a rounding of the plots themselves.
    """
    spread, reach = np.nanmax(z) - np.nanmin(z), np.nanmax(np.abs(z))
    return losses(P, errors) * (spread / sigma + 1) + TERMS * np.arange(1, len(z) + 1) * reach / sigma


def assert_estimates_rounded(found, wanted, P, z, sigma, errors=0.0, factor=1.0):
    """Estimates (K, n), where they are known, within `factor` times `estimate_losses`; P (K, m, m), m ≥ n."""
    unit = np.sqrt(np.diagonal(P, axis1=1, axis2=2))[:, : wanted.shape[1]]
    size = factor * estimate_losses(P, z, sigma, errors)[:, None] * unit
    assert_rounded(np.where(np.isfinite(wanted), found, np.nan), wanted, size)

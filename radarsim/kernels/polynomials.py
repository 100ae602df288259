"""Polynomials for logarithm, sine and cosine, for plain numbers and lanes."""

import numpy as np

from radarsim.kernels.compiler import inline
from radarsim.kernels.lanes import ROOT_HALF


@inline
def log_polynomial(x):
    """Natural logarithm of a positive normal number, to 3 units in the last place."""
    b = np.float64(x).view(np.int64)
    e = (b - np.int64(ROOT_HALF)) >> np.int64(52)
    return log_series(np.int64(b - (e << np.int64(52))).view(np.float64), np.float64(e))


@inline
def log_series(m, e):
    """Natural logarithm of m 2^e with m from √½ to √2.

    log m = 2 atanh s = s (2 + q p(q)) with s = (m - 1) / (m + 1), q = s². p is the polynomial of least greatest error
    (Remez's algorithm in 50 digits): 1.2e-18 of the logarithm."""
    s = (m - 1.0) / (m + 1.0)
    q = s * s
    p = q * 0.1479594981044202 + 0.15314050542046614
    p = p * q + 0.1818356432645527
    p = p * q + 0.2222219857317996
    p = p * q + 0.28571428742387633
    p = p * q + 0.39999999999414676
    p = p * q + 0.6666666666666734
    return e * 0.69314718055994531 + s * (p * q + 2.0)


@inline
def sine_cosine_polynomial(x):
    """sin x and cos x for |x| <= pi/4, to 1.5 units in the last place. The polynomials in q = x² of least greatest
    error (Remez's algorithm in 50 digits), 4e-18 and 9e-17, for (sin x / x - 1) / q and (cos x - 1 + q/2) / q²."""
    q = x * x
    s = q * 1.589623019235577e-10 - 2.505074776349835e-08
    s = s * q + 2.7557313621390157e-06
    s = s * q - 0.00019841269829589552
    s = s * q + 0.008333333333322118
    s = s * q - 0.1666666666666663
    c = q * 2.0645119015439733e-09 - 2.7555523111876013e-07
    c = c * q + 2.48015807073305e-05
    c = c * q - 0.0013888888877611812
    c = c * q + 0.04166666666659654
    return x * q * s + x, (c * q - 0.5) * q + 1.0

"""A linear filter of any number of states over recorded plots."""

import numpy as np

from radarsim.kernels.compiler import kernel, kernel_part
from radarsim.kernels.likelihood import extrapolate, innovation


@kernel
def filter_recorded(x, P, F, Q, H, R, gains, adapts, z, present, out):
    """One filter over rows of recorded plots; x (n,) and P (n, n), as before the first row, are overwritten. F, Q (m,
    n, n) to each row, H, gains (m, D, n), R (m, D), numbers z (m, D) where `present`. out (m, 2 n + D) takes estimates,
    standard deviations, and squared innovations over their variances where there is a number."""
    n, D = x.size, z.shape[1]
    product, p = np.empty((n, n)), np.empty(n)
    for k in range(z.shape[0]):
        extrapolate(x, P, product, p, F[k], Q[k], 1.0)
        for d in range(D):
            if present[k, d]:
                y, spread = innovation(x, P, H, k, d, z[k, d], p)
                S = spread + R[k, d]
                out[k, 2 * n + d] = y * y / S
                correct_state(x, P, p, S, y, gains[k, d], adapts)
        for j in range(n):
            out[k, j] = x[j]
            out[k, n + j] = np.sqrt(P[j, j])


@kernel_part
def correct_state(x, P, p, S, y, gain, adapts):
    """x and P after an innovation y of variance S and covariance p (n,) with the state: P - g p' - p g' + S g g'."""
    for j in range(x.size):
        g = p[j] / S if adapts else gain[j]
        x[j] += g * y
        for m in range(j + 1):
            h = p[m] / S if adapts else gain[m]
            P[j, m] += g * h * S - g * p[m] - p[j] * h
            P[m, j] = P[j, m]

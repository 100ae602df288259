"""The logarithm of the likelihood of one recorded track, from the innovations of its Kalman filter.

Letters as in the book: x state (range, velocity, acceleration), P its covariance, Q process noise, S variance of an
innovation e, K = p/S gain with p the measured column of P. A plot is taken in one number after the other.

An outlier is a plot whose σ is FACTOR times the stated one; each number is one with the probability `share`. What the
two explanations leave of x and P is merged by moments (GPB1).
"""

import numpy as np

from radarsim.kernels.compile import kernel

FACTOR = 10.0
WIDE_VELOCITY_MPS, WIDE_ACCELERATION_MPS2 = 3e4, 3e3  # standard deviations before the first plot: nothing is known


@kernel
def log_likelihood(F, Q, z, there, values, score):
    """Add up the log-likelihood of n rows.

    F (n, 3, 3), Q (n, 3, 3): transition to each row and process noise of unit variance; z (n, 2) range and velocity,
    there (n, 2) whether the number counts; values (5,): variance of the range, of the velocity, of the manoeuvre, bias
    of the velocity, share of outliers. Out: score (n, 2), the logarithm of each number's density given those before it,
    zero where it does not count. The first range starts the track and has none.
    """
    x, P, M = np.zeros(3), np.zeros((3, 3)), np.zeros((3, 3))
    score[:, :] = 0.0
    first = 0
    while first < z.shape[0] and not there[first, 0]:
        first += 1
    for k in range(first, z.shape[0]):
        if k == first:
            x[0] = z[k, 0]
            P[0, 0], P[1, 1], P[2, 2] = values[0], WIDE_VELOCITY_MPS**2, WIDE_ACCELERATION_MPS2**2
        else:
            extrapolate(x, P, M, F[k], Q[k], values[2])
            if there[k, 0]:
                score[k, 0] = take(x, P, 0, z[k, 0] - x[0], values[0], values[4])
        if there[k, 1]:
            score[k, 1] = take(x, P, 1, z[k, 1] - x[1] - values[3], values[1], values[4])


@kernel
def extrapolate(x, P, M, F, Q, manoeuvre):
    """x = F x and P = F P F' + manoeuvre Q, in place; M (3, 3) is room for F P."""
    x0, x1, x2 = x[0], x[1], x[2]
    for i in range(3):
        x[i] = F[i, 0] * x0 + F[i, 1] * x1 + F[i, 2] * x2
        for j in range(3):
            M[i, j] = F[i, 0] * P[0, j] + F[i, 1] * P[1, j] + F[i, 2] * P[2, j]
    for i in range(3):
        for j in range(3):
            P[i, j] = M[i, 0] * F[j, 0] + M[i, 1] * F[j, 1] + M[i, 2] * F[j, 2] + manoeuvre * Q[i, j]


@kernel
def take(x, P, m, e, variance, share):
    """Take in a number of component m with innovation e: x, P in place; the logarithm of its density."""
    S, T = P[m, m] + variance, P[m, m] + FACTOR * FACTOR * variance
    plain = np.log(1.0 - share) - 0.5 * (np.log(2.0 * np.pi * S) + e * e / S)
    density, w, v = plain, 1.0, 0.0
    if share > 0.0:
        wide = np.log(share) - 0.5 * (np.log(2.0 * np.pi * T) + e * e / T)
        most = max(plain, wide)
        density = most + np.log(np.exp(plain - most) + np.exp(wide - most))
        w, v = np.exp(plain - density), np.exp(wide - density)
    gain = w / S + v / T
    spread = 1.0 / S - 1.0 / T
    shrink = gain - w * v * e * e * spread * spread
    p = (P[0, m], P[1, m], P[2, m])
    for i in range(3):
        x[i] += gain * e * p[i]
        for j in range(3):
            P[i, j] -= shrink * p[i] * p[j]
    return density

"""A Kalman filter of range, velocity and acceleration, one realisation at a time; plain numbers.

x (3) is the state, P (6) its covariance, packed as in `kernels.symmetric`. Numbers are taken one after the other: for
independent errors that is the same as all at once, and needs no inverse. The row of what is taken is scaled and not
subtracted from itself, of which rounding would leave a negative number where the prior is wide.
"""

import math

from radarsim.kernels.compile import inline


@inline
def moved(x, e, g):
    """x + g e."""
    return x[0] + g[0] * e, x[1] + g[1] * e, x[2] + g[2] * e


@inline
def range_taken(x, P, z, variance):
    """State and covariance after a range z of that variance."""
    S = P[0] + variance
    g, kept = (P[0] / S, P[1] / S, P[2] / S), variance / S
    P = P[0] * kept, P[1] * kept, P[2] * kept, P[3] - g[1] * P[1], P[4] - g[1] * P[2], P[5] - g[2] * P[2]
    return moved(x, z - x[0], g), P


@inline
def velocity_taken(x, P, e, variance):
    """State and covariance after a velocity of innovation e, and the innovation's variance."""
    S = P[3] + variance
    g, kept = (P[1] / S, P[3] / S, P[4] / S), variance / S
    P = P[0] - g[0] * P[1], P[1] * kept, P[2] - g[0] * P[4], P[3] * kept, P[4] * kept, P[5] - g[2] * P[4]
    return moved(x, e, g), P, S


@inline
def acceleration_taken(x, P, e, variance):
    """State and covariance after an acceleration of innovation e, and the innovation's variance."""
    S = P[5] + variance
    g, kept = (P[2] / S, P[4] / S, P[5] / S), variance / S
    P = P[0] - g[0] * P[2], P[1] - g[0] * P[4], P[2] * kept, P[3] - g[1] * P[4], P[4] * kept, P[5] * kept
    return moved(x, e, g), P, S


@inline
def lock_weight(distance, determinant, takes, lock, density):
    """Probability that an estimate has locked, by its squared distance in variances from the prediction.

    determinant is that of its innovation's covariance, lock the probability before, density that of one not locked.
    """
    near = lock * math.exp(-0.5 * distance) / math.sqrt((2.0 * math.pi) ** takes * determinant)
    return near / (near + (1.0 - lock) * density)


@inline
def mixed(x, P, y, Q, w):
    """Mean and covariance of a mixture: (y, Q) with the weight w, (x, P) with the rest."""
    d, u, v = (y[0] - x[0], y[1] - x[1], y[2] - x[2]), 1.0 - w, w * (1.0 - w)
    P = (
        u * P[0] + w * Q[0] + v * d[0] * d[0],
        u * P[1] + w * Q[1] + v * d[0] * d[1],
        u * P[2] + w * Q[2] + v * d[0] * d[2],
        u * P[3] + w * Q[3] + v * d[1] * d[1],
        u * P[4] + w * Q[4] + v * d[1] * d[2],
        u * P[5] + w * Q[5] + v * d[2] * d[2],
    )
    return moved(x, w, d), P

"""A Kalman filter of range, velocity and acceleration, one realisation at a time; plain numbers.

x (3) is the state, P (6) its covariance, packed as in `kernels.algebra`. Numbers are taken one after the other: for
independent errors that is the same as all at once, and needs no inverse. The row of what is taken is scaled and not
subtracted from itself, of which rounding would leave a negative number where the prior is wide.
"""

import math

import numpy as np

from radarsim.kernels.algebra import predicted, predicted_covariance
from radarsim.kernels.compile import inline
from radarsim.kernels.random import normals
from radarsim.studies.pulses_to_tracks.kernels.records import AGES, LOCKED, LOCKED_3


@inline
def state_of(rows, i):
    """x (3) and P (6) of row i of rows (n, 9); a row cut out of them would be counted, a fifth of the time."""
    return (rows[i, 0], rows[i, 1], rows[i, 2]), (
        rows[i, 3],
        rows[i, 4],
        rows[i, 5],
        rows[i, 6],
        rows[i, 7],
        rows[i, 8],
    )


@inline
def put_state(rows, i, x, P):
    """Write x and P into row i of rows (n, 9)."""
    rows[i, 0], rows[i, 1], rows[i, 2] = x
    rows[i, 3], rows[i, 4], rows[i, 5], rows[i, 6], rows[i, 7], rows[i, 8] = P


@inline
def begun(world, realisation, noise):
    """State and covariance after the first range, which errs by noise, and the designation, which is drawn."""
    v, a = normals(world.keys[2, 0], world.keys[2, 1], realisation, 0)
    x = noise, world.prior[0] * v, world.prior[1] * a
    return x, (world.sigma_r**2, 0.0, 0.0, world.prior[0] ** 2, 0.0, world.prior[1] ** 2)


@inline
def a_scan_later(world, own, k, x, P):
    """State and covariance a scan later, at scan k."""
    missed, Q = world.missed[k], own.noise
    x = predicted(x, world.motion)
    x = x[0] + missed[0], x[1] + missed[1], x[2] + missed[2]
    q = (Q[0], Q[1], Q[2], Q[3], Q[4], Q[5]) if k >= own.start else (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    return x, predicted_covariance(P, world.motion, q)


@inline
def folded(x, span):
    """x, less the nearest whole number of spans."""
    return x - span * np.rint(x / span)


@inline
def scored(sigma, takes, v, a, i, ages, locks, of_measured):
    """Count a burst of realisation i whose estimates err by v and a: whether it locked, and the errors' powers.

    sigma (2,) are the Fisher bounds; ages (n,) scans since a burst was lost.
    """
    worst = abs(v) / sigma[0]
    if takes == 2:
        worst = max(worst, abs(a) / sigma[1])
    locked = worst < 5.0
    ages[i] = min(ages[i] + 1, AGES - 1) if locked else 0
    locks[LOCKED] += 1.0 if locked else 0.0
    locks[LOCKED_3] += 1.0 if worst < 3.0 else 0.0
    for c in range(takes):
        square = v * v if c == 0 else a * a
        of_measured[c, 1, 0] += square
        of_measured[c, 1, 1] += square * square
        of_measured[c, 0, 0] += square if locked else 0.0
        of_measured[c, 0, 1] += square * square if locked else 0.0


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

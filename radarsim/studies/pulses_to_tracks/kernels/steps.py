"""A Kalman filter of range, velocity and acceleration, one realisation at a time; plain numbers.

x (3) is the state, P (6) its covariance, packed as in `kernels.algebra`. Numbers are taken one after the other: for
independent errors that is the same as all at once, and needs no inverse.
"""

import math

import numpy as np

from radarsim.kernels.algebra import NO_NOISE, add_scaled, add_spread, predicted, predicted_covariance
from radarsim.kernels.compile import inline
from radarsim.kernels.random import normals
from radarsim.studies.pulses_to_tracks.kernels import records as rec


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
    Q = own.noise
    q = (Q[0], Q[1], Q[2], Q[3], Q[4], Q[5]) if k >= own.start else NO_NOISE
    return add_scaled(predicted(x, world.motion), 1.0, world.missed[k]), predicted_covariance(P, world.motion, q)


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
    ages[i] = min(ages[i] + 1, rec.AGES - 1) if locked else 0
    locks[rec.LOCKED] += 1.0 if locked else 0.0
    locks[rec.LOCKED_3] += 1.0 if worst < 3.0 else 0.0
    for c in range(takes):
        square = v * v if c == 0 else a * a
        of_measured[c, 1, 0] += square
        of_measured[c, 1, 1] += square * square
        of_measured[c, 0, 0] += square if locked else 0.0
        of_measured[c, 0, 1] += square * square if locked else 0.0


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
    d = add_scaled(y, -1.0, x)
    P = add_spread(NO_NOISE, 1.0 - w, P, (w * d[0], w * d[1], w * d[2]))
    return add_scaled(x, w, d), add_spread(P, w, Q, ((1.0 - w) * d[0], (1.0 - w) * d[1], (1.0 - w) * d[2]))

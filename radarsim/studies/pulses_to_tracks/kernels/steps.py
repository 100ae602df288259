"""A Kalman filter of range, velocity and acceleration, one realisation at a time; plain numbers.

x (3) is the state, P (6) its covariance, packed as in `radarsim.kernels.kalman_algebra`. The numbers of a plot are
processed one after the other: for independent errors that gives the same as all at once, and needs no inverse."""

import math

import numpy as np

from radarsim.kernels import kalman_algebra
from radarsim.kernels.compiler import inline
from radarsim.kernels.kalman_algebra import NO_NOISE, add_scaled, add_spread
from radarsim.kernels.random import normals
from radarsim.studies.pulses_to_tracks.kernels.layout import AGES, LOCKED, LOCKED_3


@inline
def state_of(rows, i):
    """x (3) and P (6) of row i of rows (n, 9); a slice would be reference-counted, which takes a fifth of the time."""
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
def start_state(world, realisation, noise):
    """State and covariance after the first range, with error `noise`, and the designation, which is drawn."""
    v, a = normals(world.keys[2, 0], world.keys[2, 1], realisation, 0)
    x = noise, world.prior[0] * v, world.prior[1] * a
    return x, (world.sigma_r**2, 0.0, 0.0, world.prior[0] ** 2, 0.0, world.prior[1] ** 2)


@inline
def predict_state(world, options, k, x, P):
    """State and covariance predicted to scan k."""
    Q = options.noise
    q = (Q[0], Q[1], Q[2], Q[3], Q[4], Q[5]) if k >= options.start else NO_NOISE
    x = add_scaled(kalman_algebra.predict_state(x, world.motion), 1.0, world.model_defects[k])
    return x, kalman_algebra.predict_covariance(P, world.motion, q)


@inline
def fold(x, span):
    """x minus the nearest whole number of spans."""
    return x - span * np.rint(x / span)


@inline
def score_burst(sigma, takes, v, a, i, ages, locks, error_sums):
    """Add a burst of realisation i with errors v and a to the sums: whether it locked, and the powers of its errors.

    sigma (2,) are the Cramér–Rao bounds; ages (n,) scans since a burst was lost."""
    worst = abs(v) / sigma[0]
    if takes == 2:
        worst = max(worst, abs(a) / sigma[1])
    locked = worst < 5.0
    ages[i] = min(ages[i] + 1, AGES - 1) if locked else 0
    locks[LOCKED] += 1.0 if locked else 0.0
    locks[LOCKED_3] += 1.0 if worst < 3.0 else 0.0
    for c in range(takes):
        square = v * v if c == 0 else a * a
        error_sums[c, 1, 0] += square
        error_sums[c, 1, 1] += square * square
        error_sums[c, 0, 0] += square if locked else 0.0
        error_sums[c, 0, 1] += square * square if locked else 0.0


@inline
def lock_weight(distance, determinant, takes, lock, density):
    """Probability that an estimate has locked, given its squared distance from the prediction in variances.

    determinant: of the innovation's covariance; lock: prior probability; density: of an estimate that did not lock."""
    locked = lock * math.exp(-0.5 * distance) / math.sqrt((2.0 * math.pi) ** takes * determinant)
    return locked / (locked + (1.0 - lock) * density)


@inline
def mix_states(x, P, y, Q, w):
    """Mean and covariance of a mixture: (y, Q) with weight w, (x, P) with weight 1 − w."""
    d = add_scaled(y, -1.0, x)
    P = add_spread(NO_NOISE, 1.0 - w, P, (w * d[0], w * d[1], w * d[2]))
    return add_scaled(x, w, d), add_spread(P, w, Q, ((1.0 - w) * d[0], (1.0 - w) * d[1], (1.0 - w) * d[2]))

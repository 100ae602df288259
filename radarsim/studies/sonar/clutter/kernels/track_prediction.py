"""Tracks of range and bearing, eight at a time: their state, and its prediction with the innovation's covariance.

The state is that of two lines, (r, vr) and (b, vb), each with the recursion of a plain Kalman filter (after
`sonar.kernels.least_squares` up to two plots). Probabilistic association causes a covariance between them: four
numbers, which are exactly zero as long as every plot taken is certain. The coordinates of a plot are processed one
after the other, which is possible because their errors are independent. Letters as in `sonar.kernels.steps`, and

    P_r, P_b    (6)   covariances of the two lines; their third component is zero
    C           (4)   covariance between them, (r, vr) by (b, vb), packed by rows
    nu_r, nu_b        innovations in range and bearing, in m and rad
    S           (3)   covariance of the innovations: rr, rb, bb
    V           (3)   additional covariance of innovations that may not be the target's: rr, rb, bb
    K_rb        (2)   gain of the line in range for the innovation in bearing; likewise K_rr, K_br, K_bb
    n, w              plots of a track before this scan; 1 where it takes a plot, else 0

P, C and K are in nominal plots and periods. Arrays contain a chunk of realisations, as in `sonar.kernels.steps`."""

from typing import NamedTuple

import numpy as np

from radarsim.kernels.compiler import aligned_zeros, inline, kernel
from radarsim.kernels.gap_noise import manoeuvre_noise
from radarsim.kernels.kalman_algebra import constant_acceleration, predict_covariance, predict_state
from radarsim.kernels.lane_matrices import choose6, get3, get4, get6
from radarsim.kernels.lanes import address, full, get, put
from radarsim.studies.sonar.kernels.chunks import CHUNK, GROUPS

LEAST_SQUARES_PLOTS = 2.0  # plots from which a line is no longer least squares


class Tracks(NamedTuple):
    """A chunk of tracks of one tracker; lines in range and in bearing."""

    x: np.ndarray  #: (2, 4, CHUNK) states of each line
    Y: np.ndarray  #: (2, 8, CHUNK) information, as in `steps`
    P: np.ndarray  #: (2, 6, CHUNK) covariance
    C: np.ndarray  #: (4, CHUNK) covariance between the lines
    plots: np.ndarray  #: (CHUNK,) so far


def no_tracks() -> Tracks:
    """A chunk without any track."""
    shapes = ((2, 4, CHUNK), (2, 8, CHUNK), (2, 6, CHUNK), (4, CHUNK), (CHUNK,))
    return Tracks(*(aligned_zeros(*shape) for shape in shapes))


@kernel
def clear_track(tracks, i):
    """Set track i to zero."""
    tracks.x[:, :, i], tracks.Y[:, :, i], tracks.P[:, :, i] = 0.0, 0.0, 0.0
    tracks.C[:, i], tracks.plots[i] = 0.0, 0.0


@inline
def predict_line_covariance(P, n, tau, q):
    """Predict the covariance (6) of a line over tau periods."""
    moved = predict_covariance(P, constant_acceleration(tau), manoeuvre_noise(q, tau, 1.0, 2))
    return choose6(full(LEAST_SQUARES_PLOTS), n, P, moved)


@inline
def predict_cross_covariance(C, tau):
    """Predict the covariance between the lines over tau periods: F C Fᵀ."""
    value, rate = C[0] + tau * C[2], C[1] + tau * C[3]
    return value + tau * rate, rate, C[2] + tau * C[3], C[3]


@kernel
def predict(tracks, dt, period, sigma, manoeuvre, forecast):
    """Write positions and innovation covariances after dt to forecast (5, CHUNK): r, b, S (rr, rb, bb); in m, rad.

    sigma (2,) of a nominal plot; manoeuvre (2,) variances q of the lines."""
    ar, ab, pr, pb = address(tracks.x[0]), address(tracks.x[1]), address(tracks.P[0]), address(tracks.P[1])
    ac, an, out, tau = address(tracks.C), address(tracks.plots), address(forecast), dt / period
    rr, rb, bb, F = sigma[0] * sigma[0], sigma[0] * sigma[1], sigma[1] * sigma[1], constant_acceleration(dt)
    for i in range(GROUPS):
        n, (r, _, _), (b, _, _) = (
            get(an, i),
            predict_state(get3(ar, i, GROUPS), F),
            predict_state(get3(ab, i, GROUPS), F),
        )
        P_r = predict_line_covariance(get6(pr, i, GROUPS), n, tau, manoeuvre[0])
        P_b = predict_line_covariance(get6(pb, i, GROUPS), n, tau, manoeuvre[1])
        C, _, _, _ = predict_cross_covariance(get4(ac, i, GROUPS), tau)
        put(out, i, r)
        put(out, GROUPS + i, b)
        put(out, 2 * GROUPS + i, rr * (P_r[0] + 1.0))
        put(out, 3 * GROUPS + i, rb * C)
        put(out, 4 * GROUPS + i, bb * (P_b[0] + 1.0))

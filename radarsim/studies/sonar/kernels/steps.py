"""One scan of a recursive filter whose gains differ between realisations, eight realisations at a time.

The letters of this file and of those that use it (tuples; a number in them is a lane of eight realisations, or, where
Python designs a filter, an array over patterns of plots):

    x    (4)   state: value, rate, acceleration, and the error e carried over from the last plot
    P    (6)   covariance of value, rate and acceleration, packed as in `kernels.kalman_algebra`
    J    (10)  joint covariance of x: P, then the covariances of the three with e, then the variance of e
    Y    (6)   information, the inverse of P, packed likewise; (8) with age and correlation of the last plot's error
    H    (3)   observation row
    K    (4)   gain
    S          variance of the innovation
    z, w       plot, and its weight 1 / R, zero where it is missed
    n          number of plots before this scan
    rank       number of components that the plots determine: the size of the state, or fewer at the start
    tau        interval since the previous scan, in periods (dt: in s)
    c          correlation of the error with that of the previous scan
    q          manoeuvre variance: of the derivative of order `size`, constant over an interval

P, J, Y, R, S and q are in units of a nominal plot's σ and of the period; x is in m or rad, and s. An array contains one
chunk of realisations: `get(address(a), j * GROUPS + i)` is group i of row j."""

from typing import NamedTuple

import numpy as np

from radarsim.kernels import kalman_algebra, lane_matrices
from radarsim.kernels.compiler import inline
from radarsim.kernels.lane_matrices import get4, put4, put6
from radarsim.kernels.lanes import address, get
from radarsim.studies.sonar.kernels.chunks import GROUPS
from radarsim.studies.sonar.kernels.kalman import kalman
from radarsim.studies.sonar.kernels.least_squares import least_squares


class Filters(NamedTuple):
    """What F filters in C coordinates store from scan to scan, for a chunk."""

    x: np.ndarray  #: (F, C, 4, CHUNK) state
    Y: np.ndarray  #: (F, C, 8, CHUNK) information
    #: (F, C, >= 10, CHUNK) rows by kind of filter: here the joint covariance J; see `adaptive.update_adaptive`,
    #: `imm.update_imm`
    kind_rows: np.ndarray
    P: np.ndarray  #: (6, CHUNK) of the filter that was updated last


class Plots(NamedTuple):
    """Plots of a chunk at a scan, each (C, CHUNK)."""

    z: np.ndarray
    weight: np.ndarray
    n: np.ndarray  #: number of plots before the scan
    n_now: np.ndarray  #: up to it
    recent: np.ndarray  #: (C, 3, L, ROW) the last plots: plot, age, weight
    T: np.ndarray  #: (D, G, CHUNK) statistics of the detectors


@inline
def updated_state(x, z, K, dt, period, c):
    """State x (4) after an interval dt and a plot z: F x + K (z - H F x), in m or rad, and s."""
    per, twice = 1.0 / period, 1.0 / (period * period)
    r, v, a = kalman_algebra.predict_state((x[0], x[1], x[2]), kalman_algebra.constant_acceleration(dt))
    e = c * x[3]
    innovation = z - r - e
    return (r + K[0] * innovation, v + per * K[1] * innovation, a + twice * K[2] * innovation, e + K[3] * innovation)


@inline
def memory_addresses(filters, plots, f, c):
    """Addresses of a filter's x, Y, rows of its kind and P, then of its coordinate's z, weight and n.

    The arrays must outlive the addresses.
    Numba would count a reference to each array wherever it is passed on."""
    x, Y, kind_rows, P = filters.x[f, c], filters.Y[f, c], filters.kind_rows[f, c], filters.P
    z, w, n = plots.z[c], plots.weight[c], plots.n[c]
    return address(x), address(Y), address(kind_rows), address(P), address(z), address(w), address(n)


@inline
def get_information(a, i):
    """Y (8) of group i."""
    return get4(a, i, GROUPS) + get4(a, 4 * GROUPS + i, GROUPS)


@inline
def put_information(a, i, Y):
    """Write Y (8) of group i."""
    put4(a, i, Y, GROUPS)
    put4(a, 4 * GROUPS + i, Y[4:], GROUPS)


@inline
def update_recursive(filters, plots, f, c, by_covariance, model, dt, period):
    """Update the memory of a recursive filter with one scan, in place.

    by_covariance: after the model's start the filter switches from information to the joint covariance."""
    ax, ay, aj, ap, az, aw, an = memory_addresses(filters, plots, f, c)
    tau = dt / period
    for i in range(GROUPS):
        w, n = get(aw, i), get(an, i)
        Y, K, P = least_squares(get_information(ay, i), n, w, tau, model.c, model.size)
        put_information(ay, i, Y)
        if by_covariance:
            J = lane_matrices.get6(aj, i, GROUPS) + get4(aj, 6 * GROUPS + i, GROUPS)
            J, K, P = kalman(J, (K, P), n, w, tau, model)
            put6(aj, i, J, GROUPS)
            put4(aj, 6 * GROUPS + i, J[6:], GROUPS)
        put6(ap, i, P, GROUPS)
        put4(ax, i, updated_state(get4(ax, i, GROUPS), get(az, i), K, dt, period, model.c), GROUPS)

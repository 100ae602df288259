"""The Kalman filter of the state and of the carried error of the last plot."""

from typing import NamedTuple

from radarsim.kernels import kalman_algebra
from radarsim.kernels.compiler import inline
from radarsim.kernels.gap_noise import manoeuvre_noise
from radarsim.kernels.lane_matrices import choose3, choose6
from radarsim.kernels.lanes import full, where_greater
from radarsim.studies.sonar.kernels.least_squares import NOTHING_NEW

KALMAN_GAIN = (0.0, 0.0, 0.0)  # instead of a fixed gain


class Model(NamedTuple):
    """The model of a recursive filter for one coordinate and scan."""

    size: int  #: of the state, 2 or 3
    start: int  #: number of plots up to which the filter is least squares
    c: float  #: correlation
    q: float  #: manoeuvre variance
    gain: tuple[float, float, float]  #: of a filter of fixed gain, else KALMAN_GAIN


@inline
def predicted_joint(J, w, tau, model):
    """Predict the joint covariance: F J Fᵀ + Q; the error stays stationary, with variance 1 / w."""
    ones, zeros, c, F = full(1.0), full(0.0), model.c, kalman_algebra.constant_acceleration(tau)
    P = kalman_algebra.predict_covariance(J[:6], F, manoeuvre_noise(model.q, tau, 1.0, model.size))
    e = kalman_algebra.predict_state(J[6:9], F)
    return (*P, c * e[0], c * e[1], c * e[2], c * c * J[9] + (1.0 - c * c) / where_greater(w, zeros, w, ones))


@inline
def joint_gain(J, w, fixed):
    """Gain K (4), J Hᵀ (4) and S of an exact observation of value plus error, H = (1, 0, 0, 1); K is zero where missed.

    fixed (3) is the gain of a filter of fixed gain, or KALMAN_GAIN. Where value plus error is known already, a plot
    contains nothing new."""
    zeros, ones = full(0.0), full(1.0)
    h = (J[0] + J[6], J[1] + J[7], J[2] + J[8], J[6] + J[9])
    S = h[0] + h[3]
    detected = where_greater(w, zeros, where_greater(S, full(NOTHING_NEW), ones, zeros), zeros)
    per = detected / where_greater(S, full(NOTHING_NEW), S, ones)
    K = (h[0] * per, h[1] * per, h[2] * per, h[3] * per)
    if fixed[0] > 0.0:
        K = (fixed[0] * detected, fixed[1] * detected, fixed[2] * detected, zeros)
    return K, h, S


@inline
def updated_joint(J, K, h, S):
    """J - h Kᵀ - K hᵀ + K S Kᵀ with h = J Hᵀ, which is valid for any gain."""
    r = (K[0] * S - h[0], K[1] * S - h[1], K[2] * S - h[2], K[3] * S - h[3])
    e = (J[6] + K[0] * r[3] - h[0] * K[3], J[7] + K[1] * r[3] - h[1] * K[3], J[8] + K[2] * r[3] - h[2] * K[3])
    return (*kalman_algebra.correct_covariance(J[:6], h, K, S), *e, J[9] + K[3] * r[3] - h[3] * K[3])


@inline
def kalman(J, start, n, w, tau, model):
    """Update the Kalman filter with one scan: joint covariance J (10), gain K (4) and covariance P (6).

    start (K (4), P (6)) are those of least squares, which apply up to the model's start. Just after a plot its value
    plus error is known exactly, so the covariances of the error are those of the state with opposite sign. The paper's
    step 4 lacks a plus."""
    zero, first, carried = full(0.0), full(float(model.start)), 1.0 if model.c != 0.0 else 0.0
    K_start, P_start = start
    J = predicted_joint(J, w, tau, model)
    K, h, S = joint_gain(J, w, model.gain)
    J = updated_joint(J, K, h, S)
    P = choose6(first, n, P_start, J[:6])
    e = choose3(first, n, (zero - P[0], zero - P[1], zero - P[2]), J[6:9])
    ee = where_greater(first, n, P[0], J[9])
    K_new = choose3(first, n, K_start[:3], K[:3])
    return (*P, *e, ee), (*K_new, where_greater(first, n, K_start[3], carried * K[3])), P

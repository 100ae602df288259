"""The update of tracks of range and bearing with associated plots, eight tracks at a time.

Letters as in `track_prediction`."""

from radarsim.kernels import lanes
from radarsim.kernels.compiler import inline, kernel
from radarsim.kernels.kalman_algebra import add_outer, constant_acceleration, predict_state, take_value
from radarsim.kernels.lane_matrices import choose3, choose6, get3, get4, get6, put4, put6
from radarsim.kernels.lanes import address, full, get, put
from radarsim.studies.sonar.clutter.kernels.track_prediction import (
    LEAST_SQUARES_PLOTS,
    predict_cross_covariance,
    predict_line_covariance,
)
from radarsim.studies.sonar.kernels import steps
from radarsim.studies.sonar.kernels.chunks import GROUPS
from radarsim.studies.sonar.kernels.least_squares import least_squares
from radarsim.studies.sonar.kernels.steps import get_information


@inline
def update_line(P, start, n, w):
    """Gain K (3) and covariance P (6) of a line after a plot; start is (K, P) by least squares."""
    P, K, _ = take_value(P, 1.0, w)
    start_plots = full(LEAST_SQUARES_PLOTS)
    return choose3(start_plots, n, start[0][:3], K), choose6(start_plots, n, start[1], P)


@inline
def transpose(C):
    """Cᵀ: the covariance between the lines in the other order."""
    return C[0], C[2], C[1], C[3]


@inline
def update_pair(P, P_other, C, start, n, w):
    """Update both lines with a plot of one of them.

    Returns the gains K and K_other (2), the covariances P and P_other (6), and the covariance C (4) between the lines.
    P belongs to the line that has the plot, start is its (K, P) by least squares; C is that line by the other."""
    h = (C[0], C[1])  # covariance of the measured value with the other line
    scale = w / (P[0] + 1.0)
    K, P = update_line(P, start, n, w)
    K_other = (h[0] * scale, h[1] * scale)
    P_other = add_outer(P_other, full(0.0) - scale, (h[0], h[1], 0.0))
    C = (C[0] - K[0] * h[0], C[1] - K[0] * h[1], C[2] - K[1] * h[0], C[3] - K[1] * h[1])
    return K, K_other, P, P_other, C


@inline
def add_scatter(P, K, L, V):
    """Add [K L] V [K L]ᵀ to the covariance P (6) of a line; K and L are its gains (2) for the two innovations."""
    u0, u1 = V[0] * K[0] + V[1] * L[0], V[0] * K[1] + V[1] * L[1]
    v0, v1 = V[1] * K[0] + V[2] * L[0], V[1] * K[1] + V[2] * L[1]
    xx, xv, vv = P[0] + u0 * K[0] + v0 * L[0], P[1] + u0 * K[1] + v0 * L[1], P[3] + u1 * K[1] + v1 * L[1]
    return xx, xv, P[2], vv, P[4], P[5]


@inline
def add_scatter_between(C, K_r, K_b, V):
    """Add [K_rr K_rb] V [K_br K_bb]ᵀ to the covariance C (4) between the lines; K_r, K_b are these pairs of gains."""
    (K_rr, K_rb), (K_br, K_bb) = K_r, K_b
    u0, u1 = V[0] * K_br[0] + V[1] * K_bb[0], V[0] * K_br[1] + V[1] * K_bb[1]
    v0, v1 = V[1] * K_br[0] + V[2] * K_bb[0], V[1] * K_br[1] + V[2] * K_bb[1]
    return (
        C[0] + K_rr[0] * u0 + K_rb[0] * v0,
        C[1] + K_rr[0] * u1 + K_rb[0] * v1,
        C[2] + K_rr[1] * u0 + K_rb[1] * v0,
        C[3] + K_rr[1] * u1 + K_rb[1] * v1,
    )


@inline
def update_jointly(P, C, starts, n, w, V):
    """Update both lines with a plot that may not be the target's.

    Returns the gains (K_rr, K_br, K_rb, K_bb), the covariances (P_r, P_b), and C. The range of the plot is processed
    first, then its bearing: K_rb and K_bb are gains for the part of the innovation in bearing that the innovation in
    range does not explain. starts are (K, P) of both lines by least squares."""
    K_rr, K_br, P_r, P_b, C = update_pair(P[0], P[1], C, starts[0], n, w)
    K_bb, K_rb, P_b, P_r, C = update_pair(P_b, P_r, transpose(C), starts[1], n, w)
    # Gains for the two innovations, both processed at once.
    K_r = ((K_rr[0] - K_rb[0] * K_br[0], K_rr[1] - K_rb[1] * K_br[0]), K_rb)
    K_b = ((K_br[0] - K_bb[0] * K_br[0], K_br[1] - K_bb[1] * K_br[0]), K_bb)
    P_r, P_b = add_scatter(P_r, K_r[0], K_r[1], V), add_scatter(P_b, K_b[0], K_b[1], V)
    return (K_rr, K_br, K_rb, K_bb), (P_r, P_b), add_scatter_between(transpose(C), K_r, K_b, V)


@kernel
def update(tracks, dt, period, sigma, manoeuvre, joint, association):
    """Update all tracks with one scan, in place; association (6, CHUNK) is what `association.associate` writes.

    Its rows: 1 if a plot is taken, else 0; innovations in range and bearing; V (rr, rb, bb), in m and rad. joint: V may
    differ from zero."""
    ar, ab, pr, pb = address(tracks.x[0]), address(tracks.x[1]), address(tracks.P[0]), address(tracks.P[1])
    yr, yb, ac, an = address(tracks.Y[0]), address(tracks.Y[1]), address(tracks.C), address(tracks.plots)
    az, tau, per, F = address(association), dt / period, 1.0 / period, constant_acceleration(dt)
    r_per_b, b_per_r, per_r, per_b = sigma[0] / sigma[1], sigma[1] / sigma[0], 1.0 / sigma[0], 1.0 / sigma[1]
    for i in range(GROUPS):
        n, w, nu_r, nu_b = get(an, i), get(az, i), get(az, GROUPS + i), get(az, 2 * GROUPS + i)
        (r, vr, _), (b, vb, _) = predict_state(get3(ar, i, GROUPS), F), predict_state(get3(ab, i, GROUPS), F)
        Y_r, K_start_r, P_start_r = least_squares(get_information(yr, i), n, w, tau, 0.0, 2)
        Y_b, K_start_b, P_start_b = least_squares(get_information(yb, i), n, w, tau, 0.0, 2)
        P_r = predict_line_covariance(get6(pr, i, GROUPS), n, tau, manoeuvre[0])
        P_b = predict_line_covariance(get6(pb, i, GROUPS), n, tau, manoeuvre[1])
        if joint:
            rr, rb = per_r * per_r * get(az, 3 * GROUPS + i), per_r * per_b * get(az, 4 * GROUPS + i)
            V = (rr, rb, per_b * per_b * get(az, 5 * GROUPS + i))
            starts = ((K_start_r, P_start_r), (K_start_b, P_start_b))
            C = predict_cross_covariance(get4(ac, i, GROUPS), tau)
            K, (P_r, P_b), C = update_jointly((P_r, P_b), C, starts, n, w, V)
            K_rr, K_br, K_rb, K_bb = K
            put4(ac, i, C, GROUPS)
            nu_b = nu_b - (b_per_r * K_br[0]) * nu_r
            r, vr = r + (r_per_b * K_rb[0]) * nu_b, vr + (per * r_per_b * K_rb[1]) * nu_b
            b, vb = b + (b_per_r * K_br[0]) * nu_r, vb + (per * b_per_r * K_br[1]) * nu_r
        else:
            K_rr, P_r = update_line(P_r, (K_start_r, P_start_r), n, w)
            K_bb, P_b = update_line(P_b, (K_start_b, P_start_b), n, w)
        put(ar, i, r + K_rr[0] * nu_r)
        put(ar, GROUPS + i, vr + per * K_rr[1] * nu_r)
        put(ab, i, b + K_bb[0] * nu_b)
        put(ab, GROUPS + i, vb + per * K_bb[1] * nu_b)
        put6(pr, i, P_r, GROUPS)
        put6(pb, i, P_b, GROUPS)
        steps.put_information(yr, i, Y_r)
        steps.put_information(yb, i, Y_b)
        put(an, i, n + lanes.where_greater(w, full(0.0), full(1.0), full(0.0)))

"""P1's filters over a recorded track, at uneven times with missing values."""

from radarsim.kernels import kalman_algebra
from radarsim.kernels.compiler import inline, kernel


@inline
def noise_over(noise, t):
    """Q, packed, over a time t (s), of the coefficients (2, 6) that `filter_design.noise_by_time` gives."""
    t2, a, b = t * t, noise[0], noise[1]
    t3 = t2 * t
    return (
        (a[0] + b[0] * t) * (t3 * t2),
        (a[1] + b[1] * t) * (t2 * t2),
        (a[2] + b[2] * t) * t3,
        (a[3] + b[3] * t) * t3,
        (a[4] + b[4] * t) * t2,
        (a[5] + b[5] * t) * t,
    )


@kernel
def filter_rows(x, P, dt, z, detected, variance, noise, estimate, spread, nis):
    """Go through n rows: state x (3,), its packed covariance P (6,) before the first of them, in place.

    dt (n,) s since the row before; z (n, 2) value and rate, detected (n, 2) 1 where the filter takes it, else 0;
    variance (2,) of the plots; noise (2, 6) as in `noise_over`. Out: estimate (n, 3), spread (n, 3) the believed
    standard deviations, nis (n, 2) the squared innovation over its variance, where the number came."""
    state, covariance = (x[0], x[1], x[2]), (P[0], P[1], P[2], P[3], P[4], P[5])
    for k in range(dt.size):
        F = kalman_algebra.constant_acceleration(dt[k])
        state, covariance = (
            kalman_algebra.predict_state(state, F),
            kalman_algebra.predict_covariance(covariance, F, noise_over(noise, dt[k])),
        )
        for m in range(2):
            if detected[k, m] > 0.0:
                covariance, gain, S = (
                    kalman_algebra.take_value(covariance, variance[0], 1.0)
                    if m == 0
                    else kalman_algebra.take_rate(covariance, variance[1], 1.0)
                )
                e = z[k, m] - (state[0] if m == 0 else state[1])
                state, nis[k, m] = kalman_algebra.add_scaled(state, e, gain), e * e / S
        estimate[k, 0], estimate[k, 1], estimate[k, 2] = state
        spread[k, 0], spread[k, 1], spread[k, 2] = covariance[0] ** 0.5, covariance[3] ** 0.5, covariance[5] ** 0.5
    x[0], x[1], x[2] = state
    P[0], P[1], P[2], P[3], P[4], P[5] = covariance

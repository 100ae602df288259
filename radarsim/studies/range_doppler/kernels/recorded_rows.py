"""P1's filters over a recorded track, at uneven times with missing values."""

from radarsim.kernels import gap_noise, kalman_algebra
from radarsim.kernels.compiler import inline, kernel


@inline
def noise_over(noise, t):
    """Q, packed, over a time t (s), of the numbers (4,) that `filter_design.noise_by_time` gives."""
    jerk = gap_noise.manoeuvre_noise(noise[1], t, noise[0], 3)
    steps = gap_noise.acceleration_step_noise(noise[2], t, noise[0])
    white = gap_noise.white_jerk_noise(noise[3], t)
    return (
        jerk[0] + steps[0] + white[0],
        jerk[1] + steps[1] + white[1],
        jerk[2] + steps[2] + white[2],
        jerk[3] + steps[3] + white[3],
        jerk[4] + steps[4] + white[4],
        jerk[5] + steps[5] + white[5],
    )


@kernel
def fill_noise(noise, dt, Q):
    """Fill in Q (n, 6), packed, over times dt (n,), of the numbers noise (4,) as in `noise_over`."""
    for k in range(dt.size):
        Q[k, 0], Q[k, 1], Q[k, 2], Q[k, 3], Q[k, 4], Q[k, 5] = noise_over(noise, dt[k])


@kernel
def filter_rows(x, P, last_t, t, z, detected, variance, noise, estimate, spread, nis):
    """Go through n rows: state x (3,), its packed covariance P (6,) and time last_t (1,) at the last row with a number
    before them, in place. After a row without a number they stay, so that it is as if there were no row.

    t (n,) s; z (n, 2) value and rate, detected (n, 2) 1 where the filter takes it, else 0; variance (2,) of the plots;
    noise (4,) as in `noise_over`. Out: estimate (n, 3), spread (n, 3) the believed standard deviations, nis (n, 2) the
    squared innovation over its variance, where the number came."""
    for k in range(t.size):
        dt = t[k] - last_t[0]
        F = kalman_algebra.constant_acceleration(dt)
        state = kalman_algebra.predict_state((x[0], x[1], x[2]), F)
        covariance = kalman_algebra.predict_covariance((P[0], P[1], P[2], P[3], P[4], P[5]), F, noise_over(noise, dt))
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
        if detected[k, 0] + detected[k, 1] > 0.0:
            last_t[0] = t[k]
            x[0], x[1], x[2] = state
            P[0], P[1], P[2], P[3], P[4], P[5] = covariance

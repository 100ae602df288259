"""A linear filter over one recorded track at uneven times with missing values: one row after the other.

The state is value, rate and second rate. Value and rate are measured independently, so a plot is taken in one number
after the other, which needs no inverse; the result is that of the joint update of `filters.linear`.
"""

import numpy as np

from radarsim.kernels.compile import kernel


@kernel
def filter_rows(x, P, dt, z, detected, variance, noise, estimate, spread, nis):
    """Go through n rows, in place: state x (3,), its covariance P (3, 3) before the first of them.

    dt (n,) s since the row before; z (n, 2) value and rate, detected (n, 2) 1 where the filter takes it, else 0;
    variance (2,) of the plots; noise (2, 3, 3): a time t adds noise[0, i, j] t^(5 - i - j) + noise[1, i, j]
    t^(6 - i - j) to P. Out: estimate (n, 3), spread (n, 3) the believed standard deviations, nis (n, 2) the squared
    innovation over its variance, where the number came.
    """
    F, M, power = P.copy(), P.copy(), np.ones(7)
    for k in range(dt.size):
        t = dt[k]
        x[0] += t * (x[1] + 0.5 * t * x[2])
        x[1] += t * x[2]
        F[:, :] = 0.0
        F[0, 0] = F[1, 1] = F[2, 2] = 1.0
        F[0, 1] = F[1, 2] = t
        F[0, 2] = 0.5 * t * t
        for i in range(3):
            for j in range(3):
                M[i, j] = F[i, 0] * P[0, j] + F[i, 1] * P[1, j] + F[i, 2] * P[2, j]
        for n in range(1, 7):
            power[n] = power[n - 1] * t
        for i in range(3):
            for j in range(3):
                grown = noise[0, i, j] * power[5 - i - j] + noise[1, i, j] * power[6 - i - j]
                P[i, j] = M[i, 0] * F[j, 0] + M[i, 1] * F[j, 1] + M[i, 2] * F[j, 2] + grown
        for m in range(2):
            if detected[k, m] > 0.0:
                S = P[m, m] + variance[m]
                innovation = z[k, m] - x[m]
                nis[k, m] = innovation * innovation / S
                a, b, c = P[0, m] / S, P[1, m] / S, P[2, m] / S
                x[0] += a * innovation
                x[1] += b * innovation
                x[2] += c * innovation
                # (I - K h) P (I - K h)' + K R K', which stays positive whatever the rounding.
                F[:, :] = 0.0
                F[0, 0] = F[1, 1] = F[2, 2] = 1.0
                F[0, m] -= a
                F[1, m] -= b
                F[2, m] -= c
                for i in range(3):
                    for j in range(3):
                        M[i, j] = F[i, 0] * P[0, j] + F[i, 1] * P[1, j] + F[i, 2] * P[2, j]
                for i in range(3):
                    for j in range(3):
                        k_i = a if i == 0 else (b if i == 1 else c)
                        k_j = a if j == 0 else (b if j == 1 else c)
                        own = M[i, 0] * F[j, 0] + M[i, 1] * F[j, 1] + M[i, 2] * F[j, 2]
                        P[i, j] = own + variance[m] * k_i * k_j
                for i in range(3):
                    for j in range(i):
                        P[i, j] = P[j, i] = 0.5 * (P[i, j] + P[j, i])
        for i in range(3):
            estimate[k, i] = x[i]
            spread[k, i] = P[i, i] ** 0.5

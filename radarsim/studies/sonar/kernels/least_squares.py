"""Recursive least squares in information form."""

from radarsim.kernels import kalman_algebra
from radarsim.kernels.compiler import inline
from radarsim.kernels.lanes import full, where_greater
from radarsim.studies.sonar.kernels.normal_equations import leading_inverse

NOTHING_NEW = 1e-12  # of a plot's variance: less is rounding


@inline
def least_squares(Y, n, w, tau, c, size):
    """Recursive least squares of one scan on differences of plots: information Y (8), gain K (4), covariance P (6).

    The observation is the plot less c times the last one (after P3 eq. 15), c to the power of their distance, with the
    row H = H₀ - c H₀ F(-age) and R = 1 - c²; with c = 0 it is the plot itself. With fewer plots than unknowns a
    polynomial of lower degree is determined. A plot at the very time of the last one contains nothing new of an error
    that is correlated."""
    ones, zeros = full(1.0), full(0.0)
    age, c_last = Y[6] + tau, Y[7] * c
    new = 1.0 - c_last * c_last
    w_new = where_greater(new, full(NOTHING_NEW), w / new, zeros)
    second = -0.5 if size == 3 else 0.0
    H = (1.0 - c_last, c_last * age, second * (c_last * age) * age)
    Y = kalman_algebra.add_outer(kalman_algebra.predict_information(Y[:6], tau), w_new, H)
    rank, full_rank = n + where_greater(w, zeros, ones, zeros), full(float(size))
    P = leading_inverse(Y, where_greater(rank, full_rank, full_rank, rank))
    k0, k1, k2 = kalman_algebra.times(P, (w_new * H[0], w_new * H[1], w_new * H[2]))
    carried = 1.0 if c != 0.0 else 0.0
    k3 = carried * where_greater(w_new, zeros, 1.0 - k0, zeros)
    age, c_last = where_greater(w, zeros, zeros, age), where_greater(w, zeros, ones, c_last)
    return (*Y, age, c_last), (k0, k1, k2, k3), P

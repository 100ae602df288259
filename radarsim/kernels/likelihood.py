"""The log-likelihood of one recorded track, from the innovations of its Kalman filter (Schweppe 1965).

Letters as in the book: x state, P its covariance, F transition, Q process noise of unit variance, h the row of a number
that was measured, S variance of its innovation e, K = p / S gain with p = P h. A plot is taken in one number after the
other, each with an error of its own.

An outlier is a number whose σ is OUTLIER_FACTOR times the configured one; each is one with the probability `share`. The
two explanations of x and P are merged by moments (GPB1).

Errors that last from plot to plot are states of their own (`with_lasting_errors`), each of the first order: its
correlation falls with time as a power."""

import numpy as np

from radarsim.kernels.compiler import kernel

OUTLIER_FACTOR = 10.0


@kernel
def log_likelihood(x, P, F, Q, H, z, variance, present, manoeuvre, share, white, log_densities):
    """The log-likelihood of n rows of m numbers, for a state of d components.

    x (d,) and P (d, d) are what is known at the first row, and are overwritten; F, Q (n, d, d): transition to each row
    and what the manoeuvre of unit variance adds; H (n, m, d), z, variance (n, m): the numbers, where `present`;
    manoeuvre: its variance; share: of outliers; white: 1, or 0 where the errors are states. Out: log_densities (n, m),
    the logarithm of each number's density given those before it, zero where it is missing."""
    product, p = np.zeros_like(P), np.zeros_like(x)
    for k in range(z.shape[0]):
        if k > 0:
            extrapolate(x, P, product, p, F[k], Q[k], manoeuvre)
        for j in range(z.shape[1]):
            log_densities[k, j] = 0.0
            if present[k, j]:
                e, spread = innovation(x, P, H[k, j], z[k, j], p)
                log_densities[k, j] = take_number(x, P, p, e, spread + white * variance[k, j], variance[k, j], share)


@kernel
def innovation(x, P, h, z, p):
    """The innovation z - h x of a number, and the part h P h' of its variance; p (d,) takes P h'."""
    e, spread, d = z, 0.0, x.size
    for a in range(d):
        e -= h[a] * x[a]
        p[a] = 0.0
        for b in range(d):
            p[a] += P[a, b] * h[b]
    for a in range(d):
        spread += h[a] * p[a]
    return e, spread


@kernel
def extrapolate(x, P, product, predicted_x, F, Q, manoeuvre):
    """x = F x and P = F P F' + manoeuvre Q, in place; product (d, d) and predicted_x (d,) are work arrays.

    P stays symmetric to the last digit, here and in `take`: a difference between its halves grows from row to row."""
    d = x.size
    for a in range(d):
        predicted_x[a] = 0.0
        for b in range(d):
            predicted_x[a] += F[a, b] * x[b]
            product[a, b] = 0.0
            for c in range(d):
                product[a, b] += F[a, c] * P[c, b]
    for a in range(d):
        x[a] = predicted_x[a]
        for b in range(a + 1):
            P[a, b] = manoeuvre * Q[a, b]
            for c in range(d):
                P[a, b] += product[a, c] * F[b, c]
            P[b, a] = P[a, b]


@kernel
def take_number(x, P, p, e, S, variance, share):
    """Update x and P in place by a number with innovation e of variance S; returns the logarithm of its density.

    variance: of the number's error; that of an outlier is FACTOR² times as large."""
    T = S + (OUTLIER_FACTOR * OUTLIER_FACTOR - 1.0) * variance
    plain = np.log(1.0 - share) - 0.5 * (np.log(2.0 * np.pi * S) + e * e / S)
    density, w, v = plain, 1.0, 0.0
    if share > 0.0:
        wide = np.log(share) - 0.5 * (np.log(2.0 * np.pi * T) + e * e / T)
        larger = max(plain, wide)
        density = larger + np.log(np.exp(plain - larger) + np.exp(wide - larger))
        w, v = np.exp(plain - density), np.exp(wide - density)
    gain = w / S + v / T
    difference = 1.0 / S - 1.0 / T
    shrink = gain - w * v * e * e * difference * difference
    for a in range(x.size):
        x[a] += gain * e * p[a]
        for b in range(a + 1):
            P[a, b] -= shrink * p[a] * p[b]
            P[b, a] = P[a, b]
    return density


def with_lasting_errors(x, P, with_errors, F, Q, H, variance, correlation):
    """The arguments x, P, F, Q and H of `log_likelihood`, white 0 and manoeuvre 1, for errors that last: after the d
    components of the state come m errors of the numbers, in their standard deviations.

    x (d,) and P (d, d) at the first row, there with_errors (d, m) their covariance with the errors; F, Q (n, d, d): Q
    of the manoeuvre as it is; H (n, m, d), variance (n, m); correlation (n,): of errors with those of the row before.
    """
    n, m, d = H.shape
    errors, eye = slice(d, d + m), np.eye(m)
    state, wide = np.append(x, np.zeros(m)), np.block([[P, with_errors], [with_errors.T, eye]])
    F_, Q_ = np.zeros((n, d + m, d + m)), np.zeros((n, d + m, d + m))
    F_[:, :d, :d], Q_[:, :d, :d] = F, Q
    F_[:, errors, errors] = correlation[:, None, None] * eye
    Q_[:, errors, errors] = (1 - correlation**2)[:, None, None] * eye
    return state, wide, F_, Q_, np.concatenate([H, np.sqrt(variance)[:, :, None] * eye], axis=2)

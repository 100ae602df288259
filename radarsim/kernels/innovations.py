"""The logarithm of the likelihood of one recorded track, from the innovations of its Kalman filter (Schweppe 1965).

Letters as in the book: x state, P its covariance, F transition, Q process noise of unit variance, h the row of a number
that was measured, S variance of its innovation e, K = p / S gain with p = P h. A plot is taken in one number after the
other, each with an error of its own.

An outlier is a number whose σ is FACTOR times the stated one; each is one with the probability `share`. What the two
explanations leave of x and P is merged by moments (GPB1).

Errors that last from plot to plot are states of their own (`lasting`), each of the first order: its correlation falls
with time as a power.
"""

import numpy as np

from radarsim.kernels.compile import kernel

FACTOR = 10.0


@kernel
def log_likelihood(x, P, F, Q, H, z, variance, there, manoeuvre, share, white, score):
    """The log-likelihood of n rows of m numbers, for a state of d components.

    x (d,) and P (d, d) are what is known at the first row, and are overwritten; F, Q (n, d, d): transition to each row
    and what the manoeuvre of unit variance adds; H (n, m, d), z, variance (n, m): the numbers, where `there`;
    manoeuvre: its variance; share: of outliers; white: 1, or 0 where the errors are states. Out: score (n, m), the
    logarithm of each number's density given those before it, zero where it is not there.
    """
    d, room, p = x.size, np.zeros_like(P), np.zeros_like(x)
    for k in range(z.shape[0]):
        if k > 0:
            extrapolate(x, P, room, p, F[k], Q[k], manoeuvre)
        for j in range(z.shape[1]):
            score[k, j] = 0.0
            if there[k, j]:
                e, spread = z[k, j], 0.0
                for a in range(d):
                    e -= H[k, j, a] * x[a]
                    p[a] = 0.0
                    for b in range(d):
                        p[a] += P[a, b] * H[k, j, b]
                for a in range(d):
                    spread += H[k, j, a] * p[a]
                score[k, j] = take(x, P, p, e, spread + white * variance[k, j], variance[k, j], share)


@kernel
def extrapolate(x, P, room, moved, F, Q, manoeuvre):
    """x = F x and P = F P F' + manoeuvre Q, in place; room (d, d) and moved (d,) are for the sums.

    P stays symmetric to the last digit, here and in `take`: what its halves differ by grows from row to row.
    """
    d = x.size
    for a in range(d):
        moved[a] = 0.0
        for b in range(d):
            moved[a] += F[a, b] * x[b]
            room[a, b] = 0.0
            for c in range(d):
                room[a, b] += F[a, c] * P[c, b]
    for a in range(d):
        x[a] = moved[a]
        for b in range(a + 1):
            P[a, b] = manoeuvre * Q[a, b]
            for c in range(d):
                P[a, b] += room[a, c] * F[b, c]
            P[b, a] = P[a, b]


@kernel
def take(x, P, p, e, S, variance, share):
    """Take in a number of innovation e, of variance S: x, P in place; variance: of its error, which that of an outlier
    is FACTOR² times as large as. The logarithm of its density."""
    T = S + (FACTOR * FACTOR - 1.0) * variance
    plain = np.log(1.0 - share) - 0.5 * (np.log(2.0 * np.pi * S) + e * e / S)
    density, w, v = plain, 1.0, 0.0
    if share > 0.0:
        wide = np.log(share) - 0.5 * (np.log(2.0 * np.pi * T) + e * e / T)
        most = max(plain, wide)
        density = most + np.log(np.exp(plain - most) + np.exp(wide - most))
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


def lasting(x, P, with_errors, F, Q, H, variance, correlation):
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

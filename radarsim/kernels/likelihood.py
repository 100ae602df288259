"""The log-likelihood of one recorded track, from the innovations of its Kalman filter (Schweppe 1965).

Letters as in the book: x state, P its covariance, F transition, Q process noise of unit variance, h the row of a number
that was measured, S variance of its innovation e, K = p / S gain with p = P h. A plot is taken in one number after the
other, each with an error of its own.

An outlier is a number whose error follows another law. It is near: off by some σ to either side, and spread about that.
A law without the offset has most of its mass among the sound numbers: it takes these for outliers, and σ is too small.
Or it is far, of any size: the logarithm of its σ is uniform between FAR_WIDTH times the stated one and the span of the
data, taken at FAR_COUNT values. One law of one width would lift σ with the size of the farthest. A hard manoeuvre is an
interval in which the process noise is HARD_FACTOR times as large. The explanations of x and P are merged by moments
(GPB1).

Errors that last from plot to plot are states of their own (`with_lasting_errors`), each of the first order: its
correlation falls with time as a power."""

import numpy as np

from radarsim.kernels.compiler import inline, kernel

FAR_WIDTH = 10.0  # the least of far outliers, in σ of a number
FAR_COUNT = 6  # widths of far outliers
LAW_COUNT = 3 + FAR_COUNT  # of errors: the stated one, those of near outliers to either side, those of far ones
LOG_DENSITY, VARIANCE, MEAN = range(3)  # rows of the laws at an innovation: with the probability of each law
HARD_FACTOR = 100.0  # on the process noise in a hard manoeuvre
NEAR, FAR, OFFSET, SPREAD = range(4)  # of an outlier law: the shares, and offset and spread of near outliers in σ


@kernel
def log_likelihood(
    x, P, F, Q, H, z, variance, present, manoeuvre, outliers, first, hard_share, span, white, log_densities, soundness
):
    """The log-likelihood of n rows of m numbers, for a state of d components.

    x (d,) and P (d, d) are what is known at the first row, and are overwritten; F, Q (n, d, d): transition to each row
    and what the manoeuvre of unit variance adds; H (n, m, d), z, variance (n, m): the numbers, where `present`;
    manoeuvre: its variance; outliers (m, 4): the law of outliers of each number, from row `first` on. Earlier rows find
    the state: gross errors are left out of them, and the rest are taken with the mean square of all errors, since
    before the state is known an outlier is as likely as anything. hard_share: of hard manoeuvres among the intervals;
    span (m,): of the data; white: 1, or 0 where the errors are states.
    Out: log_densities (n, m), the logarithm of each number's density given those before it, zero where it is missing;
    soundness (n, m): the probability that it is no outlier."""
    product, p, laws = np.zeros_like(P), np.zeros_like(x), np.empty((3, LAW_COUNT))
    numbers = H, z, variance, present, outliers, first, span, white, p, laws
    hard_x, hard_P = x.copy(), P.copy()
    hard_scores, hard_soundness = np.empty_like(log_densities[:1]), np.empty_like(soundness[:1])
    for k in range(z.shape[0]):
        may_be_hard = k > 0 and hard_share > 0.0
        if may_be_hard:
            hard_x[:], hard_P[:] = x, P
            extrapolate(hard_x, hard_P, product, p, F[k], Q[k], HARD_FACTOR * manoeuvre)
            take_row(hard_x, hard_P, numbers, k, hard_scores, hard_soundness, 0)
        if k > 0:
            extrapolate(x, P, product, p, F[k], Q[k], manoeuvre)
        take_row(x, P, numbers, k, log_densities, soundness, k)
        if may_be_hard:
            calm = np.log(1.0 - hard_share) + log_densities[k].sum()
            hard = np.log(hard_share) + hard_scores.sum()
            total = max(calm, hard) + np.log1p(np.exp(-abs(calm - hard)))
            log_densities[k, 0] += total - log_densities[k].sum()
            merge_states(x, P, hard_x, hard_P, np.exp(hard - total))


@kernel
def log_likelihood_of_tracks(
    lengths, x, P, F, Q, H, z, variance, present, manoeuvre, outliers, first, hard_share, span, white, log_densities,
    soundness
):  # fmt: skip
    """`log_likelihood` of several tracks, whose rows follow each other: of track i lengths[i], which starts from x[i]
    and P[i], and whose outliers follow their law from its row first[i] on."""
    b = 0
    for i in range(lengths.size):
        a, b = b, b + lengths[i]
        log_likelihood(
            x[i], P[i], F[a:b], Q[a:b], H[a:b], z[a:b], variance[a:b], present[a:b], manoeuvre, outliers, first[i],
            hard_share, span, white, log_densities[a:b], soundness[a:b]
        )  # fmt: skip


@inline
def take_row(x, P, numbers, k, log_densities, soundness, out):
    """Update x and P in place by the numbers of row k; fills row `out` of the logarithms of their densities and of
    their soundness.

    numbers: those of all rows as `log_likelihood` has them, and work arrays p (d,) and laws (3, LAW_COUNT). No view of
    a row is made, which would take longer than the row."""
    H, z, variance, present, outliers, first, span, white, p, laws = numbers
    for j in range(z.shape[1]):
        log_densities[out, j], soundness[out, j] = 0.0, 1.0
        if present[k, j]:
            e, spread = innovation(x, P, H, k, j, z[k, j], p)
            S = spread + white * variance[k, j]
            share = outliers[j, NEAR] + outliers[j, FAR]
            if share > 0.0 and k < first:
                S += (start_factor(outliers[j]) - 1.0) * variance[k, j]
            if share > 0.0 and k >= first:
                fill_laws(laws, e, S, variance[k, j], outliers[j], span[j])
                log_densities[out, j], soundness[out, j] = take_number_of_laws(x, P, p, e, laws)
            else:
                log_densities[out, j] = take_number(x, P, p, e, S)


@inline
def start_factor(outliers):
    """The factor on the variance of a number that starts a track, where it may be an outlier that is no gross error;
    outliers (4,): the law of these."""
    sizes = outliers[OFFSET] * outliers[OFFSET] + outliers[SPREAD] * outliers[SPREAD]
    return 1.0 + outliers[NEAR] * sizes + outliers[FAR] * (FAR_WIDTH * FAR_WIDTH - 1.0)


@inline
def innovation(x, P, H, k, j, z, p):
    """The innovation z - h x of a number, with h = H[k, j], and the part h P h' of its variance; p (d,) takes P h'."""
    e, spread, d = z, 0.0, x.size
    for a in range(d):
        e -= H[k, j, a] * x[a]
        p[a] = 0.0
        for b in range(d):
            p[a] += P[a, b] * H[k, j, b]
    for a in range(d):
        spread += H[k, j, a] * p[a]
    return e, spread


@inline
def extrapolate(x, P, product, predicted_x, F, Q, manoeuvre):
    """x = F x and P = F P F' + manoeuvre Q, in place; product (d, d) and predicted_x (d,) are work arrays.

    P stays symmetric to the last digit, here and in `take_number`: a difference between its halves grows from row to
    row."""
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


@inline
def take_number(x, P, p, e, S):
    """Update x and P in place by a number with innovation e of variance S; returns the logarithm of its density."""
    gain = 1.0 / S
    for a in range(x.size):
        x[a] += gain * e * p[a]
        for b in range(a + 1):
            P[a, b] -= gain * p[a] * p[b]
            P[b, a] = P[a, b]
    return -0.5 * (np.log(2.0 * np.pi * S) + e * e / S)


@kernel
def fill_laws(laws, e, S, variance, outliers, span):
    """Fill, for each law of a number's error, the logarithm of its probability and density at an innovation e, and its
    variance and mean of the innovation: S and 0 for the stated law, whose error has the given variance.

    laws (3, LAW_COUNT); outliers (4,): the law of outliers of the number."""
    near, far, offset = outliers[NEAR], outliers[FAR], outliers[OFFSET] * np.sqrt(variance)
    sides = 2.0 if offset > 0.0 else 1.0
    width = FAR_WIDTH * FAR_WIDTH
    ratio = max(span * span / (width * variance), 1.0) ** (1.0 / (FAR_COUNT - 1)) if far > 0.0 else 1.0
    for i in range(LAW_COUNT):
        laws[MEAN, i] = 0.0
        if i == 0:
            share, T = 1.0 - near - far, S
        elif i < 3:
            share, T = near / sides, S + outliers[SPREAD] * outliers[SPREAD] * variance
            laws[MEAN, i] = offset
            if i == 2:
                share, laws[MEAN, i] = share * (sides - 1.0), -offset
        else:
            share, T = far / FAR_COUNT, S + (width - 1.0) * variance
            width *= ratio
        laws[VARIANCE, i], laws[LOG_DENSITY, i], deviation = T, -np.inf, e - laws[MEAN, i]
        if share > 0.0:
            laws[LOG_DENSITY, i] = np.log(share) - 0.5 * (np.log(2.0 * np.pi * T) + deviation * deviation / T)


@kernel
def take_number_of_laws(x, P, p, e, laws):
    """As `take_number`, of an error that follows one of several laws; returns the logarithm of the number's density and
    the probability of the stated law."""
    larger, total, gain, pull, square = laws[LOG_DENSITY].max(), 0.0, 0.0, 0.0, 0.0
    for i in range(LAW_COUNT):
        if laws[LOG_DENSITY, i] > -np.inf:
            w = np.exp(laws[LOG_DENSITY, i] - larger)
            step = (e - laws[MEAN, i]) / laws[VARIANCE, i]
            total += w
            gain += w / laws[VARIANCE, i]
            pull += w * step
            square += w * step * step
    gain, pull, square = gain / total, pull / total, square / total
    shrink = gain - max(square - pull * pull, 0.0)
    for a in range(x.size):
        x[a] += pull * p[a]
        for b in range(a + 1):
            P[a, b] -= shrink * p[a] * p[b]
            P[b, a] = P[a, b]
    return larger + np.log(total), np.exp(laws[LOG_DENSITY, 0] - larger) / total


@kernel
def merge_states(x, P, other_x, other_P, weight):
    """Merge another state of the given weight into x and P, by moments, in place."""
    for a in range(x.size):
        for b in range(a + 1):
            spread = weight * (1.0 - weight) * (other_x[a] - x[a]) * (other_x[b] - x[b])
            P[a, b] = P[b, a] = (1.0 - weight) * P[a, b] + weight * other_P[a, b] + spread
    for a in range(x.size):
        x[a] += weight * (other_x[a] - x[a])


def with_lasting_errors(x, P, with_errors, F, Q, H, variance, correlation):
    """The arguments x, P, F, Q and H of `log_likelihood`, white 0 and manoeuvre 1, for errors that last: after the d
    components of the state come m errors of the numbers, in their standard deviations.

    x (…, d) and P (…, d, d) at the first row, there with_errors (d, m) their covariance with the errors; F, Q (n, d,
    d): Q of the manoeuvre as it is; H (n, m, d), variance (n, m); correlation (n,): of errors with those of the row
    before."""
    n, m, d = H.shape
    errors, eye = slice(d, d + m), np.eye(m)
    state = np.concatenate([x, np.zeros((*x.shape[:-1], m))], axis=-1)
    wide = np.zeros((*P.shape[:-2], d + m, d + m))
    wide[..., :d, :d], wide[..., :d, d:], wide[..., d:, :d], wide[..., d:, d:] = P, with_errors, with_errors.T, eye
    F_, Q_ = np.zeros((n, d + m, d + m)), np.zeros((n, d + m, d + m))
    F_[:, :d, :d], Q_[:, :d, :d] = F, Q
    F_[:, errors, errors] = correlation[:, None, None] * eye
    Q_[:, errors, errors] = (1 - correlation**2)[:, None, None] * eye
    return state, wide, F_, Q_, np.concatenate([H, np.sqrt(variance)[:, :, None] * eye], axis=2)

"""Filters of eight realisations over all scans: gains, the filters with one hypothesis, the one that merges.

A plot is taken range first, velocity after, which needs no inverse and gives the fold a prediction that knows the
range. Letters, each of eight lanes:

    x (3), P (6)   state (range, radial velocity, acceleration) and covariance, packed as in `kernels.algebra`
    F (5), Q (6)   motion over a scan
    S, g (3)       variance of an innovation, and its gains
    D              span of velocity

`design`, `plots`, `gains`, `out` are addresses.
"""

from radarsim.kernels.algebra import predicted, predicted_covariance
from radarsim.kernels.compile import inline, part
from radarsim.kernels.hypotheses import FARTHEST
from radarsim.kernels.lanes import any_greater, exponential, full, get, nearest, put, root, row, where_greater
from radarsim.studies.ambiguous_doppler.kernels.records import (
    BEST,
    COUNT,
    DETECTED,
    FIRST,
    GAINS,
    LISTED,
    MEAN,
    MOTION,
    NOISE,
    NONE,
    OUTPUT,
    PAIRED,
    PLOT,
    PRIOR,
    PROBABILITY,
    RANGE,
    RANGE_GAIN,
    REMAINDER,
    RIGHT,
    SOLVED,
    TAKES_VELOCITY,
    UNFOLDED,
    UNFOLDS,
    VARIANCE,
    VELOCITY,
    VELOCITY_GAIN,
    WEIGHT,
)


@inline
def motion(design):
    """F and Q of a design."""
    f, q = design, MOTION + NOISE
    return (f[0], f[1], f[2], f[3], f[4]), (f[q], f[q + 1], f[q + 2], f[q + 3], f[q + 4], f[q + 5])


@inline
def three(at, number):
    """Three rows."""
    return get(at, number), get(at, number + 1), get(at, number + 2)


@inline
def put_three(at, number, x):
    """Write three rows."""
    put(at, number, x[0])
    put(at, number + 1, x[1])
    put(at, number + 2, x[2])


@inline
def moved(x, g, e):
    """x + g e."""
    return x[0] + g[0] * e, x[1] + g[1] * e, x[2] + g[2] * e


@inline
def widened(P, g, variance):
    """P + variance g g', P packed: what is not known of an innovation that was taken with the gain g."""
    return (
        P[0] + g[0] * g[0] * variance,
        P[1] + g[0] * g[1] * variance,
        P[2] + g[0] * g[2] * variance,
        P[3] + g[1] * g[1] * variance,
        P[4] + g[1] * g[2] * variance,
        P[5] + g[2] * g[2] * variance,
    )


@inline
def range_taken(P, first, taken, variance):
    """Covariance after a range of that variance, 1/(2S) and gains; `first` (0 or 1) is a track's first, which sets it.

    S and R/S multiply what a difference of large numbers would leave: P - P₀ P₀ᵀ/S has P₀₀ R/S in its first row.
    """
    zero = full(0.0)
    S = P[0] + variance
    use = taken / S
    g = P[0] * use, P[1] * use, P[2] * use
    kept = where_greater(taken, zero, variance / S, full(1.0))
    P = (
        where_greater(first, zero, full(variance), P[0] * kept),
        where_greater(first, zero, zero, P[1] * kept),
        where_greater(first, zero, zero, P[2] * kept),
        P[3] - g[1] * P[1],
        P[4] - g[1] * P[2],
        P[5] - g[2] * P[2],
    )
    return P, 0.5 * use, g


@inline
def velocity_taken(P, taken, variance):
    """Covariance after a velocity of that variance, the innovation's variance S, and gains."""
    S = P[3] + variance
    use = taken / S
    g = P[1] * use, P[3] * use, P[4] * use
    kept = where_greater(taken, full(0.0), variance / S, full(1.0))
    P = P[0] - g[0] * P[1], P[1] * kept, P[2] - g[0] * P[4], P[3] * kept, P[4] * kept, P[5] - g[2] * P[4]
    return P, S, g


@inline
def prior(design):
    """Covariance before the first plot; the range is not in it."""
    zero = full(0.0)
    return zero, zero, zero, full(design[PRIOR]), zero, full(design[PRIOR + 1])


@part
def fill_gains(design, sigma, scans, plots, gains):
    """Gains of a design over all scans, of a filter whose folds are right: rows GAINS a scan; sigma (2,)."""
    F, Q = motion(design)
    P = prior(design)
    for k in range(scans):
        plot, to = row(plots, k * PLOT), row(gains, k * GAINS)
        detected, first = get(plot, DETECTED), get(plot, FIRST)
        if k > 0:
            P = predicted_covariance(P, F, Q)
        P, weight, g = range_taken(P, first, detected - first, sigma[0] * sigma[0])
        put(to, WEIGHT, weight)
        put_three(to, RANGE_GAIN, g)
        taken = get(plot, PAIRED) if design[TAKES_VELOCITY] > 1.0 else detected * design[TAKES_VELOCITY]
        P, S, g = velocity_taken(P, taken, sigma[1] * sigma[1])
        put(to, VARIANCE, S)
        put_three(to, VELOCITY_GAIN, g)


@inline
def with_range(x, plot, scan):
    """A state after a plot's range; the track's first sets it."""
    z = get(plot, RANGE)
    x = moved(x, three(scan, RANGE_GAIN), z - x[0])
    return where_greater(get(plot, FIRST), full(0.0), z, x[0]), x[1], x[2]


@inline
def whether_right(right, plot, taken, D):
    """`right` (0 or 1) where the velocity `taken`, folded back somehow, is the one that was folded; else 0."""
    off = get(plot, UNFOLDED) - taken
    off = where_greater(off, full(0.0), off, full(0.0) - off)
    return where_greater(off * get(plot, DETECTED), full(0.5 * D), full(0.0), right)


@inline
def put_single(to, x, right):
    """Output of a bank with one hypothesis."""
    put_three(to, MEAN, x)
    put_three(to, BEST, x)
    put(to, RIGHT, right)
    put(to, LISTED, right)
    put(to, COUNT, full(1.0))
    put(to, PROBABILITY, full(1.0))


@part
def run_single(kind, design, spans, plots, gains, out):
    """A bank with one hypothesis over all scans: of range alone, with the true folds, the nearest, or remainders.

    `right` of a remainder is that of its scan alone: it rests on two plots, and not on what was before.
    """
    F, _ = motion(design)
    zero = full(0.0)
    x, right = (zero, zero, zero), full(1.0)
    for k in range(spans.size):
        plot, scan, D = row(plots, k * PLOT), row(gains, k * GAINS), spans[k]
        x = with_range(predicted(x, F), plot, scan)
        if kind != NONE:
            u = get(plot, UNFOLDED)
            if kind == REMAINDER:
                right = whether_right(get(plot, PAIRED), plot, get(plot, SOLVED), D)
                u = get(plot, SOLVED)
            elif kind != UNFOLDS:
                z = get(plot, VELOCITY)
                u = z + D * nearest((x[1] - z) / D)
                right = whether_right(right, plot, u, D)
            x = moved(x, three(scan, VELOCITY_GAIN), u - x[1])
        put_single(row(out, k * OUTPUT), x, right)


@inline
def folds_merged(e, S, D):
    """Mean and variance of the innovation e + n D over all whole n, with weights exp(-(e + n D)²/2S); |e| <= D/2.

    And the sum of the weights over that of e.
    """
    total, mean, square = full(1.0), e, e * e
    limit, scale = root(S * FARTHEST), -0.5 / S
    n = 1.0
    while any_greater(limit + 0.5 * D, full(n * D)):
        for sign in (-1.0, 1.0):
            f = e + sign * n * D
            weight = exponential(scale * (f * f - e * e))
            total, mean, square = total + weight, mean + weight * f, square + weight * f * f
        n += 1.0
    mean = mean / total
    return mean, square / total - mean * mean, total


@part
def run_merged(design, sigma, spans, plots, out):
    """A bank that merges the folds of each scan into one state, over all scans (GPB1); its covariance is its own."""
    F, Q = motion(design)
    zero = full(0.0)
    x, P, right = (zero, zero, zero), prior(design), full(1.0)
    for k in range(spans.size):
        plot, D = row(plots, k * PLOT), spans[k]
        detected, first = get(plot, DETECTED), get(plot, FIRST)
        x = predicted(x, F)
        if k > 0:
            P = predicted_covariance(P, F, Q)
        P, _, g = range_taken(P, first, detected - first, sigma[0] * sigma[0])
        z = get(plot, RANGE)
        x = moved(x, g, z - x[0])
        x = where_greater(first, zero, z, x[0]), x[1], x[2]
        e = get(plot, VELOCITY) - x[1]
        e = e - D * nearest(e / D)
        right = whether_right(right, plot, x[1] + e, D)
        P, S, g = velocity_taken(P, detected, sigma[1] * sigma[1])
        mean, variance, _ = folds_merged(e, S, D)
        x = moved(x, g, mean)
        P = widened(P, g, variance)
        put_single(row(out, k * OUTPUT), x, right)

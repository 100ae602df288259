"""Filters of eight realisations over all scans: gains, the filters with one hypothesis, the one that merges.

A plot is taken range first, velocity after, which needs no inverse and gives the fold a prediction that knows the
range. Letters, each of eight lanes:

    x (3), P (6)   state (range, radial velocity, acceleration) and covariance, packed as in `kernels.algebra`
    F (5), Q (6)   motion over a scan
    S, g (3)       variance of an innovation, and its gains
    D              span of velocity

`design`, `plots`, `gains`, `out` are addresses.
"""

from radarsim.kernels.algebra import add_outer, add_scaled, predicted, predicted_covariance, take_rate, take_value
from radarsim.kernels.compile import inline, part
from radarsim.kernels.hypotheses import FARTHEST
from radarsim.kernels.lanes import (
    any_greater,
    choose3,
    exponential,
    full,
    get,
    get3,
    nearest,
    put,
    put3,
    root,
    row,
    where_greater,
)
from radarsim.studies.ambiguous_doppler.kernels import records as rec


@inline
def motion(design):
    """F and Q of a design."""
    f, q = design, rec.NOISE
    return (f[0], f[1], f[2], f[3], f[4]), (f[q], f[q + 1], f[q + 2], f[q + 3], f[q + 4], f[q + 5])


@inline
def range_taken(P, first, taken, variance):
    """Covariance after a range of that variance, its gain, and 1/(2S); `first` (0 or 1) is a track's first, which sets
    it."""
    zero = full(0.0)
    P, gain, S = take_value(P, variance, taken)
    of_range = choose3(first, zero, (full(variance), zero, zero), (P[0], P[1], P[2]))
    return (*of_range, P[3], P[4], P[5]), gain, 0.5 * taken / S


@inline
def prior(design):
    """Covariance before the first plot; the range is not in it."""
    zero = full(0.0)
    return zero, zero, zero, full(design[rec.PRIOR]), zero, full(design[rec.PRIOR + 1])


@part
def fill_gains(design, sigma, scans, plots, gains):
    """Gains of a design over all scans, of a filter whose folds are right: rows GAINS a scan; sigma (2,)."""
    F, Q = motion(design)
    P = prior(design)
    for k in range(scans):
        plot, to = row(plots, k * rec.PLOT), row(gains, k * rec.GAINS)
        detected, first = get(plot, rec.DETECTED), get(plot, rec.FIRST)
        if k > 0:
            P = predicted_covariance(P, F, Q)
        P, g, weight = range_taken(P, first, detected - first, sigma[0] * sigma[0])
        put(to, rec.WEIGHT, weight)
        put3(to, rec.RANGE_GAIN, g)
        taken = get(plot, rec.PAIRED) if design[rec.TAKES_VELOCITY] > 1.0 else detected * design[rec.TAKES_VELOCITY]
        P, g, S = take_rate(P, sigma[1] * sigma[1], taken)
        put(to, rec.VARIANCE, S)
        put3(to, rec.VELOCITY_GAIN, g)


@inline
def with_range(x, plot, scan):
    """A state after a plot's range; the track's first sets it."""
    z = get(plot, rec.RANGE)
    x = add_scaled(x, z - x[0], get3(scan, rec.RANGE_GAIN))
    return where_greater(get(plot, rec.FIRST), full(0.0), z, x[0]), x[1], x[2]


@inline
def whether_right(right, plot, taken, D):
    """`right` (0 or 1) where the velocity `taken`, folded back somehow, is the one that was folded; else 0."""
    off = get(plot, rec.UNFOLDED) - taken
    off = where_greater(off, full(0.0), off, full(0.0) - off)
    return where_greater(off * get(plot, rec.DETECTED), full(0.5 * D), full(0.0), right)


@inline
def put_single(to, x, right):
    """Output of a bank with one hypothesis."""
    put3(to, rec.MEAN, x)
    put3(to, rec.BEST, x)
    put(to, rec.RIGHT, right)
    put(to, rec.LISTED, right)
    put(to, rec.COUNT, full(1.0))
    put(to, rec.PROBABILITY, full(1.0))


@part
def run_single(kind, design, spans, plots, gains, out):
    """A bank with one hypothesis over all scans: of range alone, with the true folds, the nearest, or remainders.

    `right` of a remainder is that of its scan alone: it rests on two plots, and not on what was before.
    """
    F, _ = motion(design)
    zero = full(0.0)
    x, right = (zero, zero, zero), full(1.0)
    for k in range(spans.size):
        plot, scan, D = row(plots, k * rec.PLOT), row(gains, k * rec.GAINS), spans[k]
        x = with_range(predicted(x, F), plot, scan)
        if kind != rec.NONE:
            u = get(plot, rec.UNFOLDED)
            if kind == rec.REMAINDER:
                right = whether_right(get(plot, rec.PAIRED), plot, get(plot, rec.SOLVED), D)
                u = get(plot, rec.SOLVED)
            elif kind != rec.UNFOLDS:
                z = get(plot, rec.VELOCITY)
                u = z + D * nearest((x[1] - z) / D)
                right = whether_right(right, plot, u, D)
            x = add_scaled(x, u - x[1], get3(scan, rec.VELOCITY_GAIN))
        put_single(row(out, k * rec.OUTPUT), x, right)


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
        plot, D = row(plots, k * rec.PLOT), spans[k]
        detected, first = get(plot, rec.DETECTED), get(plot, rec.FIRST)
        x = predicted(x, F)
        if k > 0:
            P = predicted_covariance(P, F, Q)
        P, g, _ = range_taken(P, first, detected - first, sigma[0] * sigma[0])
        z = get(plot, rec.RANGE)
        x = add_scaled(x, z - x[0], g)
        x = where_greater(first, zero, z, x[0]), x[1], x[2]
        e = get(plot, rec.VELOCITY) - x[1]
        e = e - D * nearest(e / D)
        right = whether_right(right, plot, x[1] + e, D)
        P, g, S = take_rate(P, sigma[1] * sigma[1], detected)
        mean, variance, _ = folds_merged(e, S, D)
        x = add_scaled(x, mean, g)
        P = add_outer(P, variance, g)
        put_single(row(out, k * rec.OUTPUT), x, right)

"""Filters of eight realisations over all scans: gains, filters with one hypothesis, and the one that merges folds.

A plot is taken range first and velocity second: this needs no inverse, and the fold is chosen by a prediction that
includes the range. Letters, each of eight lanes:

    x (3), P (6)   state (range, radial velocity, acceleration) and covariance, packed as in `kernels.kalman_algebra`
    F (5), Q (6)   motion over a scan
    S, g (3)       variance of an innovation, and its gains
    D              span of velocity

`design`, `plots`, `gains`, `out` are addresses."""

from radarsim.kernels import lane_matrices, lanes
from radarsim.kernels.compiler import inline, kernel_part
from radarsim.kernels.hypotheses import MAX_SQUARED_DEVIATION
from radarsim.kernels.kalman_algebra import (
    add_outer,
    add_scaled,
    predict_covariance,
    predict_state,
    take_rate,
    take_value,
)
from radarsim.kernels.lane_matrices import put3
from radarsim.kernels.lanes import exponential, full, get, nearest, put, row, where_greater
from radarsim.studies.ambiguous_doppler.kernels import layout


@inline
def motion(design):
    """F and Q of a design."""
    f, q = design, layout.NOISE
    return (f[0], f[1], f[2], f[3], f[4]), (f[q], f[q + 1], f[q + 2], f[q + 3], f[q + 4], f[q + 5])


@inline
def update_by_range(P, first, detected, variance):
    """Covariance after a range of that variance, its gain, and 1/(2S).

    first, detected (0 or 1): whether it is the track's first, which sets the range; whether a later one is there."""
    zero = full(0.0)
    P, gain, S = take_value(P, variance, detected)
    range_covariances = lane_matrices.choose3(first, zero, (full(variance), zero, zero), (P[0], P[1], P[2]))
    return (*range_covariances, P[3], P[4], P[5]), gain, 0.5 * detected / S


@inline
def prior_covariance(design):
    """Covariance before the first plot, without the range."""
    zero = full(0.0)
    return zero, zero, zero, full(design[layout.PRIOR]), zero, full(design[layout.PRIOR + 1])


@kernel_part
def fill_gains(design, sigma, scans, plots, gains):
    """Fill in the gains of a design over all scans, with all folds right: GAINS rows a scan; sigma (2,)."""
    F, Q = motion(design)
    P = prior_covariance(design)
    for k in range(scans):
        plot, output = row(plots, k * layout.PLOT), row(gains, k * layout.GAINS)
        detected, first = get(plot, layout.DETECTED), get(plot, layout.FIRST)
        if k > 0:
            P = predict_covariance(P, F, Q)
        P, g, weight = update_by_range(P, first, detected - first, sigma[0] * sigma[0])
        put(output, layout.WEIGHT, weight)
        put3(output, layout.RANGE_GAIN, g)
        takes_velocity = (
            get(plot, layout.PAIRED)
            if design[layout.TAKES_VELOCITY] > 1.0
            else detected * design[layout.TAKES_VELOCITY]
        )
        P, g, S = take_rate(P, sigma[1] * sigma[1], takes_velocity)
        put(output, layout.VARIANCE, S)
        put3(output, layout.VELOCITY_GAIN, g)


@inline
def take_range(x, plot, scan):
    """The state after a plot's range; the track's first sets it."""
    z = get(plot, layout.RANGE)
    x = add_scaled(x, z - x[0], lane_matrices.get3(scan, layout.RANGE_GAIN))
    return where_greater(get(plot, layout.FIRST), full(0.0), z, x[0]), x[1], x[2]


@inline
def still_right(right, plot, velocity, D):
    """`right` (0 or 1) where the unfolded `velocity` lies in the fold of the measured one; else 0."""
    deviation = get(plot, layout.UNFOLDED) - velocity
    deviation = where_greater(deviation, full(0.0), deviation, full(0.0) - deviation)
    return where_greater(deviation * get(plot, layout.DETECTED), full(0.5 * D), full(0.0), right)


@inline
def put_single(output, x, right):
    """Write the output of a bank with one hypothesis."""
    put3(output, layout.MEAN, x)
    put3(output, layout.BEST, x)
    put(output, layout.RIGHT, right)
    put(output, layout.LISTED, right)
    put(output, layout.COUNT, full(1.0))
    put(output, layout.PROBABILITY, full(1.0))


@kernel_part
def run_single(kind, design, spans, plots, gains, out):
    """Run a bank with one hypothesis over all scans: range alone, or the true fold, the nearest, or the remainder.

    For a remainder, `right` counts its scan alone: it depends on two plots, not on earlier estimates."""
    F, _ = motion(design)
    zero = full(0.0)
    x, right = (zero, zero, zero), full(1.0)
    for k in range(spans.size):
        plot, scan, D = row(plots, k * layout.PLOT), row(gains, k * layout.GAINS), spans[k]
        x = take_range(predict_state(x, F), plot, scan)
        if kind != layout.NONE:
            u = get(plot, layout.UNFOLDED)
            if kind == layout.REMAINDER:
                right = still_right(get(plot, layout.PAIRED), plot, get(plot, layout.SOLVED), D)
                u = get(plot, layout.SOLVED)
            elif kind != layout.UNFOLDS:
                z = get(plot, layout.VELOCITY)
                u = z + D * nearest((x[1] - z) / D)
                right = still_right(right, plot, u, D)
            x = add_scaled(x, u - x[1], lane_matrices.get3(scan, layout.VELOCITY_GAIN))
        put_single(row(out, k * layout.OUTPUT), x, right)


@inline
def merge_folds(e, S, D):
    """Mean and variance of the innovation e + n D over all whole n, and the sum of weights over that of e.

    The weights are exp(-(e + n D)²/2S); |e| <= D/2."""
    weight_sum, mean, square = full(1.0), e, e * e
    limit, scale = lanes.square_root(S * MAX_SQUARED_DEVIATION), -0.5 / S
    n = 1.0
    while lanes.any_greater(limit + 0.5 * D, full(n * D)):
        for sign in (-1.0, 1.0):
            f = e + sign * n * D
            weight = exponential(scale * (f * f - e * e))
            weight_sum, mean, square = weight_sum + weight, mean + weight * f, square + weight * f * f
        n += 1.0
    mean = mean / weight_sum
    return mean, square / weight_sum - mean * mean, weight_sum


@kernel_part
def run_merged(design, sigma, spans, plots, out):
    """Run a bank that merges the folds of each scan into one state (GPB1) over all scans; each lane has its own
    covariance."""
    F, Q = motion(design)
    zero = full(0.0)
    x, P, right = (zero, zero, zero), prior_covariance(design), full(1.0)
    for k in range(spans.size):
        plot, D = row(plots, k * layout.PLOT), spans[k]
        detected, first = get(plot, layout.DETECTED), get(plot, layout.FIRST)
        x = predict_state(x, F)
        if k > 0:
            P = predict_covariance(P, F, Q)
        P, g, _ = update_by_range(P, first, detected - first, sigma[0] * sigma[0])
        z = get(plot, layout.RANGE)
        x = add_scaled(x, z - x[0], g)
        x = where_greater(first, zero, z, x[0]), x[1], x[2]
        e = get(plot, layout.VELOCITY) - x[1]
        e = e - D * nearest(e / D)
        right = still_right(right, plot, x[1] + e, D)
        P, g, S = take_rate(P, sigma[1] * sigma[1], detected)
        mean, variance, _ = merge_folds(e, S, D)
        x = add_scaled(x, mean, g)
        P = add_outer(P, variance, g)
        put_single(row(out, k * layout.OUTPUT), x, right)

"""Linear filters of the second order over many realisations: plots, least-squares start, Kalman scans, sums of errors.

The gains do not depend on the data, so a filter is a schedule of gains that all realisations share. Realisations lie in
chunks that stay in cache, scans outermost, one plain loop over the chunk per formula. The rows of a state are value,
rate and second rate of one coordinate (range, radial velocity, acceleration); a filter of the first order is one whose
third gains and weights are zero, and a further coordinate is a further call.

A schedule is four arrays, F filters over K scans:

    observes (F,)           1: the filter observes the value alone; 2: value and rate
    start    (F,)           scan, counted from 1, at which its least-squares start ends
    weights  (F, 3, 2, S)   that start is the sum of weights times plots over the first `start` scans; S >= all starts
    gains    (F, K, 3, 2)   of every scan after the start; not read up to it

Before the start the estimates are the plots themselves, of what the filter observes.

The work array x (F + 1, 3, n) holds the filters' states and, last, the plots (its third row stays zero).
"""

import numpy as np

from radarsim.kernels.compile import aligned_zeros, inline, kernel, part, summing
from radarsim.kernels.random import fill_words, normal_pair

CHUNK = 512  # realisations; a row is 4 KB, so that two filters and the plots just fill a first-level cache


@inline
def extrapolated(r, v, a, dt):
    """B x of P1 eq. (3): value, rate and second rate after a time dt."""
    return r + dt * (v + 0.5 * dt * a), v + dt * a, a


@part
def fill_plots(key, first, scan, mean, sigma, z, w):
    """Plots of one scan: values z (n,) and rates w (n,) of realisations first, first + 1, …

    mean (>= 2,) holds the true ones, sigma (2,) their standard deviations. The first normal of draw pair `scan` goes to
    the value, the second to the rate, whether or not any filter observes it.
    """
    mean_z, mean_w, sigma_z, sigma_w = mean[0], mean[1], sigma[0], sigma[1]
    x, y = z.view(np.uint64), w.view(np.uint64)
    fill_words(key, first, scan, x, y)
    for i in range(z.size):
        a, b = normal_pair(x[i], y[i])
        z[i], w[i] = mean_z + sigma_z * a, mean_w + sigma_w * b


@part
def add_weighted(x, z, w, weight):
    """One scan's share of the least-squares start: x (3, n) += weight (3, 2) of the plots z (n,), w (n,)."""
    for j in range(3):
        row, of_value, of_rate = x[j], weight[j, 0], weight[j, 1]
        for i in range(z.size):
            row[i] += of_value * z[i] + of_rate * w[i]


@part
def scan_value(x, z, dt, gain):
    """One scan, in place, of a filter that observes the value: x (3, n) estimates, z (n,) plots, gain (3, >= 1)."""
    r, v, a = x[0], x[1], x[2]
    g0, g1, g2 = gain[0, 0], gain[1, 0], gain[2, 0]
    for i in range(z.size):
        p, q, s = extrapolated(r[i], v[i], a[i], dt)
        residual = z[i] - p
        r[i], v[i], a[i] = p + g0 * residual, q + g1 * residual, s + g2 * residual


@part
def scan_value_rate(x, z, w, dt, gain):
    """One scan, in place, of a filter that observes value z (n,) and rate w (n,): x (3, n) estimates, gain (3, 2)."""
    r, v, a = x[0], x[1], x[2]
    g0, g1, g2 = gain[0, 0], gain[1, 0], gain[2, 0]
    h0, h1, h2 = gain[0, 1], gain[1, 1], gain[2, 1]
    for i in range(z.size):
        p, q, s = extrapolated(r[i], v[i], a[i], dt)
        e, f = z[i] - p, w[i] - q
        r[i], v[i], a[i] = p + g0 * e + h0 * f, q + g1 * e + h1 * f, s + g2 * e + h2 * f


@part
def advance(x, k, dt, observes, start, weights, gains):
    """Scan k, counted from 0, of all filters, in place: x as above, its plots of scan k; dt is the time since k - 1."""
    plots = x.shape[0] - 1
    z, w = x[plots, 0], x[plots, 1]
    for f in range(plots):
        if k < start[f]:
            add_weighted(x[f], z, w, weights[f, :, :, k])
        elif observes[f] == 1:
            scan_value(x[f], z, dt, gains[f, k])
        else:
            scan_value_rate(x[f], z, w, dt, gains[f, k])


@inline
def source(x, f, k, observes, start):
    """Which row of x holds the estimates of filter f at scan k, and how many components of it are estimates."""
    if k >= start[f] - 1:
        return f, 3
    return x.shape[0] - 1, observes[f]


@summing
def moments(x, f, n, truth):
    """Sums over the first n realisations of the errors r, v, a = x[f] - truth (3,) and of their products, in one pass.

    Returns r, r², r³, r⁴, the same of v and of a, then r v, r a, v a: fifteen numbers.
    """
    r0, v0, a0 = truth[0], truth[1], truth[2]
    r1 = r2 = r3 = r4 = v1 = v2 = v3 = v4 = a1 = a2 = a3 = a4 = rv = ra = va = 0.0
    for i in range(n):
        r, v, a = x[f, 0, i] - r0, x[f, 1, i] - v0, x[f, 2, i] - a0
        rr, vv, aa = r * r, v * v, a * a
        r1, v1, a1 = r1 + r, v1 + v, a1 + a
        r2, v2, a2 = r2 + rr, v2 + vv, a2 + aa
        r3, v3, a3 = r3 + r * rr, v3 + v * vv, a3 + a * aa
        r4, v4, a4 = r4 + rr * rr, v4 + vv * vv, a4 + aa * aa
        rv, ra, va = rv + r * v, ra + r * a, va + v * a
    return r1, r2, r3, r4, v1, v2, v3, v4, a1, a2, a3, a4, rv, ra, va


@summing
def products_of_squares(x, f, g, n, truth):
    """Sums over the first n realisations of e² e'², the errors of rows f and g in each of the three components."""
    r0, v0, a0 = truth[0], truth[1], truth[2]
    r = v = a = 0.0
    for i in range(n):
        rr = (x[f, 0, i] - r0) * (x[g, 0, i] - r0)
        vv = (x[f, 1, i] - v0) * (x[g, 1, i] - v0)
        aa = (x[f, 2, i] - a0) * (x[g, 2, i] - a0)
        r, v, a = r + rr * rr, v + vv * vv, a + aa * aa
    return r, v, a


@part
def add_sums(x, n, k, truth, observes, start, baseline, error, paired, cross):
    """Add the sums of scan k over the first n realisations of x; truth (3,), the rest as in `simulate_block`."""
    beside, compared = source(x, baseline, k, observes, start)
    for f in range(x.shape[0] - 1):
        row, known = source(x, f, k, observes, start)
        sums = moments(x, row, n, truth)
        squares = sums[3], sums[7], sums[11]
        if row != beside:
            squares = products_of_squares(x, row, beside, n, truth)
        for c in range(known):
            for power in range(4):
                error[f, k, c, power] += sums[4 * c + power]
            if c < compared:
                paired[f, k, c] += squares[c]
            for d in range(c):
                cross[f, k, c + d - 1] += sums[12 + c + d - 1]


@kernel
def add_block(x, key, first, count, truth, sigma, dt, observes, start, weights, gains, baseline, error, paired, cross):
    """`simulate_block` for arguments of the one type that is compiled, with a work array x (F + 1, 3, CHUNK)."""
    filters, scans = gains.shape[0], gains.shape[1]
    for done in range(0, count, CHUNK):
        x[:] = 0.0
        # A partial chunk is computed whole and summed in part, so each realisation goes through the same instructions.
        n = min(CHUNK, count - done)
        for k in range(scans):
            fill_plots(key, first + done, k, truth[k], sigma[k], x[filters, 0], x[filters, 1])
            advance(x, k, dt[k], observes, start, weights, gains)
            add_sums(x, n, k, truth[k], observes, start, baseline, error, paired, cross)


@kernel
def fill_simulated(x, key, first, truth, sigma, plots):
    """`simulate_plots` into plots (n, K, 2), with a work array x (2, CHUNK)."""
    for done in range(0, plots.shape[0], CHUNK):
        n = min(CHUNK, plots.shape[0] - done)
        for k in range(plots.shape[1]):
            fill_plots(key, first + done, k, truth[k], sigma[k], x[0], x[1])
            plots[done : done + n, k] = x[:, :n].T


@kernel
def fill_estimates(x, plots, dt, observes, start, weights, gains, estimates):
    """`estimate` into estimates (n, F, K, 3), with a work array x (F + 1, 3, CHUNK)."""
    filters, scans = gains.shape[0], gains.shape[1]
    for done in range(0, plots.shape[0], CHUNK):
        x[:] = 0.0
        n = min(CHUNK, plots.shape[0] - done)
        for k in range(scans):
            x[filters, :2, :n] = plots[done : done + n, k].T
            advance(x, k, dt[k], observes, start, weights, gains)
            for f in range(filters):
                row, known = source(x, f, k, observes, start)
                estimates[done : done + n, f, k, :known] = x[row, :known, :n].T


def plain(array, *shape, dtype=np.float64):
    """The array as the kernels take it: of one type, contiguous, writable, broadcast to a shape; itself where it is so.

    Numba counts a read-only array as another type and would compile everything again.
    """
    alike = type(array) is np.ndarray and array.shape == shape and array.dtype == dtype
    if alike and array.flags.c_contiguous and array.flags.writeable:
        return array
    made = np.empty(shape, dtype=dtype)
    made[...] = array
    return made


def schedule(dt, observes, start, weights, gains) -> tuple[np.ndarray, ...]:
    """Interval and schedule arrays as the kernels take them; dt a number or (K,), the rest as above."""
    filters, scans = gains.shape[:2]
    return (
        plain(dt, scans),
        plain(observes, filters, dtype=np.int64),
        plain(start, filters, dtype=np.int64),
        plain(weights, *weights.shape),
        plain(gains, *gains.shape),
    )


def simulate_block(
    key, first, count, truth, sigma, dt, observes, start, weights, gains, baseline, error, paired, cross
) -> None:
    """Simulate realisations first … first + count - 1 (any count > 0) and add the sums of all filters' errors.

    key (2,) of the noise's stream; truth (K, 3); sigma (2,) or (K, 2), standard deviations of the plots' value and
    rate; dt a number or (K,), the time since the scan before (the first is not read); observes, start, weights, gains
    the schedule of F filters; baseline the filter that others are compared with. Added to, float64 and contiguous, over
    the components that a filter estimates at that scan:

        error  (F, K, 3, 4)   sums of e, e², e³, e⁴, the errors e = estimate - truth
        paired (F, K, 3)      sums of e² times the baseline's e², where both have an estimate
        cross  (F, K, 3)      sums of e_r e_V, e_r e_a, e_V e_a

    Realisation i has the same plots and estimates in any block. Memory does not grow with count or scans.
    """
    filters, scans = gains.shape[:2]
    x = aligned_zeros(filters + 1, 3, CHUNK)
    world = plain(key, 2, dtype=np.uint64), int(first), int(count), plain(truth, scans, 3), plain(sigma, scans, 2)
    add_block(x, *world, *schedule(dt, observes, start, weights, gains), int(baseline), error, paired, cross)


def simulate_plots(key, first, count, truth, sigma) -> np.ndarray:
    """The plots (count, K, 2) that `simulate_block` draws for realisations first … first + count - 1."""
    scans = len(truth)
    x, plots = aligned_zeros(2, CHUNK), np.empty((count, scans, 2))
    fill_simulated(x, plain(key, 2, dtype=np.uint64), int(first), plain(truth, scans, 3), plain(sigma, scans, 2), plots)
    return plots


def estimate(plots, dt, observes, start, weights, gains) -> np.ndarray:
    """Estimates (n, F, K, 3) of F filters over plots (n, K, 2) of n tracks; NaN where a filter has none yet.

    dt and the schedule as for `simulate_block`, by the same instructions. For a missing plot give any finite number,
    with zero gains.
    """
    filters, scans = gains.shape[:2]
    x, estimates = aligned_zeros(filters + 1, 3, CHUNK), np.full((len(plots), filters, scans, 3), np.nan)
    fill_estimates(x, plain(plots, *np.shape(plots)), *schedule(dt, observes, start, weights, gains), estimates)
    return estimates

"""Linear filters of the second order over many realisations: plots, least-squares start, Kalman scans, sums of errors.

The gains do not depend on the data, so a filter is a schedule of gains that all realisations share. Realisations lie in
chunks that stay in cache, scans outermost, one plain loop over the chunk per formula. The rows of a state are value,
rate and second rate of one coordinate (range, radial velocity, acceleration); a filter of the first order is one whose
third gains and weights are zero, and a further coordinate is a further call.

Before a filter's start its estimates are the plots themselves, of what it observes.

The work array x (F + 1, 3, n) holds the filters' states and, last, the plots (its third row stays zero)."""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from radarsim.kernels.compiler import aligned_zeros, inline, kernel, kernel_part, summing_kernel
from radarsim.kernels.kalman_algebra import add_scaled, constant_acceleration, predict_state
from radarsim.kernels.random import fill_words, normal_pair

CHUNK = 512  # realisations; a row is 4 KB, so that two filters and the plots just fill a first-level cache
COMPONENT_PAIRS = ((0, 1), (0, 2), (1, 2))  # the pairs of components whose products `Sums.cross` holds, in its order


class Problem(NamedTuple):
    """What is simulated: the truth and its plots over K scans, and the F filters that see them."""

    key: np.ndarray  #: (2,) of the noise's stream
    truth: np.ndarray  #: (K, 3) value, rate and second rate
    sigma: np.ndarray  #: (2,), (K, 2) standard deviations of the plots' value and rate
    dt: np.ndarray | float  #: (), (K,) time since the scan before; the first is not read
    observes: np.ndarray  #: (F,) 1: the filter observes the value alone; 2: value and rate
    start: np.ndarray  #: (F,) scan, counted from 1, at which its least-squares start ends
    #: (F, 3, 2, S) that start is the sum of weights times plots over the first `start` scans; S >= all starts
    weights: np.ndarray
    gains: np.ndarray  #: (F, K, 3, 2) of every scan after the start; not read up to it
    baseline: int = 0  #: the filter that others are compared with

    def plain(self) -> "Problem":
        """The same with arrays as the kernels take them, sigma (K, 2) and dt (K,); itself where they are so."""
        scans = len(self.truth)
        return with_kernel_arrays(self, sigma=(scans, 2), dt=(scans,))


class Sums(NamedTuple):
    """Sums over realisations of the errors e = estimate - truth, of the components that a filter has at that scan."""

    error: np.ndarray  #: (F, K, 3, 4) e, e², e³, e⁴
    paired: np.ndarray  #: (F, K, 3) e² times the baseline's e², where both have an estimate
    cross: np.ndarray  #: (F, K, 3) the products of two components' errors, CROSSED


def shapes(filters: int, scans: int) -> Mapping[str, tuple[int, ...]]:
    """The shapes of `Sums`, by name."""
    return {
        "error": (filters, scans, 3, 4),
        "paired": (filters, scans, 3),
        "cross": (filters, scans, len(COMPONENT_PAIRS)),
    }


@kernel_part
def fill_plots(key, first, scan, mean, sigma, next_word, z, w):
    """Plots of one scan: values z (n,) and rates w (n,) of realisations first, first + 1, …

    mean (>= 2,) holds the true ones, sigma (2,) their standard deviations. The first normal of pair `scan` goes to the
    value, the second to the rate, whether or not any filter observes it. Words come two at a time: those of the scan
    after an even one are kept in next_word (n,) uint64, so scans are taken in their order."""
    mean_z, mean_w, sigma_z, sigma_w = mean[0], mean[1], sigma[0], sigma[1]
    word = z.view(np.uint64)
    if scan % 2 == 0:
        fill_words(key, first, scan // 2, word, next_word)
    else:
        for i in range(z.size):
            word[i] = next_word[i]
    for i in range(z.size):
        a, b = normal_pair(word[i])
        z[i], w[i] = mean_z + sigma_z * a, mean_w + sigma_w * b


@kernel_part
def add_weighted(x, z, w, weight):
    """One scan's share of the least-squares start: x (3, n) += weight (3, 2) of the plots z (n,), w (n,)."""
    for j in range(3):
        row, of_value, of_rate = x[j], weight[j, 0], weight[j, 1]
        for i in range(z.size):
            row[i] += of_value * z[i] + of_rate * w[i]


@kernel_part
def scan_value(x, z, dt, gain):
    """One scan, in place, of a filter that observes the value: x (3, n) estimates, z (n,) plots, gain (3, >= 1)."""
    r, v, a, F = x[0], x[1], x[2], constant_acceleration(dt)
    g = gain[0, 0], gain[1, 0], gain[2, 0]
    for i in range(z.size):
        p = predict_state((r[i], v[i], a[i]), F)
        r[i], v[i], a[i] = add_scaled(p, z[i] - p[0], g)


@kernel_part
def scan_value_rate(x, z, w, dt, gain):
    """One scan, in place, of a filter that observes value z (n,) and rate w (n,): x (3, n) estimates, gain (3, 2)."""
    r, v, a, F = x[0], x[1], x[2], constant_acceleration(dt)
    g, h = (gain[0, 0], gain[1, 0], gain[2, 0]), (gain[0, 1], gain[1, 1], gain[2, 1])
    for i in range(z.size):
        p = predict_state((r[i], v[i], a[i]), F)
        r[i], v[i], a[i] = add_scaled(add_scaled(p, z[i] - p[0], g), w[i] - p[1], h)


@kernel_part
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
def estimate_row(x, f, k, observes, start):
    """Which row of x holds the estimates of filter f at scan k, and how many components of it are estimates."""
    if k >= start[f] - 1:
        return f, 3
    return x.shape[0] - 1, observes[f]


@summing_kernel
def error_moments(x, f, n, truth):
    """Sums over the first n realisations of the errors r, v, a = x[f] - truth (3,) and of their products, in one pass.

    Returns r, r², r³, r⁴, the same of v and of a, then r v, r a, v a: fifteen numbers."""
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


@summing_kernel
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


@kernel_part
def add_sums(x, n, k, truth, observes, start, baseline, sums):
    """Add scan k over the first n realisations of x to the sums; truth (3,)."""
    error, paired, cross = sums
    baseline_row, baseline_components = estimate_row(x, baseline, k, observes, start)
    for f in range(x.shape[0] - 1):
        row, components = estimate_row(x, f, k, observes, start)
        error_sums = error_moments(x, row, n, truth)
        squares = error_sums[3], error_sums[7], error_sums[11]
        if row != baseline_row:
            squares = products_of_squares(x, row, baseline_row, n, truth)
        for c in range(components):
            for power in range(4):
                error[f, k, c, power] += error_sums[4 * c + power]
            if c < baseline_components:
                paired[f, k, c] += squares[c]
            for d in range(c):
                cross[f, k, c + d - 1] += error_sums[12 + c + d - 1]


@kernel
def add_block(x, first, count, problem, sums):
    """`simulate_block` for a plain problem, with a work array x (F + 1, 3, CHUNK)."""
    # Unpacked once: an array taken out of a record counts a reference, at every scan a tenth of the whole time.
    key, truth, sigma, dt, observes, start, weights, gains, baseline = problem
    filters, scans = gains.shape[0], gains.shape[1]
    z, w, next_word = x[filters, 0], x[filters, 1], np.empty(CHUNK, np.uint64)
    for done in range(0, count, CHUNK):
        x[:] = 0.0
        # A partial chunk is computed whole and summed in part, so each realisation goes through the same instructions.
        n = min(CHUNK, count - done)
        for k in range(scans):
            fill_plots(key, first + done, k, truth[k], sigma[k], next_word, z, w)
            advance(x, k, dt[k], observes, start, weights, gains)
            add_sums(x, n, k, truth[k], observes, start, baseline, sums)


@kernel
def fill_simulated(x, first, key, truth, sigma, plots):
    """`simulate_plots` into plots (2, K, n), with a work array x (2, CHUNK)."""
    z, w, next_word, count = plots[0], plots[1], np.empty(CHUNK, np.uint64), plots.shape[2]
    for done in range(0, count, CHUNK):
        n = min(CHUNK, count - done)
        for k in range(plots.shape[1]):
            if n == CHUNK:
                to_z, to_w = z[k, done : done + CHUNK], w[k, done : done + CHUNK]
                fill_plots(key, first + done, k, truth[k], sigma[k], next_word, to_z, to_w)
            else:
                fill_plots(key, first + done, k, truth[k], sigma[k], next_word, x[0], x[1])
                for i in range(n):
                    z[k, done + i], w[k, done + i] = x[0, i], x[1, i]


@kernel
def fill_estimates(x, problem, plots, estimates):
    """`estimate` into estimates (n, F, K, 3), with a work array x (F + 1, 3, CHUNK)."""
    filters, scans = problem.gains.shape[0], problem.gains.shape[1]
    for done in range(0, plots.shape[0], CHUNK):
        x[:] = 0.0
        n = min(CHUNK, plots.shape[0] - done)
        for k in range(scans):
            for m in range(2):
                for i in range(n):
                    x[filters, m, i] = plots[done + i, k, m]
            advance(x, k, problem.dt[k], problem.observes, problem.start, problem.weights, problem.gains)
            for f in range(filters):
                row, components = estimate_row(x, f, k, problem.observes, problem.start)
                for i in range(n):
                    for m in range(components):
                        estimates[done + i, f, k, m] = x[row, m, i]


def as_kernel_array(array, *shape, dtype=np.float64):
    """The array as the kernels take it: of one type, contiguous, writable, broadcast to a shape; itself where it is so.
    Numba counts a read-only array as another type and would compile everything again."""
    has_form = type(array) is np.ndarray and array.shape == shape and array.dtype == dtype
    if has_form and array.flags.c_contiguous and array.flags.writeable:
        return array
    converted = np.empty(shape, dtype=dtype)
    converted[...] = array
    return converted


INTEGER_ARRAYS: dict[str, type] = {
    **dict.fromkeys(("key", "keys"), np.uint64),
    **dict.fromkeys(("observes", "start", "given"), int),
}


def with_kernel_arrays(problem: Any, **shapes: tuple[int, ...]) -> Any:
    """A problem with its arrays as the kernels take them, by name: of these shapes, else of their own."""
    arrays = {name: value for name, value in problem._asdict().items() if name in shapes or np.ndim(value)}
    types = {name: INTEGER_ARRAYS.get(name, np.float64) for name in arrays}
    converted = {
        name: as_kernel_array(value, *shapes.get(name, np.shape(value)), dtype=types[name])
        for name, value in arrays.items()
    }
    return problem._replace(**converted)


def simulate_block(problem: Problem, first: int, count: int, sums: Sums) -> None:
    """Simulate realisations first … first + count - 1 (any count > 0) and add all filters' errors to the sums. The
    arrays of sums are float64 and contiguous. Realisation i has the same plots and estimates in any block. Memory does
    not grow with count or scans."""
    problem = problem.plain()
    add_block(aligned_zeros(len(problem.gains) + 1, 3, CHUNK), int(first), int(count), problem, sums)


def simulate_plots(problem: Problem, first: int, count: int) -> np.ndarray:
    """The plots (count, K, 2) that `simulate_block` draws for realisations first … first + count - 1."""
    problem = problem.plain()
    plots = np.empty((2, len(problem.truth), count))
    fill_simulated(aligned_zeros(2, CHUNK), int(first), problem.key, problem.truth, problem.sigma, plots)
    return plots.transpose(2, 1, 0)


def errors(problem: Problem, first: int, count: int) -> np.ndarray:
    """The errors (F, count, K, 3) of the realisations of `simulate_block`; NaN where a filter has no estimate."""
    return (estimate(problem, simulate_plots(problem, first, count)) - problem.truth).swapaxes(0, 1)


def estimate(problem: Problem, plots: np.ndarray) -> np.ndarray:
    """Estimates (n, F, K, 3) of a problem's filters over plots (n, K, 2) of n tracks; NaN where a filter has none yet.
    By the same instructions as `simulate_block`. For a missing plot give any finite number, with zero gains."""
    problem = problem.plain()
    filters, scans = problem.gains.shape[:2]
    x, estimates = aligned_zeros(filters + 1, 3, CHUNK), np.full((len(plots), filters, scans, 3), np.nan)
    fill_estimates(x, problem, as_kernel_array(plots, *np.shape(plots)), estimates)
    return estimates

"""Linear filters of any number of states over many realisations: truth, plots, scans, sums of errors.

The truth is a linear process with noise, so each realisation has its own; a filter may believe another model than the
true one. Realisations lie in chunks that stay in cache, scans outermost, and a sum of rows is one plain loop over the
chunk. A plot's numbers have independent errors and are taken in one after the other.

Letters as in the book: t truth, x estimate, P its covariance, F transition, Q noise of the process, H row of a number.
"""

from typing import Any, NamedTuple

import numpy as np

from radarsim.kernels import algebra
from radarsim.kernels.compile import aligned_zeros, inline, kernel, part, summing
from radarsim.kernels.hypotheses import extrapolate
from radarsim.kernels.lanes import address
from radarsim.kernels.random import fill_uniform_pairs, fill_words, normal_pair

CHUNK = 512  # realisations; a row is 4 KB
LOT = 4  # scans whose normals are drawn together, so that no word and no half of a pair is left over


class Problem(NamedTuple):
    """What is simulated: n states, K scans, F filters that see G different plots of D numbers.

    key, detections (2,)     of the noise's stream, and of the one that says which plots are missed
    move    (n, n)           of the truth over a scan, with noise `push` (n, r) times r unit normals
    start   (n,)             its mean at the first scan, with noise `spread` (n, r) times r unit normals
    see     (G, K, D, n)     rows of the plots' numbers, with standard deviations `sigma` (G, K, D)
    sees    (F,)             which of the plots a filter takes
    F       (F, n, n)        as a filter believes, and x (F, n) its first estimate
    H       (F, K, D, n)     as a filter believes
    gains   (F, K, D, n)     of each number; not read of a filter that adapts
    adapts  (F,)             1: gains are made of the plots that are there, by P (F, n, n) first, Q (F, n, n) and
                             R (F, K, D), as the filter believes
    probability              that there is a plot; all its numbers are missed together
    baseline                 the filter that others are compared with
    """

    key: np.ndarray
    detections: np.ndarray
    move: np.ndarray
    push: np.ndarray
    start: np.ndarray
    spread: np.ndarray
    see: np.ndarray
    sigma: np.ndarray
    sees: np.ndarray
    F: np.ndarray
    x: np.ndarray
    H: np.ndarray
    gains: np.ndarray
    adapts: np.ndarray
    P: np.ndarray
    Q: np.ndarray
    R: np.ndarray
    probability: float
    baseline: int


# ---- sums of rows --------
# Rows are of one work array, whose address `a` is; a row is counted from its beginning. Coefficients c are read from
# number `at` on. Arrays in place of addresses would be counted at each of these calls, a third of the time.
@part
def combine(a, out, c, at, n, x):
    """Row `out` = the sum of n coefficients times the rows from x on; zeros that lead cost nothing."""
    o, j = out * CHUNK, 0
    while j < n - 1 and c[at + j] == 0.0:
        j += 1
    u, p, left = c[at + j], (x + j) * CHUNK, n - j
    if left >= 3:
        v, w, q, r = c[at + j + 1], c[at + j + 2], p + CHUNK, p + 2 * CHUNK
        for i in range(CHUNK):
            a[o + i] = u * a[p + i] + v * a[q + i] + w * a[r + i]
    elif left == 2:
        v, q = c[at + j + 1], p + CHUNK
        for i in range(CHUNK):
            a[o + i] = u * a[p + i] + v * a[q + i]
    else:
        for i in range(CHUNK):
            a[o + i] = u * a[p + i]
    for m in range(j + 3, n):
        add_scaled(a, out, c[at + m], x + m)


@part
def add_scaled(a, out, c, x):
    """Row `out` += c times row x."""
    if c != 0.0:
        o, p = out * CHUNK, x * CHUNK
        for i in range(CHUNK):
            a[o + i] += c * a[p + i]


# ---- truth and plots --------
@part
def fill_normals(key, first, lot, w):
    """Unit normals w (LOT m, CHUNK) of realisations first, first + 1, … over the scans of a lot, m a scan."""
    for j in range(0, w.shape[0], 4):
        a, b, c, d = w[j], w[j + 1], w[j + 2], w[j + 3]
        x, y = a.view(np.uint64), c.view(np.uint64)
        fill_words(key, first, lot * (w.shape[0] // 4) + j // 4, x, y)
        for i in range(CHUNK):
            a[i], b[i] = normal_pair(x[i])
        for i in range(CHUNK):
            c[i], d[i] = normal_pair(y[i])


@part
def advance_truth(a, n, r, F, L, old, new, w):
    """The truth, n rows from `new` on: F times the old one and L (n, r) times the unit normals from row w on."""
    for j in range(n):
        combine(a, new + j, F, j * n, n, old)
        for m in range(r):
            add_scaled(a, new + j, L[j * r + m], w + m)


@part
def begin_truth(a, n, r, mean, L, new, w):
    """The truth at the first scan: its mean (n,) and L (n, r) times unit normals."""
    for j in range(n):
        o = (new + j) * CHUNK
        for i in range(CHUNK):
            a[o + i] = mean[j]
        for m in range(r):
            add_scaled(a, new + j, L[j * r + m], w + m)


@part
def fill_plots(a, n, count, H, at, sigma, t, v, z):
    """Plots of `count` numbers, the rows from z on, of rows H from number `at` on, with unit normals from row v on."""
    for d in range(count):
        combine(a, z + d, H, (at + d) * n, n, t)
        add_scaled(a, z + d, sigma[at + d], v + d)


# ---- filters --------
@part
def predict(a, n, F, at, old, x):
    """Estimates, n rows from x on: F (n, n), from number `at` on, times the old ones."""
    for j in range(n):
        combine(a, x + j, F, at + j * n, n, old)


@part
def innovate(a, n, z, H, at, x, y):
    """Row y = row z - h x."""
    combine(a, y, H, at, n, x)
    p, q = z * CHUNK, y * CHUNK
    for i in range(CHUNK):
        a[q + i] = a[p + i] - a[q + i]


@part
def take(a, n, z, H, gains, at, x, y):
    """The n estimates from row x on after the number of row z, by its row in H and its gains, from `at` on."""
    if n == 2:
        take_two(a, z * CHUNK, (H[at], H[at + 1]), (gains[at], gains[at + 1]), x * CHUNK)
    elif n == 3:
        h, g = (H[at], H[at + 1], H[at + 2]), (gains[at], gains[at + 1], gains[at + 2])
        take_three(a, z * CHUNK, h, g, x * CHUNK)
    else:
        innovate(a, n, z, H, at, x, y)
        for j in range(n):
            add_scaled(a, x + j, gains[at + j], y)


# Of few states in one loop: half of the time of a loop a row.
@part
def take_two(a, z, h, g, p):
    """`take` of two states; z and p are places, not rows."""
    q = p + CHUNK
    for i in range(CHUNK):
        y = a[z + i] - (h[0] * a[p + i] + h[1] * a[q + i])
        a[p + i], a[q + i] = a[p + i] + y * g[0], a[q + i] + y * g[1]


@part
def take_three(a, z, h, g, p):
    """`take` of three states; z and p are places, not rows."""
    q, r = p + CHUNK, p + 2 * CHUNK
    for i in range(CHUNK):
        x = a[p + i], a[q + i], a[r + i]
        a[p + i], a[q + i], a[r + i] = algebra.add_scaled(x, a[z + i] - algebra.dot(h, x), g)


@part
def take_there(a, n, z, H, gains, at, there, x, y):
    """As `take`, where row `there` has a 1."""
    innovate(a, n, z, H, at, x, y)
    p, q = there * CHUNK, y * CHUNK
    for i in range(CHUNK):
        a[q + i] *= a[p + i]
    for j in range(n):
        add_scaled(a, x + j, gains[at + j], y)


@part
def predict_covariance(a, n, F, Q, at, P, room):
    """Covariances P, n n rows: F P F' + Q, of matrices from number `at` on; room: n n rows."""
    for j in range(n):
        for m in range(n):
            combine(a, room + j * n + m, F, at + j * n, n, P + m * n)
    for j in range(n):
        for m in range(j + 1):
            combine(a, P + j * n + m, F, at + m * n, n, room + j * n)
            o, p = (P + j * n + m) * CHUNK, (P + m * n + j) * CHUNK
            for i in range(CHUNK):
                a[o + i] += Q[at + j * n + m]
                a[p + i] = a[o + i]


@part
def take_adapting(a, n, z, H, at, R, there, x, P, y):
    """As `take_there` with the gains that the covariances from row P on give; after y are n + 1 rows of room."""
    innovate(a, n, z, H, at, x, y)
    h, s, there, y = y + 1, (y + n + 1) * CHUNK, there * CHUNK, y * CHUNK
    for j in range(n):
        combine(a, h + j, H, at, n, P + j * n)
    combine(a, h + n, H, at, n, h)
    for i in range(CHUNK):
        a[s + i] = a[there + i] / (a[s + i] + R)
    for j in range(n):
        p, q = (h + j) * CHUNK, (x + j) * CHUNK
        for i in range(CHUNK):
            a[q + i] += a[p + i] * (a[s + i] * a[y + i])
        for m in range(j + 1):
            o, u, v = (h + m) * CHUNK, (P + j * n + m) * CHUNK, (P + m * n + j) * CHUNK
            for i in range(CHUNK):
                a[u + i] -= a[p + i] * (a[s + i] * a[o + i])
                a[v + i] = a[u + i]


# ---- sums --------
@summing
def powers(a, x, t, n):
    """Sums over the first n realisations of e, e², e³, e⁴ of the errors e of row x, whose truth is row t."""
    s1 = s2 = s3 = s4 = 0.0
    for i in range(n):
        e = a[x * CHUNK + i] - a[t * CHUNK + i]
        q = e * e
        s1, s2, s3, s4 = s1 + e, s2 + q, s3 + e * q, s4 + q * q
    return s1, s2, s3, s4


@summing
def powers_beside(a, x, b, t, n):
    """The same, and of e² times the squared error of row b."""
    s1 = s2 = s3 = s4 = s22 = 0.0
    for i in range(n):
        e, d = a[x * CHUNK + i] - a[t * CHUNK + i], a[b * CHUNK + i] - a[t * CHUNK + i]
        q = e * e
        s1, s2, s3, s4, s22 = s1 + e, s2 + q, s3 + e * q, s4 + q * q, s22 + q * (d * d)
    return s1, s2, s3, s4, s22


@part
def add_sums(a, states, k, many, baseline, t, error, paired):
    """Add scan k over the first `many` realisations; states: of a filter; t: the first row of the truth, after them."""
    filters, components = error.shape[0], error.shape[2]
    x = t - filters * states
    for f in range(filters):
        for c in range(components):
            own = x + f * states + c
            if f == baseline:
                s1, s2, s3, s4 = powers(a, own, t + c, many)
                s22 = s4
            else:
                s1, s2, s3, s4, s22 = powers_beside(a, own, x + baseline * states + c, t + c, many)
            error[f, k, c, 0] += s1
            error[f, k, c, 1] += s2
            error[f, k, c, 2] += s3
            error[f, k, c, 3] += s4
            paired[f, k, c] += s22


# ---- blocks --------
class Places(NamedTuple):
    """The rows of a work array, and what the loops over them count: filters, scans, states, numbers, unit normals.

    Estimates of all filters and then the truth, of one scan and of another; normals of a lot; plots; `there` and the
    half that is kept of it; an innovation with n + 1 rows of room; covariances, and those of one filter as room.
    """

    F: int
    K: int
    n: int
    D: int
    G: int
    r: int
    normals: int
    plots: int
    there: int
    innovation: int
    P: int
    end: int


@inline
def places(filters, problem):
    """Those of a problem, of so many of its filters."""
    groups, scans, D, n = problem.see.shape
    r = problem.push.shape[1]
    normals = 2 * (filters + 1) * n
    plots = normals + LOT * (r + D)
    there = plots + groups * D
    P = there + 4 + n
    end = P + (filters + 1 if problem.adapts.any() else 0) * n * n
    return Places(filters, scans, n, D, groups, r, normals, plots, there, there + 2, P, end)


class Addresses(NamedTuple):
    """Where the arrays of a problem are, without counting references to them."""

    move: Any
    push: Any
    start: Any
    spread: Any
    see: Any
    sigma: Any
    sees: Any
    F: Any
    H: Any
    gains: Any
    adapts: Any
    Q: Any
    R: Any


@inline
def addresses(problem):
    """Those of a problem, which must outlive their use."""
    return Addresses(
        address(problem.move),
        address(problem.push),
        address(problem.start),
        address(problem.spread),
        address(problem.see),
        address(problem.sigma),
        address(problem.sees),
        address(problem.F),
        address(problem.H),
        address(problem.gains),
        address(problem.adapts),
        address(problem.Q),
        address(problem.R),
    )


@part
def advance_world(a, k, of, at, old, new):
    """The truth, n rows from `new` on, and the plots of scan k."""
    own = at.normals + k % LOT * (at.r + at.D)
    if k == 0:
        begin_truth(a, at.n, at.r, of.start, of.spread, new, own)
    else:
        advance_truth(a, at.n, at.r, of.move, of.push, old, new, own)
    for g in range(at.G):
        fill_plots(a, at.n, at.D, of.see, (g * at.K + k) * at.D, of.sigma, new, own + at.r, at.plots + g * at.D)


@part
def advance_filter(a, f, k, of, at, missing, same, old, x):
    """The estimates of filter f, n rows from x on, after scan k; missing: whether plots are; same: the unit matrix."""
    n, first, matrix, z = at.n, (f * at.K + k) * at.D, f * at.n * at.n, at.plots + of.sees[f] * at.D
    predict(a, n, of.F if k else same, matrix if k else 0, old, x)
    if of.adapts[f] and k:
        predict_covariance(a, n, of.F, of.Q, matrix, at.P + matrix, at.P + at.F * n * n)
    for d in range(at.D):
        number, row = first + d, (first + d) * n
        if of.adapts[f]:
            R = of.R[number]
            take_adapting(a, n, z + d, of.H, row, R, at.there, x, at.P + matrix, at.innovation)
        elif missing:
            take_there(a, n, z + d, of.H, of.gains, row, at.there, x, at.innovation)
        else:
            take(a, n, z + d, of.H, of.gains, row, x, at.innovation)


@part
def fill_there(k, key, probability, first, there, other):
    """there (CHUNK,): 1 where a realisation has a plot at scan k, else 0; scans in their order, other keeps a half."""
    if k % 2 == 0:
        fill_uniform_pairs(key, first, k // 2, there, other)
    else:
        there[:] = other
    for i in range(CHUNK):
        there[i] = 1.0 if there[i] < probability else 0.0


@part
def start(work, at, problem):
    """Every filter's estimates before the first scan, and covariances of those that adapt."""
    n = at.n
    for f in range(at.F):
        for j in range(n):
            work[(at.F + 1 + f) * n + j] = problem.x[f, j]
            for m in range(n if problem.adapts[f] else 0):
                work[at.P + (f * n + j) * n + m] = problem.P[f, j, m]


@kernel
def add_block(work, first, count, problem, error, paired):
    """`simulate_block` with a work array (its places' end, CHUNK)."""
    at, of, a, eye = places(problem.H.shape[0], problem), addresses(problem), address(work), np.eye(problem.H.shape[3])
    span, truth, same = (at.F + 1) * at.n, at.F * at.n, address(eye)
    normals, there, other = work[at.normals : at.plots], work[at.there], work[at.there + 1]
    there[:] = 1.0
    for done in range(0, count, CHUNK):
        # A partial chunk is computed whole and summed in part, so each realisation goes through the same instructions.
        many = min(CHUNK, count - done)
        start(work, at, problem)
        for k in range(at.K):
            now, old = k % 2 * span, (1 - k % 2) * span
            if k % LOT == 0:
                fill_normals(problem.key, first + done, k // LOT, normals)
            advance_world(a, k, of, at, old + truth, now + truth)
            if problem.probability < 1.0:
                fill_there(k, problem.detections, problem.probability, first + done, there, other)
            for f in range(at.F):
                advance_filter(a, f, k, of, at, problem.probability < 1.0, same, old + f * at.n, now + f * at.n)
            add_sums(a, at.n, k, many, problem.baseline, now + truth, error, paired)


@kernel
def fill_realisation(work, realisation, problem, truth, plots):
    """`simulate_plots` into truth (K, n) and plots (G, K, D), with a work array as of no filter."""
    at, of, a = places(0, problem), addresses(problem), address(work)
    there, other = work[at.there], work[at.there + 1]
    there[:] = 1.0
    for k in range(at.K):
        now, old = k % 2 * at.n, (1 - k % 2) * at.n
        if k % LOT == 0:
            fill_normals(problem.key, realisation, k // LOT, work[at.normals : at.plots])
        advance_world(a, k, of, at, old, now)
        if problem.probability < 1.0:
            fill_there(k, problem.detections, problem.probability, realisation, there, other)
        truth[k] = work[now : now + at.n, 0]
        for g in range(at.G):
            for d in range(at.D):
                plots[g, k, d] = work[at.plots + g * at.D + d, 0] if there[0] > 0.0 else np.nan


@kernel
def follow(x, P, F, Q, H, R, gains, adapts, z, there, out):
    """One filter over rows of recorded plots; x (n,) and P (n, n), as before the first row, are overwritten.

    F, Q (m, n, n) to each row, H, gains (m, D, n), R (m, D), numbers z (m, D) where `there`. out (m, 2 n + D) takes
    estimates, standard deviations, and squared innovations over their variances where there is a number.
    """
    n, D = x.size, z.shape[1]
    room, p = np.empty((n, n)), np.empty(n)
    for k in range(z.shape[0]):
        extrapolate(x, P, room, p, F[k], Q[k], 1.0)
        for d in range(D):
            if there[k, d]:
                y, S = z[k, d], R[k, d]
                for j in range(n):
                    y -= H[k, d, j] * x[j]
                    p[j] = 0.0
                    for m in range(n):
                        p[j] += P[j, m] * H[k, d, m]
                for j in range(n):
                    S += H[k, d, j] * p[j]
                out[k, 2 * n + d] = y * y / S
                correct(x, P, p, S, y, gains[k, d], adapts)
        for j in range(n):
            out[k, j] = x[j]
            out[k, n + j] = np.sqrt(P[j, j])


@part
def correct(x, P, p, S, y, gain, adapts):
    """x and P after an innovation y of variance S and covariance p (n,) with the state: P - g p' - p g' + S g g'."""
    for j in range(x.size):
        g = p[j] / S if adapts else gain[j]
        x[j] += g * y
        for m in range(j + 1):
            other = p[m] / S if adapts else gain[m]
            P[j, m] += g * other * S - g * p[m] - p[j] * other
            P[m, j] = P[j, m]


def simulate_block(problem: Problem, first: int, count: int, error: np.ndarray, paired: np.ndarray) -> None:
    """Simulate realisations first … first + count - 1 and add all filters' errors to the sums.

    error (F, K, C, 4) takes e, e², e³, e⁴ of the first C states, paired (F, K, C) e² times the baseline's e².
    Realisation i has the same plots and estimates in any block.
    """
    work = aligned_zeros(places(len(problem.H), problem).end, CHUNK)
    add_block(work, int(first), int(count), problem, error, paired)


def simulate_plots(problem: Problem, realisation: int) -> tuple[np.ndarray, np.ndarray]:
    """The truth (K, n) and the plots (G, K, D) of a realisation, not-a-number where one is missed."""
    groups, scans, D, n = problem.see.shape
    truth, plots = np.empty((scans, n)), np.empty((groups, scans, D))
    fill_realisation(aligned_zeros(places(0, problem).end, CHUNK), int(realisation), problem, truth, plots)
    return truth, plots

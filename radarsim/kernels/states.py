"""Linear filters of any number of states over many realisations: truth, plots, scans, sums of errors.

The truth is a linear process with noise, so each realisation has its own; a filter may believe another model than the
true one. A plot's numbers have independent errors and are taken in one after the other.

Formulas are recorded from the matrices (`radarsim.kernels.traced`): what is 0 or 1 at all scans stands in them, so that
a coupling that is not there takes no time; other numbers are read, so that keys change no kernel. Realisations lie in
eights, some GROUPS of them in a chunk that stays in cache, scans outermost.

Letters as in the book: t truth, x estimate, P its covariance, F transition, Q noise of the process, H row of a number.
"""

from collections.abc import Sequence
from functools import cache, reduce
from operator import add
from typing import Any, NamedTuple

import numpy as np

from radarsim.kernels import lanes
from radarsim.kernels.compile import aligned_zeros, kernel, part
from radarsim.kernels.hypotheses import extrapolate, innovation
from radarsim.kernels.lanes import WIDTH, address, emitted, emitted_sums, full, get, put, row, total, where_greater
from radarsim.kernels.random import U, fill_normal_strip, fill_uniform_strip
from radarsim.kernels.traced import Program, Trace, row_of, where

GROUPS = 64  # eights in a chunk
STRIP = 16  # scans whose noise is drawn at once
POWERS = 5  # sums of a component: e, e², e³, e⁴, and e² times the baseline's e²
# Arrays of a program of the world, of a filter, and of the sums.
STATE, NUMBERS, FIRST_NORMALS, SECOND_NORMALS, PLOTS = range(5)
PLOT_NUMBERS, PRESENCE = 2, 3
ESTIMATES, TRUTH, COUNTED, BASELINE = range(4)


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
    baseline                 the filter that others are compared with"""

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


# ---- formulas --------------------------------------------------------------------------------------------------------
def table(trace: Trace, *matrices: np.ndarray) -> tuple[list[np.ndarray], np.ndarray]:
    """Matrices (m, K, …) as numbers of a program, each (…), and the table (m, K, width) of numbers to read."""
    flat = np.concatenate([matrix.reshape(*matrix.shape[:2], -1) for matrix in matrices], axis=2)
    first = flat[0, 0]
    is_constant = (flat == first).all(axis=(0, 1)) & np.isin(first, (0, 1))
    variables = iter(trace.plain(NUMBERS, (0.0,) * int((~is_constant).sum())))
    entries = np.empty(first.size, dtype=object)
    for i, fixed in enumerate(is_constant):
        entries[i] = float(first[i]) if fixed else next(variables)
    boundaries = np.cumsum([matrix[0, 0].size for matrix in matrices])[:-1]
    shaped = [
        part.reshape(matrix.shape[2:]) for part, matrix in zip(np.split(entries, boundaries), matrices, strict=True)
    ]
    return shaped, np.ascontiguousarray(np.concatenate([flat[..., ~is_constant], 0 * flat[..., :1]], axis=2))


def combined(weights: Sequence[Any], x: Sequence[Any], constant: Any = 0.0) -> Any:
    """`constant` plus the sum of products, without the products whose weight is zero in every case."""
    terms = [value if is_plain(w, 1) else w * value for w, value in zip(weights, x, strict=True) if not is_plain(w, 0)]
    return reduce(add, terms if is_plain(constant, 0) and terms else [constant, *terms])


def is_plain(number: Any, value: float) -> bool:
    """Whether a number is a constant of the formulas and has this value."""
    return isinstance(number, float) and number == value


def world(problem: Problem) -> list[tuple[Program, np.ndarray]]:
    """The programs of truth and plots at the first scan and at others, each with its table (K, width)."""
    groups, scans, D, n = problem.see.shape
    r, programs = problem.push.shape[1], []
    for state, noise in ((problem.start, problem.spread), (problem.move, problem.push)):
        trace = Trace()
        matrices = [np.broadcast_to(row, (1, scans, *row.shape)) for row in (state, noise)]
        matrices += [row.swapaxes(0, 1)[None] for row in (problem.see, problem.sigma)]
        (moved, L, see, sigma), numbers = table(trace, *matrices)
        w = [trace.rows((FIRST_NORMALS, SECOND_NORMALS)[i % 2], 0.0, i // 2) for i in range(r + D)]
        t = moved if state is problem.start else [combined(row, trace.rows(STATE, (0.0,) * n)) for row in moved]
        t = tuple(combined(row, w[:r], before) for row, before in zip(L, t, strict=True))
        trace.write(STATE, t)
        for g in range(groups):
            for d in range(D):
                trace.write(PLOTS, combined([sigma[g, d]], [w[r + d]], combined(see[g, d], t)), g * D + d)
        programs.append((trace.program(), numbers[0]))
    return programs


def of_filters(problem: Problem, selection: np.ndarray, adapts: bool) -> tuple[Program, np.ndarray]:
    """The program of a scan, the same for all filters in `selection` (F,), and their tables (F, K, width).

    At the first scan the estimates stay as they are before its plot: there F is the unit matrix, and Q zero."""
    trace, n, scans = Trace(), problem.x.shape[1], problem.H.shape[1]
    F, Q = (np.repeat(matrix[selection][:, None], scans, axis=1) for matrix in (problem.F, problem.Q))
    F[:, 0], Q[:, 0] = np.eye(n), 0.0
    update_matrices = (Q, problem.R[selection]) if adapts else (problem.gains[selection],)
    (F, H, *update_matrices), numbers = table(trace, F, problem.H[selection], *update_matrices)
    x = trace.rows(STATE, (0.0,) * n)
    x = [combined(matrix, x) for matrix in F]
    present = trace.rows(PRESENCE, 0.0) if problem.probability < 1 else 1.0
    if adapts:
        Q, R = update_matrices
        P = trace.rows(STATE, (0.0,) * (n * (n + 1) // 2), n)
        moved = [[combined(F[i], row_of(P, n, j)) for j in range(n)] for i in range(n)]
        P = [combined(F[j], moved[i], Q[i, j]) for i in range(n) for j in range(i, n)]
    for d, h in enumerate(H):
        e = trace.rows(PLOT_NUMBERS, 0.0, d) - combined(h, x)
        if adapts:
            g = [combined(h, row_of(P, n, i)) for i in range(n)]
            share = present / combined(h, g, R[d])
            x = [a + b * (share * e) for a, b in zip(x, g, strict=True)]
            P = [row_of(P, n, i)[j] - g[i] * (share * g[j]) for i in range(n) for j in range(i, n)]
        else:
            x = [combined([gain], [e * present], a) for a, gain in zip(x, update_matrices[0][d], strict=True)]
    trace.write(STATE, (*x, *P) if adapts else tuple(x))
    return trace.program(), numbers


def of_sums(components: int) -> Program:
    """The program of the sums of the leading components of a filter."""
    trace = Trace()
    estimates, truth, baseline = (trace.rows(array, (0.0,) * components) for array in (ESTIMATES, TRUTH, BASELINE))
    counts = trace.rows(COUNTED, 0.0) > 0.5
    for x, t, b in zip(estimates, truth, baseline, strict=True):
        e, d = where(counts, x - t, 0.0), b - t
        trace.add((e, e * e, e * (e * e), (e * e) * (e * e), (e * e) * (d * d)))
    return trace.program()


# ---- kernels ---------------------------------------------------------------------------------------------------------
class Work(NamedTuple):
    """Work arrays of a chunk of GROUPS eights: rows are eights of realisations.

    a, b (GROUPS, …)    unit normals of STRIP scans, of each pair the first and the second
    u, v (GROUPS, …)    uniform numbers in the same way
    truth, plots, presence, counted n, G D, 1 and 1 rows an eight; presence: 1 where there is a plot, else 0; counted:
                                    0 beyond the block's last realisation
    states (F, …)       states and covariances of the filters"""

    a: np.ndarray
    b: np.ndarray
    u: np.ndarray
    v: np.ndarray
    truth: np.ndarray
    plots: np.ndarray
    presence: np.ndarray
    counted: np.ndarray
    states: np.ndarray


class Shape(NamedTuple):
    """Rows of an eight: states, normals of a scan, plots' numbers, rows that a filter stores; numbers of a plot."""

    n: int
    normals: int
    plots: int
    stored_rows: int
    D: int


def follower(program: Program, sums: Program, shape: Shape):
    """The part that runs a filter through a scan of a chunk and adds to its sums."""
    step, add_errors, zero_sums, sum_count = (
        emitted(program),
        emitted_sums(sums),
        lanes.zeros(len(sums.sums)),
        len(sums.sums),
    )
    n, _, plots, stored_rows, _ = shape

    @part
    def follow(groups, states, baseline_states, numbers, plot_rows, presence, truth, counted, sums_of_scan):
        totals = zero_sums()
        for g in range(groups):
            state = row(states, g * stored_rows)
            step((state, numbers, row(plot_rows, g * plots), row(presence, g)))
            totals = add_errors(
                (state, row(truth, g * n), row(counted, g), row(baseline_states, g * stored_rows)), totals
            )
        for i in range(sum_count):
            sums_of_scan[i] += total(totals[i])

    return follow


def scene(begin: Program, move: Program, shape: Shape):
    """The part that draws truth and plots of a scan of a chunk."""
    opening, moving = emitted(begin), emitted(move)
    n, normals, plots_rows, _, _ = shape

    @part
    def draw(k, scans, groups, keys, first, probability, at_first, numbers, work):
        """Truth and plots of scan k."""
        normal_index, strip = k % STRIP * normals, (STRIP * normals + 1) >> 1
        if k % STRIP == 0:
            pairs = (min(STRIP, scans - k) * normals + 1) >> 1
            halves = (min(STRIP, scans - k) + 1) >> 1
            for g in range(groups):
                start = first + g * WIDTH
                fill_normal_strip(
                    keys[0], start, U(k * normals >> 1), work.a[g, : pairs * WIDTH], work.b[g, : pairs * WIDTH]
                )
                if probability < 1.0:
                    fill_uniform_strip(
                        keys[1], start, U(k >> 1), work.u[g, : halves * WIDTH], work.v[g, : halves * WIDTH]
                    )
        a, b = address(work.a), address(work.b)
        uniform = address(work.v) if k & 1 else address(work.u)
        truth, plots = address(work.truth), address(work.plots)
        for g in range(groups):
            pair_row = g * strip + (normal_index >> 1)
            state, to = row(truth, g * n), row(plots, g * plots_rows)
            # Of an odd number of normals a scan, every other one begins with the second of a pair.
            first_normals, second_normals = (
                (row(b, pair_row), row(a, pair_row + 1)) if normal_index & 1 else (row(a, pair_row), row(b, pair_row))
            )
            if k == 0:
                opening((state, address(at_first), first_normals, second_normals, to))
            else:
                moving((state, address(numbers), first_normals, second_normals, to))
            if probability < 1.0:
                u = get(uniform, g * (STRIP >> 1) + (k % STRIP >> 1))
                put(address(work.presence), g, where_greater(full(probability), u, full(1.0), full(0.0)))

    return draw


@cache
def kernels(begin: Program, move: Program, fixed: Program, adapting: Program, sums: Program, shape: Shape):
    """The kernels that add a block to sums and that draw realisations."""
    draw, follow_fixed, follow_adapting = (
        scene(begin, move, shape),
        follower(fixed, sums, shape),
        follower(adapting, sums, shape),
    )
    n, _, plots_rows, stored_rows, D = shape

    @kernel
    def simulate(keys, first, count, probability, at_first, moves, numbers, filter_order, starts, work, sums, errors):
        scans, components, eights = numbers.shape[1], errors.shape[2], errors.shape[3] // WIDTH
        truth, plots, presence, counted = address(work.truth), address(work.plots), address(work.presence), work.counted
        for done in range(0, count, GROUPS * WIDTH):
            groups = min(GROUPS, (count - done + WIDTH - 1) // WIDTH)
            for i in range(groups * WIDTH):
                counted[i] = 1.0 if done + i < count else 0.0
            for f in range(numbers.shape[0]):
                for i in range(groups * stored_rows):
                    put(address(work.states[f]), i, full(starts[f, i % stored_rows]))
            for k in range(scans):
                draw(k, scans, groups, keys, first + done, probability, at_first, moves[k], work)
                for f, sees, adapts in filter_order:
                    states, baseline_states, filter_numbers = (
                        address(work.states[f]),
                        address(work.states[filter_order[0, 0]]),
                        address(numbers[f, k]),
                    )
                    target, plot_rows = address(sums[f, k]), row(plots, sees * D)
                    if adapts:
                        follow_adapting(
                            groups,
                            states,
                            baseline_states,
                            filter_numbers,
                            plot_rows,
                            presence,
                            truth,
                            address(counted),
                            target,
                        )
                    else:
                        follow_fixed(
                            groups,
                            states,
                            baseline_states,
                            filter_numbers,
                            plot_rows,
                            presence,
                            truth,
                            address(counted),
                            target,
                        )
                    if eights > 0:
                        error_row = (f * scans + k) * components * eights + done // WIDTH
                        for g in range(groups):
                            for i in range(components):
                                e = get(states, g * stored_rows + i) - get(truth, g * n + i)
                                put(address(errors), error_row + i * eights + g, e)

    @kernel
    def realisations(keys, first, probability, at_first, moves, work, truth, plots):
        scans, eights = truth.shape[1], truth.shape[2] // WIDTH
        for done in range(0, eights, GROUPS):
            groups = min(GROUPS, eights - done)
            for k in range(scans):
                draw(k, scans, groups, keys, first + done * WIDTH, probability, at_first, moves[k], work)
                for g in range(groups):
                    eight, presence, missing = done + g, get(address(work.presence), g), full(np.nan)
                    for i in range(n):
                        put(address(truth), (i * scans + k) * eights + eight, get(address(work.truth), g * n + i))
                    for i in range(plots_rows):
                        z = where_greater(presence, full(0.5), get(address(work.plots), g * plots_rows + i), missing)
                        put(address(plots), (i * scans + k) * eights + eight, z)

    return simulate, realisations


class Simulator:
    """A problem with its formulas and their tables."""

    def __init__(self, problem: Problem, components: int):
        self.problem, self.components = problem, components
        groups, scans, D, n = problem.see.shape
        filters, adapts_mask = len(problem.x), problem.adapts.astype(bool)
        stored_rows = n + n * (n + 1) // 2 if adapts_mask.any() else n
        self.shape = Shape(n, problem.push.shape[1] + D, groups * D, stored_rows, D)
        (begin, at_first), (move, self.moves) = world(problem)
        self.at_first, self.keys = at_first[0], np.stack([problem.key, problem.detections])
        programs = {
            adapts: of_filters(problem, adapts_mask == adapts, adapts)
            for adapts in (False, True)
            if adapts in adapts_mask
        }
        self.numbers = np.zeros((filters, scans, max(numbers.shape[2] for _, numbers in programs.values())))
        for adapts, (_, numbers) in programs.items():
            self.numbers[adapts_mask == adapts, :, : numbers.shape[2]] = numbers
        self.filter_order = np.array(
            sorted(zip(range(filters), problem.sees, adapts_mask, strict=True), key=self._is_not_baseline), dtype=int
        )
        P = problem.P[(slice(None), *np.triu_indices(n))]
        self.starts = np.concatenate([problem.x, P], axis=1)[:, :stored_rows].copy()
        fixed, adapting = (programs.get(adaptive, next(iter(programs.values())))[0] for adaptive in (False, True))
        self.block, self.draw = kernels(begin, move, fixed, adapting, of_sums(components), self.shape)

    def _is_not_baseline(self, entry: tuple) -> bool:
        return entry[0] != self.problem.baseline

    def _work(self) -> Work:
        n, normals, plots, stored_rows, _ = self.shape
        strip, rows = (STRIP * normals + 1) // 2, (n, plots, 1, 1)
        work = Work(
            *(aligned_zeros(GROUPS, row_count * WIDTH) for row_count in (strip, strip, STRIP // 2, STRIP // 2)),
            *(aligned_zeros(GROUPS * row_count * WIDTH) for row_count in rows),
            aligned_zeros(len(self.starts), GROUPS * stored_rows * WIDTH),
        )
        work.presence[:] = 1.0
        return work

    def simulate_block(self, first: int, count: int, error: np.ndarray, paired: np.ndarray) -> None:
        """Simulate realisations first … first + count - 1 and add all filters' errors to the sums.

        error (F, K, C, 4) takes e, e², e³, e⁴ of the first C states, paired (F, K, C) e² times the baseline's e².
        Realisation i has the same plots and estimates in any block."""
        sums = self._simulated(first, count, 0)[0].reshape(*error.shape[:3], POWERS)
        error += sums[..., :4]
        paired += sums[..., 4]

    def errors(self, first: int, count: int) -> np.ndarray:
        """The errors (F, count, K, C) of the same realisations."""
        errors = self._simulated(first, count, -(-count // WIDTH) * WIDTH)[1]
        return errors[..., :count].transpose(0, 3, 1, 2)

    def _simulated(self, first: int, count: int, error_count: int) -> tuple[np.ndarray, np.ndarray]:
        """Sums (F, K, …) of a block, and errors (F, K, C, error_count) of whole eights, or of none."""
        shape = self.numbers.shape[:2]
        sums, errors = np.zeros((*shape, self.components * POWERS)), aligned_zeros(*shape, self.components, error_count)
        scene = self.keys, first, count, self.problem.probability, self.at_first, self.moves
        self.block(*scene, self.numbers, self.filter_order, self.starts, self._work(), sums, errors)
        return sums, errors

    def simulate_plots(self, first: int, count: int) -> tuple[np.ndarray, np.ndarray]:
        """The truth (count, K, n) and the plots (count, K, G, D) of realisations first … first + count - 1,
        not-a-number where one is missed."""
        groups, scans, D, n = self.problem.see.shape
        padded_count = -(-count // WIDTH) * WIDTH
        truth, plots = aligned_zeros(n, scans, padded_count), aligned_zeros(groups, D, scans, padded_count)
        scene = self.keys, first, self.problem.probability, self.at_first, self.moves
        self.draw(*scene, self._work(), truth, plots)
        return truth.transpose(2, 1, 0)[:count], plots.transpose(3, 2, 0, 1)[:count]


# ---- recorded plots --------------------------------------------------------------------------------------------------
@kernel
def follow(x, P, F, Q, H, R, gains, adapts, z, present, out):
    """One filter over rows of recorded plots; x (n,) and P (n, n), as before the first row, are overwritten. F, Q (m,
    n, n) to each row, H, gains (m, D, n), R (m, D), numbers z (m, D) where `present`. out (m, 2 n + D) takes estimates,
    standard deviations, and squared innovations over their variances where there is a number."""
    n, D = x.size, z.shape[1]
    product, p = np.empty((n, n)), np.empty(n)
    for k in range(z.shape[0]):
        extrapolate(x, P, product, p, F[k], Q[k], 1.0)
        for d in range(D):
            if present[k, d]:
                y, spread = innovation(x, P, H[k, d], z[k, d], p)
                S = spread + R[k, d]
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
            h = p[m] / S if adapts else gain[m]
            P[j, m] += g * h * S - g * p[m] - p[j] * h
            P[m, j] = P[j, m]

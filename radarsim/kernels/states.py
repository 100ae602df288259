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
SEEN, THERE = 2, 3
OWN, TRUTH, COUNTED, BASE = range(4)


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
    """Of matrices (m, K, …): each (…) as numbers of a program, and the table (m, K, width) of those that are read."""
    flat = np.concatenate([one.reshape(*one.shape[:2], -1) for one in matrices], axis=2)
    first = flat[0, 0]
    stands = (flat == first).all(axis=(0, 1)) & np.isin(first, (0, 1))
    read = iter(trace.plain(NUMBERS, (0.0,) * int((~stands).sum())))
    entries = np.empty(first.size, dtype=object)
    for i, fixed in enumerate(stands):
        entries[i] = float(first[i]) if fixed else next(read)
    ends = np.cumsum([one[0, 0].size for one in matrices])[:-1]
    shaped = [part.reshape(one.shape[2:]) for part, one in zip(np.split(entries, ends), matrices, strict=True)]
    return shaped, np.ascontiguousarray(np.concatenate([flat[..., ~stands], 0 * flat[..., :1]], axis=2))


def combined(weights: Sequence[Any], x: Sequence[Any], more: Any = 0.0) -> Any:
    """`more` and a sum of products, without those whose weight is zero in every case."""
    terms = [one if is_plain(w, 1) else w * one for w, one in zip(weights, x, strict=True) if not is_plain(w, 0)]
    return reduce(add, terms if is_plain(more, 0) and terms else [more, *terms])


def is_plain(number: Any, value: float) -> bool:
    """Whether a number stands in the formulas, and is this one."""
    return isinstance(number, float) and number == value


def world(problem: Problem) -> list[tuple[Program, np.ndarray]]:
    """The programs of truth and plots at the first scan and at others, each with its table (K, width)."""
    groups, scans, D, n = problem.see.shape
    r, made = problem.push.shape[1], []
    for state, noise in ((problem.start, problem.spread), (problem.move, problem.push)):
        trace = Trace()
        matrices = [np.broadcast_to(one, (1, scans, *one.shape)) for one in (state, noise)]
        matrices += [one.swapaxes(0, 1)[None] for one in (problem.see, problem.sigma)]
        (moved, L, see, sigma), numbers = table(trace, *matrices)
        w = [trace.rows((FIRST_NORMALS, SECOND_NORMALS)[i % 2], 0.0, i // 2) for i in range(r + D)]
        t = moved if state is problem.start else [combined(one, trace.rows(STATE, (0.0,) * n)) for one in moved]
        t = tuple(combined(one, w[:r], before) for one, before in zip(L, t, strict=True))
        trace.write(STATE, t)
        for g in range(groups):
            for d in range(D):
                trace.write(PLOTS, combined([sigma[g, d]], [w[r + d]], combined(see[g, d], t)), g * D + d)
        made.append((trace.program(), numbers[0]))
    return made


def of_filters(problem: Problem, some: np.ndarray, adapts: bool) -> tuple[Program, np.ndarray]:
    """The program of a scan of some filters (F,), of all the same, and their tables (F, K, width).

    At the first scan the estimates stay as they are before its plot: there F is the unit matrix, and Q zero."""
    trace, n, scans = Trace(), problem.x.shape[1], problem.H.shape[1]
    F, Q = (np.repeat(one[some][:, None], scans, axis=1) for one in (problem.F, problem.Q))
    F[:, 0], Q[:, 0] = np.eye(n), 0.0
    of_plots = (Q, problem.R[some]) if adapts else (problem.gains[some],)
    (F, H, *of_plots), numbers = table(trace, F, problem.H[some], *of_plots)
    x = trace.rows(STATE, (0.0,) * n)
    x = [combined(one, x) for one in F]
    there = trace.rows(THERE, 0.0) if problem.probability < 1 else 1.0
    if adapts:
        Q, R = of_plots
        P = trace.rows(STATE, (0.0,) * (n * (n + 1) // 2), n)
        moved = [[combined(F[i], row_of(P, n, j)) for j in range(n)] for i in range(n)]
        P = [combined(F[j], moved[i], Q[i, j]) for i in range(n) for j in range(i, n)]
    for d, h in enumerate(H):
        e = trace.rows(SEEN, 0.0, d) - combined(h, x)
        if adapts:
            g = [combined(h, row_of(P, n, i)) for i in range(n)]
            share = there / combined(h, g, R[d])
            x = [a + b * (share * e) for a, b in zip(x, g, strict=True)]
            P = [row_of(P, n, i)[j] - g[i] * (share * g[j]) for i in range(n) for j in range(i, n)]
        else:
            x = [combined([gain], [e * there], a) for a, gain in zip(x, of_plots[0][d], strict=True)]
    trace.write(STATE, (*x, *P) if adapts else tuple(x))
    return trace.program(), numbers


def of_sums(components: int) -> Program:
    """The program of the sums of the leading components of a filter."""
    trace = Trace()
    own, true, base = (trace.rows(array, (0.0,) * components) for array in (OWN, TRUTH, BASE))
    counts = trace.rows(COUNTED, 0.0) > 0.5
    for x, t, b in zip(own, true, base, strict=True):
        e, d = where(counts, x - t, 0.0), b - t
        trace.add((e, e * e, e * (e * e), (e * e) * (e * e), (e * e) * (d * d)))
    return trace.program()


# ---- kernels ---------------------------------------------------------------------------------------------------------
class Work(NamedTuple):
    """Room for a chunk of GROUPS eights: rows are eights of realisations.

    a, b (GROUPS, …)    unit normals of STRIP scans, of each pair the first and the second
    u, v (GROUPS, …)    uniform numbers in the same way
    truth, plots, there, counted    n, G D, 1 and 1 rows an eight; there: 1 where there is a plot, else 0; counted: 0
                                    beyond the block's last realisation
    states (F, …)       what a filter keeps"""

    a: np.ndarray
    b: np.ndarray
    u: np.ndarray
    v: np.ndarray
    truth: np.ndarray
    plots: np.ndarray
    there: np.ndarray
    counted: np.ndarray
    states: np.ndarray


class Shape(NamedTuple):
    """Rows of an eight: states, unit normals of a scan, plots' numbers; what a filter keeps; numbers of a plot."""

    n: int
    normals: int
    plots: int
    kept: int
    D: int


def follower(program: Program, sums: Program, shape: Shape):
    """The part that runs a filter through a scan of a chunk and adds to its sums."""
    step, judged, nothing, many = emitted(program), emitted_sums(sums), lanes.zeros(len(sums.sums)), len(sums.sums)
    n, _, plots, kept, _ = shape

    @part
    def follow(groups, own, base, numbers, seen, there, truth, counted, held):
        found = nothing()
        for g in range(groups):
            state = row(own, g * kept)
            step((state, numbers, row(seen, g * plots), row(there, g)))
            found = judged((state, row(truth, g * n), row(counted, g), row(base, g * kept)), found)
        for i in range(many):
            held[i] += total(found[i])

    return follow


def scene(begin: Program, move: Program, shape: Shape):
    """The part that draws truth and plots of a scan of a chunk."""
    opening, moving = emitted(begin), emitted(move)
    n, normals, plots_rows, _, _ = shape

    @part
    def draw(k, scans, groups, keys, first, probability, at_first, numbers, work):
        """Truth and plots of scan k."""
        at, strip = k % STRIP * normals, (STRIP * normals + 1) >> 1
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
            one = g * strip + (at >> 1)
            state, to = row(truth, g * n), row(plots, g * plots_rows)
            # Of an odd number of normals a scan, every other one begins with the second of a pair.
            first_normals, second_normals = (row(b, one), row(a, one + 1)) if at & 1 else (row(a, one), row(b, one))
            if k == 0:
                opening((state, address(at_first), first_normals, second_normals, to))
            else:
                moving((state, address(numbers), first_normals, second_normals, to))
            if probability < 1.0:
                drawn = get(uniform, g * (STRIP >> 1) + (k % STRIP >> 1))
                put(address(work.there), g, where_greater(full(probability), drawn, full(1.0), full(0.0)))

    return draw


@cache
def kernels(begin: Program, move: Program, fixed: Program, own: Program, sums: Program, shape: Shape):
    """The kernels that add a block to sums and that draw realisations."""
    draw, follow_fixed, follow_own = scene(begin, move, shape), follower(fixed, sums, shape), follower(own, sums, shape)
    n, _, plots_rows, kept, D = shape

    @kernel
    def simulate(keys, first, count, probability, at_first, moves, numbers, which, starts, work, held, each):
        scans, shown, eights = numbers.shape[1], each.shape[2], each.shape[3] // WIDTH
        truth, plots, there, counted = address(work.truth), address(work.plots), address(work.there), work.counted
        for done in range(0, count, GROUPS * WIDTH):
            groups = min(GROUPS, (count - done + WIDTH - 1) // WIDTH)
            for i in range(groups * WIDTH):
                counted[i] = 1.0 if done + i < count else 0.0
            for f in range(numbers.shape[0]):
                for i in range(groups * kept):
                    put(address(work.states[f]), i, full(starts[f, i % kept]))
            for k in range(scans):
                draw(k, scans, groups, keys, first + done, probability, at_first, moves[k], work)
                for f, sees, adapts in which:
                    own, base, of = address(work.states[f]), address(work.states[which[0, 0]]), address(numbers[f, k])
                    to, seen = address(held[f, k]), row(plots, sees * D)
                    if adapts:
                        follow_own(groups, own, base, of, seen, there, truth, address(counted), to)
                    else:
                        follow_fixed(groups, own, base, of, seen, there, truth, address(counted), to)
                    if eights > 0:
                        at = (f * scans + k) * shown * eights + done // WIDTH
                        for g in range(groups):
                            for i in range(shown):
                                e = get(own, g * kept + i) - get(truth, g * n + i)
                                put(address(each), at + i * eights + g, e)

    @kernel
    def realisations(keys, first, probability, at_first, moves, work, truth, plots):
        scans, eights = truth.shape[1], truth.shape[2] // WIDTH
        for done in range(0, eights, GROUPS):
            groups = min(GROUPS, eights - done)
            for k in range(scans):
                draw(k, scans, groups, keys, first + done * WIDTH, probability, at_first, moves[k], work)
                for g in range(groups):
                    at, there, none = done + g, get(address(work.there), g), full(np.nan)
                    for i in range(n):
                        put(address(truth), (i * scans + k) * eights + at, get(address(work.truth), g * n + i))
                    for i in range(plots_rows):
                        z = where_greater(there, full(0.5), get(address(work.plots), g * plots_rows + i), none)
                        put(address(plots), (i * scans + k) * eights + at, z)

    return simulate, realisations


class Simulator:
    """A problem with its formulas and their tables."""

    def __init__(self, problem: Problem, components: int):
        self.problem, self.components = problem, components
        groups, scans, D, n = problem.see.shape
        filters, own = len(problem.x), problem.adapts.astype(bool)
        kept = n + n * (n + 1) // 2 if own.any() else n
        self.shape = Shape(n, problem.push.shape[1] + D, groups * D, kept, D)
        (begin, at_first), (move, self.moves) = world(problem)
        self.at_first, self.keys = at_first[0], np.stack([problem.key, problem.detections])
        programs = {adapts: of_filters(problem, own == adapts, adapts) for adapts in (False, True) if adapts in own}
        self.numbers = np.zeros((filters, scans, max(numbers.shape[2] for _, numbers in programs.values())))
        for adapts, (_, numbers) in programs.items():
            self.numbers[own == adapts, :, : numbers.shape[2]] = numbers
        self.which = np.array(sorted(zip(range(filters), problem.sees, own, strict=True), key=self._last), dtype=int)
        P = problem.P[(slice(None), *np.triu_indices(n))]
        self.starts = np.concatenate([problem.x, P], axis=1)[:, :kept].copy()
        fixed, adapting = (programs.get(one, next(iter(programs.values())))[0] for one in (False, True))
        self.block, self.draw = kernels(begin, move, fixed, adapting, of_sums(components), self.shape)

    def _last(self, one: tuple) -> bool:
        return one[0] != self.problem.baseline

    def _work(self) -> Work:
        n, normals, plots, kept, _ = self.shape
        strip, rows = (STRIP * normals + 1) // 2, (n, plots, 1, 1)
        made = Work(
            *(aligned_zeros(GROUPS, many * WIDTH) for many in (strip, strip, STRIP // 2, STRIP // 2)),
            *(aligned_zeros(GROUPS * many * WIDTH) for many in rows),
            aligned_zeros(len(self.starts), GROUPS * kept * WIDTH),
        )
        made.there[:] = 1.0
        return made

    def simulate_block(self, first: int, count: int, error: np.ndarray, paired: np.ndarray) -> None:
        """Simulate realisations first … first + count - 1 and add all filters' errors to the sums.

        error (F, K, C, 4) takes e, e², e³, e⁴ of the first C states, paired (F, K, C) e² times the baseline's e².
        Realisation i has the same plots and estimates in any block."""
        sums = self._simulated(first, count, 0)[0].reshape(*error.shape[:3], POWERS)
        error += sums[..., :4]
        paired += sums[..., 4]

    def errors(self, first: int, count: int) -> np.ndarray:
        """The errors (F, count, K, C) of the same realisations."""
        each = self._simulated(first, count, -(-count // WIDTH) * WIDTH)[1]
        return each[..., :count].transpose(0, 3, 1, 2)

    def _simulated(self, first: int, count: int, kept: int) -> tuple[np.ndarray, np.ndarray]:
        """Sums (F, K, …) of a block, and the errors (F, K, C, kept) of whole eights or of none."""
        shape = self.numbers.shape[:2]
        held, each = np.zeros((*shape, self.components * POWERS)), aligned_zeros(*shape, self.components, kept)
        of = self.keys, first, count, self.problem.probability, self.at_first, self.moves
        self.block(*of, self.numbers, self.which, self.starts, self._work(), held, each)
        return held, each

    def simulate_plots(self, first: int, count: int) -> tuple[np.ndarray, np.ndarray]:
        """The truth (count, K, n) and the plots (count, K, G, D) of realisations first … first + count - 1,
        not-a-number where one is missed."""
        groups, scans, D, n = self.problem.see.shape
        whole = -(-count // WIDTH) * WIDTH
        truth, plots = aligned_zeros(n, scans, whole), aligned_zeros(groups, D, scans, whole)
        of = self.keys, first, self.problem.probability, self.at_first, self.moves
        self.draw(*of, self._work(), truth, plots)
        return truth.transpose(2, 1, 0)[:count], plots.transpose(3, 2, 0, 1)[:count]


# ---- recorded plots --------------------------------------------------------------------------------------------------
@kernel
def follow(x, P, F, Q, H, R, gains, adapts, z, there, out):
    """One filter over rows of recorded plots; x (n,) and P (n, n), as before the first row, are overwritten. F, Q (m,
    n, n) to each row, H, gains (m, D, n), R (m, D), numbers z (m, D) where `there`. out (m, 2 n + D) takes estimates,
    standard deviations, and squared innovations over their variances where there is a number."""
    n, D = x.size, z.shape[1]
    room, p = np.empty((n, n)), np.empty(n)
    for k in range(z.shape[0]):
        extrapolate(x, P, room, p, F[k], Q[k], 1.0)
        for d in range(D):
            if there[k, d]:
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
            other = p[m] / S if adapts else gain[m]
            P[j, m] += g * other * S - g * p[m] - p[j] * other
            P[m, j] = P[j, m]

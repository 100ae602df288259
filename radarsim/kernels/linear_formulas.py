"""The formulas of linear filters of any number of states, recorded from their matrices.

What is 0 or 1 at all scans stands in the formulas, so that a coupling that is not there takes no time; other numbers
are read, so that keys change no kernel. A plot's numbers have independent errors and are taken in one after the other.

Letters as in the book: t truth, x estimate, P its covariance, F transition, Q noise of the process, H row of a number.
"""

from collections.abc import Sequence
from functools import reduce
from operator import add
from typing import Any, NamedTuple

import numpy as np

from radarsim.kernels.small_matrices import row_of
from radarsim.kernels.tracing import Program, Trace, where

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


def record_matrices(trace: Trace, *matrices: np.ndarray) -> tuple[list[np.ndarray], np.ndarray]:
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


def linear_combination(weights: Sequence[Any], x: Sequence[Any], constant: Any = 0.0) -> Any:
    """`constant` plus the sum of products, without the products whose weight is zero in every case."""
    terms = [
        value if is_constant_of(w, 1) else w * value
        for w, value in zip(weights, x, strict=True)
        if not is_constant_of(w, 0)
    ]
    return reduce(add, terms if is_constant_of(constant, 0) and terms else [constant, *terms])


def is_constant_of(number: Any, value: float) -> bool:
    """Whether a number is a constant of the formulas and has this value."""
    return isinstance(number, float) and number == value


def truth_programs(problem: Problem) -> list[tuple[Program, np.ndarray]]:
    """The programs of truth and plots at the first scan and at others, each with its table (K, width)."""
    groups, scans, D, n = problem.see.shape
    r, programs = problem.push.shape[1], []
    for state, noise in ((problem.start, problem.spread), (problem.move, problem.push)):
        trace = Trace()
        matrices = [np.broadcast_to(row, (1, scans, *row.shape)) for row in (state, noise)]
        matrices += [row.swapaxes(0, 1)[None] for row in (problem.see, problem.sigma)]
        (moved, L, see, sigma), numbers = record_matrices(trace, *matrices)
        w = [trace.rows((FIRST_NORMALS, SECOND_NORMALS)[i % 2], 0.0, i // 2) for i in range(r + D)]
        t = (
            moved
            if state is problem.start
            else [linear_combination(row, trace.rows(STATE, (0.0,) * n)) for row in moved]
        )
        t = tuple(linear_combination(row, w[:r], before) for row, before in zip(L, t, strict=True))
        trace.write(STATE, t)
        for g in range(groups):
            for d in range(D):
                trace.write(
                    PLOTS, linear_combination([sigma[g, d]], [w[r + d]], linear_combination(see[g, d], t)), g * D + d
                )
        programs.append((trace.program(), numbers[0]))
    return programs


def filter_program(problem: Problem, selection: np.ndarray, adapts: bool) -> tuple[Program, np.ndarray]:
    """The program of a scan, the same for all filters in `selection` (F,), and their tables (F, K, width).

    At the first scan the estimates stay as they are before its plot: there F is the unit matrix, and Q zero."""
    trace, n, scans = Trace(), problem.x.shape[1], problem.H.shape[1]
    F, Q = (np.repeat(matrix[selection][:, None], scans, axis=1) for matrix in (problem.F, problem.Q))
    F[:, 0], Q[:, 0] = np.eye(n), 0.0
    update_matrices = (Q, problem.R[selection]) if adapts else (problem.gains[selection],)
    (F, H, *update_matrices), numbers = record_matrices(trace, F, problem.H[selection], *update_matrices)
    x = trace.rows(STATE, (0.0,) * n)
    x = [linear_combination(matrix, x) for matrix in F]
    present = trace.rows(PRESENCE, 0.0) if problem.probability < 1 else 1.0
    if adapts:
        Q, R = update_matrices
        P = trace.rows(STATE, (0.0,) * (n * (n + 1) // 2), n)
        moved = [[linear_combination(F[i], row_of(P, n, j)) for j in range(n)] for i in range(n)]
        P = [linear_combination(F[j], moved[i], Q[i, j]) for i in range(n) for j in range(i, n)]
    for d, h in enumerate(H):
        e = trace.rows(PLOT_NUMBERS, 0.0, d) - linear_combination(h, x)
        if adapts:
            g = [linear_combination(h, row_of(P, n, i)) for i in range(n)]
            share = present / linear_combination(h, g, R[d])
            x = [a + b * (share * e) for a, b in zip(x, g, strict=True)]
            P = [row_of(P, n, i)[j] - g[i] * (share * g[j]) for i in range(n) for j in range(i, n)]
        else:
            x = [linear_combination([gain], [e * present], a) for a, gain in zip(x, update_matrices[0][d], strict=True)]
    trace.write(STATE, (*x, *P) if adapts else tuple(x))
    return trace.program(), numbers


def sum_program(components: int) -> Program:
    """The program of the sums of the leading components of a filter."""
    trace = Trace()
    estimates, truth, baseline = (trace.rows(array, (0.0,) * components) for array in (ESTIMATES, TRUTH, BASELINE))
    counts = trace.rows(COUNTED, 0.0) > 0.5
    for x, t, b in zip(estimates, truth, baseline, strict=True):
        e, d = where(counts, x - t, 0.0), b - t
        trace.add((e, e * e, e * (e * e), (e * e) * (e * e), (e * e) * (d * d)))
    return trace.program()

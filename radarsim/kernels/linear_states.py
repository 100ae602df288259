"""Linear filters of any number of states over many realisations: truth, plots, scans, sums of errors.

The truth is a linear process with noise, so each realisation has its own; a filter may believe another model than the
true one. Realisations lie in eights, some GROUPS of them in a chunk that stays in cache, scans outermost."""

from functools import cache
from typing import NamedTuple

import numpy as np

from radarsim.kernels import lane_programs
from radarsim.kernels.compiler import aligned_zeros, kernel, kernel_part
from radarsim.kernels.lane_programs import emit_program, emit_sums
from radarsim.kernels.lanes import WIDTH, address, full, get, put, row, total, where_greater
from radarsim.kernels.linear_formulas import Problem, filter_program, sum_program, truth_programs
from radarsim.kernels.random import U, fill_normal_strip, fill_uniform_strip
from radarsim.kernels.tracing import Program

GROUPS = 64  # eights in a chunk
STRIP = 16  # scans whose noise is drawn at once
POWERS = 5  # sums of a component: e, e², e³, e⁴, and e² times the baseline's e²


class Workspace(NamedTuple):
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


class RowCounts(NamedTuple):
    """Rows of an eight: states, normals of a scan, plots' numbers, rows that a filter stores; numbers of a plot."""

    n: int
    normals: int
    plots: int
    stored_rows: int
    D: int


def filter_part(program: Program, sums: Program, shape: RowCounts):
    """The part that runs a filter through a scan of a chunk and adds to its sums."""
    step, add_errors, zero_sums, sum_count = (
        emit_program(program),
        emit_sums(sums),
        lane_programs.zero_lanes(len(sums.sums)),
        len(sums.sums),
    )
    n, _, plots, stored_rows, _ = shape

    @kernel_part
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


def truth_part(begin: Program, move: Program, shape: RowCounts):
    """The part that draws truth and plots of a scan of a chunk."""
    opening, moving = emit_program(begin), emit_program(move)
    n, normals, plots_rows, _, _ = shape

    @kernel_part
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
def compile_kernels(begin: Program, move: Program, fixed: Program, adapting: Program, sums: Program, shape: RowCounts):
    """The kernels that add a block to sums and that draw realisations."""
    draw, follow_fixed, follow_adapting = (
        truth_part(begin, move, shape),
        filter_part(fixed, sums, shape),
        filter_part(adapting, sums, shape),
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
        self.shape = RowCounts(n, problem.push.shape[1] + D, groups * D, stored_rows, D)
        (begin, at_first), (move, self.moves) = truth_programs(problem)
        self.at_first, self.keys = at_first[0], np.stack([problem.key, problem.detections])
        programs = {
            adapts: filter_program(problem, adapts_mask == adapts, adapts)
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
        self.block, self.draw = compile_kernels(begin, move, fixed, adapting, sum_program(components), self.shape)

    def _is_not_baseline(self, entry: tuple) -> bool:
        return entry[0] != self.problem.baseline

    def _work(self) -> Workspace:
        n, normals, plots, stored_rows, _ = self.shape
        strip, rows = (STRIP * normals + 1) // 2, (n, plots, 1, 1)
        work = Workspace(
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

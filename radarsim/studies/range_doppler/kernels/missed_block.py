"""P1's filters where plots may be missed or biased, or the target's start is random: a block of realisations."""

from typing import NamedTuple

import numpy as np

from radarsim.kernels import lanes
from radarsim.kernels.compiler import aligned_zeros, kernel, kernel_part
from radarsim.kernels.lanes import address, row
from radarsim.kernels.random import fill_uniform_pairs
from radarsim.kernels.second_order import COMPONENT_PAIRS, fill_plots, with_kernel_arrays
from radarsim.studies.range_doppler.kernels.missed_draws import count_plots, displace, displace_plots, draw_once
from radarsim.studies.range_doppler.kernels.missed_scores import FILTER_SUMS, PAIR_SUMS, pair, score
from radarsim.studies.range_doppler.kernels.missed_steps import (
    CHUNK,
    addresses,
    advance,
    advance_by_gains,
    make_starts,
    make_workspace,
)

ROWS = (FILTER_SUMS + PAIR_SUMS) // lanes.WIDTH  # of what is found of a filter and scan


class Problem(NamedTuple):
    """What is simulated: the truth and its plots over K scans, and the F filters that see them."""

    keys: np.ndarray  #: (3, 2) of the streams of noise, of misses, and of what is drawn once a realisation
    truth: np.ndarray  #: (K, 3) range, radial velocity and acceleration
    sigma: np.ndarray  #: (2,) standard deviations of the plots' range and velocity
    bias: np.ndarray  #: (2,) their mean errors
    sigma_bias: np.ndarray  #: (2,) standard deviations of the errors that are drawn once a realisation
    #: (6,) standard deviations of x, y, z and of vx, vy, vz at the first scan of a flight in space, drawn once a
    #: realisation
    sigma_flight: np.ndarray
    #: (K or 0, 9) that flight, (x, vx, ax, y, …), of which truth is the motion in range; none: not drawn
    flight: np.ndarray
    detection: float  #: probability that a scan has its plot
    dt: float  #: scan period, s
    observes: np.ndarray  #: (F,) 1: the filter observes the range alone; 2: range and velocity
    start: np.ndarray  #: (F,) plots in its least-squares start
    Q: np.ndarray  #: (F, 6) covariance that a scan adds, packed
    baseline: int  #: the filter that others are compared with
    has_given_gains: np.ndarray  #: (F,) 1: its gains are given, and every scan has its plot; else 0
    gains: np.ndarray  #: (F, K, 3, 2) of such a filter, not read of others
    believed: np.ndarray  #: (F, K, 6) the covariance that it believes with them, packed

    def plain(self) -> "Problem":
        """The same with arrays and numbers as the kernels take them."""
        return with_kernel_arrays(self)


class Sums(NamedTuple):
    """Sums over realisations of the errors e = estimate − truth, where a filter has an estimate."""

    error: np.ndarray  #: (F, K, 3, 4) e, e², e³, e⁴
    estimates: np.ndarray  #: (F, K, 3) how many there are
    cross: np.ndarray  #: (F, K, 3) the products of two components' errors, as in `kernels.second_order`
    paired: np.ndarray  #: (F, K, 3) e² times the baseline's e², where both have an estimate
    both: np.ndarray  #: (F, K, 3, 5) where both have one: how many, e², e⁴, and the same two of the baseline
    believed: np.ndarray  #: (F, K, 3) the variances that the filter believes
    nees: np.ndarray  #: (F, K, 3) where it has started: their number, q = eᵀP⁻¹e / 3, q²


def shapes(filters: int, scans: int) -> dict[str, tuple[int, ...]]:
    """The shapes of `Sums`, by name."""
    rows = (filters, scans, 3)
    return {
        "error": (*rows, 4),
        "estimates": rows,
        "cross": (filters, scans, len(COMPONENT_PAIRS)),
        "paired": rows,
        "both": (*rows, 5),
        "believed": rows,
        "nees": rows,
    }


@kernel_part
def begin_chunk(keys, first, arrays, bias, sigma_bias, sigma_flight):
    """A new chunk: nothing has come yet, and what is drawn once a realisation is drawn; whether anything is."""
    has_random_offsets = np.any(sigma_bias > 0.0) or np.any(sigma_flight > 0.0)
    arrays.count[:] = 0.0
    arrays.first[:] = 0.0
    arrays.x[:] = 0.0
    arrays.p[:] = 0.0
    arrays.normal[:] = 0.0
    arrays.state[:] = 0.0
    for m in range(2):
        arrays.offset[m, :] = bias[m]
    if has_random_offsets:
        draw_once(keys, first, arrays, bias, sigma_bias, sigma_flight)
    return has_random_offsets


@kernel_part
def keep_errors(e, has, errors):
    """Errors e (F, 3, CHUNK) into errors (F, 3, n), not-a-number where there is no estimate."""
    for f in range(errors.shape[0]):
        for c in range(3):
            for i in range(errors.shape[2]):
                errors[f, c, i] = e[f, c, i] if has[f, c, i] > 0.0 else np.nan


@kernel
def add_block(arrays, first, count, problem, block_sums, errors):
    """`simulate_block` for a plain problem, with a chunk's work arrays, into block_sums (F, K, OWN +
    PAIRED), and into errors (F, K, 3, count or 0)."""
    keys, truth, sigma, bias, sigma_bias, sigma_flight, flight, detection, dt = problem[:9]
    observes, start, Q, baseline, has_given_gains, gains, believed = problem[9:]
    filters, scans, R, memory, sums = (
        observes.size,
        truth.shape[0],
        sigma * sigma,
        addresses(arrays),
        address(block_sums),
    )
    detected, second_uniforms, next_word = arrays.detected, arrays.other, np.empty(CHUNK, np.uint64)
    running = np.zeros(filters, dtype=np.bool_)  # filters that have started in every realisation of the chunk
    for done in range(0, count, CHUNK):
        # A partial chunk is computed whole, with no plots beyond its end, so each realisation goes through the same
        # instructions.
        n = min(CHUNK, count - done)
        has_random_offsets = begin_chunk(keys, first + done, arrays, bias, sigma_bias, sigma_flight)
        displaced = has_random_offsets or np.any(bias != 0.0)
        running[:] = False
        for k in range(scans):
            if has_random_offsets and flight.shape[0] > 0:
                displace(arrays, flight[k], truth[k], k * dt)
            fill_plots(keys[0], first + done, k, truth[k], sigma, next_word, arrays.plots[0], arrays.plots[1])
            if displaced:
                displace_plots(memory)
            if detection < 1.0 and k % 2 == 0:
                fill_uniform_pairs(keys[1], first + done, k // 2, detected, second_uniforms)
            count_plots(memory, k, detection, n)
            for f in range(filters):
                if k > 0 and has_given_gains[f] == 1:
                    advance_by_gains(memory, f, dt, gains[f, k], believed[f, k])
                elif k > 0:
                    advance(memory, f, dt, (observes[f], Q[f]), R)
                if not running[f]:
                    weights = 1.0 / R[0], 1.0 / (R[1] * dt * dt) if observes[f] == 2 else 0.0
                    running[f] = make_starts(memory, f, k, start[f], weights, dt)
                score(memory, f, start[f], observes[f], truth[k], R, row(sums, (f * scans + k) * ROWS))
            for f in range(filters):
                if f != baseline:
                    pair(memory, f, baseline, row(sums, (f * scans + k) * ROWS + FILTER_SUMS // lanes.WIDTH))
            if errors.shape[3] > 0:
                keep_errors(arrays.e, arrays.has, errors[:, k, :, done : done + n])


@kernel
def fill_simulated(arrays, first, problem, plots, displacement):
    """`simulate_plots` into plots (2, K, n); displacement (3, K, n or 0) of the truth; arrays: the work arrays."""
    keys, truth, sigma, bias, sigma_bias, sigma_flight, flight, detection, dt = problem[:9]
    memory, next_word = addresses(arrays), np.empty(CHUNK, np.uint64)
    for done in range(0, plots.shape[2], CHUNK):
        n = min(CHUNK, plots.shape[2] - done)
        has_random_offsets = begin_chunk(keys, first + done, arrays, bias, sigma_bias, sigma_flight)
        displaced = has_random_offsets or np.any(bias != 0.0)
        for k in range(plots.shape[1]):
            if has_random_offsets and flight.shape[0] > 0:
                displace(arrays, flight[k], truth[k], k * dt)
            fill_plots(keys[0], first + done, k, truth[k], sigma, next_word, arrays.plots[0], arrays.plots[1])
            if displaced:
                displace_plots(memory)
            if detection < 1.0 and k % 2 == 0:
                fill_uniform_pairs(keys[1], first + done, k // 2, arrays.detected, arrays.other)
            count_plots(memory, k, detection, n)
            for m in range(2):
                for i in range(n):
                    plots[m, k, done + i] = arrays.plots[m, i] if arrays.detected[i] > 0.0 else np.nan
            if displacement.shape[2] > 0:
                for m in range(displacement.shape[0]):
                    for i in range(n):
                        displacement[m, k, done + i] = arrays.state[m, i]


def add_block_sums(block_sums: np.ndarray, baseline: int, sums: Sums) -> None:
    """Add the sums of `score` and `pair`, (F, K, OWN + PAIRED), to those of the problem."""
    rows = (*block_sums.shape[:2], 3)
    error = block_sums[..., :12].reshape(*rows, 4)
    estimates = block_sums[..., 18:21]
    pairs = block_sums[..., FILTER_SUMS : FILTER_SUMS + 18].reshape(*rows, 6).copy()
    squares, fourth_powers = error[baseline, ..., 1], error[baseline, ..., 3]
    pairs[baseline] = np.stack(
        [estimates[baseline], squares, fourth_powers, squares, fourth_powers, fourth_powers], axis=-1
    )
    for total, addend in zip(
        sums,
        (
            error,
            estimates,
            block_sums[..., 12:15],
            pairs[..., 5],
            pairs[..., :5],
            block_sums[..., 21:24],
            block_sums[..., 15:18],
        ),
        strict=True,
    ):
        total += addend


def simulate_block(problem: Problem, first: int, count: int, sums: Sums) -> None:
    """Simulate realisations first … first + count - 1 (any count > 0) and add all filters' errors to the sums. The
    arrays of sums are float64 and contiguous. Realisation i has the same plots and estimates in any block."""
    block_sums, _ = simulate(problem, first, count, 0)
    add_block_sums(block_sums, int(problem.baseline), sums)


def errors(problem: Problem, first: int, count: int) -> np.ndarray:
    """The errors (F, count, K, 3) of the realisations of `simulate_block`; NaN where a filter has no estimate."""
    return simulate(problem, first, count, count)[1].transpose(0, 3, 1, 2)


def simulate(problem: Problem, first: int, count: int, error_count: int) -> tuple[np.ndarray, np.ndarray]:
    """Sums (F, K, OWN + PAIRED) of a block, and the errors (F, K, 3, error_count) of all realisations or none."""
    problem = problem.plain()
    filters, scans = len(problem.observes), len(problem.truth)
    block_sums, errors = (
        aligned_zeros(filters, scans, FILTER_SUMS + PAIR_SUMS),
        np.empty((filters, scans, 3, error_count)),
    )
    add_block(make_workspace(filters), int(first), int(count), problem, block_sums, errors)
    return block_sums, errors


def simulate_plots(problem: Problem, first: int, count: int) -> tuple[np.ndarray, np.ndarray]:
    """The plots (count, K, 2) that `simulate_block` draws for realisations first … first + count - 1, not-a-number
    where missed, and the truth (count, K, 3), a view that cannot be written where all have the same."""
    problem, scans = problem.plain(), len(problem.truth)
    is_random = len(problem.flight) > 0 and problem.sigma_flight.any()
    plots, displacement = np.empty((2, scans, count)), np.empty((3, scans, count if is_random else 0))
    fill_simulated(make_workspace(1), int(first), problem, plots, displacement)
    if is_random:
        displacement += problem.truth.T[:, :, None]
        return plots.transpose(2, 1, 0), displacement.transpose(2, 1, 0)
    return plots.transpose(2, 1, 0), np.broadcast_to(problem.truth, (count, scans, 3))

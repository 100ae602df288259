"""P1's filters where plots may be missed or biased, or the target's start is drawn: a covariance to each realisation.

Realisations lie in chunks that stay in cache, scans outermost; eight of them go through a formula at once. Where a plot
is missed a filter extrapolates. It starts with as many plots as its least-squares start takes; before, its estimates
are the plots that come, of what it observes, and at a scan without one it has none."""

from typing import NamedTuple

import numpy as np

from radarsim.kernels.compile import aligned_zeros, kernel, part
from radarsim.kernels.lanes import WIDTH, address, row
from radarsim.kernels.linear import CROSSED, as_taken, fill_plots
from radarsim.kernels.random import fill_uniform_pairs
from radarsim.studies.range_doppler.kernels import steps

ROWS = (steps.OWN + steps.PAIRED) // WIDTH  # of what is found of a filter and scan


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
    given: np.ndarray  #: (F,) 1: its gains are given, and every scan has its plot; else 0
    gains: np.ndarray  #: (F, K, 3, 2) of such a filter, not read of others
    believed: np.ndarray  #: (F, K, 6) the covariance that it believes with them, packed

    def plain(self) -> "Problem":
        """The same with arrays and numbers as the kernels take them."""
        return as_taken(self)


class Sums(NamedTuple):
    """Sums over realisations of the errors e = estimate − truth, where a filter has an estimate."""

    error: np.ndarray  #: (F, K, 3, 4) e, e², e³, e⁴
    estimates: np.ndarray  #: (F, K, 3) how many there are
    cross: np.ndarray  #: (F, K, 3) the products of two components' errors, as in `kernels.linear`
    paired: np.ndarray  #: (F, K, 3) e² times the baseline's e², where both have an estimate
    both: np.ndarray  #: (F, K, 3, 5) where both have one: how many, e², e⁴, and the same two of the baseline
    believed: np.ndarray  #: (F, K, 3) the variances that the filter believes
    nees: np.ndarray  #: (F, K, 3) where it has started: their number, q = eᵀP⁻¹e / 3, q²


def shapes(filters: int, scans: int) -> dict[str, tuple[int, ...]]:
    """The shapes of `Sums`, by name."""
    each = (filters, scans, 3)
    return {
        "error": (*each, 4),
        "estimates": each,
        "cross": (filters, scans, len(CROSSED)),
        "paired": each,
        "both": (*each, 5),
        "believed": each,
        "nees": each,
    }


@part
def begin_chunk(keys, first, made, bias, sigma_bias, sigma_flight):
    """A new chunk: nothing has come yet, and what is drawn once a realisation is drawn; whether anything is."""
    drawn = np.any(sigma_bias > 0.0) or np.any(sigma_flight > 0.0)
    made.count[:] = 0.0
    made.first[:] = 0.0
    made.x[:] = 0.0
    made.p[:] = 0.0
    made.normal[:] = 0.0
    made.state[:] = 0.0
    for m in range(2):
        made.offset[m, :] = bias[m]
    if drawn:
        steps.draw_once(keys, first, made, bias, sigma_bias, sigma_flight)
    return drawn


@part
def keep_errors(e, has, each):
    """Errors e (F, 3, CHUNK) into each (F, 3, n), not-a-number where there is no estimate."""
    for f in range(each.shape[0]):
        for c in range(3):
            for i in range(each.shape[2]):
                each[f, c, i] = e[f, c, i] if has[f, c, i] > 0.0 else np.nan


@kernel
def add_block(made, first, count, problem, found, each):
    """`simulate_block` for a plain problem, with a chunk's work arrays, into found (F, K, OWN + PAIRED), `errors`
    into each (F, K, 3, count or 0)."""
    keys, truth, sigma, bias, sigma_bias, sigma_flight, flight, detection, dt = problem[:9]
    observes, start, Q, baseline, given, gains, believed = problem[9:]
    filters, scans, R, at, sums = observes.size, truth.shape[0], sigma * sigma, steps.places(made), address(found)
    detected, other, next_word = made.detected, made.other, np.empty(steps.CHUNK, np.uint64)
    running = np.zeros(filters, dtype=np.bool_)  # filters that have started in every realisation of the chunk
    for done in range(0, count, steps.CHUNK):
        # A partial chunk is computed whole, with no plots beyond its end, so each realisation goes through the same
        # instructions.
        n = min(steps.CHUNK, count - done)
        drawn = begin_chunk(keys, first + done, made, bias, sigma_bias, sigma_flight)
        displaced = drawn or np.any(bias != 0.0)
        running[:] = False
        for k in range(scans):
            if drawn and flight.shape[0] > 0:
                steps.displace(made, flight[k], truth[k], k * dt)
            fill_plots(keys[0], first + done, k, truth[k], sigma, next_word, made.plots[0], made.plots[1])
            if displaced:
                steps.displace_plots(at)
            if detection < 1.0 and k % 2 == 0:
                fill_uniform_pairs(keys[1], first + done, k // 2, detected, other)
            steps.count_plots(at, k, detection, n)
            for f in range(filters):
                if k > 0 and given[f] == 1:
                    steps.advance_given(at, f, dt, gains[f, k], believed[f, k])
                elif k > 0:
                    steps.advance(at, f, dt, (observes[f], Q[f]), R)
                if not running[f]:
                    weights = 1.0 / R[0], 1.0 / (R[1] * dt * dt) if observes[f] == 2 else 0.0
                    running[f] = steps.make_starts(at, f, k, start[f], weights, dt)
                steps.score(at, f, start[f], observes[f], truth[k], R, row(sums, (f * scans + k) * ROWS))
            for f in range(filters):
                if f != baseline:
                    steps.pair(at, f, baseline, row(sums, (f * scans + k) * ROWS + steps.OWN // WIDTH))
            if each.shape[3] > 0:
                keep_errors(made.e, made.has, each[:, k, :, done : done + n])


@kernel
def fill_simulated(made, first, problem, plots, displacement):
    """`simulate_plots` into plots (2, K, n); displacement (3, K, n or 0) of the truth; made: work arrays."""
    keys, truth, sigma, bias, sigma_bias, sigma_flight, flight, detection, dt = problem[:9]
    at, next_word = steps.places(made), np.empty(steps.CHUNK, np.uint64)
    for done in range(0, plots.shape[2], steps.CHUNK):
        n = min(steps.CHUNK, plots.shape[2] - done)
        drawn = begin_chunk(keys, first + done, made, bias, sigma_bias, sigma_flight)
        displaced = drawn or np.any(bias != 0.0)
        for k in range(plots.shape[1]):
            if drawn and flight.shape[0] > 0:
                steps.displace(made, flight[k], truth[k], k * dt)
            fill_plots(keys[0], first + done, k, truth[k], sigma, next_word, made.plots[0], made.plots[1])
            if displaced:
                steps.displace_plots(at)
            if detection < 1.0 and k % 2 == 0:
                fill_uniform_pairs(keys[1], first + done, k // 2, made.detected, made.other)
            steps.count_plots(at, k, detection, n)
            for m in range(2):
                for i in range(n):
                    plots[m, k, done + i] = made.plots[m, i] if made.detected[i] > 0.0 else np.nan
            if displacement.shape[2] > 0:
                displacement[:, k, done : done + n] = made.state[:, :n]


def add_found(found: np.ndarray, baseline: int, sums: Sums) -> None:
    """Add what `score` and `pair` found, (F, K, OWN + PAIRED), to the sums."""
    each = (*found.shape[:2], 3)
    error = found[..., :12].reshape(*each, 4)
    estimates = found[..., 18:21]
    pairs = found[..., steps.OWN : steps.OWN + 18].reshape(*each, 6).copy()
    own_2, own_4 = error[baseline, ..., 1], error[baseline, ..., 3]
    pairs[baseline] = np.stack([estimates[baseline], own_2, own_4, own_2, own_4, own_4], axis=-1)
    for total, more in zip(
        sums,
        (error, estimates, found[..., 12:15], pairs[..., 5], pairs[..., :5], found[..., 21:24], found[..., 15:18]),
        strict=True,
    ):
        total += more


def simulate_block(problem: Problem, first: int, count: int, sums: Sums) -> None:
    """Simulate realisations first … first + count - 1 (any count > 0) and add all filters' errors to the sums. The
    arrays of sums are float64 and contiguous. Realisation i has the same plots and estimates in any block."""
    found, _ = simulated(problem, first, count, 0)
    add_found(found, int(problem.baseline), sums)


def errors(problem: Problem, first: int, count: int) -> np.ndarray:
    """The errors (F, count, K, 3) of the realisations of `simulate_block`; NaN where a filter has no estimate."""
    return simulated(problem, first, count, count)[1].transpose(0, 3, 1, 2)


def simulated(problem: Problem, first: int, count: int, kept: int) -> tuple[np.ndarray, np.ndarray]:
    """Sums (F, K, OWN + PAIRED) of a block, and the errors (F, K, 3, kept) of all its realisations or of none."""
    problem = problem.plain()
    filters, scans = len(problem.observes), len(problem.truth)
    found, each = aligned_zeros(filters, scans, steps.OWN + steps.PAIRED), np.empty((filters, scans, 3, kept))
    add_block(steps.work(filters), int(first), int(count), problem, found, each)
    return found, each


def simulate_plots(problem: Problem, first: int, count: int) -> tuple[np.ndarray, np.ndarray]:
    """The plots (count, K, 2) that `simulate_block` draws for realisations first … first + count - 1, not-a-number
    where missed, and the truth (count, K, 3), a view that cannot be written where all have the same."""
    problem, scans = problem.plain(), len(problem.truth)
    several = len(problem.flight) > 0 and problem.sigma_flight.any()
    plots, displacement = np.empty((2, scans, count)), np.empty((3, scans, count if several else 0))
    fill_simulated(steps.work(1), int(first), problem, plots, displacement)
    if several:
        displacement += problem.truth.T[:, :, None]
        return plots.transpose(2, 1, 0), displacement.transpose(2, 1, 0)
    return plots.transpose(2, 1, 0), np.broadcast_to(problem.truth, (count, scans, 3))

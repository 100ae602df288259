"""One block of realisations: plots, gains, filters and sums, eight realisations at a time.

Realisations whose normals are shifted towards a wrong fold, and the weights that correct for the shift.

The normals z of a realisation are drawn from the mixture α₀ N(0, 1) + Σ α_m N(s_m u_m, 1), u_m unit vectors. The ratio
of the density of N(0, 1) to that of the mixture is

    w(z) = 1 / (α₀ + Σ α_m exp(s_m u_mᵀ z − s_m²/2)),

at most 1/α₀ (Owen & Zhou, Journal of the American Statistical Association 95, 2000, 135)."""

from typing import NamedTuple

import numpy as np

from radarsim.kernels.compile import aligned_zeros, inline, kernel, part
from radarsim.kernels.hypotheses import Lists
from radarsim.kernels.lanes import WIDTH, address, exponential, full, get, put, row, rows, total, where_greater
from radarsim.kernels.random import add_drawn, add_weight, part_of
from radarsim.studies.ambiguous_doppler.kernels import records as rec
from radarsim.studies.ambiguous_doppler.kernels import steps, together
from radarsim.studies.ambiguous_doppler.kernels.records import Banks, Sums, World, work_arrays
from radarsim.studies.ambiguous_doppler.kernels.steps import fill_gains, fill_normals, put_plots, run_merged, run_single
from radarsim.studies.ambiguous_doppler.kernels.together import (
    Orders,
    run_interacting,
    run_interacting_hypotheses,
    run_intersection,
)


# ---- sums ------------------------------------------------------------------------------------------------------------
@part
def run_filters(world, banks, memory, recompute_gains):
    """Run all banks over the plots in memory: fills in gains, if they are to be recomputed, and outputs."""
    scans, plots = world.truth.shape[0], address(memory.plots)
    sigma = address(world.sigma)
    if recompute_gains:
        for d in range(banks.designs.shape[0]):
            fill_gains(
                address(banks.designs[d]), sigma, scans, plots, row(address(memory.gains), d * scans * rec.GAINS)
            )
    lists = Lists(
        address(memory.hypotheses), address(memory.children), address(memory.parents), memory.room, memory.parents.size
    )
    for b in range(banks.kind.size):
        kind, design, size = banks.kind[b], banks.members[b, 0], banks.size[b]
        shares, stay = address(banks.shares[b]), banks.stay[b]
        bank = Orders(address(banks.designs), address(banks.members[b]), address(banks.orders[b]), size, stay)
        outputs = address(memory.out)
        out = row(outputs, b * scans * rec.OUTPUT)
        if kind == rec.WEIGHS:
            together.run_fixed_shares(outputs, bank, banks.member_field[b], shares, scans, out)
        elif kind == rec.CHOOSES:
            run_intersection(outputs, bank, banks.member_field[b], shares, scans, out)
        elif kind == rec.INTERACTS:
            unfolding = banks.unfolding[b]
            if unfolding != rec.REMEMBERS:
                run_interacting(bank, unfolding, sigma, world.spans, plots, out, address(memory.interacting_states))
                continue
            scratch = (address(memory.order_states), address(memory.broadcast_plot), lists)
            limits = (np.exp(-banks.max_depth[b]), banks.max_hypotheses[b])
            for lane in range(WIDTH):
                lane_output = address(memory.out[b * scans * rec.OUTPUT * WIDTH + lane :])
                run_interacting_hypotheses(
                    bank, limits, sigma, world.spans, address(memory.plots[lane:]), lane_output, scratch
                )
        elif kind == rec.REMEMBERS:
            for lane in range(WIDTH):
                steps.run_hypotheses(
                    address(banks.designs[design]),
                    banks.max_hypotheses[b],
                    banks.max_depth[b],
                    world.spans,
                    address(memory.plots[lane:]),
                    address(memory.gains[design * scans * rec.GAINS * WIDTH + lane :]),
                    address(memory.out[b * scans * rec.OUTPUT * WIDTH + lane :]),
                    lists,
                )
        elif kind == rec.MERGES:
            run_merged(address(banks.designs[design]), sigma, world.spans, plots, out)
        else:
            gains = row(address(memory.gains), design * scans * rec.GAINS)
            run_single(kind, address(banks.designs[design]), world.spans, plots, gains, out)


@inline
def component_error(estimate, plot, active, c):
    """The error of component c; zero in lanes that do not count."""
    return active * (get(estimate, c) - get(plot, rec.TRUTH + c))


@part
def add_scan(plot, rows_of_estimates, active, half_span, sums):
    """Add a scan of a filter; returns the number of lanes whose velocity is off by more than half a span.

    rows_of_estimates: the filter's, the baseline's and the oracle's; active: lanes that count; sums: addresses."""
    over_half_span, (estimate, baseline, oracle), (error, (paired, oracle_products), estimates) = (
        full(0.0),
        rows_of_estimates,
        sums,
    )
    for c in range(3):
        e = component_error(estimate, plot, active, c)
        e2, baseline_error, oracle_error = (
            e * e,
            component_error(baseline, plot, active, c),
            component_error(oracle, plot, active, c),
        )
        error[4 * c] += total(e)
        error[4 * c + 1] += total(e2)
        error[4 * c + 2] += total(e2 * e)
        error[4 * c + 3] += total(e2 * e2)
        paired[c] += total(e2 * (baseline_error * baseline_error))
        oracle_products[c] += total(e2 * (oracle_error * oracle_error))
        estimates[c] += total(active)
        if c == 1:
            over_half_span = where_greater(e2, full(half_span * half_span), full(1.0), full(0.0))
    return total(over_half_span)


@part
def add_calibration(out, plot, calibration):
    """Count the lanes with a plot in bins of the best hypothesis's probability, and those in which it is right."""
    for i in range(WIDTH):
        if plot[rec.DETECTED * WIDTH + i] > 0.0:
            p = out[rec.PROBABILITY * WIDTH + i]
            p = p if p >= 0.0 else 0.0  # not-a-number, which the errors show, has no bin
            offset = 3 * min(int(p * rec.BINS), rec.BINS - 1)
            calibration[offset] += 1.0
            calibration[offset + 1] += out[rec.RIGHT * WIDTH + i]
            calibration[offset + 2] += p


@part
def add_group(world, banks, memory, sums):
    """Add the outputs of a group of eight realisations to the sums."""
    scans = world.truth.shape[0]
    active, out = get(address(memory.active), 0), address(memory.out)
    for k in range(scans):
        plot = row(address(memory.plots), k * rec.PLOT)
        started = active * get(plot, rec.STARTED)
        put(plot, rec.DETECTED, active * get(plot, rec.DETECTED))  # read by add_calibration, and no more after it
        baseline = row(
            out, (banks.bank[banks.baseline] * scans + k) * rec.OUTPUT + banks.estimate_field[banks.baseline]
        )
        for f in range(banks.bank.size):
            bank = row(out, (banks.bank[f] * scans + k) * rec.OUTPUT)
            oracle = baseline
            if banks.oracle >= 0:
                oracle = row(
                    out, (banks.bank[banks.oracle] * scans + k) * rec.OUTPUT + banks.estimate_field[banks.oracle]
                )
            folds = address(sums.folds[f, k])
            estimated, half_span = (row(bank, banks.estimate_field[f]), baseline, oracle), 0.5 * world.spans[k]
            powers, products = address(sums.error[f, k]), (address(sums.paired[f, k]), address(sums.oracle[f, k]))
            targets = powers, products, address(sums.estimates[f, k])
            folds[rec.BEYOND_SUM] += add_scan(plot, estimated, started, half_span, targets)
            folds[rec.RIGHT_SUM] += total(started * get(bank, rec.RIGHT))
            folds[rec.LISTED_SUM] += total(started * get(bank, rec.LISTED))
            folds[rec.COUNT_SUM] += total(started * get(bank, rec.COUNT))
            kind, unfolding = banks.kind[banks.bank[f]], banks.unfolding[banks.bank[f]]
            if kind == rec.REMEMBERS or (kind == rec.INTERACTS and unfolding == rec.REMEMBERS):
                add_calibration(bank, plot, address(sums.calibration[f, k]))
            if kind >= rec.INTERACTS:
                for order in range(3):
                    w = started * get(bank, rec.WEIGHTS + order)
                    sums.orders[f, k, order, 0] += total(w)
                    sums.orders[f, k, order, 1] += total(w * w)


@kernel
def add_block(world, banks, memory, sums, first, count):
    """Add the realisations first … first + count - 1 to the sums."""
    for group in range(0, count, WIDTH):
        for n in range(WIDTH):
            memory.active[n] = 1.0 if group + n < count else 0.0
        fill_normals(world, first + group, memory.normals)
        put_plots(world, first + group, memory.normals, memory.plots)
        run_filters(world, banks, memory, group == 0 or world.detection_probability < 1.0)
        add_group(world, banks, memory, sums)


@kernel
def fill_outputs(world, banks, memory, first):
    """Plots and outputs of the realisations first … first + 7, left in memory."""
    fill_normals(world, first, memory.normals)
    put_plots(world, first, memory.normals, memory.plots)
    run_filters(world, banks, memory, True)


@kernel
def fill_plots_and_truth(world, normals, plots, first, measured, truth):
    """Fill in measured (2, K, n) and truth (3, K, n or 0) of `simulate_plots`, n a multiple of eight.

    normals, plots: work arrays."""
    scans, groups = measured.shape[1], measured.shape[2] // WIDTH
    for g in range(groups):
        fill_normals(world, first + g * WIDTH, normals)
        put_plots(world, first + g * WIDTH, normals, plots)
        for k in range(scans):
            scan = row(address(plots), k * rec.PLOT)
            detected, threshold = get(scan, rec.DETECTED), full(0.5)
            for m in range(2):  # RANGE, VELOCITY
                value = where_greater(detected, threshold, get(scan, m), full(np.nan))
                put(address(measured), (m * scans + k) * groups + g, value)
            if truth.shape[2] > 0:
                for c in range(3):
                    put(address(truth), (c * scans + k) * groups + g, get(scan, rec.TRUTH + c))


def simulate_plots(world: World, first: int, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Range and folded velocity (count, K, 2) of realisations first …, not-a-number where missed, and the truth.

    The truth (count, K, 3) is a read-only view if all realisations have the same."""
    scans, padded_count, draws_truth = len(world.t), -(-count // WIDTH) * WIDTH, world.spread.any()
    measured, truth = aligned_zeros(2, scans, padded_count), aligned_zeros(3, scans, padded_count if draws_truth else 0)
    folded_world = world._replace(joint_spans=np.zeros_like(world.joint_spans))  # no remainders are solved
    fill_plots_and_truth(folded_world, rows(2 + 2 * scans), rows(scans * rec.PLOT), first, measured, truth)
    common_truth = np.broadcast_to(world.truth, (count, scans, 3))
    return measured.transpose(2, 1, 0)[:count], truth.transpose(2, 1, 0)[:count] if draws_truth else common_truth


def simulate_block(world: World, banks: Banks, sums: Sums, first: int, count: int) -> None:
    """Add the errors and folds of realisations first … first + count - 1 to the sums."""
    add_block(world, banks, work_arrays(len(world.t), banks), sums, first, count)


def simulate_errors(world: World, banks: Banks, first: int, count: int) -> np.ndarray:
    """The errors (F, count, K, 3) of realisations first … first + count - 1; NaN where a filter has not started."""
    scans, arrays = len(world.t), work_arrays(len(world.t), banks)
    plots, out = arrays.plots.reshape(scans, rec.PLOT, WIDTH), arrays.out.reshape(-1, scans, rec.OUTPUT, WIDTH)
    rows_of_estimates = banks.estimate_field[:, None] + np.arange(3)
    errors_by_group = np.empty((len(banks.bank), -(-count // WIDTH), WIDTH, scans, 3))
    for group in range(errors_by_group.shape[1]):
        fill_outputs(world, banks, arrays, first + group * WIDTH)
        e = out[banks.bank[:, None], :, rows_of_estimates] - plots[:, rec.TRUTH : rec.TRUTH + 3].swapaxes(0, 1)
        e[:, :, plots[:, rec.STARTED] == 0] = np.nan
        errors_by_group[:, group] = e.transpose(0, 3, 2, 1)
    return errors_by_group.reshape(len(errors_by_group), -1, scans, 3)[:, :count]


def simulate_outputs(world: World, banks: Banks, first: int) -> tuple[np.ndarray, np.ndarray]:
    """Plots (K, PLOT, 8) and outputs (B, K, OUTPUT, 8) of the realisations first … first + 7, see `records`."""
    plots, out, _ = simulate_hypotheses(world, banks, first)
    return plots, out


def simulate_hypotheses(world: World, banks: Banks, first: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """As `simulate_outputs`, and the columns of the last list of hypotheses, see `kernels.hypotheses.Lists`."""
    scans, arrays = len(world.t), work_arrays(len(world.t), banks)
    fill_outputs(world, banks, arrays, first)
    shape = (len(banks.kind), scans, rec.OUTPUT, WIDTH)
    return arrays.plots.reshape(scans, rec.PLOT, WIDTH), arrays.out.reshape(shape), arrays.hypotheses


# ---- rare ------------------------------------------------------------------------------------------------------------
# A fold of the best hypothesis is wrong; the velocity is off by more than half the span; a fold is wrong, and the right
# hypothesis was dropped at a scan that filled the list.
WRONG, BEYOND, FULL, EVENTS = 0, 1, 2, 3


class Mixture(NamedTuple):
    """A mixture of the plain law and M shifted ones, over normals as `steps.fill_normals` has them."""

    key: np.ndarray  #: (2,) of the stream that decides from which component a realisation is drawn
    cumulative: np.ndarray  #: (M + 1,) running sums of the shares α, the plain law first; the last is 1
    shift: np.ndarray  #: (M,) s_m
    units: np.ndarray  #: (M, 2 + 2K) u_m


class Losses(NamedTuple):
    """Weighted sums over realisations."""

    events: np.ndarray  #: (F, K, EVENTS, 4) Σw, Σw², the number, and Σw⁴ of the realisations with the event
    drawn: np.ndarray  #: (3,) number of plain realisations, and Σw, Σw² of all


@part
def put_weights(mixture, normals, weights):
    """Write the weights of eight realisations into a row, from the rows of their normals; both are addresses."""
    density = full(mixture.cumulative[0])
    for m in range(mixture.shift.size):
        projection, shift = full(0.0), mixture.shift[m]
        for r in range(mixture.units.shape[1]):
            projection = projection + mixture.units[m, r] * get(normals, r)
        share = mixture.cumulative[m + 1] - mixture.cumulative[m]
        density = density + share * exponential(shift * projection - 0.5 * shift * shift)
    put(weights, 0, 1.0 / density)


@kernel
def fill_shifted(world, mixture, first, normals, components, weights):
    """Draw normals of realisations first … first + 7, each shifted by its component of the mixture.

    Filled: components (8,), 0 the plain law, and weights (8,)."""
    fill_normals(world, first, normals)
    for n in range(WIDTH):
        components[n] = component = part_of(mixture.key, mixture.cumulative, first + n)
        if component > 0:
            for r in range(mixture.units.shape[1]):
                normals[WIDTH * r + n] += mixture.shift[component - 1] * mixture.units[component - 1, r]
    put_weights(mixture, address(normals), address(weights))


@part
def add_events(world, banks, memory, weights, size, losses):
    """Add the weights of the first `size` realisations of a group of eight to the events that they have."""
    scans, out = world.truth.shape[0], address(memory.out)
    for f in range(banks.bank.size):
        max_hypotheses, lost, crowded_out = banks.max_hypotheses[banks.bank[f]], 0, 0  # a bit for each lane
        for k in range(scans):
            plot = row(address(memory.plots), k * rec.PLOT)
            bank = row(out, (banks.bank[f] * scans + k) * rec.OUTPUT)
            velocity = row(bank, banks.estimate_field[f] + 1)
            for n in range(size):
                if bank[rec.LISTED * WIDTH + n] == 0.0 and lost >> n & 1 == 0:
                    lost |= 1 << n
                    crowded_out |= (1 if bank[rec.COUNT * WIDTH + n] >= max_hypotheses else 0) << n
                if bank[rec.RIGHT * WIDTH + n] == 0.0:
                    add_weight(weights[n], losses.events[f, k], WRONG)
                    if crowded_out >> n & 1 == 1:
                        add_weight(weights[n], losses.events[f, k], FULL)
                if abs(velocity[n] - plot[(rec.TRUTH + 1) * WIDTH + n]) > 0.5 * world.spans[k]:
                    add_weight(weights[n], losses.events[f, k], BEYOND)


@kernel
def add_weighted_block(world, banks, mixture, memory, scratch, sums, losses, first, count):
    """Add the realisations first … first + count - 1: all to the losses, with their weights, plain ones to the sums."""
    components, weights = scratch
    for group in range(0, count, WIDTH):
        fill_shifted(world, mixture, first + group, memory.normals, components, weights)
        put_plots(world, first + group, memory.normals, memory.plots)
        run_filters(world, banks, memory, group == 0)
        size = min(WIDTH, count - group)
        for n in range(WIDTH):
            memory.active[n] = 1.0 if n < size and components[n] == 0 else 0.0
        for n in range(size):
            add_drawn(weights[n], memory.active[n], losses.drawn)
        add_events(world, banks, memory, weights, size, losses)
        add_group(world, banks, memory, sums)


def simulate_weighted_block(
    world: World, banks: Banks, mixture: Mixture, sums: Sums, losses: Losses, first: int, count: int
) -> None:
    """Add realisations first … first + count - 1 of a case without missed plots."""
    scratch = np.zeros(WIDTH, np.int64), rows(1)
    add_weighted_block(world, banks, mixture, work_arrays(len(world.t), banks), scratch, sums, losses, first, count)

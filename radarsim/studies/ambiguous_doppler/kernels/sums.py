"""One block of realisations: plots, gains, filters and sums, eight realisations at a time."""

import numpy as np

from radarsim.kernels.compiler import inline, kernel, kernel_part
from radarsim.kernels.hypotheses import HypothesisLists
from radarsim.kernels.lanes import WIDTH, address, full, get, put, row, total, where_greater
from radarsim.studies.ambiguous_doppler.kernels import fold_hypotheses, layout, order_combinations
from radarsim.studies.ambiguous_doppler.kernels.interacting_hypotheses import run_interacting_hypotheses
from radarsim.studies.ambiguous_doppler.kernels.layout import Banks, Sums, World, work_arrays
from radarsim.studies.ambiguous_doppler.kernels.order_combinations import run_intersection
from radarsim.studies.ambiguous_doppler.kernels.orders import Orders, run_interacting
from radarsim.studies.ambiguous_doppler.kernels.plots import fill_normals, put_plots
from radarsim.studies.ambiguous_doppler.kernels.single_fold import fill_gains, run_merged, run_single


@kernel_part
def run_filters(world, banks, memory, recompute_gains):
    """Run all banks over the plots in memory: fills in gains, if they are to be recomputed, and outputs."""
    scans, plots = world.truth.shape[0], address(memory.plots)
    sigma = address(world.sigma)
    if recompute_gains:
        for d in range(banks.designs.shape[0]):
            fill_gains(
                address(banks.designs[d]), sigma, scans, plots, row(address(memory.gains), d * scans * layout.GAINS)
            )
    lists = HypothesisLists(
        address(memory.hypotheses), address(memory.children), address(memory.parents), memory.room, memory.parents.size
    )
    for b in range(banks.kind.size):
        kind, design, size = banks.kind[b], banks.members[b, 0], banks.size[b]
        shares, stay = address(banks.shares[b]), banks.stay[b]
        bank = Orders(address(banks.designs), address(banks.members[b]), address(banks.orders[b]), size, stay)
        outputs = address(memory.out)
        out = row(outputs, b * scans * layout.OUTPUT)
        if kind == layout.WEIGHS:
            order_combinations.run_fixed_shares(outputs, bank, banks.member_field[b], shares, scans, out)
        elif kind == layout.CHOOSES:
            run_intersection(outputs, bank, banks.member_field[b], shares, scans, out)
        elif kind == layout.INTERACTS:
            unfolding = banks.unfolding[b]
            if unfolding != layout.REMEMBERS:
                run_interacting(bank, unfolding, sigma, world.spans, plots, out, address(memory.interacting_states))
                continue
            scratch = (address(memory.order_states), address(memory.broadcast_plot), lists)
            limits = (np.exp(-banks.max_depth[b]), banks.max_hypotheses[b])
            for lane in range(WIDTH):
                lane_output = address(memory.out[b * scans * layout.OUTPUT * WIDTH + lane :])
                run_interacting_hypotheses(
                    bank, limits, sigma, world.spans, address(memory.plots[lane:]), lane_output, scratch
                )
        elif kind == layout.REMEMBERS:
            for lane in range(WIDTH):
                fold_hypotheses.run_hypotheses(
                    address(banks.designs[design]),
                    banks.max_hypotheses[b],
                    banks.max_depth[b],
                    world.spans,
                    address(memory.plots[lane:]),
                    address(memory.gains[design * scans * layout.GAINS * WIDTH + lane :]),
                    address(memory.out[b * scans * layout.OUTPUT * WIDTH + lane :]),
                    lists,
                )
        elif kind == layout.MERGES:
            run_merged(address(banks.designs[design]), sigma, world.spans, plots, out)
        else:
            gains = row(address(memory.gains), design * scans * layout.GAINS)
            run_single(kind, address(banks.designs[design]), world.spans, plots, gains, out)


@inline
def component_error(estimate, plot, active, c):
    """The error of component c; zero in lanes that do not count."""
    return active * (get(estimate, c) - get(plot, layout.TRUTH + c))


@kernel_part
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


@kernel_part
def add_calibration(out, plot, calibration):
    """Count the lanes with a plot in bins of the best hypothesis's probability, and those in which it is right."""
    for i in range(WIDTH):
        if plot[layout.DETECTED * WIDTH + i] > 0.0:
            p = out[layout.PROBABILITY * WIDTH + i]
            p = p if p >= 0.0 else 0.0  # not-a-number, which the errors show, has no bin
            offset = 3 * min(int(p * layout.BINS), layout.BINS - 1)
            calibration[offset] += 1.0
            calibration[offset + 1] += out[layout.RIGHT * WIDTH + i]
            calibration[offset + 2] += p


@kernel_part
def add_group(world, banks, memory, sums):
    """Add the outputs of a group of eight realisations to the sums."""
    scans = world.truth.shape[0]
    active, out = get(address(memory.active), 0), address(memory.out)
    for k in range(scans):
        plot = row(address(memory.plots), k * layout.PLOT)
        started = active * get(plot, layout.STARTED)
        put(plot, layout.DETECTED, active * get(plot, layout.DETECTED))  # read by add_calibration, and no more after it
        baseline = row(
            out, (banks.bank[banks.baseline] * scans + k) * layout.OUTPUT + banks.estimate_field[banks.baseline]
        )
        for f in range(banks.bank.size):
            bank = row(out, (banks.bank[f] * scans + k) * layout.OUTPUT)
            oracle = baseline
            if banks.oracle >= 0:
                oracle = row(
                    out, (banks.bank[banks.oracle] * scans + k) * layout.OUTPUT + banks.estimate_field[banks.oracle]
                )
            folds = address(sums.folds[f, k])
            estimated, half_span = (row(bank, banks.estimate_field[f]), baseline, oracle), 0.5 * world.spans[k]
            powers, products = address(sums.error[f, k]), (address(sums.paired[f, k]), address(sums.oracle[f, k]))
            targets = powers, products, address(sums.estimates[f, k])
            folds[layout.OFF_BY_HALF_SPAN_SUM] += add_scan(plot, estimated, started, half_span, targets)
            folds[layout.RIGHT_SUM] += total(started * get(bank, layout.RIGHT))
            folds[layout.LISTED_SUM] += total(started * get(bank, layout.LISTED))
            folds[layout.COUNT_SUM] += total(started * get(bank, layout.COUNT))
            kind, unfolding = banks.kind[banks.bank[f]], banks.unfolding[banks.bank[f]]
            if kind == layout.REMEMBERS or (kind == layout.INTERACTS and unfolding == layout.REMEMBERS):
                add_calibration(bank, plot, address(sums.calibration[f, k]))
            if kind >= layout.INTERACTS:
                for order in range(3):
                    w = started * get(bank, layout.WEIGHTS + order)
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


def simulate_block(world: World, banks: Banks, sums: Sums, first: int, count: int) -> None:
    """Add the errors and folds of realisations first … first + count - 1 to the sums."""
    add_block(world, banks, work_arrays(len(world.t), banks), sums, first, count)

"""Single realisations: their plots, errors, outputs and hypotheses."""

import numpy as np

from radarsim.kernels.compiler import aligned_zeros, kernel
from radarsim.kernels.lanes import WIDTH, address, full, get, put, row, rows, where_greater
from radarsim.studies.ambiguous_doppler.kernels import layout
from radarsim.studies.ambiguous_doppler.kernels.layout import Banks, World, work_arrays
from radarsim.studies.ambiguous_doppler.kernels.plots import fill_normals, put_plots
from radarsim.studies.ambiguous_doppler.kernels.sums import run_filters


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
            scan = row(address(plots), k * layout.PLOT)
            detected, threshold = get(scan, layout.DETECTED), full(0.5)
            for m in range(2):  # RANGE, VELOCITY
                value = where_greater(detected, threshold, get(scan, m), full(np.nan))
                put(address(measured), (m * scans + k) * groups + g, value)
            if truth.shape[2] > 0:
                for c in range(3):
                    put(address(truth), (c * scans + k) * groups + g, get(scan, layout.TRUTH + c))


def simulate_plots(world: World, first: int, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Range and folded velocity (count, K, 2) of realisations first …, not-a-number where missed, and the truth.

    The truth (count, K, 3) is a read-only view if all realisations have the same."""
    scans, padded_count, draws_truth = len(world.t), -(-count // WIDTH) * WIDTH, world.spread.any()
    measured, truth = aligned_zeros(2, scans, padded_count), aligned_zeros(3, scans, padded_count if draws_truth else 0)
    folded_world = world._replace(joint_spans=np.zeros_like(world.joint_spans))  # no remainders are solved
    fill_plots_and_truth(folded_world, rows(2 + 2 * scans), rows(scans * layout.PLOT), first, measured, truth)
    common_truth = np.broadcast_to(world.truth, (count, scans, 3))
    return measured.transpose(2, 1, 0)[:count], truth.transpose(2, 1, 0)[:count] if draws_truth else common_truth


def simulate_errors(world: World, banks: Banks, first: int, count: int) -> np.ndarray:
    """The errors (F, count, K, 3) of realisations first … first + count - 1; NaN where a filter has not started."""
    scans, arrays = len(world.t), work_arrays(len(world.t), banks)
    plots, out = arrays.plots.reshape(scans, layout.PLOT, WIDTH), arrays.out.reshape(-1, scans, layout.OUTPUT, WIDTH)
    rows_of_estimates = banks.estimate_field[:, None] + np.arange(3)
    errors_by_group = np.empty((len(banks.bank), -(-count // WIDTH), WIDTH, scans, 3))
    for group in range(errors_by_group.shape[1]):
        fill_outputs(world, banks, arrays, first + group * WIDTH)
        e = out[banks.bank[:, None], :, rows_of_estimates] - plots[:, layout.TRUTH : layout.TRUTH + 3].swapaxes(0, 1)
        e[:, :, plots[:, layout.STARTED] == 0] = np.nan
        errors_by_group[:, group] = e.transpose(0, 3, 2, 1)
    return errors_by_group.reshape(len(errors_by_group), -1, scans, 3)[:, :count]


def simulate_outputs(world: World, banks: Banks, first: int) -> tuple[np.ndarray, np.ndarray]:
    """Plots (K, PLOT, 8) and outputs (B, K, OUTPUT, 8) of the realisations first … first + 7, see `records`."""
    plots, out, _ = simulate_hypotheses(world, banks, first)
    return plots, out


def simulate_hypotheses(world: World, banks: Banks, first: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """As `simulate_outputs`, and the columns of the last list of hypotheses (`kernels.hypotheses.HypothesisLists`)."""
    scans, arrays = len(world.t), work_arrays(len(world.t), banks)
    fill_outputs(world, banks, arrays, first)
    shape = (len(banks.kind), scans, layout.OUTPUT, WIDTH)
    return arrays.plots.reshape(scans, layout.PLOT, WIDTH), arrays.out.reshape(shape), arrays.hypotheses

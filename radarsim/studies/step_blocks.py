"""Blocks of a step study's realisations: the sums of the filters' errors, and the errors themselves."""

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING

import numpy as np

from radarsim.errors import ConfigError
from radarsim.studies.step_plots import MAX_ROWS, draw_plots, prepare_drawing
from radarsim.studies.step_tracker import Tracker

if TYPE_CHECKING:
    from radarsim.studies.step_plan import Plan
    from radarsim.studies.stepwise import StepStudy

MAX_DIFFERENCE = 1e-9  # of the largest truth: permitted difference between plain Python and the kernel


def simulate_sums(study: "StepStudy", plan: "Plan", first: int, count: int) -> np.ndarray:
    """The sums of a block, packed as the plan's layout."""
    values = np.zeros(plan.layout.size)
    sums = plan.layout.unpack(values)
    for _ in follow_realisations(plan, first, count, sums):
        pass
    is_zero = (sums["error"][..., 1] == 0) & (sums["estimates"] > 0 if "estimates" in sums else True)
    if is_zero.any():
        sums["error"][is_zero & ~has_no_error(study, plan)] = np.nan
    if "believed" in sums and (has_no_covariance := (sums["believed"] < 0).any(axis=2)).any():
        sums["believed"][has_no_covariance] = sums["nees"][has_no_covariance] = np.nan
    return values


def simulate_errors(study: "StepStudy", plan: "Plan", first: int, count: int) -> np.ndarray:
    """The errors (F, count, K, C) of a block."""
    errors = np.empty((count, *plan.axes.available.shape))
    sums = plan.layout.unpack(np.zeros(plan.layout.size))
    for f, start, used, block_errors in follow_realisations(plan, first, count, sums):
        errors[start : start + used, f] = block_errors[:used]
    if (is_zero := errors == 0).any():
        errors[is_zero & ~has_no_error(study, plan)] = np.nan
    return np.moveaxis(errors, 0, 1)


def follow_realisations(
    plan: "Plan", first: int, count: int, sums: Mapping[str, np.ndarray]
) -> Iterator[tuple[int, int, int, np.ndarray]]:
    """Run the filters over a block and add up their sums.

    Gives each filter, the number of the first of some realisations and how many they are, and their errors
    (≥ used, K, C), which are valid till the next ones."""
    from radarsim.kernels.compiler import aligned_zeros
    from radarsim.kernels.lanes import WIDTH

    nothing = np.zeros((1, 2))
    scans, components = plan.axes.k.size, len(plan.axes.components)
    error_rows = components + (1 if "both" in sums else 0)
    max_groups = max(1, MAX_ROWS // (scans * (plan.scene.plot_rows + 2 * error_rows)))
    work = aligned_zeros(max(member.rows for member in plan.filters) * WIDTH)
    baseline_errors, own_errors = (aligned_zeros(max_groups * scans * error_rows * WIDTH) for _ in range(2))
    order = sorted(range(len(plan.filters)), key=lambda f: f != plan.axes.baseline)
    for start in range(0, count, max_groups * WIDTH):
        used = min(max_groups * WIDTH, count - start)
        groups = -(-used // WIDTH)
        plots = draw_plots(plan, first + start, groups)
        for f in order:
            member, errors = plan.filters[f], baseline_errors if f == plan.axes.baseline else own_errors
            tested = [sums[name][f] if member.tested else nothing for name in ("believed", "nees")]
            counts, both = [sums[name][f] if name in sums else nothing for name in ("counts", "both")]
            filter_sums = sums["error"][f], sums["paired"][f], *tested, counts, both
            member.kernel(
                groups,
                used,
                plan.known_quantities,
                plan.width,
                member.numbers,
                plots,
                work,
                errors,
                baseline_errors,
                *filter_sums,
            )
            if "counts" in sums:
                sums["estimates"][f] = counts[:, :1]
            values = errors.reshape(max_groups, scans, error_rows, WIDTH)[:groups, :, :components]
            yield f, start, used, values.transpose(0, 3, 1, 2).reshape(-1, scans, components)


def has_no_error(study: "StepStudy", plan: "Plan") -> np.ndarray:
    """Where (F, K, C) estimates equal the truth in plain Python too, in realisation 0.

    Compiled code assumes finite numbers: a NaN error may be stored as zero."""
    if "free" not in plan.checked:
        plots = prepare_drawing(study, plan)(0, 1)
        columns, truth = plots.rows(0), plots.truth[0]
        try:
            with np.errstate(all="ignore"):
                estimate = Tracker(study, plan.case.spec).feed(columns).estimate
        except ConfigError:  # a division by zero
            estimate = np.full_like(plan.axes.exact_sigma, np.nan)
        errors = np.stack(study.difference(np.moveaxis(estimate, -1, 0), truth.T), axis=-1)
        plan.checked["free"] = np.abs(errors) <= MAX_DIFFERENCE * np.abs(truth).max(axis=0)
    return plan.checked["free"]

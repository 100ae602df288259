"""Whether a user filter draws the same random numbers in every block, as one with a seeded generator of its own does.

It then gives different estimates for the same plots in the rows of one block, and the same ones in another block."""

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from radarsim.errors import AUTHOR_ERRORS
from radarsim.studies.user_filters.estimates import check_estimates, columns_of
from radarsim.studies.user_filters.filters import EstimateChunks, StoredEstimates, UserFilter
from radarsim.studies.user_filters.plots import plots_for_filter

if TYPE_CHECKING:
    from radarsim.studies.user_filters.sums import Plan

TRIAL_REALISATIONS = 8  # rows with the same plots
ROUNDING = 1e-6  # of an estimate, of single precision over a batch
MATERIAL_CHANGE = 1e-3  # of the rms error of a component; smaller changes are rounding


def repeats_numbers(plan: "Plan", member: UserFilter) -> bool:
    """Whether the random numbers of a filter's own repeat in each block; False for estimates that are there already,
    and for a filter that cannot take the same plots in all rows."""
    if isinstance(member, StoredEstimates | EstimateChunks) or plan.block < 2:
        return False
    try:
        return _repeats_numbers(plan, member)
    except AUTHOR_ERRORS:  # whatever the user's code raises: its run on the plots themselves says so
        return False


def _repeats_numbers(plan: "Plan", member: UserFilter) -> bool:
    plots = plan.draw(0, 1)
    n = min(plan.block, TRIAL_REALISATIONS)

    def estimates(first: int) -> np.ndarray:
        first_plots = plots_for_filter(plan.world, plots)
        columns = {name: np.repeat(column, n, axis=0) for name, column in first_plots.columns.items()}
        answer = member.estimates(replace(first_plots, columns=columns, first=first, n=n))
        return check_estimates(member.name, answer, n, len(plan.world.t_s), plan.names, member.components)[0]

    reference = estimates(0)
    components = columns_of(member.name, reference.shape[2], plan.names, member.components)
    errors = reference - plots.truth_of(plan.axes.components)[..., components]
    tolerance = MATERIAL_CHANGE * _rms(errors) + ROUNDING * _rms(reference)
    if is_near(np.broadcast_to(reference[:1], reference.shape), reference, tolerance):
        return False
    return is_near(estimates(plan.block), reference, tolerance)


def is_near(first: np.ndarray, second: np.ndarray, tolerance: np.ndarray) -> bool:
    """Whether estimates differ by no more than a tolerance (d,), and the same of them are finite."""
    if first.shape != second.shape:
        return False
    with np.errstate(invalid="ignore"):
        return not ((np.isfinite(first) != np.isfinite(second)) | (np.abs(first - second) > tolerance)).any()


def _rms(values: np.ndarray) -> np.ndarray:
    """The root mean square (d,) of finite values (n, K, d)."""
    with np.errstate(invalid="ignore"):
        finite = np.where(np.isfinite(values), values, 0)
        return np.asarray(np.sqrt((finite**2).sum((0, 1)) / np.maximum(np.isfinite(values).sum((0, 1)), 1)))

"""Whether the estimates of a user filter are independent from realisation to realisation, as intervals require.

Equal plots in all rows of a batch tell what a row depends on besides its plots: where its estimates differ from row to
row, and are the same in another block, they repeat. Other seeds of the generators that the filter makes tell whether it
is by random numbers (`radarsim.studies.user_filters.seeding`)."""

from dataclasses import replace
from typing import TYPE_CHECKING, Literal

import numpy as np

from radarsim.errors import AUTHOR_ERRORS
from radarsim.studies.user_filters.estimates import check_estimates, columns_of
from radarsim.studies.user_filters.filters import EstimateChunks, Plots, StoredEstimates, UserFilter
from radarsim.studies.user_filters.plots import plots_for_filter
from radarsim.studies.user_filters.seeding import SeedRecorder

if TYPE_CHECKING:
    from radarsim.studies.plot_arrays import SimulatedPlots
    from radarsim.studies.user_filters.sums import Plan

Dependence = Literal["", "repeated", "shared", "place", "others"]
EQUAL_ROWS = 8  # rows with the same plots
DIFFERENT_ROWS = 16  # rows with plots of their own
ROUNDING = 1e-6  # of an estimate, of single precision over a batch
MATERIAL_CHANGE = 1e-3  # of the rms error of a component; smaller changes are rounding


def dependence(plan: "Plan", member: UserFilter) -> Dependence:
    """Why realisations of a filter depend on each other; empty where they do not, or where no trial can tell.

    `repeated`: it draws the same random numbers in each block; `shared`: in each realisation; `place`: its estimates
    depend on the row in the batch, in each block alike; `others`: on the plots in other rows."""
    if isinstance(member, StoredEstimates | EstimateChunks) or plan.block < 2:
        return ""
    trial = _Trial(plan, member)
    for check in (trial.depends_on_row, trial.depends_on_other_rows):
        try:
            if (reason := check()) is not None:
                return reason
        except AUTHOR_ERRORS:  # whatever the user's code raises: its run on the plots themselves says so
            continue
    return ""


class _Trial:
    """A few runs of a filter."""

    def __init__(self, plan: "Plan", member: UserFilter):
        self.plan, self.member = plan, member

    def depends_on_row(self) -> Dependence | None:
        """Whether equal plots give other estimates in another row, or the same random numbers; None if neither."""
        plots = self.plan.draw(0, 1)
        rows = min(self.plan.block, EQUAL_ROWS)
        recorder = SeedRecorder()
        reference = self._estimates(self._equal_rows(plots, rows), recorder)
        tolerance = self._tolerance(reference, plots)
        if is_near(np.broadcast_to(reference[:1], reference.shape), reference, tolerance):
            return "shared" if self._shares_numbers(plots, tolerance) else None
        if not is_near(self._estimates(self._equal_rows(plots, rows, self.plan.block)), reference, tolerance):
            return ""
        reseeded = self._estimates(self._equal_rows(plots, rows), SeedRecorder(range(len(recorder.seeds))))
        return "place" if is_near(reseeded, reference, tolerance) else "repeated"

    def depends_on_other_rows(self) -> Dependence | None:
        """Whether a part of a batch gives other estimates than the whole, although nothing is random in it."""
        rows = min(self.plan.block, DIFFERENT_ROWS)
        plots = self.plan.draw(0, rows)
        middle = slice(rows // 4, rows // 4 + max(rows // 2, 1))  # neither the first row nor the last
        reference = self._estimates(plots_for_filter(self.plan.world, plots))
        part = plots_for_filter(self.plan.world, self.plan.draw(middle.start, middle.stop - middle.start))
        tolerance = self._tolerance(reference, plots)
        if is_near(self._estimates(part), reference[middle], tolerance):
            return None
        in_other_block = replace(plots_for_filter(self.plan.world, plots), first=self.plan.block)
        is_random = uses_generator(part) or not is_near(self._estimates(in_other_block), reference, tolerance)
        return None if is_random else "others"

    def _shares_numbers(self, plots: "SimulatedPlots", tolerance: np.ndarray) -> bool:
        """Whether two realisations seed their generators alike, and other seeds change the estimates."""
        first, other = SeedRecorder(), SeedRecorder()
        reference = self._estimates(plots_for_filter(self.plan.world, plots), first)
        if not (in_use := first.in_use):
            return False
        number = self.plan.block + 1
        self._estimates(plots_for_filter(self.plan.world, self.plan.draw(number, 1)), other)
        if [first.seeds[i] for i in sorted(in_use)] != [other.seeds[i] for i in sorted(other.in_use)]:
            return False
        reseeded = self._estimates(plots_for_filter(self.plan.world, plots), SeedRecorder(in_use))
        return not is_near(reseeded, reference, tolerance)

    def _equal_rows(self, plots: "SimulatedPlots", rows: int, first: int = 0) -> Plots:
        """The plots of one realisation in several rows, numbered from `first` on."""
        first_plots = plots_for_filter(self.plan.world, plots)
        columns = {name: np.repeat(column, rows, axis=0) for name, column in first_plots.columns.items()}
        return replace(first_plots, columns=columns, first=first, n=rows)

    def _estimates(self, plots: Plots, recorder: SeedRecorder | None = None) -> np.ndarray:
        with (recorder or SeedRecorder()).recording():
            answer = self.member.estimates(plots)
        K = len(self.plan.world.t_s)
        return check_estimates(self.member.name, answer, plots.n, K, self.plan.names, self.member.components)[0]

    def _tolerance(self, estimates: np.ndarray, plots: "SimulatedPlots") -> np.ndarray:
        """The change (d,) of estimates that is more than rounding."""
        components = columns_of(self.member.name, estimates.shape[2], self.plan.names, self.member.components)
        errors = estimates - plots.truth_of(self.plan.axes.components)[..., components]
        return MATERIAL_CHANGE * _rms(errors) + ROUNDING * _rms(estimates)


def uses_generator(plots: Plots) -> bool:
    """Whether a filter has taken `plots.generator`, whose numbers depend on the batch."""
    source = plots.world.random
    return source is not None and source.generator_used


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

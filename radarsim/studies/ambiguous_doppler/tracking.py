"""Plots of simulated realisations, and the trackers of a case over recorded ones."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from radarsim.config.experiment import Case
from radarsim.errors import PlotFault
from radarsim.studies.ambiguous_doppler.axes import COMPONENTS
from radarsim.studies.ambiguous_doppler.followers import NO_ESTIMATE, RowResult, make_follower
from radarsim.studies.ambiguous_doppler.kernels import realisations
from radarsim.studies.ambiguous_doppler.study import prepare
from radarsim.studies.missed_scans import missed_scan_times
from radarsim.studies.plot_arrays import DrawPlots, SimulatedPlots
from radarsim.studies.recording_interface import Track

COLUMNS = ("t_s", "range_m", "velocity_mps")
SPAN = "span_mps"  # an optional column: the span by which each velocity is ambiguous
MEASURED = (("range_m", "m"), ("velocity_mps", "m/s"))


def drawing(case: Case) -> DrawPlots:
    """The function that draws plots of realisations of a case, with folded velocities."""
    plan = prepare(case)

    def draw(first: int, count: int) -> SimulatedPlots:
        plots, truth = realisations.simulate_plots(plan.world, first, count)
        columns = {name: plots[..., i] for i, (name, _) in enumerate(MEASURED)}
        return SimulatedPlots(plan.axes.t_s, columns, COMPONENTS, truth, first=first)

    return draw


class Tracker:
    """The filters of a case over recorded plots at any times, chunk by chunk in flat memory.

    A recorded velocity counts as folded. A filter with `doppler: unfolded` has no estimate, as it needs the true folds,
    which a recording lacks; only if no filter unfolds does it take the velocity as recorded. The span is that of the
    row, else the config's; with several repetition rates the scan of a row follows from its time. Innovations of the
    velocity are tested where the fold is certain."""

    most_rows: int | None = None
    several: bool = False

    def __init__(self, case: Case):
        usable = usable_filters(case.spec)
        self.names = tuple(options.name for options in usable)
        self.followers = [make_follower(options, case.spec) for options in usable]
        self.last_t, self.period = np.nan, case.spec.radar.scan_period_s
        self.plot_sigmas = np.array([case.spec.radar.sigma_range_m, case.spec.radar.sigma_velocity_mps])
        # An estimate correlates with a number that it has taken, so that variances subtract; with others they add.
        self.estimate_signs = np.array([[-1.0, 1.0 if options.doppler == "none" else -1.0] for options in usable])

    def feed(self, columns: Mapping[str, np.ndarray]) -> Track:
        """The estimates over the next rows: columns (n,), not-a-number where a value is missing.

        Raises PlotFault for a row that leaves too many folds, or exceeds a filter's digits."""
        rows = plot_rows(columns)
        results_by_filter = [run_rows(follower, rows, self.last_t, self.period) for follower in self.followers]
        if not np.isnan(self.last_t) or not all(map(is_empty_row, rows)):
            self.last_t = rows[-1][0]
        fields = {
            name: np.array([[getattr(result, name) for result in results] for results in results_by_filter])
            for name in RowResult._fields
        }
        spread = self.plot_sigmas**2 + self.estimate_signs[:, None] * fields["sigma"][..., :2] ** 2
        finite = np.isfinite(fields["residual"])
        return Track(
            filters=self.names,
            components=COMPONENTS,
            t_s=columns["t_s"],
            measured=MEASURED,
            tested=tuple((name, 1) for name, _ in MEASURED),
            residual_sigma=np.where(finite, np.sqrt(np.maximum(spread, 0.0)), np.nan),
            **fields,
        )


def usable_filters(spec: Any) -> list[Any]:
    """The filters that can run over a recording of folded velocities: not those that need the true folds."""
    folded = any(options.doppler in ("folded", "remainder") for options in spec.filters)
    return [options for options in spec.filters if options.doppler != "unfolded" or not folded]


def run_rows(follower: Any, rows: Sequence[tuple[float, ...]], last_t: float, period: float) -> list[RowResult]:
    """Run a filter over rows after one at last_t, and over the scans missed between them; empty rows before the first
    plot begin nothing. A PlotFault carries the number of its row."""
    results: list[RowResult] = []
    try:
        with np.errstate(invalid="ignore"):  # a variance lost in rounding: not-a-number, which the caller refuses
            for row in rows:
                if np.isnan(last_t) and is_empty_row(row):
                    results.append(NO_ESTIMATE)
                    continue
                for missed_t in missed_scan_times(last_t, row[0], period):
                    follower.step(missed_t, np.nan, np.nan)
                results.append(follower.step(*row))
                last_t = row[0]
    except PlotFault as fault:
        fault.row = len(results)
        raise
    return results


def is_empty_row(row: Sequence[float]) -> bool:
    """Whether a row has neither range nor velocity."""
    return bool(np.isnan(row[1]) and np.isnan(row[2]))


def plot_rows(columns: Mapping[str, np.ndarray]) -> list[tuple[float, ...]]:
    """The rows of recorded plots: time, range, velocity and its span, not-a-number where a value is missing."""
    spans = columns.get(SPAN, np.full(len(columns["t_s"]), np.nan))
    return list(zip(*(columns[name].tolist() for name in COLUMNS), spans.tolist(), strict=True))

"""Step filters over recorded plots, in plain Python."""

import math
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from radarsim.errors import PlotFault
from radarsim.kernels import tracing
from radarsim.studies.missed_scans import missed_scan_times
from radarsim.studies.recording_interface import Track
from radarsim.studies.step_checks import check_length, check_same_shape, record, step_numbers, variances
from radarsim.user_code.errors import study_context, user_code_error

if TYPE_CHECKING:
    from radarsim.studies.stepwise import Steps, StepStudy


class Tracker:
    """The filters of a case over recorded plots, in plain Python, chunk by chunk: each begins with the first plot.

    Over missed scans they predict scan by scan, as they do over empty rows; where rows hold known quantities, which a
    missed one lacks, in one step. Among false plots rows of one time are the plots of a scan: a filter begins with the
    first, and takes a scan without plots too.

    Where plots have one origin and a filter gives its `innovation`, each number of a plot has its NIS."""

    most_rows: int | None = None

    def __init__(self, study: "StepStudy", spec: Any):
        self.study, self.names = study, tuple(filter_keys.name for filter_keys in spec.filters)
        self.several = study.false_places(spec) > 0
        measured = [number.column for number in study.measured]
        self.filters = [
            (
                study.kinds[filter_keys.kind],
                record(study.kinds[filter_keys.kind].design, spec, filter_keys),
                [measured.index(name) for name in study.columns(spec, filter_keys) if name in measured],
            )
            for filter_keys in spec.filters
        ]
        self.states: list[Any] = [None] * len(self.filters)
        self.last, self.scan_period_s = math.nan, study.scan_period_s(spec)

    def feed(self, columns: "Mapping[str, np.ndarray]") -> Track:
        with study_context(self.study.name):
            return self._follow(columns)

    def _follow(self, columns: "Mapping[str, np.ndarray]") -> Track:
        study, t = self.study, columns["t_s"]
        unknown = np.full(t.size, np.nan)
        plots = np.transpose([columns.get(number.column, unknown) for number in study.measured])
        known_quantities = np.reshape([columns[name] for name in study.known_columns], (-1, t.size)).T
        first_rows = np.flatnonzero(np.diff(t, prepend=math.nan) != 0) if self.several else np.arange(t.size)
        scans = np.split(np.arange(t.size), first_rows[1:])
        values = np.full((len(self.filters), len(scans), 2, len(study.components)), np.nan)
        nis = np.full((len(self.filters), len(scans), len(study.measured)), np.nan)
        for n, rows in enumerate(scans):
            row, time = int(rows[0]), float(t[rows[0]])
            u = tuple(map(float, known_quantities[row]))
            for f, (steps, c, used) in enumerate(self.filters):
                scan_plots = [tuple(map(float, plots[i])) for i in rows if np.isfinite(plots[i, used]).all()]
                s, squares = self._next_scan(row, time, steps, self.states[f], scan_plots, u, c)
                self.states[f], nis[f, n, : len(squares)] = s, squares
                if s is not None:
                    m = len(study.components)
                    values[f, n, 0] = self._numbers(row, steps.estimate, m, "components", s, u, c)
                    if steps.covariance is not None:
                        description = "elements of a packed covariance"
                        P = self._numbers(row, steps.covariance, m * (m + 1) // 2, description, s, u, c)
                        if min(variance := variances(P, m)) < 0:
                            raise refusal(row, steps.covariance, f"gives a variance of {min(variance):g}")
                        values[f, n, 1] = np.sqrt(variance)
            self.last = time
        components = tuple((component.name, component.unit) for component in study.components)
        tested = tuple((number.column, 1) for number in study.measured)
        return Track(self.names, components, t[first_rows], values[:, :, 0], values[:, :, 1], tested=tested, nis=nis)

    def _next_scan(
        self, row: int, t: float, steps: "type[Steps]", s: Any, scan_plots: list[tuple[float, ...]], u: Any, c: Any
    ) -> tuple[Any, list[float]]:
        """The state of a filter after a scan at time t whose plots begin at a row, None before its first plot; and the
        NIS of the numbers of its plot."""
        if s is None:
            return self._next(row, steps.start, None, scan_plots[0], u, c) if scan_plots else None, []
        missed = () if u else missed_scan_times(self.last, t, self.scan_period_s)
        time, previous = self.last, s
        for scan_time in (*missed, t):
            s = self._next(row, steps.predict, previous, s, scan_time - time, u, c)
            time = scan_time
            if self.several:
                places = tuple((1.0, z) for z in scan_plots) if scan_time == t else ()
                s = self._next(row, steps.update, previous, s, places, u, c)
        if self.several or not scan_plots:
            return s, []
        nis = []
        if steps.innovation is not None:
            with np.errstate(all="ignore"):
                e, S = step_numbers(steps.innovation, s, scan_plots[0], u, c)
            nis = [a * a / variance for a, variance in zip(e, variances(S, len(e)), strict=True)]
        return self._next(row, steps.update, previous, s, scan_plots[0], u, c), nis

    def _next(self, row: int, step: Callable[..., Any], previous: Any, *step_arguments: Any) -> Any:
        """The state after a step at a row, of the shape of the one before, if any."""
        with np.errstate(all="ignore"):
            state = step_numbers(step, *step_arguments)
        if previous is not None:
            check_same_shape(step, state, previous)
        return check_finite(row, step, state)

    def _numbers(self, row: int, step: Callable[..., Any], count: int, description: str, *step_arguments: Any) -> Any:
        """A given number of numbers from a step at a row."""
        with np.errstate(all="ignore"):
            numbers = step_numbers(step, *step_arguments)
        check_length(step, numbers, count, description)
        return check_finite(row, step, numbers)


def check_finite(row: int, step: Callable[..., Any], result: Any) -> Any:
    """The result of a step; raises PlotFault with the row where a number of it is not finite."""
    if wrong := [number for number in tracing.leaves(result) if not math.isfinite(number)]:
        raise refusal(row, step, f"gives {wrong[0]:g}")
    return result


def refusal(row: int, step: Callable[..., Any], words: str) -> PlotFault:
    """Why a filter cannot continue after a row."""
    error = PlotFault(*user_code_error(step, words).lines)
    error.row = row
    return error

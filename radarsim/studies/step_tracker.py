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
    from radarsim.studies.stepwise import StepStudy


class Tracker:
    """The filters of a case over recorded plots, in plain Python, chunk by chunk: each begins with the first plot.

    Over missed scans they predict scan by scan, as they do over empty rows; where rows hold known quantities, which a
    missed one lacks, in one step."""

    most_rows: int | None = None
    several = False

    def __init__(self, study: "StepStudy", spec: Any):
        self.study, self.names = study, tuple(filter_keys.name for filter_keys in spec.filters)
        filter_steps = [study.kinds[filter_keys.kind] for filter_keys in spec.filters]
        self.filters = [
            (steps, record(steps.design, spec, filter_keys))
            for steps, filter_keys in zip(filter_steps, spec.filters, strict=True)
        ]
        self.states: list[Any] = [None] * len(self.filters)
        self.last, self.scan_period_s = math.nan, study.scan_period_s(spec)

    def feed(self, columns: "Mapping[str, np.ndarray]") -> Track:
        with study_context(self.study.name):
            return self._follow(columns)

    def _follow(self, columns: "Mapping[str, np.ndarray]") -> Track:
        study, t = self.study, columns["t_s"]
        plots = np.transpose([columns[number.column] for number in study.measured])
        known_quantities = np.reshape([columns[name] for name in study.known_columns], (-1, t.size)).T
        values = np.full((len(self.filters), t.size, 2, len(study.components)), np.nan)
        for n in range(t.size):
            z, u = tuple(map(float, plots[n])), tuple(map(float, known_quantities[n]))
            for f, (steps, c) in enumerate(self.filters):
                s = previous = self.states[f]
                if s is not None:
                    time = self.last
                    missed = () if u else missed_scan_times(self.last, float(t[n]), self.scan_period_s)
                    for scan_time in (*missed, float(t[n])):
                        s = self._next(n, steps.predict, previous, s, scan_time - time, u, c)
                        time = scan_time
                if not any(map(math.isnan, z)):
                    step, step_arguments = (steps.start, (z, u, c)) if s is None else (steps.update, (s, z, u, c))
                    s = self._next(n, step, previous, *step_arguments)
                self.states[f] = s
                if s is not None:
                    m = len(study.components)
                    values[f, n, 0] = self._numbers(n, steps.estimate, m, "components", s, u, c)
                    if steps.covariance is not None:
                        description = "elements of a packed covariance"
                        P = self._numbers(n, steps.covariance, m * (m + 1) // 2, description, s, u, c)
                        if min(variance := variances(P, m)) < 0:
                            raise refusal(n, steps.covariance, f"gives a variance of {min(variance):g}")
                        values[f, n, 1] = np.sqrt(variance)
            self.last = float(t[n])
        components = tuple((component.name, component.unit) for component in study.components)
        return Track(self.names, components, t, values[:, :, 0], values[:, :, 1])

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

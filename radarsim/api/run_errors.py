"""Errors of single realisations, drawn again from a case, and the table `runs` of each run's root mean square.

A run keeps sums over realisations; what is no function of these is computed from the errors themselves, block by block
as the run computed them."""

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from radarsim.api.case_work import CaseWork
from radarsim.config.experiment import Case
from radarsim.errors import ConfigError, argument
from radarsim.report.run_statistics import ScanSpan, run_rms, statistics_row
from radarsim.report.tables import frame
from radarsim.studies.registry import study

if TYPE_CHECKING:
    import pandas as pd

    from radarsim.api.result import Result

MAX_ERRORS_AT_ONCE = 4_000_000  # numbers of a block in memory, 32 MB; a block of a filter in Python is never cut


class CaseErrors:
    """The errors of a case's realisations, of its own and of user filters."""

    def __init__(self, case: Case, realisations: int | None = None):
        """realisations: how many, from the first on; default: those of the case."""
        self.case, self.work = case, CaseWork(case)
        self.realisations = case.realisations if realisations is None else realisations
        self._run_rms: dict[ScanSpan, np.ndarray] = {}

    @property
    def filters(self) -> tuple[str, ...]:
        """The names of the filters, those of the user last."""
        return (*self.work.plan.axes.filters, *(member.name for member in self.case.user_filters))

    @property
    def components(self) -> tuple[tuple[str, str], ...]:
        """The names of the components, with their units."""
        return tuple(self.work.plan.axes.components)

    def blocks(self) -> Iterator[np.ndarray]:
        """The errors (F, n, K, C) block by block; not-a-number where a filter has no estimate."""
        step, total = self._block_length(), self.realisations
        for first in range(0, total, step):
            yield self._errors(first, min(step, total - first))

    def _block_length(self) -> int:
        """Realisations at once: the run's blocks for user filters, which may depend on them; else so that they fit."""
        block = self.work.block
        if self.case.user_filters:
            return block
        return max(1, min(block, MAX_ERRORS_AT_ONCE // self.work.plan.axes.available.size))

    def _errors(self, first: int, count: int) -> np.ndarray:
        if self.case.user_filters:
            from radarsim.studies.user_filters import sums

            user_plan: Any = self.work.plans[-1]
            return sums.errors(user_plan, first, count)
        errors = np.array(study(self.case.study).errors(self.work.plan, first, count))
        errors.swapaxes(0, 1)[:, ~np.asarray(self.work.plan.axes.available)] = np.nan
        return errors

    def of_filter(self, filter_name: str, component: str) -> Iterator[np.ndarray]:
        """The errors (n, K) of a filter in a component, block by block."""
        f, c = self.filter_index(filter_name), self.component_index(component)
        return (errors[f, :, :, c] for errors in self.blocks())

    def filter_index(self, name: str) -> int:
        """The place of a filter. Raises ConfigError where there is none."""
        return _index("filter", name, self.filters)

    def component_index(self, name: str) -> int:
        """The place of a component. Raises ConfigError where there is none."""
        return _index("component", name, [component for component, _ in self.components])

    def run_rms(self, span: ScanSpan | None = None) -> np.ndarray:
        """The root mean squares (F, n, C) over the scans of a span, computed once. Default: all scans."""
        k = np.asarray(self.work.plan.axes.k)
        span = ScanSpan(int(k[0]), int(k[-1])) if span is None else span
        if not span.is_among(k):
            raise ConfigError(f"{argument('runs')}: {self.case.name}: no such scans; there are {k[0]} to {k[-1]}")
        if span not in self._run_rms:
            scans = span.indices(k)
            by_block = [run_rms(np.moveaxis(errors[:, :, scans], 2, 3)) for errors in self.blocks()]
            self._run_rms[span] = np.concatenate(by_block, axis=1)
        return self._run_rms[span]


def _index(kind: str, name: str, names: Sequence[str]) -> int:
    if name not in names:
        raise ConfigError(f"{argument(kind)}: no {kind} {name!r}; there are {', '.join(names)}")
    return list(names).index(name)


def result_errors(
    result: "Result", filter: str, component: str, case: str | None = None, realisations: int | None = None
) -> Iterator[np.ndarray]:
    """As `Result.errors`."""
    names = [experiment_case.name for experiment_case in result.experiment.cases]
    number = 0 if case is None else _index("case", case, names)
    counts = {case_result.name: case_result.count for case_result in result.cases}
    available = counts.get(names[number], 0)
    count = available if realisations is None else _checked_count(realisations, available)
    return CaseErrors(result.experiment.cases[number], count).of_filter(filter, component)


def _checked_count(realisations: int, available: int) -> int:
    if not 1 <= realisations <= available:
        raise ConfigError(f"{argument('realisations')}: must be 1 to {available}, got {realisations}")
    return int(realisations)


def parse_span(text: str) -> ScanSpan | None:
    """The span of scans in a text, `2:60`; None of `all`. Raises ConfigError."""
    if text == "all":
        return None
    first, _, last = text.partition(":")
    if not (first.isdecimal() and last.isdecimal() and 1 <= int(first) <= int(last)):
        raise ConfigError(f"{argument('runs')}: must be FIRST:LAST, such as 2:60, or all, got {text!r}")
    return ScanSpan(int(first), int(last))


def runs_table(result: "Result", span: str = "all") -> "pd.DataFrame":
    """The table `runs`: statistics over the runs of each run's root mean square over a span of scans.

    case, filter, component, unit: as in `curves`
    first_k, last_k: the scans of the span
    n: the runs that have an estimate
    mean ± mean: the mean over the runs of √(mean over the scans of e²)
    variance ± variance, median ± median: of the same numbers
    quantile_05, quantile_25, quantile_50, quantile_75, quantile_95: below which so many of a hundred runs lie"""
    scans = parse_span(span)
    rows = [row for case in result.cases for row in _rows_of_case(case.realisation_errors, scans)]
    return frame({name: [row[name] for row in rows] for name in (rows[0] if rows else ())})


def _rows_of_case(errors: CaseErrors, span: ScanSpan | None) -> list[dict[str, Any]]:
    """The rows of a case: of each filter in each component in which it has an estimate."""
    k, rms = np.asarray(errors.work.plan.axes.k), errors.run_rms(span)
    scans = k if span is None else k[span.indices(k)]
    return [
        {
            **{"case": errors.case.name, "filter": name, "component": component, "unit": unit},
            **{"first_k": int(scans[0]), "last_k": int(scans[-1])},
            **statistics_row(rms[f, :, c]),
        }
        for f, name in enumerate(errors.filters)
        for c, (component, unit) in enumerate(errors.components)
        if np.isfinite(rms[f, :, c]).any()
    ]

"""Errors of single realisations, drawn again from a case, block by block as the run computed them.

A run keeps sums over realisations; what is no function of these is computed from the errors themselves."""

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from radarsim.api.case_work import CaseWork
from radarsim.config.experiment import Case
from radarsim.errors import ConfigError, argument
from radarsim.studies.registry import study

if TYPE_CHECKING:
    from radarsim.api.result import Result
    from radarsim.report.run_statistics import ScanSpan

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

    def run_rms(self, span: "ScanSpan | None" = None) -> np.ndarray:
        """The root mean squares (F, n, C) over the scans of a span, computed once. Default: all scans."""
        from radarsim.report.run_statistics import ScanSpan, run_rms  # for --runs and claims on runs alone

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

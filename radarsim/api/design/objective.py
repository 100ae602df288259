"""The objective of `solve`, `tune` and `sensitivity`: quantities of a case, exact where its study knows them, else
sampled.

It knows which case is read in the long run and which shorter one suffices, whether values are exact, and at which scan
they are read. `Curve` is an objective of one quantity as a function of keys."""

import math
from collections.abc import Callable, Collection, Sequence
from dataclasses import replace
from functools import lru_cache
from typing import Any, Protocol

import numpy as np

from radarsim.api.case_results import case_result
from radarsim.api.case_work import CaseWork
from radarsim.api.design import quantities
from radarsim.api.design.quantities import UNKNOWN_ESTIMATE, MeasuredQuantity, QuantityName, Series
from radarsim.config.experiment import Case
from radarsim.engine.collect import collect
from radarsim.engine.results import Axes, CaseResult
from radarsim.errors import ConfigError, argument
from radarsim.report.statistics import Estimate
from radarsim.studies import registry

UNPAIRED_FACTOR = 4  # factor on the realisations where a key moves the scan that is read, so that the noise differs
BATCHES = 20  # of one case: their spread has 19 degrees of freedom
ROUGH_VALUES = -1  # stands for a number of realisations


Scan = tuple[float, float]  # its number and time, s


def have_common_noise(scans: Collection[Scan]) -> bool:
    """Whether values read at these scans share their noise: it belongs to a scan's number, or to its time."""
    return any(len({scan[i] for scan in scans}) < 2 for i in (0, 1))


class Objective:
    """Quantities (n,) of a case, all at the same scans; its methods raise ConfigError where a case is refused."""

    def __init__(self, measured: Sequence[MeasuredQuantity], threads: int | None = None):
        self.measured, self.threads = tuple(measured), threads
        self.quantity = self.measured[0]  # which says the scans
        self.is_planned = quantities.is_planned(self.quantity.definition)

    def filter_names(self, case: Case) -> set[str] | None:
        """The names of the filters on which the quantities depend; None: all."""
        names = {quantity.filter for quantity in self.measured}
        if None in names:
            return None
        is_paired = any(quantity.definition.paired for quantity in self.measured)
        baseline = {getattr(case.spec, "baseline", None) or case.spec.members[0].name} if is_paired else set()
        return {str(name) for name in names} | baseline

    def case_read(self, case: Case) -> Case:
        """The case that is read: of the long run one that lasts until its filters have settled, without a manoeuvre."""
        if self.quantity.over != "long run":
            return case
        return registry.study(case.study).in_the_long_run(case, self.filter_names(case))

    def shortened(self, case: Case) -> Case:
        """The case with only those scans that exact values need."""
        study = registry.study(case.study)
        if self.quantity.over == "at":
            return study.shortened(case, self.quantity.at_s, self.quantity.at_k)
        return study.shortened(case, None, 1) if self.is_limit(case) else self.case_read(case)

    def is_limit(self, case: Case) -> bool:
        """Whether values are the limits of the long run, which the study knows without a run."""
        return self.quantity.over == "long run" and steady_sigma(case) is not None

    def labels(self, case: Case) -> Axes:
        """The labels of a case's plan, with exact errors up to the scans that the quantities need."""
        return registry.study(case.study).prepare(self.shortened(case)).axes

    def is_exact(self, case: Case) -> bool:
        """Whether the quantities are known exactly."""
        if self.is_planned:
            return not np.isnan(self.exact_values(case)).any()
        result = self._result(case, 1)
        definition, values = self.quantity.definition, self._table_values(result, exact_only=True)
        return not (np.isnan(values).any() and definition.ends[0] in quantities.quantity_table(definition, result))

    def exact_values(self, case: Case, axes: Axes | None = None) -> np.ndarray:
        """The exact values (n,) from a case's plan, whose labels may be given, or from the tables of one realisation;
        NaN where they are known only by sampling."""
        if not self.is_planned:
            return self._table_values(self._result(case, 1), exact_only=True)
        axes = self.labels(case) if axes is None else axes
        return np.array([self._planned_value(quantity, case, axes) for quantity in self.measured])

    def estimates(self, case: Case, realisations: int) -> tuple[list[Estimate], Axes]:
        """The values (n,) with their intervals from so many realisations, and the labels of the run."""
        result = self._result(case, realisations)
        return self._table_estimates(result), result.axes

    def batch_values(self, case: Case, realisations: int) -> np.ndarray:
        """The values (1 + BATCHES, n): of so many realisations, then of those without each of the batches."""
        work, size = CaseWork(self._without_further_baselines(case)), max(2, realisations // BATCHES)
        batches = [work.simulate(i * size, size) for i in range(BATCHES)]
        total = sum(batches[1:], start=batches[0])

        def values(packed: np.ndarray, count: int) -> np.ndarray:
            read, plan = work.case, work.plan
            sums = plan.layout.unpack(packed)
            return self._table_values(
                CaseResult(read.name, read.study, read.spec, read.swept_values, count, sums, plan.axes)
            )

        without_each = [values(total - batch, (BATCHES - 1) * size) for batch in batches]
        return np.stack([values(total, BATCHES * size), *without_each])

    def interval_note(self, case: Case, realisations: int) -> str:
        """The note of the tables on the interval of the first quantity, or an empty text."""
        return quantities.interval_note(self.quantity, self._result(case, realisations))

    def scan_read(self, axes: Axes) -> Scan:
        """Where values are read: the last scan and its time, s; for a given time that of the later of two scans alone;
        zeros where no key moves it: of a given scan, and of several."""
        quantity, t_s = self.quantity, np.asarray(axes.t_s, dtype=float)
        if quantity.at_k is not None or quantity.over != "at" or not len(t_s):
            return 0, 0.0
        if quantity.at_s is None:
            return int(axes.k[-1]), float(t_s[-1])
        later_s = float(t_s[min(int(np.searchsorted(t_s, quantity.at_s * (1 - 1e-12))), len(t_s) - 1)])
        return later_s, later_s

    def is_settled(self, case: Case) -> bool:
        """Whether the filters on which an error at a time depends have settled by then, or the target manoeuvres
        before; also where that is not known."""
        quantity, names, spec, study = self.quantity, self.filter_names(case), case.spec, registry.study(case.study)
        if quantity.over != "at" or not self.is_planned:
            return True
        members = tuple(member for member in spec.members if names is None or member.name in names)
        changes = {type(spec).bare_keys: members} | ({"baseline": None} if hasattr(spec, "baseline") else {})
        compared = replace(case, spec=spec.model_copy(update=changes))
        try:
            scans = study.counted_scans(compared, quantity.component)
        except ConfigError:  # other keys name the filters that are left out
            scans = study.counted_scans(case, quantity.component)
        if scans is None or scans.reason == "manoeuvre":
            return True
        is_late = quantity.at_s is None if quantity.at_k is None else quantity.at_k >= scans.k
        return scans.reason == "settled" and (is_late or (quantity.at_s or 0.0) >= scans.t_s)

    def _planned_value(self, quantity: MeasuredQuantity, case: Case, axes: Axes) -> float:
        """The exact value of a quantity from the labels of a plan."""
        if not registry.study(case.study).exact_errors:
            return math.nan
        definition, baseline = quantity.definition, axes.baseline
        f = axes.filters.index(str(quantity.filter))
        c = [name for name, _ in axes.components].index(str(quantity.component))
        if definition.paired and f == baseline:
            return math.nan
        if quantity.over == "long run" and (sigma := steady_sigma(case)) is not None:
            if not definition.paired:
                return float(sigma[f, c])
            return math.nan if baseline is None else float(100 * (1 - sigma[f, c] / sigma[baseline, c]))
        available = axes.available[f, :, c]
        if definition.paired:
            available = available & axes.available[baseline, :, c]
        planned = np.asarray(getattr(axes, quantities.PLANNED[definition.table, definition.value]), dtype=float)
        values = np.where(available, planned[f, :, c], np.nan)
        series = Series(np.asarray(axes.k), np.asarray(axes.t_s, dtype=float), Estimate(values, values, values))
        return float(quantities.estimate_at(quantity, series).value)

    def _without_further_baselines(self, case: Case) -> Case:
        """The case that is simulated: a question is of gains against the first baseline."""
        return replace(self.case_read(case), further_baselines=())

    def _result(self, case: Case, realisations: int) -> CaseResult:
        work = CaseWork(self._without_further_baselines(case))
        return case_result(work.case, work, collect(work, realisations, threads=self.threads))

    def _table_values(self, result: CaseResult, exact_only: bool = False) -> np.ndarray:
        return np.array([float(estimate.value) for estimate in self._table_estimates(result, exact_only)])

    def _table_estimates(self, result: CaseResult, exact_only: bool = False) -> list[Estimate]:
        """The quantities in the tables of a case. A component that a filter lacks has no estimate; where it alone is
        asked for, ConfigError is raised."""
        estimates, series_by_definition = list[Estimate](), dict[Any, dict[tuple[str, str], Series]]()
        for quantity in self.measured:
            definition, name = quantity.definition, quantity.component or ""
            if definition not in series_by_definition:
                table = quantities.quantity_table(definition, result)
                series_by_definition[definition] = quantities.series_by_filter(definition, table, exact_only)
            series = series_by_definition[definition]
            components = [component for filter_name, component in series if filter_name == quantity.filter]
            if components and len(self.measured) == 1:
                name = quantities.with_component(quantity, components).component or ""
            found = series.get((str(quantity.filter), name))
            estimates.append(UNKNOWN_ESTIMATE if found is None else quantities.estimate_at(quantity, found))
        return estimates


@lru_cache(maxsize=4)  # a case is asked for its labels, and then for its values
def steady_sigma(case: Case) -> np.ndarray | None:
    """The exact σ (F, C) of a case's filters in the long run, where its study knows it."""
    return registry.study(case.study).steady_sigma(case)


def resolve_quantity(
    request: QuantityName, case: Case, user_filters: Sequence[str] = ()
) -> tuple[MeasuredQuantity, Axes]:
    """The quantity that is asked of a case, with its filter, and the labels of the plan. Raises ConfigError."""
    measured = quantities.check_quantity(request, case, user_filters)
    axes = Objective([measured]).labels(case)
    measured = quantities.resolve_scan(measured, axes)
    objective = Objective([measured])
    if measured.over == "long run" and not objective.is_limit(case) and len(axes.t_s):
        measured = replace(measured, settled_s=float(axes.t_s[-1]))
    return measured, axes


class CaseFunction(Protocol):
    """A case, and the same case with other values, which raises ConfigError if the config refuses them."""

    base: Case

    def case_with_value(self, key: str, value: Any) -> Case: ...


class Curve:
    """A quantity as a function of a key, or of several, each value computed once.

    exact: whether its values are known exactly, unless they are to be `sampled`. progress is called for each value;
    `completed` counts realisations simulated, or values that need none."""

    def __init__(
        self,
        cases: CaseFunction,
        key: str,
        objective: Objective,
        realisations: int,
        progress: Callable[[int, int, int], None] | None = None,
        sampled: bool = False,
    ):
        self.cases, self.key, self.objective, self.progress = cases, key, objective, progress
        self.realisations, self.quantity = realisations, objective.quantity
        self.exact = not sampled and objective.is_exact(cases.base)
        study = registry.study(cases.base.study)
        # Whether cheaper approximate values exist, for a first search.
        self.has_rough_values = self.exact and study.costly(objective.shortened(cases.base))
        self.estimates: dict[tuple[Any, int], Estimate] = {}
        self.refusals: dict[Any, ConfigError] = {}
        self.scans = set[Scan]()  # at which simulated values were read
        self.completed, self.expected = 0, 0  # 0 expected: unknown

    def exact_value(self, value: Any) -> float:
        """The exact quantity at a value (None: the config's own); NaN where there is none."""
        return self._cached(value, 0, self._exact_estimate).value

    def roughly(self, value: Any) -> float:
        """A cheaper value, to a thousandth of σ, if the study has one; else the exact quantity."""
        if not self.has_rough_values:
            return self.exact_value(value)
        return self._cached(value, ROUGH_VALUES, lambda case: self._exact_estimate(replace(case, roughly=True))).value

    def simulate(self, value: Any, realisations: int) -> Estimate:
        """The quantity with its interval, from this number of realisations."""
        return self._cached(value, realisations, lambda case: self._sampled_estimate(case, realisations))

    def interval_notes(self, value: Any) -> tuple[str, ...]:
        """The note of the tables on the interval at a value, in words."""
        note = self.objective.interval_note(self.cases.case_with_value(self.key, value), self.realisations)
        option = argument("realisations=…", "-n")
        return (f"the interval may be too narrow: {note}; use more realisations, {option}",) if note else ()

    def _cached(self, value: Any, count: int, compute: Callable[[Case], Estimate]) -> Estimate:
        if value is None:
            return compute(self.cases.base)
        if (value, count) in self.estimates:
            return self.estimates[value, count]
        try:
            estimate = compute(self.cases.case_with_value(self.key, value))
        except ConfigError as error:
            self.refusals[value] = error
            estimate = UNKNOWN_ESTIMATE
        self.estimates[value, count] = estimate
        cost = max(count, 1)
        self.completed += cost
        if self.expected and self.progress is not None:
            # A search that needs a value more than expected may need further ones.
            self.expected = max(self.expected, self.completed + cost)
            self.progress(self.completed, self.expected, 0)
        return estimate

    def _exact_estimate(self, case: Case) -> Estimate:
        (value,) = self.objective.exact_values(case)
        return Estimate(float(value), float(value), float(value))

    def _sampled_estimate(self, case: Case, realisations: int) -> Estimate:
        (estimate,), axes = self.objective.estimates(case, realisations)
        self.scans.add(self.objective.scan_read(axes))
        return estimate

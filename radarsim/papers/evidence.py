"""Measured values for claims: tables of a result as curves, and points of them with their intervals."""

import copy
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from radarsim.engine.results import CaseResult
from radarsim.errors import ConfigError
from radarsim.report import tables
from radarsim.report.run_statistics import ScanSpan
from radarsim.report.statistics import Estimate, difference

if TYPE_CHECKING:
    from radarsim.api.realisation_errors import CaseErrors

DEPENDENT_REALISATIONS = "realisations of a filter depend on each other: no interval holds"
INTERVAL_ROUNDING = 1e-12  # of a number: an interval that is narrower is rounding


class MissingEvidence(KeyError):
    """The experiment does not hold what a part of a claim needs; it then does not judge that part. A text gives the
    reason; anything else is the key of an absent case."""

    @property
    def why(self) -> str:
        """The reason, if given."""
        return next((arg for arg in self.args if isinstance(arg, str)), "")


class UnknownName(MissingEvidence):
    """An existing case has no filter, or component, of that name, or no gain of it: it is the baseline."""

    for_the_author = True

    def __str__(self) -> str:
        return "; ".join(self.args)


class UnknownScans(UnknownName):
    """A curve that is there has no such scans. A second text says which it has."""


class HiddenTables(dict):
    """Stands for sums and tables that must not be read: everything is missing."""

    def __missing__(self, key: str) -> Any:
        raise MissingEvidence(key)


class ExactNumber(Estimate):
    """A number without noise: algebra, a count."""

    __slots__ = ()


@dataclass(frozen=True)
class Curve:
    """A measured curve: scans k, times t, values and the ends of their intervals, arrays of one length.

    short: why it ends before the paper's; values that depend on its end are then missing."""

    k: np.ndarray
    t: np.ndarray
    value: np.ndarray
    lo: np.ndarray
    hi: np.ndarray
    short: str = ""

    def point(self, i: int) -> Estimate:
        """The i-th point."""
        return Estimate(float(self.value[i]), float(self.lo[i]), float(self.hi[i]))

    def where(self, mask: np.ndarray | slice) -> "Curve":
        """The points selected by a mask or indices; raises MissingEvidence where there is none."""
        if not np.asarray(self.k)[mask].size:
            there = f"there are {self.k[0]} to {self.k[-1]}" if len(self.k) else "there are none"
            raise UnknownScans("no such scans", there)
        k, t, value, lo, hi = (np.asarray(part)[mask] for part in (self.k, self.t, self.value, self.lo, self.hi))
        return Curve(k, t, value, lo, hi, self.short)

    def upto(self, k: int) -> "Curve":
        """Points up to scan k; complete (not `short`) if the curve reaches k."""
        part = self.where(self.k <= k)
        return replace(part, short="") if self.k[-1] >= k else part

    def _check_complete(self) -> None:
        if self.short:
            raise MissingEvidence(self.short)

    def since(self, k: int) -> "Curve":
        """From scan k on."""
        return self.where(self.k >= k)

    def at_scan(self, k: int) -> Estimate:
        """The point at scan k."""
        return self.where(self.k == k).point(0)

    def first(self) -> Estimate:
        """The first point."""
        return self.point(0)

    def last(self) -> Estimate:
        """The last point."""
        self._check_complete()
        return self.point(-1)

    def largest(self) -> Estimate:
        """The largest value, with the interval of its own scan."""
        self._check_complete()
        return self.point(int(np.nanargmax(self.value)))

    def smallest(self) -> Estimate:
        """The smallest value, with the interval of its own scan."""
        self._check_complete()
        return self.point(int(np.nanargmin(self.value)))

    def when_largest(self, axis_name: str = "t") -> Estimate:
        """Time (axis_name="k": scan) of the largest value; the interval spans all points not significantly below
        it."""
        self._check_complete()
        axis = getattr(self, axis_name)
        top = int(np.nanargmax(self.value))
        near = axis[self.hi >= self.lo[top]]
        return Estimate(float(axis[top]), float(near.min()), float(near.max()))


def common_times(a: Curve, b: Curve) -> tuple[Curve, Curve]:
    """The points of both at their common times."""
    _, i, j = np.intersect1d(np.round(a.t, 6), np.round(b.t, 6), return_indices=True)
    return a.where(i), b.where(j)


def subtract(a: Curve, b: Curve) -> Curve:
    """a − b, point by point, of independent noise: half-widths add in squares."""
    difference_of = difference(Estimate(a.value, a.lo, a.hi), Estimate(b.value, b.lo, b.hi))
    return Curve(a.k, a.t, *difference_of, short=a.short or b.short)


def ratio(a: Estimate, b: Estimate, scale: float = 1.0) -> Estimate:
    """scale · a / b of independent positive estimates: relative half-widths add in squares. Its ends are NaN where an
    estimate is zero, as errors of exactly known values are."""
    with np.errstate(divide="ignore", invalid="ignore"):
        value = np.divide(scale * a.value, b.value)
        down = np.hypot(1 - np.divide(a.lo, a.value), np.divide(b.hi, b.value) - 1)
        up = np.hypot(np.divide(a.hi, a.value) - 1, 1 - np.divide(b.lo, b.value))
    return Estimate(
        *(number if np.ndim(number) else float(number) for number in (value, value * (1 - down), value * (1 + up)))
    )


def has_interval(estimate: Estimate) -> bool:
    """Whether an estimate has an interval wider than rounding, or an unknown one, so that its value is not exact.

    The ends of a ratio of exact numbers are unknown where one of them is zero (`ratio`): that is no interval. Nor are
    those of an infinite value, such as a time to something that does not come within the run."""
    value, lo, hi = (float(number) for number in estimate)
    if not math.isfinite(value):
        return False
    if math.isnan(lo) or math.isnan(hi):
        return value != 0
    if lo == hi:
        return False
    return math.isinf(lo) or math.isinf(hi) or hi - lo > INTERVAL_ROUNDING * max(abs(lo), abs(hi))


def exact_number(value: float) -> ExactNumber:
    """A number without noise: algebra, a count."""
    return ExactNumber(float(value), float(value), float(value))


@dataclass(frozen=True, repr=False)
class InterpretedCase(CaseResult):
    """A case that was run under an interpretation: `spec` has the keys of the run, `shipped_spec` those of the paper's
    own case, by which claims find it."""

    shipped_spec: Any = None


def interpreted_case(result: CaseResult, shipped_spec: Any) -> InterpretedCase:
    """A result of a changed case, with the keys of the paper's own case."""
    return InterpretedCase(**{f.name: getattr(result, f.name) for f in fields(result)}, shipped_spec=shipped_spec)


def shipped_spec(result: CaseResult) -> Any:
    """The keys by which claims find a case: under an interpretation those of the paper's own case, not of the run."""
    return result.shipped_spec if isinstance(result, InterpretedCase) else result.spec


def _check_independent(result: CaseResult, *filter_names: str) -> None:
    """Raise MissingEvidence for a filter whose realisations depend on each other."""
    axes: Any = result.user_filters and result.user_filters.axes
    if axes and {*filter_names} & {name for name, _ in axes.dependent}:
        raise MissingEvidence(DEPENDENT_REALISATIONS)


class _WatchedTables(dict):
    """Tables that record which of them are read."""

    def __init__(self, tables: Mapping, tables_read: set[tuple[str, str]]):
        super().__init__(tables)
        self._looked = tables_read

    def __getitem__(self, name: str) -> Any:
        self._looked.add((name, ""))
        return super().__getitem__(name)


class Evidence:
    """Measured values of an experiment for the claims of its study. Studies define in `case` the meaning of a key.

    results: only the paper's cases; `members` gives the paper's members of their lists that may grow."""

    def __init__(
        self, results: Sequence[CaseResult], tables_by_name: Mapping, places: Mapping[str, Mapping[str, set[int]]]
    ):
        """places: by case name and list key, the indices of the paper's members."""
        self.results: list[CaseResult] = list(results)
        self.tables_read: set[tuple[str, str]] = (
            set()
        )  # tables read, with or without a component, since it was last emptied
        self.tables: Mapping = _WatchedTables(tables_by_name, self.tables_read)
        self._places = places
        self._exact = False
        self._groups: dict[str, Mapping] = {}

    def exactly(self) -> "Evidence":
        """The same with exact values in place of measured ones; values that are not known exactly are missing. Curves
        and gains are those of their exact columns; other tables, and sums, cannot be read."""
        for name in ("curves", "gains"):
            self._grouped(name)
        exact_evidence = copy.copy(self)
        exact_evidence._exact, exact_evidence.tables = True, HiddenTables()
        exact_evidence.results = [replace(result, sums=HiddenTables()) for result in self.results]
        return exact_evidence

    def _grouped(self, table: str) -> Mapping:
        """The rows of curves by case, filter and component; of gains also by baseline."""
        if table not in self._groups:
            columns = ("case", "filter", "component", *(("baseline",) if table == "gains" else ()))
            self._groups[table] = tables.group_by(self.tables[table], *columns)
        return self._groups[table]

    def members(self, result: CaseResult, key: str = "filters") -> list[tuple[int, Any]]:
        """The paper's members of a list of a case, each with its number; not the added ones."""
        return [
            (i, member)
            for i, member in enumerate(getattr(shipped_spec(result), key))
            if i in self._places[result.name][key]
        ]

    def case(self, key: Any) -> CaseResult:
        """The case for a key; raises MissingEvidence where the experiment does not hold it. Here: by name.

        A subclass compares keys with `shipped_spec(result)`; the case's `spec` has those of the run."""
        for result in self.results:
            if result.name == key:
                return result
        raise MissingEvidence(key)

    def _lacking(self, result: CaseResult, filter_name: str, component: str, *base: str) -> MissingEvidence:
        """Which name an existing case lacks; if it has all names, that it has no such curve."""
        filters = *result.axes.filters, *(result.user_filters.axes.filters if result.user_filters else ())
        components = tuple(name for name, _ in result.axes.components)
        for kind, name, existing in (("filter", filter_name, filters), ("component", component, components)):
            if name not in existing:
                return UnknownName(f"no {kind} {name!r}; there are {', '.join(existing)}")
        if filter_name in base:
            return UnknownName(f"filter {filter_name!r} is the baseline: it has no gain")
        return MissingEvidence((result.name, filter_name, component, *base))

    def curve(self, key: Any, filter_name: str, component: str) -> Curve:
        """σ(k) of a filter of a case."""
        return self._series("curves", key, filter_name, component, ("sigma", "sigma_lo", "sigma_hi", "exact_sigma"))

    def gain(self, key: Any, filter_name: str, component: str) -> Curve:
        """Relative gain of a filter of a case against its baseline, the first of several, %."""
        return self._gain(key, filter_name, component, self.case(key).baseline)

    def _gain(self, key: Any, filter_name: str, component: str, base: str) -> Curve:
        names = ("gain_percent", "gain_lo", "gain_hi", "exact_percent")
        return self._series("gains", key, filter_name, component, names, base)

    def _series(
        self, table: str, key: Any, filter_name: str, component: str, names: tuple[str, ...], *base: str
    ) -> Curve:
        result = self.case(key)
        rows = self._grouped(table).get((result.name, filter_name, component, *base))
        self.tables_read.add((table, component))
        if rows is None:
            raise self._lacking(result, filter_name, component, *base)
        _check_independent(result, filter_name, *base)
        value, lo, hi, exact = (
            rows[name].to_numpy(dtype=float) if name in rows else np.full(len(rows), np.nan) for name in names
        )
        if self._exact:
            if np.isnan(exact).any():
                raise MissingEvidence("not known exactly")
            value = lo = hi = exact
        return Curve(rows["k"].to_numpy(), rows["t_s"].to_numpy(), value, lo, hi)

    def ratio(self, key: Any, filter_name: str, base_name: str, component: str) -> Curve:
        """σ of a filter over that of another one of the case: paired where one of the two is a baseline of it, or
        is from outside.

        Otherwise as of independent estimates, with an interval wider than under common noise."""
        case = self.case(key)
        gains = self._grouped("gains")
        if (case.name, filter_name, component, base_name) in gains:
            gain = self._gain(key, filter_name, component, base_name)
            value, lo, hi = (1 - part / 100 for part in (gain.value, gain.hi, gain.lo))
            return Curve(gain.k, gain.t, value, lo, hi)
        if (case.name, base_name, component, filter_name) in gains:
            gain = self._gain(key, base_name, component, filter_name)
            value, lo, hi = (1 / (1 - part / 100) for part in (gain.value, gain.lo, gain.hi))
            return Curve(gain.k, gain.t, value, lo, hi)
        curve, base_curve = (self.curve(key, name, component) for name in (filter_name, base_name))
        curve, base_curve = (
            curve.where(np.isin(curve.k, base_curve.k)),
            base_curve.where(np.isin(base_curve.k, curve.k)),
        )
        ratios = ratio(
            Estimate(curve.value, curve.lo, curve.hi), Estimate(base_curve.value, base_curve.lo, base_curve.hi)
        )
        return Curve(curve.k, curve.t, ratios.value, ratios.lo, ratios.hi)

    def errors(self, key: Any, filter_name: str, component: str, realisations: int | None = None) -> np.ndarray:
        """The errors (n, K) of a filter's estimates in the realisations of a case, not-a-number where there is none.

        They are drawn again, and held in memory: `realisations` takes only so many, the first ones. K counts the scans
        of `case(key).axes.k`."""
        errors = self._case_errors(key, filter_name, component)
        if realisations is not None and realisations < errors.realisations:
            errors = type(errors)(errors.case, realisations)
        return np.concatenate(list(errors.of_filter(filter_name, component)))

    def run_rms(
        self, key: Any, filter_name: str, component: str, first: int | None = None, last: int | None = None
    ) -> np.ndarray:
        """Each run's root-mean-square error (n,) over the scans first to last; default: all of them."""
        errors = self._case_errors(key, filter_name, component)
        k = self.case(key).axes.k
        span = ScanSpan(int(k[0]) if first is None else first, int(k[-1]) if last is None else last)
        if not span.is_among(np.asarray(k)):
            raise UnknownScans("no such scans", f"there are {k[0]} to {k[-1]}")
        return errors.run_rms(span)[errors.filter_index(filter_name), :, errors.component_index(component)]

    def _case_errors(self, key: Any, filter_name: str, component: str) -> "CaseErrors":
        """The errors of a case. Raises MissingEvidence where they are not to be seen, or a name is unknown."""
        result = self.case(key)
        if self._exact:
            raise MissingEvidence("not known exactly")
        if result.realisation_errors is None:
            raise MissingEvidence("the errors of its realisations are not known")
        errors: CaseErrors = result.realisation_errors
        if filter_name not in errors.filters or component not in dict(errors.components):
            raise self._lacking(result, filter_name, component)
        _check_independent(result, filter_name)
        return errors

    def row(self, table: str, **equal: object) -> Mapping[str, Any]:
        """The one row of a table with these values; raises MissingEvidence, or ConfigError where there is no such
        table."""
        if not isinstance(self.tables, HiddenTables) and table not in self.tables:
            raise ConfigError(f"this study has no table {table!r}; there are {', '.join(self.tables)}")
        rows = self.tables[table]
        self.tables_read.add((table, str(equal.get("component", ""))))
        for name, value in equal.items():
            if name in ("filter", "component") and not (rows[name] == value).any():
                raise UnknownName(f"no {name} {value!r}; there are {', '.join(dict.fromkeys(rows[name].astype(str)))}")
            rows = rows[rows[name] == value]
        if not len(rows):
            raise MissingEvidence(equal)
        first: Any = rows.iloc[0]  # a Series, read as a mapping
        return first

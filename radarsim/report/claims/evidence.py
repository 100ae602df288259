"""What an experiment measured, as claims ask for it: curves as series, points of them with their intervals."""

import copy
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from radarsim.engine.results import CaseResult
from radarsim.report import tables as common
from radarsim.report.statistics import Estimate, difference


class Missing(KeyError):
    """The experiment does not hold what a part of a claim needs; that part is then not judged by it.

    A text says why; anything else is the key of a case that is not there.
    """

    @property
    def why(self) -> str:
        """The reason, where one was given."""
        return next((arg for arg in self.args if isinstance(arg, str)), "")


class Hidden(dict):
    """In place of sums and tables where none may be looked at: everything is missing."""

    def __missing__(self, key: str) -> Any:
        raise Missing(key)


class Certain(Estimate):
    """A number without noise: algebra, a count."""

    __slots__ = ()


@dataclass(frozen=True)
class Series:
    """A measured curve: scans k, times t, values and the ends of their intervals, arrays of one length.

    short says why it ends before the paper's does; what depends on its end is then missing.
    """

    k: np.ndarray
    t: np.ndarray
    value: np.ndarray
    lo: np.ndarray
    hi: np.ndarray
    short: str = ""

    def point(self, i: int) -> Estimate:
        """The i-th point."""
        return Estimate(float(self.value[i]), float(self.lo[i]), float(self.hi[i]))

    def where(self, mask: np.ndarray | slice) -> "Series":
        """The points that a mask or indices pick; raises Missing where there is none."""
        if not np.asarray(self.k)[mask].size:
            raise Missing("no such scans")
        k, t, value, lo, hi = (np.asarray(part)[mask] for part in (self.k, self.t, self.value, self.lo, self.hi))
        return Series(k, t, value, lo, hi, self.short)

    def upto(self, k: int) -> "Series":
        """To scan k; whole if it goes so far."""
        part = self.where(self.k <= k)
        return replace(part, short="") if self.k[-1] >= k else part

    def _whole(self) -> None:
        if self.short:
            raise Missing(self.short)

    def since(self, k: int) -> "Series":
        """From scan k on."""
        return self.where(self.k >= k)

    def at(self, k: int) -> Estimate:
        """The point at scan k."""
        return self.where(self.k == k).point(0)

    def first(self) -> Estimate:
        """The first point."""
        return self.point(0)

    def last(self) -> Estimate:
        """The last point."""
        self._whole()
        return self.point(-1)

    def largest(self) -> Estimate:
        """The largest value, with the interval of its own scan."""
        self._whole()
        return self.point(int(np.nanargmax(self.value)))

    def least(self) -> Estimate:
        """The least value, with the interval of its own scan."""
        self._whole()
        return self.point(int(np.nanargmin(self.value)))

    def when_largest(self, of: str = "t") -> Estimate:
        """Time (or scan, of="k") of the largest value; the interval spans all that cannot be told from it."""
        self._whole()
        axis = getattr(self, of)
        top = int(np.nanargmax(self.value))
        near = axis[self.hi >= self.lo[top]]
        return Estimate(float(axis[top]), float(near.min()), float(near.max()))


def common_times(a: Series, b: Series) -> tuple[Series, Series]:
    """The points of both at the times that both have."""
    _, i, j = np.intersect1d(np.round(a.t, 6), np.round(b.t, 6), return_indices=True)
    return a.where(i), b.where(j)


def minus(a: Series, b: Series) -> Series:
    """a − b, point by point, of independent noise: half-widths add in squares."""
    of = difference(Estimate(a.value, a.lo, a.hi), Estimate(b.value, b.lo, b.hi))
    return Series(a.k, a.t, *of, short=a.short or b.short)


def ratio(a: Estimate, b: Estimate, scale: float = 1.0) -> Estimate:
    """scale · a / b of independent positive estimates: relative half-widths add in squares."""
    value = scale * a.value / b.value
    down = np.hypot(1 - a.lo / a.value, b.hi / b.value - 1)
    up = np.hypot(a.hi / a.value - 1, 1 - b.lo / b.value)
    return Estimate(value, value * (1 - down), value * (1 + up))


def certain(value: float) -> Certain:
    """A number without noise: algebra, a count."""
    return Certain(float(value), float(value), float(value))


class _Watched(dict):
    """Tables that note which of them is looked at."""

    def __init__(self, made: Mapping, looked: set[tuple[str, str]]):
        super().__init__(made)
        self._looked = looked

    def __getitem__(self, name: str) -> Any:
        self._looked.add((name, ""))
        return super().__getitem__(name)


class Evidence:
    """What an experiment measured, as the claims of its study ask for it. Studies say in `case` what a key means.

    results are the cases that are the paper's, no others; of their lists that may grow, `members` gives the paper's.
    """

    def __init__(self, results: Sequence[CaseResult], made: Mapping, places: Mapping[str, Mapping[str, set[int]]]):
        """places: by the name of a case and the key of a list, which of its members are the paper's."""
        self.results: list[CaseResult] = list(results)
        self.looked: set[tuple[str, str]] = set()  # tables, with or without a component, since it was last emptied
        self.tables: Mapping = _Watched(made, self.looked)
        self._places = places
        self._exact = False
        self._groups: dict[str, Mapping] = {}

    def exactly(self) -> "Evidence":
        """The same with exact values in place of measured ones; what is not known exactly is missing.

        Curves and gains are those of their exact columns; no other table, and no sums, can be seen.
        """
        for name in ("curves", "gains"):
            self._grouped(name)
        other = copy.copy(self)
        other._exact, other.tables = True, Hidden()
        other.results = [replace(result, sums=Hidden()) for result in self.results]
        return other

    def _grouped(self, table: str) -> Mapping:
        """The rows of curves or gains by case, filter and component."""
        if table not in self._groups:
            self._groups[table] = common.groups(self.tables[table], "case", "filter", "component")
        return self._groups[table]

    def members(self, result: CaseResult, key: str = "filters") -> list[tuple[int, Any]]:
        """The members of a list of a case that are the paper's, each with its number; not those that were added."""
        return [(i, one) for i, one in enumerate(getattr(result.spec, key)) if i in self._places[result.name][key]]

    def case(self, key: Any) -> CaseResult:
        """The case that a key means; raises Missing where the experiment does not hold it. Here: by name."""
        for result in self.results:
            if result.name == key:
                return result
        raise Missing(key)

    def curve(self, key: Any, filter_name: str, component: str) -> Series:
        """σ(k) of a filter of a case."""
        return self._series("curves", key, filter_name, component, ("sigma", "sigma_lo", "sigma_hi", "exact_sigma"))

    def gain(self, key: Any, filter_name: str, component: str) -> Series:
        """Relative gain of a filter of a case against its baseline, %."""
        names = ("gain_percent", "gain_lo", "gain_hi", "exact_percent")
        return self._series("gains", key, filter_name, component, names)

    def _series(self, table: str, key: Any, filter_name: str, component: str, names: tuple[str, ...]) -> Series:
        rows = self._grouped(table).get((self.case(key).name, filter_name, component))
        self.looked.add((table, component))
        if rows is None:
            raise Missing(key)
        value, lo, hi, exact = (rows[name].to_numpy(dtype=float) for name in names)
        if self._exact:
            if np.isnan(exact).any():
                raise Missing("not known exactly")
            value = lo = hi = exact
        return Series(rows["k"].to_numpy(), rows["t_s"].to_numpy(), value, lo, hi)

    def row(self, table: str, **equal: object) -> Mapping[str, Any]:
        """The one row of a table with these values; raises Missing."""
        rows = self.tables[table]
        self.looked.add((table, str(equal.get("component", ""))))
        for name, value in equal.items():
            rows = rows[rows[name] == value]
        if not len(rows):
            raise Missing(equal)
        first: Any = rows.iloc[0]  # a Series, read as a mapping
        return first

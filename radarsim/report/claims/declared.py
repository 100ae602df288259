"""The papers' claims as data: what a study declares.

Measured values for claims: curves as series, points of them with their intervals.

Whether a case is the paper's own experiment; only such cases may judge its claims. A claim names the shipped config
that holds its experiment. A case is the paper's when its checked keys equal those of a case of that config. These may
differ: the number of realisations, the seed and the options of a run, which are not keys of a study; display names
(`config.fields.Display`); and members added to a list that the study declares in `PaperClaims.may_grow`, or filters of
other code (`python:`) beside the paper's own."""

import copy
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from radarsim.config.experiment import Case, canonical
from radarsim.config.fields import NameIn
from radarsim.engine.results import CaseResult
from radarsim.errors import ConfigError
from radarsim.report import tables
from radarsim.report.claims.rule import Range
from radarsim.report.statistics import Estimate, difference


# ---- evidence --------------------------------------------------------------------------------------------------------
class Missing(KeyError):
    """The experiment does not hold what a part of a claim needs; it then does not judge that part. A text gives the
    reason; anything else is the key of an absent case."""

    @property
    def why(self) -> str:
        """The reason, if given."""
        return next((arg for arg in self.args if isinstance(arg, str)), "")


class NoSuchName(Missing):
    """An existing case has no filter, or component, of that name, or no gain of it: it is the baseline."""

    for_the_author = True

    def __str__(self) -> str:
        return "; ".join(self.args)


class NoSuchScans(NoSuchName):
    """A curve that is there has no such scans. A second text says which it has."""


class Hidden(dict):
    """Stands for sums and tables that must not be read: everything is missing."""

    def __missing__(self, key: str) -> Any:
        raise Missing(key)


class Certain(Estimate):
    """A number without noise: algebra, a count."""

    __slots__ = ()


@dataclass(frozen=True)
class Series:
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

    def where(self, mask: np.ndarray | slice) -> "Series":
        """The points selected by a mask or indices; raises Missing where there is none."""
        if not np.asarray(self.k)[mask].size:
            there = f"there are {self.k[0]} to {self.k[-1]}" if len(self.k) else "there are none"
            raise NoSuchScans("no such scans", there)
        k, t, value, lo, hi = (np.asarray(part)[mask] for part in (self.k, self.t, self.value, self.lo, self.hi))
        return Series(k, t, value, lo, hi, self.short)

    def upto(self, k: int) -> "Series":
        """Points up to scan k; complete (not `short`) if the curve reaches k."""
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
        """Time (or scan, of="k") of the largest value; the interval spans all points not significantly below it."""
        self._whole()
        axis = getattr(self, of)
        top = int(np.nanargmax(self.value))
        near = axis[self.hi >= self.lo[top]]
        return Estimate(float(axis[top]), float(near.min()), float(near.max()))


def common_times(a: Series, b: Series) -> tuple[Series, Series]:
    """The points of both at their common times."""
    _, i, j = np.intersect1d(np.round(a.t, 6), np.round(b.t, 6), return_indices=True)
    return a.where(i), b.where(j)


def minus(a: Series, b: Series) -> Series:
    """a − b, point by point, of independent noise: half-widths add in squares."""
    of = difference(Estimate(a.value, a.lo, a.hi), Estimate(b.value, b.lo, b.hi))
    return Series(a.k, a.t, *of, short=a.short or b.short)


def ratio(a: Estimate, b: Estimate, scale: float = 1.0) -> Estimate:
    """scale · a / b of independent positive estimates: relative half-widths add in squares. Its ends are NaN where an
    estimate is zero, as errors of exactly known values are."""
    with np.errstate(divide="ignore", invalid="ignore"):
        value = np.divide(scale * a.value, b.value)
        down = np.hypot(1 - np.divide(a.lo, a.value), np.divide(b.hi, b.value) - 1)
        up = np.hypot(np.divide(a.hi, a.value) - 1, 1 - np.divide(b.lo, b.value))
    return Estimate(*(one if np.ndim(one) else float(one) for one in (value, value * (1 - down), value * (1 + up))))


def certain(value: float) -> Certain:
    """A number without noise: algebra, a count."""
    return Certain(float(value), float(value), float(value))


class _Watched(dict):
    """Tables that record which of them are read."""

    def __init__(self, made: Mapping, looked: set[tuple[str, str]]):
        super().__init__(made)
        self._looked = looked

    def __getitem__(self, name: str) -> Any:
        self._looked.add((name, ""))
        return super().__getitem__(name)


class Evidence:
    """Measured values of an experiment for the claims of its study. Studies define in `case` the meaning of a key.

    results: only the paper's cases; `members` gives the paper's members of their lists that may grow."""

    def __init__(self, results: Sequence[CaseResult], made: Mapping, places: Mapping[str, Mapping[str, set[int]]]):
        """places: by case name and list key, the indices of the paper's members."""
        self.results: list[CaseResult] = list(results)
        self.looked: set[tuple[str, str]] = set()  # tables read, with or without a component, since it was last emptied
        self.tables: Mapping = _Watched(made, self.looked)
        self._places = places
        self._exact = False
        self._groups: dict[str, Mapping] = {}

    def exactly(self) -> "Evidence":
        """The same with exact values in place of measured ones; values that are not known exactly are missing. Curves
        and gains are those of their exact columns; other tables, and sums, cannot be read."""
        for name in ("curves", "gains"):
            self._grouped(name)
        other = copy.copy(self)
        other._exact, other.tables = True, Hidden()
        other.results = [replace(result, sums=Hidden()) for result in self.results]
        return other

    def _grouped(self, table: str) -> Mapping:
        """The rows of curves by case, filter and component; of gains also by baseline."""
        if table not in self._groups:
            columns = ("case", "filter", "component", *(("baseline",) if table == "gains" else ()))
            self._groups[table] = tables.groups(self.tables[table], *columns)
        return self._groups[table]

    def members(self, result: CaseResult, key: str = "filters") -> list[tuple[int, Any]]:
        """The paper's members of a list of a case, each with its number; not the added ones."""
        return [(i, one) for i, one in enumerate(getattr(result.spec, key)) if i in self._places[result.name][key]]

    def case(self, key: Any) -> CaseResult:
        """The case for a key; raises Missing where the experiment does not hold it. Here: by name."""
        for result in self.results:
            if result.name == key:
                return result
        raise Missing(key)

    def _lacking(self, result: CaseResult, filter_name: str, component: str, *base: str) -> Missing:
        """Which name an existing case lacks; if it has all names, that it has no such curve."""
        filters = *result.axes.filters, *(result.outside.axes.filters if result.outside else ())
        components = tuple(name for name, _ in result.axes.components)
        for kind, name, known in (("filter", filter_name, filters), ("component", component, components)):
            if name not in known:
                return NoSuchName(f"no {kind} {name!r}; there are {', '.join(known)}")
        if filter_name in base:
            return NoSuchName(f"filter {filter_name!r} is the baseline: it has no gain")
        return Missing((result.name, filter_name, component, *base))

    def curve(self, key: Any, filter_name: str, component: str) -> Series:
        """σ(k) of a filter of a case."""
        return self._series("curves", key, filter_name, component, ("sigma", "sigma_lo", "sigma_hi", "exact_sigma"))

    def gain(self, key: Any, filter_name: str, component: str) -> Series:
        """Relative gain of a filter of a case against its baseline, the first of several, %."""
        return self._gain(key, filter_name, component, self.case(key).baseline)

    def _gain(self, key: Any, filter_name: str, component: str, base: str) -> Series:
        names = ("gain_percent", "gain_lo", "gain_hi", "exact_percent")
        return self._series("gains", key, filter_name, component, names, base)

    def _series(
        self, table: str, key: Any, filter_name: str, component: str, names: tuple[str, ...], *base: str
    ) -> Series:
        result = self.case(key)
        rows = self._grouped(table).get((result.name, filter_name, component, *base))
        self.looked.add((table, component))
        if rows is None:
            raise self._lacking(result, filter_name, component, *base)
        value, lo, hi, exact = (rows[name].to_numpy(dtype=float) for name in names)
        if self._exact:
            if np.isnan(exact).any():
                raise Missing("not known exactly")
            value = lo = hi = exact
        return Series(rows["k"].to_numpy(), rows["t_s"].to_numpy(), value, lo, hi)

    def ratio(self, key: Any, filter_name: str, over: str, component: str) -> Series:
        """σ of a filter over that of another one of the case: paired where one of the two is a baseline of it, or
        is from outside.

        Otherwise as of independent estimates, with an interval wider than under common noise."""
        case = self.case(key)
        gains = self._grouped("gains")
        if (case.name, filter_name, component, over) in gains:
            of = self._gain(key, filter_name, component, over)
            value, lo, hi = (1 - part / 100 for part in (of.value, of.hi, of.lo))
            return Series(of.k, of.t, value, lo, hi)
        if (case.name, over, component, filter_name) in gains:
            of = self._gain(key, over, component, filter_name)
            value, lo, hi = (1 / (1 - part / 100) for part in (of.value, of.lo, of.hi))
            return Series(of.k, of.t, value, lo, hi)
        own, other = (self.curve(key, name, component) for name in (filter_name, over))
        own, other = own.where(np.isin(own.k, other.k)), other.where(np.isin(other.k, own.k))
        found = ratio(Estimate(own.value, own.lo, own.hi), Estimate(other.value, other.lo, other.hi))
        return Series(own.k, own.t, found.value, found.lo, found.hi)

    def row(self, table: str, **equal: object) -> Mapping[str, Any]:
        """The one row of a table with these values; raises Missing, ConfigError where there is no such table."""
        if not isinstance(self.tables, Hidden) and table not in self.tables:
            raise ConfigError(f"this study has no table {table!r}; there are {', '.join(self.tables)}")
        rows = self.tables[table]
        self.looked.add((table, str(equal.get("component", ""))))
        for name, value in equal.items():
            if name in ("filter", "component") and not (rows[name] == value).any():
                raise NoSuchName(f"no {name} {value!r}; there are {', '.join(dict.fromkeys(rows[name].astype(str)))}")
            rows = rows[rows[name] == value]
        if not len(rows):
            raise Missing(equal)
        first: Any = rows.iloc[0]  # a Series, read as a mapping
        return first


# ---- paper -----------------------------------------------------------------------------------------------------------
CLOSE = 1e-12  # relative: one number in radians and in degrees
Shipped = Callable[[str], "Sequence[CaseResult | Case] | None"]  # config → its cases; None: not shipped


@dataclass(frozen=True)
class Described:
    """A case's keys, as plain data: those of its lists that may grow separate from the rest.

    named: for each key that names a member of such a list, that member. outside: by the name of a filter of the user's
    own code what its numbers depend on."""

    fixed: dict
    members: dict[str, list]
    named: dict[str, object]
    outside: dict[str, str]


def described(one: CaseResult | Case, may_grow: Sequence[str], may_shorten: Sequence[str] = ()) -> Described:
    """The keys of a case for comparison: all but may_shorten."""
    spec = one.spec
    plain = {key: value for key, value in canonical(spec).items() if key not in may_shorten}
    members = {key: plain.pop(key) for key in may_grow}
    named = {}
    for name, info in type(spec).model_fields.items():
        for mark in info.metadata:
            if isinstance(mark, NameIn) and mark.field in members:
                named[name] = members[mark.field][plain.pop(name)]
    return Described(plain, members, named, _outside(one))


def _outside(one: CaseResult | Case) -> dict[str, str]:
    """What filters from outside depend on, by their names."""
    if isinstance(one, Case):
        return {member.name: member.identity for member in one.outside}
    axes: Any = one.outside and one.outside.axes
    return dict(zip(axes.filters, axes.identities, strict=True)) if axes else {}


def own_members(mine: Described, shipped: Iterable[Described], may_grow: Sequence[str]) -> dict[str, set[int]] | None:
    """For a paper's case, the indices of the paper's members of its lists; None for any other case.

    shipped: the cases of the claim's config."""
    found: dict[str, set[int]] | None = None
    for papers in shipped:
        same = equal(mine.fixed, papers.fixed) and equal(mine.named, papers.named)
        if not same or not papers.outside.items() <= mine.outside.items():
            continue
        places = {key: _places(papers.members[key], mine.members[key]) for key in may_grow}
        if all(len(places[key]) == len(papers.members[key]) for key in may_grow):
            found = {key: places[key] | (found or {}).get(key, set()) for key in may_grow}
    return found


def differences(mine: Described, shipped: Iterable[Described], may_grow: Sequence[str]) -> list[str]:
    """The keys in which a case differs from the nearest of these, "key is x, the paper's y"; empty if none."""
    shipped = list(shipped)
    if own_members(mine, shipped, may_grow) is not None:
        return []
    every = [_differing(mine.fixed, papers.fixed) + _lacking(mine, papers, may_grow) for papers in shipped]
    return min(every, key=len, default=["no such experiment is shipped"])


def _lacking(mine: Described, papers: Described, may_grow: Sequence[str]) -> list[str]:
    said = []
    for key in may_grow:
        missing = len(papers.members[key]) - len(_places(papers.members[key], mine.members[key]))
        if missing:
            said.append(f"{missing} of the paper's {len(papers.members[key])} {key} changed or missing")
    if others := [name for name, one in papers.outside.items() if mine.outside.get(name) != one]:
        said.append(f"filter {', '.join(others)} missing, or of other code")
    if not equal(mine.named, papers.named):
        said.append(f"{', '.join(papers.named)} differs from the paper's")
    return said


def _differing(mine: object, papers: object, path: str = "") -> list[str]:
    """The keys of plain data in which two differ, by dotted path."""
    if equal(mine, papers):
        return []
    if isinstance(mine, dict) and isinstance(papers, dict):
        if mine.get("kind") != papers.get("kind"):  # keys of one kind are meaningless for another
            return _differing(mine.get("kind"), papers.get("kind"), f"{path}.kind".strip("."))
        keys = dict.fromkeys((*mine, *papers))
        return [line for key in keys for line in _differing(mine.get(key), papers.get(key), f"{path}.{key}".strip("."))]
    if isinstance(mine, list) and isinstance(papers, list) and len(mine) == len(papers):
        pairs = enumerate(zip(mine, papers, strict=True))
        return [line for i, (own, other) in pairs for line in _differing(own, other, f"{path}.{i}")]
    return [f"{path} is {_short(mine)}, the paper's {_short(papers)}"]


def _short(value: object) -> str:
    if value is None:
        return "none"
    text = f"{value:g}" if isinstance(value, int | float) and not isinstance(value, bool) else str(value)
    return text if len(text) <= LONGEST else text[:LONGEST] + "…"


LONGEST = 40  # characters of a value quoted in a reason


def _places(wanted: Sequence, given: Sequence) -> set[int]:
    """The indices of the wanted members among the given ones, all different."""
    places: set[int] = set()
    for one in wanted:
        place = next((i for i, other in enumerate(given) if i not in places and equal(one, other)), None)
        if place is not None:
            places.add(place)
    return places


def equal(one: object, other: object) -> bool:
    """Whether plain data are equal, numbers to a relative 10⁻¹²."""
    if isinstance(one, dict) and isinstance(other, dict):
        return one.keys() == other.keys() and all(equal(value, other[key]) for key, value in one.items())
    if isinstance(one, list) and isinstance(other, list):
        return len(one) == len(other) and all(map(equal, one, other))
    if isinstance(one, bool) or isinstance(other, bool):
        return one is other
    if isinstance(one, int | float) and isinstance(other, int | float):
        return math.isclose(one, other, rel_tol=CLOSE)
    return one == other


# ---- declared --------------------------------------------------------------------------------------------------------
Measured = Callable[[Any], Estimate]  # takes the evidence of the study, a subclass of Evidence
Number = Callable[[Any], float]


@dataclass(frozen=True)
class Part:
    """One measurement of a claim: its cases (the study's keys), the quantity, its unit, the function, and the range.

    scale gives the quantity that the margin is relative to, such as σ; default: the margin is in the part's own unit.
    exact gives the exact value where `measure` of the exact curves does not; ceiling the score of a perfect estimator.
    statement, number, variant, against_print and asserted are as in `rule.Judged`."""

    cases: tuple
    what: str
    unit: str
    measure: Measured
    expected: Range
    scale: Number | None = None
    exact: Number | None = None
    ceiling: Number | None = None
    statement: str = ""
    number: str = ""
    variant: str = ""
    against_print: bool = False
    asserted: bool = True


@dataclass(frozen=True)
class Claim:
    """A statement of a paper: its place, its interpretation, the parts that judge it, the config that holds them.

    original is the sentence in the paper's language. An extension is ours, and not counted. reported: the paper reports
    an assertion of others: judged under every interpretation, and not counted. unstated: what the paper omits and the
    statement cannot be judged without; joint: one variant has to give every number; internal: both sides are printed,
    so that a disagreement is within the print."""

    id: str
    place: str
    statement: str
    parts: tuple[Part, ...]
    interpretation: str = ""
    config: str = ""
    original: str = ""
    extension: bool = False
    reported: bool = False
    unstated: str = ""
    joint: bool = False
    internal: bool = False
    source: str = field(default="", compare=False)  # where its config is named, for messages

    @property
    def paper(self) -> str:
        """The key of the paper, the part of the id before its first point."""
        return self.id.partition(".")[0]

    @property
    def counted(self) -> bool:
        """Whether it is one of the paper's own claims."""
        return not (self.extension or self.reported)

    @property
    def how(self) -> dict[str, bool]:
        """Its judging options, as arguments of `rule.claim`."""
        return {"unstated": bool(self.unstated), "joint": self.joint, "internal": self.internal}


@dataclass(frozen=True)
class PaperClaims:
    """The claims of a paper that a study judges, and how its results are read for them.

    paper: how tables cite it, authors and year. page: the stem of the study's page in docs/, if any. may_shorten: keys
    that only shorten or extend a run: quantities that do not depend on its end are still judged. may_grow: the study's
    lists to which members may be added while it stays the paper's experiment; every other key must be as in the claim's
    config, see `radarsim.report.claims.declared`. held_too: by the stem of a shipped config, the claims of other
    configs all of whose parts it holds: if it is changed so that it no longer judges them, it says so."""

    claims: Sequence[Claim]
    evidence: type[Evidence]
    paper: str
    page: str = ""
    may_grow: tuple[str, ...] = ()
    may_shorten: tuple[str, ...] = ()
    held_too: Mapping[str, tuple[str, ...]] = field(default_factory=dict)

    def holds(self, claim: Claim, stem: str) -> bool:
        """Whether the shipped config of that stem holds all of a claim."""
        return claim.config == stem or claim.id in self.held_too.get(stem, ())

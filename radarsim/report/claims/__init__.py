"""The papers' claims as data, and verdicts on them from measured values and their intervals.

A claim says what the paper says, where, and how it was read; a part of it says what is measured and the range that the
paper's words leave to it. The ranges come from the words alone and were written down before anything was measured:

* a printed number holds when the measured value rounds to its last digit; "a to b" is that range so widened;
* "about" means within 10 %;
* confirmed: the whole 95 % interval lies inside; refuted: wholly outside; else not distinguishable.

Exact values, where known, never enter a verdict.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from radarsim.engine.results import CaseResult
from radarsim.report import tables as common
from radarsim.report.claims.paper import Described, Shipped, described, own_members
from radarsim.report.statistics import Estimate, difference

if TYPE_CHECKING:
    import pandas as pd

CONFIRMED, REFUTED, UNCLEAR, NOT_RUN = "confirmed", "refuted", "not distinguishable", "not run"


class Missing(KeyError):
    """The experiment does not hold a case that a claim needs; the claim is then not judged by it."""


class Range(NamedTuple):
    """The values that the paper's words leave, ends included, and the words with these ends where they widen them."""

    lo: float
    hi: float
    words: str


def _widened(lo: float, hi: float, words: str) -> Range:
    """A range whose ends the words alone do not tell: both stand in them."""
    return Range(lo, hi, f"{words} ({lo:.6g} … {hi:.6g})")


def printed(text: str) -> Range:
    """A printed number: values that round to its last digit."""
    half = 0.5 * 10.0 ** -(len(text.partition(".")[2]))
    return _widened(float(text) - half, float(text) + half, text)


def between(low: str, high: str) -> Range:
    """A printed range, each end with its rounding."""
    return _widened(printed(low).lo, printed(high).hi, f"{low} to {high}")


def about(low: str, high: str | None = None) -> Range:
    """A positive number or range with "about": 10 % beyond it."""
    return _widened(0.9 * float(low), 1.1 * float(high or low), f"about {low}" + (f" to {high}" if high else ""))


def above(value: float) -> Range:
    """More than a value."""
    return Range(math.nextafter(value, math.inf), math.inf, f"> {value:g}")


def below(value: float) -> Range:
    """Less than a value."""
    return Range(-math.inf, math.nextafter(value, -math.inf), f"< {value:g}")


def at_most(value: float) -> Range:
    """No more than a value."""
    return Range(-math.inf, value, f"≤ {value:g}")


def within(low: float, high: float) -> Range:
    """From low to high as they stand: counts of scans, shares."""
    return Range(low, high, f"{low:g}" if low == high else f"{low:g} to {high:g}")


@dataclass(frozen=True)
class Part:
    """One measurement of a claim: its cases (the study's keys), what is measured, the unit, how, and the range."""

    cases: tuple
    what: str
    unit: str
    measure: Callable[[Any], Estimate]  # of the evidence of the study, a subclass of Evidence
    expected: Range


@dataclass(frozen=True)
class Claim:
    """A statement of a paper: where it stands, how it was read, the parts that judge it, the config that holds them."""

    id: str
    place: str
    statement: str
    parts: tuple[Part, ...]
    reading: str = ""
    config: str = ""

    @property
    def paper(self) -> str:
        """The key of the paper, the part of the id before its first point."""
        return self.id.partition(".")[0]


@dataclass(frozen=True)
class Series:
    """A measured curve: scans k, times t, values and the ends of their intervals, arrays of one length."""

    k: np.ndarray
    t: np.ndarray
    value: np.ndarray
    lo: np.ndarray
    hi: np.ndarray

    def point(self, i: int) -> Estimate:
        """The i-th point."""
        return Estimate(float(self.value[i]), float(self.lo[i]), float(self.hi[i]))

    def where(self, mask: np.ndarray | slice) -> "Series":
        """The points that a mask or indices pick; raises Missing where there is none."""
        if not np.asarray(self.k)[mask].size:
            raise Missing("no such scans")
        return Series(*(np.asarray(part)[mask] for part in (self.k, self.t, self.value, self.lo, self.hi)))

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
        return self.point(-1)

    def largest(self) -> Estimate:
        """The largest value, with the interval of its own scan."""
        return self.point(int(np.nanargmax(self.value)))

    def least(self) -> Estimate:
        """The least value, with the interval of its own scan."""
        return self.point(int(np.nanargmin(self.value)))

    def when_largest(self, of: str = "t") -> Estimate:
        """Time (or scan, of="k") of the largest value; the interval spans all that cannot be told from it."""
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
    return Series(a.k, a.t, *of)


def ratio(a: Estimate, b: Estimate, scale: float = 1.0) -> Estimate:
    """scale · a / b of independent positive estimates: relative half-widths add in squares."""
    value = scale * a.value / b.value
    down = np.hypot(1 - a.lo / a.value, b.hi / b.value - 1)
    up = np.hypot(a.hi / a.value - 1, 1 - b.lo / b.value)
    return Estimate(value, value * (1 - down), value * (1 + up))


def certain(value: float) -> Estimate:
    """A number without noise: algebra, a count."""
    return Estimate(float(value), float(value), float(value))


class Evidence:
    """What an experiment measured, as the claims of its study ask for it. Studies say in `case` what a key means.

    results are the cases that are the paper's, no others; of their lists that may grow, `members` gives the paper's.
    """

    def __init__(self, results: Sequence[CaseResult], made: Mapping, places: Mapping[str, Mapping[str, set[int]]]):
        """places: by the name of a case and the key of a list, which of its members are the paper's."""
        self.results, self.tables, self._places = list(results), made, places

    @cached_property
    def _curves(self) -> Mapping:
        return common.groups(self.tables["curves"], "case", "filter", "component")

    @cached_property
    def _gains(self) -> Mapping:
        return common.groups(self.tables["gains"], "case", "filter", "component")

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
        return self._series(self._curves, key, filter_name, component, ("sigma", "sigma_lo", "sigma_hi"))

    def gain(self, key: Any, filter_name: str, component: str) -> Series:
        """Relative gain of a filter of a case against its baseline, %."""
        return self._series(self._gains, key, filter_name, component, ("gain_percent", "gain_lo", "gain_hi"))

    def _series(self, groups: Mapping, key: Any, filter_name: str, component: str, values: tuple[str, ...]) -> Series:
        rows = groups.get((self.case(key).name, filter_name, component))
        if rows is None:
            raise Missing(key)
        return Series(*(rows[name].to_numpy() for name in ("k", "t_s", *values)))

    def row(self, table: str, **equal: object) -> Mapping[str, Any]:
        """The one row of a table with these values; raises Missing."""
        rows = self.tables[table]
        for name, value in equal.items():
            rows = rows[rows[name] == value]
        if not len(rows):
            raise Missing(equal)
        first: Any = rows.iloc[0]  # a Series, read as a mapping
        return first


@dataclass(frozen=True)
class PaperClaims:
    """The claims of a paper that a study judges, and how its results are read for them.

    paper is how tables cite it: authors and year. page is the stem of the study's page in docs/, where there is one.
    may_grow names the study's lists to which members may be added without its being another experiment than the
    paper's; every other key must be as in the claim's config, see `radarsim.report.claims.paper`.
    """

    claims: Sequence[Claim]
    evidence: type[Evidence]
    paper: str
    page: str = ""
    may_grow: tuple[str, ...] = ()


def verdict(of: Estimate, expected: Range) -> str:
    """Whether an interval lies inside a range, outside, or neither."""
    if not (of.lo <= of.hi):
        return UNCLEAR
    if expected.lo <= of.lo and of.hi <= expected.hi:
        return CONFIRMED
    if of.hi < expected.lo or of.lo > expected.hi:
        return REFUTED
    return UNCLEAR


def overall(verdicts: Sequence[str]) -> str:
    """Of a claim with several parts: refuted with any of them, confirmed with all."""
    if REFUTED in verdicts:
        return REFUTED
    return CONFIRMED if set(verdicts) == {CONFIRMED} else UNCLEAR


CLAIMED = (
    *("claim", "paper", "statement", "case", "measured", "lo", "hi", "expected", "verdict"),
    *("expected_lo", "expected_hi", "what", "unit", "place", "reading", "overall"),
)
NUMBERS = ("measured", "lo", "hi", "expected_lo", "expected_hi")  # of these columns; empty where there is none


def judged(
    of: PaperClaims | None, results: Sequence[CaseResult], made: "Mapping[str, pd.DataFrame]", shipped: Shipped
) -> "pd.DataFrame":
    """claims.csv: a row for each part of each claim that these results can judge, those of whole claims only.

    A claim sees only the cases that are the paper's: those of its config, which `shipped` gives by its stem.
    """
    rows: list[tuple] = []
    if of is not None:
        papers = _Papers(of, results, made, shipped)
        for claim in of.claims:
            if (evidence := papers.evidence(claim.config)) is not None:
                rows += _rows(claim, of.paper, evidence)
    return common.frame({name: [row[i] for row in rows] for i, name in enumerate(CLAIMED)})


class _Papers:
    """What of the results is the paper's, by the config of a claim."""

    def __init__(self, of: PaperClaims, results: Sequence[CaseResult], made: Mapping, shipped: Shipped):
        self._of, self._results, self._made, self._shipped = of, results, made, shipped
        self._seen: dict[str, Evidence | None] = {}

    def evidence(self, config: str) -> Evidence | None:
        """The evidence that claims of a config may see; None where no case is the paper's."""
        if config not in self._seen:
            specs = self._shipped(config)
            self._seen[config] = self._evidence([described(spec, self._of.may_grow) for spec in specs or ()])
        return self._seen[config]

    def _evidence(self, shipped: Sequence[Described]) -> Evidence | None:
        every = {result.name: own_members(result.spec, shipped, self._of.may_grow) for result in self._results}
        places = {name: own for name, own in every.items() if own is not None}
        if not places:
            return None
        made = self._made
        if len(places) < len(every):
            made = {name: _of_cases(table, set(places)) for name, table in made.items()}
        return self._of.evidence([result for result in self._results if result.name in places], made, places)


def _of_cases(table: "pd.DataFrame", names: set[str]) -> "pd.DataFrame":
    """The rows of a table that belong to cases of these names, or to none."""
    return table[table["case"].isin(names)] if "case" in table else table


def _rows(claim: Claim, paper: str, evidence: Evidence) -> list[tuple]:
    try:
        measured = [part.measure(evidence) for part in claim.parts]
        cases = [", ".join(evidence.case(key).name for key in part.cases) for part in claim.parts]
    except Missing:
        return []
    verdicts = [verdict(of, part.expected) for of, part in zip(measured, claim.parts, strict=True)]
    return [
        (
            *(claim.id, paper, claim.statement, case, float(of.value), float(of.lo), float(of.hi)),
            *(part.expected.words, said, _end(part.expected.lo), _end(part.expected.hi)),
            *(part.what, part.unit, claim.place, claim.reading, overall(verdicts)),
        )
        for part, case, of, said in zip(claim.parts, cases, measured, verdicts, strict=True)
    ]


def _end(value: float) -> float:
    """An end of a range as a table holds it: at twelve digits, not-a-number where there is none."""
    return float(f"{value:.12g}") if math.isfinite(value) else math.nan


def listed(papers: Sequence[PaperClaims], stored: Mapping[str, Sequence[Mapping]]) -> list[dict]:
    """Rows of claims with the columns of claims.csv and `config`: as stored, or once as not run.

    stored: config stem → the rows of its claims.csv.
    """
    rows = []
    for paper, claim in ((of.paper, claim) for of in papers for claim in of.claims):
        own = [dict(row) for row in stored.get(claim.config, ()) if row["claim"] == claim.id]
        blank = dict.fromkeys(CLAIMED, "") | {"claim": claim.id, "paper": paper}
        blank |= {"place": claim.place, "reading": claim.reading}
        rows += own or [blank | {"statement": claim.statement, "verdict": NOT_RUN, "overall": NOT_RUN}]
        for row in rows[-max(1, len(own)) :]:
            row["config"] = claim.config
    return rows

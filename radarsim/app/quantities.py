"""Quantities of a case, such as a gain, a σ or a rate of locks: exact where known, otherwise sampled.

Exact values come from the plan of a case, without a realisation. Sampled ones are read from the tables by column names
that all studies share: any study with a table `locks` has the quantity lock.

Roots of a function of one number on a range, or the place nearest to a root. The function may be undefined (NaN) in
places where keys of a config exclude each other. Positive ranges of more than a factor of 20 are searched on a
logarithmic scale."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from radarsim.config.document import did_you_mean
from radarsim.config.experiment import Case
from radarsim.engine.results import Axes, CaseResult
from radarsim.errors import ConfigError, argument
from radarsim.language import term, tr
from radarsim.report.quantities import Quantity
from radarsim.report.statistics import Estimate
from radarsim.studies import registry

if TYPE_CHECKING:
    import pandas as pd


# ---- quantities ------------------------------------------------------------------------------------------------------
UNKNOWN = Estimate(np.nan, np.nan, np.nan)
UNPAIRED = 4  # factor on the realisations where a change moves the scans, so that the noise is not common


class Wanted(NamedTuple):
    """A quantity by names: its own, that of a filter, and the component.

    For a quantity over scans: at time at_s, linear between two scans, or at scan at_k; neither: at the last."""

    name: str
    filter: str | None = None
    component: str | None = None
    at_s: float | None = None
    at_k: int | None = None


@dataclass(frozen=True)
class Asked:
    """A quantity that a case measures; the other fields as in `Wanted`."""

    of: Quantity
    filter: str | None = None
    component: str | None = None
    at_s: float | None = None
    at_k: int | None = None

    @property
    def words(self) -> str:
        """`gain of r+Vr in r at 60 s`."""
        component = f" in {self.of.place(self.component)}" if self.component else ""
        at = f" at {self.at_s:g} s" if self.at_s is not None else ""
        at = f" at k = {self.at_k}" if self.at_k is not None else at
        return f"{self.of.words} of {self.filter}{component}{at}"

    @property
    def said(self) -> str:
        """The same in the current language."""
        told = {"kind": term(self.of.words), "filter": self.filter}
        told["component"] = self.of.place(self.component or "", tr)
        what = tr("{kind} of {filter} in {component}", **told) if self.component else tr("{kind} of {filter}", **told)
        if self.at_k is not None:
            return tr("{what} at k = {k}", what=what, k=str(self.at_k))
        return what if self.at_s is None else tr("{what} at {t_s:g} s", what=what, t_s=self.at_s)


class Series(NamedTuple):
    """A quantity over scans k (n,) at times t_s (n,): value and interval (n,). Without scans n = 1 and k is zero."""

    k: np.ndarray
    t_s: np.ndarray
    values: Estimate


def checked(wanted: Wanted, case: Case, outside: Sequence[str] = ()) -> Asked:
    """The request, checked before anything is prepared. ConfigError for an unknown quantity or filter.

    outside: names of the config's filters of Python, which the case is without."""
    name, chosen, component, at_s, at_k = wanted
    of = registry.quantity(name, case)
    if not of.per:
        if chosen is not None and component is not None:
            raise ConfigError(f"{argument(of.name, of.option)} names the filter itself: leave {argument('filter')} out")
        chosen, component = component if chosen is None else chosen, None
    if chosen is not None:
        names = [member.name for member in case.spec.members]
        if chosen in outside:
            raise ConfigError(f"filter {chosen!r} is written in Python: radarsim does not know its keys, only those of "
                              f"{', '.join(names)}")  # fmt: skip
        named(chosen, names)
    return Asked(of, chosen, component, at_s, at_k)


def named(name: str, names: Sequence[str], what: str = "filter") -> None:
    """ConfigError unless a filter, or another item, has this name."""
    if name not in names:
        near = did_you_mean(name, names) or f"; there are: {', '.join(names)}"
        raise ConfigError(f"no {what} {name!r}{near}")


def resolved(asked: Asked, axes: Axes) -> Asked:
    """The request with its filter filled in if there is only one. ConfigError for unknown names."""
    names, chosen = list(axes.filters), asked.filter
    gain = asked.of.paired and planned(asked.of)
    if chosen is None:
        others = [name for i, name in enumerate(names) if not gain or i != axes.baseline]
        if len(others) != 1:
            raise ConfigError(f"{argument('filter')}: name one of {', '.join(names)}")
        chosen = others[0]
    named(chosen, names)
    if gain and chosen == names[axes.baseline]:
        words = asked.of.words
        raise ConfigError(
            f"filter {chosen!r} is the baseline, against which {words}s are: its {words} is 0 % at any value"
        )
    if asked.component is not None and planned(asked.of):
        named(asked.component, [name for name, _ in axes.components], "component")
    return replace(asked, filter=chosen)


def unit(asked: Asked, axes: Axes) -> str:
    """The unit of a quantity."""
    from radarsim.report import wording

    return wording.unit(asked.of.shown_unit(dict(axes.components).get(str(asked.component), "")))


def shortened(quantity: Asked, case: Case) -> Case:
    """The case shortened to the scans that a quantity needs. Raises ConfigError where the whole case is invalid."""
    return registry.study(case.study).shortened(case, quantity.at_s, quantity.at_k)


def labels(quantity: Asked, case: Case) -> Axes:
    """The labels of a case's plan, with exact errors up to the scans that a quantity needs. Raises ConfigError."""
    return registry.study(case.study).prepare(shortened(quantity, case)).axes


PLANNED = {("curves", "sigma"): "exact_sigma", ("gains", "gain_percent"): "exact_gains"}  # by table and column


def planned(of: Quantity) -> bool:
    """Whether a plan holds its exact values: σ and gain of the common tables."""
    return (of.table, of.value) in PLANNED


def exact(asked: Asked, case: Case, axes: Axes) -> float:
    """The exact value from the labels of a case's plan; NaN where none is known without sampling."""
    if not planned(asked.of) or not registry.study(case.study).exact_errors:
        return np.nan
    f = axes.filters.index(str(asked.filter))
    c = [name for name, _ in axes.components].index(str(asked.component))
    there = axes.available[f, :, c]
    if asked.of.paired:
        if f == axes.baseline:
            return np.nan
        there = there & axes.available[axes.baseline, :, c]
    known = np.asarray(getattr(axes, PLANNED[asked.of.table, asked.of.value]), dtype=float)
    value = np.where(there, known[f, :, c], np.nan)
    k, t_s = np.asarray(axes.k), np.asarray(axes.t_s, dtype=float)
    return float(at(asked, Series(k, t_s, Estimate(value, value, value))).value)


def sampled(asked: Asked, result: CaseResult) -> tuple[Estimate, float]:
    """Value and 95 % interval from a case's tables, and its exact value if the table has one, else NaN."""
    table = table_of(asked.of, result)
    table = table[table["filter"] == asked.filter]
    if not len(table):
        return UNKNOWN, np.nan
    own, known = ({part: one for (_, part), one in courses(asked.of, table, of).items()} for of in (False, True))
    name = asked.component or ""
    named(name, list(own), asked.of.per)
    return at(asked, own[name]), float(at(asked, known[name]).value)


def table_of(of: Quantity, result: CaseResult) -> "pd.DataFrame":
    """The table of a case that holds a quantity. Raises ConfigError where the study has none."""
    made = registry.study(result.study).table(of.table, [result], of.value)
    if made is None:
        raise ConfigError(f"{result.name}: no {of.words}: study {result.study} makes no {of.table}.csv")
    return made


def courses(of: Quantity, table: "pd.DataFrame", exactly: bool = False) -> dict[tuple[str, str], Series]:
    """A quantity, or its exact values, over the scans of its table, by filter and component (empty if it has none)."""
    values, known = of.read(table)
    ends = Estimate(known, known, known) if exactly else values
    size = len(table)
    k = table["k"].to_numpy() if "k" in table else np.zeros(size, dtype=int)
    t_s = table["t_s"].to_numpy(dtype=float) if "t_s" in table else np.zeros(size)
    parts = table[of.per] if of.per else np.full(size, "", dtype=object)
    groups: Any = table.groupby([table["filter"], parts], sort=False).indices.items()
    return {
        (name, str(part)): Series(k[rows], t_s[rows], Estimate(*(of.scale * end[rows] for end in ends)))
        for (name, part), rows in groups
    }


def noted(quantity: Asked, result: CaseResult) -> str:
    """The note that tables would put on the interval without an exact value: why it is too narrow, or nothing."""
    from radarsim.report import notes

    study, name = registry.study(result.study), quantity.of.table
    tables = {"curves": study.curves([result]), name: table_of(quantity.of, result)}
    declared = registry.quantities(result.study, result.spec)
    table = notes.add_notes(tables, [result], exact=False, quantities=declared)[name]
    if "note" not in table:
        return ""
    rows = table[table["filter"] == quantity.filter]
    if quantity.component is not None:
        rows = rows[rows[quantity.of.per].astype(str) == quantity.component]
    if quantity.at_k is not None:
        rows = rows[rows["k"] == quantity.at_k]
    elif quantity.at_s is not None and "t_s" in rows:
        t_s = rows["t_s"].to_numpy(dtype=float)
        rows = rows[(t_s <= quantity.at_s) | (np.arange(len(t_s)) <= np.searchsorted(t_s, quantity.at_s))]
    return str(rows["note"].iloc[-1]) if len(rows) else ""


def scan(quantity: Asked, axes: Axes) -> int:
    """The scan at which a quantity at a time is read, or the later of two; 0 where the scan number is given."""
    k, t_s = np.asarray(axes.k), np.asarray(axes.t_s, dtype=float)
    if quantity.at_k is not None or not len(k):
        return 0
    last = len(k) - 1
    return int(k[last if quantity.at_s is None else min(int(np.searchsorted(t_s, quantity.at_s * (1 - 1e-12))), last)])


def at(quantity: Asked, series: Series) -> Estimate:
    """The series at the requested time or scan: NaN where there is no estimate. Raises ConfigError for a time or scan
    beyond the run."""
    k, t_s, values = series
    if not len(k):
        return UNKNOWN
    if not k.any() and (quantity.at_s, quantity.at_k) != (None, None):
        where = argument("at_s", "--at") if quantity.at_k is None else argument("at_k", "--at-k")
        raise ConfigError(f"{where}: the {quantity.of.words} has one value, not one a scan: leave it out")
    if quantity.at_k is not None:
        if quantity.at_k > k[-1] or quantity.at_k < 1:
            where = argument("at_k", "--at-k")
            raise ConfigError(f"{where}: must be from 1 to {k[-1]}, the last scan, got {quantity.at_k}")
        found = np.flatnonzero(k == quantity.at_k)
        return Estimate(*(float(part[found[0]]) for part in values)) if len(found) else UNKNOWN
    if quantity.at_s is None:
        return Estimate(*(float(part[-1]) for part in values))
    if not 0 <= quantity.at_s <= t_s[-1] * (1 + 1e-12):
        where = argument("at_s", "--at")
        raise ConfigError(f"{where}: must be from 0 to {t_s[-1]:g} s, the last scan's time, got {quantity.at_s:g}")
    if quantity.at_s < t_s[0] - 1e-9 * t_s[-1]:
        return UNKNOWN
    exactly = np.flatnonzero(np.isclose(t_s, quantity.at_s, rtol=1e-12, atol=0))
    if len(exactly):
        return Estimate(*(float(part[exactly[0]]) for part in values))
    return Estimate(*(float(np.interp(quantity.at_s, t_s, part)) for part in values))


# ---- search ----------------------------------------------------------------------------------------------------------
WIDE = 20  # ratio of high to low from which a range is searched logarithmically
PER_DECADE, LEAST_POINTS, MOST_POINTS = 5, 25, 61
EXACTLY = 1e-13  # relative width to which brackets are closed: far below the documented 1e-9
BILLIONTH = 1e-9
POLISHED, MOST_POLISHED = 1e-10, 8  # relative step at which secants end; how many
FIRST_STEP = 1e-4  # of the range: distance of the second start in a search near a known root
GOLDEN = (math.sqrt(5) - 1) / 2

Function = Callable[[float], float]


@dataclass(frozen=True)
class Range:
    """A range to search: low to high, logarithmic or not, of whole numbers or not."""

    low: float
    high: float
    logarithmic: bool
    whole: bool = False

    def inner(self, x: float) -> float:
        """A value on the scale of the search."""
        return math.log(x) if self.logarithmic else x

    def outer(self, u: float) -> float:
        """The value at a place of the scale, within the range; rounded where only whole numbers are allowed."""
        x = math.exp(u) if self.logarithmic else u
        return min(max(float(round(x)) if self.whole else x, self.low), self.high)

    def grid(self, points: int | None = None) -> list[float]:
        """Places from end to end, even on the scale; whole numbers, all of them where they are few."""
        if self.whole and self.high - self.low < MOST_POINTS:
            return [float(n) for n in range(math.ceil(self.low), math.floor(self.high) + 1)]
        if points is None:
            decades = (self.inner(self.high) - self.inner(self.low)) / math.log(10) if self.logarithmic else 0
            points = min(max(LEAST_POINTS, math.ceil(PER_DECADE * decades) + 1), MOST_POINTS)
        first, step = self.inner(self.low), (self.inner(self.high) - self.inner(self.low)) / (points - 1)
        found = [self.outer(first + i * step) for i in range(points)]
        found[0], found[-1] = self.low, self.high
        return sorted(set(found)) if self.whole else found


def searched(low: float, high: float, whole: bool = False) -> Range:
    """The range from low to high, on a suitable scale."""
    return Range(low, high, low > 0 and high / low > WIDE, whole)


@dataclass(frozen=True)
class Found:
    """The roots on a range, ascending; without any, the place where the function is nearest to zero and its value."""

    roots: tuple[float, ...]
    nearest: float
    at_nearest: float


class Undefined(ValueError):
    """A function without a value anywhere on a range."""


def roots_of(function: Function, over: Range, width: float = EXACTLY) -> Found:
    """All roots that a scan of the range shows: changes of sign, and touching ones where it turns near zero. A jump
    over zero counts as a root, unless the function is undefined between. Brackets are closed to the relative width
    `width`, by default to rounding. Raises Undefined where the function has no value anywhere on the scan."""
    places = [(x, function(x)) for x in over.grid()]
    places = _with_edges(function, over, places)
    places = _with_turns(function, over, places)
    known = [(x, y) for x, y in places if not math.isnan(y)]
    if not known:
        raise Undefined("not defined on the range")
    found = [x for x, y in known if y == 0]
    for (a, ya), (b, yb) in pairwise(places):
        if ya * yb < 0:
            found.append(closed(function, over, (a, ya), (b, yb), width=width))
    found = [x for x in found if not math.isnan(function(x))]
    nearest, at_nearest = min(known, key=lambda one: abs(one[1]))
    return Found(tuple(sorted(found)), nearest, at_nearest)


def polished(function: Function, over: Range, root: float, rising: float, near_enough: float) -> float | None:
    """The root of a smooth function near that of an approximation, by secants on the scale of the search.

    rising is the first slope. To ten digits, or to rounding; for a function that jumps where |function| <= near_enough.
    None where a step does not bring it nearer."""
    u, y = over.inner(root), function(root)
    for _ in range(MOST_POLISHED):
        size = 1.0 if over.logarithmic else abs(u)
        if y == 0 or (rising and abs(y / rising) <= POLISHED * size):
            return over.outer(u)
        v = over.inner(over.outer(u - y / rising)) if rising else u
        z = function(over.outer(v)) if v != u else math.nan
        if not abs(z) <= abs(y) / 2:
            break
        u, y, rising = v, z, (z - y) / (v - u)
    return over.outer(u) if abs(y) <= near_enough else None


def near(function: Function, over: Range, root: float, near_enough: float) -> float | None:
    """The root of a function near that of an approximation: to 1e-9, or where |function| <= near_enough. None where the
    function keeps its sign within a tenth of the range."""
    u, reach = over.inner(root), over.inner(over.high) - over.inner(over.low)

    def place(u: float) -> tuple[float, float]:
        x = over.outer(u)
        return x, function(x)

    one = place(u)
    if abs(one[1]) <= near_enough:
        return root
    step, other = FIRST_STEP * reach, place(u + FIRST_STEP * reach)
    side, before = (1, other) if abs(other[1]) < abs(one[1]) else (-1, one)
    if one[1] * other[1] > 0:
        while before[1] * (other := place(u + side * step))[1] > 0 and step < reach / 10:
            before, step = other, 2 * step
        one = before
    if not one[1] * other[1] <= 0:
        return None
    return closed(function, over, one, other, lambda x, y: abs(y) <= near_enough, BILLIONTH)


def closed(
    function: Function,
    over: Range,
    one: tuple[float, float],
    other: tuple[float, float],
    near_enough: Callable[[float, float], bool] = lambda x, y: False,
    width: float = EXACTLY,
) -> float:
    """The root between two places (x, y) of opposite signs (Chandrupatla, Adv. Eng. Software 28, 1997, 145-149).

    Ends where near_enough(x, y), at a root, or where the bracket is closed to the relative width `width`, by default to
    rounding; where the function jumps over zero, at the jump. For whole numbers: the one beside the change of sign with
    the smaller value."""
    (a, fa), (b, fb) = (over.inner(one[0]), one[1]), (over.inner(other[0]), other[1])
    c, fc, t = a, fa, 0.5
    for _ in range(200):
        x = over.outer(a + t * (b - a))
        u = over.inner(x)
        between = abs(over.outer(b) - over.outer(a))
        if x in (over.outer(a), over.outer(b)) or between <= width * abs(x) or (over.whole and between <= 1):
            break
        f = function(x)
        if f == 0 or near_enough(x, f) or math.isnan(f):
            return x
        if (f > 0) == (fa > 0):
            c, fc = a, fa
        else:
            c, b, fc, fb = b, a, fb, fa
        a, fa = u, f
        t = _next(a, b, c, fa, fb, fc)
    u, _ = min(((a, fa), (b, fb)), key=lambda end: abs(end[1]))
    return over.outer(u)


def _next(a: float, b: float, c: float, fa: float, fb: float, fc: float) -> float:
    """The next place between a and b, as a share: inverse quadratic interpolation where it is safe, else half."""
    if c in (a, b) or fc in (fa, fb):
        return 0.5
    xi, phi = (a - b) / (c - b), (fa - fb) / (fc - fb)
    if not (phi**2 < xi and (1 - phi) ** 2 < 1 - xi):
        return 0.5
    share = fa / (fb - fa) * fc / (fb - fc) + (c - a) / (b - a) * fa / (fc - fa) * fb / (fc - fb)
    margin = 2e-15 * max(abs(a), 1e-300) / abs(b - a)
    return min(max(share, margin), 1 - margin)


def _with_edges(function: Function, over: Range, places: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """The places plus those where the function starts or stops being defined, to a thousandth of a step."""
    made = list(places)
    if over.whole:
        return made
    for one, other in pairwise(places):
        if math.isnan(one[1]) == math.isnan(other[1]):
            continue
        bad, good = (one, other) if math.isnan(one[1]) else (other, one)
        for _ in range(10):
            x = over.outer((over.inner(bad[0]) + over.inner(good[0])) / 2)
            tried = (x, function(x))
            bad, good = (tried, good) if math.isnan(tried[1]) else (bad, tried)
        made.append(good)
    return sorted(made)


def _with_turns(function: Function, over: Range, places: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """The places plus the extremes, by golden sections, where the function turns back before it reaches zero. Only
    where zero may be reached: beyond a turn, the parabola through the three places comes at most that much nearer; and,
    without any zero, the turn that comes nearest."""
    made = list(places)
    if over.whole:
        return made
    crossed = any(one[1] * other[1] <= 0 for one, other in pairwise(places))
    for (a, ya), (b, yb), (c, yc) in zip(places, places[1:], places[2:], strict=False):
        if math.isnan(ya + yb + yc) or not (ya * yb > 0 and yb * yc > 0 and abs(ya) > abs(yb) <= abs(yc)):
            continue
        if abs(yb) > 2 * max(abs(ya - yb), abs(yc - yb)) + 1e-12 and (crossed or not _least(places, b)):
            continue
        made.append(_turn(function, over, a, c, math.copysign(1.0, yb)))
    return sorted(made)


def _least(places: Sequence[tuple[float, float]], x: float) -> bool:
    """Whether the function is nearest to zero here: the limit, if zero is never reached."""
    return x == min((abs(y), x) for x, y in places if not math.isnan(y))[1]


def _turn(function: Function, over: Range, low: float, high: float, sign: float) -> tuple[float, float]:
    """The minimum of sign · function between two places; ends early where it crosses zero."""
    a, b = over.inner(low), over.inner(high)
    u, v = b - GOLDEN * (b - a), a + GOLDEN * (b - a)
    fu, fv = sign * function(over.outer(u)), sign * function(over.outer(v))
    for _ in range(40):
        if min(fu, fv) <= 0 or b - a < 1e-8 * max(abs(a), abs(b), 1.0):
            break
        if fu < fv:
            b, v, fv = v, u, fu
            u = b - GOLDEN * (b - a)
            fu = sign * function(over.outer(u))
        else:
            a, u, fu = u, v, fv
            v = a + GOLDEN * (b - a)
            fv = sign * function(over.outer(v))
    place, least = (u, fu) if fu < fv else (v, fv)
    return over.outer(place), sign * least

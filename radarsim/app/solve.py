"""`radarsim solve`: the value of a numeric key at which a quantity reaches a target.

Where the quantity is known exactly the root is that of the exact function. Else every value is simulated with the same
noise, and the interval is the set of values at which the quantity's own 95 % interval holds the target: it covers the
true value as often as that interval covers.
"""

import math
import os
import shlex
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import pairwise
from typing import Any

from radarsim.app import quantities, search
from radarsim.app.configs import load
from radarsim.app.quantities import UNKNOWN, Quantity
from radarsim.app.simulation import result_of
from radarsim.app.work import CaseWork
from radarsim.config import numeric
from radarsim.config.experiment import Case
from radarsim.config.lookup import did_you_mean
from radarsim.engine.collect import collect
from radarsim.engine.results import Axes, CaseResult
from radarsim.errors import ConfigError
from radarsim.language import term, tr
from radarsim.report.statistics import Estimate
from radarsim.studies import registry

FACTOR = 1000.0  # the search goes from a thousandth of a positive key's value to a thousand times it
NEAR = 1e-4  # of a value: the step of a derivative
WHOLE = term("of whole numbers the one beside the target that does at least as well")
MOST_NAMED = 6  # cases that a message lists
JUMP = 1e-4  # of a quantity: more than means over patterns of plots may jump where others are merged
JUMPS = term("the quantity jumps over the target there")
TINY = 1e-300  # in place of nothing
SAME = 1e-12  # of a quantity: what rounding may make of no change
TO_CLOSE = 12  # values, beside those of the scan, that bring a root from its bracket to rounding, and its slope
ROUGH = -1  # in place of a number of realisations
NEAR_ENOUGH = 1e-10  # of the quantity: how near to its target it ends where it jumps about at a ten-thousandth anyway
ROUGHLY = 1e-4  # part of a root, to which a rough one is closed
DOUBT = 0.01  # of the quantity: how near to the target the rough one may come without a root before it is not trusted
LONG_S = 2.0  # of an answer, from which it is predicted what it takes

Config = str | os.PathLike[str] | Mapping[str, Any]


@dataclass(frozen=True)
class Answer:
    """What was found.

    value is None where the target is not attained; then limit is the nearest that was, at limit_at. lo and hi bound the
    value at 95 %, and equal it where exact. slope is the quantity's change for one unit of the key; others are further
    values that attain the target. low and high are what was searched, command the run that confirms.
    """

    key: str
    unit: str
    quantity: Quantity
    quantity_unit: str
    equals: float
    now: float | None
    attained_now: float
    value: float | None
    lo: float | None
    hi: float | None
    exact: bool
    attained: float | None
    slope: float | None
    others: tuple[float, ...]
    limit: float | None
    limit_at: float | None
    low: float
    high: float
    command: str
    notes: tuple[str, ...] = ()


@dataclass
class Cases:
    """The cases that a config stands for with other values at a key; `base` as it is.

    The others share the base's noise, whatever their world.
    """

    config: Config
    overrides: tuple[str, ...]
    name: str | None = None
    base: Case = field(init=False)

    def __post_init__(self) -> None:
        self.base = self._chosen(self.overrides)

    def _chosen(self, overrides: Iterable[str]) -> Case:
        experiment = load(self.config, overrides)
        named = {case.name: case for case in experiment.cases}
        if self.name is None and len(named) == 1:
            return experiment.cases[0]
        if self.name is None:
            some = ", ".join(repr(one) for one in list(named)[:MOST_NAMED]) + (", …" if len(named) > MOST_NAMED else "")
            raise ConfigError(f"{experiment.stem} has {len(named)} cases: choose one with --case: {some}")
        if self.name not in named:
            near = did_you_mean(self.name, named) or f"; there are: {', '.join(named)}"
            raise ConfigError(f"no case {self.name!r} in {experiment.stem}{near}")
        return named[self.name]

    def at(self, key: str, value: float) -> Case:
        """The case with another value at a key. Raises ConfigError where the config refuses it."""
        return replace(self._chosen((*self.overrides, self._setting(key, value))), noise_of=self.base.spec)

    def _setting(self, key: str, value: float) -> str:
        """A key's setting; of an item of a list the whole list, which the config may give in degrees or not at all."""
        holder, _, place = key.rpartition(".")
        items = {one.path: one.value for one in numeric.keys(self.base.spec) if one.path.rpartition(".")[0] == holder}
        listed = [f"{holder}.{i}" for i in range(len(items))]
        if not place.isdecimal() or list(items) != listed or None in items.values():
            return f"{key}={_yaml(value)}"
        values = (value if path == key else own for path, own in items.items())
        return f"{holder}=[{', '.join(_yaml(one) for one in values if one is not None)}]"


def _yaml(value: float) -> str:
    """A number as a config holds it: whole ones without a point."""
    return repr(int(value)) if float(value).is_integer() and abs(value) < 1e15 else repr(float(value))


def solve(
    config: Config,
    key: str,
    quantity: Quantity,
    equals: float,
    *,
    overrides: Sequence[str] = (),
    between: tuple[float, float] | None = None,
    case: str | None = None,
    realisations: int | None = None,
    threads: int | None = None,
    sampled: bool = False,
    progress: Callable[[int, int, int], None] | None = None,
    told: Callable[[str], None] | None = None,
) -> Answer:
    """The value of a key at which a quantity equals `equals`, in the quantity's unit (gains and rates in per cent).

    between: what is searched; by default what the key allows, and of one that has no two bounds a thousandth to a
    thousand times its value. realisations: behind each sampled value, by default the config's. sampled: simulate also
    what is known exactly. told is called with a line, before the search, that says what it will do, if that takes some
    seconds.

    Raises ConfigError for a wrong config, key, filter or component, and for a key without effect.
    """
    if not math.isfinite(equals):
        raise ConfigError(f"--equals: must be a finite number, got {equals:g}")
    cases = Cases(config, tuple(overrides), case)
    found = numeric.find(cases.base.spec, key)
    quantities.checked(quantity, cases.base)
    axes = quantities.labels(quantity, cases.base)
    quantity = quantities.resolved(quantity, axes)
    over = range_of(found, key, between)
    curve = Curve(cases, key, quantity, threads, progress, realisations or cases.base.realisations)
    now = found[0].value if len({one.value for one in found}) == 1 else None
    question = Question(
        cases, key, quantity, equals, over, now, quantities.unit(quantity, axes), tuple(overrides), realisations
    )
    work = _exactly if not sampled and curve.exact(axes) else _by_sampling
    return work(question, curve, told or (lambda line: None))


@dataclass(frozen=True)
class Question:
    """What is asked, with its config read: of which cases, which key, what it shall do, over which range."""

    cases: Cases
    key: str
    quantity: Quantity
    equals: float
    over: search.Range
    now: float | None
    unit: str
    overrides: tuple[str, ...]
    realisations: int | None = None

    def command(self, value: float) -> str:
        """The run that shows what a value attains, of noise of its own, with as many realisations as were asked for."""
        name = self.cases.config if isinstance(self.cases.config, str | os.PathLike) else "CONFIG.yaml"
        settings = [*self.overrides, f"{self.key}={number(value)}"]
        count = [] if self.realisations is None else ["-n", str(self.realisations)]
        parts = [part for one in settings for part in ("--set", one)]
        return shlex.join(["radarsim", "run", os.fspath(name), *parts, *count])


def number(value: float) -> str:
    """A number as YAML reads it back, to twelve digits."""
    return repr(rounded(value)).removesuffix(".0")


def rounded(value: float) -> float:
    """A number without what lies beyond its twelfth digit."""
    return float(f"{value:.12g}")


def range_of(found: Sequence[numeric.NumericKey], name: str, between: tuple[float, float] | None) -> search.Range:
    """What is searched of a key. Raises ConfigError where it has neither bounds nor a value to begin from."""
    key, values = found[0], [one.value for one in found if one.value]
    if between is not None:
        low, high = between
        if not (math.isfinite(low) and math.isfinite(high) and low < high):
            raise ConfigError(f"--between: must be two rising numbers, got {low:g} {high:g}")
        if key.whole:
            low, high = float(math.ceil(low)), float(math.floor(high))
            if low > high:
                ends = " ".join(f"{end:g}" for end in between)
                raise ConfigError(f"--between: {name} takes whole numbers, and there is none from {ends}")
        return search.searched(low, high, key.whole)
    if math.isfinite(key.low) and math.isfinite(key.high) and not key.whole:
        return search.searched(key.low, key.high)
    if not values:
        what = "not given" if key.value is None else f"{key.value:g}"
        raise ConfigError(f"{name}: is {what} in the config, and its own range has no end: give --between LO HI")
    if key.low >= 0:
        low, high = max(rounded(min(values) / FACTOR), key.low), min(rounded(max(values) * FACTOR), key.high)
        return search.searched(math.ceil(low) if key.whole else low, math.floor(high) if key.whole else high, key.whole)
    size = 10 * max(map(abs, values))
    return search.searched(max(-size, key.low), min(size, key.high), key.whole)


class Curve:
    """The quantity as a function of the key, each value computed once.

    progress is told of each; `simulated` counts those that were simulated.
    """

    def __init__(
        self,
        cases: Cases,
        key: str,
        quantity: Quantity,
        threads: int | None,
        progress: Callable[[int, int, int], None] | None,
        realisations: int,
    ):
        self.cases, self.key, self.quantity = cases, key, quantity
        self.threads, self.progress, self.realisations = threads, progress, realisations
        self.known: dict[tuple[float, int], Estimate] = {}
        self.refused: dict[float, ConfigError] = {}
        self.from_tables = False
        self.rough = False  # whether there are values for less work, for a search to look about
        self.expected = 1

    def exact(self, axes: Axes) -> bool:
        """Whether the quantity is known exactly: from the plan, or from one realisation's tables."""
        case = self.cases.base
        if not math.isnan(quantities.exact(self.quantity, case, axes)):
            return True
        if self.quantity.kind in ("gain", "sigma"):
            return False
        _, known = self._sampled(case, 1)
        self.from_tables = not math.isnan(known)
        return self.from_tables

    def exactly(self, value: float | None) -> float:
        """The exact quantity at a value (None: as the config has it); not-a-number where there is none."""
        return self._kept(value, 0, self._exact_of).value

    def roughly(self, value: float) -> float:
        """The same for less work, to a thousandth of σ, where the study has it so; else the exact quantity."""
        if not self.rough:
            return self.exactly(value)
        return self._kept(value, ROUGH, lambda case: self._exact_of(replace(case, roughly=True))).value

    def simulated(self, value: float | None, realisations: int) -> Estimate:
        """The quantity with its interval, from so many realisations."""
        return self._kept(value, realisations, lambda case: self._sampled(case, realisations)[0])

    def noted(self, value: float) -> tuple[str, ...]:
        """What the tables note of the interval at a value, in words."""
        note = quantities.noted(self.quantity, self._result(self.cases.at(self.key, value), self.realisations))
        return (f"the interval is too narrow: {note}; more realisations, -n, mend that",) if note else ()

    def _kept(self, value: float | None, count: int, of: Callable[[Case], Estimate]) -> Estimate:
        place = (math.nan if value is None else value, count)
        if place in self.known:
            return self.known[place]
        if value is None:
            return of(self.cases.base)
        try:
            found = of(self.cases.at(self.key, value))
        except ConfigError as error:
            self.refused[value] = error
            found = UNKNOWN
        self.known[place] = found
        if self.progress is not None:
            self.expected = max(self.expected, len(self.known))
            self.progress(len(self.known), self.expected, 0)
        return found

    def _exact_of(self, case: Case) -> Estimate:
        if self.from_tables:
            value = self._sampled(case, 1)[1]
        else:
            value = quantities.exact(self.quantity, case, quantities.labels(self.quantity, case))
        return Estimate(value, value, value)

    def _sampled(self, case: Case, realisations: int) -> tuple[Estimate, float]:
        return quantities.sampled(self.quantity, self._result(case, realisations))

    def _result(self, case: Case, realisations: int) -> CaseResult:
        work = CaseWork(case)
        return result_of(case, work, collect(work, realisations, threads=self.threads))


def _exactly(asked: Question, curve: Curve, told: Callable[[str], None]) -> Answer:
    """The answer where the quantity is exact."""
    attained_now = curve.exactly(None)
    grid = asked.over.grid()
    curve.expected = len(grid) + TO_CLOSE
    begun = time.monotonic()
    curve.exactly(grid[len(grid) // 3])  # not the config's own, which a study may still know
    near = registry.study(asked.cases.base.study).exact_but_for(quantities.shortened(asked.quantity, asked.cases.base))
    what = tr("computes the {quantity} at about {count} values of {key}", **_of(asked), count=curve.expected)
    predict(
        told, what + (tr(", each {near}", near=tr(near)) if near else ""), curve.expected * (time.monotonic() - begun)
    )

    curve.rough = bool(near) and not asked.over.whole
    try:
        found = roots(asked, curve)
    except ValueError:
        raise nowhere(asked, curve) from None
    counted = ROUGH if curve.rough else 0  # both kinds differ a little where the key has no effect
    refuse_without_effect(asked, [one.value for (_, count), one in curve.known.items() if count == counted])
    values = found.roots
    if asked.over.whole:
        values = tuple(dict.fromkeys(fulfilling(asked, x, curve.exactly) for x in values))
    answer = partial(_answer, asked, attained_now, exact=True)
    if not values:
        limit = found.at_nearest + asked.equals
        return answer(limit=limit, limit_at=found.nearest, notes=boundary(asked, curve, found.nearest))
    value = nearest(values, asked)
    attained = curve.exactly(value)
    jumps = not asked.over.whole and abs(attained - asked.equals) > JUMP * max(abs(asked.equals), abs(attained_now))
    return answer(
        **{"value": value, "lo": value, "hi": value, "attained": attained},
        slope=None if jumps else slope(curve.exactly, value, asked.over),
        others=tuple(x for x in values if x != value),
        notes=((JUMPS,) if jumps else ())
        + ((WHOLE,) if asked.over.whole and attained != asked.equals else ())
        + ((tr("σ is {what}", what=tr(near)),) if near else ()),
    )


def roots(asked: Question, curve: Curve) -> search.Found:
    """Where the exact quantity reaches the target; first looked for roughly where that is much less work.

    Raises ValueError where it is defined nowhere.
    """

    def missing(x: float) -> float:
        return curve.exactly(x) - asked.equals

    if not curve.rough:
        return search.roots(missing, asked.over)
    size = max(abs(asked.equals), TINY)
    found = search.roots(lambda x: curve.roughly(x) - asked.equals, asked.over, ROUGHLY)
    near = [search.near(missing, asked.over, x, NEAR_ENOUGH * size) for x in found.roots]
    exactly = [x for x in near if x is not None]
    if len(exactly) < len(near) or (not near and abs(found.at_nearest) < DOUBT * size):
        return search.roots(missing, asked.over)
    return search.Found(tuple(exactly), found.nearest, missing(found.nearest))


def predict(told: Callable[[str], None], what: str, seconds: float) -> None:
    """Say what a search will do and about how long it takes, where that is long."""
    if seconds > LONG_S:
        told(tr("{what}: about {seconds:.0f} s", what=what, seconds=seconds))


def _of(asked: Question) -> dict[str, str]:
    """What is asked, for a sentence."""
    return {"quantity": asked.quantity.said, "key": asked.key}


def _answer(asked: Question, attained_now: float, **given: Any) -> Answer:
    """An answer of what was asked; what is not given is none."""
    whole: dict[str, Any] = {
        **dict.fromkeys(("value", "lo", "hi", "attained", "slope", "limit", "limit_at")),
        "others": (),
        "notes": (),
        **given,
    }
    shown = whole["limit_at"] if whole["value"] is None else whole["value"]
    return Answer(
        key=asked.key,
        unit=numeric.unit(asked.key),
        quantity=asked.quantity,
        quantity_unit=asked.unit,
        equals=asked.equals,
        now=asked.now,
        attained_now=attained_now,
        low=asked.over.low,
        high=asked.over.high,
        command=asked.command(shown),
        **whole,
    )


def nowhere(asked: Question, curve: Curve) -> ConfigError:
    """Why the quantity has no value anywhere on the range: the config's own reason where it gives one."""
    reasons = [error for _, error in sorted(curve.refused.items())]
    if reasons:
        return ConfigError(*dict.fromkeys(line for error in reasons[:1] for line in error.lines))
    return ConfigError(f"{asked.quantity.words}: there is no estimate there, whatever {asked.key} is")


def refuse_without_effect(asked: Question, values: Iterable[float]) -> None:
    """ConfigError where the quantity is the same at every value that was tried."""
    known = [value for value in values if not math.isnan(value)]
    if known and max(known) - min(known) <= SAME * max(abs(max(known)), abs(min(known)), 1e-300):
        everywhere = f"{known[0]:.6g} {asked.unit} at every value from {asked.over.low:g} to {asked.over.high:g}"
        raise ConfigError(f"{asked.key}: has no effect on the {asked.quantity.words}: {everywhere}")


def fulfilling(asked: Question, x: float, of: Callable[[float], float]) -> float:
    """Of the whole numbers about a change of sign the first that does at least as well as is asked."""
    better = 1 if asked.quantity.of.more_is_better else -1
    near = [n for n in (x, x - 1, x + 1) if asked.over.low <= n <= asked.over.high]
    good = [n for n in near if better * (of(n) - asked.equals) >= 0]
    return good[0] if good else x


def nearest(values: Sequence[float], asked: Question) -> float:
    """The value nearest to the config's own, on the scale of the search; the first where the config has none."""
    if asked.now is None or (asked.over.logarithmic and asked.now <= 0):
        return values[0]
    own = asked.over.inner(asked.now)
    return min(values, key=lambda x: abs(asked.over.inner(x) - own))


def slope(of: Callable[[float], float], value: float, over: search.Range) -> float | None:
    """The change of a function for one unit of the key, by a central difference within the range; one-sided at an end.

    Error of the order of 1e-8 of itself; of whole numbers the change to the next.
    """
    step = NEAR * (abs(value) or 1.0)
    low, high = max(value - step, over.low), min(value + step, over.high)
    if over.whole:
        low, high = value, min(value + 1, over.high)
    if math.isnan(of(low)):
        low = value
    if math.isnan(of(high)):
        high = value
    if low == high or math.isnan(of(low)) or math.isnan(of(high)):
        return None
    return (of(high) - of(low)) / (high - low)


def boundary(asked: Question, curve: Curve, x: float) -> tuple[str, ...]:
    """Whether the nearest value lies at an end of what was searched, or of what the config allows, in words."""
    if x in (asked.over.low, asked.over.high):
        return (term("the end of what was searched; --between LO HI searches elsewhere"),)
    beyond = [other for other in curve.refused if abs(other - x) <= 0.05 * abs(x)]
    return (term("the end of what the config allows"),) if beyond else ()


# ---- by sampling ----------------------------------------------------------------------------------------------------
PILOT_SHARE, PILOT_LEAST = 16, 200  # realisations of the scan: a share of all, but not fewer
PILOT_POINTS = 13
WITH_ALL = 13  # values with all realisations: a bracket, the value, both ends of its interval
MOST_STEPS = 3  # of the scan, by which the pilot's noise may have moved a crossing
RESIDUE = 0.02  # of its interval: how near a sampled quantity is brought to the target, so that the noise decides


def _by_sampling(asked: Question, curve: Curve, told: Callable[[str], None]) -> Answer:
    """The answer where the quantity is simulated, with the same noise at every value."""
    over, count = asked.over, curve.realisations
    grid, pilot = over.grid(PILOT_POINTS), min(count, max(PILOT_LEAST, count // PILOT_SHARE))
    curve.expected = len(grid) + WITH_ALL
    curve.simulated(None, 1)  # compiles
    begun = time.monotonic()
    attained_now = curve.simulated(None, count).value
    counts = {"grid": len(grid), "pilot": pilot, "more": WITH_ALL, "count": count}
    what = tr(
        "simulates {grid} values of {key} with {pilot} realisations, then about {more} with {count}",
        **_of(asked),
        **counts,
    )
    predict(told, what, (WITH_ALL + len(grid) * pilot / count) * (time.monotonic() - begun))
    scanned = [(x, curve.simulated(x, pilot).value - asked.equals) for x in grid]
    known = [one for one in scanned if not math.isnan(one[1])]
    if not known:
        raise nowhere(asked, curve)
    refuse_without_effect(asked, [y for _, y in known])
    answer = partial(_answer, asked, attained_now, exact=False)
    best, _ = min(known, key=lambda one: abs(one[1]))
    places = _changes(scanned) or [grid.index(best)]
    brackets = [pair for pair in map(partial(_bracket, asked, curve, grid), places) if pair is not None]
    if not brackets:  # the pilot may have been far off, as where its errors have heavy tails
        whole = [(x, curve.simulated(x, count).value - asked.equals) for x in grid]
        brackets = [(whole[i], whole[i + 1]) for i in _changes(whole)]
        best = min((one for one in whole if not math.isnan(one[1])), key=lambda one: abs(one[1]), default=(best, 0.0))[
            0
        ]
    found = [_interval(asked, curve, *pair) for pair in dict.fromkeys(brackets)]
    if not found:
        limit = curve.simulated(best, count)
        near = limit.lo <= asked.equals <= limit.hi
        doubt = tr(
            "its 95 % interval, {lo:.4g} to {hi:.4g} {unit}, holds the target: -n decides",
            lo=limit.lo,
            hi=limit.hi,
            unit=tr(asked.unit),
        )
        notes = (doubt,) if near else boundary(asked, curve, best)
        return answer(limit=limit.value, limit_at=best, notes=notes)
    value = nearest([one.value for one in found], asked)
    own, there = next(one for one in found if one.value == value), curve.simulated(value, count)
    jumps = not over.whole and not there.lo <= asked.equals <= there.hi
    return answer(
        **{"value": value, "lo": own.lo, "hi": own.hi, "attained": there.value},
        slope=None if jumps else _sampled_slope(curve, own),
        others=tuple(one.value for one in found if not own.lo <= one.value <= own.hi),
        notes=((JUMPS,) if jumps else ()) + ((WHOLE,) if over.whole else ()) + curve.noted(value),
    )


def _changes(scanned: Sequence[tuple[float, float]]) -> list[int]:
    """Places i of a scan of (x, y) at which y changes its sign to the next place."""
    return [i for i, ((_, a), (_, b)) in enumerate(pairwise(scanned)) if a * b < 0 or (a == 0 and b != 0)]


def _bracket(
    asked: Question, curve: Curve, grid: Sequence[float], i: int
) -> tuple[tuple[float, float], tuple[float, float]] | None:
    """Neighbouring places of the grid between which the quantity crosses the target with all realisations.

    About the place i where the pilot saw it cross or come nearest, from which the noise may have moved it by steps.
    """
    for j in sorted(range(i - MOST_STEPS, i + MOST_STEPS + 1), key=lambda j: abs(j - i)):
        if not 0 <= j < len(grid) - 1:
            continue
        ends = [(x, curve.simulated(x, curve.realisations).value - asked.equals) for x in grid[j : j + 2]]
        if ends[0][1] * ends[1][1] <= 0:
            return ends[0], ends[1]
    return None


def _interval(asked: Question, curve: Curve, one: tuple[float, float], other: tuple[float, float]) -> Estimate:
    """A value and the 95 % set about it: all values at which the quantity's own interval holds the target."""
    over, count, end = asked.over, curve.realisations, asked.equals

    def part(of: str, x: float) -> float:
        return float(getattr(curve.simulated(x, count), of)) - end

    def close(of: str, x: float, y: float) -> bool:
        found = curve.simulated(x, count)
        return not over.whole and abs(y) <= RESIDUE * (found.hi - found.lo)

    value = search.closed(partial(part, "value"), over, one, other, partial(close, "value"))
    if over.whole:
        value = fulfilling(asked, value, lambda n: curve.simulated(n, count).value)
    rising = other[1] > one[1]
    ends = []
    for side, of in ((-1, "hi" if rising else "lo"), (1, "lo" if rising else "hi")):
        inside, outside = (value, part(of, value)), _outside(over, partial(part, of), value, one, other, side)
        if inside[1] * outside[1] >= 0 or math.isnan(outside[1]):
            ends.append(outside[0])  # as far as is searched, the interval holds the target
        else:
            ends.append(search.closed(partial(part, of), over, inside, outside, partial(close, of)))
    return Estimate(value, *ends)


def _outside(
    over: search.Range,
    function: Callable[[float], float],
    value: float,
    one: tuple[float, float],
    other: tuple[float, float],
    side: int,
) -> tuple[float, float]:
    """A place on one side of a value at which the function has another sign than there, or the end of the range.

    The first step is a twentieth of the bracket's width on the scale of the search, each further one twice as long.
    """
    sign = function(value)
    step = max(abs(over.inner(other[0]) - over.inner(one[0])) / 20, over.whole)
    u = over.inner(value)
    while True:
        u += side * step
        x = over.outer(u)
        y = function(x)
        if y * sign <= 0 or math.isnan(y) or x in (over.low, over.high):
            return x, y
        step *= 2


def _sampled_slope(curve: Curve, found: Estimate) -> float | None:
    """The change of the quantity for one unit of the key, over the interval, of the same noise at both ends."""
    low, high = (curve.simulated(x, curve.realisations).value for x in (found.lo, found.hi))
    return None if found.lo == found.hi or math.isnan(high - low) else (high - low) / (found.hi - found.lo)

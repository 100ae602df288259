"""`radarsim solve`: the value of a numeric key at which a quantity reaches a target.

If the quantity is known exactly, the root of the exact function. Otherwise it is simulated, with the same noise at
every value; the interval is then the set of values at which the quantity's own 95 % interval holds the target, and
covers the true value as often as that interval does."""

import math
import os
import shlex
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import pairwise
from typing import TYPE_CHECKING, Any, Protocol, SupportsFloat, TypeVar

from radarsim.app import configs, quantities
from radarsim.app.case_work import CaseWork
from radarsim.app.configs import Config, load
from radarsim.app.quantities import UNKNOWN, UNPAIRED, Asked, Wanted
from radarsim.app.run import case_result, merged
from radarsim.app.shown import Shown
from radarsim.config import fields
from radarsim.config.check import label
from radarsim.config.document import did_you_mean
from radarsim.config.experiment import Case, Experiment
from radarsim.config.load import given
from radarsim.engine.results import Axes, CaseResult
from radarsim.engine.run import collect
from radarsim.errors import ConfigError, argument
from radarsim.language import term, tr
from radarsim.report import tables
from radarsim.report.statistics import Estimate
from radarsim.report.wording import labelled, shown, with_unit
from radarsim.studies import registry

if TYPE_CHECKING:
    import numpy as np
    import pandas as pd


# ---- question --------------------------------------------------------------------------------------------------------
V = TypeVar("V")

FACTOR = 1000.0  # the search goes from a thousandth of a positive key's value to a thousand times it
WHOLE = term("the nearest whole number that is at least as good as the target")
MOST_NAMED = 6  # cases listed in a message
JUMPS = term("the quantity jumps over the target there")
SAME = 1e-12  # relative change of a quantity that may be rounding
ROUGH = -1  # stands for a number of realisations
BATCHES = 20  # of one case: their spread has 19 degrees of freedom
LONG_S = 2.0  # duration of a search from which it is predicted


@dataclass(frozen=True, repr=False)
class Answer(Shown):
    """The answer of `radarsim solve`.

    value is None where the target is not attained; then limit is the nearest attainable value, at limit_at. lo and hi
    bound the value at 95 %, and equal it where exact. slope is the change of the quantity for one unit of the key;
    others are further values that attain the target. low and high are the searched range, command the run that
    confirms."""

    key: str
    unit: str
    quantity: Asked
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

    @property
    def table(self) -> "pd.DataFrame":
        """The output of `radarsim solve --json` as one row."""
        from radarsim.app import shown

        return tables.frame({name: [value] for name, value in shown.answer(self).items()})

    @property
    def lines(self) -> list[tuple[str, str]]:
        """The value, the quantity there, the slope, other values and notes: label and words of each."""
        value, lo, hi = self.value, self.lo, self.hi
        if value is None or lo is None or hi is None:
            return [("", line) for line in self.unattained]
        interval = tr("exact") if self.exact else f"95 % {shown(lo)} … {shown(hi)}"
        attained = math.nan if self.attained is None else self.attained
        if abs(attained - self.equals) < NEAR_ZERO * max(abs(self.equals), abs(self.attained_now)):
            attained = self.equals  # of a root at zero rounding is all that is left
        made = [("", f"{self.key} = {with_unit(value, self.unit)}   {interval}")]
        made.append(("attains", f"{self.quantity.said}: {self._quantity(attained)}{self._now}"))
        if self.slope is not None:
            made.append(("slope", self._slope(value, self.slope)))
        if self.others:
            made.append(("also at", ", ".join(with_unit(other, self.unit) for other in self.others)))
        return made + [("note", tr(note)) for note in self.notes]

    @property
    def unattained(self) -> tuple[str, ...]:
        """Why there is no value: the nearest attainable one, and where; empty where there is one."""
        limit, at = self.limit, self.limit_at
        if self.value is not None or limit is None or at is None:
            return ()
        told = {
            **{"quantity": self.quantity.said, "key": self.key, "wanted": self._quantity(self.equals)},
            **{"low": shown(self.low), "high": with_unit(self.high, self.unit)},
            **{"limit": self._quantity(limit), "at": with_unit(at, self.unit)},
        }
        line = tr(AT_MOST, **told) if limit < self.equals else tr(AT_LEAST, **told)
        return (line, *(tr("note: {words}", words=tr(note)) for note in self.notes))

    def _said(self) -> list[str]:
        return [labelled(label, words).strip() for label, words in self.lines]

    def _slope(self, value: float, per_unit: float) -> str:
        """The effect of a small increase of the key: `1 m/s more costs 1.7 points`."""
        step = 10.0 ** math.floor(math.log10(abs(value) / 2)) if value else 1.0
        step = max(step, 1.0) if float(value).is_integer() and step >= 0.5 else step
        change, more_is_better = per_unit * step, self.quantity.of.more_is_better
        better = (change > 0) == more_is_better
        size = shown(abs(change), "#.3g")
        points = tr("{size} points", size=size)
        changed = points if self.quantity_unit == "%" else f"{size} {tr(self.quantity_unit)}".rstrip()
        told = {"step": with_unit(step, self.unit), "change": changed}
        if more_is_better:
            return tr("{step} more brings {change}", **told) if better else tr("{step} more costs {change}", **told)
        return tr("{step} more takes off {change}", **told) if better else tr("{step} more adds {change}", **told)

    @property
    def _now(self) -> str:
        if math.isnan(self.attained_now):
            return ""
        value = self._quantity(self.attained_now)
        if self.now is None:
            return tr(" (as the config is: {value})", value=value)
        return tr(" (at {at}: {value})", at=with_unit(self.now, self.unit), value=value)

    def _quantity(self, value: float) -> str:
        number = _rate(value) if self.quantity.of.kind == "share" else shown(value, ".4g")
        return f"{number} {tr(self.quantity_unit)}".rstrip()


AT_MOST = term(
    "{quantity}: {wanted} is not attainable with {key} from {low} to {high}: the largest is {limit}, at {at}"
)
AT_LEAST = term(
    "{quantity}: {wanted} is not attainable with {key} from {low} to {high}: the smallest is {limit}, at {at}"
)
MOST_DIGITS = 12  # behind the point: beyond is rounding
NEAR_ZERO = 1e-9  # of a quantity: accuracy of an exact root


def _rate(percent: float) -> str:
    """A share in per cent, with digits enough to show three of its complement where it is near 100 %.

    >>> _rate(99.9990021)
    '99.999002'
    """
    rest = 100.0 - percent
    if not 0.0 < rest < 1.0:
        return shown(percent, ".4g")
    return shown(percent, f".{min(2 - math.floor(math.log10(rest)), MOST_DIGITS)}f")


@dataclass
class Cases:
    """The cases of a config with other values at a key; `base` as it is. The others share the base's noise, whatever
    their world."""

    config: Config
    overrides: tuple[str, ...]
    name: str | None = None
    base: Case = field(init=False)
    outside: tuple[str, ...] = field(init=False)  # filters of Python, which the cases are without
    stem: str = field(init=False)  # the config's, of one case; else that of the case's own config

    def __post_init__(self) -> None:
        experiment = load(self.config, self.overrides)
        self.base = self._chosen(experiment)
        self.outside = tuple(one.name for case in experiment.cases for one in case.outside)
        self.stem = experiment.stem if len(experiment.cases) == 1 else self.base.stem

    def _chosen(self, experiment: Experiment) -> Case:
        named = {case.name: case for case in experiment.cases}
        if self.name is None and len(named) == 1:
            return replace(experiment.cases[0], outside=())
        if self.name is None:
            some = ", ".join(repr(one) for one in list(named)[:MOST_NAMED]) + (", …" if len(named) > MOST_NAMED else "")
            raise ConfigError(f"{experiment.stem} has {len(named)} cases: choose one with {argument('case')}: {some}")
        if self.name not in named:
            near = did_you_mean(self.name, named) or f"; there are: {', '.join(named)}"
            raise ConfigError(f"no case {self.name!r} in {experiment.stem}{near}")
        return replace(named[self.name], outside=())

    def at(self, key: str, value: float) -> Case:
        """The case with another value at a key. Raises ConfigError where the config refuses it."""
        setting = self._setting(key, value)
        key = setting.partition("=")[0]
        try:
            return replace(self._chosen(load(self.config, (*self.overrides, setting))), noise_of=self.base.spec)
        except ConfigError as error:
            raise ConfigError(*(_not_by_argument(line, key) for line in error.lines)) from error

    def _setting(self, key: str, value: float) -> str:
        """A key's setting; for an item of a list the whole list, which the config may give in degrees or leave out."""
        holder, _, place = key.rpartition(".")
        if not place.isdecimal():
            return f"{key}={_yaml(value)}"
        items = {one.path: one.value for one in fields.keys(self.base.spec) if one.path.rpartition(".")[0] == holder}
        listed = [f"{holder}.{i}" for i in range(len(items))]
        if list(items) != listed or None in items.values():
            return f"{key}={_yaml(value)}"
        values = (value if path == key else own for path, own in items.items())
        return f"{holder}=[{', '.join(_yaml(one) for one in values if one is not None)}]"


def _not_by_argument(line: str, key: str) -> str:
    """A message about a key's value without the name of an argument that the user did not give.

    >>> _not_by_argument("overrides['filters.0.orders']: filters.0.orders.0: must be <= 2, got 3", "filters.0.orders")
    'filters.0.orders.0: must be <= 2, got 3'
    """
    where = f"{given(key)}: "
    if not line.startswith(where):
        return line
    said = line.removeprefix(where)
    return said if said.startswith(f"{key}.") else f"{key}: {said}"


def _yaml(value: float) -> str:
    """A number as in a config: whole ones without a point."""
    return repr(int(value)) if float(value).is_integer() and abs(value) < 1e15 else repr(float(value))


@dataclass(frozen=True)
class Question:
    """A parsed question: cases, key, target and range."""

    cases: Cases
    key: str
    quantity: Asked
    equals: float
    over: quantities.Range
    now: float | None
    unit: str
    overrides: tuple[str, ...]
    realisations: int | None = None

    def command(self, value: float) -> str:
        """The run that confirms a value, with independent noise and the requested number of realisations."""
        name = self.cases.config if isinstance(self.cases.config, str | os.PathLike) else "CONFIG.yaml"
        settings = [*self.overrides, f"{self.key}={number(value)}"]
        count = [] if self.realisations is None else ["-n", str(self.realisations)]
        parts = [part for one in settings for part in ("--set", one)]
        return shlex.join(["radarsim", "run", os.fspath(name), *parts, *count])


def number(value: float) -> str:
    """A number as YAML reads it back, to twelve digits."""
    return repr(rounded(value)).removesuffix(".0")


def rounded(value: float) -> float:
    """A number rounded to twelve digits."""
    return float(f"{value:.12g}")


def range_of(
    found: Sequence[fields.NumericKey], name: str, between: tuple[float, float] | None, factor: float = FACTOR
) -> quantities.Range:
    """The search range of a key, up to `factor` times its value if it has no bounds. Raises ConfigError where it has
    neither bounds nor a starting value."""
    key, values = found[0], [one.value for one in found if one.value]
    if between is not None:
        low, high = between
        if not (math.isfinite(low) and math.isfinite(high) and low < high):
            raise ConfigError(f"{argument('between')}: must be two rising numbers, got {low:g} {high:g}")
        if key.whole:
            low, high = float(math.ceil(low)), float(math.floor(high))
            if low > high:
                told = " ".join(f"{end:g}" for end in between)
                raise ConfigError(f"{argument('between')}: {name} takes whole numbers, and there is none from {told}")
        return quantities.searched(low, high, key.whole)
    if math.isfinite(key.low) and math.isfinite(key.high) and not key.whole:
        return quantities.searched(key.low, key.high)
    if not values:
        what = "there is no value to search about" if key.value is None else f"is {key.value:g} in the config"
        raise ConfigError(f"{name}: {what}, and its own range has no end: give {ends()}")
    if key.low >= 0:
        low, high = max(rounded(min(values) / factor), key.low), min(rounded(max(values) * factor), key.high)
        return quantities.searched(
            math.ceil(low) if key.whole else low, math.floor(high) if key.whole else high, key.whole
        )
    size = 10 * max(map(abs, values))
    return quantities.searched(max(-size, key.low), min(size, key.high), key.whole)


def ends() -> str:
    """The argument that sets the search range."""
    return argument("between=(low, high)", "--between LO HI")


class Altered(Protocol):
    """A case, and the same case with other values, which raises ConfigError if the config refuses them."""

    base: Case

    def at(self, key: str, value: Any) -> Case: ...


class Curve:
    """The quantity as a function of the key, or of several, each value computed once.

    progress is called for each; `simulated` counts the simulated ones."""

    def __init__(
        self,
        cases: "Cases | Altered",
        key: str,
        quantity: Asked,
        threads: int | None,
        progress: Callable[[int, int, int], None] | None,
        realisations: int,
    ):
        self.cases, self.key, self.quantity = cases, key, quantity
        self.threads, self.progress, self.realisations = threads, progress, realisations
        self.known: dict[tuple[Any, int], Estimate] = {}
        self.refused: dict[Any, ConfigError] = {}
        self.scans = set[int]()  # scans at which the quantity was read, of simulated values
        self.from_tables = False
        self.rough = False  # whether cheaper approximate values exist, for a first search
        self.done, self.expected = 0, 0  # realisations simulated, or values that need none; 0 expected: unknown

    def exact(self, axes: Axes) -> bool:
        """Whether the quantity is known exactly: from the plan, or from one realisation's tables."""
        case = self.cases.base
        if not math.isnan(quantities.exact(self.quantity, case, axes)):
            return True
        if quantities.planned(self.quantity.of):
            return False
        result = self._result(case, 1)
        _, known = quantities.sampled(self.quantity, result)
        without_ends = self.quantity.of.ends[0] not in quantities.table_of(self.quantity.of, result)
        self.from_tables = without_ends or not math.isnan(known)
        return self.from_tables

    def exactly(self, value: Any) -> float:
        """The exact quantity at a value (None: the config's own); NaN where there is none."""
        return self._kept(value, 0, self._exact_of).value

    def roughly(self, value: Any) -> float:
        """A cheaper value, to a thousandth of σ, if the study has one; else the exact quantity."""
        if not self.rough:
            return self.exactly(value)
        return self._kept(value, ROUGH, lambda case: self._exact_of(replace(case, roughly=True))).value

    def simulated(self, value: Any, realisations: int) -> Estimate:
        """The quantity with its interval, from this number of realisations."""
        return self._kept(value, realisations, lambda case: self._sampled(case, realisations)[0])

    def noted(self, value: Any) -> tuple[str, ...]:
        """The note of the tables on the interval at a value, in words."""
        note = quantities.noted(self.quantity, self._result(self.cases.at(self.key, value), self.realisations))
        more = argument("realisations=…", "-n")
        return (f"the interval may be too narrow: {note}; use more realisations, {more}",) if note else ()

    def _kept(self, value: Any, count: int, of: Callable[[Case], Estimate]) -> Estimate:
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
        each = max(count, 1)
        self.done += each
        if self.expected and self.progress is not None:
            self.expected = max(self.expected, self.done + each)  # whoever asks once more may ask again
            self.progress(self.done, self.expected, 0)
        return found

    def _exact_of(self, case: Case) -> Estimate:
        if self.from_tables:
            value = self._sampled(case, 1)[1]
        else:
            value = quantities.exact(self.quantity, case, quantities.labels(self.quantity, case))
        return Estimate(value, value, value)

    def _sampled(self, case: Case, realisations: int) -> tuple[Estimate, float]:
        result = self._result(case, realisations)
        self.scans.add(quantities.scan(self.quantity, result.axes))
        return quantities.sampled(self.quantity, result)

    def _result(self, case: Case, realisations: int) -> CaseResult:
        case = replace(case, against=())  # a question is of gains against the first
        work = CaseWork(case)
        return case_result(case, work, collect(work, realisations, threads=self.threads))


def without_one(case: Case, of: Callable[[CaseResult], V], count: int) -> tuple[V, list[V], Axes]:
    """A function of a case's realisations, of all of them and of all but each of n batches; the axes of its sums."""
    work, each = CaseWork(replace(case, against=())), max(2, count // BATCHES)
    batches = [work.simulate(n * each, each) for n in range(BATCHES)]
    total = sum(batches[1:], start=batches[0])

    def value(packed: "np.ndarray", count: int) -> V:
        sums = work.plan.layout.unpack(packed)
        return of(CaseResult(case.name, case.study, case.spec, case.swept, count, sums, work.plan.axes))

    whole = value(total, BATCHES * each)
    return whole, [value(total - one, (BATCHES - 1) * each) for one in batches], work.plan.axes


def predict(notify: Callable[[str], None], what: str, seconds: float) -> None:
    """Predict the work and the duration of a search, where that is long."""
    if seconds > LONG_S:
        notify(tr("{what}: about {seconds:.0f} s", what=what, seconds=seconds))


def said_of(asked: Question) -> dict[str, str]:
    """The quantity in a sentence."""
    return {"quantity": asked.quantity.said, "key": asked.key}


def answered(asked: Question, attained_now: float, **given: Any) -> Answer:
    """An answer to the question; omitted fields are empty."""
    empty: dict[str, Any] = dict.fromkeys(("value", "lo", "hi", "attained", "slope", "limit", "limit_at"))
    whole = empty | {"others": ()} | given
    shown = whole["limit_at"] if whole["value"] is None else whole["value"]
    return Answer(
        key=asked.key,
        unit=label(asked.cases.base.spec, asked.key).unit,
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
    """Why the quantity has no value anywhere on the range: the config's own reason if it gives one."""
    if curve.refused:
        x, error = min(curve.refused.items(), key=lambda one: one[0])
        own = (line if line.startswith(asked.key) else f"with {asked.key}={number(x)}: {line}" for line in error.lines)
        return ConfigError(*dict.fromkeys(own))
    return ConfigError(f"{asked.quantity.words}: there is no estimate there, whatever {asked.key} is")


def refuse_without_effect(asked: Question, tried: Iterable[tuple[float, float]]) -> None:
    """ConfigError where the quantity is the same at every value of the key that was tried and has an estimate."""
    places, known = zip(*((x, y) for x, y in tried if not math.isnan(y)), strict=True)
    if max(known) - min(known) <= SAME * max(abs(max(known)), abs(min(known)), 1e-300):
        everywhere = f"{known[0]:.6g} {asked.unit} at every value from {min(places):g} to {max(places):g}"
        raise ConfigError(f"{asked.key}: has no effect on the {asked.quantity.words}: {everywhere}")


def fulfilling(asked: Question, x: float, of: Callable[[float], float]) -> float:
    """Of the whole numbers around a change of sign, the first that meets the target."""
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


def boundary(asked: Question, curve: Curve, x: float) -> tuple[str, ...]:
    """Whether the nearest value lies at an end of the search range, or of the config's bounds, in words."""
    if x in (asked.over.low, asked.over.high):
        return (tr("the end of the searched range; {between} searches elsewhere", between=ends()),)
    beyond = [other for other in curve.refused if abs(other - x) <= 0.05 * abs(x)]
    return (term("the limit that the config allows"),) if beyond else ()


# ---- sampled search --------------------------------------------------------------------------------------------------
PILOT_SHARE, PILOT_LEAST = 16, 200  # realisations of the scan: a share of all, but not fewer
PILOT_POINTS = 13
WITH_ALL = 13  # values with all realisations: a bracket, the value, both ends of its interval
MOST_STEPS = 3  # of the scan: the pilot's noise may have moved a crossing that far
RESIDUE = 0.02  # part of its interval to which a sampled quantity is brought to the target: below, noise dominates


def by_sampling(asked: Question, curve: Curve, notify: Callable[[str], None]) -> Answer:
    """The answer where the quantity is simulated, with the same noise at every value."""
    over, count = asked.over, curve.realisations
    grid, pilot = over.grid(PILOT_POINTS), min(count, max(PILOT_LEAST, count // PILOT_SHARE))
    curve.expected = len(grid) * pilot + WITH_ALL * count
    curve.simulated(None, 1)  # compiles
    begun = time.monotonic()
    attained_now = curve.simulated(None, count).value
    counts = {"grid": len(grid), "pilot": pilot, "more": WITH_ALL, "count": count}
    what = tr(
        "simulates {grid} values of {key} with {pilot} realisations, then about {more} with {count}",
        **said_of(asked),
        **counts,
    )
    predict(notify, what, (WITH_ALL + len(grid) * pilot / count) * (time.monotonic() - begun))
    scanned = [(x, curve.simulated(x, pilot).value - asked.equals) for x in grid]
    known = [one for one in scanned if not math.isnan(one[1])]
    if not known:
        raise nowhere(asked, curve)
    refuse_without_effect(asked, [(x, y + asked.equals) for x, y in known])
    apart = unpaired(asked, curve)
    if apart:
        notify("; ".join(apart))
        count = curve.realisations = UNPAIRED * count
        curve.expected = curve.done + WITH_ALL * count
    answer = partial(answered, asked, attained_now, exact=False)
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
            "its 95 % interval, {lo:.4g} to {hi:.4g} {unit}, holds the target: more realisations, {option}, decide",
            lo=limit.lo,
            hi=limit.hi,
            unit=tr(asked.unit),
            option=argument("realisations=…", "-n"),
        )
        notes = (doubt,) if near else boundary(asked, curve, best)
        return answer(limit=limit.value, limit_at=best, notes=notes + apart)
    value = nearest([one.value for one in found], asked)
    own, there = next(one for one in found if one.value == value), curve.simulated(value, count)
    jumps = not over.whole and not there.lo <= asked.equals <= there.hi
    return answer(
        **{"value": value, "lo": own.lo, "hi": own.hi, "attained": there.value},
        slope=None if jumps else _sampled_slope(curve, own),
        others=tuple(one.value for one in found if not own.lo <= one.value <= own.hi),
        notes=(JUMPS,) * jumps + (WHOLE,) * over.whole + apart + curve.noted(value),
    )


def unpaired(asked: Question, curve: Curve) -> tuple[str, ...]:
    """A note where the key moves the scans, so that values are not compared with the same noise. The quantity at a time
    is then read at another scan, whose noise is another."""
    if len(curve.scans) < 2:
        return ()
    words = tr(
        "{key} moves the scans, so the noise differs between values: each value gets {count} "
        "realisations, {times} times as many",
        key=asked.key,
        count=UNPAIRED * curve.realisations,
        times=UNPAIRED,
    )
    return (words,)


def _changes(scanned: Sequence[tuple[float, float]]) -> list[int]:
    """Places i of a scan of (x, y) between which and the next y changes its sign."""
    return [i for i, ((_, a), (_, b)) in enumerate(pairwise(scanned)) if a * b < 0 or (a == 0 and b != 0)]


def _bracket(
    asked: Question, curve: Curve, grid: Sequence[float], i: int
) -> tuple[tuple[float, float], tuple[float, float]] | None:
    """Neighbouring places of the grid between which the quantity crosses the target with all realisations. Starts at
    place i, where the pilot crossed or came nearest; its noise may have moved that by some steps."""
    for j in sorted(range(i - MOST_STEPS, i + MOST_STEPS + 1), key=lambda j: abs(j - i)):
        if not 0 <= j < len(grid) - 1:
            continue
        ends = [(x, curve.simulated(x, curve.realisations).value - asked.equals) for x in grid[j : j + 2]]
        if ends[0][1] * ends[1][1] <= 0:
            return ends[0], ends[1]
    return None


def _interval(asked: Question, curve: Curve, one: tuple[float, float], other: tuple[float, float]) -> Estimate:
    """A value and its 95 % set: all values at which the quantity's own interval holds the target."""
    over, count, end = asked.over, curve.realisations, asked.equals

    def part(of: str, x: float) -> float:
        return float(getattr(curve.simulated(x, count), of)) - end

    def close(of: str, x: float, y: float) -> bool:
        found = curve.simulated(x, count)
        return not over.whole and abs(y) <= RESIDUE * (found.hi - found.lo)

    def closed(of: str, one: tuple[float, float], other: tuple[float, float]) -> float:
        # Other noise at every value makes jumps, which a search for the target itself would close to rounding.
        near = curve.simulated(one[0], count)
        part_of = RESIDUE * (near.hi - near.lo) / abs(one[1] - other[1]) if len(curve.scans) > 1 else 0.0
        width = part_of * abs(one[0] - other[0]) / max(abs(one[0]), abs(other[0]), 1e-300)
        return quantities.closed(
            partial(part, of), over, one, other, partial(close, of), max(width, quantities.EXACTLY)
        )

    value = closed("value", one, other)
    if over.whole:
        value = fulfilling(asked, value, lambda n: curve.simulated(n, count).value)
    rising = other[1] > one[1]
    ends = []
    for side, of in ((-1, "hi" if rising else "lo"), (1, "lo" if rising else "hi")):
        inside, outside = (value, part(of, value)), _outside(over, partial(part, of), value, one, other, side)
        if inside[1] * outside[1] >= 0 or math.isnan(outside[1]):
            ends.append(outside[0])  # the interval holds the target up to the end of the search
        else:
            ends.append(closed(of, inside, outside))
    return Estimate(value, *ends)


def _outside(
    over: quantities.Range,
    function: Callable[[float], float],
    value: float,
    one: tuple[float, float],
    other: tuple[float, float],
    side: int,
) -> tuple[float, float]:
    """A place on one side of a value where the function has the other sign, or the end of the range. The first step is
    a twentieth of the bracket's width on the scale of the search, each further one twice as long."""
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
    """The change of the quantity for one unit of the key, over the interval, with the same noise at both ends."""
    low, high = (curve.simulated(x, curve.realisations).value for x in (found.lo, found.hi))
    return None if found.lo == found.hi or math.isnan(high - low) else (high - low) / (found.hi - found.lo)


# ---- solve -----------------------------------------------------------------------------------------------------------
NEAR = 1e-4  # of a value: the step of a derivative
JUMP = 1e-4  # of a quantity: larger changes may be jumps of means over detection patterns, where others are merged
STEP = 1e-3  # on the scale of the search, the step of a rough derivative
AROUND = 2  # rough values for each place of the scan, including those around roots and turns
TINY = 1e-300  # instead of zero
TO_CLOSE = 12  # values, besides those of the scan, to close a bracket to rounding and take the slope
NEAR_ENOUGH = 1e-10  # of the quantity: distance from the target at which a search ends that jumps by 1e-4 anyway
ROUGHLY = 1e-4  # relative width to which a rough root is closed
DOUBT = 0.01  # of the quantity: a rough one that comes this near the target without a root is not trusted


def place(at_s: float | None, at_k: int | None) -> dict[str, object]:
    """The time or scan, where given. Raises ConfigError for both at once."""
    if at_s is not None and at_k is not None:
        both = f"{argument('at_s', '--at')} and {argument('at_k', '--at-k')}"
        raise ConfigError(f"{both} do not go together: a time or a scan")
    if isinstance(at_k, SupportsFloat) and not float(at_k).is_integer():
        raise ConfigError(f"{argument('at_k', '--at-k')}: must be a whole number, that of a scan, got {at_k:g}")
    return {name: value for name, value in (("at_s", at_s), ("at_k", at_k)) if value is not None}


def solve(
    config: Config,
    key: str,
    *,
    equals: float,
    filter: str | None = None,
    at_s: float | None = None,
    at_k: int | None = None,
    between: tuple[float, float] | None = None,
    case: str | None = None,
    overrides: configs.Overrides = (),
    realisations: float | None = None,
    seed: int | None = None,
    threads: int | None = None,
    sampled: bool = False,
    progress: Callable[[int, int, int], None] | None = None,
    notify: Callable[[str], None] | None = None,
    **quantity: str | None,
) -> Answer:
    """Find the value of a key at which a quantity equals `equals`, in its unit; gains and rates in per cent.

    The quantity is given as an argument named after an option of `radarsim solve`: `gain="r"` or `sigma="Vr"` of a
    component, for the `filter`; or a rate of a filter, `lock="sequence"`, `loss="nearest"`, … It is taken at time at_s,
    s, or at scan at_k, counted from 1; default: the last scan. between: the range of the key to search. case: the case,
    if the config has several. realisations: the number for each simulated value, if nothing exact is known; sampled:
    simulate even if it is. notify is called with a line on what a search of some seconds will do.

    `value` lies between `lo` and `hi` (95 %; equal where `exact`). If the target cannot be attained, value is None, and
    limit, at limit_at, is the nearest attainable value. Raises ConfigError for a wrong config, key, filter or quantity.

    >>> answer = solve("rls2", "radar.sigma_velocity_mps", gain="r", filter="r+Vr", at_s=60, equals=30)
    >>> print(f"{answer.value:.4f} {answer.unit}", answer.exact)
    13.7212 m/s True
    """
    named = {name: value for name, value in quantity.items() if value is not None}
    if len(named) != 1:
        given = ", ".join(named) or "none"
        examples = f"{argument('sigma=…', '--sigma')}, {argument('gain=…', '--gain')}"
        raise ConfigError(f"name one quantity, as `radarsim solve --help` lists them: {examples}, …; got {given}")
    texts = merged(configs.check(overrides, threads=threads, equals=equals, **place(at_s, at_k)), None, seed)
    if not isinstance(key, str):
        raise ConfigError(f"key: must be text, got {key!r}")
    if between is not None and not configs.is_pair(between):
        raise ConfigError(f"between: must be two rising numbers, got {between!r}")
    if not math.isfinite(equals):
        raise ConfigError(f"{argument('equals')}: must be a finite number, got {equals:g}")
    ((name, component),) = named.items()
    cases, count = Cases(config, texts, case), configs.whole(realisations)
    found = fields.find(cases.base.spec, key)
    wanted = quantities.checked(Wanted(name, filter, component, at_s, at_k), cases.base, cases.outside)
    axes = quantities.labels(wanted, cases.base)
    wanted = quantities.resolved(wanted, axes)
    over = range_of(found, key, between)
    curve = Curve(cases, key, wanted, threads, progress, count or cases.base.realisations)
    now = found[0].value if len({one.value for one in found}) == 1 else None
    asked = Question(cases, key, wanted, equals, over, now, quantities.unit(wanted, axes), texts, count)
    work = _exactly if not sampled and curve.exact(axes) else by_sampling
    return work(asked, curve, notify or (lambda line: None))


def _exactly(asked: Question, curve: Curve, notify: Callable[[str], None]) -> Answer:
    """The answer where the quantity is exact."""
    attained_now = curve.exactly(None)
    grid = asked.over.grid()
    curve.expected = len(grid) + TO_CLOSE
    study, base = registry.study(asked.cases.base.study), quantities.shortened(asked.quantity, asked.cases.base)
    curve.rough = study.costly(base) and not asked.over.whole
    elsewhere = grid[len(grid) // 3]  # not the config's own value, which a study may have cached
    near = study.exact_but_for(base)
    roughly = timed(partial(curve.roughly, elsewhere))
    # One exact value beyond the search's own, where it may take seconds: with each pattern of plots followed it takes
    # a twentieth of one.
    each = timed(partial(curve.exactly, elsewhere)) if near or not curve.rough else 0.0
    said = said_of(asked)
    what = tr("computes the {quantity} at about {count} values of {key}", **said, count=curve.expected)
    seconds = TO_CLOSE * each + len(grid) * (AROUND * roughly if curve.rough else each)
    predict(notify, what + (tr(", each {near}", near=tr(near)) if near else ""), seconds)
    try:
        found = roots(asked, curve)
    except quantities.Undefined:
        raise nowhere(asked, curve) from None
    counted = ROUGH if curve.rough else 0  # both kinds differ a little where the key has no effect
    refuse_without_effect(asked, [(x, one.value) for (x, n), one in curve.known.items() if n == counted])
    values = found.roots
    if asked.over.whole:
        values = tuple(dict.fromkeys(fulfilling(asked, x, curve.exactly) for x in values))
    answer = partial(answered, asked, attained_now, exact=True)
    if not values:
        limit = found.at_nearest + asked.equals
        return answer(limit=limit, limit_at=found.nearest, notes=boundary(asked, curve, found.nearest))
    value = nearest(values, asked)
    near = study.exact_but_for(quantities.shortened(asked.quantity, asked.cases.at(asked.key, value)))
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


def roots(asked: Question, curve: Curve) -> quantities.Found:
    """Where the exact quantity reaches the target; searched roughly first where that is much cheaper. Raises
    quantities.Undefined where it has no value."""

    def missing(x: float) -> float:
        return curve.exactly(x) - asked.equals

    if not curve.rough:
        return quantities.roots_of(missing, asked.over)
    size = max(abs(asked.equals), TINY)
    found = quantities.roots_of(lambda x: curve.roughly(x) - asked.equals, asked.over, ROUGHLY)
    near = [exact_near(missing, curve, asked.over, x, NEAR_ENOUGH * size) for x in found.roots]
    exactly = [x for x in near if x is not None]
    if len(exactly) < len(near) or (not near and abs(found.at_nearest) < DOUBT * size):
        return quantities.roots_of(missing, asked.over)
    return quantities.Found(tuple(exactly), found.nearest, found.at_nearest if exactly else missing(found.nearest))


def exact_near(
    missing: Callable[[float], float], curve: Curve, over: quantities.Range, x: float, near_enough: float
) -> float | None:
    """The root near a rough one: by secants, the first from the rough quantity; if they fail, bracketed."""
    u = over.inner(x)
    ends = over.outer(u - STEP), over.outer(u + STEP)
    low, high = (curve.roughly(end) for end in ends)
    rising = (high - low) / (over.inner(ends[1]) - over.inner(ends[0]))
    found = quantities.polished(missing, over, x, rising, near_enough)
    return quantities.near(missing, over, x, near_enough) if found is None else found


def timed(work: Callable[[], object]) -> float:
    """Seconds that a function takes."""
    begun = time.monotonic()
    work()
    return time.monotonic() - begun


def slope(of: Callable[[float], float], value: float, over: quantities.Range) -> float | None:
    """The change of a function for one unit of the key, by a central difference within the range; one-sided at an end.
    Error of the order of 1e-8 of itself; of whole numbers the change to the next."""
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

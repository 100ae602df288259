"""The question of `radarsim solve`: cases, key, target; the quantity as a function of the key; the answer."""

import math
import os
import shlex
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Protocol, TypeVar

from radarsim.app import quantities
from radarsim.app.configs import CaseWork, Config, load
from radarsim.app.quantities import UNKNOWN, Asked
from radarsim.app.run import case_result
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

if TYPE_CHECKING:
    import numpy as np
    import pandas as pd

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
    confirms.
    """

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
        from radarsim.app import documents

        return tables.frame({name: [value] for name, value in documents.answer(self).items()})

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
    """The cases of a config with other values at a key; `base` as it is.

    The others share the base's noise, whatever their world.
    """

    config: Config
    overrides: tuple[str, ...]
    name: str | None = None
    base: Case = field(init=False)
    stem: str = field(init=False)  # the config's, of one case; else that of the case's own config

    def __post_init__(self) -> None:
        experiment = load(self.config, self.overrides)
        self.base = self._chosen(experiment)
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
    """The search range of a key, up to `factor` times its value if it has no bounds.

    Raises ConfigError where it has neither bounds nor a starting value.
    """
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

    progress is called for each; `simulated` counts the simulated ones.
    """

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
        self.expected = 1

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
        return (tr("the end of what was searched; {between} searches elsewhere", between=ends()),)
    beyond = [other for other in curve.refused if abs(other - x) <= 0.05 * abs(x)]
    return (term("the limit of what the config allows"),) if beyond else ()

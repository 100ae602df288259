"""The answer of `radarsim solve`, and how its numbers are written."""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from radarsim.api.design.quantities import MeasuredQuantity
from radarsim.api.display import Displayable
from radarsim.language.translate import term, tr
from radarsim.report import tables
from radarsim.report.output_labels import labelled_line
from radarsim.report.wording import format_number, with_unit

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, repr=False)
class Answer(Displayable):
    """The answer of `radarsim solve`.

    value is None where the target is not attained; then limit is the nearest attainable value, at limit_at. lo and hi
    bound the value at 95 %, and equal it where exact. slope is the change of the quantity for one unit of the key;
    other_values: further values that attain the target. low and high are the searched range, command the run that
    confirms. last_s: the time of the last scan; settled: whether the filters have settled by the time asked about."""

    key: str
    unit: str
    quantity: MeasuredQuantity
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
    other_values: tuple[float, ...]
    limit: float | None
    limit_at: float | None
    low: float
    high: float
    command: str
    notes: tuple[str, ...] = ()
    last_s: float | None = None
    settled: bool = True

    @property
    def table(self) -> "pd.DataFrame":
        """The output of `radarsim solve --json` as one row."""
        from radarsim.api import json_output

        return tables.frame({name: [value] for name, value in json_output.answer(self).items()})

    @property
    def lines(self) -> list[tuple[str, str]]:
        """The value, the quantity there, the slope, other values and notes: label and words of each."""
        value, lo, hi = self.value, self.lo, self.hi
        if value is None or lo is None or hi is None:
            return [("", line) for line in self.unattained]
        interval = tr("exact") if self.exact else f"95 % {format_number(lo)} … {format_number(hi)}"
        attained = math.nan if self.attained is None else self.attained
        if abs(attained - self.equals) < NEAR_ZERO * max(abs(self.equals), abs(self.attained_now)):
            attained = self.equals  # of a root at zero rounding is all that is left
        lines = [("", f"{self.key} = {with_unit(value, self.unit)}   {interval}")]
        lines.append(("attains", f"{self._quantity_and_time}: {self._quantity(attained)}{self._now}"))
        if self.slope is not None:
            lines.append(("slope", self._slope(value, self.slope)))
        if self.other_values:
            lines.append(("also at", ", ".join(with_unit(other_value, self.unit) for other_value in self.other_values)))
        return lines + [("note", tr(note)) for note in self.notes]

    @property
    def unattained(self) -> tuple[str, ...]:
        """Why there is no value: the nearest attainable one, and where; empty where there is one."""
        limit, limit_key_value = self.limit, self.limit_at
        if self.value is not None or limit is None or limit_key_value is None:
            return ()
        fields = {
            **{"quantity": self._quantity_and_time, "key": self.key, "wanted": self._quantity(self.equals)},
            **{"low": format_number(self.low), "high": with_unit(self.high, self.unit)},
            **{"limit": self._quantity(limit), "at": with_unit(limit_key_value, self.unit)},
        }
        line = tr(AT_MOST, **fields) if limit < self.equals else tr(AT_LEAST, **fields)
        return (line, *(tr("note: {words}", words=tr(note)) for note in self.notes))

    @property
    def _quantity_and_time(self) -> str:
        """The quantity in words, with its time, and whether the filters have not settled by then."""
        quantity, last_s = self.quantity, self.last_s
        text = quantity.translated_words
        if last_s is not None and (quantity.over, quantity.at_s, quantity.at_k) == ("at", None, None):
            fields = {"what": text, "t_s": last_s}
            if self.settled:
                return tr("{what} at the last scan ({t_s:g} s)", **fields)
            return tr("{what} at the last scan ({t_s:g} s, not settled)", **fields)
        return text if self.settled else tr("{what} (not settled)", what=text)

    def _answer_lines(self) -> list[str]:
        return [labelled_line(label, words).strip() for label, words in self.lines]

    def _slope(self, value: float, per_unit: float) -> str:
        """The effect of a small increase of the key: `1 m/s more costs 1.7 points`."""
        step = 10.0 ** math.floor(math.log10(abs(value) / 2)) if value else 1.0
        step = max(step, 1.0) if float(value).is_integer() and step >= 0.5 else step
        change, more_is_better = per_unit * step, self.quantity.definition.more_is_better
        is_improvement = (change > 0) == more_is_better
        size = format_number(abs(change), "#.3g")
        points = tr("{size} points", size=size)
        change_words = points if self.quantity_unit == "%" else f"{size} {tr(self.quantity_unit)}".rstrip()
        fields = {"step": with_unit(step, self.unit), "change": change_words}
        if more_is_better:
            return (
                tr("{step} more brings {change}", **fields)
                if is_improvement
                else tr("{step} more costs {change}", **fields)
            )
        return (
            tr("{step} more takes off {change}", **fields)
            if is_improvement
            else tr("{step} more adds {change}", **fields)
        )

    @property
    def _now(self) -> str:
        if math.isnan(self.attained_now):
            return ""
        value = self._quantity(self.attained_now)
        if self.now is None:
            return tr(" (as the config is: {value})", value=value)
        return tr(" (at {at}: {value})", at=with_unit(self.now, self.unit), value=value)

    def _quantity(self, value: float) -> str:
        number = _rate(value) if self.quantity.definition.kind == "share" else format_number(value, ".4g")
        return f"{number} {tr(self.quantity_unit)}".rstrip()


AT_MOST = term(
    "{quantity}: {wanted} is not attainable with {key} from {low} to {high}: the largest is {limit}, at {at}"
)
AT_LEAST = term(
    "{quantity}: {wanted} is not attainable with {key} from {low} to {high}: the smallest is {limit}, at {at}"
)
MAX_DECIMALS = 12  # behind the point: beyond is rounding
NEAR_ZERO = 1e-9  # of a quantity: accuracy of an exact root


def _rate(percent: float) -> str:
    """A share in per cent, with digits enough to show three of its complement where it is near 100 %.

    >>> _rate(99.9990021)
    '99.999002'
    """
    complement = 100.0 - percent
    if not 0.0 < complement < 1.0:
        return format_number(percent, ".4g")
    return format_number(percent, f".{min(2 - math.floor(math.log10(complement)), MAX_DECIMALS)}f")


def number(value: float) -> str:
    """A number as YAML reads it back, to twelve digits."""
    return repr(rounded(value)).removesuffix(".0")


def rounded(value: float) -> float:
    """A number rounded to twelve digits."""
    return float(f"{value:.12g}")

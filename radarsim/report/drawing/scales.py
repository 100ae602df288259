"""Scales of axes and of map colours, and round values for their ticks."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from radarsim.language.numerals import power_of_ten
from radarsim.report.drawing.model import Heat, Line, Panel
from radarsim.report.wording import number

STEPS = (1.0, 2.0, 2.5, 5.0, 10.0)  # between ticks, times a power of ten
TICK_DIGITS = 6
WIDE_RATIO = 20.0  # of the values of a map, from which its colours are logarithmic
MIN_SCANS = 5  # from which ticks stand at scans
MIN_LAST_GAP = 0.5  # between the last two ticks at scans, in intervals
MAX_EXTRA_TICKS = 3  # more than asked for, on a logarithmic axis
MIN_HIGH_SHARE = 0.9  # median of shares whose differences from one matter
MAX_DECADES = 7  # labelled on a logarithmic axis
MIN_END_GAP = 0.1  # of a logarithmic axis, from its outer power of ten to a tick beyond


@dataclass(frozen=True)
class Scale:
    """A linear or logarithmic axis from `low` to `high`, over the positions `start` to `end`."""

    log: bool
    low: float
    high: float
    start: float
    end: float

    def position(self, values: ArrayLike) -> np.ndarray:
        """Positions of values; not-a-number for a value that the axis cannot show."""
        v = np.asarray(values, dtype=float)
        low, high = self.low, self.high
        if self.log:
            with np.errstate(divide="ignore", invalid="ignore"):
                v = np.log10(np.where(v > 0, v, np.nan))
            low, high = math.log10(low), math.log10(high)
        return self.start + (self.end - self.start) * (v - low) / (high - low)

    def ticks(self, count: int) -> list[tuple[float, str]]:
        """About `count` round values on the axis, with their text."""
        if self.log and self.high / self.low >= 10:
            return decades(self.low, self.high, count)
        return [(v, tick_text(v)) for v in steps(self.low, self.high, count)]


def steps(low: float, high: float, count: int) -> list[float]:
    """Multiples of a round step between low and high, about `count` of them."""
    rough = (high - low) / max(count, 1)
    power = 10.0 ** math.floor(math.log10(rough))
    step = next(s for s in STEPS if s * power >= rough * (1 - 1e-9)) * power
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    return [n * step for n in range(first, last + 1)]


def decades(low: float, high: float, count: int) -> list[tuple[float, str]]:
    """Powers of ten, and 2 and 5 times these if that gives not many more than `count`, else only at ends far from them.

    All are written out where each is short, else all raised except 1 to 50."""
    first, last = math.ceil(math.log10(low) - 1e-9), math.floor(math.log10(high) + 1e-9)
    stride = max(1, -(-(last - first + 1) // MAX_DECADES))
    exponents = range(first, last + 1, stride)
    powers = [(1, n) for n in exponents]
    multiples = [(m, n) for n in range(first - 1, last + 1) for m in (2, 5) if low <= m * 10.0**n <= high]
    if stride > 1 or len(powers) + len(multiples) > count + MAX_EXTRA_TICKS:
        gap = MIN_END_GAP * math.log10(high / low)
        ends = (multiples[0], multiples[-1]) if stride == 1 and powers and multiples else ()
        multiples = [(m, n) for m, n in ends if not first - gap < math.log10(m) + n < last + gap]
    parts = [*powers, *multiples]
    short = all(-4 <= n <= 4 for _, n in parts)
    return sorted((m * 10.0**n, _decade_text(m, n, short)) for m, n in parts)


def _decade_text(multiple: int, exponent: int, short: bool) -> str:
    """The number of a tick, a multiple of a power of ten."""
    if short or exponent in (0, 1):
        return tick_text(multiple * 10.0**exponent)
    return power_of_ten(exponent) if multiple == 1 else f"{multiple}·{power_of_ten(exponent)}"


def tick_text(value: float) -> str:
    """The number of a tick: at most six digits, a true minus, powers of ten raised."""
    return number(value, TICK_DIGITS)


class Scans(NamedTuple):
    """Even values from zero to the last."""

    step: float
    last: float


def scans_of(panel: Panel) -> Scans | None:
    """Step and last value of the even grid from zero on which the points of all lines lie; None where there is none."""
    columns = [np.asarray(mark.x, float) for mark in panel.marks if isinstance(mark, Line)]
    x = np.unique(np.concatenate(columns or [np.zeros(0)]))
    if panel.x.scale == "log" or len(x) < MIN_SCANS or x[0] < 0:
        return None
    step = float(x[-1] / np.round(x[-1] / np.diff(x).min()))
    even = np.abs(x / step - np.round(x / step)).max() < 1e-6 and x[0] <= MIN_SCANS * step
    is_short = abs(float(f"{step:.3g}") - step) < 1e-9 * step  # few digits write it
    return Scans(step, float(x[-1])) if even and is_short else None


def scan_ticks(scans: Scans, intervals: int) -> list[tuple[float, str]]:
    """Ticks from zero at every few scans, and at the last scan, in about so many intervals.

    There may be one interval more, or down to half as many, if all intervals are then equally long."""
    count = round(scans.last / scans.step)
    strides = [m * 10**p for p in range(9) for m in (1, 2, 3, 4, 5)]
    divisors = [n for n in strides if count % n == 0 and intervals / 2 <= count / n <= intervals + 1]
    stride = (divisors or [n for n in strides if count / n <= intervals])[0]
    numbers = list(range(0, count + 1, stride))
    if last_gap := count - numbers[-1]:
        numbers = [*(numbers[:-1] if last_gap < MIN_LAST_GAP * stride and len(numbers) > 1 else numbers), count]
    return [(n * scans.last / count, tick_text(n * scans.last / count)) for n in numbers]


class HeatScale(NamedTuple):
    """Least and largest value of the maps that share their colours, and whether the colours are logarithmic.

    least_loss: of shares near one, half the least difference from one, to which the colours are logarithmic in that
    difference; else zero."""

    low: float
    high: float
    log: bool
    least_loss: float = 0.0

    def loss_decades(self, values: ArrayLike) -> np.ndarray:
        """How many decades shares are from one."""
        return -np.log10(np.maximum(1 - np.asarray(values, float), 0) + self.least_loss)

    def share(self, decades: ArrayLike) -> np.ndarray:
        """The shares that are so many decades from one."""
        return 1 + self.least_loss - 10.0 ** -np.asarray(decades, float)

    def loss_ticks(self) -> tuple[tuple[float, str], ...]:
        """Ticks of a bar of such colours."""
        values = (0.0, 0.5, *(1 - 10.0**-n for n in range(1, MAX_DECADES)), 1.0)
        return tuple(
            (v, tick_text(v)) for v in values if self.low <= v <= min(self.high, 1 - self.least_loss) or v == 1
        )


def heat_scales(panels: Sequence[Panel]) -> dict[tuple[str, str], HeatScale]:
    """The colour scales of maps by the label of their bar and their group."""
    maps = [mark for panel in panels for mark in panel.marks if isinstance(mark, Heat)]
    groups: dict[tuple[str, str], list[np.ndarray]] = {}
    for heat in maps:
        groups.setdefault((heat.label, heat.group), []).append(heat.values)
    return {key: _heat_scale(values) for key, values in groups.items()}


def _heat_scale(maps: Sequence[np.ndarray]) -> HeatScale:
    values = np.concatenate([np.zeros(0), *map(np.ravel, maps)])
    values = values[np.isfinite(values)]
    low, high = (float(values.min()), float(values.max())) if values.size else (0.0, 1.0)
    if values.size and low >= 0 and MIN_HIGH_SHARE <= high <= 1 and np.median(values) > MIN_HIGH_SHARE:
        losses = 1 - values[values < 1]
        return HeatScale(low, high, False, float(losses.min()) / 2 if losses.size else 0.0)
    return HeatScale(low, high, bool(low > 0 and high > WIDE_RATIO * low))

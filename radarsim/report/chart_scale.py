"""Axes of a page's charts: from values to places, limits and ticks."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from radarsim.language import power_of_ten
from radarsim.report.drawing import Axis
from radarsim.report.text import number

MARGIN = {"x": 0.02, "y": 0.06}  # of the span of the data, on either side
STEPS = (1.0, 2.0, 2.5, 5.0, 10.0)
TICK_DIGITS = 6
WIDE = 20.0  # largest over least value of maps from which their colours go by the logarithm
FURTHER = 3  # ticks more than wanted that a logarithmic axis may have
MOST_DECADES = 7  # labelled on a logarithmic axis


@dataclass(frozen=True)
class Scale:
    """A linear or logarithmic axis from `low` to `high` over the places `start` to `end`."""

    log: bool
    low: float
    high: float
    start: float
    end: float

    def place(self, values: ArrayLike) -> np.ndarray:
        """Places of values; not-a-number where a value has none."""
        v = np.asarray(values, dtype=float)
        low, high = self.low, self.high
        if self.log:
            with np.errstate(divide="ignore", invalid="ignore"):
                v = np.log10(np.where(v > 0, v, np.nan))
            low, high = math.log10(low), math.log10(high)
        return self.start + (self.end - self.start) * (v - low) / (high - low)

    def ticks(self, wanted: int) -> list[tuple[float, str]]:
        """About `wanted` round values inside the axis, with their text."""
        if self.log and self.high / self.low >= 10:
            return decades(self.low, self.high, wanted)
        return [(v, tick_text(v)) for v in steps(self.low, self.high, wanted)]


def scale(axis: Axis, values: Sequence[np.ndarray], which: str, start: float, end: float) -> Scale:
    """The scale of an axis for the data of its panel: limits where given, else the data with a margin."""
    log = axis.scale == "log"
    parts = [np.ravel(np.asarray(v, dtype=float)) for v in values]
    v = np.concatenate(parts) if parts else np.zeros(0)
    v = v[np.isfinite(v) & ((v > 0) | (not log))]
    low, high = (float(v.min()), float(v.max())) if v.size else ((1.0, 10.0) if log else (0.0, 1.0))
    a, b = (math.log10(low), math.log10(high)) if log else (low, high)
    pad = MARGIN[which] * (b - a)
    if pad == 0:
        pad = 0.5 if log else 0.5 * abs(a) or 0.5
    a, b = a - pad, b + pad
    low, high = (10.0**a, 10.0**b) if log else (a, b)
    given = axis.limits
    low, high = low if given[0] is None else given[0], high if given[1] is None else given[1]
    if not low < high:
        high = low + 1.0 if not log else 10.0 * low
    return Scale(log, low, high, start, end)


def steps(low: float, high: float, wanted: int) -> list[float]:
    """Multiples of a round step between low and high."""
    rough = (high - low) / max(wanted, 1)
    power = 10.0 ** math.floor(math.log10(rough))
    step = next(s for s in STEPS if s * power >= rough * (1 - 1e-9)) * power
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    return [n * step for n in range(first, last + 1)]


def decades(low: float, high: float, wanted: int) -> list[tuple[float, str]]:
    """Powers of ten, and 2 and 5 times as well where these are not many more than wanted."""
    first, last = math.ceil(math.log10(low) - 1e-9), math.floor(math.log10(high) + 1e-9)
    stride = max(1, -(-(last - first + 1) // MOST_DECADES))
    ticks = list(
        zip((10.0**n for n in range(first, last + 1, stride)), powers(range(first, last + 1, stride)), strict=True)
    )
    fine = [m * 10.0**n for n in range(first - 1, last + 1) for m in (2, 5) if low <= m * 10.0**n <= high]
    if stride > 1 or len(ticks) + len(fine) > wanted + FURTHER:
        return ticks
    return sorted([*ticks, *((v, tick_text(v)) for v in fine)])


def powers(exponents: Sequence[int]) -> list[str]:
    """Powers of ten, all in figures where each is short, else all raised but 1 and 10."""
    short = all(-4 <= n <= 4 for n in exponents)
    return [tick_text(10.0**n) if short or n in (0, 1) else power_of_ten(n) for n in exponents]


def tick_text(value: float) -> str:
    """A tick's number: at most six digits, a true minus, powers of ten raised."""
    return number(value, TICK_DIGITS)


def heat_scale(parts: Sequence[np.ndarray]) -> tuple[float, float, bool]:
    """Least and largest of the values of maps side by side, and whether their colours go by the logarithm."""
    values = np.concatenate([np.zeros(0), *map(np.ravel, parts)])
    values = values[np.isfinite(values)]
    low, high = (float(values.min()), float(values.max())) if values.size else (0.0, 1.0)
    return low, high, bool(low > 0 and high > WIDE * low)


def equal(x: Scale, y: Scale) -> tuple[Scale, Scale]:
    """Two linear scales with as many units to a place each: the one with the smaller span sees more, to both sides."""
    per_place = max((one.high - one.low) / abs(one.end - one.start) for one in (x, y))

    def widened(one: Scale) -> Scale:
        more = (per_place * abs(one.end - one.start) - (one.high - one.low)) / 2
        return replace(one, low=one.low - more, high=one.high + more)

    return widened(x), widened(y)

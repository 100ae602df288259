"""What a paper's words leave of a number: the values, and how finely the words give them. See docs/verdicts.md.

Every function takes the words alone; none knows what was measured.
"""

import math
from typing import NamedTuple

from radarsim.report.claims.rule import ABOUT, GRID, LIMIT, MATERIAL, PRINT, SAME


class Range(NamedTuple):
    """The values that the words say, ends included, the words, their margin, and the kind of rule that gives it.

    strict is the range of the rule of version 0.1, for `old_verdict`.
    """

    lo: float
    hi: float
    words: str
    margin: float
    kind: str
    strict: tuple[float, float]


def digit(text: str) -> float:
    """The unit of a printed number's last digit."""
    return 10.0 ** -len(text.partition(".")[2])


def printed(text: str, step: float | None = None) -> Range:
    """A printed number; step: that of which it is a multiple where numbers are read off a graph. Default: its digit."""
    return _inclusive(text, text, text, step, PRINT)


def between(low: str, high: str, step: float | None = None) -> Range:
    """A printed range, both its ends as `printed`."""
    return _inclusive(low, high, f"{low} to {high}", step, PRINT)


def _inclusive(low: str, high: str, words: str, step: float | None, kind: str) -> Range:
    half = max(digit(low), digit(high)) / 2
    margin = half if step is None else step / 2
    strict = (float(low) - digit(low) / 2, float(high) + digit(high) / 2)
    return Range(float(low), float(high), f"{words} ± {margin:g}", margin, kind, strict)


def about(low: str, high: str | None = None, margin: float | None = None, kind: str = ABOUT) -> Range:
    """A positive number or range with "about"; margin where the paper or its grid is coarser than 10 %."""
    high = high or low
    words = f"about {low}" + (f" to {high}" if high != low else "")
    wide = 0.1 * float(high) if margin is None else margin
    strict = (0.9 * float(low), 1.1 * float(high))
    return Range(float(low), float(high), f"{words} ± {wide:g}", wide, kind, strict)


def _half_digit(value: float) -> float:
    return digit(f"{value:.12f}".rstrip("0").rstrip(".")) / 2


def above(value: float, margin: float | None = None) -> Range:
    """More than a value. Over zero: better, a difference of at least the margin, 1 % where none is given."""
    kind, wide = _one_sided(value, margin)
    return Range(math.nextafter(value, math.inf), math.inf, f"> {value:g}", wide, kind, (value, math.inf))


def below(value: float, margin: float | None = None) -> Range:
    """Less than a value. Under zero: better, as in `above`."""
    kind, wide = _one_sided(value, margin)
    return Range(-math.inf, math.nextafter(value, -math.inf), f"< {value:g}", wide, kind, (-math.inf, value))


def _one_sided(value: float, margin: float | None) -> tuple[str, float]:
    if value == 0:
        return MATERIAL, 1.0 if margin is None else margin
    return LIMIT, _half_digit(value) if margin is None else margin


def at_most(value: float, margin: float | None = None) -> Range:
    """No more than a value."""
    wide = _half_digit(value) if margin is None else margin
    return Range(-math.inf, value, f"≤ {value:g}", wide, LIMIT, (-math.inf, value))


def at_least(value: float, margin: float | None = None) -> Range:
    """No less than a value."""
    wide = _half_digit(value) if margin is None else margin
    return Range(value, math.inf, f"≥ {value:g}", wide, LIMIT, (value, math.inf))


def greater(margin: float = 0.01) -> Range:
    """A ratio of two σ over one: the first is the worse."""
    return above(1.0, margin)._replace(kind=MATERIAL)


def less(margin: float = 0.01) -> Range:
    """A ratio of two σ under one: the first is the better."""
    return below(1.0, margin)._replace(kind=MATERIAL)


def within(low: float, high: float, margin: float = 0.5) -> Range:
    """From low to high as they stand: counts of scans (half a scan is their margin), shares."""
    words = f"{low:g}" if low == high else f"{low:g} to {high:g}"
    return Range(low, high, words, margin, PRINT, (low, high))


def same(value: float = 0.0, margin: float = 1.0, strict: float | None = None) -> Range:
    """What coincides: a value to within a margin, 1 % of σ."""
    old = margin if strict is None else strict
    return Range(value, value, f"{value:g} ± {margin:g}", margin, SAME, (value - old, value + old))


def kept(margin: float = 1.0, strict: float = 0.5) -> Range:
    """No loss, in % of σ: a gain, or a loss within the margin."""
    return Range(0.0, math.inf, f"≥ 0 ± {margin:g}", margin, SAME, (-strict, math.inf))


def on_grid(low: float, high: float, step: float, strict: tuple[float, float]) -> Range:
    """A time, or a ratio of times, no finer than the grid on which it is read."""
    words = f"{low:g}" if low == high else f"{low:g} to {high:g}"
    return Range(low, high, f"{words} ± {step:g}", step, GRID, strict)

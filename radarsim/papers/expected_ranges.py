"""Ranges and margins from a paper's words; these functions see the words alone, never a measurement."""

import inspect
import math
from contextlib import suppress
from typing import Any, NamedTuple

from radarsim.papers.verdict_rule import ABOUT, GRID, LIMIT, MATERIAL, PRINT, SAME, SAMPLE, Z95
from radarsim.report.statistics import student

RANGE_NAMES = (
    *("printed", "between", "about", "above", "below", "at_most", "at_least", "greater", "less", "within", "same"),
    *("no_loss", "on_grid"),
)


class ExpectedRange(NamedTuple):
    """The range of the words, ends included, the words, their margin, and the kind of rule that gives it.

    strict is the range of the rule of version 0.1, for `old_verdict`."""

    lo: float
    hi: float
    words: str
    margin: float
    kind: str
    strict: tuple[float, float]


def last_digit_unit(text: str) -> float:
    """The unit of a printed number's last digit."""
    return 10.0 ** -len(text.partition(".")[2])


def printed_number(text: str) -> float:
    """A number as it is printed. Raises ValueError for any other text."""
    with suppress(ValueError):
        if math.isfinite(number := float(text)):
            return number
    raise ValueError("must be a number as it is printed, such as 0.374")


def printed(
    text: str,
    step: float | None = None,
    runs: int | None = None,
    variance: float | None = None,
    se: float | None = None,
) -> ExpectedRange:
    """A printed number; step: its resolution where numbers are read off a graph. Default: its last digit.

    Of a number that is itself a mean over simulated runs: how many, and the variance over the runs, or its standard
    error se. Its margin is then the half-width of its own 95 % interval, rounding included; the sampling error of what
    is measured is in the interval that is judged, so that both samples count. Raises ValueError where these do not
    fit together."""
    if runs is variance is se is None:
        return _inclusive_range(text, text, text, step, PRINT)
    factor, error = _printed_standard_error(runs, variance, se)
    rounding = (last_digit_unit(text) if step is None else step) / math.sqrt(12)  # of a number within half a step
    margin = factor * math.hypot(error, rounding)
    value = printed_number(text)
    return ExpectedRange(value, value, f"{text} ± {margin:.2g}", margin, SAMPLE, (value - margin, value + margin))


def _printed_standard_error(runs: int | None, variance: float | None, se: float | None) -> tuple[float, float]:
    """Half-width of a 95 % interval in standard errors, and the standard error of a printed mean over runs."""
    if se is not None:
        if runs is not None or variance is not None:
            raise ValueError("takes se alone, or runs and variance")
        if not 0 < se < math.inf:
            raise ValueError("se must be > 0")
        return Z95, float(se)
    if runs is None or variance is None:
        raise ValueError("needs both runs and variance, the variance over the runs")
    if runs < 2 or not 0 < variance < math.inf:
        raise ValueError("needs at least 2 runs, and a variance > 0")
    return float(student(runs - 1)), math.sqrt(variance / runs)


def between(low: str, high: str, step: float | None = None) -> ExpectedRange:
    """A printed range, both its ends as `printed`."""
    return _inclusive_range(low, high, f"{low} to {high}", step, PRINT)


def _inclusive_range(low: str, high: str, words: str, step: float | None, kind: str) -> ExpectedRange:
    half = max(last_digit_unit(low), last_digit_unit(high)) / 2
    margin = half if step is None else step / 2
    bottom, top = printed_number(low), printed_number(high)
    strict = (bottom - last_digit_unit(low) / 2, top + last_digit_unit(high) / 2)
    return ExpectedRange(bottom, top, f"{words} ± {margin:g}", margin, kind, strict)


def about(low: str, high: str | None = None, margin: float | None = None, kind: str = ABOUT) -> ExpectedRange:
    """A positive number or range with "about"; margin where the paper or its grid is coarser than 10 %."""
    high = high or low
    words = f"about {low}" + (f" to {high}" if high != low else "")
    bottom, top = printed_number(low), printed_number(high)
    wide = 0.1 * top if margin is None else margin
    strict = (0.9 * bottom, 1.1 * top)
    return ExpectedRange(bottom, top, f"{words} ± {wide:g}", wide, kind, strict)


def _half_last_digit(value: float) -> float:
    return last_digit_unit(f"{value:.12f}".rstrip("0").rstrip(".")) / 2


def above(value: float, margin: float | None = None) -> ExpectedRange:
    """More than a value. Over zero: better, a difference of at least the margin, by default 1 %."""
    kind, wide = _one_sided_margin(value, margin)
    return ExpectedRange(math.nextafter(value, math.inf), math.inf, f"> {value:g}", wide, kind, (value, math.inf))


def below(value: float, margin: float | None = None) -> ExpectedRange:
    """Less than a value. Under zero: better, as in `above`."""
    kind, wide = _one_sided_margin(value, margin)
    return ExpectedRange(-math.inf, math.nextafter(value, -math.inf), f"< {value:g}", wide, kind, (-math.inf, value))


def _one_sided_margin(value: float, margin: float | None) -> tuple[str, float]:
    if value == 0:
        return MATERIAL, 1.0 if margin is None else margin
    return LIMIT, _half_last_digit(value) if margin is None else margin


def at_most(value: float, margin: float | None = None) -> ExpectedRange:
    """No more than a value."""
    wide = _half_last_digit(value) if margin is None else margin
    return ExpectedRange(-math.inf, value, f"≤ {value:g}", wide, LIMIT, (-math.inf, value))


def at_least(value: float, margin: float | None = None) -> ExpectedRange:
    """No less than a value."""
    wide = _half_last_digit(value) if margin is None else margin
    return ExpectedRange(value, math.inf, f"≥ {value:g}", wide, LIMIT, (value, math.inf))


def greater(margin: float = 0.01) -> ExpectedRange:
    """A ratio of two σ over one: the first is the worse."""
    return above(1.0, margin)._replace(kind=MATERIAL)


def less(margin: float = 0.01) -> ExpectedRange:
    """A ratio of two σ under one: the first is the better."""
    return below(1.0, margin)._replace(kind=MATERIAL)


def within(low: float, high: float, margin: float = 0.5) -> ExpectedRange:
    """From low to high as they stand: counts of scans (half a scan is their margin), shares."""
    words = f"{low:g}" if low == high else f"{low:g} to {high:g}"
    return ExpectedRange(low, high, words, margin, PRINT, (low, high))


def same(value: float = 0.0, margin: float = 1.0, strict: float | None = None) -> ExpectedRange:
    """Coincidence: a value to within a margin, by default 1 % of σ."""
    old = margin if strict is None else strict
    return ExpectedRange(value, value, f"{value:g} ± {margin:g}", margin, SAME, (value - old, value + old))


def no_loss(margin: float = 1.0, strict: float = 0.5) -> ExpectedRange:
    """No loss, in % of σ: a gain, or a loss within the margin."""
    return ExpectedRange(0.0, math.inf, f"≥ 0 ± {margin:g}", margin, SAME, (-strict, math.inf))


def on_grid(low: float, high: float, step: float, strict: tuple[float, float]) -> ExpectedRange:
    """A time, or a ratio of times, no finer than the grid on which it is read."""
    words = f"{low:g}" if low == high else f"{low:g} to {high:g}"
    return ExpectedRange(low, high, f"{words} ± {step:g}", step, GRID, strict)


def with_further_arguments(expected: Any) -> Any:
    """A range with arguments beside its own, `{printed: "0.374", runs: 100, variance: 0.015}`, as one call."""
    names = [name for name in expected if name in RANGE_NAMES] if isinstance(expected, dict) else []
    if len(names) != 1 or len(expected) < 2:
        return expected
    (name,) = names
    values = expected[name] if isinstance(expected[name], tuple) else (expected[name],)
    own_arguments = dict(zip(inspect.signature(globals()[name]).parameters, values, strict=False))
    return {name: own_arguments | {key: value for key, value in expected.items() if key != name}}

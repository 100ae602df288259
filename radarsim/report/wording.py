"""Numbers, units and counts in sentences, and text that is safe to print. Loads no NumPy."""

import math
import re
import sys
from collections.abc import Iterable, Sequence

from radarsim.language.numerals import numeral, power_of_ten
from radarsim.language.translate import term, tr

POWERS = str.maketrans("234", "²³⁴")  # of units in tables, as people write them
TRANSLATED_UNITS = (  # units that a language may write differently
    *(term("m"), term("m²"), term("s"), term("m/s"), term("m/s²"), term("rad"), term("rad/s"), term("rad/s²")),
    *(term("Hz"), term("Hz/s"), term("Hz/s²"), term("Hz/s³"), term("Hz/s⁴"), term("km"), term("°/s"), term("°/s²")),
)
NBSP = "\N{NO-BREAK SPACE}"
SPACE_BEFORE_UNIT = re.compile(  # the space between a number and its unit, in any language spoken here; and around ±
    r"(?<=\d) (?=(?:%|°|k?m|к?м|m?s|м?с|[kM]?Hz|[кМ]?Гц|dB|дБ|rad|рад)(?:[/²³⁴]\S*)?(?:\W|$))"
    r"|(?<=\S) (?=± )|(?<=±) (?=\d)"
)
SPACES = "\N{NO-BREAK SPACE}\N{NARROW NO-BREAK SPACE}"  # which a language may put into numbers
MAX_PLAIN_DIGITS = 6  # digits before the point that are still written out
MAX_SHARE_DIGITS = 12  # digits of a share near one
MIN_PLAIN_EXPONENT = -3  # of ten, from which a value with its interval is still written out
MAX_MORE_DECIMALS = 3  # of a value with its interval, where fewer do not tell them apart
MIN_SHOWN_WIDTH = 1e-4  # of the power of ten below a value: a narrower interval is the rounding of numbers
NEARLY_ONE = 1e-3  # under one, from which more digits are written


def plural(count: int, noun: str) -> str:
    """1 case, 2 cases."""
    return f"{count} {noun}{'s' * (count != 1)}"


def number(value: float, digits: int = 4) -> str:
    """A number for people at so many digits: 25600, 0.00012, 1.2·10⁻⁷, ∞; nothing for not-a-number.

    A number under one is never rounded to one.

    >>> [number(one) for one in (25600.0, 1e10, 2.56e7, -0.00005, 0.25, 0.99999)]
    ['25,600', '10¹⁰', '2.56·10⁷', '−5·10⁻⁵', '0.25', '0.99999']
    """
    if math.isnan(value):
        return ""
    if math.isinf(value):
        return "∞" if value > 0 else "−∞"
    if 0 < abs(value) < sys.float_info.min:
        digits = 1  # the least number above zero, an end that a claim excludes, has no more
    if 0 < 1 - value < 10.0**-digits:
        digits = min(-math.floor(math.log10(1 - value)), MAX_SHARE_DIGITS)
    mantissa, _, exponent = f"{value:.{digits - 1}e}".partition("e")
    if value == 0 or -4 <= int(exponent) < MAX_PLAIN_DIGITS:
        return numeral(f"{float(f'{value:.{digits}g}') + 0.0:.{max(digits, 10)}g}")
    short = f"{float(mantissa):g}"
    raised = power_of_ten(int(exponent))
    return raised if short == "1" else f"−{raised}" if short == "-1" else f"{numeral(short)}·{raised}"


def interval(low: str, high: str) -> str:
    """The ends of an interval in brackets, with the language's separator of decimal numbers."""
    return tr("[{low}, {high}]", low=low, high=high)


def estimate(values: Iterable[float], unit: str = "", form: str = ".4g") -> str:
    """A value with its unit and its 95 % interval, from the value and the two ends; without an interval where the ends
    are not known.

    All three have as many decimals: so many that the largest has the digits of `form`, and the interval's width one;
    more where an end would look like 0, or a number a little under 1 like 1.

    >>> estimate((12.34, 12.0, 12.61), "m", ".3g"), estimate((6.983, 1.48, 12.8), "%", "+.3g")
    ('12.3 m [12.0, 12.6]', '+7.0 % [+1.5, +12.8]')
    """
    numbers = tuple(values)
    if all(math.isnan(end) for end in numbers[1:]):
        texts = [_text_unless_one(numbers[0], format(numbers[0], form))]
    else:
        texts = [numeral(text) for text in _aligned(numbers, form)]
    value, *ends = (text.replace("inf", "∞") for text in texts)
    with_unit_text = " ".join(filter(None, (value, unit)))
    return f"{with_unit_text} {interval(*ends)}" if len(ends) else with_unit_text


def _aligned(numbers: tuple[float, ...], form: str) -> list[str]:
    """A value and its ends with equally many decimals; very small and large ones each with a power of ten."""
    flags, digits, kind = re.fullmatch(r"([+,]*)\.(\d+)([fg])", form).groups()  # type: ignore[union-attr]
    exponent = max((math.floor(math.log10(abs(n))) for n in numbers if n and math.isfinite(n)), default=0)
    if kind == "g" and not MIN_PLAIN_EXPONENT <= exponent < MAX_PLAIN_DIGITS:
        mantissa = f"{flags.replace(',', '')}.{int(digits) - 1}e"
        return [format(number, mantissa if math.isfinite(number) and number else "g") for number in numbers]
    decimals = int(digits) if kind == "f" else int(digits) - 1 - exponent
    width = numbers[2] - numbers[1]
    if (
        kind == "g" and MIN_SHOWN_WIDTH * 10.0**exponent < width < math.inf
    ):  # one digit of the interval's width at least
        width_decimals = -math.floor(math.log10(width))
        decimals = max(decimals, min(width_decimals, decimals + MAX_MORE_DECIMALS))
    if decimals < 0:
        numbers, decimals = tuple(round(n, decimals) if math.isfinite(n) else n for n in numbers), 0
    for more in range(MAX_MORE_DECIMALS + 1):
        texts = [_fixed(number, f"{flags}.{decimals + more}f") for number in numbers]
        if not _are_blurred(numbers, texts):
            return texts
    return [_fixed(number, f"{flags}.{decimals}f") for number in numbers]


def _are_blurred(numbers: Sequence[float], texts: Sequence[str]) -> bool:
    """Whether rounding makes an end nought, or a number a little under one one."""
    read = [float(text.replace(",", "")) for text in texts]
    return any(number and not shown for number, shown in zip(numbers[1:], read[1:], strict=True)) or any(
        0 < 1 - number < NEARLY_ONE and shown == 1 for number, shown in zip(numbers, read, strict=True)
    )


def _fixed(number: float, form: str) -> str:
    """A number in a fixed format, without a minus before nought; 0 alone where nothing was counted."""
    text = format(number, form) if number else "0"
    return text if float(text.replace(",", "")) else text.removeprefix("-")


def _text_unless_one(value: float, text: str) -> str:
    """The text of a number; one with more digits where the number is a little under one and the text is one."""
    return number(value) if 0 < 1 - value < NEARLY_ONE and float(text) == 1 else numeral(text)


def share(value: float, low: float, high: float) -> str:
    """A share in per cent with its 95 % interval, with digits enough to distinguish the ends from each other, 0 and 100
    %; without one (NaN) the share alone.

    >>> share(100, 99.9962, 100), share(94.123, 93.9, 94.3), share(99.99, 99.9885, 99.9915)
    ('100 % [99.996, 100]', '94.12 % [93.90, 94.30]', '99.990 % [99.989, 99.992]')
    >>> share(99.9975, math.nan, math.nan), share(100, math.nan, math.nan)
    ('99.998 %', '100 %')
    """
    if math.isnan(low) or math.isnan(high):
        digits = next(n for n in range(4, MAX_SHARE_DIGITS + 1) if value == 100 or float(f"{value:.{n}g}") != 100)
        return f"{numeral(f'{value:.{digits}g}')} %"
    rounded, limits = [round(number, MAX_SHARE_DIGITS) for number in (value, low, high)], (0.0, 100.0)
    for digits in range(2, MAX_SHARE_DIGITS):
        texts = [f"{number:.{digits}f}" for number in rounded]
        is_blurred = any(
            (float(text) in limits) != (number in limits) for text, number in zip(texts, rounded, strict=True)
        )
        if (texts[1] != texts[2] or low == high) and not is_blurred:
            break
    value_text, *bounds = (
        numeral(f"{number:.0f}" if number in limits else text) for number, text in zip(rounded, texts, strict=True)
    )
    return f"{value_text} % {interval(*bounds)}"


def unit(name: str) -> str:
    """A unit of a table as people write it: m/s² of m/s2, nothing of 1."""
    return {"hz": "Hz", "1": ""}.get(name, name.translate(POWERS))


def with_unbroken_units(words: str) -> str:
    """Text in which a unit stays with its number, and a number with a ± before it.

    >>> with_unbroken_units("at 60 s: 12 % ± 3 m/s").replace(NBSP, "_")
    'at 60_s: 12_%_±_3_m/s'
    """
    return SPACE_BEFORE_UNIT.sub(NBSP, words)


def printable(text: str) -> str:
    """Text without control characters: names in a config must not control the terminal."""
    return "".join(c if c.isprintable() or c in SPACES else "�" for c in text)


def list_numbers(numbers: Iterable[str]) -> str:
    """Numbers one after the other, separated by semicolons where the language writes a decimal comma."""
    return (", " if numeral("0.5") == "0.5" else f";{NBSP}").join(numbers)


def split_clauses(sentence: str) -> list[str]:
    """A sentence's parts between semicolons; one within brackets or between numbers (`list_numbers`) does not separate.

    >>> split_clauses("locked in 12 % [11; 13] (of 5; 6 lost); lost in 88 %")
    ['locked in 12 % [11; 13] (of 5; 6 lost)', 'lost in 88 %']
    """
    parts: list[str] = []
    for part in sentence.split("; "):
        if parts and any(parts[-1].count(opening) > parts[-1].count(closing) for opening, closing in ("[]", "()")):
            parts[-1] += f"; {part}"
        else:
            parts.append(part)
    return parts


def significant_digits(value: float, form: str = "#.4g") -> str:
    """A number in a format, of four digits, for sentences: no trailing point, no minus zero, a true minus."""
    text = format(value, form).removesuffix(".")
    if float(text) == 1 and "+" not in form:
        return _text_unless_one(value, text)
    return numeral(text if float(text) else text.removeprefix("-"))


def format_number(value: float, form: str = ".6g") -> str:
    """A number in words."""
    return significant_digits(value, form)


def with_unit(value: float, name: str) -> str:
    """A number with its unit, in words."""
    return f"{format_number(value)} {tr(name)}".rstrip()


def format_if_known(value: float, form: str = "#.4g", after: str = "") -> str:
    """`figures` of a number and its suffix, or nothing for NaN."""
    return significant_digits(value, form) + after if value == value else ""


SINCE_TEXTS = {
    "manoeuvre": term("from the manoeuvre on ({t_s:g} s)"),
    "settled": term("once settled ({t_s:g} s)"),
    "last": term("at the last scan, not settled before"),
}


def since(k: int, t_s: float, reason: str) -> str:
    """From which scan on errors count, in words: the fields of `studies.counted_scans.CountedScans`."""
    return tr("from the first scan on") if k == 1 else tr(SINCE_TEXTS[reason], t_s=t_s)

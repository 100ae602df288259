"""Numbers and powers of ten in the notation of the language in use.

Whole parts of five and more digits are written in groups of three, shorter ones are not. The catalogue says under the
context "number" how its language writes the point and the separator of thousands."""

import re

from radarsim.language.current import ENGLISH, current_language, translations

SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
POWER = re.compile(r"(?P<mantissa>\d[\d.,]*)e(?P<exponent>[+-]\d+)")  # of a number in Python's form
FOUR_DIGITS = re.compile(r"(?<![\d.,])(\d),(\d{3})(?![\d,])")  # 4,000, which is written 4000
LONG_WHOLE_PART = re.compile(r"(?<![\w.,])\d{5,}(?!\w)")
NUMBER = "number"  # context of the point and of the separator of thousands


def numeral(text: str) -> str:
    """An English number (1,234.5) in the current language's notation, with a true minus and raised powers of ten.

    >>> [numeral(one) for one in ("-0.5", "6.678e+09", "1e-05", "4,000", "12345.678")]
    ['−0.5', '6.678·10⁹', '10⁻⁵', '4000', '12,345.678']
    """
    if "e" in text:
        text = POWER.sub(_format_power, text)
    text = group_digits(text)
    if current_language() == ENGLISH:
        return text.replace("-", "−")
    catalogue_of_language = translations(current_language())
    return text.translate({ord(mark): catalogue_of_language.pgettext(NUMBER, mark) for mark in ".,"} | {ord("-"): "−"})


def group_digits(text: str) -> str:
    """An English text with its numbers in groups of three digits from five digits on.

    >>> group_digits("0 of 100000, 1,234.5")
    '0 of 100,000, 1234.5'
    """
    return LONG_WHOLE_PART.sub(lambda match: f"{int(match[0]):,}", FOUR_DIGITS.sub(r"\1\2", text))


def power_of_ten(exponent: int) -> str:
    """10⁻³ of −3."""
    return f"10{str(exponent).translate(SUPERSCRIPT)}"


def _format_power(match: re.Match[str]) -> str:
    power = power_of_ten(int(match["exponent"]))
    return power if match["mantissa"] == "1" else f"{match['mantissa']}·{power}"

"""How sentences word the gain of one filter over another on the same noise, and what equal filters leave open."""

import numpy as np

from radarsim.language.numerals import numeral
from radarsim.language.translate import tr
from radarsim.report import exact_marks, wording
from radarsim.report.compared_value import ComparedValue

SINGLE = 1e-3  # per cent: width of the interval of a gain that is nought but for rounding to single precision
EQUAL = 1e-9  # per cent of an exact gain that is nought but for rounding
MIN_EXACT_GAIN = 0.05  # per cent: what is not nil to one decimal
FACTOR_LOSS = 100.0  # per cent of loss from which it is given as a factor
RULE_OF_THREE = 3.0  # what occurs in none of n realisations has a probability under 3/n, with 95 % confidence


def is_equal(gain: ComparedValue) -> bool:
    """Whether two filters have the same errors, but for rounding, in every realisation."""
    value, low, high = map(float, gain.estimate)
    return abs(value) < EQUAL if gain.is_exact else bool(abs(value) < SINGLE and high - low < SINGLE)


def unseen_text(n: float) -> str:
    """What two filters that are equal in all of n realisations may still differ in."""
    return tr(
        "identical in all {n:,} realisations: a difference in fewer than {share} % would not have shown",
        n=int(n),
        share=numeral(f"{100 * RULE_OF_THREE / max(n, RULE_OF_THREE):.2g}"),
    )


def comparison_text(gain: ComparedValue) -> str:
    """A gain as a comparison of σ: lower, higher, or not significantly either."""
    rounded = gain.mapped(lambda percent: round(percent, 1) + 0.0)
    if gain.is_exact and abs(gain.value) < MIN_EXACT_GAIN:
        return exact_marks.exact_text(tr("less than 0.1 % lower or higher"))
    if not any(rounded.estimate):
        return tr("less than 0.1 % lower or higher")
    if not gain.is_exact and gain.estimate.lo <= 0 <= gain.estimate.hi:
        return tr("not significantly lower or higher (gain {gain})", gain=gain.text("%", ".1f"))
    if gain.value < -FACTOR_LOSS:
        ratio = gain.mapped(lambda percent: 1 - percent / 100)
        return tr("higher by a factor of {factor}", factor=ratio.text(form=".3g"))
    if gain.value < 0:
        return tr("{percent} higher", percent=gain.mapped(lambda percent: 0.0 - percent).text("%", ".1f"))
    return tr("{percent} lower", percent=gain.text("%", ".1f"))


def percent_text(gain: ComparedValue, n: float) -> str:
    """A gain in per cent with its interval; of filters that are equal in all of n realisations what was not seen."""
    return unseen_text(n) if is_equal(gain) and not gain.is_exact else number_text(gain)


def number_text(gain: ComparedValue) -> str:
    """A gain in per cent with its interval to a thousandth, its ends outward; 0 % of equal filters."""
    if is_equal(gain):
        return exact_marks.exact_text("0 %") if gain.is_exact else "0 %"
    if gain.is_exact:
        return gain.text("%", ".3g")
    value, low, high = map(float, gain.estimate)
    rounded = np.round(value, 3), np.floor(1e3 * low) / 1e3, np.ceil(1e3 * high) / 1e3
    return wording.estimate((number + 0.0 for number in rounded), "%", ".3g")

"""The answer's sentences on a gain with each filter at its best process noise, beside that at the same one for both.

A paper asks for the second; whoever chooses a filter for a radar, for the first."""

from collections.abc import Callable, Collection, Iterator, Mapping
from typing import Any, NamedTuple

from radarsim.language.numerals import numeral
from radarsim.language.translate import join_names, quote_name, term, tr
from radarsim.report.sentences import Sentence
from radarsim.report.statistics import Estimate

MEASURE_TEXTS = {
    "worst": term("{component} at worst"),
    "mean": term("{component} on average"),
    "last": term("{component} at the last scan"),
    "steady": term("{component} once settled"),
    "at": term("{component} at {t_s:g} s"),
}


class NoiseKey(NamedTuple):
    """A key of process noise in sentences: its letter, or its name; and how a value of it is written."""

    symbol: str
    value_text: Callable[[Any], str]


class FilterChoices(NamedTuple):
    """A filter with several values of its process noise: σ by value, its ends the same where it is known, else of
    intervals that all hold at once; and the best values, of which there are several where noise or too little parts
    them, and none where no value settles in time."""

    name: str
    sigmas: Mapping[Any, Estimate]
    best: Collection[Any]

    @property
    def is_measured(self) -> bool:
        """Whether noise is in any σ."""
        return any(sigma.lo < sigma.hi for sigma in self.sigmas.values())

    @property
    def best_sigma(self) -> Estimate:
        """σ with any of the best values: the least, and the ends of all of them; of measured ones those of the least,
        which is under the end of each."""
        if self.is_measured:
            return Estimate(*(min(float(s[i]) for s in self.sigmas.values()) for i in range(3)))
        sigmas = [self.sigmas[value] for value in self.best]
        return Estimate(*(pick(float(s[i]) for s in sigmas) for i, pick in enumerate((min, min, max))))


def gain_sentences(
    subject: str,
    quantity: str,
    measure: str,
    key: NoiseKey,
    baseline: FilterChoices,
    others: Collection[FilterChoices],
    t_s: float = 0.0,
) -> list[Sentence]:
    """How much each of the others gains over the baseline in σ of a quantity; measure: over scans as, or at t_s, s."""
    what = tr(MEASURE_TEXTS[measure], component=tr("RMS error of the {quantity}", quantity=quantity), t_s=t_s)
    return [
        Sentence(
            tr(
                "{subject}, gain of {filter} over {baseline} in {what}{remark}: {clauses}.",
                subject=subject,
                what=what,
                filter=quote_name(other.name),
                baseline=quote_name(baseline.name),
                remark=f" ({tr('95 % intervals')})" if baseline.is_measured or other.is_measured else "",
                clauses="; ".join(_clauses(key, baseline, other)),
            )
        )
        for other in others
    ]


def _clauses(key: NoiseKey, baseline: FilterChoices, other: FilterChoices) -> Iterator[str]:
    is_measured = baseline.is_measured or other.is_measured
    unsettled = [quote_name(choices.name) for choices in (baseline, other) if not choices.best]
    if unsettled:
        yield tr("no {symbol} settles in time with {filters}", symbol=key.symbol, filters=join_names(unsettled))
    else:
        gain = _span_text(_gain(baseline.best_sigma, other.best_sigma), is_measured)
        yield tr("{gain} with each at its best {symbol}", gain=gain, symbol=key.symbol)
    gains = {
        value: _gain(baseline.sigmas[value], sigma) for value, sigma in other.sigmas.items() if value in baseline.sigmas
    }
    ends = dict.fromkeys(pick(gains, key=lambda value: gains[value].value) for pick in (min, max) if gains)
    form = term("{gain} at {value}") if is_measured else term("{gain} ({value})")
    texts = [tr(form, gain=_span_text(gains[value], is_measured), value=key.value_text(value)) for value in ends]
    if texts:
        gains_text = texts[0] if len(texts) == 1 else tr("{low} to {high}", low=texts[0], high=texts[1])
        yield tr("{gains} with the same {symbol} for both", symbol=key.symbol, gains=gains_text)


def _gain(baseline: Estimate, sigma: Estimate) -> Estimate:
    """The gain, per cent, with the ends that those of both σ allow."""
    ratios = sigma.value / baseline.value, sigma.hi / baseline.lo, sigma.lo / baseline.hi
    return Estimate(*(100 * (1 - float(ratio)) for ratio in ratios))


def _span_text(gain: Estimate, is_measured: bool) -> str:
    """A gain, or its span where its ends differ as they are shown: of D_M that are equally good, or of noise."""
    value, low, high = (numeral(f"{end:.1f}") for end in gain)
    if low == high:
        return tr("{value} %", value=value)
    if is_measured:
        return tr("{value} % ({low} … {high})", value=value, low=low, high=high)
    return tr("{low} to {high} %", low=low, high=high)

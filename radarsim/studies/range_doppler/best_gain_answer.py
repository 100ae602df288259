"""The answer's sentences on the gain of Doppler with each filter at its best D_M, beside that at one D_M for both.

The paper asks for the second; whoever chooses a filter for a radar, for the first."""

from collections.abc import Collection, Iterator, Mapping
from typing import NamedTuple

from radarsim.language.numerals import numeral
from radarsim.language.translate import term, tr
from radarsim.report import key_labels
from radarsim.report.sentences import Sentence
from radarsim.report.statistics import Estimate

MEASURE_TEXTS = {
    "worst": term("{component} at worst"),
    "mean": term("{component} on average"),
    "last": term("{component} at the last scan"),
    "steady": term("{component} once settled"),
}
COMPONENT_TEXTS = {
    "sigma_r": term("σ of the range"),
    "sigma_Vr": term("σ of the radial velocity"),
    "sigma_ar": term("σ of the radial acceleration"),
}


class FilterChoices(NamedTuple):
    """A filter with several D_M, (m/s³)²: σ by D_M, its ends the same where it is known, else of intervals that all
    hold at once; and the D_M that are the best, of which there are several where noise or too little parts them."""

    name: str
    sigmas: Mapping[float, Estimate]
    best: Collection[float]

    @property
    def is_measured(self) -> bool:
        """Whether noise is in any σ."""
        return any(sigma.lo < sigma.hi for sigma in self.sigmas.values())

    @property
    def best_sigma(self) -> Estimate:
        """σ with any of the best D_M: the least, and the ends of all of them."""
        sigmas = [self.sigmas[variance] for variance in self.best]
        return Estimate(*(pick(float(s[i]) for s in sigmas) for i, pick in enumerate((min, min, max))))


def gain_sentences(
    subject: str, error: str, measure: str, baseline: FilterChoices, others: Collection[FilterChoices]
) -> list[Sentence]:
    """How much each of the others gains over the baseline; error: which σ, measure: over scans as."""
    what = tr(MEASURE_TEXTS[measure], component=tr(COMPONENT_TEXTS[error]))
    return [
        Sentence(
            tr(
                "{subject}, gain in {what}, {filter} over {baseline}: {clauses}.",
                subject=subject,
                what=what,
                filter=other.name,
                baseline=baseline.name,
                clauses="; ".join(_clauses(baseline, other)),
            )
        )
        for other in others
        if baseline.best and other.best
    ]


def _clauses(baseline: FilterChoices, other: FilterChoices) -> Iterator[str]:
    is_measured = baseline.is_measured or other.is_measured
    gain = _span_text(_gain(baseline.best_sigma, other.best_sigma), is_measured)
    yield tr("{gain} with each at its best D_M", gain=gain)
    gains = {
        variance: _gain(baseline.sigmas[variance], sigma)
        for variance, sigma in other.sigmas.items()
        if variance in baseline.sigmas
    }
    ends = dict.fromkeys(pick(gains, key=lambda variance: gains[variance].value) for pick in (min, max) if gains)
    texts = [
        f"{_span_text(gains[variance], is_measured)} ({key_labels.format_value(variance, powers=True)})"
        for variance in ends
    ]
    if texts:
        gains_text = texts[0] if len(texts) == 1 else tr("{low} to {high}", low=texts[0], high=texts[1])
        yield tr("with one D_M for both {gains}", gains=gains_text)


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
        return tr("{low} to {high} % (95 % interval)", low=low, high=high)
    return tr("{low} to {high} %", low=low, high=high)

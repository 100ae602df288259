"""What helps a filter that folded velocities make worse than the range alone, tried on realisations of the case."""

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from functools import lru_cache
from itertools import islice
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from radarsim.config.experiment import Case
from radarsim.language.numerals import numeral
from radarsim.language.translate import quote_name, tr
from radarsim.report import key_labels, tables
from radarsim.report.sentences import Sentence
from radarsim.studies.ambiguous_doppler.config import MAX_HYPOTHESES, Prior, states_speed
from radarsim.studies.ambiguous_doppler.kernels.layout import OFF_BY_HALF_SPAN_SUM
from radarsim.studies.ambiguous_doppler.study import prepare, simulate
from radarsim.studies.ambiguous_doppler.tables import BEYOND_SHARE, Result

if TYPE_CHECKING:
    import pandas as pd


TablesByName = Mapping[str, "pd.DataFrame"]
LOST_SHARE = 0.5  # of realisations, from which a filter counts as lost
TRIAL_REALISATIONS = 400  # a share of a tenth is known to 1.5 points
MAX_TRIAL_REALISATIONS = 4096  # a second or two for each remedy
MAX_LOST_SHARE = 0.1  # of realisations, up to which a remedy helps
MAX_NAMED = 2  # remedies in the answer, the first that help
NEARLY = 10.0  # per cent of gain: so much less is as good
SMOOTH_MPS2 = 10.0  # acceleration that the model of order 1 allows for: what keeps the lock through turns of some g
LARGER = (10.0, 100.0, 1e3, 1e4)  # times the manoeuvre variance
STAGGER = (1.0, 7 / 6, 4 / 3)  # times the repetition rate, used in turn
MORE_HYPOTHESES = 4  # times the hypotheses kept
PRIOR_FACTOR = 2.0  # between the prior's σ of velocity and that which fits the target's speed, from which that is tried


class Trial(NamedTuple):
    """What a remedy brings at the last scan: the share of realisations lost, and the gain in range over range alone, in
    per cent; not-a-number without a filter of range alone."""

    share: float
    gain: float

    @property
    def helps(self) -> bool:
        return self.share <= MAX_LOST_SHARE and not self.gain <= 0

    @property
    def merit(self) -> float:
        return -100 * self.share if math.isnan(self.gain) else self.gain


def remedy_sentence(filters: Sequence[tuple[Result, str]], tables_by_name: TablesByName) -> list[Sentence]:
    """What helps the first filter, of those of results, that is lost or worse than the range alone."""
    for result, name in filters:
        if not (is_lost(result, name, tables_by_name) or _is_worse(result, name, tables_by_name)):
            continue
        count = min(max(result.count, TRIAL_REALISATIONS), MAX_TRIAL_REALISATIONS)
        tried = list(islice(cures(result.spec, name, dict(result.swept_values), count), MAX_NAMED))
        fields = {"case": key_labels.plain_case_label(result), "filter": quote_name(name), "count": count}
        if not tried:
            text = tr(
                "{case}, {filter}: none of these helps (tried on {count} realisations): a larger D_M, alternating "
                "repetition rates, two model orders, more hypotheses, another prior.",
                **fields,
            )
            return [Sentence(text)]
        return [
            Sentence(
                tr(
                    "{case}, {filter}: {settings} --out cured helps: {gains} ({count} trials).",
                    settings=settings,
                    gains=_trial_text(trial),
                    **fields,
                )
            )
            for settings, trial in tried
        ]
    return []


def _trial_text(trial: Trial) -> str:
    share = numeral(f"{100 * trial.share:.2g}")
    if math.isnan(trial.gain):
        return tr("{share} % of the tracks are lost", share=share)
    gain = numeral(f"{trial.gain:.0f}")
    return tr(
        "{share} % of the tracks are lost, {gain} % gain over range alone in the RMS range error",
        share=share,
        gain=gain,
    )


def is_lost(result: Result, name: str, tables_by_name: TablesByName) -> bool:
    """Whether most of its velocities are off by more than half a span at the last scan."""
    folds = tables.select_rows(tables_by_name["folds"], case=result.name, filter=name)
    return bool(len(folds) and folds.iloc[-1][BEYOND_SHARE] > LOST_SHARE)


def _is_worse(result: Result, name: str, tables_by_name: TablesByName) -> bool:
    """Whether its range is surely worse at the last scan than that of a filter of the range alone."""
    alone = [f.name for f in result.spec.filters if f.doppler == "none"]
    rows = tables.select_rows(tables_by_name["gains"], case=result.name, filter=name, component="r")
    rows = rows[rows["baseline"].isin(alone)]
    return bool(len(rows) and rows.iloc[-1]["gain_hi"] < 0)


class _Remedy(NamedTuple):
    """Settings of the config that may help a filter, by key; the filter, the radar and the prior that they make."""

    settings: Mapping[str, str]
    filter: Any
    radar: Any
    prior: Any

    @property
    def options(self) -> str:
        return " ".join(f"--set {key}={value}" for key, value in self.settings.items())


def cures(
    spec: Any, name: str, swept: Collection[str] = (), count: int = TRIAL_REALISATIONS
) -> Iterator[tuple[str, Trial]]:
    """The remedies that help a filter, as settings of the config, with what they bring.

    swept: keys that the config sweeps, which no setting may change beside it. count: realisations of those that help on
    a few: rare losses decide a gain, and few realisations have none."""
    alone = next((f for f in spec.filters if f.doppler == "none" and f.combine is None), None)

    def trial(remedy: _Remedy, realisations: int) -> Trial:
        filters = (remedy.filter,) if alone is None else (remedy.filter, alone)
        changes = {"radar": remedy.radar, "filters": filters, "baseline": None, "rare": None, "prior": remedy.prior}
        return _trial(spec.model_copy(update=changes), realisations)

    for group in _remedies(spec, name):
        allowed = [r for r in group if not any(f"{s}.".startswith(f"{key}.") for s in r.settings for key in swept)]
        promising = [remedy for remedy in allowed if trial(remedy, TRIAL_REALISATIONS).helps]
        if promising:
            trials = [(trial(remedy, max(count, TRIAL_REALISATIONS)), remedy.options) for remedy in promising]
            most = max(tried.merit for tried, _ in trials)
            # Of those that gain nearly as much the largest D_M: losses too rare for the trial are rarest with it.
            best, options = next(tried for tried in reversed(trials) if tried[0].merit >= most - NEARLY)
            if best.helps:
                yield options, best


def _remedies(spec: Any, name: str) -> Iterator[list[_Remedy]]:
    """What is tried, the least changes first, in groups: a larger manoeuvre variance, staggered repetition rates, a
    prior that fits the target's speed, two orders with a smoother one, more hypotheses."""
    index, lost = next((i, f) for i, f in enumerate(spec.filters) if f.name == name)
    key, radar, prior = f"filters.{index}", spec.radar, spec.prior
    (variance, *_), rates = lost.variances, spec.radar.rates_hz
    staggered = tuple(float(f"{factor * rates[0]:.4g}") for factor in STAGGER)
    in_turn = {"radar.repetition_rate_hz": f"[{','.join(f'{rate:g}' for rate in staggered)}]"}
    rates_in_turn = radar.model_copy(update={"repetition_rate_hz": staggered})
    if lost.combine is None:
        larger = [float(f"{factor * variance:.4g}") for factor in LARGER]
        quicker = [lost.model_copy(update={"manoeuvre_variance": value}) for value in larger]
        settings = [{f"{key}.manoeuvre_variance": f"{value:g}"} for value in larger]
        yield [_Remedy(s, f, radar, prior) for s, f in zip(settings, quicker, strict=True)]
        if len(rates) == 1:
            yield [_Remedy(s | in_turn, f, rates_in_turn, prior) for s, f in zip(settings, quicker, strict=True)]
    if len(rates) == 1:
        yield [_Remedy(in_turn, lost, rates_in_turn, prior)]
    fitted = Prior.model_validate({}).fitted_to(spec.target)
    ratio = fitted.sigma_velocity_mps / prior.sigma_velocity_mps
    if states_speed(spec.target) and not 1 / PRIOR_FACTOR < ratio < PRIOR_FACTOR:
        yield [_Remedy({f"prior.{key}": f"{value:g}" for key, value in fitted}, lost, radar, fitted)]
    if lost.combine is None:
        both = {"orders": (1, 2), "combine": "likelihood", "manoeuvre_variance": (SMOOTH_MPS2**2, variance)}
        combined = {
            f"{key}.orders": "[1,2]",
            f"{key}.combine": "likelihood",
            f"{key}.manoeuvre_variance": f"[{SMOOTH_MPS2**2:g},{variance:g}]",
        }
        yield [_Remedy(combined, lost.model_copy(update=both | {"stay_probability": 0.95}), radar, prior)]
    if lost.combine is None and lost.hypotheses and lost.merge == "never":
        more = min(MORE_HYPOTHESES * lost.hypotheses, MAX_HYPOTHESES)
        if more > lost.hypotheses:
            with_more = lost.model_copy(update={"hypotheses": more})
            yield [_Remedy({f"{key}.hypotheses": f"{more}"}, with_more, radar, prior)]


@lru_cache(maxsize=64)  # the answer is made for the page, and again where a program asks for it
def _trial(spec: Any, count: int) -> Trial:
    """What the first filter loses and, beside one of the range alone, gains at the last scan."""
    plan = prepare(Case("", "", "ambiguous_doppler", spec, (), count, 1))
    arrays = plan.layout.unpack(simulate(plan, 0, count))
    estimates = np.asarray(arrays["estimates"])[:, -1, 0]
    share = float(arrays["folds"][0, -1, OFF_BY_HALF_SPAN_SUM] / estimates[0])
    if len(spec.filters) == 1:
        return Trial(share, math.nan)
    square = np.asarray(arrays["error"])[:, -1, 0, 1] / estimates
    return Trial(share, float(100 * (1 - np.sqrt(square[0] / square[1]))))

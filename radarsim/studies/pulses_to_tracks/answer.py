"""What the report of the chain asks and answers, in sentences."""

import math
from collections.abc import Collection, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from radarsim.config.experiment import Experiment
from radarsim.language.numerals import numeral
from radarsim.language.translate import list_filters, quote_name, term, tr
from radarsim.report import case_selection, compared_value, key_labels, sentences, statistics, tables, wording
from radarsim.report.compared_value import ComparedValue
from radarsim.report.quantities import LOCK, Quantity
from radarsim.report.sentences import Sentence
from radarsim.studies.pulses_to_tracks.tables import Result

if TYPE_CHECKING:
    import pandas as pd


TablesByName = Mapping[str, "pd.DataFrame"]
RatioKeys = Collection[tuple[str, str]]  # cases and filters
RATIO_DECIMALS = 3
RATIO = Quantity("over_ideal", term("σ over that of the idealisation"), "idealisations", "paired_over_ideal")
MAX_RATIO_OF_IDEAL = 1.05  # σ over its idealisation's, up to which the idealisation holds
MAX_RATIO_IN_PERCENT = 2.0  # from which on a ratio is not written in per cent above one


def warnings(experiment: Experiment) -> list[str]:
    """A line for each config whose forecasts exceed the unambiguous interval, if a filter takes the nearest fold.

    No burst alone can tell the fold then."""
    lines: dict[str, None] = {}
    for case in experiment.cases:
        spec = case.spec
        reach = 3 * spec.prior.sigma_velocity_mps
        if reach > spec.span_mps / 2 and any(f.hypotheses == 1 for f in spec.filters):
            text = tr(
                "3 σ of the velocity, {reach:g} m/s, are over half the unambiguous interval of {span:g} m/s: first "
                "bursts may be taken in a wrong ambiguity",
                reach=reach,
                span=spec.span_mps,
            )
            lines[f"{case.stem}: prior.sigma_velocity_mps: {text}"] = None
    return list(lines)


def question(experiment: Experiment) -> str:
    """What the experiment asks, in one sentence."""
    names = list(dict.fromkeys(case.spec.device or case.stem for case in experiment.cases))
    if len(names) > 1:
        return tr(
            "How well do {radars} track from their pulse bursts, and what does a failed burst cost?",
            radars=key_labels.list_radars(names),
        )
    return tr(
        "How well does {radar} track from its pulse bursts, and what does a failed burst cost?",
        radar=key_labels.list_radars(names),
    )


def answer(results: Sequence[Result], tables_by_name: TablesByName) -> list[Sentence]:
    """Sentences on σ over that of the filters' idealisations.

    Of several cases, first each filter where it is furthest from its idealisation. For each case: the filters nearest
    to their idealisation and furthest from it; the locks and σ of each, and what a failed burst costs; the burst."""
    reported, remark = case_selection.select_reported(results, 3)
    worst, keys = _worst_of_all_cases(results, tables_by_name) if len(results) > 1 else ([], ())
    of_cases = [sentence for result in reported for sentence in _case_sentences(result, tables_by_name, keys)]
    return [*worst, *of_cases, *map(Sentence, remark)]


def _worst_of_all_cases(results: Sequence[Result], tables_by_name: TablesByName) -> tuple[list[Sentence], RatioKeys]:
    """The largest σ of the range of each filter at the last scan over its idealisation's, and whose; none without."""
    final = tables.select_rows(tables_by_name["idealisations"], component="r")
    final = final.groupby(["case", "filter"], sort=False).tail(1)
    case_names = dict(
        zip((result.name for result in results), case_selection.distinct_case_names(results), strict=True)
    )
    final = final[final["case"].isin(case_names)].dropna(subset=[RATIO.value])
    worst = final.sort_values(RATIO.value, kind="stable").groupby("filter", sort=False).tail(1)
    if not len(worst):
        return [], ()
    ratios = [
        f"{quote_name(row['filter'])} {_ratio(row, looks=len(results))} ({case_names[row['case']]})"
        for row in worst.to_dict("records")
    ]
    text = tr(
        "Largest RMS range error at the last scan relative to ideal bursts ({together}): {found}.",
        together=compared_value.cases_together(len(results)),
        found="; ".join(ratios),
    )
    return [Sentence(text, _ratio_intervals(worst))], _ratio_keys(worst)


def _case_sentences(result: Result, tables_by_name: TablesByName, ratio_keys: RatioKeys) -> list[Sentence]:
    """The filters nearest to their idealisation and furthest from it, the locks, σ and losses of each; the burst.

    ratio_keys: of the ratios that an earlier sentence gives; each number stands once, with one interval."""
    axes = result.axes
    bound = axes.bound[..., 0][np.isfinite(axes.bound[..., 0])]
    if not bound.size:
        return []
    case = key_labels.plain_case_label(result)
    filters = [name for f, name in enumerate(axes.filters) if axes.ideal[f] >= 0]
    case_sentences: list[Sentence] = []
    if len(filters) > 1 and not any(case_name == result.name for case_name, _ in ratio_keys):
        case_sentences, ratio_keys = _nearest_and_furthest(result, tables_by_name, filters, case)
    always_locked = [name for name in filters if _always_locks(result, tables_by_name, name)]
    if len(always_locked) > 1:
        case_sentences += _without_failures(result, tables_by_name, always_locked, case, ratio_keys)
        filters = [name for name in filters if name not in always_locked]
    for name in filters:
        clauses = [
            _locks(result, tables_by_name, name),
            *([] if (result.name, name) in ratio_keys else [_ratio_of_ideal(result, tables_by_name, name)]),
            *_cost_of_failure(result, tables_by_name, name),
        ]
        clause = sentences.join("; ", clauses)
        case_sentences.append(clause.with_text(f"{case}, {quote_name(name)}: {clause.text}."))
    return [*case_sentences, *_few_failures(result, tables_by_name, case), _burst_sentence(result, case, bound.min())]


def _burst_sentence(result: Result, case: str, sigma: float) -> Sentence:
    """What a burst allows: its pulses, length and energy, and the Cramér–Rao bound of the velocity."""
    spec, energy_db = result.spec, result.axes.energy_db
    low, high = float(energy_db.min()), float(energy_db.max())
    energy = tr("{low:.3g} dB", low=low) if high - low < 0.05 else tr("{low:.3g} to {high:.3g} dB", low=low, high=high)
    text = tr(
        "{case}: {pulses} pulses in {burst_ms:.3g} ms, {energy} in all. An ideal burst always locks and reaches the "
        "Cramér–Rao bound, σ_V = {sigma:.3g} m/s.",
        case=case,
        pulses=spec.pulses,
        burst_ms=1e3 * spec.burst_s,
        energy=energy,
        sigma=sigma,
    )
    return Sentence(text)


def _nearest_and_furthest(
    result: Result, tables_by_name: TablesByName, filters: Sequence[str], case: str
) -> tuple[list[Sentence], RatioKeys]:
    """The filters whose last σ of the range is nearest to their idealisation's and furthest from it, and whose.

    None where they cannot be distinguished."""
    final = tables.select_rows(tables_by_name["idealisations"], case=result.name, component="r")
    final = final.groupby("filter", sort=False).tail(1)
    final = final[final["filter"].isin(filters)].sort_values(RATIO.value, kind="stable").iloc[[0, -1]]
    nearest, furthest = final.to_dict("records")
    values = [compared_value.row_value(row, RATIO).chosen_among(len(filters)) for row in (nearest, furthest)]
    if not compared_value.are_distinguished(*values):
        return [], ()
    text = tr(
        "RMS range error at the last scan relative to that with ideal bursts{chosen}: least with {best}, {near}; "
        "greatest with {worst}, {far}",
        best=quote_name(nearest["filter"]),
        near=_ratio(nearest, looks=len(filters)),
        worst=quote_name(furthest["filter"]),
        far=_ratio(furthest, looks=len(filters)),
        chosen=values[0].choice_remark(compared_value.filters_together),
    )
    return [Sentence(f"{case}, {text}.", _ratio_intervals(final))], _ratio_keys(final)


def _locks(result: Result, tables_by_name: TablesByName, name: str) -> Sentence:
    """The least share of a scan's bursts that lock."""
    locks = tables.select_rows(tables_by_name["locks"], case=result.name, filter=name)
    _, least = compared_value.extreme(locks, LOCK, largest=False)
    if least.value == 1:
        text = tr("none of {count:,} bursts failed to lock ({least})", **_no_failures(locks, least))
    else:
        share = wording.share(*(100 * end for end in least.estimate))
        text = tr("at the worst scan {share} of the bursts lock", share=share)
        text += least.choice_remark(compared_value.scans_together)
    return Sentence(text, least.intervals)


def _no_failures(locks: "pd.DataFrame", least: ComparedValue) -> dict[str, Any]:
    """The number of bursts of which none failed to lock, and how many of a scan lock at least, in words."""
    low = numeral(f"{math.floor(1e4 * least.estimate.lo) / 100:.2f}")
    chosen = f", {compared_value.scans_together(least.looks)}" if least.looks > 1 else ""
    return {
        "count": int(locks["n"].sum()),
        "least": tr("at each scan {low} % or more lock{chosen}", low=low, chosen=chosen),
    }


def _always_locks(result: Result, tables_by_name: TablesByName, name: str) -> bool:
    """Whether none of a filter's bursts failed to lock."""
    locks = tables.select_rows(tables_by_name["locks"], case=result.name, filter=name)
    return bool((locks[LOCK.value] == 1).all())


def _without_failures(
    result: Result, tables_by_name: TablesByName, names: Sequence[str], case: str, ratio_keys: RatioKeys
) -> list[Sentence]:
    """That none of the bursts of several filters failed to lock; and their σ over those of their idealisations."""
    locks = tables.select_rows(tables_by_name["locks"], case=result.name, filter=names[0])
    _, least = compared_value.extreme(locks, LOCK, largest=False)
    text = tr(
        "{case}: with {filters} none of {count:,} bursts failed to lock ({least}).",
        case=case,
        filters=list_filters(names),
        **_no_failures(locks, least),
    )
    finals = [
        tables.select_rows(tables_by_name["idealisations"], case=result.name, filter=name, component="r").iloc[-1]
        for name in names
        if (result.name, name) not in ratio_keys
    ]
    ratios = tr(
        "{case}, RMS range error at the last scan relative to that with ideal bursts: {found}.",
        case=case,
        found="; ".join(f"{quote_name(final['filter'])} {_ratio(final, '.4g')}" for final in finals),
    )
    intervals = [interval for final in finals for interval in _ratio_intervals(final)]
    return [Sentence(text, least.intervals), *([Sentence(ratios, tuple(intervals))] if finals else [])]


def _ratio_of_ideal(result: Result, tables_by_name: TablesByName, name: str) -> Sentence:
    """σ of the range at the last scan over its idealisation's; the same, or more, only as its interval has it."""
    ratios = tables.select_rows(tables_by_name["idealisations"], case=result.name, filter=name, component="r")
    final = ratios.iloc[-1]
    value, low, high = (round(float(final[column]), RATIO_DECIMALS) for column in (RATIO.value, *RATIO.ends))
    if low <= 1 <= high <= MAX_RATIO_OF_IDEAL:
        ratio = _ratio(final, ".4g")
        text = tr("the RMS range error at the last scan is as with ideal bursts, {ratio} times", ratio=ratio)
    elif low > 1 and value < MAX_RATIO_IN_PERCENT:
        percent = wording.estimate((100 * (end - 1) for end in (value, low, high)), "%", ".2g")
        text = tr("the RMS range error at the last scan is {percent} above that with ideal bursts", percent=percent)
    else:
        text = tr("the RMS range error at the last scan is {ratio} times that of ideal bursts", ratio=_ratio(final))
    return Sentence(text, _ratio_intervals(final))


def _cost_of_failure(result: Result, tables_by_name: TablesByName, name: str) -> list[Sentence]:
    """σ of the range at the last scan where its burst failed, beside that of ideal bursts; none where few failed."""
    losses = _last_failures(result, tables_by_name)
    losses = losses[(losses["filter"] == name) & (losses["n"] >= statistics.MIN_EVENTS)]
    if not len(losses):
        return []
    row, unit = losses.iloc[0], key_labels.unit_label(losses.iloc[0]["unit"])
    ideal = result.axes.filters[result.axes.ideal[list(result.axes.filters).index(name)]]
    curves = tables.select_rows(tables_by_name["curves"], case=result.name, filter=ideal, component="r", k=row["k"])
    text = tr(
        "where the burst of the last scan failed ({count:,} realisations) the RMS range error there is {sigma}, with "
        "ideal bursts ({ideal}) {ideal_sigma}",
        count=int(row["n"]),
        sigma=compared_value.row_value(row).text(unit, ",.3g"),
        ideal=quote_name(ideal),
        ideal_sigma=compared_value.row_value(curves.iloc[0]).text(unit),
    )
    return [Sentence(text, sentences.intervals("losses", "sigma", row))]


def _few_failures(result: Result, tables_by_name: TablesByName, case: str) -> list[Sentence]:
    """That too few bursts of the last scan failed, where some of a case failed; none where a filter has enough."""
    locks, losses = (
        tables.select_rows(tables_by_name["locks"], case=result.name),
        _last_failures(result, tables_by_name),
    )
    if (locks["lock_rate"] == 1).all() or (losses["n"] >= statistics.MIN_EVENTS).any():
        return []
    text = tr(
        "{case}: too few bursts failed at the last scan to say what one costs (under {fewest} of {count:,}).",
        case=case,
        fewest=statistics.MIN_EVENTS,
        count=result.count,
    )
    return [Sentence(text)]


def _last_failures(result: Result, tables_by_name: TablesByName) -> "pd.DataFrame":
    """The rows of `losses` on the range at the last scan of the realisations whose burst failed there."""
    return tables.select_rows(
        tables_by_name["losses"], case=result.name, component="r", since_loss=0, k=int(result.axes.k[-1])
    )


def _ratio(row: "Mapping[Any, Any] | pd.Series[Any]", form: str = ".3g", looks: int = 1) -> str:
    ratio = compared_value.row_value(row, RATIO).chosen_among(looks)
    return ratio.mapped(lambda value: round(value, RATIO_DECIMALS)).text(form=form)


def _ratio_intervals(rows: "pd.DataFrame | pd.Series[Any]") -> tuple[sentences.MeasuredInterval, ...]:
    return sentences.intervals("idealisations", "paired_over_ideal", rows)


def _ratio_keys(rows: "pd.DataFrame") -> RatioKeys:
    return set(zip(rows["case"], rows["filter"], strict=True))

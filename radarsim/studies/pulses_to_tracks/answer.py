"""What the report of the chain asks and answers, in sentences."""

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from radarsim.config.experiment import Experiment
from radarsim.language.numerals import numeral
from radarsim.language.translate import join_names, quote_name, term, tr
from radarsim.report import case_selection, compared_value, key_labels, sentences, tables, wording
from radarsim.report.quantities import LOCK, Quantity
from radarsim.report.sentences import Sentence
from radarsim.studies.pulses_to_tracks.tables import Result

if TYPE_CHECKING:
    import pandas as pd


TablesByName = Mapping[str, "pd.DataFrame"]
RATIO_DECIMALS = 3
RATIO = Quantity("over_ideal", term("σ over that of the idealisation"), "idealisations", "paired_over_ideal")
MAX_RATIO_OF_IDEAL = 1.05  # σ over its idealisation's, up to which the idealisation holds


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
            radars=join_names(names),
        )
    return tr("How well does {radar} track from its pulse bursts, and what does a failed burst cost?", radar=names[0])


def answer(results: Sequence[Result], tables_by_name: TablesByName) -> list[Sentence]:
    """Sentences on σ over that of the filters' idealisations.

    Of several cases, first each filter where it is furthest from its idealisation. For each case: the filters nearest
    to their idealisation and furthest from it; the locks and σ of each; the burst."""
    reported, remark = case_selection.select_reported(results, 3)
    worst = _worst_of_all_cases(results, tables_by_name) if len(results) > 1 else []
    of_cases = [sentence for result in reported for sentence in _case_sentences(result, tables_by_name)]
    return [*worst, *of_cases, *map(Sentence, remark)]


def _worst_of_all_cases(results: Sequence[Result], tables_by_name: TablesByName) -> list[Sentence]:
    """The largest σ of the range of each filter at the last scan over its idealisation's; none without any."""
    final = tables.select_rows(tables_by_name["idealisations"], component="r")
    final = final.groupby(["case", "filter"], sort=False).tail(1)
    case_names = dict(
        zip((result.name for result in results), case_selection.distinct_case_names(results), strict=True)
    )
    final = final[final["case"].isin(case_names)].dropna(subset=[RATIO.value])
    worst = final.sort_values(RATIO.value, kind="stable").groupby("filter", sort=False).tail(1)
    if not len(worst):
        return []
    ratios = [
        f"{quote_name(row['filter'])} {_ratio(row, looks=len(results))} ({case_names[row['case']]})"
        for row in worst.to_dict("records")
    ]
    text = tr(
        "Largest RMS range error at the last scan over that of ideal bursts, in {count} cases ({together}): {found}.",
        count=len(results),
        together=compared_value.simultaneity_text(len(results)),
        found="; ".join(ratios),
    )
    return [Sentence(text, _ratio_intervals(worst))]


def _case_sentences(result: Result, tables_by_name: TablesByName) -> list[Sentence]:
    axes = result.axes
    bound = axes.bound[..., 0][np.isfinite(axes.bound[..., 0])]
    if not bound.size:
        return []
    case = key_labels.plain_case_label(result)
    filters = [name for f, name in enumerate(axes.filters) if axes.ideal[f] >= 0]
    case_sentences = []
    if len(filters) > 1:
        for clause in _nearest_and_furthest(result, tables_by_name, filters):
            case_sentences.append(clause.with_text(f"{case}, {clause.text}."))
    for name in filters:
        clause = _locks_and_ratio(result, tables_by_name, name)
        case_sentences.append(clause.with_text(f"{case}, {quote_name(name)}: {clause.text}."))
    return [*case_sentences, _burst_sentence(result, case, bound.min())]


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


def _nearest_and_furthest(result: Result, tables_by_name: TablesByName, filters: Sequence[str]) -> list[Sentence]:
    """The filters whose last σ of the range is nearest to their idealisation's and furthest from it.

    None where they cannot be distinguished."""
    final = tables.select_rows(tables_by_name["idealisations"], case=result.name, component="r")
    final = final.groupby("filter", sort=False).tail(1)
    final = final[final["filter"].isin(filters)].sort_values(RATIO.value, kind="stable").iloc[[0, -1]]
    nearest, furthest = final.to_dict("records")
    values = [compared_value.row_value(row, RATIO).chosen_among(len(filters)) for row in (nearest, furthest)]
    if not compared_value.are_distinguished(*values):
        return []
    text = tr(
        "RMS range error at the last scan over that of ideal bursts{chosen}: least with {best}, {near}; greatest with "
        "{worst}, {far}",
        best=quote_name(nearest["filter"]),
        near=_ratio(nearest, looks=len(filters)),
        worst=quote_name(furthest["filter"]),
        far=_ratio(furthest, looks=len(filters)),
        chosen=values[0].choice_remark(),
    )
    return [Sentence(text, _ratio_intervals(final))]


def _locks_and_ratio(result: Result, tables_by_name: TablesByName, name: str) -> Sentence:
    """The least share of a scan's bursts that lock, and σ of the range at the last scan over its idealisation's."""
    locks = tables.select_rows(tables_by_name["locks"], case=result.name, filter=name)
    _, least = compared_value.extreme(locks, LOCK, largest=False)
    if least.value == 1:
        low = numeral(f"{math.floor(1e4 * least.estimate.lo) / 100:.2f}")
        locked = tr(
            "all {count:,} bursts lock (at every scan {low} % or more{chosen})",
            count=int(locks["n"].sum()),
            low=low,
            chosen=f"; {compared_value.simultaneity_text(least.looks)}" if least.looks > 1 else "",
        )
    else:
        share = wording.share(*(100 * end for end in least.estimate))
        locked = tr("at the worst scan {share} of the bursts lock", share=share) + least.choice_remark()
    ratios = tables.select_rows(tables_by_name["idealisations"], case=result.name, filter=name, component="r")
    final = ratios.iloc[-1]
    if final[RATIO.ends[1]] <= MAX_RATIO_OF_IDEAL:
        ratio = tr(
            "the RMS range error at the last scan is as with ideal bursts, {ratio} times", ratio=_ratio(final, ".4g")
        )
    else:
        ratio = tr("the RMS range error at the last scan is {ratio} times that of ideal bursts", ratio=_ratio(final))
    return Sentence(f"{locked}; {ratio}", (*least.intervals, *_ratio_intervals(final)))


def _ratio(row: "Mapping[Any, Any] | pd.Series[Any]", form: str = ".3g", looks: int = 1) -> str:
    ratio = compared_value.row_value(row, RATIO).chosen_among(looks)
    return ratio.mapped(lambda value: round(value, RATIO_DECIMALS)).text(form=form)


def _ratio_intervals(rows: "pd.DataFrame | pd.Series[Any]") -> tuple[sentences.MeasuredInterval, ...]:
    return sentences.intervals("idealisations", "paired_over_ideal", rows)

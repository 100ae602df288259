"""Question and answer of the report on manoeuvres."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from radarsim.engine.results import CaseResult
from radarsim.language.translate import quote_name, term, tr
from radarsim.report import case_selection, compared_value, key_labels, sentences, tables, wording
from radarsim.report.quantities import Quantity
from radarsim.report.sentences import Sentence
from radarsim.studies.sonar.config import Keys
from radarsim.studies.sonar.manoeuvre.axes import ManoeuvreAxes
from radarsim.studies.sonar.manoeuvre.figures import (
    USUAL_FALSE_ALARM_RATE,
    last_test_of_phase,
    usual_detectors,
    usual_rows,
)
from radarsim.studies.sonar.manoeuvre.tables import EVENTS, NEAR_ZERO_VERDICT

if TYPE_CHECKING:
    import pandas as pd


MAJORITY = 0.5  # of realisations with an alarm, by which detectors are called soon or late
ALARM = Quantity("alarm", term("probability of an alarm"), "detections", "probability", kind="share")
FIRST_ALARM = Quantity("first_alarm", term("probability of an alarm"), "delays", "probability", kind="share")
USES = {
    "course": term("course"),
    "speed": term("speed"),
    "x_ahead": term("x ahead"),
    "y_ahead": term("y ahead"),
    "cpa": term("CPA"),
    "t_cpa": term("time to CPA"),
}


def question(specs: Sequence[Keys]) -> str:
    """The question of cases with detectors, filters that respond to manoeuvres, or uses."""
    if any(spec.detectors for spec in specs):
        return tr("How soon and how surely is a manoeuvre detected, and what do adaptive filters gain?")
    if any(spec.uses for spec in specs):
        return tr("How well are course, speed, position ahead and closest approach known from a track?")
    return tr("What do filters that adapt to manoeuvres gain?")


def answer(
    results: Sequence[CaseResult[ManoeuvreAxes]], tables_by_name: "Mapping[str, pd.DataFrame]"
) -> list[Sentence]:
    """Sentences with 95 % intervals: how soon and how often each manoeuvre is detected, how often none is, and σ of
    uses against the covariance's."""
    answer = []
    if "detections" in tables_by_name:
        moving = [result for result in results if result.spec.detectors and result.axes.manoeuvre_s]
        for result in case_selection.select_reported(moving, 2)[0]:
            detectors = _ranked_detectors(result, tables_by_name["detections"])
            answer += [
                *_delay_sentence(result, detectors, tables_by_name["delays"]),
                *_detection_sentence(result, detectors),
            ]
        if moving:
            answer += _false_alarm_sentence(moving[-1], tables_by_name)
    return [*answer, *_sigma_of_uses(results, tables_by_name)]


def _ranked_detectors(result: CaseResult[ManoeuvreAxes], detections: "pd.DataFrame") -> "list[pd.Series[Any]]":
    """The rows of each detector's last test in the manoeuvre, from the fewest to the most detections."""
    case_rows = detections[detections["case"] == result.name]
    final_rows = [last_test_of_phase(usual_rows(case_rows, name), "manoeuvre") for name in usual_detectors(result)]
    return sorted(
        (
            rows.assign(decides=tables.exact_first(rows, ALARM.value, ALARM.exact_column)).iloc[0]
            for rows in final_rows
            if len(rows)
        ),
        key=lambda row: row["decides"],
    )


def _extremes(ranked: "Sequence[pd.Series[Any]]") -> "list[pd.Series[Any]]":
    """The last and the first; one of one."""
    return [*ranked[::-1][:: len(ranked) - 1 or 1]]


def _detection_sentence(result: CaseResult[ManoeuvreAxes], ranked: "list[pd.Series[Any]]") -> list[Sentence]:
    """The detectors with the most and the fewest detections of a manoeuvre; none where no detector has any."""
    if not ranked:
        return []
    extremes = _extremes(ranked)
    looks = sum(np.isnan(row.get(ALARM.exact_column, np.nan)) for row in ranked)
    values = [compared_value.row_value(row, ALARM).chosen_among(looks) for row in extremes]
    texts = [
        f"{quote_name(row['filter'])}, {value.text(form='.3g')}" for row, value in zip(extremes, values, strict=True)
    ]
    fields = {"usual": USUAL_FALSE_ALARM_RATE, "chosen": compared_value.choice_remark(values)}
    if len(texts) == 1 or not compared_value.are_distinguished(*values):
        text = tr(
            "detection probability of the last test in the manoeuvre, P_FA ≈ {usual:g}{chosen}: {one}.",
            **fields,
            one="; ".join(texts),
        )
    else:
        text = tr(
            "detection probability of the last test in the manoeuvre, P_FA ≈ {usual:g}{chosen}: highest with {most}; "
            "lowest with {least}.",
            **fields,
            most=texts[0],
            least=texts[-1],
        )
    intervals = [interval for value in values for interval in value.intervals]
    return [Sentence(case_selection.after_swept_values(result, text), tuple(intervals))]


def _event_rows(delays: "pd.DataFrame", ranked: "list[pd.Series[Any]]", case: str, event: str) -> "list[pd.DataFrame]":
    """The rows (scans) of the first event of a phase, of the most and the least sensitive detector."""
    rows = delays[(delays["case"] == case) & (delays["event"] == event)]
    return [usual_rows(rows, row["filter"]) for row in _extremes(ranked)] if ranked and len(rows) else []


def _delay_sentence(
    result: CaseResult[ManoeuvreAxes], ranked: "list[pd.Series[Any]]", delays: "pd.DataFrame"
) -> list[Sentence]:
    """How soon and how surely the most and the least sensitive detector raise an alarm within the manoeuvre."""
    clauses = []
    for rows in _event_rows(delays, ranked, result.name, EVENTS[1]):
        final = rows.iloc[-1]
        fields = {"filter": quote_name(final["filter"]), "share": _share_text(final)}
        soon = rows[tables.exact_first(rows, ALARM.value, ALARM.exact_column) >= MAJORITY]
        if len(soon):
            t_s = soon["delay_s"].iloc[0]
            text = tr("{filter} in {share} of realisations, in half of them within {t_s:g} s", t_s=t_s, **fields)
        else:
            text = tr("{filter} in {share} of realisations", **fields)
        clauses.append(Sentence(text, compared_value.row_value(final, FIRST_ALARM).intervals))
    if not clauses:
        return []
    start_s, end_s = result.axes.manoeuvre_s or (0.0, 0.0)
    text = tr(
        "alarm by the end of the manoeuvre ({t_s:g} s), P_FA ≈ {usual:g} per test: {filters}.",
        t_s=end_s - start_s,
        usual=USUAL_FALSE_ALARM_RATE,
        filters=sentences.join("; ", clauses).text,
    )
    return [sentences.compose(case_selection.after_swept_values(result, text), clauses)]


def _false_alarm_sentence(
    result: CaseResult[ManoeuvreAxes], tables_by_name: "Mapping[str, pd.DataFrame]"
) -> list[Sentence]:
    """How often the same detectors raise a false alarm before the manoeuvre."""
    ranked = _ranked_detectors(result, tables_by_name["detections"])
    final_rows = [rows.iloc[-1] for rows in _event_rows(tables_by_name["delays"], ranked, result.name, EVENTS[0])]
    if not final_rows:
        return []
    text = tr(
        "False alarm within the {t_s:g} s before the manoeuvre, P_FA ≈ {usual:g} per test: {filters}.",
        t_s=final_rows[0]["delay_s"],
        usual=USUAL_FALSE_ALARM_RATE,
        filters="; ".join(
            tr("{filter} in {share} of realisations", filter=quote_name(row["filter"]), share=_share_text(row))
            for row in final_rows
        ),
    )
    intervals = [i for row in final_rows for i in compared_value.row_value(row, FIRST_ALARM).intervals]
    return [Sentence(text, tuple(intervals))]


def _share_text(row: "pd.Series[Any]") -> str:
    """The probability that an event has come, in per cent."""
    value = compared_value.row_value(row, FIRST_ALARM)
    if value.is_exact:
        return value.mapped(lambda share: 100 * share).text("%", ".3g")
    return wording.share(*(100 * float(end) for end in value.estimate))


def _sigma_of_uses(
    results: Sequence[CaseResult[ManoeuvreAxes]], tables_by_name: "Mapping[str, pd.DataFrame]"
) -> list[Sentence]:
    """Measured σ of uses over that from the covariance, for the first case's first filter at the last time; or none."""
    if "uses" not in tables_by_name:
        return []
    uses = tables_by_name["uses"]
    first = uses.iloc[0]
    uses = tables.select_rows(uses, case=first["case"], filter=first["filter"])
    uses = uses[uses["k"] == uses["k"].max()]
    text = tr(
        "Ratio of the RMS error to that predicted by the track's covariance ({filter}, {t_s:g} s, {case}): {ratios}.",
        filter=quote_name(first["filter"]),
        t_s=uses.iloc[0]["t_s"],
        case=next(key_labels.plain_case_label(result) for result in results if result.name == first["case"]),
        ratios="; ".join(_ratio(row) for _, row in uses.iterrows()),
    )
    return [Sentence(text, sentences.intervals("uses", "ratio", uses))]


def _ratio(row: "pd.Series[Any]") -> str:
    """The ratio of a use's σ with its interval, and whether the first order that the covariance takes is doubtful."""
    values = wording.estimate((row[key] for key in ("ratio", "ratio_lo", "ratio_hi")), form=".3f")
    ratio = f"{tr(USES[row['component']])} {values}"
    return tr("{ratio} (near zero)", ratio=ratio) if row["first_order"] == NEAR_ZERO_VERDICT else ratio

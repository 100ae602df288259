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
from radarsim.studies.sonar.manoeuvre.tables import NEAR_ZERO_VERDICT

if TYPE_CHECKING:
    import pandas as pd


ALARM = Quantity("alarm", term("probability of an alarm"), "detections", "probability", kind="share")
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
    """Sentences with 95 % intervals: how often each manoeuvre is detected, and σ of uses against the covariance's."""
    answer = []
    if "detections" in tables_by_name:
        moving = [result for result in results if result.spec.detectors and result.axes.manoeuvre_s]
        for result in case_selection.select_reported(moving, 2)[0]:
            answer += _detection_sentence(result, tables_by_name["detections"])
    return [*answer, *_sigma_of_uses(results, tables_by_name)]


def _detection_sentence(result: CaseResult[ManoeuvreAxes], detections: "pd.DataFrame") -> list[Sentence]:
    """The detectors with the most and the fewest detections of a manoeuvre; none where no detector has any."""
    case_rows = detections[detections["case"] == result.name]
    final_rows = [last_test_of_phase(usual_rows(case_rows, name), "manoeuvre") for name in usual_detectors(result)]
    ranked = sorted(
        (
            rows.assign(decides=tables.exact_first(rows, ALARM.value, ALARM.exact_column)).iloc[0]
            for rows in final_rows
            if len(rows)
        ),
        key=lambda row: row["decides"],
    )
    if not ranked:
        return []
    extremes = ranked[::-1][:: len(ranked) - 1 or 1]
    looks = sum(np.isnan(row.get(ALARM.exact_column, np.nan)) for row in ranked)
    values = [compared_value.row_value(row, ALARM).chosen_among(looks) for row in extremes]
    texts = [
        f"{quote_name(row['filter'])}, {value.text(form='.3g')}" for row, value in zip(extremes, values, strict=True)
    ]
    fields = {"usual": USUAL_FALSE_ALARM_RATE, "chosen": compared_value.choice_remark(values)}
    if len(texts) == 1 or not compared_value.are_distinguished(*values):
        text = tr(
            "detection probability at the end of the manoeuvre, P_FA ≈ {usual:g} per test{chosen}: {one}.",
            **fields,
            one="; ".join(texts),
        )
    else:
        text = tr(
            "detection probability at the end of the manoeuvre, P_FA ≈ {usual:g} per test{chosen}: highest with "
            "{most}; lowest with {least}.",
            **fields,
            most=texts[0],
            least=texts[-1],
        )
    intervals = [interval for value in values for interval in value.intervals]
    return [Sentence(case_selection.after_swept_values(result, text), tuple(intervals))]


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
        "RMS errors of quantities derived from the track over their σ from its covariance ({filter}, {t_s:g} s, "
        "{case}): {ratios}.",
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

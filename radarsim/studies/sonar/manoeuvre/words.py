"""Question and answer of the report on manoeuvres."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from radarsim.engine.results import CaseResult
from radarsim.language import term, tr
from radarsim.report import panels, tables, wording
from radarsim.studies.sonar.config import Keys
from radarsim.studies.sonar.manoeuvre.exact import ManoeuvreAxes
from radarsim.studies.sonar.manoeuvre.figures import USUAL, every_scan, last_of, usual
from radarsim.studies.sonar.manoeuvre.tables import NEAR

if TYPE_CHECKING:
    import pandas as pd


def question(specs: Sequence[Keys]) -> str:
    """The question of cases with detectors, filters that respond to manoeuvres, or uses."""
    if any(spec.detectors for spec in specs):
        return tr("How reliably and how soon is a manoeuvre detected, and what do filters that respond to it gain?")
    if any(spec.uses for spec in specs):
        return tr("How well are course, speed, position ahead and closest approach known from a track?")
    return tr("What do filters that respond to manoeuvres gain?")


def answer(results: Sequence[CaseResult[ManoeuvreAxes]], made: "Mapping[str, pd.DataFrame]") -> list[str]:
    """Sentences with 95 % intervals: how often each manoeuvre is detected, and σ of uses against the covariance's."""
    moving = [result for result in results if result.spec.detectors and result.axes.manoeuvre_s]
    shown = panels.reported(moving, 2)[0] if "detections" in made else []
    return [*filter(None, (_detected(result, made["detections"]) for result in shown)), *_first_order(results, made)]


def _detected(result: CaseResult[ManoeuvreAxes], detections: "pd.DataFrame") -> str:
    """The detectors with the most and the fewest detections of a manoeuvre; empty where there are none."""
    rows = detections[detections["case"] == result.name]
    last = [last_of(usual(rows, name), "manoeuvre") for name in every_scan(result)]
    found = [one.assign(decides=tables.exact_first(one, "probability", "exact")).iloc[0] for one in last if len(one)]
    ranked = sorted(found, key=lambda row: row["decides"])
    if not ranked:
        return ""
    ends = [
        f"{row['filter']}, {wording.estimate((row[key] for key in ('probability', 'lo', 'hi')), form='.3g')}"
        for row in ranked[:: len(ranked) - 1 or 1]
    ]
    if len(ends) == 1:
        words = tr(
            "alarms a test at the end of the manoeuvre, at about {usual:g} false alarms: {one}.",
            usual=USUAL,
            one=ends[0],
        )
    else:
        words = tr(
            "alarms a test at the end of the manoeuvre, at about {usual:g} false alarms: most with {most}, least with "
            "{least}.",
            usual=USUAL,
            most=ends[-1],
            least=ends[0],
        )
    return panels.at_its_place(result, words)


def _first_order(results: Sequence[CaseResult[ManoeuvreAxes]], made: "Mapping[str, pd.DataFrame]") -> list[str]:
    """Measured σ of uses over that from the covariance, for the first case's first filter at the last time; or none."""
    if "uses" not in made:
        return []
    rows = made["uses"]
    first = rows.iloc[0]
    rows = tables.where(rows, case=first["case"], filter=first["filter"])
    rows = rows[rows["k"] == rows["k"].max()]
    ratios = []
    for row in rows.itertuples():
        ratio = f"{tr(USES[row.component])} {wording.estimate((row.ratio, row.ratio_lo, row.ratio_hi), form='.3f')}"
        ratios.append(tr("{ratio} (near zero)", ratio=ratio) if row.first_order == NEAR else ratio)
    return [
        tr(
            "Measured σ of the track's uses over that from its covariance ({filter}, {t_s:g} s, {case}): {ratios}.",
            filter=first["filter"],
            t_s=rows.iloc[0]["t_s"],
            case=next(panels.plain_label(one) for one in results if one.name == first["case"]),
            ratios=", ".join(ratios),
        )
    ]


USES = {
    "course": term("course"),
    "speed": term("speed"),
    "x_ahead": term("x ahead"),
    "y_ahead": term("y ahead"),
    "cpa": term("CPA"),
    "t_cpa": term("time to CPA"),
}

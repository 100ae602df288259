"""Question and answer of the report on manoeuvres."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from radarsim.engine.results import CaseResult
from radarsim.report import panels
from radarsim.studies.sonar.manoeuvre.axes import ManoeuvreAxes
from radarsim.studies.sonar.manoeuvre.config import Keys
from radarsim.studies.sonar.manoeuvre.figures import USUAL, every_scan, last_of, usual
from radarsim.studies.sonar.manoeuvre.tables import NEAR

if TYPE_CHECKING:
    import pandas as pd


def question(specs: Sequence[Keys]) -> str:
    """The question of cases with detectors, filters that respond to manoeuvres, or uses."""
    if any(spec.detectors for spec in specs):
        return "How surely and how soon is a manoeuvre detected, and what do filters that respond to it gain?"
    if any(spec.uses for spec in specs):
        return "How well are course, speed, position ahead and closest approach known from a track?"
    return "What do filters that respond to manoeuvres gain?"


def answer(results: Sequence[CaseResult[ManoeuvreAxes]], made: "Mapping[str, pd.DataFrame]") -> list[str]:
    """Sentences with 95 % intervals: how often each manoeuvre is detected, and σ of uses against the covariance's."""
    moving = [result for result in results if result.spec.detectors and result.axes.manoeuvre_s]
    shown = panels.told(moving, 2)[0] if "detections" in made else []
    return [*filter(None, (_detected(result, made["detections"]) for result in shown)), *_first_order(made)]


def _detected(result: CaseResult[ManoeuvreAxes], detections: "pd.DataFrame") -> str:
    """The detectors with the most and the fewest detections of a manoeuvre; empty where there are none."""
    rows = detections[detections["case"] == result.name]
    last = [last_of(usual(rows, name), "manoeuvre") for name in every_scan(result)]
    ranked = sorted((one.iloc[0] for one in last if len(one)), key=lambda row: row["probability"])
    if not ranked:
        return ""
    ends = [
        f"{row['filter']} {row['probability']:.3g} [{row['lo']:.3g}, {row['hi']:.3g}]"
        for row in ranked[:: len(ranked) - 1 or 1]
    ]
    where = panels.plain(panels.swept(result))
    shown = ends[0] if len(ends) == 1 else f"most with {ends[-1]}, least with {ends[0]}"
    return (
        f"{where + ': ' if where else ''}alarms a test at the end of the manoeuvre, at about {USUAL:g} false alarms: "
        f"{shown}."
    )


def _first_order(made: "Mapping[str, pd.DataFrame]") -> list[str]:
    """Measured σ of uses over that from the covariance, for the first case's first filter at the last time; or none."""
    if "uses" not in made:
        return []
    rows = made["uses"]
    first = rows.iloc[0]
    rows = rows[(rows["case"] == first["case"]) & (rows["filter"] == first["filter"])]
    rows = rows[rows["k"] == rows["k"].max()]
    ratios = [
        f"{row.component} {row.ratio:.3f} [{row.ratio_lo:.3f}, {row.ratio_hi:.3f}]"
        f"{' (near zero)' if row.first_order == NEAR else ''}"
        for row in rows.itertuples()
    ]
    where = f"{first['filter']}, {rows.iloc[0]['t_s']:g} s, {first['case']}"
    return [f"Measured σ of the track's uses over that from its covariance ({where}): {', '.join(ratios)}."]

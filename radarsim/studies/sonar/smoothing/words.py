"""Question and answer of the report on smoothed plots."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from radarsim.engine.results import CaseResult
from radarsim.report import panels
from radarsim.studies.sonar.axes import SonarAxes
from radarsim.studies.sonar.config import Keys, correlation_of
from radarsim.studies.sonar.figures import QUANTITIES

if TYPE_CHECKING:
    import pandas as pd


def question(specs: Sequence[Keys]) -> str:
    """The question of cases whose filters know their plots."""
    if any(spec.frame != "polar" for spec in specs):
        return "What does it cost to convert range and bearing to x and y, and when does the conversion's bias matter?"
    if any(correlation_of(spec.sensor.error_correlation, c) for spec in specs for c in range(3)):
        return "What does it cost to ignore that the errors of neighbouring plots are correlated?"
    if any(spec.sensor.detection_probability < 1 or spec.sensor.missed_scans for spec in specs):
        return "What does a missed plot cost?"
    names = list(dict.fromkeys(f.name for spec in specs for f in spec.filters))
    return f"How accurate are range and bearing smoothed by {', '.join(names)}?"


def answer(results: Sequence[CaseResult[SonarAxes]], made: "Mapping[str, pd.DataFrame]") -> list[str]:
    """Sentences with 95 % intervals: σ of the first coordinate at the end, and the most optimistic filter."""
    shown, others = panels.told(results)
    best = [_best(result, made["curves"]) for result in shown]
    return [*best, *_most_optimistic(results, made), *others]


def _best(result: CaseResult[SonarAxes], curves: "pd.DataFrame") -> str:
    """The filters with the least and the largest σ at the end of a case."""
    first = result.axes.components[0][0]
    rows = curves[(curves["case"] == result.name) & (curves["component"] == first)]
    last = rows[rows["k"] == rows["k"].max()]
    # By exact values where all are known, so that filters of equal accuracy are not ranked by their noise.
    order = last["exact_sigma"].round(9) if last["exact_sigma"].notna().all() else last["sigma"]
    last = last.loc[order.sort_values(kind="stable").index]
    low, high = last.iloc[0], last.iloc[-1]
    where = panels.plain(panels.swept(result))
    ends = f"{low['filter']} {low['sigma']:.4g} {low['unit']} [{low['sigma_lo']:.4g}, {low['sigma_hi']:.4g}]"
    if len(last) > 1:
        worst = f"{high['sigma']:.4g} {high['unit']} [{high['sigma_lo']:.4g}, {high['sigma_hi']:.4g}]"
        ends = f"least with {ends}, largest with {high['filter']} {worst}"
    return f"{where + ': ' if where else ''}σ of the {QUANTITIES[first].name} after {low['t_s']:g} s: {ends}."


def _most_optimistic(results: Sequence[CaseResult[SonarAxes]], made: "Mapping[str, pd.DataFrame]") -> list[str]:
    """The filter, of complete state, that overestimates its accuracy the most; none if no filter does."""
    names = [result.name for result in results]
    believed = made["believed"][made["believed"]["case"].isin(names)]
    table = believed.merge(made["consistency"][["case", "filter", "k"]].drop_duplicates())
    worst = table.iloc[int(table["ratio"].argmax())]
    if worst["ratio_lo"] <= 1.05:
        return []
    result = next(result for result in results if result.name == worst["case"])
    where = f" at {panels.plain(panels.swept(result))}" if result.swept else ""
    return [
        f"Most optimistic: {worst['filter']}{where}, whose true σ is "
        f"{worst['ratio']:.2f} [{worst['ratio_lo']:.2f}, {worst['ratio_hi']:.2f}] times the one it believes "
        f"({QUANTITIES[worst['component']].name}, scan {worst['k']})."
    ]

"""Question and answer of the report on smoothed plots."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from radarsim.engine.results import CaseResult
from radarsim.language import few, tr
from radarsim.report import panels, tables, wording
from radarsim.studies.sonar.config import Keys, correlation_of
from radarsim.studies.sonar.figures import BY_NAME
from radarsim.studies.sonar.world import SonarAxes

if TYPE_CHECKING:
    import pandas as pd


def question(specs: Sequence[Keys]) -> str:
    """The question of cases whose filters know their plots."""
    if any(spec.frame != "polar" for spec in specs):
        return tr(
            "What does it cost to convert range and bearing to x and y, and when does the conversion's bias matter?"
        )
    if any(correlation_of(spec.sensor.error_correlation, c) for spec in specs for c in range(3)):
        return tr("What does it cost to ignore that the errors of neighbouring plots are correlated?")
    if any(spec.sensor.detection_probability < 1 or spec.sensor.missed_scans for spec in specs):
        return tr("What does a missed plot cost?")
    names = list(dict.fromkeys(f.name for spec in specs for f in spec.filters))
    return tr("How accurate are range and bearing smoothed by {filters}?", filters=few(names))


def answer(results: Sequence[CaseResult[SonarAxes]], made: "Mapping[str, pd.DataFrame]") -> list[str]:
    """Sentences with 95 % intervals: σ of the first coordinate at the end, and the most optimistic filter."""
    shown, others = panels.reported(results)
    best = [_best(result, made["curves"]) for result in shown]
    return [*best, *_most_optimistic(results, made), *others]


def _best(result: CaseResult[SonarAxes], curves: "pd.DataFrame") -> str:
    """The filters with the least and the largest σ at the end of a case."""
    first = result.axes.components[0][0]
    rows = tables.where(curves, case=result.name, component=first)
    last = rows[rows["k"] == rows["k"].max()]
    # By exact values where all are known, so that filters of equal accuracy are not ranked by their noise.
    order = last["exact_sigma"].round(9) if last["exact_sigma"].notna().all() else last["sigma"]
    last = last.loc[order.sort_values(kind="stable").index]
    low, high = last.iloc[0], last.iloc[-1]
    said = {"quantity": BY_NAME[first].words, "t_s": low["t_s"], "least": _with(low), "most": _with(high)}
    if len(last) > 1:
        words = tr("σ of the {quantity} after {t_s:g} s: least with {least}, largest with {most}.", **said)
    else:
        words = tr("σ of the {quantity} after {t_s:g} s: {least}.", **said)
    return panels.at_its_place(result, words)


def _with(row: "pd.Series") -> str:
    """A filter and its σ with the interval."""
    sigma = wording.estimate((row[key] for key in ("sigma", "sigma_lo", "sigma_hi")), panels.unit_of(row["unit"]))
    return f"{row['filter']}, {sigma}"


def _most_optimistic(results: Sequence[CaseResult[SonarAxes]], made: "Mapping[str, pd.DataFrame]") -> list[str]:
    """The filter, of complete state, that overestimates its accuracy the most; none if no filter does."""
    names = [result.name for result in results]
    believed = made["believed"][made["believed"]["case"].isin(names)]
    table = believed.merge(made["consistency"][["case", "filter", "k"]].drop_duplicates())
    worst = table.iloc[int(table["ratio"].argmax())]
    if worst["ratio_lo"] <= 1.05:
        return []
    result = next(result for result in results if result.name == worst["case"])
    swept = panels.plain(panels.swept(result))
    return [
        tr(
            "Most optimistic: {filter}; its true σ is {ratio} times its own estimate ({quantity}, scan {k}).",
            filter=f"{worst['filter']} ({swept})" if swept else str(worst["filter"]),
            ratio=wording.estimate((worst[key] for key in ("ratio", "ratio_lo", "ratio_hi")), form=".2f"),
            quantity=BY_NAME[worst["component"]].words,
            k=worst["k"],
        )
    ]

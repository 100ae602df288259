"""Question and answer of the report on smoothed plots."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from radarsim.engine.results import CaseResult
from radarsim.language import few, tr
from radarsim.report import notes, panels, tables, wording
from radarsim.studies.sonar.config import Keys, correlation_of
from radarsim.studies.sonar.figures import BY_NAME
from radarsim.studies.sonar.world import SonarAxes

if TYPE_CHECKING:
    import pandas as pd

DIGITS, EQUAL = 9, 1e-9  # decimals of σ, and a ratio's difference, to which filters are of equal accuracy


def question(specs: Sequence[Keys]) -> str:
    """The question of cases whose filters know their plots."""
    if any(spec.frame != "polar" for spec in specs):
        return tr(
            "What does it cost to convert range and bearing to x and y, and when does the conversion's bias matter?"
        )
    if _correlated(specs):
        return tr("What does it cost to ignore that the errors of neighbouring plots are correlated?")
    if any(spec.sensor.detection_probability < 1 or spec.sensor.missed_scans for spec in specs):
        return tr("What does a missed plot cost?")
    names = list(dict.fromkeys(f.name for spec in specs for f in spec.filters))
    return tr("How accurate are range and bearing smoothed by {filters}?", filters=few(names))


def _correlated(specs: Sequence[Keys]) -> bool:
    return any(correlation_of(spec.sensor.error_correlation, c) for spec in specs for c in range(3))


def answer(results: Sequence[CaseResult[SonarAxes]], made: "Mapping[str, pd.DataFrame]") -> list[str]:
    """Sentences with 95 % intervals: σ of the first coordinate at the end, and the most optimistic filter. First, where
    the question is about it: the bias of the conversion, what correlated errors do to a filter's own σ."""
    shown, others = panels.reported(results)
    best = [_best(result, made["curves"]) for result in shown]
    optimistic = _most_optimistic(results, made)
    if _correlated([result.spec for result in results]):
        return [*optimistic, *best, *others]
    return [*_converted(results, made), *best, *optimistic, *others]


def _converted(results: Sequence[CaseResult[SonarAxes]], made: "Mapping[str, pd.DataFrame]") -> list[str]:
    """The largest bias of plots that are converted plainly, and of those without; none if none are plain."""
    rows = made["conversion"] if "conversion" in made else made["curves"][:0].assign(frame="")
    if not (rows["frame"] == "cartesian").any():
        return []
    told = {}
    for frame, own in rows.groupby("frame", sort=False):
        worst = own.iloc[int(own["bias_m"].abs().to_numpy().argmax())]
        result = next(result for result in results if result.name == worst["case"])
        told[str(frame)] = {
            "bias": wording.estimate((worst[key] for key in ("bias_m", "bias_lo", "bias_hi")), tr("m"), ".3g"),
            "ratio": wording.number(float(worst["bias_to_sigma_range"]), 3),
            "case": panels.plain(panels.swept(result, without=["frame"]) or panels.device(result)),
        }
    words = tr(
        "Largest bias of a plot along the line of sight, converted plainly: {bias}, {ratio} σ of the range ({case})",
        **told["cartesian"],
    )
    if other := told.get("cartesian_unbiased"):
        words += "; " + tr("converted without bias: {bias}, {ratio} σ ({case})", **other)
    return [f"{words}."]


def _best(result: CaseResult[SonarAxes], curves: "pd.DataFrame") -> str:
    """The filters with the least and the largest σ at the end of a case."""
    first = result.axes.components[0][0]
    rows = tables.where(curves, case=result.name, component=first)
    last = rows[rows["k"] == rows["k"].max()]
    # By exact values where all are known, so that filters of equal accuracy are not ranked by their noise.
    order = (last["exact_sigma"] if last["exact_sigma"].notna().all() else last["sigma"]).round(DIGITS)
    low, high = (_with(last.loc[order == end]) for end in (order.min(), order.max()))
    said = {"quantity": BY_NAME[first].words, "t_s": last["t_s"].iloc[0], "least": low, "most": high}
    if order.nunique() > 1:
        words = tr("σ of the {quantity} after {t_s:g} s: least with {least}, largest with {most}.", **said)
    else:
        words = tr("σ of the {quantity} after {t_s:g} s: {least}.", **said)
    return panels.at_its_place(result, words)


def _with(rows: "pd.DataFrame") -> str:
    """Filters of equal σ, and it with the interval."""
    row = rows.iloc[0]
    sigma = wording.estimate((row[key] for key in ("sigma", "sigma_lo", "sigma_hi")), panels.unit_of(row["unit"]))
    return f"{few(list(rows['filter']))}, {sigma}"


def _most_optimistic(results: Sequence[CaseResult[SonarAxes]], made: "Mapping[str, pd.DataFrame]") -> list[str]:
    """The filters, of complete state, that overestimate their accuracy the most; none if no filter does."""
    names = [result.name for result in results]
    curves = made["curves"][made["curves"]["case"].isin(names)]
    table = curves.merge(made["consistency"][["case", "filter", "k"]].drop_duplicates())
    ratio = notes.sigma_over_believed(table)
    table = table.assign(ratio=ratio.value, ratio_lo=ratio.lo, ratio_hi=ratio.hi)
    worst = table.iloc[int(table["ratio"].argmax())]
    if worst["ratio_lo"] <= 1.05:
        return []
    result = next(result for result in results if result.name == worst["case"])
    there = tables.where(table, case=worst["case"], component=worst["component"], k=worst["k"])
    alike = few(list(there["filter"][(there["ratio"] - worst["ratio"]).abs() < EQUAL]))
    swept = panels.plain(panels.swept(result))
    return [
        tr(
            "Most optimistic: {filter}; the true σ is {ratio} times the filter's own estimate ({quantity}, scan {k}).",
            filter=f"{alike} ({swept})" if swept else alike,
            ratio=wording.estimate((worst[key] for key in ("ratio", "ratio_lo", "ratio_hi")), form=".2f"),
            quantity=BY_NAME[worst["component"]].words,
            k=worst["k"],
        )
    ]

"""Question and answer of the report on smoothed plots."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from radarsim.engine.results import CaseResult
from radarsim.language.translate import list_filters, quote_name, shorten_names, tr
from radarsim.report import (
    case_selection,
    compared_value,
    exact_marks,
    key_labels,
    sentences,
    statistics,
    tables,
    wording,
)
from radarsim.report.compared_value import ComparedValue
from radarsim.report.sentences import Sentence
from radarsim.studies.counted_scans import CountedScans
from radarsim.studies.sonar import missed_plot_answer
from radarsim.studies.sonar.axes import SonarAxes
from radarsim.studies.sonar.components import COMPONENTS_BY_NAME
from radarsim.studies.sonar.config import Keys
from radarsim.studies.sonar.sensor_keys import coordinate_correlation

if TYPE_CHECKING:
    import pandas as pd


SIGMA_DECIMALS, EQUAL_RATIOS = 9, 1e-9  # to which filters are of equal accuracy
PART = "smoothing"
RANGE_AND_BEARING = "r", "b"
MIN_OPTIMISM = 1.05  # true over believed σ, by the interval, from which a filter is called optimistic


def question(specs: Sequence[Keys]) -> str:
    """The question of cases whose filters know their plots."""
    if any(spec.frame != "polar" for spec in specs):
        return tr(
            "What does it cost to convert range and bearing to x and y, and when does the conversion's bias matter?"
        )
    if _has_correlated_errors(specs):
        return tr("What does it cost to ignore that the errors of neighbouring plots are correlated?")
    if _misses_plots(specs):
        return tr("What does a missed plot cost?")
    names = list(dict.fromkeys(f.name for spec in specs for f in spec.filters))
    return tr("How accurate are smoothed range and bearing ({filters})?", filters=list_filters(names))


def _has_correlated_errors(specs: Sequence[Keys]) -> bool:
    return any(coordinate_correlation(spec.sensor.error_correlation, c) for spec in specs for c in range(3))


def _misses_plots(specs: Sequence[Keys]) -> bool:
    misses_plots = any(spec.sensor.detection_probability < 1 or spec.sensor.missed_scans for spec in specs)
    return misses_plots and not any(spec.sensor.further for spec in specs)


def _asks_for_accuracy(specs: Sequence[Keys]) -> bool:
    """Whether nothing is asked but how accurate smoothed range and bearing are."""
    is_plain = all(spec.frame == "polar" and spec.parts == (PART,) for spec in specs)
    return is_plain and not _has_correlated_errors(specs) and not _misses_plots(specs)


def answer(
    results: Sequence[CaseResult[SonarAxes]],
    tables_by_name: "Mapping[str, pd.DataFrame]",
    scans: Mapping[str, CountedScans],
) -> list[Sentence]:
    """Sentences with 95 % intervals: σ of the first coordinate at the end, of the bearing too where that is asked, and
    the most optimistic filter at the scans that count, which are given by case.

    First what the question is about: the bias of the conversion, what correlated errors do to a filter's own σ, or what
    missed plots cost."""
    specs = [result.spec for result in results]
    reported, remark = case_selection.select_reported(results)
    sigma = [
        _final_sigma(result, tables_by_name, component)
        for result in reported
        for component in (RANGE_AND_BEARING if _asks_for_accuracy(specs) else [result.axes.components[0][0]])
    ]
    optimistic = _most_optimistic(results, tables_by_name, scans)
    if _has_correlated_errors(specs):
        return [*optimistic, *sigma, *map(Sentence, remark)]
    missed = missed_plot_answer.cost_sentences(results, reported, tables_by_name) if _misses_plots(specs) else []
    return [*_bias_of_conversion(results, tables_by_name), *missed, *sigma, *optimistic, *map(Sentence, remark)]


def _bias_of_conversion(
    results: Sequence[CaseResult[SonarAxes]], tables_by_name: "Mapping[str, pd.DataFrame]"
) -> list[Sentence]:
    """The largest bias of plots that are converted plainly, by its formula; none if none are plain."""
    if "conversion" not in tables_by_name:
        return []
    plain = tables.select_rows(tables_by_name["conversion"], frame="cartesian")
    if not len(plain):
        return []
    worst = plain.iloc[int(plain["formula_m"].abs().to_numpy().argmax())]
    result = next(result for result in results if result.name == worst["case"])
    ratio = float(worst["formula_m"] / worst["sigma_range_m"])
    text = tr(
        "Bias of a converted plot along the line of sight: with the plain conversion up to {bias}, {ratio} σ "
        "of the range ({case})",
        bias=exact_marks.exact_text(f"{wording.number(float(worst['formula_m']), 3)} {tr('m')}"),
        ratio=wording.number(ratio, 3),
        case=key_labels.without_markup(
            key_labels.swept_description(result, without=["frame"]) or key_labels.config_device(result)
        ),
    )
    if any(tables_by_name["conversion"]["frame"] == "cartesian_unbiased"):
        text += "; " + tr("with the unbiased one none")
    return [Sentence(f"{text}.", sentences.intervals("conversion", "bias_m", worst))]


def _final_sigma(
    result: CaseResult[SonarAxes], tables_by_name: "Mapping[str, pd.DataFrame]", component: str
) -> Sentence:
    """The filters with the least and the largest σ at the end of a case, unless noise decides which they are."""
    rows = tables.select_rows(tables_by_name["curves"], case=result.name, component=component)
    final = rows[rows["k"] == rows["k"].max()]
    # By exact values where all are known, so that filters of equal accuracy are not ranked by their noise.
    order = final["exact_sigma"] if final["exact_sigma"].notna().all() else final["sigma"]
    order = order.round(SIGMA_DECIMALS)
    lowest, highest = (final.loc[order == extreme] for extreme in (order.min(), order.max()))
    looks = int(order[final["exact_sigma"].isna()].nunique())  # of equal filters none was chosen
    values = [
        compared_value.sigma_value(rows.iloc[0], tables_by_name).chosen_among(looks) for rows in (lowest, highest)
    ]
    is_of_both = all(value.choice_remark() for value in values)
    remarks = ["" if is_of_both else value.choice_remark() for value in values]
    fields = {
        "quantity": COMPONENTS_BY_NAME[component].words,
        "t_s": final["t_s"].iloc[0],
        "chosen": values[0].choice_remark() if is_of_both else "",
        "least": _filters_and_sigma(lowest, values[0]) + remarks[0],
        "most": _filters_and_sigma(highest, values[1]) + remarks[1],
    }
    if order.nunique() == 1:
        text = tr("RMS error of the {quantity} after {t_s:g} s{chosen}: {least}.", **fields)
    elif _is_surely_less(lowest.iloc[0], highest.iloc[0], tables_by_name, looks=order.nunique()):
        text = tr(
            "RMS error of the {quantity} after {t_s:g} s{chosen}: least with {least}; largest with {most}.", **fields
        )
    else:
        text = tr("RMS error of the {quantity} after {t_s:g} s{chosen}: {least}; {most}; not distinguished.", **fields)
    intervals = [interval for value in values for interval in value.intervals]
    return Sentence(case_selection.after_swept_values(result, text), tuple(intervals))


def _is_surely_less(
    row: "pd.Series[Any]", other: "pd.Series[Any]", tables_by_name: "Mapping[str, pd.DataFrame]", looks: int
) -> bool:
    """Whether σ of a row is less than that of another, where they are the extremes of so many."""
    gain = compared_value.sigma_gain(row, other, tables_by_name)
    return bool(statistics.simultaneous_gains(gain, looks * (looks - 1) // 2).lo > 0)


def _filters_and_sigma(rows: "pd.DataFrame", sigma: ComparedValue) -> str:
    """Filters of equal σ, and it with the interval; of an angle in degrees."""
    factor, unit = key_labels.degrees_factor_and_unit(rows["unit"].iloc[0])
    value = sigma if factor == 1.0 else sigma.mapped(lambda angle: factor * angle)
    return f"{list_filters(rows['filter'])}, {value.text(key_labels.unit_label(unit)).replace(' °', '°')}"


def _most_optimistic(
    results: Sequence[CaseResult[SonarAxes]],
    tables_by_name: "Mapping[str, pd.DataFrame]",
    scans: Mapping[str, CountedScans],
) -> list[Sentence]:
    """The filters, of complete state, that overestimate their accuracy the most at the scans that count; none if no
    filter does."""
    curves = tables_by_name["curves"]
    curves = curves[curves["case"].isin([result.name for result in results])]
    curves = curves[curves["k"] >= curves["case"].map({name: counted.k for name, counted in scans.items()})]
    complete = set(tables_by_name["consistency"][["case", "filter", "k"]].itertuples(index=False, name=None))
    curves = curves[[key in complete for key in curves[["case", "filter", "k"]].itertuples(index=False, name=None)]]
    believed = curves["believed_sigma"].to_numpy(dtype=float)
    with np.errstate(divide="ignore", invalid="ignore"):
        decides = np.nan_to_num(tables.exact_first(curves, "sigma", "exact_sigma") / believed, nan=0.0)
    curves = curves.assign(ratio=decides)
    worst = curves.iloc[int(decides.argmax())]
    looks = int(curves["exact_sigma"].isna().sum())
    true = compared_value.sigma_value(worst, tables_by_name).chosen_among(looks)
    ratio = true.mapped(lambda sigma: sigma / float(worst["believed_sigma"]))
    if ratio.estimate.lo <= MIN_OPTIMISM:
        return []
    result = next(result for result in results if result.name == worst["case"])
    filters = tables.select_rows(curves, case=worst["case"], component=worst["component"], k=worst["k"])
    equal = shorten_names(
        [*map(quote_name, filters["filter"][(filters["ratio"] - worst["ratio"]).abs() < EQUAL_RATIOS])]
    )
    swept = key_labels.without_markup(key_labels.swept_description(result))
    text = tr(
        "Most optimistic filter {since}: {filter}, whose RMS error is {ratio} times its own σ ({quantity}, scan {k}).",
        since=wording.since(*scans[worst["case"]]),
        filter=f"{equal} ({swept})" if swept else equal,
        ratio=ratio.text(form=".3g"),
        quantity=COMPONENTS_BY_NAME[worst["component"]].words,
        k=f"{worst['k']}{ratio.choice_remark()}",
    )
    return [Sentence(text, ratio.intervals)]

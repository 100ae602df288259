"""The answer's sentences on what missed plots cost: σ at the end against that with the most plots."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from radarsim.engine.results import CaseResult
from radarsim.language.translate import list_filters, tr
from radarsim.report import case_selection, compared_value, key_labels, tables, wording
from radarsim.report.compared_value import ComparedValue
from radarsim.report.sentences import Sentence
from radarsim.studies.sonar.axes import SonarAxes
from radarsim.studies.sonar.components import COMPONENTS_BY_NAME

if TYPE_CHECKING:
    import pandas as pd

RATIO_DECIMALS = 9  # to which filters lose equally


def cost_sentences(
    results: Sequence[CaseResult[SonarAxes]],
    reported: Sequence[CaseResult[SonarAxes]],
    tables_by_name: "Mapping[str, pd.DataFrame]",
) -> list[Sentence]:
    """How much larger σ of the first coordinate is in each reported case than in the one with the highest detection
    probability; and which scans are missed in that one, too."""
    baseline = max(results, key=lambda result: result.spec.sensor.detection_probability)
    sentences = [
        _cost_sentence(result, baseline, tables_by_name)
        for result in reported
        if result.spec.sensor.detection_probability < baseline.spec.sensor.detection_probability
    ]
    if scans := baseline.spec.sensor.missed_scans:
        text = tr(
            "Scans {scans} are always missed, at P_D = {probability:g} too.",
            scans=wording.list_numbers(map(str, scans)),
            probability=baseline.spec.sensor.detection_probability,
        )
        sentences.append(Sentence(text))
    return sentences


def _cost_sentence(
    result: CaseResult[SonarAxes], baseline: CaseResult[SonarAxes], tables_by_name: "Mapping[str, pd.DataFrame]"
) -> Sentence:
    """The filters whose σ at the last scan grows the least and the most."""
    component = result.axes.components[0][0]
    ratios = _ratios(result, baseline, component, tables_by_name)
    looks = len({round(ratio.value, RATIO_DECIMALS) for ratio in ratios.values() if not ratio.is_exact})
    ratios = {name: ratio.chosen_among(looks) for name, ratio in ratios.items()}
    ends = [pick(ratios.values(), key=lambda ratio: ratio.value) for pick in (min, max)]
    low, high = (_filters_text(ratios, end) for end in ends)
    text = tr(
        "RMS error of the {quantity} after {t_s:g} s relative to that at {baseline}{chosen}: {filters}.",
        quantity=COMPONENTS_BY_NAME[component].words,
        t_s=result.axes.t_s[-1],
        baseline=key_labels.without_markup(key_labels.swept_description(baseline)),
        chosen=compared_value.choice_remark(ends),
        filters=low if low == high else tr("{low} to {high}", low=low, high=high),
    )
    intervals = [interval for end in ends for interval in end.intervals]
    return Sentence(case_selection.after_swept_values(result, text), tuple(intervals))


def _ratios(
    result: CaseResult[SonarAxes],
    baseline: CaseResult[SonarAxes],
    component: str,
    tables_by_name: "Mapping[str, pd.DataFrame]",
) -> dict[str, ComparedValue]:
    """σ of each filter at the last scan over that in another case."""
    curves = tables.select_rows(tables_by_name["curves"], component=component)
    rows, baseline_rows = (
        {row["filter"]: row for _, row in curves[curves["case"] == case.name].iterrows()} for case in (result, baseline)
    )
    return {
        name: compared_value.value_ratio(
            *(compared_value.sigma_value(row, tables_by_name) for row in (rows[name], baseline_rows[name]))
        )
        for name in rows
        if name in baseline_rows
    }


def _filters_text(ratios: Mapping[str, ComparedValue], end: ComparedValue) -> str:
    """A ratio and the filters that have it."""
    names = [name for name, ratio in ratios.items() if round(ratio.value - end.value, RATIO_DECIMALS) == 0]
    return f"{end.text(form='.3g')} ({list_filters(names)})"

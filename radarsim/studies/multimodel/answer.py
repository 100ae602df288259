"""What the report of P2's experiments asks and answers, in sentences."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from radarsim.config.experiment import Experiment
from radarsim.engine.results import CaseResult
from radarsim.language.translate import list_filters, plural, quote_name, term, tr
from radarsim.report import case_selection, compared_value, key_labels, sentences, tables, wording
from radarsim.report.compared_value import ComparedValue
from radarsim.report.sentences import Sentence
from radarsim.studies.multimodel import overall_answer, stage_ranking
from radarsim.studies.multimodel.tables import stage_bounds

if TYPE_CHECKING:
    import pandas as pd


def question(experiment: Experiment) -> str:
    """What the experiment asks, in one sentence."""
    filters = list(dict.fromkeys(f.name for case in experiment.cases for f in case.spec.filters))
    cases = len(experiment.cases)
    if len(filters) == 1:
        return tr("How accurately does {filter} track the target?", filter=quote_name(filters[0]))
    if cases == 1:
        return tr("Which filter tracks the target best: {filters}?", filters=list_filters(filters))
    return plural(
        "Which filter tracks the target best in {count} case: {filters}?",
        "Which filter tracks the target best in {count} cases: {filters}?",
        cases,
        filters=list_filters(filters),
    )


def answer(results: Sequence[CaseResult], tables_by_name: "Mapping[str, pd.DataFrame]") -> list[Sentence]:
    """The filter that is best overall.

    Of one case, or where no filter is best of several, the least σ of each stage too."""
    stages = tables_by_name["stages"]
    ranking = overall_answer.rank_overall(results, stages)
    overall = overall_answer.ranking_sentences(results, ranking) if ranking else []
    if len(results) > 1 and ranking and not ranking.close:
        return overall
    reported, remark = case_selection.select_reported(results, 4)
    names = {
        result.name: name if len(results) > 1 or result.swept_values else ""
        for result, name in zip(results, case_selection.distinct_case_names(results), strict=True)
    }
    quantities = [("y", term("the height")), *([("vy", term("the rate of climb"))] if len(results) == 1 else [])]
    known = set(stages["component"])
    stage_sentences = [
        _least_sigma(result, names[result.name], stages, *quantity)
        for result in reported
        for quantity in quantities
        if quantity[0] in known
    ]
    return [*overall, *stage_sentences, *map(Sentence, remark)]


def answer_points(result: CaseResult) -> list[tuple[str, float]]:
    """The height at the last scan of each stage."""
    times = result.axes.t_s
    within = [times[(times >= begin) & (times <= end)] for _, begin, end in stage_bounds(result)]
    return [("y", float(stage_times[-1])) for stage_times in within if stage_times.size]


def _least_sigma(result: CaseResult, case_name: str, stages: "pd.DataFrame", component: str, quantity: str) -> Sentence:
    """The filter of the least σ in each stage, with the interval, and those that noise alone places behind it.

    case_name: of one of several cases. Equal filters are not ranked, and no noise has chosen among them."""
    rows = tables.select_rows(stages, case=result.name, component=component)
    best = rows.loc[rows.groupby("stage", sort=False)["sigma"].idxmin()]
    looks = int(rows["sigma"].map("{:.9g}".format).groupby(rows["stage"]).nunique().max())
    clauses = [_least_sigma_clause(result, rows, row, looks) for _, row in best.iterrows()]
    remark = compared_value.row_value(best.iloc[0]).chosen_among(looks).choice_remark(compared_value.filters_together)
    fields = {"quantity": quantity, "stages": "; ".join(clauses)}
    text = (
        tr("Least RMS error of {quantity} by stage{chosen}: {stages}.", chosen=remark, **fields)
        if looks > 1
        else tr("RMS error of {quantity} by stage: {stages}.", **fields)
    )
    return Sentence(case_selection.after_case_name(case_name, text), sentences.intervals("stages", "sigma", best))


def _least_sigma_clause(result: CaseResult, rows: "pd.DataFrame", best: "pd.Series[Any]", looks: int) -> str:
    """The filter of the least σ of a stage, σ, chosen among so many, and the filters not distinguished from it."""
    filters, close = stage_ranking.least_filters(result, rows, best)
    sigma = _three_digits(compared_value.row_value(best).chosen_among(looks), key_labels.unit_label(best["unit"]))
    remark = " " + tr("(not distinguished from {others})", others=close) if close else ""
    return f"{tr(str(best['stage']))}: {filters}, {sigma}{remark}"


def _three_digits(value: ComparedValue, unit: str) -> str:
    """A value with its interval, to three digits."""
    return wording.estimate(value.estimate, unit, ",.3g")

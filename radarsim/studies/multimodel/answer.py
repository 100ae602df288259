"""What the report of P2's experiments asks and answers, in sentences."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from radarsim.config.experiment import Experiment
from radarsim.engine.results import CaseResult
from radarsim.language.translate import list_filters, plural, quote_name, term, tr
from radarsim.report import case_selection, compared_value, key_labels, sentences, tables, wording
from radarsim.report.compared_value import ComparedValue
from radarsim.report.sentences import Sentence
from radarsim.studies.multimodel import stage_ranking
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
    """The filter that is closest to the best one of every stage.

    Of one case, or where no filter can be compared so, the least σ of each stage."""
    stages = tables_by_name["stages"]
    closest = _closest_to_the_best(results, stages)
    if closest and len(results) > 1:
        return closest
    reported, remark = case_selection.select_reported(results, 4)
    quantities = [("y", term("the height")), *([("vy", term("the rate of climb"))] if len(results) == 1 else [])]
    known = set(stages["component"])
    stage_sentences = [
        _least_sigma(result, stages, *quantity)
        for result in reported
        for quantity in quantities
        if quantity[0] in known
    ]
    return [*closest, *stage_sentences, *map(Sentence, remark)]


def answer_points(result: CaseResult) -> list[tuple[str, float]]:
    """The height at the last scan of each stage."""
    times = result.axes.t_s
    within = [times[(times >= begin) & (times <= end)] for _, begin, end in stage_bounds(result)]
    return [("y", float(stage_times[-1])) for stage_times in within if stage_times.size]


def _closest_to_the_best(results: Sequence[CaseResult], stages: "pd.DataFrame") -> list[Sentence]:
    """The filter whose σ of the height is nowhere far above the least of a stage, that stage, and the next filter.

    Of filters that all cases have; nothing where there are not two, or where noise decides which it is."""
    rows = stages[(stages["component"] == "y") & (stages["sigma"] > 0)]
    rows = rows[rows.groupby("filter")["case"].transform("nunique") == len(results)]
    if rows["filter"].nunique() < 2:
        return []
    lowest_rows = rows.loc[rows.groupby(["case", "stage"], sort=False)["sigma"].idxmin()]
    least_by_stage = lowest_rows.set_index(["case", "stage"])["sigma"]
    least_sigma = least_by_stage.loc[list(zip(rows["case"], rows["stage"], strict=True))]
    rows = rows.assign(above=100 * (rows["sigma"].to_numpy() / least_sigma.to_numpy() - 1))
    worst_stages = rows.loc[rows.groupby("filter", sort=False)["above"].idxmax()]
    worst_stages = worst_stages.sort_values("above", kind="stable")
    closest, second = worst_stages.iloc[0], worst_stages.iloc[1]
    # The second is further from the best only if it is surely worse than the first where it is worst itself.
    by_name = {result.name: result for result in results}
    if not stage_ranking.percent_above(by_name[second["case"]], second, closest["filter"], len(rows)).estimate.lo > 0:
        return []
    best_by_stage = lowest_rows.set_index(["case", "stage"])["filter"]
    above = [
        _three_digits(
            stage_ranking.percent_above(
                by_name[row["case"]], row, best_by_stage.loc[(row["case"], row["stage"])], len(rows)
            ),
            "%",
        )
        for row in (closest, second)
    ]
    fields = {
        "filter": quote_name(closest["filter"]),
        "second": quote_name(second["filter"]),
        "more": above[1],
        "where": _stage_label(results, second),
        "together": compared_value.simultaneity_text(len(rows)),
    }
    if not closest["above"]:
        text = tr(
            "Least RMS height error in every stage: {filter}; next is {second}, at most {more} above it ({where}; "
            "{together}).",
            **fields,
        )
        return [Sentence(text, sentences.intervals("stages", "sigma", second))]
    text = tr(
        "Smallest worst excess of the RMS height error over the best filter of {every} ({together}): {filter}, "
        "{percent} ({closest_where}, where {best} is best); next is {second}, {more} ({where}).",
        every=tr("each stage"),
        percent=above[0],
        closest_where=_stage_label(results, closest),
        best=quote_name(best_by_stage.loc[(closest["case"], closest["stage"])]),
        **fields,
    )
    return [Sentence(text, sentences.intervals("stages", "sigma", closest, second))]


def _stage_label(results: Sequence[CaseResult], row: "pd.Series[Any]") -> str:
    """The stage of a row, after its case where there are several."""
    case_names = dict(
        zip((result.name for result in results), case_selection.distinct_case_names(results), strict=True)
    )
    stage = tr(str(row["stage"]))
    return f"{case_names[row['case']]}, {stage}" if len(results) > 1 else stage


def _least_sigma(result: CaseResult, stages: "pd.DataFrame", component: str, quantity: str) -> Sentence:
    """The filter of the least σ in each stage, with the interval, and those that noise alone places behind it.

    Equal filters are not ranked, and no noise has chosen among them."""
    rows = tables.select_rows(stages, case=result.name, component=component)
    best = rows.loc[rows.groupby("stage", sort=False)["sigma"].idxmin()]
    looks = int(rows["sigma"].map("{:.9g}".format).groupby(rows["stage"]).nunique().max())
    clauses = [_least_sigma_clause(result, rows, row, looks) for _, row in best.iterrows()]
    remark = compared_value.row_value(best.iloc[0]).chosen_among(looks).choice_remark()
    fields = {"quantity": quantity, "stages": "; ".join(clauses)}
    text = (
        tr("Least RMS error of {quantity} by stage{chosen}: {stages}.", chosen=remark, **fields)
        if looks > 1
        else tr("RMS error of {quantity} by stage: {stages}.", **fields)
    )
    return Sentence(case_selection.after_swept_values(result, text), sentences.intervals("stages", "sigma", best))


def _least_sigma_clause(result: CaseResult, rows: "pd.DataFrame", best: "pd.Series[Any]", looks: int) -> str:
    """The filter of the least σ of a stage, σ, chosen among so many, and the filters not distinguished from it."""
    filters, close = stage_ranking.least_filters(result, rows, best)
    sigma = _three_digits(compared_value.row_value(best).chosen_among(looks), key_labels.unit_label(best["unit"]))
    remark = " " + tr("(not distinguished from {others})", others=close) if close else ""
    return f"{tr(str(best['stage']))}: {filters}, {sigma}{remark}"


def _three_digits(value: ComparedValue, unit: str) -> str:
    """A value with its interval, to three digits."""
    return wording.estimate(value.estimate, unit, ",.3g")

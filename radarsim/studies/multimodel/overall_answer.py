"""The filter that is best overall: its σ of the height is nowhere far above the least of a stage.

Filters are ranked by their largest excess over the best filter of a stage, over all cases and stages. Noise chooses
among them too: the best is named alone only if each other is surely worse than it where that other one is worst."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from radarsim.engine.results import CaseResult
from radarsim.language.translate import list_filters, quote_name, tr
from radarsim.report import case_selection, sentences, wording
from radarsim.report.compared_value import comparisons_together
from radarsim.report.sentences import Sentence
from radarsim.studies.multimodel import stage_ranking

if TYPE_CHECKING:
    import pandas as pd


class OverallRanking(NamedTuple):
    """The stage in which each filter is worst, the best filter first, and what its excess is relative to."""

    worst_stages: "pd.DataFrame"  #: rows of `stages`, one for each filter, with `above`, % of the least σ of the stage
    best_by_stage: "pd.Series[Any]"  #: name of the best filter by case and stage
    close: list[str]  #: filters that noise does not distinguish from the best one
    looks: int  #: comparisons among which these were chosen


def rank_overall(results: Sequence[CaseResult], stages: "pd.DataFrame") -> OverallRanking | None:
    """The ranking of the filters that all cases have; none where there are not two."""
    rows = stages[(stages["component"] == "y") & (stages["sigma"] > 0)]
    rows = rows[rows.groupby("filter")["case"].transform("nunique") == len(results)]
    if rows["filter"].nunique() < 2:
        return None
    lowest_rows = rows.loc[rows.groupby(["case", "stage"], sort=False)["sigma"].idxmin()].set_index(["case", "stage"])
    least_sigma = lowest_rows["sigma"].loc[list(zip(rows["case"], rows["stage"], strict=True))]
    rows = rows.assign(above=100 * (rows["sigma"].to_numpy() / least_sigma.to_numpy() - 1))
    worst_stages = rows.loc[rows.groupby("filter", sort=False)["above"].idxmax()]
    worst_stages = worst_stages.sort_values("above", kind="stable")
    by_name = {result.name: result for result in results}
    best, looks = worst_stages.iloc[0]["filter"], len(rows)
    close = [
        row["filter"]
        for _, row in worst_stages.iloc[1:].iterrows()
        if not stage_ranking.percent_above(by_name[row["case"]], row, best, looks).estimate.lo > 0
    ]
    return OverallRanking(worst_stages, lowest_rows["filter"], close, looks)


def ranking_sentences(results: Sequence[CaseResult], ranking: OverallRanking) -> list[Sentence]:
    """The best filter overall, how far it is above the least, and the next; or those among which noise decides.

    Nothing where noise decides among filters of which the first is nowhere above the least."""
    best, second = ranking.worst_stages.iloc[0], ranking.worst_stages.iloc[1]
    if ranking.close:
        return _undecided_sentences(results, ranking) if best["above"] else []
    fields = {"filter": quote_name(best["filter"]), "second": quote_name(second["filter"])}
    fields |= {"more": _excess(results, ranking, second), "together": comparisons_together(ranking.looks)}
    if not best["above"]:
        text = tr(
            "{filter} is best overall: its RMS height error is the least in every stage; that of the next, {second}, "
            "is up to {more} above it ({where}; {together}).",
            where=_stage_label(results, second),
            **fields,
        )
        return [Sentence(text, sentences.intervals("stages", "sigma", second))]
    first_text = tr(
        "{filter} is best overall: its RMS height error is at most {percent} above the least of a stage "
        "({where}; {together}).",
        percent=_excess(results, ranking, best),
        where=_stage_label(results, best),
        **fields,
    )
    next_text = tr(
        "Next is {second}, whose RMS height error is up to {more} above the least of a stage ({where}; {together}).",
        where=_stage_label(results, second),
        **fields,
    )
    return [
        Sentence(first_text, sentences.intervals("stages", "sigma", best)),
        Sentence(next_text, sentences.intervals("stages", "sigma", second)),
    ]


def _undecided_sentences(results: Sequence[CaseResult], ranking: OverallRanking) -> list[Sentence]:
    """The filters among which noise decides which is best overall, and how far the first is above the least."""
    best, together = ranking.worst_stages.iloc[0], comparisons_together(ranking.looks)
    filters = list_filters([best["filter"], *ranking.close], stage_ranking.MAX_CLOSE_NAMES)
    undecided_text = tr(
        "No filter is surely best overall in RMS height error: {filters} are not distinguished ({together}).",
        filters=filters,
        together=together,
    )
    first_text = tr(
        "The RMS height error of {filter} is never more than {percent} above the least of a stage ({where}, where "
        "{best} is best; {together}).",
        filter=quote_name(best["filter"]),
        together=together,
        percent=_excess(results, ranking, best),
        where=_stage_label(results, best),
        best=quote_name(ranking.best_by_stage.loc[(best["case"], best["stage"])]),
    )
    rows = ranking.worst_stages[ranking.worst_stages["filter"].isin([best["filter"], *ranking.close])]
    return [
        Sentence(undecided_text, sentences.intervals("stages", "sigma", rows)),
        Sentence(first_text, sentences.intervals("stages", "sigma", best)),
    ]


def _excess(results: Sequence[CaseResult], ranking: OverallRanking, row: "pd.Series[Any]") -> str:
    """How far the σ of a row is above that of the best filter of its stage, %, to three digits."""
    result = next(result for result in results if result.name == row["case"])
    best = ranking.best_by_stage.loc[(row["case"], row["stage"])]
    return wording.estimate(stage_ranking.percent_above(result, row, best, ranking.looks).estimate, "%", ",.3g")


def _stage_label(results: Sequence[CaseResult], row: "pd.Series[Any]") -> str:
    """The stage of a row, after its case where there are several."""
    case_names = dict(
        zip((result.name for result in results), case_selection.distinct_case_names(results), strict=True)
    )
    stage = tr(str(row["stage"]))
    return f"{case_names[row['case']]}, {stage}" if len(results) > 1 else stage

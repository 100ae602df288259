"""What the report of P2's experiments asks and answers, in sentences."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from radarsim.config.experiment import Experiment
from radarsim.engine.results import CaseResult
from radarsim.language import few, plural, term, tr
from radarsim.report import panels, tables, wording

if TYPE_CHECKING:
    import pandas as pd


def question(experiment: Experiment) -> str:
    """What the experiment asks, in one sentence."""
    filters = list(dict.fromkeys(f.name for case in experiment.cases for f in case.spec.filters))
    cases = len(experiment.cases)
    if cases == 1:
        return tr("How accurately do {filters} track the target?", filters=few(filters))
    return plural(
        "How accurately do {filters} track the target in {count} case?",
        "How accurately do {filters} track the target in {count} cases?",
        cases,
        filters=few(filters),
    )


def answer(results: Sequence[CaseResult], made: Mapping) -> list[str]:
    """The filter that comes closest to the best one of every stage; else, and for one case, the least σ by stage."""
    first = _closest_to_the_best(results, made["stages"])
    if first and len(results) > 1:
        return first
    shown, others = panels.reported(results, 4)
    quantities = [("y", term("the height")), *([("vy", term("the rate of climb"))] if len(results) == 1 else [])]
    told = [panels.at_its_place(result, _least(result, made["stages"], *of)) for result in shown for of in quantities]
    return [*first, *told, *others]


def _closest_to_the_best(results: Sequence[CaseResult], stages: "pd.DataFrame") -> list[str]:
    """The filter whose σ of the height is nowhere far above the least of a stage, that stage, and the next filter. Of
    filters that all cases have; nothing where there are not two."""
    rows = stages[(stages["component"] == "y") & (stages["sigma"] > 0)]
    rows = rows[rows.groupby("filter")["case"].transform("nunique") == len(results)]
    if rows["filter"].nunique() < 2:
        return []
    least = rows.loc[rows.groupby(["case", "stage"], sort=False)["sigma"].idxmin()].set_index(["case", "stage"])
    best = least.loc[list(zip(rows["case"], rows["stage"], strict=True))]
    rows = rows.assign(above=100 * (rows["sigma"].to_numpy() / best["sigma"].to_numpy() - 1))
    worst = rows.loc[rows.groupby("filter", sort=False)["above"].idxmax()].sort_values("above", kind="stable")
    row, second = worst.iloc[0], worst.iloc[1]
    said = {"filter": row["filter"], "second": second["filter"], "more": _percent(second["above"])}
    if not row["above"]:
        return [tr("Least σ of the height in every stage: {filter}; next {second}, at most {more} above it.", **said)]
    beaten_by = least.loc[(row["case"], row["stage"])]
    called = dict(zip((result.name for result in results), panels.names_of(results), strict=True))
    several = len(results) > 1
    return [
        tr(
            "Closest to the best filter of {every}: {filter}, σ of the height at most {percent} above the least "
            "({where}: {sigma}; {best}: {least}); next {second}, {more}.",
            every=tr("each stage of every case") if several else tr("each stage"),
            percent=_percent(row["above"]),
            where=", ".join([*([called[row["case"]]] if several else []), tr(str(row["stage"]))]),
            sigma=_sigma(row),
            best=beaten_by["filter"],
            least=_sigma(beaten_by),
            **said,
        )
    ]


def _percent(value: float) -> str:
    return f"{wording.number(value, 2)} %"


def _least(result: CaseResult, stages: "pd.DataFrame", component: str, quantity: str) -> str:
    """The filter of the least σ in each stage, with the interval."""
    rows: Any = tables.where(stages, case=result.name, component=component)
    best = [own.loc[own["sigma"].idxmin()] for _, own in rows.groupby("stage", sort=False)]
    said = "; ".join(f"{tr(str(row['stage']))}: {row['filter']}, {_sigma(row)}" for row in best)
    return tr("Least σ of {quantity} by stage: {stages}.", quantity=quantity, stages=said)


def _sigma(row: "pd.Series") -> str:
    """σ of a row of the stages with its interval, to three digits."""
    values = (float(f"{row[name]:.3g}") for name in ("sigma", "sigma_lo", "sigma_hi"))
    return wording.estimate(values, panels.unit_of(row["unit"]), ",.10g")

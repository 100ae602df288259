"""What the report of P2's experiments asks and answers, in sentences."""

from collections.abc import Mapping, Sequence
from typing import Any

from radarsim.config.experiment import Experiment
from radarsim.engine.results import CaseResult
from radarsim.language import few, numeral, plural, term, tr
from radarsim.report import panels, tables, wording


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
    """Sentences: which filter has the least σ of the height in each stage, by case; for one case also of the rate of
    climb."""
    shown, others = panels.reported(results, 4)
    height = [f"{panels.plain_label(result)}: {_least(result, made, 'y', term('the height'))}" for result in shown]
    climb = [f"{panels.plain_label(results[0])}: {_least(results[0], made, 'vy', term('the rate of climb'))}"]
    return [*height, *(climb if len(results) == 1 else []), *others]


def _least(result: CaseResult, made: Mapping, component: str, quantity: str) -> str:
    """The filter of the least σ in each stage, with the interval."""
    rows: Any = tables.where(made["stages"], case=result.name, component=component)
    parts = []
    for stage, own in rows.groupby("stage", sort=False):
        best = own.loc[own["sigma"].idxmin()]
        value, low, high = (
            numeral(f"{float(f'{best[name]:.3g}'):,.10g}") for name in ("sigma", "sigma_lo", "sigma_hi")
        )
        ends = wording.interval(low, high)
        parts.append(f"{tr(str(stage))}: {best['filter']}, {value} {panels.unit_of(best['unit'])} {ends}")
    return tr("least σ of {quantity} by stage: {stages}.", quantity=quantity, stages="; ".join(parts))

"""Which filters have the least σ in a stage, as far as their gains on the same noise tell."""

from typing import TYPE_CHECKING, Any

from radarsim.engine.results import CaseResult
from radarsim.language.translate import shorten_names, tr
from radarsim.report import gain_sentences
from radarsim.report.statistics import Estimate
from radarsim.studies.multimodel.tables import stage_gain, stage_names

if TYPE_CHECKING:
    import pandas as pd

MAX_CLOSE_NAMES = 3  # of filters that cannot be distinguished from the best


def least_filters(result: CaseResult, rows: "pd.DataFrame", best: "pd.Series[Any]") -> str:
    """The filter of the least σ in a stage, those equal to it, and those that cannot be distinguished from it.

    rows: of one component; best: the one of the least σ."""
    gains = {
        name: paired_gain(result, best["stage"], best["filter"], name, best["component"])
        for name in rows.loc[rows["stage"] == best["stage"], "filter"]
        if name != best["filter"]
    }
    equal = [name for name, gain in gains.items() if gain.hi - gain.lo < gain_sentences.SINGLE and not gain.lo > 0]
    close = [name for name, gain in gains.items() if not gain.lo > 0 and name not in equal]
    names = " = ".join([best["filter"], *equal])
    if not close:
        return names
    others = shorten_names(close, MAX_CLOSE_NAMES)
    return tr("{filter} (not distinguished from it: {others})", filter=names, others=others)


def paired_gain(result: CaseResult, stage: str, name: str, other: str, component: str = "y") -> Estimate:
    """The gain of a filter over another in a component over a stage, on the same noise."""
    filters, components = list(result.axes.filters), [label for label, _ in result.axes.components]
    return stage_gain(
        result, filters.index(name), filters.index(other), stage_names(result).index(stage), components.index(component)
    )

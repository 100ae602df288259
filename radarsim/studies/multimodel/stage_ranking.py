"""Which filters have the least σ in a stage, as far as their gains on the same noise tell.

The least is chosen by the values themselves: a gain decides by an interval that holds for all pairs compared."""

from typing import TYPE_CHECKING, Any

from radarsim.engine.results import CaseResult
from radarsim.language.translate import list_filters, quote_name
from radarsim.report import gain_sentences, statistics
from radarsim.report.compared_value import ComparedValue
from radarsim.report.statistics import Estimate
from radarsim.studies.multimodel.tables import stage_gain, stage_names

if TYPE_CHECKING:
    import pandas as pd

MAX_CLOSE_NAMES = 2  # of filters that cannot be distinguished from the best


def least_filters(result: CaseResult, rows: "pd.DataFrame", best: "pd.Series[Any]") -> tuple[str, str]:
    """The filter of the least σ in a stage with those equal to it; and those that cannot be distinguished from it.

    rows: of one component; best: the one of the least σ."""
    names = list(rows.loc[rows["stage"] == best["stage"], "filter"])
    pairs = len(names) * (len(names) - 1) // 2
    gains = {
        name: statistics.simultaneous_gains(
            paired_gain(result, best["stage"], best["filter"], name, best["component"]), pairs
        )
        for name in names
        if name != best["filter"]
    }
    equal = [name for name, gain in gains.items() if gain.hi - gain.lo < gain_sentences.SINGLE and not gain.lo > 0]
    close = [name for name, gain in gains.items() if not gain.lo > 0 and name not in equal]
    equal_names = " = ".join(map(quote_name, [best["filter"], *equal]))
    return equal_names, list_filters(close, MAX_CLOSE_NAMES) if close else ""


def percent_above(result: CaseResult, row: "pd.Series[Any]", best_filter: str, looks: int) -> ComparedValue:
    """By how many per cent σ of a row of the stages is above that of another filter, which was chosen as the least.

    The interval is that of the gain on the same noise, for all `looks` at values among which they were chosen."""
    gain = paired_gain(result, row["stage"], row["filter"], best_filter, row["component"])
    return ComparedValue(gain, is_exact=False, kind="gain").chosen_among(looks).mapped(lambda percent: 0.0 - percent)


def paired_gain(result: CaseResult, stage: str, name: str, other: str, component: str = "y") -> Estimate:
    """The gain of a filter over another in a component over a stage, on the same noise."""
    filters, components = list(result.axes.filters), [label for label, _ in result.axes.components]
    return stage_gain(
        result, filters.index(name), filters.index(other), stage_names(result).index(stage), components.index(component)
    )

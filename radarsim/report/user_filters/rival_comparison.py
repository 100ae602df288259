"""The rows by which a user filter is compared with the config's filters: its rivals, and at which scan."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from radarsim.engine.results import CaseResult
from radarsim.language.translate import list_filters, quote_name, tr
from radarsim.report import compared_value, gain_sentences, key_labels
from radarsim.report import tables as common
from radarsim.report.compared_value import ComparedValue
from radarsim.report.quantities import GAIN
from radarsim.report.user_filters.rows import TablesByName, user_filter_cases

if TYPE_CHECKING:
    import pandas as pd


TUNED = ", tuned"  # the end of the names of filters that `radarsim tune` has tuned
ROUNDING = 1e-9  # relative difference of σ of filters that are the same but for rounding


@dataclass(frozen=True)
class RivalComparison:
    """The rows by which a user filter is compared with the config's filters: of one component at one scan."""

    name: str
    unit: str
    gains: "pd.DataFrame"  # against every other filter
    sigma: "pd.Series[Any]"  # of `curves`: the user filter's
    rivals: Mapping[str, "pd.Series[Any]"]  # of `curves`: the best filter, then the best tuned one
    equal: tuple[str, ...]  # the config's other filters with the σ of its best one, but for rounding
    dependence: str  # why the user filter has no intervals; empty where it has

    @property
    def best(self) -> str:
        return next(iter(self.rivals))

    @property
    def best_name(self) -> str:
        """The config's best filter in a sentence, with those that are equal to it."""
        name = quote_name(self.best)
        return tr("{name} (equal to {others})", name=name, others=list_filters(self.equal)) if self.equal else name

    @property
    def best_sigma(self) -> ComparedValue:
        return compared_value.row_value(self.rivals[self.best])

    @property
    def has_same_realisations(self) -> bool:
        """Whether the user filter has an estimate in as many realisations as the config's best filter."""
        return bool(self.sigma["n"] == self.rivals[self.best]["n"])

    @property
    def is_equal(self) -> bool:
        """Whether it has the same errors as the config's best filter, wherever both have an estimate."""
        return gain_sentences.is_equal(self.gain_against(self.best))

    def row_against(self, baseline: str) -> "pd.Series[Any]":
        return self.gains[self.gains["baseline"] == baseline].iloc[0]

    def gain_against(self, baseline: str) -> ComparedValue:
        return compared_value.row_value(self.row_against(baseline), GAIN)

    def gain_text(self, baseline: str) -> str:
        """The gain against a baseline with its interval, or what was not seen of equal filters."""
        return gain_sentences.percent_text(self.gain_against(baseline), self.sigma["n"])

    @cached_property
    def own_sigma(self) -> ComparedValue:
        """σ of the user filter: beside an exact rival that times the paired ratio, else measured."""
        if self.best_sigma.is_exact and self.has_same_realisations:
            return compared_value.paired_sigma(self.best_sigma.value, self.row_against(self.best))
        return compared_value.row_value(self.sigma)


def worst_comparison(
    result: CaseResult, name: str, gains: "pd.DataFrame", tables_by_name: TablesByName
) -> RivalComparison:
    """The comparison by which a filter is judged: at the point asked for, else at the worst of those that the study's
    answer is about."""
    axes = user_filter_cases(result)[0].axes
    points = [axes.answer_at] if axes.answer_at else axes.answer_points
    present = set(gains["component"])
    first = next(component for component, _ in result.axes.components if component in present)
    usable_points = [point for point in points if point[0] in present] or [(first, points[-1][1])]
    comparisons = [compare_with_rivals(result, name, gains, tables_by_name, point) for point in usable_points]
    return min(comparisons, key=lambda comparison: comparison.row_against(comparison.best)["gain_percent"])


def compare_with_rivals(
    result: CaseResult, name: str, gains: "pd.DataFrame", tables_by_name: TablesByName, point: tuple[str, float]
) -> RivalComparison:
    """The rows of a component at the scan next to a time."""
    (component, unit), t_s = next(c for c in result.axes.components if c[0] == point[0]), point[1]
    gains = gains[gains["component"] == component]
    distance_s = (gains["t_s"] - min(t_s, gains["t_s"].max())).abs()
    gains = gains[gains["k"] == gains["k"][distance_s.idxmin()]]
    curves = common.select_rows(tables_by_name["curves"], case=result.name, component=component, k=gains["k"].iloc[0])
    rows = {row["filter"]: row for _, row in curves.iterrows()}
    baselines = [baseline for baseline in gains["baseline"] if baseline in result.axes.filters]
    rank = _ranks(baselines, rows, gains)
    tuned = [baseline for baseline in baselines if baseline.endswith(TUNED)]
    best = min((baseline for baseline in baselines if baseline not in tuned), key=rank.__getitem__)
    rivals = {rival: rows[rival] for rival in (best, *sorted(tuned, key=rank.__getitem__)[:1])}
    dependence = dict(user_filter_cases(result)[0].axes.dependent).get(name, "")
    equal = tuple(
        baseline
        for baseline in baselines
        if baseline != best and math.isclose(rows[baseline]["sigma"], rows[best]["sigma"], rel_tol=ROUNDING)
    )
    return RivalComparison(name, key_labels.unit_label(unit), gains, rows[name], rivals, equal, dependence)


def _ranks(baselines: Sequence[str], rows: Mapping[str, "pd.Series[Any]"], gains: "pd.DataFrame") -> dict[str, float]:
    """By what the config's filters are ranked: exact σ where all have it, else how little is gained against them."""
    exact = {baseline: float(rows[baseline].get("exact_sigma", np.nan)) for baseline in baselines}
    if not np.isnan(list(exact.values())).any():
        return exact
    return dict(zip(gains["baseline"], gains["gain_percent"], strict=True))

"""Figures of σ, gain and NEES with user filters among the config's."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from radarsim.config.experiment import Experiment
from radarsim.engine.results import CaseResult
from radarsim.report import case_selection, consistency_figures, key_labels, time_figures
from radarsim.report import tables as common
from radarsim.report.drawing.model import Figure
from radarsim.report.quantities import RADIAL, Component
from radarsim.report.user_filters.rows import TablesByName, append, user_filter_cases


def figures(
    results: Sequence[CaseResult],
    tables_by_name: TablesByName,
    experiment: Experiment,
    study_figures: Mapping[str, Figure],
    shown_components: Sequence[Component],
) -> dict[str, Figure]:
    """σ, gain and NEES over time with the user filters: in place of the study's figures of these names.

    σ and gain at least of the first component. shown_components: the components as the study calls them."""
    if not any(result.user_filters for result in results):
        return {}
    combined = [
        case for case, result in zip(with_user_filters_in_cases(results), results, strict=True) if result.user_filters
    ]
    by_name = {component.name: component for component in (*RADIAL, *shown_components)}
    components = [
        by_name.get(name, Component(name, unit, key_labels.component_symbol(name), name))
        for name, unit in combined[0].axes.components
    ]
    rows = {**tables_by_name, "gains": common.gains_against_baselines(tables_by_name["gains"], combined)}
    figures_by_name = time_figures.component_figures(combined, rows, components, experiment)
    consistency = tables_by_name.get("consistency")
    if "nees" in tables_by_name and consistency is not None and {"t_s", "nees"} <= set(consistency) - {"component"}:
        nees = append(consistency, tables_by_name["nees"])
        figures_by_name |= consistency_figures.consistency_figures(
            case_selection.unswept_cases(combined), nees, experiment
        )
    always = {f"{kind}_{components[0].name}" for kind in ("gain", "sigma")}
    return {name: figure for name, figure in figures_by_name.items() if name in study_figures or name in always}


def with_user_filters_in_cases(results: Sequence[CaseResult]) -> list[CaseResult]:
    """The cases with user filters among their own, as figures that are drawn from tables alone need it."""
    return [_with_user_filters(result) if result.user_filters else result for result in results]


def _with_user_filters(result: CaseResult) -> CaseResult:
    (user_case,) = user_filter_cases(result)
    arrays = {
        name: np.concatenate([getattr(result.axes, name), getattr(user_case.axes, name)])
        for name in ("available", "exact_sigma", "exact_bias")
    }
    filters = (*result.axes.filters, *user_case.axes.filters)
    axes = replace(user_case.axes, filters=filters, baseline=result.axes.baseline, **arrays)
    return replace(result, axes=axes)

"""Tables, figures and sentences of filters in the plane: σ along and across the line of sight, gain over two keys."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from radarsim.engine.results import CaseResult
from radarsim.kernels.polar_plots import polar
from radarsim.language.translate import join_names, quote_name, term, tr
from radarsim.report import case_selection, statistics, tables, time_figures
from radarsim.report.drawing.model import Figure
from radarsim.report.quantities import Component
from radarsim.report.sentences import Sentence

if TYPE_CHECKING:
    import pandas as pd

    from radarsim.config.experiment import Experiment
    from radarsim.studies.planar import PlanarStudy

ACROSS = Component("across", "m", "$\\perp$", term("position across the line of sight"))


def position_columns(study: "PlanarStudy", result: CaseResult) -> Mapping[str, Any]:
    """σ of position along the line of sight, that of the range, and across it, that of the bearing times the range.

    range_m: range of the flight whose course is in the middle of its spread
    sigma_m ±: σ of position along the line of sight, or across it, as `component` says"""
    f, k, c = np.nonzero(result.axes.available[:, :, :2])
    r = np.array([polar(x)[0] for x in study.moving_flight(result.spec)])[k]
    n = tables.realisation_counts(result)[f, k, c]
    sigma = statistics.errors(np.asarray(result.sums["error"])[f, k, c], n).sigma
    factor = np.where(c == 1, r, 1.0)
    return {
        **tables.label_columns(result, f, k, component=np.array(["along", "across"], dtype=object)[c]),
        "n": n.astype(int),
        "range_m": r,
        **tables.interval_columns("sigma_m", statistics.Estimate(*(factor * end for end in sigma))),
    }


def position_figure(results: Sequence[CaseResult], positions: "pd.DataFrame", experiment: "Experiment") -> Figure:
    """σ of position across the line of sight against time."""
    columns = {"sigma_m": "sigma", "sigma_m_lo": "sigma_lo", "sigma_m_hi": "sigma_hi"}
    rows = positions.rename(columns=columns).assign(exact_sigma=np.nan)
    groups = tables.group_by(rows, "case", "filter", "component")
    names = case_selection.cases_for_figure(experiment, "position")
    visible, remark = case_selection.select_cases_by_panel(results, names)
    across = time_figures.sigma_figure("position", visible, groups, ACROSS)
    return replace(across, caption=across.caption + remark)


def unused_velocity_sentences(study: "PlanarStudy", result: CaseResult) -> list[Sentence]:
    """The filters that never know the fold of a velocity, if there are any."""
    spec = result.spec
    folds = study.span_mps(spec) is not None
    blind = [quote_name(keys.name) for keys in spec.filters if folds and not study.tells_folds(spec, keys)]
    if not blind:
        return []
    text = tr(
        "No velocity counts in {filters}: its fold is never known (a higher repetition_rate_hz, "
        "or a smaller process noise).",
        filters=join_names(blind),
    )
    return [Sentence(case_selection.after_swept_values(result, text))]

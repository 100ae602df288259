"""Figures of NEES against time, of every study."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from radarsim.config.experiment import Experiment
from radarsim.engine.results import CaseResult
from radarsim.language.translate import term, tr
from radarsim.report import tables as common
from radarsim.report.case_selection import cases_for_figure, group_by_panel, select_cases_by_panel
from radarsim.report.drawing.model import Figure, Panel
from radarsim.report.figure_lines import all_filters, ratio_panels
from radarsim.report.panel_layout import arrange_columns

if TYPE_CHECKING:
    import pandas as pd


NEES = term("NEES per component")


def consistency_figures(
    results: Sequence[CaseResult], table: "pd.DataFrame", experiment: Experiment
) -> dict[str, Figure]:
    """The figure `consistency` of a table with NEES by case, filter and time, a panel for each config."""
    rows = {(*key, "nees"): filter_rows for key, filter_rows in common.group_by(table, "case", "filter").items()}
    visible, left_out = select_cases_by_panel(results, cases_for_figure(experiment, "consistency"))
    return {"consistency": nees_figure(nees_panels(visible, rows), left_out)}


def nees_panels(results: Sequence[CaseResult], rows: Mapping) -> list[Panel]:
    """NEES against time, a panel for each config; rows by case, filter and `nees`."""
    filters = all_filters(results)
    return [
        panel
        for title, members in group_by_panel(results).items()
        for panel in ratio_panels(title, members, rows, tr(NEES), filters)
    ]


def nees_figure(panels: Sequence[Panel], left_out: str) -> Figure:
    """The figure `consistency` of such panels; its caption names the panels left out."""
    caption = tr(
        "Mean of the normalised squared error eᵀP⁻¹e per estimated component, with the filter's own "
        "covariance P: one (dotted) for a consistent filter, more for an optimistic one, less for a "
        "pessimistic one."
    )
    title = tr("Consistency of the filters")
    return arrange_columns(Figure("consistency", title, caption + left_out, tuple(panels)))

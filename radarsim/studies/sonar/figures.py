"""The figures of a sonar's cases."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from radarsim.config.experiment import Experiment
from radarsim.engine.results import CaseResult
from radarsim.report import case_selection, key_labels, tables, time_figures
from radarsim.report.drawing.model import Figure
from radarsim.studies.sonar.axes import GivenPlotsAxes, SonarAxes
from radarsim.studies.sonar.components import COMPONENTS
from radarsim.studies.sonar.sigma_figure import sigma_figure
from radarsim.studies.sonar.smoothing_figures import (
    believed_figure,
    conversion_figure,
    gains_figure,
    missed_figure,
    plots_figure,
)

if TYPE_CHECKING:
    import pandas as pd


TABLES_OF_FIGURES = {"missed": ("curves",), "believed": ("curves", "consistency")}


def figures(
    results: Sequence[CaseResult[SonarAxes]], tables_by_name: "Mapping[str, pd.DataFrame]", experiment: Experiment
) -> dict[str, Figure | None]:
    """sigma_<component> of every component that some case has; and the figures of filters that know their plots."""
    curves = tables.group_by(tables_by_name["curves"], "case", "filter", "component")
    figures_by_name: dict[str, Figure | None] = {}
    for component in COMPONENTS:
        name = f"sigma_{component.name}"
        results_with_component = [result for result in results if component.name in dict(result.axes.components)]
        chosen, left_out = case_selection.select_cases(
            results_with_component, case_selection.cases_for_figure(experiment, name)
        )
        if chosen:
            figure = sigma_figure(name, chosen, curves, component, left_out)
            if figure and len(results) == 1:
                figure = time_figures.with_floor(
                    figure,
                    tables_by_name["curves"],
                    component.name,
                    key_labels.degrees_factor_and_unit(component.unit)[0],
                )
            figures_by_name[name] = figure
    given_plots_results: Any = [result for result in results if isinstance(result.axes, GivenPlotsAxes)]
    of_tables = {"plots": plots_figure, "smoothing_gains": gains_figure, "conversion": conversion_figure}
    smoothing_figures = {name: draw(tables_by_name[name]) for name, draw in of_tables.items() if name in tables_by_name}
    smoothing_figures["believed"] = believed_figure(
        given_plots_results, tables_by_name["curves"], tables_by_name["consistency"]
    )
    smoothing_figures["missed"] = missed_figure(given_plots_results, tables_by_name["curves"])
    return figures_by_name | smoothing_figures

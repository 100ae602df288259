"""The study's figures, as data; radarsim draws them, on paper and in the report.

Yours: further figures, of the marks in radarsim.report.drawing; their names go into `figure_names` of the config too.
"""

from collections.abc import Mapping, Sequence

from radarsim.config.experiment import Experiment
from radarsim.engine.results import CaseResult
from radarsim.language import term
from radarsim.report import panels
from radarsim.report.drawing import Figure
from radarsim.report.quantities import Component

# Yours: each component's name, unit, letter and words.
COMPONENTS = (Component("x", "m", "$x$", term("position")),)


def figures(results: Sequence[CaseResult], made: Mapping, experiment: Experiment) -> dict[str, Figure]:
    """sigma_x: σ(t) of every case and filter, with exact values; gain_x: the gain against the baseline."""
    return panels.per_component(results, made, COMPONENTS, experiment)

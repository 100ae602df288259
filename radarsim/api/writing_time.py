"""The time that tables, figures and report of an experiment take, measured on a few of its realisations."""

import time
from collections.abc import Sequence

from radarsim.api import arguments, configs
from radarsim.api.case_results import case_result
from radarsim.api.case_work import CaseWork
from radarsim.config.experiment import Experiment
from radarsim.engine.collect import collect

MEASURED_REALISATIONS = 2  # the time of tables and figures does not depend on their number
MARGIN = 1.25  # for the report, for files, and for slower figures of other cases


def writing_seconds(experiment: Experiment, figures: bool | str | Sequence[str], width_mm: float | None) -> float:
    """Estimated seconds for writing: the tables of the first case, times the cases, and one figure of each kind, times
    their number, measured here."""
    from radarsim.api import result_content

    case = experiment.cases[0]
    work = CaseWork(case)
    result = case_result(case, work, collect(work, MEASURED_REALISATIONS))
    result_content.case_tables([result])  # a first call, so that imports are not timed
    started = time.perf_counter()
    tables_by_name = result_content.case_tables([result], configs.shipped_stem(experiment))
    tables_s = (time.perf_counter() - started) * len(experiment.cases)
    formats = arguments.figure_formats(figures)
    figures_by_name = result_content.case_figures([result], tables_by_name, experiment) if formats else {}
    if not figures_by_name:
        return MARGIN * tables_s
    from radarsim.report.drawing.canvas import draw

    names = experiment.selected_figures(figures_by_name) or list(figures_by_name)
    started = time.perf_counter()
    for name in dict.fromkeys((names[0], names[-1])):
        draw(figures_by_name[name], formats, width_mm)
    figure_s = (time.perf_counter() - started) / len(dict.fromkeys((names[0], names[-1])))
    return MARGIN * (tables_s + figure_s * (len(experiment.figures) or len(names)))

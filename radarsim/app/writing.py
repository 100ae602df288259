"""How long tables, figures and report of an experiment take, measured on a few of its realisations."""

import time
from collections.abc import Sequence

from radarsim.app import arguments, output
from radarsim.app.simulation import result_of
from radarsim.app.work import CaseWork
from radarsim.config.experiment import Experiment
from radarsim.engine.collect import collect

REALISATIONS = 2  # what tables and figures take does not depend on their number
SPARE = 1.25  # for the report, for files and for what a picture of one case does not show


def seconds(experiment: Experiment, figures: bool | str | Sequence[str], width_mm: float | None) -> float:
    """An estimate of the seconds that writing takes: the tables of the first case, times the cases, and one figure of
    each kind, times their number, measured here."""
    case = experiment.cases[0]
    work = CaseWork(case)
    result = result_of(case, work, collect(work, REALISATIONS))
    output.tables([result])  # what it loads is not to be counted for every case
    started = time.perf_counter()
    made = output.tables([result], experiment.stem)
    tables = (time.perf_counter() - started) * len(experiment.cases)
    formats = arguments.formats(figures)
    described = output.figures([result], made, experiment) if formats else {}
    if not described:
        return SPARE * tables
    from radarsim.report import figures as drawing

    names = list(described)
    started = time.perf_counter()
    for name in dict.fromkeys((names[0], names[-1])):
        drawing.save(described[name], formats, width_mm, "")
    each = (time.perf_counter() - started) / len(dict.fromkeys((names[0], names[-1])))
    return SPARE * (tables + each * len(names))

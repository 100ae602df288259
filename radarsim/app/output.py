"""From finished cases to files: tables, figures, claims, run.json and report.html of one experiment."""

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from radarsim.app import configs
from radarsim.app.stored_readings import classes_of
from radarsim.config.experiment import Experiment
from radarsim.engine import machine
from radarsim.engine.results import CaseResult
from radarsim.language import tr
from radarsim.report import agreement, claims, files, notes, provenance, seen, sweeps
from radarsim.report import tables as common
from radarsim.report.chart_text import spoken
from radarsim.report.claims import forest
from radarsim.report.claims.classes import OVER, with_classes
from radarsim.report.drawing import Figure
from radarsim.studies.registry import study

if TYPE_CHECKING:
    import pandas as pd


def tables(results: Sequence[CaseResult], stem: str = "") -> dict:
    """All tables of an experiment by the stem of their file: curves, gains, the study's own, claims.

    A study whose errors are not of all realisations at common scans makes its own curves and gains. stem is the
    config's: all claims of it are in the table of claims, also those that it cannot judge any more.
    """
    of = study(results[0].study)
    made = measured(results)
    verdicts = claims.judged(of.claims(), results, made, configs.shipped, stem)
    made["claims"] = over_readings(verdicts, results[0].study)
    return notes.noted(made, results, of.exact_errors)


def over_readings(verdicts: "pd.DataFrame", name: str, out: Path | None = None) -> "pd.DataFrame":
    """claims.csv of a study with the classes over all readings: those under `out`, else those that are shipped."""
    of = study(name)
    readings, papers = of.readings(), of.claims()
    if readings is None or papers is None or not len(verdicts):
        return verdicts
    own: Any = verdicts.to_dict("records")
    rows = with_classes(own, classes_of([(readings, papers)], out))
    return verdicts.assign(**{column: [row[column] for row in rows] for column in OVER})


def measured(results: Sequence[CaseResult]) -> dict:
    """The tables of what was measured alone: curves, gains, and the study's own."""
    own = study(results[0].study).tables(results)
    shared = {"curves": common.curves, "gains": common.gains}
    return {name: own[name] if name in own else table(results) for name, table in shared.items()} | own


def figures(
    results: Sequence[CaseResult], made: Mapping[str, "pd.DataFrame"], experiment: Experiment
) -> dict[str, Figure]:
    """The figures of an experiment, described, by the stem of their file: the study's own, and of sweeps."""
    own = study(results[0].study)
    drawn = dict(own.figures(results, _banded(made), experiment))
    if (judged := forest.figure(made["claims"].to_dict("records"))) is not None:
        drawn["claims"] = judged
    if any(notes.heavy(made[name]).any() for name in ("curves", "gains")):
        drawn = {
            name: _said(figure) if name.startswith(("sigma", "gain")) else figure for name, figure in drawn.items()
        }
    if not own.draws_sweeps:
        drawn |= sweeps.figures(results, common.groups(made["curves"], "case", "filter", "component"))
    return {name: seen.crossed(figure) for name, figure in drawn.items()}


def _said(figure: Figure) -> Figure:
    """The figure whose caption says why a band is missing."""
    said = tr("No band where few large errors decide.")
    return replace(figure, caption=f"{figure.caption} {said}")


def _banded(made: Mapping[str, "pd.DataFrame"]) -> Mapping[str, "pd.DataFrame"]:
    """The tables for figures: σ and gains without an interval where theirs is marked."""
    thinned = {}
    for name, ends in (("curves", ("sigma_lo", "sigma_hi")), ("gains", ("gain_lo", "gain_hi"))):
        table = made[name]
        if (thin := notes.heavy(table)).any():
            thinned[name] = table.assign(**{end: table[end].mask(thin) for end in ends})
    return {**made, **thinned}


@dataclass(frozen=True)
class Written:
    """What was written: the folder, its files by their path in it, the tables, and the sentences of the answer.

    removed are files of an earlier run that this one did not write. seconds: what drawing took, and writing with the
    report.
    """

    folder: Path
    files: tuple[str, ...]
    removed: tuple[str, ...]
    tables: Mapping[str, "pd.DataFrame"] = field(repr=False)
    answer: tuple[str, ...]
    seconds: Mapping[str, float]


ALWAYS = ("curves", "gains")  # tables written without a row too; others only where they have one


def write(
    experiment: Experiment,
    results: Sequence[CaseResult],
    folder: Path,
    run: Mapping[str, Any],
    *,
    draw: bool = True,
    made: "Mapping[str, pd.DataFrame] | None" = None,
    formats: Sequence[str] = ("svg", "png"),
    width_mm: float | None = None,
) -> Written:
    """Write all of an experiment's outputs into folder; every file at once, none half.

    run holds the facts of the run for run.json: see provenance.record; made the tables, where they are at hand; formats
    those of the figures' files, width_mm their width in place of their own. Outputs of an earlier run that this one
    does not write (figures without `draw`) are removed, so that nothing stale stands beside new numbers.
    """
    from radarsim.report import html

    made = tables(results, stem=experiment.stem) if made is None else made
    contents = {f"{name}.csv": common.to_csv(table) for name, table in made.items() if len(table) or name in ALWAYS}
    began = time.perf_counter()
    described = figures(results, made, experiment) if draw else {}
    if draw:
        from radarsim.report import figures as drawing  # Matplotlib

        made_by = (
            f"radarsim {provenance.versions()['radarsim']}, {experiment.stem}, config {provenance.asked(experiment)}"
        )
        for name, figure in described.items():
            saved = drawing.save(figure, formats, width_mm, made_by)
            contents |= {f"figures/{name}.{kind}": data for kind, data in saved.items()}
        contents["figures/captions.md"] = captions(described).encode()
    drawn = time.perf_counter()
    own = study(experiment.study)
    answer = tuple(own.answer(results, made))
    of_intervals = provenance.of_intervals(results, made, partial(own.answer, results))
    run = {**run, "warnings": [*run.get("warnings", ()), *of_intervals]}
    record = provenance.record(experiment, results, run, contents, answer, machine.described())
    page = html.page(
        experiment,
        made,
        list(described.values()),
        record,
        answer,
        own.question(experiment),
        inputs=own.inputs(results),
        cost=own.cost(made, run),
        agreement=agreement.agreement(made["curves"]) if own.exact_errors else None,
        drawn_from=own.drawn_from(),
    )
    contents["report.html"] = page.encode()
    contents["run.json"] = provenance.to_json(provenance.with_output(record, "report.html", contents["report.html"]))
    removed = sorted(set(provenance.outputs(folder)) - set(contents))
    files.replace_all(folder, contents, stale=provenance.outputs)
    seconds = {"drawing": drawn - began, "writing": time.perf_counter() - drawn}
    return Written(folder, tuple(sorted(contents)), tuple(removed), made, answer, seconds)


def captions(described: Mapping[str, Figure]) -> str:
    """The captions of figures as Markdown: what each shows, then how it is drawn."""
    parts = [f"## {name}\n\n**{spoken(one.title)}.** {spoken(one.caption)}\n" for name, one in described.items()]
    return "\n".join([f"# {tr('Captions')}\n", *parts])

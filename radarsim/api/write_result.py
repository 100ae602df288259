"""The files of a result."""

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from radarsim.api import configs
from radarsim.api.earlier_outputs import earlier_outputs, remaking_options
from radarsim.api.result_config import config_files
from radarsim.api.result_content import (
    captions,
    case_figures,
    case_tables,
    make_answer,
    question_text,
    undeclared_figures,
)
from radarsim.config.complete_config import CONFIG_FILE
from radarsim.config.experiment import Experiment
from radarsim.engine.machine import machine_facts
from radarsim.engine.results import CaseResult
from radarsim.errors import AUTHOR_ERRORS, RadarsimError
from radarsim.language.translate import tr
from radarsim.report import atomic_files, csv_text, exact_check, provenance
from radarsim.report.case_selection import swept_cases, swept_keys
from radarsim.report.drawing.model import Figure
from radarsim.report.drawing.page_figure import DrawnFigure
from radarsim.report.page_links import sources_behind_figure
from radarsim.report.quantities import RADIAL
from radarsim.report.row_notes import with_note_texts
from radarsim.report.user_filters import rows as user_filters_rows
from radarsim.studies.registry import study

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True)
class WrittenFiles:
    """Output of `write_files`: the folder, its files by their path in it, the tables, and the sentences of the answer.

    files: with those of an earlier run that stay. removed: those that do not; remaking_options: of the command, which
    write them again. seconds: of drawing, and of writing with the report.
    answer_warnings: on the intervals that the answer rests on, and on figures that are wider than asked for.
    main_count: see `Answer`."""

    folder: Path
    files: tuple[str, ...]
    removed: tuple[str, ...]
    remaking_options: tuple[str, ...]
    tables: Mapping[str, "pd.DataFrame"] = field(repr=False)
    answer: tuple[str, ...]
    seconds: Mapping[str, float]
    answer_warnings: tuple[str, ...]
    main_count: int


ALWAYS_WRITTEN = ("curves", "gains")  # tables written even without a row; others only if they have rows


def write_files(
    experiment: Experiment,
    results: Sequence[CaseResult],
    folder: Path,
    run: Mapping[str, Any],
    *,
    draw: bool = True,
    tables_by_name: "Mapping[str, pd.DataFrame] | None" = None,
    formats: Sequence[str] = ("svg",),
    width_mm: float | None = None,
) -> WrittenFiles:
    """Write all outputs of an experiment into folder; each file completely or not at all.

    run: the facts of the run for run.json, see provenance.record; tables_by_name: the tables, if at hand; formats: of
    the figures' files; width_mm overrides their width. Outputs of an earlier run that this one does not write are
    removed, so that nothing stale remains, except figures and the table of runs where the earlier run has the same
    numbers. Where figures or sentences of a package's study fail, only the tables are written."""
    from radarsim.report import headlines, page

    if tables_by_name is None:
        tables_by_name = case_tables(results, configs.shipped_stem(experiment))
    contents = {
        f"{name}.csv": csv_text.to_csv(table)
        for name, table in tables_by_name.items()
        if len(table) or name in ALWAYS_WRITTEN
    }
    case_study, draw_start = study(experiment.study), time.perf_counter()
    try:
        figures_by_name = _selected_figures(experiment, results, tables_by_name) if draw else {}
        answer = make_answer(results, tables_by_name)
        sources = {
            name: sources_behind_figure(name, case_study.drawn_from(), tables_by_name) for name in figures_by_name
        }
        figures_by_name = headlines.with_headlines(
            *(figures_by_name, answer.marked_texts, answer.sources, sources, swept_cases(results), swept_keys(results)),
            case_study.user_filter_components() or RADIAL,
        )
        question = question_text(experiment)
    except RadarsimError:
        raise
    except AUTHOR_ERRORS:  # in a package's figures or sentences, on which the tables do not depend
        atomic_files.replace_all(folder, contents, stale=provenance.outputs)
        raise
    drawings = _draw(experiment, figures_by_name, formats, width_mm) if draw else []
    for name, drawing in zip(figures_by_name, drawings, strict=True):
        contents |= {f"figures/{name}.{kind}": data for kind, data in drawing.files.items()}
    if draw:
        contents["figures/captions.md"] = captions(figures_by_name).encode()
    draw_end = time.perf_counter()
    kept_config = config_files(experiment, results, taken_paths=(*contents, *provenance.RECORD_FILES))
    contents |= kept_config
    if data_files := [name for name in kept_config if name != CONFIG_FILE]:
        run = {**run, "data_files": data_files}
    tables_by_name = {name: with_note_texts(table) for name, table in tables_by_name.items()}
    warnings = (*answer.warnings, *_widened_figures(drawings, width_mm))
    run = {**run, "warnings": [*run.get("warnings", ()), *warnings, *undeclared_figures(case_study, figures_by_name)]}
    with atomic_files.folder_lock(folder):
        record = provenance.record(experiment, results, run, contents, answer.texts, machine_facts())
        earlier = earlier_outputs(folder, record)
        record["outputs"] = dict(sorted({**earlier.lasting, **record["outputs"]}.items()))
        report = page.report_page(
            experiment,
            tables_by_name,
            drawings,
            record,
            answer.texts,
            question,
            inputs=case_study.inputs(results),
            cost=case_study.cost(user_filters_rows.without_user_filters(tables_by_name, results), run),
            agreement=exact_check.agreement_table(tables_by_name["curves"]) if case_study.exact_errors else None,
            drawn_from=case_study.drawn_from(),
            config_text=kept_config.get(CONFIG_FILE, b"").decode(),
        )
        contents["report.html"] = report.encode()
        record = provenance.with_output(record, "report.html", contents["report.html"])
        contents["run.json"] = provenance.to_json(record)
        removed = sorted({*earlier.removable} - {*contents})
        atomic_files.replace_all(folder, contents, stale=lambda folder: removed)
    return WrittenFiles(
        folder=folder,
        files=tuple(sorted({*contents, *earlier.lasting})),
        removed=tuple(removed),
        remaking_options=remaking_options(removed, earlier.runs_table),
        tables=tables_by_name,
        answer=answer.texts,
        seconds={"drawing": draw_end - draw_start, "writing": time.perf_counter() - draw_end},
        answer_warnings=warnings,
        main_count=answer.main_count,
    )


def _widened_figures(drawings: Sequence[DrawnFigure], width_mm: float | None) -> tuple[str, ...]:
    """A line for each figure that was drawn wider than asked for."""
    return tuple(
        tr(
            "figure {name}: drawn {width:g} mm wide, as at {wanted:g} mm words would be cut or the page exceeded",
            name=drawing.figure.name,
            width=drawing.figure.width_mm,
            wanted=width_mm,
        )
        for drawing in drawings
        if width_mm is not None and drawing.figure.width_mm > width_mm
    )


def _selected_figures(
    experiment: Experiment, results: Sequence[CaseResult], tables_by_name: "Mapping[str, pd.DataFrame]"
) -> dict[str, Figure]:
    """The figures that the config selects, after the first of user filters: the answer is about it."""
    all_figures = case_figures(results, tables_by_name, experiment)
    first_figures = [*all_figures][:1] if any(result.user_filters for result in results) else []
    names = dict.fromkeys([*first_figures, *experiment.selected_figures(all_figures)])
    return {name: all_figures[name] for name in names}


def _draw(
    experiment: Experiment, figures_by_name: Mapping[str, Figure], formats: Sequence[str], width_mm: float | None
) -> list[DrawnFigure]:
    """The figures drawn, with program, config and its digest in their metadata."""
    from radarsim.report.drawing import canvas  # Matplotlib

    version, digest = provenance.versions()["radarsim"], provenance.resolved_sha256(experiment)
    creator = f"radarsim {version}, {experiment.stem}, config {digest}"
    return [canvas.draw(figure, formats, width_mm, creator) for figure in figures_by_name.values()]

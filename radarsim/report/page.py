"""The pages of an experiment, of a comparison, and of tracks over recorded plots."""

import shlex
from collections.abc import Collection, Mapping, Sequence
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from radarsim.config.experiment import Experiment
from radarsim.extensions import ReportSection, extension_figures, extension_tables, extensions
from radarsim.language.translate import tr
from radarsim.report import caption_remarks, provenance
from radarsim.report.drawing import page_figure
from radarsim.report.drawing.model import COLUMN_MM
from radarsim.report.drawing.page_figure import DrawnFigure
from radarsim.report.math_text import plain_text
from radarsim.report.page_links import tables_behind_figure
from radarsim.report.page_sentences import count_visible_sentences
from radarsim.report.page_tables import column_heading, page_table, page_tables, row_table, translated_table
from radarsim.report.render_page import render_page
from radarsim.report.settings_tables import settings_tables
from radarsim.report.target_words import target_words
from radarsim.report.typeset import cell_text, marked_up

if TYPE_CHECKING:
    import pandas as pd
    from markupsafe import Markup


MAX_VISIBLE_FIGURES, MAX_VISIBLE_PANELS = 2, 4  # that are not folded
RUN_FACTS = ("threads", "seconds", "kernel_seconds", "realisations_computed", "realisations_from_store")


def report_page(
    experiment: Experiment,
    tables: "Mapping[str, pd.DataFrame]",
    figures: Sequence[DrawnFigure],
    record: Mapping[str, Any],
    answer: Sequence[str],
    question: str,
    *,
    inputs: "pd.DataFrame | None" = None,
    agreement: "pd.DataFrame | None" = None,
    cost: "pd.DataFrame | None" = None,
    drawn_from: Mapping[str, Sequence[str]] = MappingProxyType({}),
    config_text: str = "",
) -> str:
    """The page of an experiment: question, answer, settings, figures, the sections of extensions, tables, provenance.

    figures are drawn ones (none with --no-figures); record is run.json's; inputs, agreement and cost (against
    accuracy) are tables, or None. drawn_from: of the study, see `Study`. config_text: config.yaml, if there is one."""
    # The sections of extensions show their own figures in other ways.
    figures = [drawing for drawing in figures if drawing.figure.name not in extension_figures()]
    written = {name for name, table in tables.items() if f"{name}.csv" in record["outputs"] and len(table)}
    names = [drawing.figure.name for drawing in figures]
    sources = {name: tables_behind_figure(name, drawn_from, written) for name in names}
    titles = {drawing.figure.name: plain_text(drawing.figure.title) for drawing in figures}
    sections = _sections(tables, titles, sources, written, experiment.study)
    return render_page(
        "report.html.j2",
        experiment=experiment,
        question=question,
        target=target_words(experiment.cases),
        answer=answer,
        visible_sentences=count_visible_sentences(answer),
        inputs=None if inputs is None else translated_table(tr("inputs"), inputs),
        settings=[translated_table(title, table) for title, table in settings_tables(experiment.cases).items()],
        agreement=None if agreement is None else translated_table(tr("exact versus Monte-Carlo"), agreement),
        cost=None if cost is None else translated_table(tr("cost versus accuracy"), cost),
        yaml=config_text,
        record=record,
        extent=provenance.extent(record),
        sections=sections,
        figures=_page_figures(figures),
        conventions=caption_remarks.conventions(drawing.figure for drawing in figures),
        visible_figures=_count_visible_figures(figures),
        files=_figure_formats(figures, record["outputs"]),
        sources=sources,
        links={name: _joined_links(name, sections) for name in names},
        tables=page_tables(
            {name: table for name, table in tables.items() if name not in extension_tables() and len(table)}
        ),
        facts=[(name.replace("_", " "), cell_text(record[name])) for name in RUN_FACTS if name in record],
        command=repeat_command(experiment, record),
    )


def _sections(
    tables: "Mapping[str, pd.DataFrame]",
    titles: Mapping[str, str],
    sources: Mapping[str, Sequence[str]],
    written: Collection[str],
    study_name: str,
) -> list[ReportSection]:
    """The sections of extensions."""
    sections = (extension.report_section(tables, titles, sources, written, study_name) for extension in extensions())
    return [section for section in sections if section is not None]


def _joined_links(figure_name: str, sections: Sequence[ReportSection]) -> "Markup":
    """What the sections of extensions link to a figure."""
    from markupsafe import Markup

    return Markup("").join(section.links.get(figure_name, Markup("")) for section in sections)


def _count_visible_figures(figures: Sequence[DrawnFigure]) -> int:
    """How many figures are not folded: the first one, others while they have few panels together."""
    panels = [sum(bool(panel.marks) for panel in drawing.figure.panels) for drawing in figures[:MAX_VISIBLE_FIGURES]]
    return max(1, sum(sum(panels[: n + 1]) <= MAX_VISIBLE_PANELS for n in range(len(panels))))


def comparison_page(
    labels: Sequence[str],
    sentences: Sequence[str],
    summaries: Sequence[Mapping[str, Any]],
    notes: Sequence[str],
    warnings: Sequence[str],
    figures: Sequence[DrawnFigure],
    table: "pd.DataFrame",
    differing: "Mapping[str, pd.DataFrame]",
    outputs: Collection[str],
) -> str:
    """The page of a comparison: sentences, summaries, figures, differing keys, the table.

    summaries: of `text_table`; differing: tables of keys by their title, empty for configs of several studies; outputs:
    the files beside the page."""
    return render_page(
        "compare.html.j2",
        labels=labels,
        sentences=sentences,
        summaries=summaries,
        notes=notes,
        warnings=warnings,
        figures=_page_figures(figures),
        conventions=caption_remarks.conventions(drawing.figure for drawing in figures),
        files=_figure_formats(figures, outputs),
        differ=_differences(differing),
        settings=[translated_table(title, keys) for title, keys in differing.items()],
        table=page_table("comparison", table.drop(columns=["label", "against_label"])),
        version=provenance.versions()["radarsim"],
    )


MAX_NAMED_KEYS = 4  # in a line on differences


def _differences(differing: "Mapping[str, pd.DataFrame]") -> str:
    """The first keys in which the compared cases differ, with the values of each; empty where none does."""
    *_, table = (None, *differing.values()) if len(differing) > 1 else (None,)
    if table is None:
        return ""
    values = {str(key): list(dict.fromkeys(map(cell_text, table[key]))) for key in table.columns[1:]}
    changed = {key: texts for key, texts in values.items() if len(texts) > 1}
    numbers_first = sorted(changed.items(), key=lambda item: item[1][0][:1].isalpha())
    lines = [f"{column_heading(key)}: {' → '.join(texts)}" for key, texts in numbers_first]
    omitted = len(lines) - MAX_NAMED_KEYS
    return "; ".join([*lines[:MAX_NAMED_KEYS], *([tr("{count} more", count=omitted)] if omitted > 0 else [])])


def track_page(
    config: str,
    source: str,
    answer: Sequence[str],
    plots: Sequence[str],
    figures: Sequence[DrawnFigure],
    tables: Mapping[str, Sequence[Mapping[str, object]]],
    yaml: str,
    command: str,
) -> str:
    """The page of tracks over recorded plots: answer, plots, figures, tables of rows by column, config."""
    return render_page(
        "track.html.j2",
        config=config,
        source=source,
        answer=answer,
        plots=plots,
        figures=_page_figures(figures),
        conventions=caption_remarks.conventions(drawing.figure for drawing in figures),
        tables=[row_table(name, rows) for name, rows in tables.items() if rows],
        yaml=yaml,
        command=command,
        version=provenance.versions()["radarsim"],
    )


def repeat_command(experiment: Experiment, record: Mapping[str, Any]) -> str:
    """The command that repeats the run: from the run's facts, else from the config."""
    if "command" in record:
        return str(record["command"])
    words = ["radarsim", "run", shlex.quote(str(experiment.path or experiment.stem))]
    for flag, key in (("-n", "asked"), ("--seed", "seed")):
        values = {case[key] for case in record["cases"].values()}
        words += [flag, str(*values)] if len(values) == 1 else []  # cases that differ have it from the config
    return " ".join(words)


def _page_figures(figures: Sequence[DrawnFigure]) -> list[dict[str, Any]]:
    """What a page shows of each figure."""
    return [
        {
            "name": drawing.figure.name,
            "heading": marked_up(drawing.figure.title),
            "caption": plain_text(drawing.figure.caption),
            "wide": drawing.figure.width_mm > 1.3 * COLUMN_MM,
            "svg": page_figure.embed(drawing, f"svg{n}"),
        }
        for n, drawing in enumerate(figures)
    ]


def _figure_formats(figures: Sequence[DrawnFigure], outputs: Collection[str]) -> dict[str, list[str]]:
    """The formats of each figure's files beside the page."""
    names = [drawing.figure.name for drawing in figures]
    formats = {name: [kind for kind in ("svg", "png", "pdf") if f"figures/{name}.{kind}" in outputs] for name in names}
    return {name: kinds for name, kinds in formats.items() if kinds}

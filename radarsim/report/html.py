"""report.html: one self-contained page of an experiment; the template escapes all text from configs and tables.

Its links: the tables behind a figure. Its settings: every key of the cases with its value and the schema's description.

results/index.html: all runs of a folder by group, newest first, each with its answer in one line."""

import base64
import hashlib
import json
import math
import re
import shlex
from collections import Counter
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from datetime import UTC, datetime
from functools import cache
from importlib import resources
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, TypeGuard
from urllib.parse import quote

from radarsim.config.experiment import Case, Experiment
from radarsim.config.fields import Model
from radarsim.config.load import as_yaml
from radarsim.extensions import ReportSection, extension_figures, extension_tables, extensions
from radarsim.language import called, current, numeral, plural, speaking, term, tr
from radarsim.report import files, page_figure, wording
from radarsim.report import tables as common
from radarsim.report.drawing import COLUMN_MM
from radarsim.report.page_figure import DrawnFigure
from radarsim.report.wording import number, spoken, subscripts

if TYPE_CHECKING:
    import pandas as pd
    from jinja2 import Environment, Template
    from markupsafe import Markup


# ---- links -----------------------------------------------------------------------------------------------------------
TABLES_BY_KIND = {"sigma": ("curves",), "sweep": ("curves",), "dynamic": ("curves",), "gain": ("gains",)}


def tables_behind_figure(
    figure_name: str, declared: Mapping[str, Sequence[str]], table_names: Collection[str]
) -> tuple[str, ...]:
    """The tables behind a figure, of those that exist: as its study declares, by its own name, by its kind."""
    prefixes = sorted((name for name in declared if figure_name.startswith(name)), key=len)
    if prefixes and figure_name not in table_names:
        names: Sequence[str] = declared[prefixes[-1]]
    elif figure_name in table_names:
        names = declared.get(figure_name, (figure_name,))
    else:
        names = TABLES_BY_KIND.get(figure_name.partition("_")[0], ())
    return tuple(name for name in names if name in table_names)


# ---- settings --------------------------------------------------------------------------------------------------------
SETTING_COLUMNS = ("key", "value", "meaning")
MAX_LIST_ENTRIES = 12  # of a list, shown one by one
MAX_CASE_ROWS = 40  # cases shown row by row


def settings_tables(cases: Sequence[Case]) -> "dict[str, pd.DataFrame]":
    """Tables of text by their title: keys that all cases share and, of several cases, those that differ."""
    settings = {case.name: {key: (value, meaning) for key, value, meaning in describe(case.spec)} for case in cases}
    shared = [
        (key, value, meaning)
        for key, (value, meaning) in settings[cases[0].name].items()
        if all(key in others and others[key][0] == value for others in settings.values())
    ]
    title = plural("Every key with its value and meaning", "What all {count} cases share", len(cases))
    tables = {title: _frame(SETTING_COLUMNS, [*shared, *_shared_extent(cases)])}
    if len(cases) > 1:
        shared_keys = {key for key, _, _ in shared}
        keys = [key for keys in settings.values() for key in keys if key not in shared_keys]
        title, table = _differing_settings(cases, settings, list(dict.fromkeys(keys)))
        tables[title] = table
    return tables


def _shared_extent(cases: Sequence[Case]) -> list[tuple[str, str, str]]:
    """Rows with the number of realisations and the seed, if all cases have the same."""
    counts, seeds = (sorted({getattr(case, name) for case in cases}) for name in ("realisations", "seed"))
    rows = [("realisations", numeral(f"{n:,}"), tr("independent runs")) for n in counts]
    rows += [("seed", str(seed), tr("of the noise")) for seed in seeds]
    return rows if len(rows) == 2 else []


def _differing_settings(
    cases: Sequence[Case], settings: Mapping[str, Mapping[str, tuple[str, str]]], keys: Sequence[str]
) -> "tuple[str, pd.DataFrame]":
    """Title and table of the keys in which the cases differ, a row for each of the first cases."""
    rows: list[tuple[object, ...]] = []
    for case in cases[:MAX_CASE_ROWS]:
        values = (settings[case.name].get(key, ("–", ""))[0] for key in keys)
        rows.append((case.name, *values, numeral(f"{case.realisations:,}"), case.seed))
    title = tr("How the cases differ")
    if omitted := len(cases) - len(rows):
        title = tr("How the cases differ (first {shown}; {left} more in run.json)", shown=len(rows), left=omitted)
    return title, _frame(("case", *keys, "realisations", "seed"), rows)


def _frame(columns: Sequence[str], rows: Sequence[tuple[object, ...]]) -> "pd.DataFrame":
    return common.frame({name: [row[i] for row in rows] for i, name in enumerate(columns)})


def describe(model: Model, prefix: str = "") -> Iterator[tuple[str, str, str]]:
    """Key, value and meaning of every field that a checked model holds, in the order of its schema."""
    for name, field in type(model).model_fields.items():
        value = getattr(model, name)
        meaning = tr(" ".join((field.description or "").split()))
        if isinstance(value, Model):
            yield from describe(value, f"{prefix}{name}.")
        elif _are_models(value):
            for i, entry in enumerate(value[:MAX_LIST_ENTRIES]):
                yield f"{prefix}{name}.{i}", "; ".join(_field_texts(entry)), meaning if i == 0 else ""
            if len(value) > MAX_LIST_ENTRIES:
                yield f"{prefix}{name}", tr("{count} more", count=len(value) - MAX_LIST_ENTRIES), ""
        elif value is not None and value != ():
            yield f"{prefix}{name}", value_text(name, value), meaning


def _are_models(value: object) -> TypeGuard[Sequence[Model]]:
    return isinstance(value, tuple | list) and bool(value) and all(isinstance(entry, Model) for entry in value)


def _field_texts(model: Model) -> Iterator[str]:
    """A short "key value" for each field that is set."""
    for name in type(model).model_fields:
        value = getattr(model, name)
        if isinstance(value, Model):
            yield f"{name}: {', '.join(_field_texts(value))}"
        elif _are_models(value):
            yield f"{name}: {' | '.join(', '.join(_field_texts(entry)) for entry in value)}"
        elif value is not None and value != ():
            yield f"{name} {value_text(name, value)}"


def value_text(name: str, value: object) -> str:
    """The value of a key as text: angles in degrees too, lists with commas."""
    if isinstance(value, bool):
        return tr("yes") if value else tr("no")
    if isinstance(value, float):
        text = number(value, 6)
        degrees = {"_rad": "°", "_radps": "°/s"}.get(name[name.rfind("_") :]) if "_" in name else None
        return f"{text} ({number(math.degrees(value), 6)}{degrees})" if degrees and value else text
    if isinstance(value, tuple | list):
        texts = [value_text(name, entry) for entry in value]
        return ", ".join(
            f"[{text}]" if isinstance(entry, tuple | list) else text for entry, text in zip(value, texts, strict=True)
        )
    if isinstance(value, Mapping):
        return ", ".join(f"{key}: {value_text(str(key), entry)}" for key, entry in value.items())
    return str(value)


# ---- pages -----------------------------------------------------------------------------------------------------------
NOT_SETTLED = term("not settled in the run")
SCRIPT_TEXTS = (term("Light page"), term("Dark page"))
MAX_ROWS = 200  # of a table shown in the page
MAX_PAGE_ROWS = 800  # of all of them together: the page stays under 1.5 MB
MAX_VISIBLE_LETTERS = 200  # of an answer above its figure
MAX_VISIBLE_FIGURES, MAX_VISIBLE_PANELS = 2, 4  # that are not folded
MAX_SENTENCE_LETTERS = 300  # of a sentence that is not split into its clauses
MAX_YAML_CASES = 12
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
) -> str:
    """The page of an experiment: question, answer, settings, figures, the sections of extensions, tables, provenance.

    figures are drawn ones (none with --no-figures); record is run.json's; inputs, agreement and cost (against
    accuracy) are tables, or None. drawn_from: of the study, see `Study`."""
    # The sections of extensions show their own figures in other ways.
    figures = [drawing for drawing in figures if drawing.figure.name not in extension_figures()]
    written = {name for name, table in tables.items() if f"{name}.csv" in record["outputs"] and len(table)}
    names = [drawing.figure.name for drawing in figures]
    sources = {name: tables_behind_figure(name, drawn_from, written) for name in names}
    titles = {drawing.figure.name: spoken(drawing.figure.title) for drawing in figures}
    sections = _sections(tables, titles, sources, written, experiment.study)
    sentences = split_into_clauses(answer)
    return render_page(
        "report.html.j2",
        experiment=experiment,
        question=question,
        answer=sentences,
        visible_sentences=count_visible_sentences(sentences),
        inputs=None if inputs is None else translated_table(tr("inputs"), inputs),
        settings=[translated_table(title, table) for title, table in settings_tables(experiment.cases).items()],
        agreement=None if agreement is None else translated_table(tr("exact against Monte-Carlo"), agreement),
        cost=None if cost is None else translated_table(tr("cost against accuracy"), cost),
        yaml=config_yaml(record["resolved"]),
        record=record,
        extent=files.extent(record),
        sections=sections,
        figures=_page_figures(figures),
        visible_figures=_count_visible_figures(figures),
        files=_figure_formats(figures, record["outputs"]),
        sources=sources,
        links={name: _joined_links(name, sections) for name in names},
        tables=_page_tables(
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


def split_into_clauses(answer: Sequence[str]) -> list[str]:
    """The sentences of an answer, long ones in their clauses."""
    split = [wording.clauses(sentence) if len(sentence) > MAX_SENTENCE_LETTERS else [sentence] for sentence in answer]
    return [f"{clause};" if clause is not clauses[-1] else clause for clauses in split for clause in clauses]


def headline(answer: Sequence[str]) -> str:
    """The first sentence of an answer as the page shows it, of a long one its first clause; empty without any."""
    return split_into_clauses(answer)[0].removesuffix(";") if answer else ""


def count_visible_sentences(answer: Sequence[str]) -> int:
    """How many sentences of an answer are not folded: the first one, others while they are short together."""
    lengths = [sum(len(sentence) for sentence in answer[: n + 1]) for n in range(len(answer))]
    return max(1, sum(length <= MAX_VISIBLE_LETTERS for length in lengths))


def comparison_page(
    labels: Sequence[str],
    sentences: Sequence[str],
    notes: Sequence[str],
    warnings: Sequence[str],
    figures: Sequence[DrawnFigure],
    table: "pd.DataFrame",
    differing: "Mapping[str, pd.DataFrame]",
    outputs: Collection[str],
) -> str:
    """The page of a comparison: sentences, figures, differing keys, the table.

    differing: tables of keys by their title, empty for configs of several studies; outputs: the files beside
    the page."""
    return render_page(
        "compare.html.j2",
        labels=labels,
        sentences=sentences,
        notes=notes,
        warnings=warnings,
        figures=_page_figures(figures),
        files=_figure_formats(figures, outputs),
        differ=_differences(differing),
        settings=[translated_table(title, keys) for title, keys in differing.items()],
        table=_page_table("comparison", table.drop(columns=["label", "against_label"])),
        version=files.versions()["radarsim"],
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
        tables=[_row_table(name, rows) for name, rows in tables.items() if rows],
        yaml=yaml,
        command=command,
        version=files.versions()["radarsim"],
    )


def _row_table(name: str, rows: Sequence[Mapping[str, object]]) -> dict[str, Any]:
    """The part of a table of rows that a page shows."""
    columns = [{"name": key, "numeric": isinstance(value, int | float)} for key, value in rows[0].items()]
    cells = [[cell_text(value) for value in row.values()] for row in rows[:MAX_ROWS]]
    return {"name": name, "columns": columns, "rows": cells, "count": len(rows), "cut": len(rows) > len(cells)}


def config_yaml(resolved: Mapping[str, Any]) -> str:
    """The resolved experiment as YAML; of very many cases the first."""
    cases = resolved["cases"]
    text = as_yaml({**resolved, "cases": cases[:MAX_YAML_CASES]})
    omitted = len(cases) - MAX_YAML_CASES
    return text + (f"# {omitted} further cases stand in run.json\n" if omitted > 0 else "")


def repeat_command(experiment: Experiment, record: Mapping[str, Any]) -> str:
    """The command that repeats the run: from the run's facts, else from the config."""
    if "command" in record:
        return str(record["command"])
    words = ["radarsim", "run", shlex.quote(str(experiment.path or experiment.stem))]
    for flag, key in (("-n", "asked"), ("--seed", "seed")):
        values = {case[key] for case in record["cases"].values()}
        words += [flag, str(*values)] if len(values) == 1 else []  # cases that differ have it from the config
    return " ".join(words)


def cell_text(value: object) -> str:
    """A number for people, whole ones in full, others at four digits; text unchanged, empty for NaN."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return str(value)
    return numeral(str(value)) if isinstance(value, int) else wording.number(value)


def fragment(package: str, template: str, filters: Mapping[str, Callable[..., str]], **content: object) -> "Markup":
    """A part of a page from a template of another package, with filters of its own."""
    from markupsafe import Markup

    environment = _environment(package)
    environment.filters.update(filters)
    return Markup(environment.get_template(template).render(**content))


def _template(name: str) -> "Template":
    return _environment("radarsim.report").get_template(name)


@cache
def _environment(package: str) -> "Environment":
    from jinja2 import Environment, PackageLoader, StrictUndefined

    loader = PackageLoader(package)
    environment = Environment(loader=loader, autoescape=True, undefined=StrictUndefined, trim_blocks=True)
    filters: dict[str, Callable[..., str]] = {
        "number": cell_text,
        "unit": lambda name: tr(wording.unit(name)),
        "typeset": _typeset,
    }
    environment.filters.update(filters)
    environment.globals.update(tr=tr, plural=plural)
    return environment


def _typeset(text: str) -> "Markup":
    """A text in which numbers stay with their units, and with ± before them; letters with an index as formulas."""
    return marked_up(wording.formulas(wording.unbroken(text)))


def marked_up(text: str) -> "Markup":
    """A text with formulas for a page: <i>, <sub>, <sup>; everything else is escaped."""
    from markupsafe import Markup, escape

    return Markup("").join(
        Markup("<{0}>{1}</{0}>").format(Markup(kind), piece) if kind else escape(piece)
        for piece, kind in subscripts(text)
    )


def _column_cell(column: str, value: object) -> str:
    """The text of a cell; an infinite settling time in words."""
    is_endless = column.startswith("settling") and isinstance(value, float) and math.isinf(value)
    return tr(NOT_SETTLED) if is_endless else cell_text(value)


def _page_tables(tables: "Mapping[str, pd.DataFrame]") -> list[dict[str, Any]]:
    """The parts of tables that a page shows: long ones share the rows that short ones leave."""
    counts, max_rows = [len(table) for table in tables.values()], MAX_ROWS
    while max_rows > 10 and sum(min(count, max_rows) for count in counts) > MAX_PAGE_ROWS:
        max_rows -= 10
    with speaking(current()):  # the language is looked up once, not for each of ten thousand cells
        return [_page_table(name, table, max_rows) for name, table in tables.items()]


def translated_table(name: str, table: "pd.DataFrame") -> dict[str, Any]:
    """A table of the page alone, in words; a table with a file of its own is shown as in the file."""
    shown_table = _page_table(name, table)
    for column in shown_table["columns"]:
        column["name"] = _typeset(column_heading(column["name"]))
    translations = {"unit": lambda name: tr(wording.unit(name)), "filter": called, "radar": called}
    for i, column in enumerate(table.columns):
        for row in shown_table["rows"] if column in translations else ():
            row[i] = translations[column](row[i])
    return shown_table


def column_heading(column: str) -> str:
    """The heading of a column of a table of the page alone; a unit is behind the last comma."""
    if column in COLUMN_NAMES or column in HEADINGS:
        return tr(COLUMN_NAMES.get(column, column))
    stage = re.fullmatch(r"σ of y, (.+), m", column)
    if stage:
        return tr("σ of y, {stage}, m", stage=tr(stage[1]))
    name, _, unit = column.rpartition(", ")
    return f"{tr(COLUMN_NAMES.get(name, name))}, {tr(unit)}" if name else column


FACTS = (  # names of facts of a run and of its machine
    *(term("system"), term("architecture"), term("processor"), term("cores"), term("byteorder"), term("threads")),
    *(term("seconds"), term("kernel seconds"), term("realisations computed"), term("realisations from store")),
)
COLUMN_NAMES = {  # of columns of tables that stand in pages alone, where these have other names
    **{"at_k": term("at scan"), "merge": term("merging rule"), "inside_percent": term("inside the interval, %")},
    "largest_difference_percent": term("largest difference, %"),
}
HEADINGS = (  # of their other columns
    *(term("SNR a pulse"), term("burst"), term("case"), term("component"), term("energy"), term("filter")),
    *(term("family"), term("key"), term("meaning"), term("measured, ns"), term("models"), term("operations")),
    *(term("pulses"), term("radar"), term("realisations"), term("scans"), term("seed"), term("unit"), term("value")),
)


def _page_table(name: str, table: "pd.DataFrame", max_rows: int = MAX_ROWS) -> dict[str, Any]:
    """The part of a table that a page shows, with how many rows have which note."""
    order = list(table.columns)
    if {"sigma", "exact_sigma"} <= set(order):  # side by side, to be compared
        order.remove("exact_sigma")
        order.insert(order.index("sigma") + 1, "exact_sigma")
    rows = table[order].head(max_rows)
    return {
        "name": name,
        "columns": [{"name": column, "numeric": table[column].dtype.kind in "iuf"} for column in order],
        "rows": [list(map(_column_cell, order, row)) for row in rows.astype(object).itertuples(index=False, name=None)],
        "count": len(table),
        "cut": len(table) > max_rows,
        "notes": Counter(str(note) for note in table.get("note", ()) if note),
    }


def _page_figures(figures: Sequence[DrawnFigure]) -> list[dict[str, Any]]:
    """What a page shows of each figure."""
    return [
        {
            "name": drawing.figure.name,
            "heading": marked_up(drawing.figure.title),
            "caption": spoken(drawing.figure.caption),
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


def _script_texts(texts: Sequence[str] = ()) -> "Markup":
    """Texts of the page's script, and of a page's own script, in the current language, as JSON by the English."""
    return _safe_json({text: tr(text) for text in (*SCRIPT_TEXTS, *texts)})


def _safe_json(value: object) -> "Markup":
    """JSON of a value, or of text that is JSON already, that cannot end the element in which it stands."""
    from markupsafe import Markup

    data = value if isinstance(value, str) else json.dumps(value, ensure_ascii=False, separators=(",", ":"))
    return Markup(data.replace("&", "\\u0026").replace("<", "\\u003c").replace(">", "\\u003e"))


@cache
def _page_script() -> tuple[str, str]:
    """The page's script, and its hash as the page's policy names it: no other script runs."""
    code = _template_file("script.js")
    return code, _policy_hash(code)


def _policy_hash(code: str) -> str:
    return "sha256-" + base64.b64encode(hashlib.sha256(code.encode()).digest()).decode()


@cache
def _template_file(name: str) -> str:
    return resources.files("radarsim.report").joinpath("templates", name).read_text(encoding="utf-8")


def live_page(title: str, sources: Sequence[str], data: str, texts: Sequence[str] = ()) -> str:
    """A self-contained page that computes: a study's own body, style and script, and its data as JSON.

    sources: the text of these files: in the body, a template, `tr` marks messages; style and script are copied. texts:
    of the script, to be translated. The data cannot end its element."""
    from jinja2 import Environment, StrictUndefined
    from markupsafe import Markup

    body_source, style, script = sources
    body = Environment(autoescape=True, undefined=StrictUndefined).from_string(body_source).render(tr=tr)
    return render_page(
        "live.html.j2",
        title=title,
        body=Markup(body),
        own_style=Markup(style),
        own_script=Markup(script),
        own_script_hash=_policy_hash(script),
        data=_safe_json(data),
        words=_script_texts(texts),
    )


def render_page(template: str, **content: object) -> str:
    """A page from a template, with the style and the script that all pages share."""
    from markupsafe import Markup

    script, script_hash = _page_script()
    content = {"language": current(), "words": _script_texts()} | content
    return _template(template).render(
        style=Markup(_template_file("style.css")), script=Markup(script), script_hash=script_hash, **content
    )


# ---- index -----------------------------------------------------------------------------------------------------------
INDEX_NAME = "index.html"


def write_index(out: Path) -> None:
    """Write the index of the runs under out; raises StoreError. Runs whose run.json cannot be read are left out.

    Under a lock from reading to writing: of two runs that end at once, the last one sees both."""
    out = Path(out)
    with files.locked(out):
        rows = filter(None, map(_index_row, out.glob("*/run.json")))
        runs = sorted(rows, key=lambda run: run["finished"], reverse=True)
        heading = next((run["entry"].heading for run in runs if run["entry"]), "")
        version = files.versions()["radarsim"]
        page = render_page("index.html.j2", groups=_by_group(runs), heading=heading, count=len(runs), version=version)
        files.replace_all(out, {INDEX_NAME: page.encode()})


def _index_row(path: Path) -> dict | None:
    """A row of the index, from a run.json and what extensions say of its folder; None where run.json cannot be read."""
    try:
        record = json.loads(files.read(path))
        answer = [str(line) for line in record["answer"]]
        row = {
            "name": path.parent.name,
            "address": f"{quote(path.parent.name)}/report.html",
            "answer": headline(answer),
            "study": str(record["study"]),
            "realisations": files.span(sorted({int(case["done"]) for case in record["cases"].values()})),
            "finished": _finish_time(record, path),
        }
    except (OSError, ArithmeticError, ValueError, LookupError, TypeError, AttributeError, RecursionError):
        return None
    entries = (extension.index_entry(path.parent) for extension in extensions())
    return row | {"entry": next((entry for entry in entries if entry is not None), None)}


def _by_group(runs: Sequence[Mapping[str, Any]]) -> dict[str, list[Mapping[str, Any]]]:
    """The runs by the group that an extension puts them in; those in none with others of their study, or under that."""
    groups = {run["study"]: run["entry"].group for run in reversed(runs) if run["entry"] and run["entry"].group}
    by_group: dict[str, list[Mapping[str, Any]]] = {}
    for run in runs:
        group = run["entry"].group if run["entry"] else ""
        by_group.setdefault(group or groups.get(run["study"], run["study"]), []).append(run)
    return dict(sorted(by_group.items()))


def _finish_time(record: Mapping, path: Path) -> str:
    """When the run ended, UTC, to the second: from run.json, else the time of that file."""
    finished = record.get("finished")
    when = datetime.fromisoformat(finished) if finished else datetime.fromtimestamp(path.stat().st_mtime, UTC)
    return when.astimezone(UTC).strftime("%Y-%m-%d %H:%M:%S UTC")

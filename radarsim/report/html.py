"""report.html: one self-contained page of an experiment; the template escapes all text from configs and tables.

Its links: the tables behind a figure, and for a claim its figures and tables. Its request: every key of the cases with
its value and the schema's description.

results/index.html: all runs of a folder by paper, newest first, each with its answer in one line."""

import base64
import csv
import hashlib
import io
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
from radarsim.language import called, current, numeral, plural, speaking, term, tr
from radarsim.report import files, page_figure, wording
from radarsim.report import tables as common
from radarsim.report.claims import page as claims_page
from radarsim.report.claims import rule
from radarsim.report.claims.judge import LOOKED
from radarsim.report.claims.over import PaperReadings
from radarsim.report.drawing import COLUMN_MM
from radarsim.report.page_figure import DrawnFigure
from radarsim.report.wording import number, spoken, subscripts

if TYPE_CHECKING:
    import pandas as pd
    from jinja2 import Template
    from markupsafe import Markup


# ---- links -----------------------------------------------------------------------------------------------------------
COMMON = {"sigma": ("curves",), "sweep": ("curves",), "dynamic": ("curves",), "gain": ("gains",)}
MOST = 3  # figures linked from one claim

Looked = Sequence[tuple[str, str]]  # tables, with the component that was looked at or nothing


def tables_of(figure: str, declared: Mapping[str, Sequence[str]], made: Collection[str]) -> tuple[str, ...]:
    """The tables behind a figure, of those made: as its study declares, by its own name, by its kind."""
    begins = sorted((name for name in declared if figure.startswith(name)), key=len)
    if begins and figure not in made:
        found: Sequence[str] = declared[begins[-1]]
    elif figure in made:
        found = declared.get(figure, (figure,))
    else:
        found = COMMON.get(figure.partition("_")[0], ())
    return tuple(name for name in found if name in made)


def figures_of(looked: Looked, drawn_from: Mapping[str, Sequence[str]]) -> list[str]:
    """The figures that show the tables read by a claim, and of these its component's own if there is one."""
    found: list[str] = []
    for table, component in looked:
        own = [name for name, tables in drawn_from.items() if table in tables]
        exact = [name for name in own if component and name.endswith(f"_{component}")]
        found += exact or own
    return list(dict.fromkeys(found))[:MOST]


# ---- asked -----------------------------------------------------------------------------------------------------------
COLUMNS = ("key", "value", "meaning")
MOST_ENTRIES = 12  # of a list shown one by one
MOST_ROWS = 40  # shown row by row


def asked(cases: Sequence[Case]) -> "dict[str, pd.DataFrame]":
    """Tables of text by their title: keys that all cases share and, if there are several, those that differ."""
    keys_of = {case.name: {key: (value, about) for key, value, about in described(case.spec)} for case in cases}
    first = keys_of[cases[0].name]
    shared = [
        (key, value, about)
        for key, (value, about) in first.items()
        if all(key in other and other[key][0] == value for other in keys_of.values())
    ]
    counts, seeds = (sorted({getattr(case, name) for case in cases}) for name in ("realisations", "seed"))
    counted = [("realisations", numeral(f"{n:,}"), tr("independent runs")) for n in counts]
    counted += [("seed", str(s), tr("of the noise")) for s in seeds]
    title = plural("Every key with its value and meaning", "What all {count} cases share", len(cases))
    made = {title: _frame(COLUMNS, [*shared, *(counted if len(counted) == 2 else [])])}
    if len(cases) > 1:
        same = {key for key, _, _ in shared}
        keys = list(dict.fromkeys(key for of in keys_of.values() for key in of if key not in same))
        rows: list[tuple[object, ...]] = []
        for case in cases[:MOST_ROWS]:
            values = (keys_of[case.name].get(key, ("–", ""))[0] for key in keys)
            rows.append((case.name, *values, numeral(f"{case.realisations:,}"), case.seed))
        left = len(cases) - len(rows)
        title = tr("How the cases differ")
        if left:
            title = tr("How the cases differ (first {shown}; {left} more in run.json)", shown=len(rows), left=left)
        made[title] = _frame(("case", *keys, "realisations", "seed"), rows)
    return made


def _frame(columns: Sequence[str], rows: Sequence[tuple[object, ...]]) -> "pd.DataFrame":
    return common.frame({name: [row[i] for row in rows] for i, name in enumerate(columns)})


def described(model: Model, before: str = "") -> Iterator[tuple[str, str, str]]:
    """Key, value and meaning of every field that a checked model holds, in the order of its schema."""
    for name, field in type(model).model_fields.items():
        value = getattr(model, name)
        about = tr(" ".join((field.description or "").split()))
        if isinstance(value, Model):
            yield from described(value, f"{before}{name}.")
        elif _models(value):
            for i, one in enumerate(value[:MOST_ENTRIES]):
                yield f"{before}{name}.{i}", "; ".join(_pairs(one)), about if i == 0 else ""
            if len(value) > MOST_ENTRIES:
                yield f"{before}{name}", tr("{count} more", count=len(value) - MOST_ENTRIES), ""
        elif value is not None and value != ():
            yield f"{before}{name}", as_text(name, value), about


def _models(value: object) -> TypeGuard[Sequence[Model]]:
    return isinstance(value, tuple | list) and bool(value) and all(isinstance(one, Model) for one in value)


def _pairs(model: Model) -> Iterator[str]:
    """A short "key value" for each field that is set."""
    for name in type(model).model_fields:
        value = getattr(model, name)
        if isinstance(value, Model):
            yield f"{name}: {', '.join(_pairs(value))}"
        elif _models(value):
            yield f"{name}: {' | '.join(', '.join(_pairs(one)) for one in value)}"
        elif value is not None and value != ():
            yield f"{name} {as_text(name, value)}"


def as_text(name: str, value: object) -> str:
    """A value as text: angles in degrees too, lists with commas."""
    if isinstance(value, bool):
        return tr("yes") if value else tr("no")
    if isinstance(value, float):
        text = number(value, 6)
        degrees = {"_rad": "°", "_radps": "°/s"}.get(name[name.rfind("_") :]) if "_" in name else None
        return f"{text} ({number(math.degrees(value), 6)}{degrees})" if degrees and value else text
    if isinstance(value, tuple | list):
        return ", ".join(
            as_text(name, one) if not isinstance(one, tuple | list) else f"[{as_text(name, one)}]" for one in value
        )
    if isinstance(value, Mapping):
        return ", ".join(f"{key}: {as_text(str(key), one)}" for key, one in value.items())
    return str(value)


# ---- html ------------------------------------------------------------------------------------------------------------
NOT_SETTLED = term("not settled in the run")
SCRIPT = (term("Light page"), term("Dark page"))
ROWS = 200  # of a table shown in the page
ALL_ROWS = 800  # of all of them together: the page stays under 1.5 MB
MOST_SEEN = 200  # letters of an answer above its figure
FIRST, FIRST_PANELS = 2, 4  # figures that are not folded, and their panels
LONG = 300  # letters of a sentence that is shown in its clauses
MOST_CASES = 12  # written out as YAML
SHOWN_FACTS = ("threads", "seconds", "kernel_seconds", "realisations_computed", "realisations_from_store")


def report_page(
    experiment: Experiment,
    made: "Mapping[str, pd.DataFrame]",
    figures: Sequence[DrawnFigure],
    record: Mapping[str, Any],
    answer: Sequence[str],
    question: str,
    *,
    inputs: "pd.DataFrame | None" = None,
    agreement: "pd.DataFrame | None" = None,
    cost: "pd.DataFrame | None" = None,
    drawn_from: Mapping[str, Sequence[str]] = MappingProxyType({}),
    readings: PaperReadings | None = None,
) -> str:
    """The page of an experiment: question, answer, request, figures, claims, exact values, tables, provenance.

    figures are drawn ones (none with --no-figures); record is run.json's; inputs, agreement and cost (against
    accuracy) are tables, or None. drawn_from and readings: of the study, see `Study`."""
    figures = [drawn for drawn in figures if drawn.figure.name != "claims"]  # the page has them in a table
    written = {name for name, table in made.items() if f"{name}.csv" in record["outputs"] and len(table)}
    sources = {drawn.figure.name: tables_of(drawn.figure.name, drawn_from, written) for drawn in figures}
    claims = _claims(made["claims"], sources, written, readings)
    answer = in_clauses(answer)
    return whole(
        "report.html.j2",
        experiment=experiment,
        question=question,
        answer=answer,
        shown=seen_at_once(answer),
        inputs=None if inputs is None else table_in_words(tr("inputs"), inputs),
        asked=[table_in_words(title, table) for title, table in asked(experiment.cases).items()],
        agreement=None if agreement is None else table_in_words(tr("exact against Monte-Carlo"), agreement),
        cost=None if cost is None else table_in_words(tr("cost against accuracy"), cost),
        yaml=yaml_of(record["resolved"]),
        record=record,
        extent=files.extent(record),
        claims=claims,
        verdicts=claims_page.counted(made["claims"].to_dict("records")),
        figures=_figures(figures),
        first=_first(figures),
        files=_files(figures, record["outputs"]),
        sources=sources,
        titles={drawn.figure.name: spoken(drawn.figure.title) for drawn in figures},
        judged={name: [one["id"] for one in claims if name in one["figures"]] for name in sources},
        tables=_tables({name: table for name, table in made.items() if name != "claims" and len(table)}),
        facts=[(name.replace("_", " "), cell(record[name])) for name in SHOWN_FACTS if name in record],
        command=command(experiment, record),
    )


def _first(figures: Sequence[DrawnFigure]) -> int:
    """How many figures are not folded: the first one, others while their panels are few together."""
    panels = [sum(bool(panel.marks) for panel in drawn.figure.panels) for drawn in figures[:FIRST]]
    return max(1, sum(sum(panels[: n + 1]) <= FIRST_PANELS for n in range(len(panels))))


def in_clauses(answer: Sequence[str]) -> list[str]:
    """The sentences of an answer, a long one in its clauses."""
    parts = [wording.clauses(sentence) if len(sentence) > LONG else [sentence] for sentence in answer]
    return [f"{part};" if part is not own[-1] else part for own in parts for part in own]


def headline(answer: Sequence[str]) -> str:
    """The first sentence of an answer as the page shows it, of a long one its first clause; empty without any."""
    return in_clauses(answer)[0].removesuffix(";") if answer else ""


def seen_at_once(answer: Sequence[str]) -> int:
    """How many sentences of an answer stand above its figure: the first one, others while they are short together."""
    lengths = [sum(len(sentence) for sentence in answer[: n + 1]) for n in range(len(answer))]
    return max(1, sum(length <= MOST_SEEN for length in lengths))


def comparison(
    labels: Sequence[str],
    sentences: Sequence[str],
    notes: Sequence[str],
    warnings: Sequence[str],
    figures: Sequence[DrawnFigure],
    made: "pd.DataFrame",
    differing: "Mapping[str, pd.DataFrame]",
    outputs: Collection[str],
) -> str:
    """The page of a comparison: sentences, figures, differing keys, the table.

    differing: tables of keys by their title, empty for configs of several studies; outputs: the files beside
    the page."""
    return whole(
        "compare.html.j2",
        labels=labels,
        sentences=sentences,
        notes=notes,
        warnings=warnings,
        figures=_figures(figures),
        files=_files(figures, outputs),
        differ=_differences(differing),
        asked=[table_in_words(title, table) for title, table in differing.items()],
        table=_table("comparison", made.drop(columns=["label", "against_label"])),
        version=files.versions()["radarsim"],
    )


MOST_KEYS = 4  # that a line names


def _differences(differing: "Mapping[str, pd.DataFrame]") -> str:
    """The first keys in which the compared cases differ, with the values of each; empty where none does."""
    *_, table = (None, *differing.values()) if len(differing) > 1 else (None,)
    if table is None:
        return ""
    values = {str(key): list(dict.fromkeys(map(cell, table[key]))) for key in table.columns[1:]}
    differ = sorted((own[0][:1].isalpha(), n) for n, own in enumerate(values.values()) if len(own) > 1)  # numbers first
    lines = [f"{head([*values][n])}: {' → '.join([*values.values()][n])}" for _, n in differ]
    more = len(lines) - MOST_KEYS
    return "; ".join([*lines[:MOST_KEYS], *([tr("{count} more", count=more)] if more > 0 else [])])


def followed(
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
    return whole(
        "track.html.j2",
        config=config,
        source=source,
        answer=answer,
        plots=plots,
        figures=_figures(figures),
        tables=[_grid(name, rows) for name, rows in tables.items() if rows],
        yaml=yaml,
        command=command,
        version=files.versions()["radarsim"],
    )


def _grid(name: str, rows: Sequence[Mapping[str, object]]) -> dict[str, Any]:
    """The shown part of a table of rows by column."""
    shown = rows[:ROWS]
    columns = [{"name": key, "numeric": isinstance(value, int | float)} for key, value in rows[0].items()]
    cells = [[cell(value) for value in row.values()] for row in shown]
    return {"name": name, "columns": columns, "rows": cells, "count": len(rows), "cut": len(rows) > len(shown)}


def yaml_of(resolved: Mapping[str, Any]) -> str:
    """The resolved experiment as YAML; with very many cases the first."""
    cases = resolved["cases"]
    written = as_yaml({**resolved, "cases": cases[:MOST_CASES]})
    left = len(cases) - MOST_CASES
    return written + (f"# {left} further cases stand in run.json\n" if left > 0 else "")


def command(experiment: Experiment, record: Mapping[str, Any]) -> str:
    """The command that repeats the run: from the run's facts, else from the config."""
    if "command" in record:
        return str(record["command"])
    parts = ["radarsim", "run", shlex.quote(str(experiment.path or experiment.stem))]
    for flag, key in (("-n", "asked"), ("--seed", "seed")):
        asked = {case[key] for case in record["cases"].values()}
        parts += [flag, str(*asked)] if len(asked) == 1 else []  # cases that differ have it from the config
    return " ".join(parts)


def cell(value: object) -> str:
    """A number for people, whole ones in full, others at four digits; text unchanged, empty for NaN."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return str(value)
    return numeral(str(value)) if isinstance(value, int) else wording.number(value)


@cache
def _template(name: str) -> "Template":
    from jinja2 import Environment, PackageLoader, StrictUndefined

    loader = PackageLoader("radarsim.report")
    environment = Environment(loader=loader, autoescape=True, undefined=StrictUndefined, trim_blocks=True)
    own: dict[str, Callable[..., str]] = {
        "number": cell,
        "unit": lambda name: tr(wording.unit(name)),
        "expected": claims_page.expected,
        "css": _css,
        "kept": _sentence,
        "reason": rule.said,
        "measured": _measured,
        "bounds": _bounds,
    }
    environment.filters.update(own)
    environment.globals.update(tr=tr, plural=plural)
    return environment.get_template(name)


def _sentence(words: str) -> "Markup":
    """A sentence in which numbers stay with their units, and with ± before them; letters with an index as formulas."""
    return marked_up(wording.formulas(wording.unbroken(words)))


def _measured(part: Mapping[str, Any]) -> str:
    """The measured value of a part of a claim; an infinite settling time as text."""
    if math.isinf(part["measured"]) and "settling" in part["what"]:
        return tr(NOT_SETTLED)
    return cell(part["measured"])


def _bounds(part: Mapping[str, Any]) -> str:
    """The interval of a part of a claim; a dash without a sampling error."""
    lo, hi = claims_page.bounds(part)
    return "–" if lo == hi else f"{cell(lo)} … {cell(hi)}"


def _css(verdict: str) -> str:
    known = ("confirmed", "refuted")
    return next((one for one in known if verdict.startswith(one)), "unclear")


def _claims(
    table: "pd.DataFrame",
    sources: Mapping[str, Sequence[str]],
    written: Collection[str],
    readings: PaperReadings | None,
) -> list[dict[str, Any]]:
    """Claims with their parts, from claims.csv's rows, with the figures and tables behind each.

    sources: the tables of each figure; written: the tables that are files."""
    found = []
    looked = table.attrs.get(LOOKED, [()] * len(table))
    records: Any = table.to_dict("records")
    rows = [row | {LOOKED: own} for row, own in zip(records, looked, strict=True)]
    for parts in claims_page.grouped(claims_page.in_words(rows, [readings])):
        same = {
            key: parts[0][key] for key in ("statement", "paper", "place", "reading", "original", "overall", "class")
        }
        found.append({"id": parts[0]["claim"], **same, "said": claims_page.verdict_of(parts), "parts": parts})
        found[-1]["said"] = str(found[-1]["said"]).replace("*", "")
        own = list(dict.fromkeys(one for part in parts for one in part[LOOKED]))
        found[-1]["figures"] = figures_of(own, sources)
        found[-1]["tables"] = list(dict.fromkeys(name for name, _ in own if name in written))
    return found


def _cell(column: str, value: object) -> str:
    endless = column.startswith("settling") and isinstance(value, float) and math.isinf(value)
    return tr(NOT_SETTLED) if endless else cell(value)


def _tables(made: "Mapping[str, pd.DataFrame]") -> list[dict[str, Any]]:
    """The shown parts of the tables: long ones share the rows that short ones leave."""
    rows, most = [len(table) for table in made.values()], ROWS
    while most > 10 and sum(min(count, most) for count in rows) > ALL_ROWS:
        most -= 10
    with speaking(current()):  # looked up once, not for each of ten thousand cells
        return [_table(name, table, most) for name, table in made.items()]


def table_in_words(name: str, table: "pd.DataFrame") -> dict[str, Any]:
    """A table of the page alone, in words; a table with a file of its own is shown as in the file."""
    made = _table(name, table)
    for column in made["columns"]:
        column["name"] = _sentence(head(column["name"]))
    said = {"unit": lambda name: tr(wording.unit(name)), "filter": called, "radar": called}
    for place, column in enumerate(table.columns):
        for row in made["rows"] if column in said else ():
            row[place] = said[column](row[place])
    return made


def head(column: str) -> str:
    """The head of a column of a table of the page alone; a unit is behind the last comma."""
    if column in CALLED or column in HEADS:
        return tr(CALLED.get(column, column))
    by_stage = re.fullmatch(r"σ of y, (.+), m", column)
    if by_stage:
        return tr("σ of y, {stage}, m", stage=tr(by_stage[1]))
    name, _, unit = column.rpartition(", ")
    return f"{tr(CALLED.get(name, name))}, {tr(unit)}" if name else column


FACTS = (  # names of facts of a run and of its machine
    *(term("system"), term("architecture"), term("processor"), term("cores"), term("byteorder"), term("threads")),
    *(term("seconds"), term("kernel seconds"), term("realisations computed"), term("realisations from store")),
)
CALLED = {  # columns of tables that stand in pages alone, where these have other names
    **{"at_k": term("at scan"), "merge": term("merging rule"), "inside_percent": term("inside the interval, %")},
    "largest_difference_percent": term("largest difference, %"),
}
HEADS = (  # their other columns
    *(term("SNR a pulse"), term("burst"), term("case"), term("component"), term("energy"), term("filter")),
    *(term("family"), term("key"), term("meaning"), term("measured, ns"), term("models"), term("operations")),
    *(term("pulses"), term("radar"), term("realisations"), term("scans"), term("seed"), term("unit"), term("value")),
)


def _table(name: str, table: "pd.DataFrame", most: int = ROWS) -> dict[str, Any]:
    order = list(table.columns)
    if {"sigma", "exact_sigma"} <= set(order):  # side by side, to be compared
        order.remove("exact_sigma")
        order.insert(order.index("sigma") + 1, "exact_sigma")
    rows = table[order].head(most)
    columns = [{"name": column, "numeric": table[column].dtype.kind in "iuf"} for column in order]
    cells = [list(map(_cell, order, row)) for row in rows.astype(object).itertuples(index=False, name=None)]
    said = Counter(str(note) for note in table.get("note", ()) if note)
    shown = {"name": name, "columns": columns, "rows": cells, "count": len(table), "cut": len(table) > most}
    return shown | {"notes": said}


def _figures(figures: Sequence[DrawnFigure]) -> list[dict[str, Any]]:
    """What a page shows of each figure."""
    return [
        {
            "name": drawn.figure.name,
            "heading": marked_up(drawn.figure.title),
            "caption": spoken(drawn.figure.caption),
            "wide": drawn.figure.width_mm > 1.3 * COLUMN_MM,
            "svg": page_figure.embed(drawn, f"svg{n}"),
        }
        for n, drawn in enumerate(figures)
    ]


def marked_up(text: str) -> "Markup":
    """A text with formulas for a page: <i>, <sub>, <sup>; everything else is escaped."""
    from markupsafe import Markup, escape

    return Markup("").join(
        Markup("<{0}>{1}</{0}>").format(Markup(kind), piece) if kind else escape(piece)
        for piece, kind in subscripts(text)
    )


def _files(figures: Sequence[DrawnFigure], outputs: Collection[str]) -> dict[str, list[str]]:
    """The formats of each figure's files beside the page."""
    kinds = ("svg", "png", "pdf")
    names = [drawn.figure.name for drawn in figures]
    found = {name: [kind for kind in kinds if f"figures/{name}.{kind}" in outputs] for name in names}
    return {name: formats for name, formats in found.items() if formats}


def words_of_script(own: Sequence[str] = ()) -> "Markup":
    """Texts of the page's script, and of a page's own script, in the current language, as JSON by the English."""
    return _json({text: tr(text) for text in (*SCRIPT, *own)})


def _json(value: object) -> "Markup":
    """JSON of a value, or of text that is JSON already, that cannot end the element in which it stands."""
    from markupsafe import Markup

    data = value if isinstance(value, str) else json.dumps(value, ensure_ascii=False, separators=(",", ":"))
    return Markup(data.replace("&", "\\u0026").replace("<", "\\u003c").replace(">", "\\u003e"))


@cache
def script() -> tuple[str, str]:
    """The page's script, and its hash as the page's policy names it: no other script runs."""
    code = _file("script.js")
    return code, _policy_hash(code)


def _policy_hash(code: str) -> str:
    return "sha256-" + base64.b64encode(hashlib.sha256(code.encode()).digest()).decode()


@cache
def _file(name: str) -> str:
    return resources.files("radarsim.report").joinpath("templates", name).read_text(encoding="utf-8")


def live(title: str, parts: Sequence[str], data: str, words: Sequence[str] = ()) -> str:
    """A self-contained page that computes: a study's own body, style and script, and its data as JSON. The parts are
    files of the package: the body is a template in which `tr` marks messages, style and script are copied. words: texts
    of the script. The data cannot end its element."""
    from jinja2 import Environment, StrictUndefined
    from markupsafe import Markup

    source, style, script = parts
    body = Environment(autoescape=True, undefined=StrictUndefined).from_string(source).render(tr=tr)
    own = {"title": title, "body": Markup(body), "own_style": Markup(style), "own_script": Markup(script)}
    own |= {"own_script_hash": _policy_hash(script), "data": _json(data), "words": words_of_script(words)}
    return whole("live.html.j2", **own)


def whole(template: str, **content: object) -> str:
    """A page from a template, with the style and the script that all pages share."""
    from markupsafe import Markup

    code, digest = script()
    content = {"language": current(), "words": words_of_script()} | content
    return _template(template).render(
        style=Markup(_file("style.css")), script=Markup(code), script_hash=digest, **content
    )


# ---- index -----------------------------------------------------------------------------------------------------------
NAME = "index.html"


def write(out: Path) -> None:
    """Write the index of the runs under out; raises StoreError. Runs whose run.json cannot be read are left out. Under
    a lock from reading to writing: of two runs that end at once, the last one sees both."""
    out = Path(out)
    with files.locked(out):
        found = filter(None, map(_run, out.glob("*/run.json")))
        runs = sorted(found, key=lambda run: run["finished"], reverse=True)
        page = whole("index.html.j2", groups=_by_paper(runs), count=len(runs), version=files.versions()["radarsim"])
        files.replace_all(out, {NAME: page.encode()})


def _run(path: Path) -> dict | None:
    """A row of the index, from a run.json and the claims.csv beside it."""
    try:
        record = json.loads(files.read(path))
        answer = [str(line) for line in record["answer"]]
        made = {
            "name": path.parent.name,
            "address": f"{quote(path.parent.name)}/report.html",
            "answer": headline(answer),
            "study": str(record["study"]),
            "realisations": files.span(sorted({int(case["done"]) for case in record["cases"].values()})),
            "finished": _finished(record, path),
        }
    except (OSError, ArithmeticError, ValueError, LookupError, TypeError, AttributeError, RecursionError):
        return None
    return made | _claims_of(path.parent / "claims.csv")


def _by_paper(runs: Sequence[Mapping[str, Any]]) -> dict[str, list[Mapping[str, Any]]]:
    """The runs by the paper whose claims they judge; one that judges none with others of its study, or under that."""
    papers = {run["study"]: run["paper"] for run in reversed(runs) if run["paper"]}
    found: dict[str, list[Mapping[str, Any]]] = {}
    for run in runs:
        found.setdefault(run["paper"] or papers.get(run["study"], run["study"]), []).append(run)
    return dict(sorted(found.items()))


def _finished(record: Mapping, path: Path) -> str:
    """When the run ended, UTC, to the second: from run.json, else the time of that file."""
    finished = record.get("finished")
    when = datetime.fromisoformat(finished) if finished else datetime.fromtimestamp(path.stat().st_mtime, UTC)
    return when.astimezone(UTC).strftime("%Y-%m-%d %H:%M:%S UTC")


def _claims_of(path: Path) -> dict[str, Any]:
    """From a table of claims the paper of the first, how many are of which class in words, and as styled marks."""
    try:
        rows = list(csv.DictReader(io.StringIO(files.read(path).decode("utf-8"), newline="")))
        looks = [_css(parts[0]["class"]) for parts in claims_page.grouped(rows)]
        marks = {look: looks.count(look) for look in ("confirmed", "refuted", "unclear") if look in looks}
        paper = rows[0]["paper"].partition(",")[0] if rows else ""
        return {"paper": paper, "claims": claims_page.counted(rows), "marks": marks}
    except (OSError, ValueError, LookupError, csv.Error):
        return {"paper": "", "claims": "", "marks": {}}

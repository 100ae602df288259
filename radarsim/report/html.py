"""report.html: one self-contained page of an experiment; the template escapes all text from configs and tables."""

import base64
import hashlib
import json
import math
import re
import shlex
from collections import Counter
from collections.abc import Callable, Collection, Mapping, Sequence
from functools import cache
from importlib import resources
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from radarsim.config.experiment import Experiment
from radarsim.config.load import as_yaml
from radarsim.language import current, numeral, plural, term, tr
from radarsim.report import asked, chart, links, provenance, text
from radarsim.report.chart_text import spoken
from radarsim.report.claims import page as claims_page
from radarsim.report.claims import reasons
from radarsim.report.claims.judge import LOOKED
from radarsim.report.drawing import Figure, Line

if TYPE_CHECKING:
    import pandas as pd
    from jinja2 import Template
    from markupsafe import Markup

NOT_SETTLED = term("not settled in the run")
SCRIPT = (
    *(term("Light page"), term("Dark page"), term("exact"), term("Copied"), term("Not allowed here")),
    *(term("Logarithmic x"), term("Logarithmic y"), term("Show all")),
)
ROWS = 200  # of a table shown in the page
ALL_ROWS = 800  # of all of them together: the page stays under 1.5 MB
MOST_POINTS = 16_000  # of all curves of a page together, which keeps it small
LEAST_POINTS = 50  # of one curve, however many there are
MOST_SEEN = 200  # letters of an answer above its figure
LONG = 300  # letters of a sentence that is shown in its clauses
MOST_CASES = 12  # written out as YAML
SHOWN_FACTS = ("threads", "seconds", "kernel_seconds", "realisations_computed", "realisations_from_store")


def page(
    experiment: Experiment,
    made: "Mapping[str, pd.DataFrame]",
    figures: Sequence[Figure],
    record: Mapping[str, Any],
    answer: Sequence[str],
    question: str,
    *,
    inputs: "pd.DataFrame | None" = None,
    agreement: "pd.DataFrame | None" = None,
    cost: "pd.DataFrame | None" = None,
    drawn_from: Mapping[str, Sequence[str]] = MappingProxyType({}),
) -> str:
    """The page of an experiment: question, answer, what was asked, figures, claims, exact values, tables, provenance.

    figures are described ones (none with --no-figures); record is run.json's; inputs, agreement and cost (against
    accuracy) are tables, or None. drawn_from: of the study, see `Study.drawn_from`.
    """
    written = {name for name, table in made.items() if f"{name}.csv" in record["outputs"] and len(table)}
    sources = {one.name: links.tables_of(one.name, drawn_from, written) for one in figures}
    claims = _claims(made["claims"], sources, written)
    answer = in_clauses(answer)
    return whole(
        "report.html.j2",
        experiment=experiment,
        question=question,
        answer=answer,
        shown=seen_at_once(answer),
        inputs=None if inputs is None else table_in_words(tr("inputs"), inputs),
        asked=[table_in_words(title, table) for title, table in asked.asked(experiment.cases).items()],
        agreement=None if agreement is None else table_in_words(tr("exact against Monte-Carlo"), agreement),
        cost=None if cost is None else table_in_words(tr("cost against accuracy"), cost),
        yaml=yaml_of(record["resolved"]),
        record=record,
        extent=provenance.extent(record),
        claims=claims,
        verdicts=claims_page.counted(made["claims"].to_dict("records")),
        figures=_figures(figures),
        files=_files(figures, record["outputs"]),
        sources=sources,
        titles={one.name: spoken(one.title) for one in figures},
        judged={name: [one["id"] for one in claims if name in one["figures"]] for name in sources},
        tables=_tables({name: table for name, table in made.items() if name != "claims" and len(table)}),
        facts=[(name.replace("_", " "), number(record[name])) for name in SHOWN_FACTS if name in record],
        command=command(experiment, record),
    )


def in_clauses(answer: Sequence[str]) -> list[str]:
    """The sentences of an answer, a long one in its clauses."""
    parts = [text.clauses(sentence) if len(sentence) > LONG else [sentence] for sentence in answer]
    return [f"{part};" if part is not own[-1] else part for own in parts for part in own]


def seen_at_once(answer: Sequence[str]) -> int:
    """How many sentences of an answer stand above its figure: the first one, others while they are short together."""
    lengths = [sum(len(sentence) for sentence in answer[: n + 1]) for n in range(len(answer))]
    return max(1, sum(length <= MOST_SEEN for length in lengths))


def comparison(
    labels: Sequence[str],
    sentences: Sequence[str],
    notes: Sequence[str],
    warnings: Sequence[str],
    figures: Sequence[Figure],
    made: "pd.DataFrame",
    differing: "Mapping[str, pd.DataFrame]",
    outputs: Collection[str],
) -> str:
    """The page of a comparison: sentences, figures, in what the configs differ, the table.

    differing are tables of keys by their title, empty where the configs are of several studies; outputs the files
    beside the page.
    """
    return whole(
        "compare.html.j2",
        labels=labels,
        sentences=sentences,
        notes=notes,
        warnings=warnings,
        figures=_figures(figures),
        files=_files(figures, outputs),
        asked=[table_in_words(title, table) for title, table in differing.items()],
        table=_table("comparison", made.drop(columns=["label", "against_label"])),
        version=provenance.versions()["radarsim"],
    )


def followed(
    config: str,
    source: str,
    answer: Sequence[str],
    plots: Sequence[str],
    figures: Sequence[Figure],
    tables: Mapping[str, Sequence[Mapping[str, object]]],
    yaml: str,
    command: str,
) -> str:
    """The page of tracks over recorded plots: answer, what the plots are, figures, tables of rows by column, config."""
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
        version=provenance.versions()["radarsim"],
    )


def _grid(name: str, rows: Sequence[Mapping[str, object]]) -> dict[str, Any]:
    """A table of rows by column, as far as it is shown."""
    shown = rows[:ROWS]
    columns = [{"name": key, "numeric": isinstance(value, int | float)} for key, value in rows[0].items()]
    cells = [[number(value) for value in row.values()] for row in shown]
    return {"name": name, "columns": columns, "rows": cells, "count": len(rows), "cut": len(rows) > len(shown)}


def yaml_of(resolved: Mapping[str, Any]) -> str:
    """The resolved experiment as YAML; of very many cases the first."""
    cases = resolved["cases"]
    written = as_yaml({**resolved, "cases": cases[:MOST_CASES]})
    left = len(cases) - MOST_CASES
    return written + (f"# {left} further cases stand in run.json\n" if left > 0 else "")


def command(experiment: Experiment, record: Mapping[str, Any]) -> str:
    """The command that repeats the run: as the run's facts give it, else by the config."""
    if "command" in record:
        return str(record["command"])
    parts = ["radarsim", "run", shlex.quote(str(experiment.path or experiment.stem))]
    for flag, key in (("-n", "asked"), ("--seed", "seed")):
        asked = {case[key] for case in record["cases"].values()}
        parts += [flag, str(*asked)] if len(asked) == 1 else []  # cases that differ have it from the config
    return " ".join(parts)


def number(value: object) -> str:
    """A number for people, whole ones in full, others at four digits; text as it is, nothing for not-a-number."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return str(value)
    return numeral(str(value)) if isinstance(value, int) else text.number(value)


@cache
def _template(name: str) -> "Template":
    from jinja2 import Environment, PackageLoader, StrictUndefined

    loader = PackageLoader("radarsim.report")
    environment = Environment(loader=loader, autoescape=True, undefined=StrictUndefined, trim_blocks=True)
    own: dict[str, Callable[..., str]] = {
        "number": number,
        "unit": lambda name: tr(text.unit(name)),
        "expected": claims_page.expected,
        "css": _css,
        "kept": kept,
        "reason": reasons.said,
        "measured": _measured,
        "bounds": _bounds,
    }
    environment.filters.update(own)
    environment.globals.update(tr=tr, plural=plural)
    return environment.get_template(name)


def kept(words: object) -> str:
    """Text in which numbers stay with their units, and with ± before them."""
    return text.unbroken(str(words))


def _measured(part: Mapping[str, Any]) -> str:
    """What a part of a claim measured; an infinite settling time as text."""
    if math.isinf(part["measured"]) and "settling" in part["what"]:
        return tr(NOT_SETTLED)
    return number(part["measured"])


def _bounds(part: Mapping[str, Any]) -> str:
    """The interval of a part of a claim; a dash where chance has no part in it."""
    lo, hi = claims_page.bounds(part)
    return "–" if lo == hi else f"{number(lo)} … {number(hi)}"


def _css(verdict: str) -> str:
    known = ("confirmed", "refuted")
    return next((one for one in known if verdict.startswith(one)), "unclear")


def _claims(
    table: "pd.DataFrame", sources: Mapping[str, Sequence[str]], written: Collection[str]
) -> list[dict[str, Any]]:
    """Claims with their parts, from claims.csv's rows, with the figures and tables that each is judged from.

    sources: the tables of each figure; written: the tables that are files.
    """
    found = []
    looked = table.attrs.get(LOOKED, [()] * len(table))
    rows = [row | {LOOKED: own} for row, own in zip(table.to_dict("records"), looked, strict=True)]
    for parts in claims_page.grouped(rows):
        same = {
            key: parts[0][key] for key in ("statement", "paper", "place", "reading", "original", "overall", "class")
        }
        found.append({"id": parts[0]["claim"], **same, "said": claims_page.verdict_of(parts), "parts": parts})
        found[-1]["said"] = str(found[-1]["said"]).replace("*", "")
        own = list(dict.fromkeys(one for part in parts for one in part[LOOKED]))
        found[-1]["figures"] = links.figures_of(own, sources)
        found[-1]["tables"] = list(dict.fromkeys(name for name, _ in own if name in written))
    return found


def _cell(column: str, value: object) -> str:
    endless = column.startswith("settling") and isinstance(value, float) and math.isinf(value)
    return tr(NOT_SETTLED) if endless else number(value)


def _tables(made: "Mapping[str, pd.DataFrame]") -> list[dict[str, Any]]:
    """The tables as far as they are shown: the long ones share what room the short ones leave."""
    rows, most = [len(table) for table in made.values()], ROWS
    while most > 10 and sum(min(count, most) for count in rows) > ALL_ROWS:
        most -= 10
    return [_table(name, table, most) for name, table in made.items()]


def table_in_words(name: str, table: "pd.DataFrame") -> dict[str, Any]:
    """A table that stands in the page alone, in words; one that is a file of its own is shown as it is there."""
    made = _table(name, table)
    for column in made["columns"]:
        column["name"] = head(column["name"])
    if "unit" in table:
        place = list(table.columns).index("unit")
        for row in made["rows"]:
            row[place] = tr(text.unit(row[place]))
    return made


def head(column: str) -> str:
    """What a column of a table that stands in the page alone is called; a unit stands behind the last comma."""
    if column in HEADS:
        return tr(HEADS[column])
    by_stage = re.fullmatch(r"σ of y, (.+), m", column)
    if by_stage:
        return tr("σ of y, {stage}, m", stage=tr(by_stage[1]))
    name, _, unit = column.rpartition(", ")
    return f"{tr(HEADS.get(name, name))}, {tr(unit)}" if name else column


FACTS = (  # names of facts of a run and of its machine
    *(term("system"), term("architecture"), term("processor"), term("cores"), term("byteorder"), term("threads")),
    *(term("seconds"), term("kernel seconds"), term("realisations computed"), term("realisations from store")),
)
HEADS = {  # of tables that stand in pages alone
    "SNR a pulse": term("SNR a pulse"),
    "at_k": term("at scan"),
    "burst": term("burst"),
    "case": term("case"),
    "component": term("component"),
    "energy": term("energy"),
    "filter": term("filter"),
    "family": term("family"),
    "inside_percent": term("inside the interval, %"),
    "key": term("key"),
    "largest_difference_percent": term("largest difference, %"),
    "meaning": term("meaning"),
    "measured, ns": term("measured, ns"),
    "merge": term("merging rule"),
    "models": term("models"),
    "operations": term("operations"),
    "pulses": term("pulses"),
    "radar": term("radar"),
    "realisations": term("realisations"),
    "scans": term("scans"),
    "seed": term("seed"),
    "unit": term("unit"),
    "value": term("value"),
}


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


def _figures(figures: Sequence[Figure]) -> list[dict[str, Any]]:
    """The figures as charts; where there are many curves, each is drawn of fewer points."""

    lines = sum(isinstance(mark, Line) for figure in figures for panel in figure.panels for mark in panel.marks)
    points = max(LEAST_POINTS, min(chart.POINTS, MOST_POINTS // max(1, lines)))
    made = []
    for figure in figures:
        drawn = chart.chart(figure, points)
        safe = _json([panel.data for panel in drawn.panels])
        named = {"name": figure.name, "title": spoken(figure.title), "caption": spoken(figure.caption)}
        made.append({**named, "chart": drawn, "data": safe})
    return made


def _files(figures: Sequence[Figure], outputs: Collection[str]) -> dict[str, list[str]]:
    """The formats of each figure's files beside the page."""
    kinds = ("svg", "png", "pdf")
    found = {one.name: [kind for kind in kinds if f"figures/{one.name}.{kind}" in outputs] for one in figures}
    return {name: own for name, own in found.items() if own}


def words_of_script(own: Sequence[str] = ()) -> "Markup":
    """What the page's script says, and a script of the page's own, in the language spoken, as JSON by the English."""
    return _json({text: tr(text) for text in (*SCRIPT, *own)})


def _json(value: object) -> "Markup":
    """JSON that cannot end the element in which it stands."""
    from markupsafe import Markup

    data = json.dumps(value, ensure_ascii=False, separators=(",", ":"))
    return Markup(data.replace("&", "\\u0026").replace("<", "\\u003c").replace(">", "\\u003e"))


@cache
def script() -> tuple[str, str]:
    """The page's script, and its hash as the page's policy names it: no other script runs."""
    code = _file("script.js")
    return code, "sha256-" + base64.b64encode(hashlib.sha256(code.encode()).digest()).decode()


@cache
def _file(name: str) -> str:
    return resources.files("radarsim.report").joinpath("templates", name).read_text(encoding="utf-8")


def live(title: str, parts: Sequence[str], data: str, words: Sequence[str] = ()) -> str:
    """A self-contained page that computes: a study's own body, style and script, and its data as JSON.

    The parts are files of the package: the body is a template in which `tr` says a message, style and script stand as
    they are. words: what the script says. The data cannot end its element.
    """
    from jinja2 import Environment, StrictUndefined
    from markupsafe import Markup

    source, style, script = parts
    body = Environment(autoescape=True, undefined=StrictUndefined).from_string(source).render(tr=tr)

    digest = "sha256-" + base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    safe = Markup(data.replace("&", "\\u0026").replace("<", "\\u003c").replace(">", "\\u003e"))
    own = {"title": title, "body": Markup(body), "own_style": Markup(style), "own_script": Markup(script)}
    return whole("live.html.j2", own_script_hash=digest, data=safe, words=words_of_script(words), **own)


def whole(template: str, **content: object) -> str:
    """A page from a template, with the style and the script that all pages share."""
    from markupsafe import Markup

    code, digest = script()
    content = {"language": current(), "words": words_of_script()} | content
    return _template(template).render(
        style=Markup(_file("style.css")), script=Markup(code), script_hash=digest, **content
    )

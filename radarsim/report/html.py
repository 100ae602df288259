"""report.html: one self-contained page of an experiment; the template escapes all text from configs and tables."""

import math
import re
import shlex
from collections.abc import Mapping, Sequence
from functools import cache

from radarsim.engine.results import CaseResult
from radarsim.report import provenance
from radarsim.report.drawing import Figure

NOT_SETTLED = "not settled in the run"
ROWS = 300  # of a table shown in the page
SHOWN_FACTS = ("threads", "seconds", "kernel_seconds", "realisations_computed", "realisations_from_store")


def page(
    experiment,
    results: Sequence[CaseResult],
    made: Mapping,
    drawn: Mapping[str, tuple[Figure, str]],
    record: Mapping,
    answer: Sequence[str],
    question: str,
    inputs=None,
) -> str:
    """The page of an experiment: question, answer, inputs (a table, or None), figures, tables, claims, provenance.

    drawn gives the figures and their SVG by name (none with --no-figures); record is run.json's.
    """
    claims = _claims(made["claims"])
    counts: dict[str, int] = {}
    for claim in claims:
        counts[claim["overall"]] = counts.get(claim["overall"], 0) + 1
    return _template().render(
        experiment=experiment,
        question=question,
        answer=answer,
        inputs=None if inputs is None else _table("inputs", inputs),
        record=record,
        extent=provenance.extent(record),
        claims=claims,
        verdicts=list(counts.items()),
        figures=[_figure(figure, svg) for figure, svg in drawn.values()],
        tables=[_table(name, table) for name, table in made.items() if name != "claims" and len(table)],
        facts=[(name.replace("_", " "), number(record[name])) for name in SHOWN_FACTS if name in record],
        command=command(experiment, record),
        resolved=provenance.to_json(record["resolved"]).decode(),
    )


def command(experiment, record: Mapping) -> str:
    """The command that repeats the run: as the run's facts give it, else by the config."""
    if "command" in record:
        return str(record["command"])
    words = ["radarsim", "run", shlex.quote(str(experiment.path or experiment.stem))]
    for flag, key in (("-n", "asked"), ("--seed", "seed")):
        asked = {case[key] for case in record["cases"].values()}
        words += [flag, str(*asked)] if len(asked) == 1 else []  # cases that differ have it from the config
    return " ".join(words)


def number(value: object) -> str:
    """A number for people, at four digits; text as it is, nothing for not-a-number."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return str(value)
    if isinstance(value, int) or math.isinf(value):
        return str(value).replace("inf", "∞").replace("-", "−")
    if math.isnan(value):
        return ""
    return f"{value:.4g}".replace("-", "−")


@cache
def _template():
    from jinja2 import Environment, PackageLoader, StrictUndefined

    loader = PackageLoader("radarsim.report")
    environment = Environment(loader=loader, autoescape=True, undefined=StrictUndefined, trim_blocks=True)
    own = {"number": number, "thousands": lambda n: f"{n:,}", "css": _css, "kept": kept, "measured": _measured}
    environment.filters |= own
    return environment.get_template("report.html.j2")


def kept(text: object) -> str:
    """Text in which a per cent sign stays with its number."""
    return str(text).replace(" %", "\u00a0%")


def _measured(part: Mapping) -> str:
    """What a part of a claim measured; a settling time without end in words."""
    if math.isinf(part["measured"]) and "settling" in part["what"]:
        return NOT_SETTLED
    return number(part["measured"])


def _css(verdict: str) -> str:
    return verdict if verdict in ("confirmed", "refuted") else "unclear"


def _claims(table) -> list[dict]:
    """Claims with their parts, from claims.csv's rows."""
    found: dict[str, dict] = {}
    for row in table.to_dict("records"):
        same = {key: row[key] for key in ("statement", "paper", "place", "reading", "overall")}
        found.setdefault(row["claim"], {"id": row["claim"], **same, "parts": []})["parts"].append(row)
    return list(found.values())


def _cell(column: str, value: object) -> str:
    endless = column.startswith("settling") and isinstance(value, float) and math.isinf(value)
    return NOT_SETTLED if endless else number(value)


def _table(name: str, table) -> dict:
    order = list(table.columns)
    if {"sigma", "exact_sigma"} <= set(order):  # side by side, to be compared
        order.remove("exact_sigma")
        order.insert(order.index("sigma") + 1, "exact_sigma")
    rows = table[order].head(ROWS)
    columns = [{"name": column, "numeric": table[column].dtype.kind in "iuf"} for column in order]
    cells = [list(map(_cell, order, row)) for row in rows.astype(object).itertuples(index=False, name=None)]
    return {"name": name, "columns": columns, "rows": cells, "count": len(table), "cut": len(table) > ROWS}


def _figure(figure: Figure, svg: str) -> dict:
    return {"name": figure.name, "title": figure.title, "caption": figure.caption, "svg": inline(svg, figure)}


def inline(svg: str, figure: Figure):
    """An SVG for the page: without prologue, its ids apart from other figures', named for those who cannot see it.

    Marked safe: it is Matplotlib's own output, which escapes all text; title and caption are escaped here.
    """
    from markupsafe import Markup

    body = svg[svg.index("<svg") :]
    body = re.sub(r"<metadata>.*?</metadata>", "", body, flags=re.DOTALL)
    body = re.sub(r'\bid="', f'id="{figure.name}-', body)
    body = re.sub(r'(href="#|url\(#)', rf"\1{figure.name}-", body)
    body = re.sub(r'\bd="[^"]*"', lambda path: re.sub(r"(\d\.\d\d)\d+", r"\1", path[0]), body)  # hundredths of a point
    width = 0.36 * figure.width_mm
    look = f"max-width: {width:.0f}rem; min-width: {min(width, 18) if width < 50 else 36:.0f}rem"
    named = Markup('<svg role="img" aria-label="{}" style="{}" ').format(f"{figure.title}. {figure.caption}", look)
    return named + Markup(body[len("<svg ") :])

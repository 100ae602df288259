"""The forest plot of claims: the worst part of each, its interval and exact value, in margins of the words."""

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from radarsim.language.translate import plural, tr
from radarsim.papers.claim_rows import (
    CLASS_ORDER,
    cell_number,
    class_count,
    decisive_value_words,
    group_by_claim,
    row_distance,
    shown_interval,
    worst_part,
)
from radarsim.papers.claims_table import NOT_JUDGED, NOT_RUN
from radarsim.papers.specification_curve import AXIS_MM, ROW_MM
from radarsim.papers.verdict_rule import CLASSES
from radarsim.report.drawing.model import GREY, PAGE_MM, Axis, Figure, Line, Note, Panel, Reference, Style
from radarsim.report.math_text import with_formulas

MAX_DRAWN_MARGINS = 4.0  # margins: larger distances are drawn there
BEYOND, RIM = 4.35, 4.6  # where an arrow says so, and where the panel ends
CLASS_COLOURS = (5, 2, 4, GREY, 3, 1, 6)  # of the classes in their order: green, red, blue, grey, …
CLASS_STYLES = {
    kind: Style(colour=colour, dash=None, marker=i, size_pt=4.0)
    for i, (kind, colour) in enumerate(zip(CLASSES, CLASS_COLOURS, strict=True))
}


def _drawn_distance(value: float, row: Mapping) -> float:
    """Distance of a value from the words, in margins, cut at 4."""
    return float(np.clip(row_distance(value, row), -MAX_DRAWN_MARGINS, MAX_DRAWN_MARGINS))


def forest_plot(rows: Sequence[Mapping]) -> Figure | None:
    """All judged claims of these rows, a panel of rows for each paper; None where there are none."""
    judged_claims = [parts for parts in group_by_claim(rows) if parts[0]["class"] not in (NOT_RUN, NOT_JUDGED)]
    claims = [(parts, worst) for parts in judged_claims if (worst := worst_part(parts)) is not None]
    papers = list(dict.fromkeys(parts[0]["paper"] for parts, _ in claims))
    panels = [
        _paper_panel(paper, [(parts, worst) for parts, worst in claims if parts[0]["paper"] == paper])
        for paper in papers
    ]
    if not panels:
        return None
    classes = Counter(parts[0]["class"] for parts in judged_claims)
    counted = ", ".join(class_count(kind, classes[kind]) for kind in CLASS_ORDER if classes[kind])
    return Figure(
        name="claims",
        title=tr("Claims compared with the papers"),
        caption=plural(
            "Of {count} claim: {counted}. ", "Of {count} claims: {counted}. ", len(judged_claims), counted=counted
        )
        + tr("Each claim's largest deviation, in tolerances: 0 or less agrees, up to 1 is tolerated."),
        panels=tuple(panels),
        width_mm=PAGE_MM,
    )


def _paper_panel(paper: str, claims: Sequence[tuple[Sequence[Mapping], Mapping]]) -> Panel:
    """The claims of a paper: statement, distance, and at the right the value."""
    key = claims[0][0][0]["claim"].partition(".")[0]
    ticks, marks, values = [], [], []
    for y, (parts, worst) in enumerate(claims):
        statement = with_formulas(tr(parts[0]["statement"]))
        ticks.append((float(y), f"{statement}  {parts[0]['claim'].partition('.')[2]}"))
        values.append(Note(RIM, float(y), decisive_value_words(worst), "e"))
    for kind, style in CLASS_STYLES.items():
        of_class = [(y, worst) for y, (parts, worst) in enumerate(claims) if parts[0]["class"] == kind]
        marks += _forest_lines(kind, style, of_class) if of_class else []
    return Panel(
        Axis(
            tr(
                "outside the paper's value by (0: agrees, 1: tolerance; cut at ± {furthest:g})",
                furthest=MAX_DRAWN_MARGINS,
            ),
            limits=(-RIM, RIM),
        ),
        Axis("", limits=(len(claims) - 0.4, -0.6), ticks=tuple(ticks)),
        (*marks, *values, Reference(0.0, "x"), Reference(1.0, "x")),
        title=f"{key} {tr(paper)}",
        direct=False,
        height_mm=AXIS_MM + ROW_MM * len(claims),
    )


def _forest_lines(kind: str, style: Style, claims: Sequence[tuple[int, Mapping]]) -> list[Line]:
    """The marks of one class: values, intervals, exact values, and arrows where a value lies beyond the rims."""
    y, rows = np.array([float(y) for y, _ in claims]), [row for _, row in claims]
    value = np.array([_drawn_distance(float(row["measured"]), row) for row in rows])
    ends = np.array([sorted(_drawn_distance(end, row) for end in shown_interval(row)) for row in rows])
    lo, hi = np.fmin(ends[:, 0], value), np.fmax(ends[:, 1], value)
    exact_values = [cell_number(row["exact"]) for row in rows]
    exact = np.array(
        [
            math.nan if number is None else _drawn_distance(number, row)
            for number, row in zip(exact_values, rows, strict=True)
        ]
    )
    gap = np.full(len(y), math.nan)
    marks = [
        Line(value, y, tr(kind), style),
        Line(np.ravel([lo, hi, gap], "F"), np.ravel([y, y, gap], "F"), "", replace(style, dash=0, marker=None)),
    ]
    marks += [Line(exact, gap, style=replace(style, dash=None), exact=y)] if np.isfinite(exact).any() else []
    for sign, arrow in ((-1, 8), (1, 10)):
        beyond = sign * value >= MAX_DRAWN_MARGINS
        look = replace(style, marker=arrow, size_pt=3.0)
        marks += [Line(np.full(beyond.sum(), sign * BEYOND), y[beyond], "", look)] if beyond.any() else []
    return marks

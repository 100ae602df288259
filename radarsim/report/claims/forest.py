"""The forest plot of claims: of each the worst part, its interval and exact value, in margins of what the words say."""

import math
from collections import Counter
from collections.abc import Mapping, Sequence

import numpy as np

from radarsim.language import plural, tr
from radarsim.report.claims import page
from radarsim.report.claims.judge import NOT_JUDGED, NOT_RUN
from radarsim.report.claims.rule import CLASSES
from radarsim.report.drawing import GREY, PAGE_MM, Axis, Figure, Line, Panel, Reference, Style

FURTHEST = 4.0  # margins: what lies further is drawn there
COLOURS = (5, 2, 4, GREY, 3, 1, 6)  # of the classes in their order: green, red, blue, grey, …
STYLES = {
    kind: Style(colour=colour, dash=None, marker=i, size_pt=4.0)
    for i, (kind, colour) in enumerate(zip(CLASSES, COLOURS, strict=True))
}


def depth(value: float, row: Mapping) -> float:
    """Distance of a value from what the words say, in margins, cut at 4."""
    return float(np.clip(page.depth(value, row), -FURTHEST, FURTHEST))


def figure(rows: Sequence[Mapping]) -> Figure | None:
    """All claims of these rows that were judged, a panel a paper; None where there are none."""
    judged = [own for own in page.grouped(rows) if own[0]["class"] not in (NOT_RUN, NOT_JUDGED)]
    found = [(own, row) for own in judged if (row := page.worst(own)) is not None]
    papers = list(dict.fromkeys(own[0]["paper"] for own, _ in found))
    panels = [_panel(paper, [(own, row) for own, row in found if own[0]["paper"] == paper]) for paper in papers]
    if not panels:
        return None
    classes = Counter(own[0]["class"] for own in judged)
    counted = ", ".join(page.of_class(kind, classes[kind]) for kind in page.ORDER if classes[kind])
    return Figure(
        name="claims",
        title=tr("Claims, in margins of what their papers say"),
        caption=plural("Of {count} claim: {counted}. ", "Of {count} claims: {counted}. ", len(judged), counted=counted)
        + tr(
            "Of each claim the part that lies furthest from the paper's words: measured, with the interval that is "
            "judged, and exactly, in margins of that part, cut at ± {furthest:g}. Under 0 it is as the words say, "
            "up to 1 within their margin. The mark is the class of the claim, over all readings that its paper allows.",
            furthest=FURTHEST,
        ),
        panels=tuple(panels),
        width_mm=PAGE_MM,
        panel_height_mm=58.0,
    )


def _panel(paper: str, found: Sequence[tuple[Sequence[Mapping], Mapping]]) -> Panel:
    ticks, marks = [], []
    for x, (own, _) in enumerate(found, 1):
        key, _, number = own[0]["claim"].partition(".")
        ticks.append((float(x), number))
    for kind, style in STYLES.items():
        of = [(x, row) for x, (own, row) in enumerate(found, 1) if own[0]["class"] == kind]
        if of:
            marks.append(_line(kind, style, of))
    return Panel(
        Axis(tr("claim of {paper}", paper=key), limits=(0, len(found) + 1), ticks=tuple(ticks)),
        Axis(
            tr("distance from the words, margins (cut at ± {furthest:g})", furthest=FURTHEST),
            limits=(-FURTHEST - 0.3, FURTHEST + 0.3),
        ),
        (*marks, Reference(0.0), Reference(1.0, label=tr("beyond the margin"))),
        title=f"{key} {tr(paper)}",
        direct=False,
        legend="right",
    )


def _line(kind: str, style: Style, of: Sequence[tuple[int, Mapping]]) -> Line:
    """The marks of one class: where a value is known exactly, this is what the mark stands at."""
    rows = [row for _, row in of]
    ends = np.array([sorted(depth(end, row) for end in page.bounds(row)) for row in rows])
    value = np.array([depth(float(row["measured"]), row) for row in rows])
    exact = [page.number(row["exact"]) for row in rows]
    crosses = np.array([math.nan if one is None else depth(one, row) for one, row in zip(exact, rows, strict=True)])
    lo, hi = np.minimum(ends[:, 0], value), np.maximum(ends[:, 1], value)
    return Line(np.array([float(x) for x, _ in of]), value, tr(kind), style, lo, hi, crosses)

"""Specification curves: a claim under every interpretation, sorted by outcome, and the alternatives of each."""

import numpy as np

from radarsim.language import plural, term, tr
from radarsim.papers.interpretations import DEFAULT, Choice, alternative_words
from radarsim.papers.verdict_rule import AGAINST, EQUIVALENT, UNSTATED
from radarsim.papers.verdicts_by_interpretation import ClaimVerdicts, InterpretationVerdict, worst_distance
from radarsim.report.drawing import GREY, PAGE_MM, Axis, Figure, Line, Panel, Reference, Style
from radarsim.report.wording import formulas

MAX_DRAWN_MARGINS = 5.0  # margins: larger distances are drawn there
MAX_LABEL_CHARACTERS = 44  # of an alternative beside the panel
HEADING_LINES = 1.5  # lines that the name of a choice takes above its alternatives
LEFT_SPACE = 0.02  # of all interpretations: room left of the first one, which may be as shipped
ROW_MM, AXIS_MM = 3.6, 14.0  # of a panel of rows: each, and its title and axis
KIND_STYLES = {
    EQUIVALENT: (term("as shipped, or equivalent"), Style(colour=0, dash=None, marker=0)),
    UNSTATED: (term("the paper does not say"), Style(colour=4, dash=None, marker=1)),
    AGAINST: (term("against the print"), Style(colour=GREY, dash=None, marker=2)),
}


def specification_curve(over: ClaimVerdicts) -> Figure:
    """The curve of a claim: above its worst part's distance from the paper's words, below the alternatives taken."""
    judged = [(one, worst_distance(one)) for one in over.under if one.outcome is not None]
    judged.sort(key=lambda pair: pair[1][0])
    every = [one for one, _ in judged]
    where = np.arange(1, len(every) + 1)
    ends = np.clip(np.array([found for _, found in judged]), -MAX_DRAWN_MARGINS, MAX_DRAWN_MARGINS)
    varied = [choice for choice in over.of.choices if len({one.interpretation[choice.key] for one in every}) > 1]
    caption = tr(
        "{statement}. {outcome}. Above: distance of the claim's worst part from the paper's words, in "
        "margins of that part, cut at ± {furthest:g}; below 0 it holds, above 1 it fails beyond the "
        "margin. Below: the choices of each interpretation.",
        statement=tr(over.claim.statement),
        outcome=over.sentence().capitalize(),
        furthest=MAX_DRAWN_MARGINS,
    )
    if gone := len(over.impossible):
        left = plural(
            "{count} interpretation that cannot be flown, designed or measured is left out.",
            "{count} interpretations that cannot be flown, designed or measured are left out.",
            gone,
        )
        caption = f"{caption} {left}"
    return Figure(
        name=over.claim.id,
        title=tr("{claim} under every interpretation", claim=over.claim.id),
        caption=caption,
        headline=f"{over.claim.id}: {over.sentence()}",
        panels=(_distance_panel(every, where, ends), *([_choices_panel(varied, every, where)] if varied else [])),
        width_mm=PAGE_MM,
    )


def _distance_panel(every: list[InterpretationVerdict], where: np.ndarray, ends: np.ndarray) -> Panel:
    marks = []
    for kind, (label, style) in KIND_STYLES.items():
        of = np.array([one.kind == kind for one in every])
        if of.any():
            value, lo, hi = ends[of].T
            marks.append(Line(where[of], value, tr(label), style, lo, hi))
    return Panel(
        Axis(tr("interpretation, sorted"), limits=(-LEFT_SPACE * len(every), len(every) + 1)),
        Axis(tr("distance of the worst part, margins (cut at ± {furthest:g})", furthest=MAX_DRAWN_MARGINS)),
        (
            *marks,
            *_shipped_lines(every, tr("as shipped")),
            Reference(0.0, label=tr("as the paper says")),
            Reference(1.0, label=tr("beyond the margin")),
        ),
        direct=False,
    )


def _shipped_lines(every: list[InterpretationVerdict], words: str) -> list[Reference]:
    """A line at the interpretation of the shipped configs."""
    return [Reference(float(n), "x", words) for n, one in enumerate(every, 1) if one.name == DEFAULT]


def _choices_panel(varied: list[Choice], every: list[InterpretationVerdict], where: np.ndarray) -> Panel:
    ticks, marks, height = [], [], HEADING_LINES - 1.0
    for choice in varied:
        height -= HEADING_LINES
        ticks.append((float(height), formulas(_shortened(f"{tr(choice.asks)}:"))))
        for one in choice.alternatives:
            height -= 1
            ticks.append((float(height), _shortened(alternative_words(one.name))))
            taken = np.array([interpretation.interpretation[choice.key] == one.name for interpretation in every])
            if taken.any():
                style = Style(
                    colour=KIND_STYLES[one.kind][1].colour,
                    dash=None,
                    marker=KIND_STYLES[one.kind][1].marker,
                    size_pt=2.6,
                )
                marks.append(Line(where[taken], np.full(taken.sum(), float(height)), "", style))
    return Panel(
        Axis(tr("interpretation, sorted"), limits=(-LEFT_SPACE * len(every), len(every) + 1)),
        Axis("", limits=(height - 1.0, 0.0), ticks=tuple(reversed(ticks))),
        (*marks, *_shipped_lines(every, "")),
        legend="none",
        height_mm=AXIS_MM - ROW_MM * height,
    )


def _shortened(text: str) -> str:
    return text if len(text) <= MAX_LABEL_CHARACTERS else text[: MAX_LABEL_CHARACTERS - 1] + "…"

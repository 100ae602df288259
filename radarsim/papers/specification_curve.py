"""Specification curves: a claim under every interpretation, sorted by outcome, and the alternatives of each."""

import numpy as np

from radarsim.language.translate import plural, term, tr
from radarsim.papers.interpretations import DEFAULT, Choice, alternative_words
from radarsim.papers.verdict_rule import AGAINST, EQUIVALENT, UNSTATED
from radarsim.papers.verdicts_by_interpretation import ClaimVerdicts, InterpretationVerdict, worst_distance
from radarsim.report.drawing.model import GREY, PAGE_MM, Axis, Figure, Line, Panel, Reference, Style
from radarsim.report.math_text import with_formulas

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


def specification_curve(claim: ClaimVerdicts) -> Figure:
    """The curve of a claim: above its worst part's distance from the paper's words, below the alternatives taken."""
    distances = [(verdict, worst_distance(verdict)) for verdict in claim.verdicts if verdict.outcome is not None]
    distances.sort(key=lambda pair: pair[1][0])
    verdicts = [verdict for verdict, _ in distances]
    places = np.arange(1, len(verdicts) + 1)
    ends = np.clip(np.array([distance for _, distance in distances]), -MAX_DRAWN_MARGINS, MAX_DRAWN_MARGINS)
    varied_choices = [
        choice
        for choice in claim.interpretations.choices
        if len({verdict.interpretation[choice.key] for verdict in verdicts}) > 1
    ]
    caption = tr(
        "{statement}. Above: distance of the claim's worst part from the paper's words, in margins; below 0 it "
        "holds. Below: the choices of each interpretation.",
        statement=tr(claim.claim.statement),
    )
    if left_out := len(claim.impossible):
        note = plural(
            "{count} interpretation that cannot be flown, designed or measured is left out.",
            "{count} interpretations that cannot be flown, designed or measured are left out.",
            left_out,
        )
        caption = f"{caption} {note}"
    return Figure(
        name=claim.claim.id,
        title=tr("{claim} under every interpretation", claim=claim.claim.id),
        caption=caption,
        headline=f"{claim.claim.id}: {claim.sentence()}",
        panels=(
            _distance_panel(verdicts, places, ends),
            *([_choices_panel(varied_choices, verdicts, places)] if varied_choices else []),
        ),
        width_mm=PAGE_MM,
    )


def _distance_panel(verdicts: list[InterpretationVerdict], places: np.ndarray, ends: np.ndarray) -> Panel:
    lines = []
    for kind, (label, style) in KIND_STYLES.items():
        of_kind = np.array([verdict.kind == kind for verdict in verdicts])
        if of_kind.any():
            value, lo, hi = ends[of_kind].T
            lines.append(Line(places[of_kind], value, tr(label), style, lo, hi))
    return Panel(
        Axis(tr("interpretation, sorted"), limits=(-LEFT_SPACE * len(verdicts), len(verdicts) + 1)),
        Axis(
            tr(
                "worst part outside the paper's value by (1: tolerance; cut at ± {furthest:g})",
                furthest=MAX_DRAWN_MARGINS,
            )
        ),
        (
            *lines,
            *_shipped_lines(verdicts, tr("as shipped")),
            Reference(0.0, label=tr("as the paper says")),
            Reference(1.0, label=tr("beyond the margin")),
        ),
        direct=False,
    )


def _shipped_lines(verdicts: list[InterpretationVerdict], words: str) -> list[Reference]:
    """A line at the interpretation of the shipped configs."""
    return [Reference(float(n), "x", words) for n, verdict in enumerate(verdicts, 1) if verdict.name == DEFAULT]


def _choices_panel(choices: list[Choice], verdicts: list[InterpretationVerdict], places: np.ndarray) -> Panel:
    ticks, marks, height = [], [], HEADING_LINES - 1.0
    for choice in choices:
        height -= HEADING_LINES
        ticks.append((float(height), with_formulas(_shortened(f"{tr(choice.asks)}:"))))
        for alternative in choice.alternatives:
            height -= 1
            ticks.append((float(height), _shortened(alternative_words(alternative.name))))
            has_alternative = np.array([verdict.interpretation[choice.key] == alternative.name for verdict in verdicts])
            if has_alternative.any():
                style = Style(
                    colour=KIND_STYLES[alternative.kind][1].colour,
                    dash=None,
                    marker=KIND_STYLES[alternative.kind][1].marker,
                    size_pt=2.6,
                )
                marks.append(Line(places[has_alternative], np.full(has_alternative.sum(), float(height)), "", style))
    return Panel(
        Axis(tr("interpretation, sorted"), limits=(-LEFT_SPACE * len(verdicts), len(verdicts) + 1)),
        Axis("", limits=(height - 1.0, 0.0), ticks=tuple(reversed(ticks))),
        (*marks, *_shipped_lines(verdicts, "")),
        legend="none",
        height_mm=AXIS_MM - ROW_MM * height,
    )


def _shortened(text: str) -> str:
    return text if len(text) <= MAX_LABEL_CHARACTERS else text[: MAX_LABEL_CHARACTERS - 1] + "…"

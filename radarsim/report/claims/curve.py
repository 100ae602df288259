"""Specification curves: a claim under every reading, sorted by how it comes out, and below what each reading takes."""

import numpy as np

from radarsim.language import term, tr
from radarsim.report.claims import rule
from radarsim.report.claims.over import Over, Under, depth
from radarsim.report.claims.readings import Choice, PaperReadings
from radarsim.report.drawing import GREY, PAGE_MM, Axis, Figure, Line, Panel, Reference, Style

FURTHEST = 5.0  # margins: what lies further is drawn there
LETTERS = 44  # of an alternative beside the panel
HEADING = 1.5  # lines that the name of a choice takes above its alternatives
KINDS = {
    rule.EQUIVALENT: (term("as shipped, or equivalent"), Style(colour=0, dash=None, marker=0)),
    rule.UNSTATED: (term("the paper does not say"), Style(colour=4, dash=None, marker=1)),
    rule.AGAINST: (term("against the print"), Style(colour=GREY, dash=None, marker=2)),
}


def specification(of: PaperReadings, over: Over) -> Figure:
    """The curve of a claim: above its worst part's distance from the paper's words, below the alternatives taken."""
    judged = [(one, depth(one)) for one in over.under if one.outcome is not None]
    judged.sort(key=lambda pair: pair[1][0])
    every = [one for one, _ in judged]
    where = np.arange(1, len(every) + 1)
    ends = np.clip(np.array([found for _, found in judged]), -FURTHEST, FURTHEST)
    varied = [choice for choice in of.choices if len({one.reading[choice.key] for one in every}) > 1]
    return Figure(
        name=over.claim.id,
        title=tr("{claim} under every reading", claim=over.claim.id),
        caption=tr(
            "{statement}. {outcome}. Above: how far the worst part of the claim is from what the paper says, in "
            "margins of that part, cut at ± {furthest:g}; under 0 it holds, over 1 it fails beyond the margin. Below: "
            "what each reading takes.",
            statement=tr(over.claim.statement),
            outcome=over.sentence().capitalize(),
            furthest=FURTHEST,
        ),
        panels=(_above(every, where, ends, over), *([_below(varied, every, where)] if varied else [])),
        width_mm=PAGE_MM,
        panel_height_mm=max(62.0, 4.2 * sum(len(choice.alternatives) + HEADING for choice in varied)),
    )


def _above(every: list[Under], where: np.ndarray, ends: np.ndarray, over: Over) -> Panel:
    marks = []
    for kind, (label, style) in KINDS.items():
        of = np.array([one.kind == kind for one in every])
        if of.any():
            value, lo, hi = ends[of].T
            marks.append(Line(where[of], value, tr(label), style, lo, hi))
    return Panel(
        Axis(tr("reading, sorted"), limits=(0, len(every) + 1)),
        Axis(tr("distance of the worst part, margins (cut at ± {furthest:g})", furthest=FURTHEST)),
        (*marks, Reference(0.0, label=tr("as the paper says")), Reference(1.0, label=tr("beyond the margin"))),
        title=f"{over.claim.id}: {over.sentence()}",
        direct=False,
    )


def _below(varied: list[Choice], every: list[Under], where: np.ndarray) -> Panel:
    ticks, marks, height = [], [], HEADING - 1.0
    for choice in varied:
        height -= HEADING
        ticks.append((float(height), _short(f"{choice.key}:")))
        for one in choice.alternatives:
            height -= 1
            ticks.append((float(height), _short(one.name)))
            taken = np.array([reading.reading[choice.key] == one.name for reading in every])
            if taken.any():
                style = Style(
                    colour=KINDS[one.kind][1].colour, dash=None, marker=KINDS[one.kind][1].marker, size_pt=2.6
                )
                marks.append(Line(where[taken], np.full(taken.sum(), float(height)), "", style))
    return Panel(
        Axis(tr("reading, sorted"), limits=(0, len(every) + 1)),
        Axis("", limits=(height - 1.0, 0.0), ticks=tuple(reversed(ticks))),
        tuple(marks),
        legend="none",
    )


def _short(text: str) -> str:
    return text if len(text) <= LETTERS else text[: LETTERS - 1] + "…"

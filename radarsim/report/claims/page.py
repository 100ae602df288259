"""The page of claims: all of a paper in a table, with every part below, from stored results.

The forest plot of claims: the worst part of each, its interval and exact value, in margins of the words.

Specification curves: a claim under every interpretation, sorted by outcome, and below the alternatives of each
interpretation.

The class of a claim over all interpretations that its paper allows, beside its class as shipped. It is computed in one
place, `over.Over.outcome`, when `radarsim interpretations` judges a claim under each of them, and kept as a row of
classes.csv. Everything else that shows a class looks it up."""

import math
import re
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from textwrap import shorten
from typing import Any

import numpy as np

from radarsim.config.experiment import digest
from radarsim.language import numeral, plural, term, tr
from radarsim.report.claims import rule
from radarsim.report.claims.declared import Claim
from radarsim.report.claims.judge import NOT_JUDGED, NOT_RUN
from radarsim.report.claims.over import (
    DEFAULT,
    DEPENDS_ON,
    Choice,
    Over,
    PaperInterpretations,
    Under,
    alternative,
    depth,
)
from radarsim.report.claims.rule import (
    CLASSES,
    CONFIRMED,
    CONTRADICTORY,
    DEPENDS,
    IMMATERIAL,
    REFUTED,
    UNDECIDED,
    UNJUDGEABLE,
    VOID,
    roughly,
)
from radarsim.report.drawing import GREY, PAGE_MM, Axis, Figure, Line, Note, Panel, Reference, Style
from radarsim.report.wording import formulas, interval

# ---- curve -----------------------------------------------------------------------------------------------------------
FURTHEST = 5.0  # margins: larger distances are drawn there
LETTERS = 44  # of an alternative beside the panel
HEADING = 1.5  # lines that the name of a choice takes above its alternatives
BESIDE = 0.02  # of all interpretations: room left of the first one, which may be as shipped
ROW_MM, AXIS_MM = 3.6, 14.0  # of a panel of rows: each, and its title and axis
KINDS = {
    rule.EQUIVALENT: (term("as shipped, or equivalent"), Style(colour=0, dash=None, marker=0)),
    rule.UNSTATED: (term("the paper does not say"), Style(colour=4, dash=None, marker=1)),
    rule.AGAINST: (term("against the print"), Style(colour=GREY, dash=None, marker=2)),
}


def specification(over: Over) -> Figure:
    """The curve of a claim: above its worst part's distance from the paper's words, below the alternatives taken."""
    judged = [(one, depth(one)) for one in over.under if one.outcome is not None]
    judged.sort(key=lambda pair: pair[1][0])
    every = [one for one, _ in judged]
    where = np.arange(1, len(every) + 1)
    ends = np.clip(np.array([found for _, found in judged]), -FURTHEST, FURTHEST)
    varied = [choice for choice in over.of.choices if len({one.interpretation[choice.key] for one in every}) > 1]
    caption = tr(
        "{statement}. {outcome}. Above: distance of the claim's worst part from the paper's words, in "
        "margins of that part, cut at ± {furthest:g}; below 0 it holds, above 1 it fails beyond the "
        "margin. Below: the choices of each interpretation.",
        statement=tr(over.claim.statement),
        outcome=over.sentence().capitalize(),
        furthest=FURTHEST,
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
        panels=(_above(every, where, ends), *([_below(varied, every, where)] if varied else [])),
        width_mm=PAGE_MM,
    )


def _above(every: list[Under], where: np.ndarray, ends: np.ndarray) -> Panel:
    marks = []
    for kind, (label, style) in KINDS.items():
        of = np.array([one.kind == kind for one in every])
        if of.any():
            value, lo, hi = ends[of].T
            marks.append(Line(where[of], value, tr(label), style, lo, hi))
    return Panel(
        Axis(tr("interpretation, sorted"), limits=(-BESIDE * len(every), len(every) + 1)),
        Axis(tr("distance of the worst part, margins (cut at ± {furthest:g})", furthest=FURTHEST)),
        (
            *marks,
            *_shipped(every, tr("as shipped")),
            Reference(0.0, label=tr("as the paper says")),
            Reference(1.0, label=tr("beyond the margin")),
        ),
        direct=False,
    )


def _shipped(every: list[Under], words: str) -> list[Reference]:
    """A line at the interpretation of the shipped configs."""
    return [Reference(float(n), "x", words) for n, one in enumerate(every, 1) if one.name == DEFAULT]


def _below(varied: list[Choice], every: list[Under], where: np.ndarray) -> Panel:
    ticks, marks, height = [], [], HEADING - 1.0
    for choice in varied:
        height -= HEADING
        ticks.append((float(height), formulas(_short(f"{tr(choice.asks)}:"))))
        for one in choice.alternatives:
            height -= 1
            ticks.append((float(height), _short(alternative(one.name))))
            taken = np.array([interpretation.interpretation[choice.key] == one.name for interpretation in every])
            if taken.any():
                style = Style(
                    colour=KINDS[one.kind][1].colour, dash=None, marker=KINDS[one.kind][1].marker, size_pt=2.6
                )
                marks.append(Line(where[taken], np.full(taken.sum(), float(height)), "", style))
    return Panel(
        Axis(tr("interpretation, sorted"), limits=(-BESIDE * len(every), len(every) + 1)),
        Axis("", limits=(height - 1.0, 0.0), ticks=tuple(reversed(ticks))),
        (*marks, *_shipped(every, "")),
        legend="none",
        height_mm=AXIS_MM - ROW_MM * height,
    )


def _short(text: str) -> str:
    return text if len(text) <= LETTERS else text[: LETTERS - 1] + "…"


# ---- classes ---------------------------------------------------------------------------------------------------------
COLUMNS = ("claim", "class", "holds", "of", "depends_on", "needed", "declared")
OVER = ("class", "overall", "holds", "of", "depends_on", "needed")  # columns of claims.csv
BOTH = term("{own} as shipped; {over}")
OVER_ALL = term("{kind} over all interpretations")
ALONE = term("{own} as shipped; other interpretations not judged")


@dataclass(frozen=True)
class Class:
    """A claim over all its interpretations: its class, in how many interpretations it is true, the choices that flip
    it.

    needed: realisations that would decide it if undecided, else NaN. declared: a mark of its declaration."""

    claim: str
    kind: str
    holds: int
    of: int
    depends_on: str
    needed: float
    declared: str

    def as_row(self) -> dict[str, Any]:
        """The row of classes.csv."""
        needed = "" if math.isnan(self.needed) else int(self.needed)
        values = (self.claim, self.kind, self.holds, self.of, self.depends_on, needed, self.declared)
        return dict(zip(COLUMNS, values, strict=True))

    @classmethod
    def of_row(cls, row: Mapping[str, Any]) -> "Class":
        """From a row of classes.csv. Raises ValueError or LookupError for an invalid one."""
        if row["class"] not in rule.CLASSES:
            raise ValueError(row["class"])
        needed = float(row["needed"]) if row["needed"] else math.nan
        holds, of = int(row["holds"]), int(row["of"])
        return cls(row["claim"], row["class"], holds, of, row["depends_on"], needed, row["declared"])


# For each claim that depends on an open choice: its class over all interpretations, None where unknown.
Known = Mapping[str, Class | None]


def declared(of: PaperInterpretations, claim: Claim) -> str:
    """A mark of a claim's assertions and of the open choices that affect it: a changed mark means another claim."""
    parts = [
        [
            *(part.what, part.unit, part.statement, part.number, part.variant, part.against_print, part.asserted),
            *(repr(end) for end in (part.expected.lo, part.expected.hi, part.expected.margin)),
            part.expected.kind,
        ]
        for part in claim.parts
    ]
    choices = [
        [choice.key, choice.contradicts, *([one.name, one.kind] for one in choice.alternatives)]
        for choice in of.choices
        if choice.bears_on(claim.id)
    ]
    return digest([parts, claim.how, choices])[:16]


def of_over(over: Over) -> Class | None:
    """The class of a claim over its interpretations; None where it could not be judged."""
    found = over.outcome
    if found is None or found.interpretations is None or found.holds_in is None:
        return None
    needed, on = float(found.needed or math.nan), ", ".join(found.depends_on)
    return Class(
        over.claim.id, found.kind, found.holds_in, found.interpretations, on, needed, declared(over.of, over.claim)
    )


def with_classes(rows: Sequence[Mapping[str, Any]], known: Known) -> list[dict[str, Any]]:
    """Rows of claims.csv with the class over all interpretations in place of that as shipped, which moves to
    `as_shipped`. Rows that were not judged stay as they are."""
    return [dict(row) | _over(row, known) for row in rows]


def _over(row: Mapping[str, Any], known: Known) -> dict[str, Any]:
    own = row["as_shipped"]
    if own in (NOT_RUN, NOT_JUDGED):
        return {}
    found = known.get(str(row["claim"]))
    if found is None:
        nothing: dict[str, Any] = {"class": own, "holds": math.nan, "of": math.nan, "depends_on": ""}
        lost = str(row["claim"]) in known and own not in rule.NO_READING_MENDS
        return nothing | {"overall": ALONE.format(own=own) if lost else own}
    needed = {} if own == rule.UNDECIDED else {"needed": found.needed}
    every = {"class": found.kind, "holds": found.holds, "of": found.of, "depends_on": found.depends_on}
    return every | needed | {"overall": words(found.kind, own, found.depends_on)}


def in_words(rows: Iterable[Mapping[str, Any]], every: Iterable[PaperInterpretations | None]) -> list[dict[str, Any]]:
    """Rows of claims.csv for people: what a claim depends on is in the words of its paper's interpretations."""
    of = {one.paper: one for one in every if one is not None}
    found = [dict(row) for row in rows]
    for row in found:
        if row["depends_on"]:
            row["depends_on"] = of[row["claim"].partition(".")[0]].asked(row["depends_on"].split(", "))
    return found


def alone(row: Mapping[str, Any]) -> bool:
    """Whether a claim was judged only as shipped, though open choices may change its verdict."""
    return bool(row["overall"] == ALONE.format(own=row["as_shipped"]))


def verdict_words(row: Mapping[str, Any]) -> str:
    """The verdict on a claim of claims.csv, as a phrase in the current language."""
    if alone(row):
        return tr(ALONE, own=term(row["as_shipped"]))
    return words(row["class"], row["as_shipped"], row["depends_on"], tr)


def words(kind: str, own: str, depends_on: str = "", say: Callable[..., str] = str.format) -> str:
    """The verdict on a claim as a phrase: its class, and the one as shipped if it differs.

    say: puts values into a message, as `language.tr` does; default: in English."""
    over: str = say(DEPENDS_ON, choices=depends_on) if kind == rule.DEPENDS and depends_on else say(kind)
    if own == kind:
        return over
    if kind not in (rule.DEPENDS, rule.CONTRADICTORY):
        over = say(OVER_ALL, kind=over)
    return say(BOTH, own=term(own), over=over)


# ---- page ------------------------------------------------------------------------------------------------------------
TITLE = "# The papers' claims"
HEAD = """One row for each claim: the paper's statement, the verdict, and the config that shows it (`radarsim run
CONFIG`, then `radarsim claims CONFIG`). All are judged by [one rule](verdicts.md), written before anything was
measured. Where the paper leaves a choice open, the verdict covers all interpretations that it allows (`radarsim
interpretations`): "refuted as shipped; depends on …" is false with the config's choice, and true with another one. Open
a claim for its original words, their interpretation, and the part furthest from them: its exact value, or the measured
one with its interval, and the expected range. Extensions are ours, or statements that a paper reports from others, and
are not counted."""
MARKS = (CONFIRMED, REFUTED)  # in bold
ORDER = (*CLASSES, NOT_JUDGED, NOT_RUN)
NOT_COUNTED = term("extension, not counted")  # a claim, or a part of one, that is not the paper's own
WORDS = {  # of each class, for the headline
    CONFIRMED: "true as stated",
    REFUTED: "false by more than the margin of their words",
    IMMATERIAL: "about differences too small to matter",
    CONTRADICTORY: "its numbers are reproduced only with values that it contradicts",
    UNJUDGEABLE: "without what a test needs",
    UNDECIDED: "intervals still too wide",
}


def page(rows: Sequence[Mapping], pages: Mapping[str, str], parts: bool = True) -> str:
    """The page, from the rows of `claims.listed`; pages holds the stem of a paper's page, by the paper.

    parts: whether a folded table of all measured parts follows."""
    text = [TITLE, "", HEAD, *headline(rows), ""]
    for paper in dict.fromkeys(row["paper"] for row in rows):
        own = [row for row in rows if row["paper"] == paper]
        key = own[0]["claim"].partition(".")[0]
        link = f" Equations and decisions: [{key}]({pages[paper]}.md)." if pages.get(paper) else ""
        claims = [[row for row in own if row["claim"] == claim] for claim in dict.fromkeys(row["claim"] for row in own)]
        text += [f"## {key} {paper}", "", f"{counted(own)}.{link}", ""]
        text += ["| claim | statement | verdict | config |", "|---|---|---|---|"]
        text += [*map(_line, claims), ""]
        lines = [line for every in claims for line in _parts(every)] if parts else []
        if lines:
            text += ["<details>", f"<summary>{key} part by part</summary>", ""]
            text += ["| claim | part | measured | exact | expected | miss, margins | verdict | rule of 0.1 |"]
            text += ["|---|---|---|---|---|---|---|---|", *lines, "", "</details>", ""]
    return "\n".join(text)


def headline(rows: Sequence[Mapping]) -> list[str]:
    """The classes with their counts, meanings and claims, a line each."""
    found, extensions = counts(rows)
    own = [parts[0] for parts in grouped(rows) if not extension(parts)]
    lines = [f"In all {sum(found.values())} claims, and {extensions} extensions that are not counted:", ""]
    for kind, count in found.items():
        names = in_a_row([row["claim"] for row in own if row["class"] == kind])
        meant = f", {WORDS[kind]}" if kind in WORDS else ""
        lines.append(f"* **{of_class(kind, count)}**{meant}: {names}")
    return lines


def in_a_row(claims: Sequence[str]) -> str:
    """Names of claims, consecutive numbers as a range: `P1.1–P1.34`."""
    runs: list[list[str]] = []
    for name in claims:
        paper, _, end = name.rpartition(".")
        follows = runs and end.isdecimal() and runs[-1][-1] == f"{paper}.{int(end) - 1}"
        runs[-1].append(name) if follows else runs.append([name])
    return ", ".join(f"{run[0]}–{run[-1]}" if len(run) > 2 else ", ".join(run) for run in runs)


def of_class(kind: str, count: int) -> str:
    """The number of claims of a class, in words."""
    if kind == DEPENDS:
        return plural(
            "{count} depends on what the paper leaves open", "{count} depend on what the paper leaves open", count
        )
    if kind == CONTRADICTORY:
        return tr("{count} where the print contradicts itself", count=count)
    return tr("{count} {kind}", count=count, kind=term(kind))


def counts(rows: Sequence[Mapping]) -> tuple[dict[str, int], int]:
    """How many claims are in each class, in the order of the rule, and how many extensions there are besides."""
    found: Counter[str] = Counter()
    extensions = 0
    for parts in grouped(rows):
        if extension(parts):
            extensions += 1
        else:
            found[parts[0]["class"]] += 1
    return {kind: found[kind] for kind in ORDER if found[kind]}, extensions


def grouped(rows: Sequence[Mapping]) -> list[list[Mapping]]:
    """The rows of each claim."""
    found: dict[tuple[str, str], list[Mapping]] = {}
    for row in rows:
        found.setdefault((row["paper"], row["claim"]), []).append(row)
    return list(found.values())


def extension(parts: Sequence[Mapping]) -> bool:
    """Whether nothing of a claim is the paper's own: ours, or reported from others."""
    return all(str(part["extension"]).lower() == "true" for part in parts)


def counted(rows: Sequence[Mapping]) -> str:
    """How many claims are in which class, in words."""
    classes, extensions = counts(rows)
    said = ", ".join(of_class(kind, count) for kind, count in classes.items())
    more = plural("{count} extension not counted", "{count} extensions not counted", extensions) if extensions else ""
    return "; ".join(filter(None, (said, more)))


def verdict_of(parts: Sequence[Mapping]) -> str:
    """The verdict on a claim, with the interpretations under which it is true, and what would decide an undecided
    one."""
    first, notes = parts[0], []
    text = verdict_words(first)
    if first["overall"] in MARKS:
        text = f"**{text}**"
    needed = number(first["needed"])
    if UNDECIDED in (first["class"], first["as_shipped"]) and needed is not None:
        notes.append(tr("{needed} realisations would decide", needed=f"{roughly(needed):,}"))
    if of := number(first["of"]):
        holds = number(first["holds"])
        notes.append(
            tr("true under all {of:.0f} interpretations", of=of)
            if holds == of
            else tr("true under {holds:.0f} of {of:.0f} interpretations", holds=holds, of=of)
        )
    if first["class"] in (UNJUDGEABLE, NOT_JUDGED) and first["why"]:
        notes.append(rule.said(first["why"]))
    if extension(parts):
        notes.append(tr(NOT_COUNTED))
    return f"{text} ({'; '.join(notes)})" if notes else text


def number(value: Any) -> float | None:
    """A number of a row, None where it has none."""
    if value in ("", None):
        return None
    return None if math.isnan(float(value)) else float(value)


def _line(parts: Sequence[Mapping]) -> str:
    """A claim: its words; folded, the original, its interpretation and the part furthest from it; its class."""
    first, found = parts[0], worst(parts)
    original = f"«{first['original']}»" if first["original"] else ""
    inner = [" ".join(filter(None, (original, f"({first['place']})")))]
    if first["interpretation"]:
        inner.append(f"Read as: {first['interpretation']}.")
    if found is not None:
        inner.append(f"Result: {named(found, parts)}: {shown(found)}; expected {_expected(found)}.")
    said = f"<details><summary>{_cell(first['statement'])}</summary>{'<br>'.join(map(_cell, inner))}</details>"
    return f"| {first['claim']} | {said} | {_cell(verdict_of(parts))} | `{first['config']}` |"


def _expected(row: Mapping) -> str:
    return f"{row['expected']} {row['unit']}".rstrip()


def worst(parts: Sequence[Mapping]) -> Mapping | None:
    """The part furthest from its words, of variants of a number the nearest; None where none was measured."""
    counted = extension(parts)
    best: dict[str, Mapping] = {}
    for i, row in enumerate(parts):
        ours = extension([row]) and not counted
        if number(row["measured"]) is None or row["verdict"] == VOID or ours:
            continue
        key = str(row["number"]) or f"#{i}"
        if key not in best or depth_of_row(_value(row), row) < depth_of_row(_value(best[key]), best[key]):
            best[key] = row
    return max(best.values(), key=lambda row: depth_of_row(_value(row), row), default=None)


def depth_of_row(value: float, row: Mapping) -> float:
    """Distance of a value from the words, in margins: 0 at an end of the range, negative inside."""
    lo, hi = number(row["expected_lo"]), number(row["expected_hi"])
    below = -math.inf if lo is None else lo - value
    above = -math.inf if hi is None else value - hi
    return max(below, above) / (number(row["margin"]) or 1.0)


def _value(row: Mapping) -> float:
    exact = number(row["exact"])
    return float(row["measured"]) if exact is None else exact


def _parts(parts: Sequence[Mapping]) -> list[str]:
    """A row for each part of a claim that was run."""
    lines = []
    for row in parts if parts[0]["class"] != NOT_RUN else ():
        verdict = f"**{row['verdict']}**" if row["verdict"] in MARKS else row["verdict"]
        if row["verdict"] == VOID:
            verdict = f"void: an efficient estimator reaches {number(row['ceiling']):.3f}"
        if row["verdict"] == NOT_JUDGED:
            verdict = f"{NOT_JUDGED}: {row['why']}"
        if str(row["extension"]).lower() == "true":
            verdict += " (extension)"
        exact, missed = number(row["exact"]), number(row["miss"])
        cells = (
            *(row["claim"], named(row, parts), measured(row) if number(row["measured"]) is not None else ""),
            *("" if exact is None else plain(exact), _expected(row)),
            *("" if missed is None else f"{missed:.3g}", verdict, row["old_verdict"]),
        )
        lines.append("| " + " | ".join(map(_cell, cells)) + " |")
    return lines


def named(row: Mapping, parts: Sequence[Mapping]) -> str:
    """Description of a part, with its case where another part has the same words."""
    alike = sum(other["what"] == row["what"] for other in parts)
    return row["what"] if alike == 1 else f"`{row['case']}`: {row['what']}"


def shown(row: Mapping) -> str:
    """The value that decides a part: the exact one where known, else the measured one with its interval."""
    exact = number(row["exact"])
    if number(row["measured"]) is None:
        return "–"
    if exact is None:
        return measured(row)
    return tr("{value} exactly", value=f"{plain(exact)} {unit_after(exact, row['unit'])}".rstrip())


def unit_after(value: float, unit: str) -> str:
    """A unit after a number: a counted thing in its plural form, that of two after a fraction."""
    count = abs(int(value)) if value == value // 1 else 2
    if unit == "scans":
        return plural("scan", "scans", count)
    if unit == "plots":
        return plural("plot", "plots", count)
    return plural("point", "points", count) if unit == "points" else tr(unit)


def expected(words: str, unit: str = "") -> str:
    """The expected range, in the current language: `about 20 to 30 ± 10`; with the unit if given."""
    said = " ".join(tr(one) if one.isalpha() else numeral(one) for one in words.split())
    last = re.findall(r"\d[\d.]*", words)[-1:]
    return f"{said} {unit_after(float(last[0]), unit) if last else tr(unit)}".rstrip() if unit else said


EXPECTED = (term("about"), term("to"), term("few"))  # the words in it


def plain(value: float) -> str:
    """A number at four digits."""
    return numeral(f"{value:.4g}").replace("inf", "∞")


def measured(row: Mapping) -> str:
    """Value and unit, with the interval where there is a sampling error, both to two figures of its half-width."""
    value, (lo, hi) = float(row["measured"]), bounds(row)
    half = (hi - lo) / 2
    if not 0 < half < math.inf:
        text = numeral(f"{value:.4g}").replace("inf", "∞")
    else:
        whole = all(one == round(one) for one in (value, lo, hi))
        place = 0 if whole else max(0, 1 - math.floor(math.log10(half)))
        middle, low, high = (numeral(f"{round(one, place) + 0.0:.{place}f}") for one in (value, lo, hi))
        text = f"{middle} {interval(low, high)}"
    return f"{text} {unit_after(value, row['unit'])}".rstrip().replace("-", "\N{MINUS SIGN}")


def bounds(row: Mapping) -> tuple[float, float]:
    """The interval shown for a part: the judged one, or, if it is known exactly, its own 95 %."""
    names = ("judged_lo", "judged_hi") if number(row["exact"]) is None else ("lo", "hi")
    lo, hi = (math.nan if row[name] == "" else float(row[name]) for name in names)
    return lo, hi


def _cell(text: str) -> str:
    """Text that neither ends a cell nor is read as markup."""
    text = text.replace("|", "\\|")
    return text.replace("<", "&lt;").replace("&lt;br>", "<br>")


# ---- forest ----------------------------------------------------------------------------------------------------------
FURTHEST_IN_FOREST = 4.0  # margins: larger distances are drawn there
STATEMENT = 56  # letters of a claim beside its row
BEYOND, RIM = 4.35, 4.6  # where an arrow says so, and where the panel ends
COLOURS = (5, 2, 4, GREY, 3, 1, 6)  # of the classes in their order: green, red, blue, grey, …
STYLES = {
    kind: Style(colour=colour, dash=None, marker=i, size_pt=4.0)
    for i, (kind, colour) in enumerate(zip(CLASSES, COLOURS, strict=True))
}


def depth_in_forest(value: float, row: Mapping) -> float:
    """Distance of a value from the words, in margins, cut at 4."""
    return float(np.clip(depth_of_row(value, row), -FURTHEST_IN_FOREST, FURTHEST_IN_FOREST))


def figure(rows: Sequence[Mapping]) -> Figure | None:
    """All judged claims of these rows, a panel of rows for each paper; None where there are none."""
    judged = [own for own in grouped(rows) if own[0]["class"] not in (NOT_RUN, NOT_JUDGED)]
    found = [(own, row) for own in judged if (row := worst(own)) is not None]
    papers = list(dict.fromkeys(own[0]["paper"] for own, _ in found))
    panels = [_panel(paper, [(own, row) for own, row in found if own[0]["paper"] == paper]) for paper in papers]
    if not panels:
        return None
    classes = Counter(own[0]["class"] for own in judged)
    counted = ", ".join(of_class(kind, classes[kind]) for kind in ORDER if classes[kind])
    return Figure(
        name="claims",
        title=tr("Claims, in margins of what their papers say"),
        caption=plural("Of {count} claim: {counted}. ", "Of {count} claims: {counted}. ", len(judged), counted=counted)
        + tr(
            "For each claim, the part furthest from the paper's words: the measured value with the judged "
            "interval, and the exact value, in margins of that part; beside it the value itself. What lies beyond "
            "± {furthest:g} is drawn there, with an arrow. Below 0 it agrees with the words, up to 1 it is within "
            "their margin. The marker shows the claim's class over all interpretations that its paper allows.",
            furthest=FURTHEST_IN_FOREST,
        ),
        panels=tuple(panels),
        width_mm=PAGE_MM,
    )


def _panel(paper: str, found: Sequence[tuple[Sequence[Mapping], Mapping]]) -> Panel:
    """The claims of a paper: statement, distance, and at the right the value."""
    key = found[0][0][0]["claim"].partition(".")[0]
    ticks, marks, values = [], [], []
    for y, (own, row) in enumerate(found):
        statement = shorten(tr(own[0]["statement"]), STATEMENT, placeholder=" …", break_on_hyphens=False)
        ticks.append((float(y), f"{formulas(statement)}  {own[0]['claim'].partition('.')[2]}"))
        values.append(Note(RIM, float(y), shown(row), "e"))
    for kind, style in STYLES.items():
        of = [(y, row) for y, (own, row) in enumerate(found) if own[0]["class"] == kind]
        marks += _forest_lines(kind, style, of) if of else []
    return Panel(
        Axis(
            tr("distance from the words, margins (cut at ± {furthest:g})", furthest=FURTHEST_IN_FOREST),
            limits=(-RIM, RIM),
        ),
        Axis("", limits=(len(found) - 0.4, -0.6), ticks=tuple(ticks)),
        (*marks, *values, Reference(0.0, "x"), Reference(1.0, "x")),
        title=f"{key} {tr(paper)}",
        direct=False,
        height_mm=AXIS_MM + ROW_MM * len(found),
    )


def _forest_lines(kind: str, style: Style, of: Sequence[tuple[int, Mapping]]) -> list[Line]:
    """The marks of one class: values, intervals, exact values, and arrows where a value lies beyond the rims."""
    y, rows = np.array([float(y) for y, _ in of]), [row for _, row in of]
    value = np.array([depth_in_forest(float(row["measured"]), row) for row in rows])
    ends = np.array([sorted(depth_in_forest(end, row) for end in bounds(row)) for row in rows])
    lo, hi = np.fmin(ends[:, 0], value), np.fmax(ends[:, 1], value)
    known = [number(row["exact"]) for row in rows]
    exact = np.array(
        [math.nan if one is None else depth_in_forest(one, row) for one, row in zip(known, rows, strict=True)]
    )
    gap = np.full(len(y), math.nan)
    marks = [
        Line(value, y, tr(kind), style),
        Line(np.ravel([lo, hi, gap], "F"), np.ravel([y, y, gap], "F"), "", replace(style, dash=0, marker=None)),
    ]
    marks += [Line(exact, gap, style=replace(style, dash=None), exact=y)] if np.isfinite(exact).any() else []
    for sign, arrow in ((-1, 8), (1, 10)):
        beyond = sign * value >= FURTHEST_IN_FOREST
        look = replace(style, marker=arrow, size_pt=3.0)
        marks += [Line(np.full(beyond.sum(), sign * BEYOND), y[beyond], "", look)] if beyond.any() else []
    return marks

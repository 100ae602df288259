"""docs/claims.md: all claims of the papers in a table each, and every part of them below, made from stored results."""

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

from radarsim.language import numeral, plural, term, tr
from radarsim.report.claims import classes, reasons
from radarsim.report.claims.judge import NOT_JUDGED, NOT_RUN
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
from radarsim.report.text import interval

HEAD = """# The papers' claims

Made from results by `make claims-page`, never by hand, by [one rule](verdicts.md) that was written down before anything
was measured. Of each claim a line: what the paper says; the part of it that lies furthest from these words, measured
with the interval that is judged or exactly, and what the words leave; how far the claim stands; the config that shows
it (`radarsim run CONFIG`, then `radarsim claims CONFIG`). The class is over all readings that the paper allows, where
it leaves anything open (`radarsim readings`): "refuted as shipped; depends on start" is false with the choices that
the config takes, and true with another start. Below, to be opened: every claim in the original and how it was read,
and every part: what was measured, the exact value where it is known, which then decides, the values that the words
leave, and by how many margins it misses them. Extensions are ours, or what a paper only reports of others, and are not
counted.

![All claims, in margins of what their papers say](claims.svg)
"""
MARKS = (CONFIRMED, REFUTED)  # in bold
ORDER = (*CLASSES, NOT_JUDGED, NOT_RUN)
NOT_COUNTED = term("extension, not counted")  # a claim, or a part of one, that is not the paper's own
WORDS = {  # of each class, for the headline
    CONFIRMED: "true as stated",
    REFUTED: "false by more than the margin of their words",
    IMMATERIAL: "about differences too small to matter",
    CONTRADICTORY: "its numbers come out only under values that it prints otherwise",
    UNJUDGEABLE: "without what a test needs",
    UNDECIDED: "intervals still too wide",
}


def page(rows: Sequence[Mapping], pages: Mapping[str, str]) -> str:
    """The page, from the rows of `claims.listed`; pages holds the stem of a paper's page, by the paper."""
    text = [HEAD, *headline(rows), ""]
    for paper in dict.fromkeys(row["paper"] for row in rows):
        own = [row for row in rows if row["paper"] == paper]
        key = own[0]["claim"].partition(".")[0]
        link = f" Equations and decisions: [{key}]({pages[paper]}.md)." if pages.get(paper) else ""
        claims = [[row for row in own if row["claim"] == claim] for claim in dict.fromkeys(row["claim"] for row in own)]
        text += [f"## {key} {paper}", "", f"{counted(own)}.{link}", ""]
        text += [
            "| claim | what the paper says | what came out | how far it stands | config |",
            "|---|---|---|---|---|",
        ]
        text += [*map(_line, claims), "", "<details>", f"<summary>{key} in the original, part by part</summary>", ""]
        text += ["| claim | in the original | place | read as |", "|---|---|---|---|", *map(_original, claims), ""]
        text += ["| claim | part | measured | exact | expected | miss, margins | verdict | rule of 0.1 |"]
        text += ["|---|---|---|---|---|---|---|---|"]
        text += [line for parts in claims for line in _parts(parts)]
        text += ["", "</details>", ""]
    return "\n".join(text)


def headline(rows: Sequence[Mapping]) -> list[str]:
    """The classes with their counts, what they mean and which claims are of them, a line each."""
    found, extensions = counts(rows)
    own = [parts[0] for parts in grouped(rows) if not extension(parts)]
    lines = [f"In all {sum(found.values())} claims, and {extensions} extensions that are not counted:", ""]
    for kind, count in found.items():
        names = in_a_row([row["claim"] for row in own if row["class"] == kind])
        meant = f", {WORDS[kind]}" if kind in WORDS else ""
        lines.append(f"* **{of_class(kind, count)}**{meant}: {names}")
    return lines


def in_a_row(claims: Sequence[str]) -> str:
    """Names of claims, those with numbers in a row by the first and last: `P1.1–P1.34`."""
    runs: list[list[str]] = []
    for name in claims:
        paper, _, end = name.rpartition(".")
        follows = runs and end.isdecimal() and runs[-1][-1] == f"{paper}.{int(end) - 1}"
        runs[-1].append(name) if follows else runs.append([name])
    return ", ".join(f"{run[0]}–{run[-1]}" if len(run) > 2 else ", ".join(run) for run in runs)


def of_class(kind: str, count: int) -> str:
    """How many claims are of a class, in words."""
    if kind == DEPENDS:
        return plural(
            "{count} depends on what the paper leaves open", "{count} depend on what the paper leaves open", count
        )
    if kind == CONTRADICTORY:
        return tr("{count} where the print contradicts itself", count=count)
    return tr("{count} {kind}", count=count, kind=term(kind))


def counts(rows: Sequence[Mapping]) -> tuple[dict[str, int], int]:
    """How many claims are of each class, in the order of the rule, and how many extensions there are besides."""
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
    """Whether nothing of a claim is the paper's own: ours, or reported of others."""
    return all(str(part["extension"]).lower() == "true" for part in parts)


def counted(rows: Sequence[Mapping]) -> str:
    """How many claims are of which class, in words."""
    classes, extensions = counts(rows)
    said = ", ".join(of_class(kind, count) for kind, count in classes.items())
    more = plural("{count} extension not counted", "{count} extensions not counted", extensions) if extensions else ""
    return "; ".join(filter(None, (said, more)))


def verdict_of(parts: Sequence[Mapping]) -> str:
    """How far a claim stands, with the readings under which it is true, and what would decide one that is not."""
    first, notes = parts[0], []
    text = classes.said(first)
    if first["overall"] in MARKS:
        text = f"**{text}**"
    needed = number(first["needed"])
    if UNDECIDED in (first["class"], first["as_shipped"]) and needed is not None:
        notes.append(tr("{needed} realisations would decide", needed=f"{roughly(needed):,}"))
    if of := number(first["of"]):
        holds = number(first["holds"])
        notes.append(
            tr("true under all {of:.0f} readings", of=of)
            if holds == of
            else tr("true under {holds:.0f} of {of:.0f} readings", holds=holds, of=of)
        )
    if first["class"] in (UNJUDGEABLE, NOT_JUDGED) and first["why"]:
        notes.append(reasons.said(first["why"]))
    if extension(parts):
        notes.append(tr(NOT_COUNTED))
    return f"{text} ({'; '.join(notes)})" if notes else text


def number(value: Any) -> float | None:
    """A number of a row, None where it has none."""
    if value in ("", None):
        return None
    return None if math.isnan(float(value)) else float(value)


def _line(parts: Sequence[Mapping]) -> str:
    """A claim: its words, the part that is furthest from them, its class."""
    first, found = parts[0], worst(parts)
    came = "" if found is None else f"{_named(found, parts)}: {shown(found)}; expected {_expected(found)}"
    cells = (first["claim"], first["statement"], came, verdict_of(parts))
    return "| " + " | ".join(map(_cell, cells)) + f" | `{first['config']}` |"


def _original(parts: Sequence[Mapping]) -> str:
    """A claim as its paper has it, and how it was read."""
    first = parts[0]
    original = f"«{first['original']}»" if first["original"] else ""
    return "| " + " | ".join(map(_cell, (first["claim"], original, first["place"], first["reading"]))) + " |"


def _expected(row: Mapping) -> str:
    return f"{row['expected']} {row['unit']}".rstrip()


def worst(parts: Sequence[Mapping]) -> Mapping | None:
    """The part that is furthest from its words, of variants of a number the nearest; None where none was measured."""
    counted = extension(parts)
    best: dict[str, Mapping] = {}
    for i, row in enumerate(parts):
        ours = extension([row]) and not counted
        if number(row["measured"]) is None or row["verdict"] == VOID or ours:
            continue
        key = str(row["number"]) or f"#{i}"
        if key not in best or depth(_value(row), row) < depth(_value(best[key]), best[key]):
            best[key] = row
    return max(best.values(), key=lambda row: depth(_value(row), row), default=None)


def depth(value: float, row: Mapping) -> float:
    """Distance of a value from what the words say, in margins: 0 at an end of the range, negative inside."""
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
            *(row["claim"], _named(row, parts), measured(row) if number(row["measured"]) is not None else ""),
            *("" if exact is None else plain(exact), _expected(row)),
            *("" if missed is None else f"{missed:.3g}", verdict, row["old_verdict"]),
        )
        lines.append("| " + " | ".join(map(_cell, cells)) + " |")
    return lines


def _named(row: Mapping, parts: Sequence[Mapping]) -> str:
    """What a part measures, with its case where the words alone are those of another part too."""
    alike = sum(other["what"] == row["what"] for other in parts)
    return row["what"] if alike == 1 else f"`{row['case']}`: {row['what']}"


def shown(row: Mapping) -> str:
    """What decides a part: the exact value where it is known, else the measured one with its interval."""
    exact = number(row["exact"])
    if number(row["measured"]) is None:
        return "–"
    unit = tr(str(row["unit"]))
    return measured(row) if exact is None else tr("{value} exactly", value=f"{plain(exact)} {unit}".rstrip())


def expected(words: str) -> str:
    """What is expected of a part, in the language spoken: `about 20 to 30 ± 10`."""
    return " ".join(tr(one) if one.isalpha() else numeral(one) for one in words.split())


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
    return f"{text} {tr(str(row['unit']))}".rstrip().replace("-", "\N{MINUS SIGN}")


def bounds(row: Mapping) -> tuple[float, float]:
    """The interval of a part that is shown: that which is judged, or of one known exactly its own 95 %."""
    names = ("judged_lo", "judged_hi") if number(row["exact"]) is None else ("lo", "hi")
    lo, hi = (math.nan if row[name] == "" else float(row[name]) for name in names)
    return lo, hi


def _cell(text: str) -> str:
    """Text that neither ends a cell nor is taken for markup."""
    text = text.replace("|", "\\|")
    return text.replace("<", "&lt;").replace("&lt;br>", "<br>")

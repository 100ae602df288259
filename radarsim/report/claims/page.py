"""docs/claims.md: all claims of the papers in a table each, and every part of them below, made from stored results."""

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

from radarsim.language import numeral, plural, term, tr
from radarsim.report.claims import reasons
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

MANY_MARGINS = 1000  # a miss by more is told as that: of an identity the margin is rounding
HEAD = """# The papers' claims

Made from results by `make claims-page`, never by hand, by [one rule](verdicts.md) that was written down before anything
was measured. For each paper first every claim: what it says, in English and in the original, and where; what came out;
its class, with the worst miss in margins; and the config that shows it (`radarsim run CONFIG`, then `radarsim claims
CONFIG`). Then every part of each: what was measured, with its 95 % interval in brackets where it has a sampling error;
the exact value where it is known, which then decides; the values that the paper's words leave, with their margin; and
the miss. "In m of M readings": `radarsim readings` judges a claim under everything that its paper leaves open. How the
words were read stands in italics. Extensions are ours and are not counted.

![All claims, in margins of what their papers say](claims.svg)
"""
MARKS = {CONFIRMED: "**confirmed**", REFUTED: "**refuted**"}
ORDER = (*CLASSES, NOT_JUDGED, NOT_RUN)
NOT_COUNTED = term("extension, not counted")  # a claim, or a part of one, that is ours
SHOWN = 3  # parts of a claim in its paper's first table
WORDS = {  # of each class, for the headline
    CONFIRMED: "true as stated",
    REFUTED: "false by more than the margin of their words",
    DEPENDS: "true or false with what the paper leaves open",
    IMMATERIAL: "about differences too small to matter",
    CONTRADICTORY: "numbers that come out only under values that the paper prints otherwise",
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
        text += ["| claim | statement | place | measured | class | config |", "|---|---|---|---|---|---|"]
        text += [*map(_line, claims), "", f"### {key}, part by part", ""]
        text += ["| claim | part | measured | exact | expected | miss, margins | verdict | rule of 0.1 |"]
        text += ["|---|---|---|---|---|---|---|---|"]
        text += [line for parts in claims for line in _parts(parts)]
        text.append("")
    return "\n".join(text)


def headline(rows: Sequence[Mapping]) -> list[str]:
    """The classes with their counts and what they mean, a line each."""
    classes, extensions = counts(rows)
    lines = [f"In all {sum(classes.values())} claims, and {extensions} extensions that are not counted:", ""]
    for kind, count in classes.items():
        lines.append(f"* {count} {kind}" + (f": {WORDS[kind]}" if kind in WORDS else ""))
    return lines


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
    """Whether all of a claim is ours."""
    return all(str(part["extension"]).lower() == "true" for part in parts)


def counted(rows: Sequence[Mapping]) -> str:
    """How many claims are of which class, in words."""
    classes, extensions = counts(rows)
    said = ", ".join(tr("{count} {kind}", count=count, kind=term(kind)) for kind, count in classes.items())
    more = plural("{count} extension not counted", "{count} extensions not counted", extensions) if extensions else ""
    return "; ".join(filter(None, (said, more)))


def verdict_of(parts: Sequence[Mapping]) -> str:
    """A claim's class in words, with the miss of one that is refuted and what would decide one that is not."""
    first = parts[0]
    said = str(first["overall"])
    text = class_words(said)
    if said in MARKS:
        text = MARKS[said].replace(said, text)
    notes = []
    if first["class"] in (REFUTED, CONTRADICTORY) and (number(first["worst_miss"]) or 0.0) > 1:
        miss = number(first["worst_miss"]) or 0.0
        far = miss >= MANY_MARGINS
        words = tr("by over {many:,} margins", many=MANY_MARGINS) if far else tr("by {miss:.3g} margins", miss=miss)
        notes.append(words)
    needed = number(first["needed"])
    if first["class"] == UNDECIDED and needed is not None:
        notes.append(tr("{needed} realisations would decide", needed=f"{roughly(needed):,}"))
    if number(first["of"]) is not None:
        holds, of = number(first["holds"]), number(first["of"])
        notes.append(tr("in {holds:.0f} of {of:.0f} readings", holds=holds, of=of))
    if first["class"] in (UNJUDGEABLE, NOT_JUDGED) and first["why"]:
        notes.append(reasons.said(first["why"]))
    if extension(parts):
        notes.append(tr(NOT_COUNTED))
    return f"{text} ({'; '.join(notes)})" if notes else text


def class_words(said: str) -> str:
    """A claim's class as the rule words it, in the language spoken."""
    keys = said.removeprefix(DEPENDS).strip()
    return tr("depends on {keys}", keys=keys) if said.startswith(DEPENDS) and keys else tr(said)


def number(value: Any) -> float | None:
    """A number of a row, None where it has none."""
    if value in ("", None):
        return None
    return None if math.isnan(float(value)) else float(value)


def _line(parts: Sequence[Mapping]) -> str:
    """A claim: its words, some parts of those that decide it, its class."""
    first = parts[0]
    original = f" «{first['original']}»" if first["original"] else ""
    reading = f" *Read as: {first['reading']}.*" if first["reading"] else ""
    said = first["statement"] + original + reading
    cells = (first["claim"], said, first["place"], "<br>".join(_decisive(parts)), verdict_of(parts))
    return "| " + " | ".join(map(_cell, cells)) + f" | `{first['config']}` |"


def _decisive(parts: Sequence[Mapping]) -> list[str]:
    """Up to three parts, the worst first, and how many came out how."""
    if parts[0]["class"] == NOT_RUN:
        return []
    own = [row for row in parts if str(row["extension"]).lower() != "true"] or list(parts)
    worst = sorted(own, key=lambda row: -(number(row["miss"]) or 0.0)) if len(own) > SHOWN else own
    said = [f"{_named(row, parts)}: {shown(row)} ({row['verdict']})" for row in worst[:SHOWN]]
    if len(own) > SHOWN:
        said.append(f"({summary(own)} of {len(own)} parts)")
    return said


def summary(parts: Sequence[Mapping]) -> str:
    """How many parts came out how."""
    found = Counter(row["verdict"] for row in parts)
    order = [*ORDER, VOID]
    return ", ".join(f"{found[one]} {one}" for one in sorted(found, key=order.index))


def _parts(parts: Sequence[Mapping]) -> list[str]:
    """A row for each part of a claim that was run."""
    lines = []
    for row in parts if parts[0]["class"] != NOT_RUN else ():
        verdict = MARKS.get(row["verdict"], row["verdict"])
        if row["verdict"] == VOID:
            verdict = f"void: an efficient estimator reaches {number(row['ceiling']):.3f}"
        if row["verdict"] == NOT_JUDGED:
            verdict = f"{NOT_JUDGED}: {row['why']}"
        if str(row["extension"]).lower() == "true":
            verdict += " (extension)"
        exact, missed = number(row["exact"]), number(row["miss"])
        cells = (
            *(row["claim"], _named(row, parts), measured(row) if number(row["measured"]) is not None else ""),
            *("" if exact is None else plain(exact), f"{row['expected']} {row['unit']}".rstrip()),
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
    value, lo, hi = (float(row[name]) for name in ("measured", "lo", "hi"))
    half = (hi - lo) / 2
    if not 0 < half < math.inf:
        text = numeral(f"{value:.4g}").replace("inf", "∞")
    else:
        whole = all(one == round(one) for one in (value, lo, hi))
        place = 0 if whole else max(0, 1 - math.floor(math.log10(half)))
        middle, low, high = (numeral(f"{round(one, place) + 0.0:.{place}f}") for one in (value, lo, hi))
        text = f"{middle} {interval(low, high)}"
    return f"{text} {tr(str(row['unit']))}".rstrip().replace("-", "\N{MINUS SIGN}")


def _cell(text: str) -> str:
    """Text that neither ends a cell nor is taken for markup."""
    text = text.replace("|", "\\|")
    return text.replace("<", "&lt;").replace("&lt;br>", "<br>")

"""docs/claims.md: all claims of the papers in a table each, and every part of them below, made from stored results."""

import math
from collections import Counter
from collections.abc import Mapping, Sequence

from radarsim.report.claims import CONFIRMED, NOT_RUN, REFUTED

HEAD = """# The papers' claims

Made from results by `make claims-page`, never by hand. For each paper first every claim: what it says and where, what
came out, the verdict, and the config that shows it (`radarsim run CONFIG`, then `radarsim claims CONFIG`). Then every
part of each: what was measured, with its 95 % interval in brackets where it has a sampling error, and the range that
the paper's words leave to it. Of a claim of more than three parts the first table shows some that decide it.

Confirmed: the whole interval lies in the range; refuted: wholly outside; else not distinguishable. A claim of several
parts is confirmed when all of them are, refuted when one is. How the words were read stands in italics; the ranges come
from the words alone and were written down before anything was measured ([rules](methods.md#verdicts)).
"""
MARKS = {CONFIRMED: "**confirmed**", REFUTED: "**refuted**"}
SHOWN = 3  # parts of a claim in its paper's first table


def page(rows: Sequence[Mapping], pages: Mapping[str, str]) -> str:
    """The page, from the rows of `claims.listed`; pages holds the stem of a paper's page, by the paper."""
    text = [HEAD, f"In all: {counted(rows)}.", ""]
    for paper in dict.fromkeys(row["paper"] for row in rows):
        own = [row for row in rows if row["paper"] == paper]
        key = own[0]["claim"].partition(".")[0]
        link = f" Equations and decisions: [{key}]({pages[paper]}.md)." if pages.get(paper) else ""
        claims = [[row for row in own if row["claim"] == claim] for claim in dict.fromkeys(row["claim"] for row in own)]
        text += [f"## {key} {paper}", "", f"{counted(own)}.{link}", ""]
        text += ["| claim | statement | place | measured | verdict | config |", "|---|---|---|---|---|---|"]
        text += [*map(_line, claims), "", f"### {key}, part by part", ""]
        text += ["| claim | part | measured | range that the words leave | verdict |", "|---|---|---|---|---|"]
        text += [line for parts in claims for line in _parts(parts)]
        text.append("")
    return "\n".join(text)


def counted(rows: Sequence[Mapping]) -> str:
    """How many claims came out how, in words."""
    overall = {(row["paper"], row["claim"]): row["overall"] for row in rows}
    return ", ".join(f"{count} {verdict}" for verdict, count in Counter(overall.values()).items())


def _line(parts: Sequence[Mapping]) -> str:
    """A claim: its words, some parts of those that decide it, its verdict."""
    first = parts[0]
    verdict = MARKS.get(first["overall"], first["overall"])
    reading = f" *Read as: {first['reading']}.*" if first["reading"] else ""
    cells = (first["claim"], first["statement"] + reading, first["place"], "<br>".join(_decisive(parts)), verdict)
    return "| " + " | ".join(map(_cell, cells)) + f" | `{first['config']}` |"


def _decisive(parts: Sequence[Mapping]) -> list[str]:
    """Up to three parts, of those that have the claim's verdict, and how many there are besides."""
    if parts[0]["overall"] == NOT_RUN:
        return []
    deciding = parts if len(parts) <= SHOWN else [row for row in parts if row["verdict"] == row["overall"]]
    said = []
    for row in deciding[:SHOWN]:
        own = "" if row["verdict"] == row["overall"] else f" ({row['verdict']})"
        said.append(f"{_named(row, parts)}: {measured(row)}{own}")
    if len(parts) > SHOWN:
        agree = sum(row["verdict"] == row["overall"] for row in parts)
        said.append(f"({agree} of {len(parts)} parts {parts[0]['overall']})")
    return said


def _parts(parts: Sequence[Mapping]) -> list[str]:
    """A row for each part of a claim that was run."""
    lines = []
    for row in parts if parts[0]["overall"] != NOT_RUN else ():
        verdict = MARKS.get(row["verdict"], row["verdict"])
        cells = (row["claim"], _named(row, parts), measured(row), f"{row['expected']} {row['unit']}".rstrip(), verdict)
        lines.append("| " + " | ".join(map(_cell, cells)) + " |")
    return lines


def _named(row: Mapping, parts: Sequence[Mapping]) -> str:
    """What a part measures, with its case where the words alone are those of another part too."""
    alike = sum(other["what"] == row["what"] for other in parts)
    return row["what"] if alike == 1 else f"`{row['case']}`: {row['what']}"


def measured(row: Mapping) -> str:
    """Value and unit, with the interval where there is a sampling error, both to two figures of its half-width."""
    value, lo, hi = (float(row[name]) for name in ("measured", "lo", "hi"))
    half = (hi - lo) / 2
    if not 0 < half < math.inf:
        text = f"{value:.4g}".replace("inf", "∞")
    else:
        whole = all(one == round(one) for one in (value, lo, hi))
        place = 0 if whole else max(0, 1 - math.floor(math.log10(half)))
        middle, low, high = (f"{round(one, place) + 0.0:.{place}f}" for one in (value, lo, hi))
        text = f"{middle} [{low}, {high}]"
    return f"{text} {row['unit']}".rstrip().replace("-", "\N{MINUS SIGN}")


def _cell(text: str) -> str:
    """Text that neither ends a cell nor is taken for markup."""
    text = text.replace("|", "\\|")
    return text.replace("<", "&lt;").replace("&lt;br>", "<br>")

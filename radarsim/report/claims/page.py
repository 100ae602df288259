"""docs/claims.md: all claims of the papers in one table each, made from stored results."""

from collections import Counter
from collections.abc import Mapping, Sequence

from radarsim.report.claims import CONFIRMED, NOT_RUN, PAPERS, REFUTED

HEAD = """# The papers' claims

Made from results by `make claims-page`, never by hand. A claim says what a paper says and where; measured is what came
out, with its 95 % interval in brackets where it has a sampling error; the config is the one that shows it
(`radarsim run CONFIG`, then `radarsim claims CONFIG`).

Confirmed: the whole interval lies in the range that the paper's words leave; refuted: wholly outside; else not
distinguishable. A claim of several parts is confirmed when all of them are, refuted when one is.
"""
MARKS = {CONFIRMED: "**confirmed**", REFUTED: "**refuted**"}


def page(rows: Sequence[Mapping]) -> str:
    """The page, from the rows of `claims.listed`."""
    text, keys = [HEAD], {name: key for key, name in PAPERS.items()}
    for paper in dict.fromkeys(row["paper"] for row in rows):
        own = [row for row in rows if row["paper"] == paper]
        text += [f"## {keys.get(paper, '')} {paper}".replace("  ", " "), "", f"{counted(own)}.", ""]
        text += ["| claim | statement | place | measured | verdict | config |", "|---|---|---|---|---|---|"]
        for claim in dict.fromkeys(row["claim"] for row in own):
            text.append(_line([row for row in own if row["claim"] == claim]))
        text.append("")
    return "\n".join([*text, f"In all: {counted(rows)}.", ""])


def counted(rows: Sequence[Mapping]) -> str:
    """How many claims came out how, in words."""
    overall = {row["claim"]: row["overall"] for row in rows}
    return ", ".join(f"{count} {verdict}" for verdict, count in Counter(overall.values()).items())


def _line(parts: Sequence[Mapping]) -> str:
    first = parts[0]
    said = [] if first["overall"] == NOT_RUN else [_part(row) for row in parts]
    verdict = MARKS.get(first["overall"], first["overall"])
    reading = f" *Read as: {first['reading']}.*" if first["reading"] else ""
    cells = (first["claim"], first["statement"] + reading, first["place"], "<br>".join(said), verdict)
    return "| " + " | ".join(map(_cell, cells)) + f" | `{first['config']}` |"


def _part(row: Mapping) -> str:
    """What one part measured, and of a claim in which parts differ its own verdict."""
    own = "" if row["verdict"] == row["overall"] else f" ({row['verdict']})"
    return f"{row['what']}: {measured(row)}{own}"


def measured(row: Mapping) -> str:
    """The value, with its interval where it has a sampling error, and unit."""
    value, lo, hi = (float(row[name]) for name in ("measured", "lo", "hi"))
    interval = "" if lo == hi else f" [{lo:.4g}, {hi:.4g}]"
    return f"{value:.4g}{interval} {row['unit']}".rstrip()


def _cell(text: str) -> str:
    """Text that neither ends a cell nor is taken for markup."""
    text = text.replace("|", "\\|")
    return text.replace("<", "&lt;").replace("&lt;br>", "<br>")

"""What the terminal shows of claims and readings: each with its class, what was measured and what was expected."""

import sys
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from radarsim.cli.console import console, field, say, show
from radarsim.language import plural, term, tr

if TYPE_CHECKING:
    from radarsim.app.readings import Done

ROOMY = 110  # columns of a terminal from which claims are shown with place and config
NOTHING_RUN = term(
    "nothing is run here: `make reproduce-figures` runs it all, docs/claims.md has the results at full size"
)


def print_claims(rows: Sequence[dict[str, Any]]) -> None:
    """Each claim with its class, and below it what was measured, or the command that would judge it.

    On a terminal a table; where it is piped, lines that can be searched. Of experiments that are not the paper's a line
    for each reason, with the claims that cannot be judged for it.
    """
    from radarsim.report.claims import NOT_JUDGED, NOT_RUN, page, reasons

    stated: list[dict[str, Any]] = []
    foreign: dict[tuple[str, str], list[str]] = {}
    for row in rows:
        if row["class"] == NOT_JUDGED and not row["what"]:
            foreign.setdefault((row["config"], row["why"]), []).append(row["claim"])
        else:
            stated.append(row)
    if stated:
        _print_stated(stated)
    for (stem, why), names in foreign.items():
        told = {"stem": stem, "names": in_a_row(names), "reason": reasons.said(why)}
        say(tr("{stem}: not judged: {names}: {reason}", **told))
    say(page.counted(stated) or tr("no claims are judged by this"))
    if stated and all(row["class"] == NOT_RUN for row in stated):
        say(tr(NOTHING_RUN))


def in_a_row(claims: Sequence[str]) -> str:
    """Names of claims, those with numbers in a row by the first and last: `P1.1–P1.34`."""
    runs: list[list[str]] = []
    for name in claims:
        paper, _, number = name.rpartition(".")
        follows = runs and number.isdecimal() and runs[-1][-1] == f"{paper}.{int(number) - 1}"
        runs[-1].append(name) if follows else runs.append([name])
    return ", ".join(f"{run[0]}–{run[-1]}" if len(run) > 2 else ", ".join(run) for run in runs)


def _print_stated(rows: Sequence[dict[str, Any]]) -> None:
    """Claims with what was measured."""
    from radarsim.report.claims import NOT_RUN, page

    if sys.stdout.isatty():
        cells = []
        for own in page.grouped(rows):
            first, done = own[0], own[0]["class"] != NOT_RUN
            beside = "" if page.extension(own) else f" ({tr(page.NOT_COUNTED)})"
            lines = [_measured(row) + (beside if page.extension([row]) else "") for row in own]
            measured = "\n".join(lines) if done else f"radarsim run {first['config']}"
            said = tr(first["statement"]) + (f"\n«{first['original']}»" if first["original"] else "")
            verdict = page.verdict_of(own).replace("*", "")
            cells.append((first["claim"], said, tr(first["place"]), measured, verdict, first["config"]))
        columns = ("claim", "statement", "place", "measured and expected", "class", "config")
        show("", columns, cells, spare=() if console().width >= ROOMY else ("place", "config"))
    else:
        for own in page.grouped(rows):
            _print_claim(own)


def _measured(row: Mapping[str, Any]) -> str:
    """What was measured for a part of a claim: its name, its value, what was expected."""
    from radarsim.report.claims import page

    expected = tr("; expected {words}", words=page.expected(row["expected"])) if row["expected"] else ""
    return f"{_named(row)}: {page.shown(row)}{expected}"


def _named(row: Mapping[str, Any]) -> str:
    """What a part of a claim measures, in which case."""
    return ": ".join(filter(None, (str(row["case"]), tr(str(row["what"])))))


def _print_claim(parts: Sequence[Mapping[str, Any]]) -> None:
    """A claim in lines: its class, statement and original sentence, and a line a part."""
    from radarsim.report.claims import NOT_JUDGED, NOT_RUN, page, reasons

    first = parts[0]
    verdict = page.verdict_of(parts).replace("*", "")
    place = f"{tr(first['paper'])}, {tr(first['place'])}"
    say(f"{first['claim']:<6} {verdict:<20} {tr(first['statement'])}  [{place}]")
    if first["original"]:
        say(f"       «{first['original']}»")
    if first["class"] == NOT_RUN:
        say(f"       radarsim run {first['config']}")
        return
    for row in parts:
        said = [_named(row)]
        if page.number(row["measured"]) is not None:
            said.append(page.measured(row) + tr("; expected {words}", words=page.expected(row["expected"])))
        if (exact := page.number(row["exact"])) is not None:
            said.append(tr("exactly {value}", value=page.plain(exact)))
        if (missed := page.number(row["miss"])) is not None and missed:
            said.append(tr("off by {miss:.3g} margins", miss=missed))
        if row["verdict"] == NOT_JUDGED:
            said.append(reasons.said(row["why"]))
        if page.extension([row]) and not page.extension(parts):
            said.append(tr(page.NOT_COUNTED))
        say(f"       {tr(row['verdict']):<20} {'; '.join(said)}")


def print_readings(done: "Done", detailed: bool) -> None:
    """A line a claim, of single claims a line a reading too, and what the joint search came to."""
    from radarsim.report.claims import reasons

    for read in done.read:
        for over in read.over:
            if detailed:
                for one in over.under:
                    outcome = (
                        tr(one.outcome.kind) if one.outcome else tr("not possible: {why}", why=reasons.said(one.why))
                    )
                    say(f"       {one.kind}  {outcome:<24} {one.name}")
            found = over.outcome
            words = tr(found.kind) if found else tr("not judged")  # on what it depends, the sentence says
            say(f"{over.claim.id:<6} {words:<28} {over.sentence()}")
        if read.counted is not None:
            say(f"{read.paper.readings.paper}: {read.counted.sentence()}")
    if done.files:
        drawn = plural("{count} figure drawn again", "{count} figures drawn again", len(done.files) - 1)
        field("table", tr("{file}; curves: {drawn}", file=str(done.folder / "readings.csv"), drawn=drawn))

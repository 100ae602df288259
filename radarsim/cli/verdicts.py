"""What the terminal shows of claims and readings: each with its class, what was measured and what was expected."""

import shlex
from collections.abc import Collection, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from radarsim.app import repeat
from radarsim.cli.console import field, say
from radarsim.language import listed, plural, term, tr

if TYPE_CHECKING:
    from radarsim.app.readings import Done
    from radarsim.app.result import Result

SHORT = 12  # words of a claim in a list
NOTHING_RUN = term(
    "nothing is run here: `make reproduce-figures` runs it all, docs/claims.md has the results at full size"
)


def print_verdicts(result: "Result") -> None:
    """The claims that a run can judge by their class over all readings, and which of them came out otherwise here."""
    from radarsim.report.claims import page, reasons

    verdicts, shipped = result.verdicts(), result.verdicts("as_shipped")
    for kind, names in verdicts.items():
        field("claims", f"{page.of_class(kind, len(names))}: {page.in_a_row(names)}")
        here = {own: [name for name in every if name in names] for own, every in shipped.items() if own != kind}
        if said := "; ".join(f"{tr(own)}: {page.in_a_row(few)}" for own, few in here.items() if few):
            field("", tr("as shipped {claims}", claims=said))
    for reason, names in result.unjudged().items():
        field("", tr("not judged: {names}: {reason}", names=", ".join(names), reason=reasons.said(reason)))
    if alone := result.as_shipped():
        told = {"names": page.in_a_row(alone), "paper": alone[0].partition(".")[0]}
        words = tr(
            "as shipped alone: {names}; `radarsim readings {paper}` judges under all that the paper allows", **told
        )
        field("", words)
    if verdicts and result.written is not None:
        told = {"command": repeat.command(result.experiment, (), result.written.folder.parent, verb="claims")}
        field("", tr("`{command}` says what each of them is", **told))


def print_claims(
    rows: Sequence[dict[str, Any]], detailed: Collection[str] = (), out: str = repeat.RESULTS, names: Sequence[str] = ()
) -> None:
    """A line a claim: its number, how far it stands, what it says; of those that are detailed what was measured too.
    The commands that it names are those for the directory `out`, and for the names that were asked for.

    Of experiments that are not the paper's a line for each reason, with the claims that cannot be judged for it.
    """
    from radarsim.report.claims import NOT_JUDGED, NOT_RUN, page, reasons

    stated: list[dict[str, Any]] = []
    foreign: dict[tuple[str, str], list[str]] = {}
    for row in rows:
        if row["class"] == NOT_JUDGED and not row["what"]:
            foreign.setdefault((row["config"], row["why"]), []).append(row["claim"])
        else:
            stated.append(row)
    for own in page.grouped(stated):
        _print_claim(own, own[0]["claim"] in detailed, repeat.into(out))
    for (stem, why), names in foreign.items():
        told = {"stem": stem, "names": page.in_a_row(names), "reason": reasons.said(why)}
        say(tr("{stem}: not judged: {names}: {reason}", **told))
    say(page.counted(stated) or tr("no claims are judged by this"))
    if stated and all(row["class"] == NOT_RUN for row in stated):
        say(tr(NOTHING_RUN))
    elif any(row["class"] != NOT_RUN and row["claim"] not in detailed for row in stated):
        if names:
            command = f"radarsim claims {shlex.join(names)} --parts{repeat.into(out)}"
            say(tr("`{command}` says what was measured", command=command))
        else:
            command = f"radarsim claims {stated[0]['claim']}{repeat.into(out)}"
            say(tr("`{command}` says what was measured; --parts of all of them", command=command))


def _named(row: Mapping[str, Any]) -> str:
    """What a part of a claim measures, in which case."""
    return ": ".join(filter(None, (str(row["case"]), tr(str(row["what"])))))


def _print_claim(parts: Sequence[Mapping[str, Any]], detailed: bool, into: str) -> None:
    """A claim in a line; detailed, its place, config, original sentence and a line a part."""
    from radarsim.report.claims import NOT_JUDGED, NOT_RUN, page, reasons

    first = parts[0]
    verdict = page.verdict_of(parts).replace("*", "")
    if not detailed:
        words = tr(first["statement"]).split()
        short = " ".join(words[:SHORT]) + (" …" if len(words) > SHORT else "")
        by = f" (radarsim run {first['config']}{into})" if first["class"] == NOT_RUN else ""
        say(f"{first['claim']:<6} {verdict}{by}: {short}")
        return
    place = f"{tr(first['paper'])}, {tr(first['place'])}"
    say(f"{first['claim']:<6} {verdict}: {tr(first['statement'])} [{place}; {first['config']}]")
    if first["original"]:
        say(f"       «{first['original']}»")
    if first["class"] == NOT_RUN:
        say(f"       radarsim run {first['config']}{into}")
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
        curves = sum(name.endswith(".svg") for name in done.files)
        drawn = plural("{count} figure drawn again", "{count} figures drawn again", curves)
        field("table", tr("{file}; curves: {drawn}", file=str(done.folder / "readings.csv"), drawn=drawn))
    if done.outdated:
        told = {"configs": listed(done.outdated), "command": f"radarsim report {' '.join(done.outdated)}"}
        field("note", tr("claims and reports of {configs} were written with other classes: `{command}`", **told))

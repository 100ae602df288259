"""Terminal output of tracks over recorded plots, and of claims."""

import shlex
import shutil
import sys
from collections.abc import Collection, Iterable, Mapping, Sequence
from textwrap import shorten
from typing import TYPE_CHECKING, Any, TextIO

from radarsim.app import configs
from radarsim.cli.console import PIPED_WIDTH, broken, field, say, show
from radarsim.language import listed, plural, term, tr
from radarsim.report.wording import interval, known, labelled, printable, significant_digits

if TYPE_CHECKING:
    from radarsim.app.readings import Readings
    from radarsim.app.result import Result
    from radarsim.recorded.advice import Advice
    from radarsim.recorded.figures import Judged
    from radarsim.recorded.fit import Fit, Fitted
    from radarsim.recorded.follow import Followed
    from radarsim.recorded.register import Registration


# ---- findings --------------------------------------------------------------------------------------------------------
def echo(rows: Iterable[Sequence[str]]) -> None:
    """Rows of CSV to the terminal; names with a comma or a quote are quoted as in a file."""
    import csv

    csv.writer(sys.stdout, lineterminator="\n").writerows(rows)


def report(followed: "Followed", judged: "Sequence[Judged]", advised: "Advice | None", stderr: bool = False) -> None:
    """Print the results; to stderr where the track itself goes to stdout. advised: where a likelihood is known."""
    from radarsim.recorded import page

    stream = sys.stderr if stderr else sys.stdout
    for line in page.rows(followed):
        write(stream, line)
    for title, rows in ((page.ERRORS, page.errors(followed)), (page.TESTS, page.tests(judged))):
        if rows:
            forms = [page.NUMBERS.get(name) for name in rows[0]]
            texts = [
                [known(cell, form) if form else cell for cell, form in zip(row.values(), forms, strict=True)]
                for row in rows
            ]
            show(tr(title), list(rows[0]), texts, list(page.NUMBERS), stream=stream)
    for line in (*page.findings(judged), *page.verdict(followed, judged, advised)):
        write(stream, line)


def write(stream: TextIO, line: str) -> None:
    """A line, to a terminal broken between words."""
    for part in broken(printable(line), stream):
        stream.write(part + "\n")


def report_fit(found: "Fit") -> None:
    """Print a fit, and the options that put it into the config."""
    from radarsim.recorded import fit, page

    tracks = plural("{count} track", "{count} tracks", found.tracks)
    told = tr("{rows} of {tracks}; filter {filter}", rows=page.counted(found.rows), tracks=tracks, filter=found.filter)
    lines = [labelled("plots", told)]
    if found.doubles:
        words = plural("{count} plot", "{count} plots", found.doubles)
        lines.append(
            labelled("doubles", tr("{plots} left out: the same scan has one nearer to the track", plots=words))
        )
    plain = {} if found.plain is None else {one.key: one for one in found.plain.keys}
    for one in found.keys:
        line = f"{one.key}: {_known(one)}"
        if one.key != fit.CORRELATION_TIME:
            line += tr(", stated {stated}", stated=significant_digits(one.stated))
        if one.key in plain:
            line += tr(", plain {value}", value=_known(plain[one.key]))
        if not one.identifiable:
            line += (
                tr("; the plots cannot distinguish it from zero")
                if one.lo == 0
                else tr("; the plots cannot distinguish it from larger values")
            )
        lines.append(line)
    if found.outliers is not None:
        lines.append(tr("outliers: {share} % of the plots", share=significant_digits(100 * found.outliers, "#.2g")))
    settings = " ".join(f"--set {key}={value:g}" for key, value in fit.settings(found).items())
    if found.beside is not None:
        lines.append(labelled("", tr("the intervals are not valid: {what}", what=page.what(*found.beside[:2]))))
    if found.plain is not None:
        words = tr("plain: of errors that are normal and independent")
        if found.plain.beside is not None:
            words = tr("{words}; the plots contradict that, so those intervals are too narrow", words=words)
        lines.append(labelled("", words))
    lines.append(
        labelled(
            "",
            tr(
                "with these values the plots are {times} times as likely as with the stated ones",
                times=page.times(found.gain),
            ),
        )
    )
    if settings:
        lines.append(labelled("", tr("to use the fitted values: {settings}", settings=settings)))
    for line in lines:
        write(sys.stdout, line)


def _known(one: "Fitted") -> str:
    """A value with its interval."""
    hi = tr("no upper bound") if one.hi == float("inf") else significant_digits(one.hi)
    return f"{significant_digits(one.value)} {interval(significant_digits(one.lo), hi)}"


def report_registration(found: "Registration", other: str) -> None:
    """Print a registration, and the options that correct the radar's plots."""
    from radarsim.recorded import register

    plots = plural("{count} plot", "{count} plots", found.plots)
    by = ", ".join(f"{kind} {count}" for kind, count in found.by.items())
    told = {"plots": plots, "matched": found.matched, "file": other, "by": by}
    lines = [
        labelled("plots", tr("{matched} of {plots} have a position of their aircraft in {file} (by {by})", **told))
    ]
    apart = tr("{distance} from it (median)", distance=register.distance(*found.apart))
    aircraft = tr("{count} aircraft", count=len(found.aircraft))
    bent = tr("positions in between err by less than {most:.2g} m (95 %)", most=found.bent_m)
    lines += [labelled("", f"{aircraft}; {apart}; {bent}")]
    lines += [labelled("", tr("left out: {what}", what=one)) for one in found.left]
    lines.append(tr("Biases of the plots with 95 % intervals, {file} taken as right", file=other))
    lines += register.lines(found)
    for line in lines:
        write(sys.stdout, line)


# ---- verdicts --------------------------------------------------------------------------------------------------------
SHORT = 12  # words of a claim in a list
MOST_CONFIGS = 6  # from which on it is said what runs them all
NOTHING_OF_ALL = term(
    "nothing is run here: `make reproduce-figures` runs all configs of the four papers; "
    "docs/claims.md, which `make docs` builds, has their results at full size"
)


def print_verdicts(result: "Result") -> None:
    """The claims of a run by their class over all readings, with those that differ here."""
    from radarsim.report.claims import page, rule

    verdicts, shipped = result.verdicts(), result.verdicts("as_shipped")
    for kind, names in verdicts.items():
        field("claims", f"{page.of_class(kind, len(names))}: {page.in_a_row(names)}")
        here = {own: [name for name in every if name in names] for own, every in shipped.items() if own != kind}
        if said := "; ".join(f"{tr(own)}: {page.in_a_row(few)}" for own, few in here.items() if few):
            field("", tr("as shipped {claims}", claims=said))
    for reason, names in result.unjudged().items():
        field("", tr("not judged: {names}: {reason}", names=", ".join(names), reason=rule.said(reason)))
    if alone := result.as_shipped():
        told = {"names": page.in_a_row(alone), "paper": alone[0].partition(".")[0]}
        words = tr(
            "only as shipped: {names}; `radarsim readings {paper}` judges under every reading that the paper allows",
            **told,
        )
        field("", words)
    if verdicts and result.written is not None:
        told = {"command": configs.command(result.experiment, (), result.written.folder.parent, verb="claims")}
        field("", tr("`{command}` describes each of them", **told))


def print_claims(
    rows: Sequence[dict[str, Any]],
    detailed: Collection[str] = (),
    out: str = configs.RESULTS,
    names: Sequence[str] = (),
) -> None:
    """A line for each claim: number, class, first words; for detailed ones all of it with measured values. The commands
    it shows are for the directory `out`, and for the requested names.

    For experiments other than the paper's a line for each reason, with the claims that cannot be judged.
    """
    from radarsim.report.claims import NOT_JUDGED, NOT_RUN, page, rule

    stated: list[dict[str, Any]] = []
    foreign: dict[tuple[str, str], list[str]] = {}
    for row in rows:
        if row["class"] == NOT_JUDGED and not row["what"]:
            foreign.setdefault((row["config"], row["why"]), []).append(row["claim"])
        else:
            stated.append(row)
    every = page.grouped(stated)
    width = max((len(_standing(own)) for own in every if own[0]["claim"] not in detailed), default=0)
    room = (shutil.get_terminal_size().columns if sys.stdout.isatty() else PIPED_WIDTH) - width - 9
    for own in every:
        if own[0]["claim"] in detailed:
            _print_claim(own)
        else:
            words = tr(own[0]["statement"]).split()
            begun = " ".join([*words[:SHORT], *["…"] * (len(words) > SHORT)])
            begun = shorten(begun, room, placeholder=" …", break_on_hyphens=False)
            say(f"{own[0]['claim']:<6} {_standing(own):<{width}}  {begun}")
    for (stem, why), foreigners in foreign.items():
        told = {"stem": stem, "names": page.in_a_row(foreigners), "reason": rule.said(why)}
        say(tr("{stem}: not judged: {names}: {reason}", **told))
    missing: dict[str, dict[str, None]] = {}
    for row in stated:
        if row["class"] == NOT_RUN:
            missing.setdefault(str(row["config"]), {})[row["claim"]] = None
    for stem, lacking in missing.items():
        command = f"radarsim run {shlex.quote(stem)}{configs.into(out)}"
        say(tr("`{command}` judges {names}", command=command, names=page.in_a_row(list(lacking))))
    bracketed = any(page.extension(own) and own[0]["claim"] not in detailed for own in every)
    say((page.counted(stated) or tr("this experiment judges no claims")) + bracketed * tr(" (in brackets)"))
    if len(missing) > MOST_CONFIGS and all(row["class"] == NOT_RUN for row in stated):
        say(tr(NOTHING_OF_ALL))
    elif any(row["class"] != NOT_RUN and row["claim"] not in detailed for row in stated):
        if names:
            command = f"radarsim claims {shlex.join(names)} --parts{configs.into(out)}"
            say(tr("`{command}` shows what was measured", command=command))
        else:
            command = f"radarsim claims {stated[0]['claim']}{configs.into(out)}"
            say(tr("`{command}` shows what was measured; --parts shows it for all of them", command=command))


def _named(row: Mapping[str, Any]) -> str:
    """A part of a claim and its case."""
    return ": ".join(filter(None, (str(row["case"]), tr(str(row["what"])))))


def _standing(parts: Sequence[Mapping[str, Any]]) -> str:
    """The class of a claim in a few words; in brackets if it is not counted."""
    from radarsim.report.claims import page, rule

    own = parts[0]["class"]
    kind = tr("depends") if own == rule.DEPENDS else tr(own)
    kind = tr("{own} as shipped", own=kind) if page.alone(parts[0]) else kind
    return f"({kind})" if page.extension(parts) else kind


def _print_claim(parts: Sequence[Mapping[str, Any]]) -> None:
    """A claim with its place, config, original sentence and a line for each part."""
    from radarsim.report.claims import NOT_JUDGED, NOT_RUN, page, rule

    first = parts[0]
    verdict, place = page.verdict_of(parts).replace("*", ""), f"{tr(first['paper'])}, {tr(first['place'])}"
    say(f"{first['claim']:<6} {verdict}: {tr(first['statement'])} [{place}; {first['config']}]")
    if first["original"]:
        say(f"       «{first['original']}»")
    for row in parts if first["class"] != NOT_RUN else ():
        said = [_named(row)]
        if page.number(row["measured"]) is not None:
            said.append(page.measured(row) + tr("; expected {words}", words=page.expected(row["expected"])))
        if (exact := page.number(row["exact"])) is not None:
            said.append(tr("exactly {value}", value=page.plain(exact) if exact == round(exact) else known(exact)))
        if (missed := page.number(row["miss"])) is not None and missed:
            said.append(tr("off by {miss:.3g} margins", miss=missed))
        if row["verdict"] == NOT_JUDGED:
            said.append(rule.said(row["why"]))
        if page.extension([row]) and not page.extension(parts):
            said.append(tr(page.NOT_COUNTED))
        say(f"       {tr(row['verdict']):<20} {'; '.join(said)}")


def print_readings(done: "Readings", detailed: bool) -> None:
    """A line for each claim, for single claims one for each reading too, and the joint search."""
    from radarsim.report.claims import rule

    for read in done.read:
        for over in read.over:
            if detailed:
                for one in over.under:
                    outcome = tr(one.outcome.kind) if one.outcome else tr("not possible: {why}", why=rule.said(one.why))
                    say(f"       {one.kind}  {outcome:<24} {one.name}")
            found = over.outcome
            words = tr(found.kind) if found else tr("not judged")  # on what it depends, the sentence says
            say(f"{over.claim.id:<6} {words:<28} {over.sentence()}")
        if read.counted is not None:
            say(f"{read.paper.readings.paper}: {read.counted.sentence()}")
    if done.files:
        curves = sum(name.endswith(".svg") for name in done.files)
        drawn = plural("{count} figure redrawn", "{count} figures redrawn", curves)
        field("table", tr("{file}; curves: {drawn}", file=str(done.folder / "readings.csv"), drawn=drawn))
    if done.outdated:
        command = f"radarsim report {shlex.join(done.outdated)}{configs.into(done.folder.parent)}"
        told = {"configs": listed(done.outdated), "command": command}
        words = tr("claims.csv and report.html of {configs} hold older verdicts: `{command}` updates them", **told)
        field("note", words)

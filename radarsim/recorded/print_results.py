"""Terminal output of `radarsim track`, `fit` and `register`."""

import sys
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, TextIO

from radarsim.cli.console import broken, show
from radarsim.language import plural, tr
from radarsim.report.wording import interval, known, labelled, printable, significant_digits

if TYPE_CHECKING:
    from radarsim.recorded.fit import Advice, Fit, Fitted
    from radarsim.recorded.follow import Followed
    from radarsim.recorded.page import Judged
    from radarsim.recorded.register import Registration


def print_rows(rows: Iterable[Sequence[str]]) -> None:
    """Print rows of CSV; names with a comma or a quote are quoted as in a file."""
    import csv

    csv.writer(sys.stdout, lineterminator="\n").writerows(rows)


def print_track(
    followed: "Followed", judged: "Sequence[Judged]", advised: "Advice | None", stderr: bool = False
) -> None:
    """Print what filters found over a recording; to stderr where the track itself goes to stdout.

    advised: None where the study knows no likelihood."""
    from radarsim.recorded import page

    stream = sys.stderr if stderr else sys.stdout
    for line in page.rows(followed):
        print_line(stream, line)
    for title, rows in ((page.ERRORS, page.errors(followed)), (page.TESTS, page.tests(judged))):
        if rows:
            forms = [page.NUMBERS.get(name) for name in rows[0]]
            texts = [
                [known(cell, form) if form else cell for cell, form in zip(row.values(), forms, strict=True)]
                for row in rows
            ]
            show(tr(title), list(rows[0]), texts, list(page.NUMBERS), stream=stream)
    for line in (*page.findings(judged), *page.verdict(followed, judged, advised)):
        print_line(stream, line)


def print_line(stream: TextIO, line: str) -> None:
    """Print a line, to a terminal broken between words."""
    for part in broken(printable(line), stream):
        stream.write(part + "\n")


def print_fit(found: "Fit") -> None:
    """Print a fit, and the options that put it into the config."""
    from radarsim.recorded import fit, page

    tracks = plural("{count} track", "{count} tracks", found.tracks)
    told = tr("{rows} of {tracks}; filter {filter}", rows=page.counted(found.rows), tracks=tracks, filter=found.filter)
    lines = [labelled("plots", told)]
    if found.doubles:
        words = plural("{count} plot", "{count} plots", found.doubles)
        words = tr("{plots} left out: the same scan has one nearer to the track", plots=words)
        lines.append(labelled("doubles", words))
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
    so = page.times(found.gain)
    words = tr("with these values the plots are {times} times as likely as with the stated ones", times=so)
    lines.append(labelled("", words))
    if settings:
        lines.append(labelled("", tr("to use the fitted values: {settings}", settings=settings)))
    for line in lines:
        print_line(sys.stdout, line)


def _known(one: "Fitted") -> str:
    """A value with its interval."""
    hi = tr("no upper bound") if one.hi == float("inf") else significant_digits(one.hi)
    return f"{significant_digits(one.value)} {interval(significant_digits(one.lo), hi)}"


def print_registration(found: "Registration", other: str) -> None:
    """Print a registration, and the options that correct the radar's plots."""
    from radarsim.recorded import identity, register

    plots = plural("{count} plot", "{count} plots", found.plots)
    by = ", ".join(f"{kind} {count}" for kind, count in found.by.items())
    told = {"plots": plots, "matched": found.matched, "file": other, "by": by}
    lines = [
        labelled("plots", tr("{matched} of {plots} have a position of their aircraft in {file} (by {by})", **told))
    ]
    apart = tr("{distance} from it (median)", distance=identity.distance(*found.apart))
    aircraft = tr("{count} aircraft", count=len(found.aircraft))
    bent = tr("positions in between err by less than {most:.2g} m (95 %)", most=found.bent_m)
    lines += [labelled("", f"{aircraft}; {apart}; {bent}")]
    lines += [labelled("", tr("left out: {what}", what=one)) for one in found.left]
    lines.append(tr("Biases of the plots with 95 % intervals, {file} taken as right", file=other))
    lines += register.lines(found)
    for line in lines:
        print_line(sys.stdout, line)

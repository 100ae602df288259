"""What the terminal reports of a track over recorded plots: rows, gaps, and how well the stated accuracies fit."""

import sys
from collections.abc import Iterable, Sequence
from typing import TextIO

from radarsim.language import plural, tr
from radarsim.recorded import accuracy, fit, words
from radarsim.recorded.advice import Advice
from radarsim.recorded.fit import Fit
from radarsim.recorded.follow import Followed
from radarsim.report.text import interval, labelled, printable, significant_digits


def echo(rows: Iterable[Sequence[str]]) -> None:
    """Rows of CSV to the terminal; names with a comma or a quote are quoted as in a file."""
    import csv

    csv.writer(sys.stdout, lineterminator="\n").writerows(rows)


def report(followed: Followed, judged: Sequence[accuracy.Judged], advised: Advice | None, stderr: bool = False) -> None:
    """Print what was found; to stderr where the track itself goes to stdout. advised: where a likelihood is known."""
    stream = sys.stderr if stderr else sys.stdout
    for line in words.sentences(followed, judged, advised):
        write(stream, line)


def write(stream: TextIO, line: str) -> None:
    """A line, to a terminal broken between words."""
    from radarsim.cli.console import broken

    for part in broken(printable(line), stream):
        stream.write(part + "\n")


def report_fit(found: Fit) -> None:
    """Print what was fitted, and the options that put it into the config."""
    tracks = plural("{count} track", "{count} tracks", found.tracks)
    told = tr("{rows} of {tracks}; filter {filter}", rows=words.counted(found.rows), tracks=tracks, filter=found.filter)
    lines = [labelled("plots", told)]
    for one in found.keys:
        value, stated = significant_digits(one.value), significant_digits(one.stated)
        lo, hi = (
            significant_digits(one.lo),
            tr("no upper end") if one.hi == float("inf") else significant_digits(one.hi),
        )
        least = one.lo == 0
        doubt = (
            tr("; the plots do not tell it from zero") if least else tr("; the plots do not tell it from larger ones")
        )
        line = tr(
            "{key}: {value} {interval}, stated {stated}",
            key=one.key,
            value=value,
            interval=interval(lo, hi),
            stated=stated,
        )
        lines.append(line + ("" if one.identifiable else doubt))
    if found.outliers is not None:
        lines.append(tr("outliers: {share} % of the plots", share=significant_digits(100 * found.outliers, "#.2g")))
    settings = " ".join(f"--set {key}={value:g}" for key, value in fit.settings(found).items())
    if found.beside is not None:
        lines.append(labelled("", tr("the intervals do not hold: {what}", what=words.what(*found.beside))))
    lines.append(
        labelled(
            "",
            tr(
                "with these values the plots are {times} times as likely as with those stated",
                times=words.times(found.gain),
            ),
        )
    )
    if settings:
        lines.append(labelled("", tr("to use what the plots tell: {settings}", settings=settings)))
    for line in lines:
        write(sys.stdout, line)

"""What the terminal reports of a track over recorded plots: rows, gaps, and how well the stated accuracies fit."""

import sys
from collections.abc import Iterable, Sequence

from radarsim.recorded import accuracy, fit, words
from radarsim.recorded.advice import Advice
from radarsim.recorded.fit import Fit
from radarsim.recorded.follow import Followed
from radarsim.report.text import plural, printable, significant_digits


def echo(rows: Iterable[Sequence[str]]) -> None:
    """Rows of CSV to the terminal; names with a comma or a quote are quoted as in a file."""
    import csv

    csv.writer(sys.stdout, lineterminator="\n").writerows(rows)


def report(followed: Followed, judged: Sequence[accuracy.Judged], advised: Advice | None, stderr: bool = False) -> None:
    """Print what was found; to stderr where the track itself goes to stdout. advised: where a likelihood is known."""
    stream = sys.stderr if stderr else sys.stdout
    for line in words.sentences(followed, judged, advised):
        stream.write(printable(line) + "\n")


def report_fit(found: Fit) -> None:
    """Print what was fitted, and the options that put it into the config."""
    lines = [f"plots    {plural(found.rows, 'row')} of {plural(found.tracks, 'track')}; filter {found.filter}"]
    for one in found.keys:
        value, stated = significant_digits(one.value), significant_digits(one.stated)
        lo, hi = significant_digits(one.lo), "no upper end" if one.hi == float("inf") else significant_digits(one.hi)
        doubt = (
            "" if one.identifiable else "; the plots do not tell it from " + ("zero" if one.lo == 0 else "larger ones")
        )
        lines.append(f"{one.key}: {value} [{lo}, {hi}], stated {stated}{doubt}")
    if found.outliers is not None:
        lines.append(f"outliers: {significant_digits(100 * found.outliers, '#.2g')} % of the plots")
    settings = " ".join(f"--set {key}={value:g}" for key, value in fit.settings(found).items())
    lines.append(f"         the stated values are less likely by a factor of exp({found.gain:.1f})")
    if settings:
        lines.append(f"         to use what the plots tell: {settings}")
    for line in lines:
        sys.stdout.write(printable(line) + "\n")

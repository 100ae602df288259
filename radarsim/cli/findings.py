"""What the terminal reports of a track over recorded plots: rows, gaps, and how well the stated accuracies fit."""

import sys
from collections.abc import Iterable, Sequence

from radarsim.report.text import plural, printable, significant_digits
from radarsim.track import accuracy
from radarsim.track.follow import Followed


def echo(rows: Iterable[Sequence[str]]) -> None:
    """Rows of CSV to the terminal; names with a comma or a quote are quoted as in a file."""
    import csv

    csv.writer(sys.stdout, lineterminator="\n").writerows(rows)


def report(followed: Followed, judged: Sequence[accuracy.Judged], stderr: bool = False) -> None:
    """Print what was found; to stderr where the track itself goes to stdout."""
    stream = sys.stderr if stderr else sys.stdout
    for line in [*_rows(followed), *_errors(followed), *(_line(one) for one in judged if one.tests), *_advice(judged)]:
        stream.write(printable(line) + "\n")


def _rows(followed: Followed) -> list[str]:
    span = followed.last_s - followed.first_s
    lines = [f"plots    {plural(followed.rows, 'row')} over {span:g} s, from {followed.first_s:g} s"]
    if followed.tracks:
        longest_rows = max(one.rows for one in followed.tracks.values())
        lines.append(f"tracks   {len(followed.tracks)}, the longest of {plural(longest_rows, 'row')}")
    if followed.passed_over:
        lines.append(f"passed   {plural(followed.passed_over, 'row')} of no track")
    missing = ", ".join(f"{count} of {name}" for name, count in followed.missing.items() if count)
    if missing:
        lines.append(f"missing  {missing}")
    if followed.silent:
        lines.append(f"no rows  {', '.join(followed.silent)}: never an estimate from these plots")
    if followed.gaps:
        longest = f"the longest {followed.longest_gap_s:g} s, after {followed.longest_gap_at_s:g} s"
        lines.append(
            f"gaps     {followed.gaps} of over three times the usual interval, {followed.median_s:g} s; {longest}"
        )
    return lines


def _errors(followed: Followed) -> list[str]:
    """What the filters missed the truth by, where the file has it."""
    return [
        f"{one.filter}, {one.component}: error against the truth {significant_digits(one.rms)} {one.unit} RMS, "
        f"{significant_digits(one.ratio, '#.3g')} of what the filter believes ({one.count} estimates)"
        for one in followed.errors.values()
        if one.count
    ]


def _line(one: accuracy.Judged) -> str:
    finding = {
        accuracy.FITS: "the stated σ fits",
        accuracy.SMALL: "the stated σ is too small, or the target manoeuvres harder than the filter allows",
        accuracy.LARGE: "the stated σ is too large, or the filter allows for harder manoeuvres than there are",
        accuracy.UNKNOWN: "too few plots to decide",
    }[one.verdict]
    bounds = f"NIS {one.nis:.3g} of {plural(one.tests, 'plot')}, 95 % of right filters [{one.lo:.3g}, {one.hi:.3g}]"
    better = ", ".join(f"{key} {value:.4g}" for key, value in one.better.items())
    return f"{one.filter}, {one.name}: {bounds}: {finding}" + (f"; {better} would" if better else "")


def _advice(judged: Sequence[accuracy.Judged]) -> list[str]:
    """What to write into the config: of the filter whose tests are most nearly right."""
    wrong = [one for one in judged if one.better]
    if not wrong or len({one.filter for one in wrong}) < 2:
        return []
    best = min((one for one in wrong), key=lambda one: abs(one.nis - 1))
    own = {key: value for one in wrong if one.filter == best.filter for key, value in one.better.items()}
    settings = " ".join(f"--set {key}={value:.4g}" for key, value in own.items())
    return [f"         nearest is {best.filter}; with its better values: {settings}"]

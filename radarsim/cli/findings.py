"""What the terminal reports of a track over recorded plots: rows, gaps, and how well the stated accuracies fit."""

import sys
from collections.abc import Iterable, Sequence

from radarsim.recorded import accuracy, advice, fit
from radarsim.recorded.advice import Advice, Finding
from radarsim.recorded.fit import Fit
from radarsim.recorded.follow import Followed
from radarsim.report.text import plural, printable, significant_digits

CLEAR = 3.0  # of the logarithm of a likelihood, twenty times: from there on one filter is clearly the best


def echo(rows: Iterable[Sequence[str]]) -> None:
    """Rows of CSV to the terminal; names with a comma or a quote are quoted as in a file."""
    import csv

    csv.writer(sys.stdout, lineterminator="\n").writerows(rows)


def report(followed: Followed, judged: Sequence[accuracy.Judged], advised: Advice | None, stderr: bool = False) -> None:
    """Print what was found; to stderr where the track itself goes to stdout. advised: where a likelihood is known."""
    stream = sys.stderr if stderr else sys.stdout
    lines = [_line(one, advised is None) for one in judged if one.tests]
    advice = _advice(judged) if advised is None else _likely(advised)
    for line in [*_rows(followed), *_errors(followed), *lines, *advice]:
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


def _line(one: accuracy.Judged, cured: bool) -> str:
    """One test; cured: with the σ under which it would be passed, where it is not."""
    finding = {
        accuracy.FITS: "the stated σ fits",
        accuracy.SMALL: "the stated σ is too small, or the target manoeuvres harder than the filter allows",
        accuracy.LARGE: "the stated σ is too large, or the filter allows for harder manoeuvres than there are",
        accuracy.UNKNOWN: "too few plots to decide",
    }[one.verdict]
    bounds = f"NIS {one.nis:.3g} of {plural(one.tests, 'plot')}, 95 % of right filters [{one.lo:.3g}, {one.hi:.3g}]"
    better = ", ".join(f"{key} {value:.4g}" for key, value in one.better.items())
    return f"{one.filter}, {one.name}: {bounds}: {finding}" + (f"; {better} would" if better and cured else "")


def _advice(judged: Sequence[accuracy.Judged]) -> list[str]:
    """What to write into the config: of the filter whose tests are most nearly right."""
    verdicts: dict[str, set[str]] = {}
    for one in judged:
        verdicts.setdefault(one.filter, set()).add(one.verdict)
    if fitting := [name for name, found in verdicts.items() if found == {accuracy.FITS}]:
        return [f"         {', '.join(fitting)}: all tests fit"] if len(fitting) < len(verdicts) else []
    wrong = [one for one in judged if one.better]
    if not wrong or len({one.filter for one in wrong}) < 2:
        return []
    best = min((one for one in wrong), key=lambda one: abs(one.nis - 1))
    own = {key: value for one in wrong if one.filter == best.filter for key, value in one.better.items()}
    settings = " ".join(f"--set {key}={value:.4g}" for key, value in own.items())
    return [f"         nearest is {best.filter}; with its better values: {settings}"]


def _likely(advised: Advice) -> list[str]:
    """Which filter foretells the plots best, and what is wrong with its numbers."""
    compared, lines = advised.compared, []
    if len(compared.behind) > 1:
        behind = sorted((name, gap) for name, gap in compared.behind.items() if name != compared.best)
        others = ", ".join(f"exp({-gap:.1f}) times under {name}" for name, gap in behind)
        clear = "" if min(gap for _, gap in behind) > CLEAR else " (not clearly)"
        lines.append(f"best     {compared.best}{clear}; elsewhere the plots are less likely: {others}")
    if not advised.findings:
        lines.append(f"advice   nothing is wrong with the stated numbers, as far as {plural(advised.rows, 'row')} tell")
    for one in advised.findings:
        lines.append(f"advice   {_explained(one)}; the plots are then more likely by exp({one.gain:.1f})")
    return lines


def _explained(one: Finding) -> str:
    """What is wrong, in words."""
    if one.what == advice.OUTLIERS:
        return f"outliers: {significant_digits(100 * one.value, '#.2g')} % of the plots err by ten times their σ"
    if one.what == advice.BIAS:
        return f"the measured velocities are off by {significant_digits(one.value, '#.3g')} of their σ, all alike"
    return f"--set {one.what}={one.value:.4g}"


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

"""The report of tracks over recorded plots: one self-contained page, and its figures as files.

Its sentences: rows, gaps, errors, how well the stated accuracies fit, advice.
"""

import math
import os
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from radarsim.config.experiment import Experiment
from radarsim.language import listed, plural, power_of_ten, term, tr
from radarsim.recorded import figures as accuracy
from radarsim.recorded import fit
from radarsim.recorded.advice import Advice, Asked, Finding
from radarsim.recorded.follow import Followed, drawn, put
from radarsim.report.wording import labelled, number, significant_digits, unit
from radarsim.studies.interface import BIAS, CORRELATION, OUTLIERS

# ---- words -----------------------------------------------------------------------------------------------------------
CLEAR = 3.0  # of the log-likelihood, twenty times: from there on one filter is clearly the best


def verdict(followed: Followed, judged: Sequence[accuracy.Judged], advised: Advice | None) -> list[str]:
    """The best filter and the changes advised, by the likelihood; where that is not known, the consistent filters."""
    return consistent(judged) if advised is None else likely(followed, advised)


def rows(followed: Followed) -> list[str]:
    """Numbers of rows and tracks, time covered, missing values, and the gaps."""
    span = followed.last_s - followed.first_s
    told = {"rows": counted(followed.rows), "span": span, "first": followed.first_s}
    lines = [labelled("plots", tr("{rows} over {span:g} s, from {first:g} s", **told))]
    if followed.tracks:
        longest = counted(max(one.rows for one in followed.tracks.values()))
        lines.append(labelled("tracks", tr("{count}, the longest of {rows}", count=len(followed.tracks), rows=longest)))
    if followed.passed_over:
        lines.append(labelled("passed", tr("{rows} outside any track", rows=counted(followed.passed_over))))
    if followed.again:
        words = plural("{count} track number", "{count} track numbers", followed.again)
        lines.append(labelled("again", tr("{numbers} used again after a gap: each begins a new track", numbers=words)))
    if followed.doubles:
        words = plural("{count} plot", "{count} plots", followed.doubles)
        lines.append(
            labelled("doubles", tr("{plots} left out: the same scan has one nearer to the track", plots=words))
        )
    missing = [tr("{count} of {name}", count=count, name=name) for name, count in followed.missing.items() if count]
    if missing:
        lines.append(labelled("missing", ", ".join(missing)))
    for name, columns in followed.without_plots.items():
        told = {"name": name, "columns": listed(columns)}
        lines.append(
            labelled("missing", tr("{name} used no plot, because it needs {columns}: predictions only", **told))
        )
    if followed.silent:
        names = ", ".join(followed.silent)
        lines.append(labelled("no rows", tr("{names}: no estimate from these plots", names=names)))
    if followed.untested:
        names = ", ".join(followed.untested)
        lines.append(labelled("untested", tr("{names}: no innovation with a covariance, so no test", names=names)))
    if followed.gaps:
        words = tr(
            "{count} longer than three times the usual interval of {usual:g} s; the longest {longest:g} s, "
            "after {at:g} s",
            count=followed.gaps,
            usual=followed.median_s,
            longest=followed.longest_gap_s,
            at=followed.longest_gap_at_s,
        )
        lines.append(labelled("gaps", words))
    return lines


def counted(rows: int) -> str:
    """1 row, 2 rows."""
    return plural("{count} row", "{count} rows", rows)


def errors(followed: Followed) -> list[dict[str, Any]]:
    """The filters' errors, where the file has the truth: a row each, by column."""
    return [
        {
            "filter": one.filter,
            "component": one.component,
            "RMS error": one.rms,
            "unit": tr(unit(one.unit)),
            "of own σ": one.ratio,
            "estimates": one.count,
        }
        for one in followed.errors.values()
        if one.count
    ]


ERRORS, TESTS = (term("Errors against the truth"), term("Innovations (NIS of a consistent filter: 1)"))
FINDINGS = {
    accuracy.SMALL: term(
        "the plots are less accurate than stated, or the target manoeuvres harder than the filter allows for"
    ),
    accuracy.LARGE: term(
        "the plots are more accurate than stated, or the filter allows for harder manoeuvres than occur"
    ),
    accuracy.LOST: term("the velocity is unfolded by a wrong number of spans; other filters fit the same plots"),
    accuracy.DOUBT: term("a wrong fold, plots less accurate than stated, or harder manoeuvres than allowed for"),
}


def tests(judged: Sequence[accuracy.Judged]) -> list[dict[str, Any]]:
    """The tests of the innovations: a row each, by column."""
    return [
        {
            "filter": one.filter,
            "number": one.name,
            "plots": one.tests,
            "NIS": one.nis,
            "95 % from": one.lo,
            "95 % to": one.hi,
            "stated σ": tr(one.verdict),
        }
        for one in judged
        if one.tests
    ]


NUMBERS = {  # columns of these, and how they are printed
    **{"RMS error": "#.4g", "of own σ": "#.3g", "estimates": ".0f"},
    **{"plots": ".0f", "NIS": ".3g", "95 % from": ".3g", "95 % to": ".3g"},
}


def findings(judged: Sequence[accuracy.Judged]) -> list[str]:
    """The meaning of the verdicts that occur."""
    there = {one.verdict for one in judged if one.tests}
    return [f"{tr(verdict)}: {tr(words)}" for verdict, words in FINDINGS.items() if verdict in there]


def consistent(judged: Sequence[accuracy.Judged]) -> list[str]:
    """The filters that are consistent in all their tests, unless all are."""
    verdicts: dict[str, set[str]] = {}
    for one in judged:
        verdicts.setdefault(one.filter, set()).add(one.verdict)
    fitting = [name for name, found in verdicts.items() if found == {accuracy.FITS}]
    words = tr("{names}: consistent in all tests", names=", ".join(fitting))
    return [labelled("", words)] if 0 < len(fitting) < len(verdicts) else []


def likely(followed: Followed, advised: Advice) -> list[str]:
    """The filter that predicts the plots best, and errors in the numbers of the one that takes most columns."""
    compared, lines = advised.compared, []
    if len(compared.behind) > 1 and advised.folding is None:
        behind = sorted((name, gap) for name, gap in compared.behind.items() if name != compared.best)
        others = ", ".join(tr("{times} times under {name}", times=times(gap), name=name) for name, gap in behind)
        best = compared.best
        if min(gap for _, gap in behind) <= CLEAR:
            best = tr("{name} (not clearly)", name=best)
        lines.append(
            labelled(
                "best", tr("{best}; the plots are less likely under the others: {others}", best=best, others=others)
            )
        )
    if advised.folding is not None:
        lines.append(labelled("advice", fit.said(advised.folding, followed.case)))
    elif not advised.findings:
        words = plural(
            "the stated values of {filter} agree with {count} row",
            "the stated values of {filter} agree with {count} rows",
            advised.asked.rows,
            filter=compared.fullest,
        )
        lines.append(labelled("advice", words))
    found = [explained(one, compared.fullest) for one in advised.findings]
    return [*lines, *(labelled("advice", one) for one in found), *_partly(followed, advised.asked)]


def _partly(followed: Followed, asked: Asked) -> list[str]:
    """The rows behind best filter and advice, where not all."""
    if asked.rows >= followed.rows:
        return []
    words = tr(
        "from {rows} of {all}, in {stretches} stretches spread over all tracks and the whole time",
        rows=counted(asked.rows),
        all=followed.rows,
        stretches=asked.stretches,
    )
    return [labelled("", words)]


def times(gain: float) -> str:
    """A likelihood ratio from the difference of the logarithms: 12, 10¹⁶."""
    power = round(gain / math.log(10))
    return (
        significant_digits(math.exp(gain), "#.2g" if gain < math.log(99) else ".0f")
        if power < 4
        else power_of_ten(power)
    )


def explained(one: Finding, filter_name: str) -> str:
    """An error in the numbers, in words, and its weight."""
    told = {"what": what(one.what, one.value), "times": times(one.gain)}
    if not one.from_zero:
        told["key"] = one.what
        words = tr("{key}: the plots cannot distinguish it from zero; that is no reason to lower it", **told)
    else:
        words = tr("{what}; the plots are then {times} times as likely", **told)
    turn = one.turning
    if turn is None:
        return words
    cost = tr(
        "in a turn of {load:g} g without missed plots the largest error of {filter} in {component} would be {changed}, "
        "not {stated} {unit}",
        load=turn.acceleration_g,
        filter=filter_name,
        component=turn.component,
        changed=number(turn.changed, 3),
        stated=number(turn.stated, 3),
        unit=tr(unit(turn.unit)),
    )
    if not one.from_zero:
        cost = tr("at {value} {cost}", value=number(one.value, 2), cost=cost)
    return f"{words}; {cost}"


def what(name: str, value: float) -> str:
    """An error in words: a key, or one of EXPLANATIONS, and its value."""
    if name == OUTLIERS:
        share = significant_digits(100 * value, "#.2g")
        return tr("outliers: {share} % of the plots have errors of ten times their σ", share=share)
    if name == BIAS:
        size = significant_digits(value, "#.3g")
        return tr("the measured velocities have a common bias of {size} of their σ", size=size)
    if name == CORRELATION:
        size = significant_digits(value, "#.2g")
        return tr("errors persist from plot to plot: the correlation of neighbours is {size}", size=size)
    return f"--set {name}={value:.3g}"


# ---- page ------------------------------------------------------------------------------------------------------------
NAME = "report.html"


@np.errstate(all="ignore")  # of a filter that diverged
def write(
    followed: Followed,
    experiment: Experiment,
    source: str | os.PathLike,
    judged: Sequence[accuracy.Judged],
    advised: Advice | None,
    folder: str | os.PathLike,
    sources: Iterable[str | os.PathLike] = (),
) -> list[str]:
    """Write the page and `figures/` into a folder; the names of the figures. Errors as of `follow.put`."""
    from radarsim.report import html
    from radarsim.report.figures import save

    made = drawn(followed)
    page = html.followed(
        experiment.stem,
        os.path.basename(os.fspath(source)),
        _said(verdict(followed, judged, advised)) or ["Too few plots to judge the filters by."],
        _said(rows(followed)),
        list(made.values()),
        {tr(ERRORS): errors(followed), tr(TESTS): tests(judged), "Tracks": _tracks(followed)},
        html.yaml_of(experiment.resolved),
        f"radarsim track {experiment.path or experiment.stem} {os.fspath(source)}",
    )
    contents = {NAME: page.encode()}
    for name, one in made.items():
        contents |= {f"figures/{name}.{kind}": data for kind, data in save(one).items()}
    put(Path(folder), contents, sources)
    return list(made)


def _said(lines: Sequence[str]) -> list[str]:
    """Lines of the terminal as sentences: the word before each with a colon."""
    parted = (line.split(maxsplit=1) for line in lines)
    return [f"{head.capitalize()}: {rest}." for head, rest in parted]


def _tracks(followed: Followed) -> list[dict[str, object]]:
    return [
        {"track": name, "rows": one.rows, "from, s": one.first_s, "to, s": one.last_s, "gaps": one.gaps}
        for name, one in followed.tracks.items()
    ]

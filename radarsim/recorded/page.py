"""The report of tracks over recorded plots: one self-contained page, and its figures as files."""

import os
from collections.abc import Iterable, Sequence
from pathlib import Path

from radarsim.config.experiment import Experiment
from radarsim.recorded import accuracy, words
from radarsim.recorded.advice import Advice
from radarsim.recorded.follow import Followed, drawn, put

NAME = "report.html"


def write(
    followed: Followed,
    experiment: Experiment,
    source: str | os.PathLike,
    judged: Sequence[accuracy.Judged],
    advised: Advice | None,
    folder: str | os.PathLike,
    sources: Iterable[str | os.PathLike] = (),
) -> list[str]:
    """Write the page and `figures/` into a folder; the names of the figures. Errors of `follow.put`."""
    from radarsim.report import figures, html

    made = drawn(followed)
    page = html.followed(
        experiment.stem,
        os.path.basename(os.fspath(source)),
        _said(words.verdict(followed, judged, advised)) or ["Too few plots to judge the filters by."],
        _said(words.rows(followed)),
        list(made.values()),
        {"Errors against the truth": _errors(followed), "Innovations": _tests(judged), "Tracks": _tracks(followed)},
        html.yaml_of(experiment.resolved),
        f"radarsim track {experiment.path or experiment.stem} {os.fspath(source)}",
    )
    contents = {NAME: page.encode()}
    for name, one in made.items():
        contents |= {f"figures/{name}.{kind}": data for kind, data in figures.save(one).items()}
    put(Path(folder), contents, sources)
    return list(made)


def _said(lines: Sequence[str]) -> list[str]:
    """Lines of the terminal as sentences: the word that stands before each with a colon."""
    parted = (line.split(maxsplit=1) for line in lines)
    return [f"{head.capitalize()}: {rest}." for head, rest in parted]


def _errors(followed: Followed) -> list[dict[str, object]]:
    return [
        {
            "filter": one.filter,
            "component": one.component,
            "unit": one.unit,
            "estimates": one.count,
            "RMS error": one.rms,
            "in believed σ": one.ratio,
        }
        for one in followed.errors.values()
        if one.count
    ]


def _tests(judged: Sequence[accuracy.Judged]) -> list[dict[str, object]]:
    return [
        {
            "filter": one.filter,
            "number": one.name,
            "plots": one.tests,
            "mean NIS": one.nis,
            "of right filters from": one.lo,
            "to": one.hi,
            "stated σ": one.verdict,
        }
        for one in judged
        if one.tests
    ]


def _tracks(followed: Followed) -> list[dict[str, object]]:
    return [
        {"track": name, "rows": one.rows, "from, s": one.first_s, "to, s": one.last_s, "gaps": one.gaps}
        for name, one in followed.tracks.items()
    ]

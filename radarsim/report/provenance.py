"""run.json: what was run, with what, and the outcome. Times stand here and in the report, never in a CSV."""

import hashlib
import json
import math
import os
import platform
from collections.abc import Callable, Mapping, Sequence
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from radarsim.config.experiment import Experiment
from radarsim.engine.results import CaseResult
from radarsim.language import numeral, plural, tr
from radarsim.report import files, notes, rare, seen
from radarsim.report.statistics import FEW

if TYPE_CHECKING:
    import pandas as pd

MOST_SEEDS, MOST_NAMES = 5, 3  # named in a line
PACKAGES = ("radarsim", "numpy", "numba", "llvmlite", "scipy", "pandas", "matplotlib", "pydantic", "pyyaml")


def record(
    experiment: Experiment,
    results: Sequence[CaseResult],
    run: Mapping[str, Any],
    contents: Mapping[str, bytes],
    answer: Sequence[str],
    machine: Mapping[str, object],
) -> dict[str, Any]:
    """All of run.json but the report's own hash.

    run gives the facts of the run (stop reason, threads, times, warnings, identities …), kept as they are; contents
    are the outputs, by path; machine describes the one they were made on.
    Realisations asked and done are sums over the cases, which may differ in both.
    """
    facts = dict(run)
    stop = facts.pop("stop", "done")
    done = {result.name: result.count for result in results}
    return {
        "config": experiment.stem,
        "config_path": path_of(experiment),
        "study": experiment.study,
        "answer": list(answer),
        "realisations_asked": sum(case.realisations for case in experiment.cases),
        "realisations_done": sum(done.get(case.name, 0) for case in experiment.cases),
        "cases": {
            case.name: {"asked": case.realisations, "done": done.get(case.name, 0), "seed": case.seed}
            for case in experiment.cases
        },
        "stop": stop,
        "seed": experiment.seed,
        "resolved": experiment.resolved,
        "resolved_sha256": asked(experiment),
        **facts,
        "versions": versions(),
        "machine": dict(machine),
        "outputs": {path: hashlib.sha256(data).hexdigest() for path, data in sorted(contents.items())},
    }


def asked(experiment: Experiment) -> str:
    """SHA-256 of a resolved config in hexadecimal."""
    return hashlib.sha256(to_json(experiment.resolved)).hexdigest()


def with_output(made: dict, path: str, data: bytes) -> dict:
    """The record with one more output."""
    return {**made, "outputs": {**made["outputs"], path: hashlib.sha256(data).hexdigest()}}


def earlier(folder: Path, name: str = "run.json") -> dict:
    """The record of an earlier run in a folder; an empty one where there is none that can be read."""
    try:
        record = json.loads(files.read(folder / name))
    except (OSError, ValueError, RecursionError):
        return {}
    return record if isinstance(record, dict) else {}


def outputs(folder: Path) -> list[str]:
    """The outputs that an earlier run.json of the folder names; none where there is no such record."""
    named = earlier(folder).get("outputs")
    return [path for path in named if isinstance(path, str)] if isinstance(named, dict) else []


def replaced(folder: Path, experiment: Experiment) -> list[str]:
    """A warning where a folder holds the results of another config, which has the same name."""
    record = earlier(folder)
    before, now = record.get("config_path"), path_of(experiment)
    if not isinstance(before, str) or before == now or _asked(record.get("resolved")) == _asked(experiment.resolved):
        return []
    return [f"{folder}: held the results of another config of this name, {before}; they are replaced"]


def path_of(experiment: Experiment) -> str:
    """The file of a config, as text that can be written."""
    if experiment.path is None:
        return "a mapping in Python"
    return os.fsencode(os.path.abspath(experiment.path)).decode("utf-8", "backslashreplace")


def _asked(resolved: Any) -> object:
    """A resolved config without how often and with which seed it is run."""
    try:
        cases = [{key: case[key] for key in case if key not in ("realisations", "seed")} for case in resolved["cases"]]
    except (LookupError, TypeError):
        return None
    return json.loads(to_json(cases))


def of_intervals(
    results: Sequence[CaseResult],
    made: "Mapping[str, pd.DataFrame]",
    answer: "Callable[[Mapping[str, pd.DataFrame]], Sequence[str]]",
) -> list[str]:
    """What a reader of the answer must know of its intervals, a line at most; and whether weights are wrong.

    answer makes its sentences from the tables. How many rows of which table are marked is said where these are shown.
    """
    return [*(few(results) or rests(results, made, answer)), *rare.warnings(made.get("rare"))]


def few(results: Sequence[CaseResult]) -> list[str]:
    """A line on the cases whose intervals rest on too few realisations, if any."""
    rough = {result.name: result.count for result in results if result.count < FEW}
    if not rough:
        return []
    words = tr(
        "{cases}: intervals of {counts} realisations are rough, use at least {least}",
        cases=_named(list(rough)),
        counts=span(list(rough.values())),
        least=FEW,
    )
    return [words]


def rests(
    results: Sequence[CaseResult],
    made: "Mapping[str, pd.DataFrame]",
    answer: "Callable[[Mapping[str, pd.DataFrame]], Sequence[str]]",
) -> list[str]:
    """A line on the answer's intervals that are too narrow, with the realisations that it takes, if any are."""
    found = notes.concerned(made, answer).values()
    if not found:
        return []
    count, names = sum(map(len, found)), _named(list(dict.fromkeys(name for rows in found for name in rows["filter"])))
    needed = np.max(np.concatenate([notes.needed(rows, made, results) for rows in found]))  # not-a-number if one is
    if np.isfinite(needed):
        words = plural(
            "{count} interval of the answer is too narrow, as few realisations decide it ({filters}): -n {needed} "
            "would do",
            "{count} intervals of the answer are too narrow, as few realisations decide them ({filters}): -n {needed} "
            "would do",
            count,
            filters=names,
            needed=roughly(float(needed)),
        )
    else:
        words = plural(
            "{count} interval of the answer may be too narrow: rare realisations decide it, and few or none were seen "
            "({filters}); it takes more of them, -n",
            "{count} intervals of the answer may be too narrow: rare realisations decide them, and few or none were "
            "seen ({filters}); it takes more of them, -n",
            count,
            filters=names,
        )
    return [words]


def roughly(count: float) -> str:
    """A number of realisations, rounded up to one digit, as `-n` takes it."""
    power = 10 ** math.floor(math.log10(max(count, 1.0)))
    return f"{math.ceil(count / power) * power:.0e}".replace("e+0", "e").replace("e+", "e")


def _named(names: Sequence[str]) -> str:
    """A few names, and how many more; those that hold a comma are quoted."""
    return seen.named(names, MOST_NAMES)


def extent(record: Mapping) -> str:
    """Realisations of a case and the seeds in words; how many were asked for only where a case is short of them."""
    cases = record["cases"].values()
    done, asked, seeds = (sorted({case[key] for case in cases}) for key in ("done", "asked", "seed"))
    most, said = max(done, default=0), {"done": span(done), "asked": span(asked)}
    short = any(case["done"] < case["asked"] for case in cases)
    if len(cases) > 1 and short:
        words = plural(
            "{done} realisation a case of {asked} asked", "{done} realisations a case of {asked} asked", most, **said
        )
    elif len(cases) > 1:
        words = plural("{done} realisation a case", "{done} realisations a case", most, **said)
    elif short:
        words = plural("{done} realisation of {asked} asked", "{done} realisations of {asked} asked", most, **said)
    else:
        words = plural("{done} realisation", "{done} realisations", most, **said)
    named = ", ".join(map(str, seeds[:MOST_SEEDS])) + (", …" if len(seeds) > MOST_SEEDS else "")
    return plural("{words}, seed {seeds}", "{words}, seeds {seeds}", len(seeds), words=words, seeds=named)


def span(counts: Sequence[int]) -> str:
    """Counts in words: the one there is, or the least to the largest."""
    low, high = min(counts, default=0), max(counts, default=0)
    return numeral(f"{low:,}") if low == high else tr("{low:,} to {high:,}", low=low, high=high)


def to_json(value: object) -> bytes:
    """JSON as it is written: readable, keys in their order, no not-a-number."""
    return (json.dumps(value, indent=2, ensure_ascii=False, allow_nan=False) + "\n").encode()


def versions() -> dict[str, str]:
    """Versions of Python and of the packages that shape a number or a figure."""
    found = {"python": platform.python_version()}
    for name in PACKAGES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = "not installed"
    return found

"""What a result records of its origin: run.json, versions, files of an earlier run.

run.json holds the request, the software, and the outcome. Times are there and in the report, never in a CSV."""

import hashlib
import json
import os
import platform
import re
from collections.abc import Mapping, Sequence
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import TYPE_CHECKING, Any

from radarsim.config.experiment import Experiment
from radarsim.language.numerals import numeral
from radarsim.language.translate import plural, tr
from radarsim.report.atomic_files import read

if TYPE_CHECKING:
    from radarsim.engine.results import CaseResult


RECORD_FILES = ("run.json", "report.html")  # of a result, beside tables, figures and config
MAX_SHOWN_SEEDS = 5  # named in a line
PACKAGES = ("radarsim", "numpy", "numba", "llvmlite", "scipy", "pandas", "matplotlib", "pydantic", "pyyaml")


def record(
    experiment: Experiment,
    results: "Sequence[CaseResult]",
    run: Mapping[str, Any],
    contents: Mapping[str, bytes],
    answer: Sequence[str],
    machine: Mapping[str, object],
) -> dict[str, Any]:
    """All of run.json except the report's own hash.

    run: the facts of the run (stop reason, threads, times, warnings, identities …), copied; contents: the outputs, by
    path; machine: its description. Realisations requested (in `run` where they are not those of the experiment) and
    done are sums over the cases, which may differ in both."""
    facts = dict(run)
    facts["warnings"] = [without_folders(line) for line in facts.get("warnings", ())]
    stop = facts.pop("stop", "done")
    asked = requested_counts(experiment, facts)
    facts.pop("asked", None)
    done = {result.name: result.count for result in results}
    return {
        "config": experiment.stem,
        "config_path": path_of(experiment),
        "study": experiment.study,
        "answer": list(answer),
        "realisations_asked": sum(asked.values()),
        "realisations_done": sum(done.get(case.name, 0) for case in experiment.cases),
        "cases": {
            case.name: {"asked": asked[case.name], "done": done.get(case.name, 0), "seed": case.seed}
            for case in experiment.cases
        },
        "stop": stop,
        "seed": experiment.seed,
        "resolved": experiment.resolved,
        "resolved_sha256": resolved_sha256(experiment),
        **facts,
        "versions": versions(),
        "machine": dict(machine),
        "outputs": {path: hashlib.sha256(data).hexdigest() for path, data in sorted(contents.items())},
    }


def requested_counts(experiment: Experiment, run: Mapping[str, Any]) -> dict[str, int]:
    """The realisations of each case that were asked for; more may be stored and shown. run: the facts of the run."""
    return {case.name: case.realisations for case in experiment.cases} | dict(run.get("asked", {}))


def resolved_sha256(experiment: Experiment) -> str:
    """SHA-256 of a resolved config in hexadecimal."""
    return hashlib.sha256(to_json(experiment.resolved)).hexdigest()


def with_output(record: dict, path: str, data: bytes) -> dict:
    """The record with one more output."""
    return {**record, "outputs": {**record["outputs"], path: hashlib.sha256(data).hexdigest()}}


def earlier_record(folder: Path, name: str = "run.json") -> dict:
    """The record of an earlier run in a folder; empty where none can be read."""
    try:
        record = json.loads(read(folder / name))
    except (OSError, ValueError, RecursionError):
        return {}
    return record if isinstance(record, dict) else {}


def outputs(folder: Path, name: str = "run.json") -> list[str]:
    """The outputs that an earlier record of the folder names; none where there is no such record."""
    earlier_outputs = earlier_record(folder, name).get("outputs")
    return [path for path in earlier_outputs if isinstance(path, str)] if isinstance(earlier_outputs, dict) else []


def is_same_config(resolved: object, other_resolved: object) -> bool:
    """Whether two resolved configs have the same cases, with any seed and number of realisations."""
    return _comparable(resolved) == _comparable(other_resolved)


def path_of(experiment: Experiment) -> str:
    """The file of a config as printable text, without folders of this machine."""
    if experiment.path is None:
        return "a mapping in Python"
    return os.fsencode(portable_path(experiment.path)).decode("utf-8", "backslashreplace")


def portable_path(path: str) -> str:
    """A path; of one that leads out of the working directory the name alone."""
    return path if is_portable(path) else os.path.basename(path)


def is_portable(path: str) -> bool:
    """Whether a path leads from one folder into folders within it."""
    return not os.path.isabs(path) and ".." not in Path(path).parts


ABSOLUTE_PATH = re.compile(r"(?<![\w.~/:-])(?:/[^\s/,;:'\"`()]+)+/([^\s/,;:'\"`()]+)")


def without_folders(text: str) -> str:
    """A text with the names alone of the files that it names by absolute paths.

    >>> without_folders("/home/an na/P1-904.sums: damaged, see /tmp/notes.txt")
    'P1-904.sums: damaged, see notes.txt'
    """
    path, colon, words = text.partition(": ")
    if os.path.isabs(path):  # a place at the beginning may have spaces, which end any other
        text = f"{os.path.basename(path)}{colon}{words}"
    for folder in (os.getcwd(), os.path.expanduser("~")):
        text = text.replace(f"{folder.rstrip('/')}/", "") if folder != "/" else text
    return ABSOLUTE_PATH.sub(r"\1", text)


def _comparable(resolved: Any) -> object:
    """A resolved config without its number of realisations and seed."""
    try:
        cases = [{key: case[key] for key in case if key not in ("realisations", "seed")} for case in resolved["cases"]]
    except (LookupError, TypeError):
        return None
    return json.loads(to_json(cases))


def extent(record: Mapping) -> str:
    """Realisations of a case and the seeds in words; the requested number only where a case is short of it."""
    cases = record["cases"].values()
    done, requested, seeds = (sorted({case[key] for case in cases}) for key in ("done", "asked", "seed"))
    max_done, counts = max(done, default=0), {"done": span(done), "asked": span(requested)}
    short = any(case["done"] < case["asked"] for case in cases)
    if len(cases) > 1 and short:
        count_text = plural(
            "{done} of {asked} realisation per case", "{done} of {asked} realisations per case", max_done, **counts
        )
    elif len(cases) > 1:
        count_text = plural("{done} realisation per case", "{done} realisations per case", max_done, **counts)
    elif short:
        count_text = plural(
            "{done} realisation of {asked} requested", "{done} realisations of {asked} requested", max_done, **counts
        )
    else:
        count_text = plural("{done} realisation", "{done} realisations", max_done, **counts)
    if any(case["done"] > case["asked"] for case in cases):
        count_text = tr("{words} (stored; {asked} requested)", words=count_text, **counts)
    seed_names = ", ".join(map(str, seeds[:MAX_SHOWN_SEEDS])) + (", …" if len(seeds) > MAX_SHOWN_SEEDS else "")
    return plural("{words}, seed {seeds}", "{words}, seeds {seeds}", len(seeds), words=count_text, seeds=seed_names)


def span(counts: Sequence[int]) -> str:
    """Counts in words: a single one, or the least to the largest."""
    low, high = min(counts, default=0), max(counts, default=0)
    return numeral(f"{low:,}") if low == high else tr("{low:,} to {high:,}", low=low, high=high)


def realisations_text(counts: Sequence[int]) -> str:
    """The span of numbers of realisations, with the noun."""
    return plural("{done} realisation", "{done} realisations", max(counts, default=0), done=span(counts))


def to_json(value: object) -> bytes:
    """JSON as written to files: readable, keys in their order, without NaN."""
    return (json.dumps(value, indent=2, ensure_ascii=False, allow_nan=False) + "\n").encode()


@cache  # a tenth of a small run's time, asked for several times
def versions() -> dict[str, str]:
    """Versions of Python and of the packages that affect numbers or figures."""
    version_numbers = {"python": platform.python_version()}
    for name in PACKAGES:
        try:
            version_numbers[name] = version(name)
        except PackageNotFoundError:
            version_numbers[name] = "not installed"
    return version_numbers

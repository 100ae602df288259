"""Outputs of an earlier run in the folder of a result: which stay, which are removed, and how these are made again.

Figures (of another format, say) and the table of runs stay if the earlier run has the same numbers: a user asked for
them, and they still show this result."""

import csv
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from radarsim.errors import StoreError
from radarsim.report import provenance
from radarsim.report.stored_tables import find_files

FIGURES = "figures/"
RUNS_FILE = "runs.csv"  # of `run --runs`, which no config asks for


class EarlierOutputs(NamedTuple):
    """lasting: those that stay, with their SHA-256; removable: the others; runs_table: the table of runs, if any."""

    lasting: Mapping[str, str]
    removable: tuple[str, ...]
    runs_table: bytes


def earlier_outputs(folder: Path, record: Mapping[str, Any]) -> EarlierOutputs:
    """The outputs of the run before the one with this record."""
    names = provenance.outputs(folder)
    try:
        files = find_files(folder, _can_last)
    except StoreError:
        files = None
    if files is None:
        return EarlierOutputs({}, tuple(names), b"")
    has_same_numbers = _numbers_key(files.record) == _numbers_key(record)
    lasting = {name: files.record["outputs"][name] for name in files.contents if has_same_numbers}
    removable = tuple(name for name in names if name not in lasting)
    return EarlierOutputs(lasting, removable, files.contents.get(RUNS_FILE, b""))


def _can_last(name: str) -> bool:
    return name.startswith(FIGURES) or name == RUNS_FILE


def _numbers_key(record: Mapping[str, Any]) -> object:
    """What the numbers of a result follow from: by case the realisations and the identity of their blocks."""
    return {name: case["done"] for name, case in record["cases"].items()}, record["identities"], record.get("judged")


def remaking_options(removed: Iterable[str], runs_table: bytes) -> tuple[str, ...]:
    """The options of the command that write removed outputs again."""
    removed = tuple(removed)
    kinds = sorted({Path(name).suffix[1:] for name in removed if name.startswith(FIGURES)} - {"md"})
    options = [f"--format {kind}" for kind in kinds]
    return (*options, *([runs_option(runs_table)] if RUNS_FILE in removed and runs_table else []))


def runs_option(content: bytes) -> str:
    """The option that makes a table of runs, given its content."""
    rows = csv.DictReader(content.decode("utf-8", "replace").splitlines())
    spans = {f"{row.get('first_k')}:{row.get('last_k')}" for row in rows}
    return f"--runs {spans.pop()}" if len(spans) == 1 else "--runs all"

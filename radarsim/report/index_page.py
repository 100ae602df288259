"""results/index.html: all runs of a folder by group, the newest of a group first, each with its answer."""

from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any
from urllib.parse import quote

from radarsim.errors import StoreError
from radarsim.extensions import extensions
from radarsim.report import atomic_files, provenance
from radarsim.report.render_page import render_page
from radarsim.report.stored_tables import find_record

INDEX_NAME = "index.html"


def write_index(out: Path) -> None:
    """Write the index of the runs under out; raises StoreError. Runs whose run.json cannot be read are left out.

    Under a lock from reading to writing: of two runs that end at once, the last one sees both."""
    out = Path(out)
    with atomic_files.folder_lock(out):
        rows = filter(None, map(_index_row, out.glob("*/run.json")))
        runs = sorted(rows, key=lambda run: run["finished"], reverse=True)
        heading = next((run["entry"].heading for run in runs if run["entry"]), "")
        version = provenance.versions()["radarsim"]
        page = render_page("index.html.j2", groups=_by_group(runs), heading=heading, count=len(runs), version=version)
        atomic_files.replace_all(out, {INDEX_NAME: page.encode()})


def _index_row(path: Path) -> dict | None:
    """A row of the index, from a run.json and what extensions say of its folder; None where run.json cannot be read."""
    try:
        record = find_record(path.parent)
        if record is None:
            return None
        answer = [str(line) for line in record["answer"]]
        row = {
            "name": path.parent.name,
            "address": f"{quote(path.parent.name)}/report.html",
            "answer": next(iter(answer), ""),
            "study": str(record["study"]),
            "realisations": provenance.span(sorted({int(case["done"]) for case in record["cases"].values()})),
            "finished": _finish_time(record, path),
        }
    except (StoreError, ArithmeticError, ValueError, LookupError, TypeError):
        return None
    entries = (extension.index_entry(path.parent) for extension in extensions())
    return row | {"entry": next((entry for entry in entries if entry is not None), None)}


def _by_group(runs: Sequence[Mapping[str, Any]]) -> dict[str, list[Mapping[str, Any]]]:
    """The runs by the group that an extension puts them in; those in none with others of their study, or under that."""
    groups = {run["study"]: run["entry"].group for run in reversed(runs) if run["entry"] and run["entry"].group}
    by_group: dict[str, list[Mapping[str, Any]]] = {}
    for run in runs:
        group = run["entry"].group if run["entry"] else ""
        by_group.setdefault(group or groups.get(run["study"], run["study"]), []).append(run)
    return dict(sorted(by_group.items()))


def _finish_time(record: Mapping, path: Path) -> str:
    """When the run ended, UTC, to the second: from run.json, else the time of that file."""
    finished = record.get("finished")
    when = datetime.fromisoformat(finished) if finished else datetime.fromtimestamp(path.stat().st_mtime, UTC)
    return when.astimezone(UTC).strftime("%Y-%m-%d %H:%M:%S UTC")

"""results/index.html: all runs of a folder, newest first, each with its answer in one line."""

import csv
import io
import json
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path
from urllib.parse import quote

from radarsim.report import files, html, provenance
from radarsim.report.claims import page

NAME = "index.html"


def write(out: Path) -> None:
    """Write the index of the runs under out; raises StoreError. Runs whose run.json cannot be read are left out.

    Under a lock from the first look to the writing: of two runs that end at once, the last one sees both.
    """
    out = Path(out)
    with files.locked(out):
        found = filter(None, map(_run, out.glob("*/run.json")))
        runs = sorted(found, key=lambda run: run["finished"], reverse=True)
        page = html.whole("index.html.j2", runs=runs, version=provenance.versions()["radarsim"])
        files.replace_all(out, {NAME: page.encode()})


def _run(path: Path) -> dict | None:
    """A row of the index, from a run.json and the claims.csv beside it."""
    try:
        record = json.loads(files.read(path))
        answer = [str(line) for line in record["answer"]]
        made = {
            "name": path.parent.name,
            "address": f"{quote(path.parent.name)}/report.html",
            "answer": answer[0] if answer else "",
            "study": str(record["study"]),
            "realisations": provenance.span(sorted({int(case["done"]) for case in record["cases"].values()})),
            "finished": _finished(record, path),
        }
    except (OSError, ArithmeticError, ValueError, LookupError, TypeError, AttributeError, RecursionError):
        return None
    return made | {"claims": _claims(path.parent / "claims.csv")}


def _finished(record: Mapping, path: Path) -> str:
    """When the run ended, UTC, to the second: as run.json says, else when that was written."""
    finished = record.get("finished")
    when = datetime.fromisoformat(finished) if finished else datetime.fromtimestamp(path.stat().st_mtime, UTC)
    return when.astimezone(UTC).strftime("%Y-%m-%d %H:%M:%S UTC")


def _claims(path: Path) -> str:
    """How many claims of a table are of which class; nothing where there is none."""
    try:
        text = files.read(path).decode("utf-8")
        return page.counted(list(csv.DictReader(io.StringIO(text, newline=""))))
    except (OSError, ValueError, LookupError, csv.Error):
        return ""

"""The output of --json: plain data, one document for each command, with the content of the text output."""

import json
import math
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

    from radarsim.app.compare import Comparison, DopplerChart
    from radarsim.app.configs import Inventory
    from radarsim.app.outlook import Outlook
    from radarsim.app.question import Answer
    from radarsim.app.result import Result
    from radarsim.app.run import Shares
    from radarsim.app.sensitivity import Sensitivity
    from radarsim.app.tune import Tuned
    from radarsim.config.experiment import Experiment


def text(document: object) -> str:
    """A document as JSON; NaN and infinities become null."""
    return json.dumps(_plain(document), indent=2, ensure_ascii=False, allow_nan=False)


def _plain(value: object) -> object:
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if hasattr(value, "item"):  # NumPy's numbers
        value = value.item()
    return None if isinstance(value, float) and not math.isfinite(value) else value


def fields(one: "DataclassInstance") -> dict[str, Any]:
    """A dataclass as a dict, paths as text."""
    return {key: str(value) if isinstance(value, Path) else value for key, value in asdict(one).items()}


def result(one: "Result") -> dict[str, Any]:
    """A finished run or report: request, counts, answer, σ at the last scan, verdicts, files."""
    written = one.written
    assert written is not None  # the commands write what they print
    names = {case.name: case.count for case in one.cases}
    return {
        "config": one.experiment.stem,
        "stop": one.facts["stop"],
        "unmet": one.unmet,
        "cases": {
            case.name: {"asked": case.realisations, "done": names.get(case.name, 0), "seed": case.seed}
            for case in one.experiment.cases
        },
        "precision": one.facts.get("precision"),
        "answer": list(written.answer),
        "last_scan": one.last_scan.to_dict("records"),
        "claims": one.verdicts(),
        "claims_as_shipped": one.verdicts("as_shipped"),
        "folder": str(written.folder),
        "files": list(written.files),
        "warnings": one.warnings,
    }


def share_record(done: "Shares") -> dict[str, Any]:
    """Realisations of a share, by case."""
    return {**asdict(done), "unmet": done.unmet, "warnings": done.warnings}


def outlook(experiment: "Experiment", one: "Outlook") -> dict[str, Any]:
    """The cost of a run."""
    return {"config": experiment.stem, "path": experiment.path, **asdict(one), "of": one.of.name}


def answer(one: "Answer") -> dict[str, Any]:
    """The answer of `solve`: the value with its interval, or the limit where it is not attainable."""
    return {**asdict(one), "quantity": one.quantity.words}


def tuned(one: "Tuned") -> dict[str, Any]:
    """What tuning found and gains."""
    return {**asdict(one), "quantity": one.quantity.words, "answer": one.answer}


def sensitivity(one: "Sensitivity") -> dict[str, Any]:
    """The effect of each key, the quantities by name."""
    return {**asdict(one), "of": [of.name for of in one.of]}


def compared(one: "Comparison") -> dict[str, Any]:
    """A comparison: sentences, notes and warnings, the rows of comparison.csv, and the files."""
    made = {name: getattr(one, name) for name in ("files", "sentences", "notes", "warnings", "rows", "last", "told")}
    return {"folder": str(one.folder), **made}


def drawn(one: "DopplerChart") -> dict[str, Any]:
    """A chart: the sentences, the rows of chart.csv, and the files."""
    rows = one.table.to_dict("records")
    return {"folder": str(one.folder), "sentences": one.sentences, "cases": rows, "files": one.files}


def inventory(tables: "Inventory") -> dict[str, list[dict[str, str]]]:
    """Configs, scenarios, studies and filters: lists of rows by the first word of their title."""
    return {
        title.split()[0].lower(): [dict(zip(columns, row, strict=True)) for row in rows]
        for title, columns, rows in tables
    }

"""Answers as JSON documents, for `--json`.

They are plain data, one document for each command, with the content of the text output."""

import json
import math
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from radarsim.extensions import extensions
from radarsim.report import provenance

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

    from radarsim.api.compare import Comparison
    from radarsim.api.cost_estimate import CostEstimate
    from radarsim.api.design.sensitivity import Sensitivity
    from radarsim.api.design.solve_answer import Answer
    from radarsim.api.design.tuning_result import TuningResult
    from radarsim.api.doppler_chart import DopplerChart
    from radarsim.api.inventory import Inventory
    from radarsim.api.result import Result
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


def fields(instance: "DataclassInstance") -> dict[str, Any]:
    """A dataclass as a dict, paths as text."""
    return {key: str(value) if isinstance(value, Path) else value for key, value in asdict(instance).items()}


def result(finished: "Result") -> dict[str, Any]:
    """A finished run or report: request, counts, answer, σ at the last scan, verdicts, files."""
    written = finished.written
    assert written is not None  # the commands write what they print
    asked = provenance.requested_counts(finished.experiment, finished.facts)
    done_counts = {case.name: case.count for case in finished.cases}
    return {
        "config": finished.experiment.stem,
        "stop": finished.facts["stop"],
        "unmet": finished.unmet,
        "cases": {
            case.name: {"asked": asked[case.name], "done": done_counts.get(case.name, 0), "seed": case.seed}
            for case in finished.experiment.cases
        },
        "precision": finished.facts.get("precision"),
        "answer": list(written.answer),
        "last_scan": finished.last_scan.to_dict("records"),
        **{key: value for extension in extensions() for key, value in extension.result_document(finished).items()},
        "folder": str(written.folder),
        "files": list(written.files),
        "removed": list(written.removed),
        "warnings": finished.warnings,
    }


def cost(experiment: "Experiment", estimate: "CostEstimate") -> dict[str, Any]:
    """The cost of a run."""
    document = {"config": experiment.stem, "path": experiment.path, **asdict(estimate), "of": estimate.of.name}
    for case in document["cases"]:
        if (stock := case["stock"]) is not None:  # the names of version 0.3
            stock["asked"], stock["loose"] = stock.pop("requested"), stock.pop("has_loose_blocks")
    return document


def answer(solve_answer: "Answer") -> dict[str, Any]:
    """The answer of `solve`: the value with its interval, or the limit where it is not attainable."""
    return {**asdict(solve_answer), "quantity": solve_answer.quantity.words}


def tuning(tuning_result: "TuningResult") -> dict[str, Any]:
    """What tuning found and gains."""
    return {**asdict(tuning_result), "quantity": tuning_result.quantity.words, "answer": tuning_result.answer}


def sensitivity(sensitivities: "Sensitivity") -> dict[str, Any]:
    """The effect of each key, the quantities by name."""
    return {**asdict(sensitivities), "of": [quantity.name for quantity in sensitivities.of]}


def comparison(compared: "Comparison") -> dict[str, Any]:
    """A comparison: sentences, notes and warnings, the rows of comparison.csv, and the files."""
    document = {
        name: getattr(compared, name)
        for name in ("files", "sentences", "notes", "warnings", "rows", "last", "shown_quantities")
    }
    return {"folder": str(compared.folder), **document}


def doppler_chart(chart: "DopplerChart") -> dict[str, Any]:
    """A chart: the sentences, the rows of chart.csv, and the files."""
    rows = chart.table.to_dict("records")
    return {"folder": str(chart.folder), "sentences": chart.sentences, "cases": rows, "files": chart.files}


def inventory(tables: "Inventory") -> dict[str, list[dict[str, str]]]:
    """Configs, scenarios, studies and filters: lists of rows by the first word of their title."""
    return {
        title.split()[0].lower(): [dict(zip(columns, row, strict=True)) for row in rows]
        for title, columns, rows in tables
    }

"""Tables of an experiment's settings: every key of the cases with its value and the schema's description."""

import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, TypeGuard

from radarsim.config.experiment import Case
from radarsim.config.marks import DataFile
from radarsim.config.model import Model
from radarsim.language.numerals import numeral
from radarsim.language.translate import plural, tr
from radarsim.report import tables as common
from radarsim.report.wording import number

if TYPE_CHECKING:
    import pandas as pd


SETTING_COLUMNS = ("key", "value", "meaning")
MAX_LIST_ENTRIES = 12  # of a list, shown one by one
MAX_CASE_ROWS = 40  # cases shown row by row


def settings_tables(cases: Sequence[Case]) -> "dict[str, pd.DataFrame]":
    """Tables of text by their title: keys that all cases share and, of several cases, those that differ."""
    settings = {case.name: {key: (value, meaning) for key, value, meaning in describe(case.spec)} for case in cases}
    shared = [
        (key, value, meaning)
        for key, (value, meaning) in settings[cases[0].name].items()
        if all(key in case_settings and case_settings[key][0] == value for case_settings in settings.values())
    ]
    title = plural("Every key with its value and meaning", "What all {count} cases share", len(cases))
    tables = {title: _frame(SETTING_COLUMNS, [*shared, *_shared_extent(cases)])}
    if len(cases) > 1:
        shared_keys = {key for key, _, _ in shared}
        keys = [key for keys in settings.values() for key in keys if key not in shared_keys]
        title, table = _differing_settings(cases, settings, list(dict.fromkeys(keys)))
        tables[title] = table
    return tables


def _shared_extent(cases: Sequence[Case]) -> list[tuple[str, str, str]]:
    """Rows with the number of realisations and the seed, if all cases have the same."""
    counts, seeds = (sorted({getattr(case, name) for case in cases}) for name in ("realisations", "seed"))
    rows = [("realisations", numeral(f"{n:,}"), tr("independent runs")) for n in counts]
    rows += [("seed", str(seed), tr("of the noise")) for seed in seeds]
    return rows if len(rows) == 2 else []


def _differing_settings(
    cases: Sequence[Case], settings: Mapping[str, Mapping[str, tuple[str, str]]], keys: Sequence[str]
) -> "tuple[str, pd.DataFrame]":
    """Title and table of the keys in which the cases differ, a row for each of the first cases."""
    rows: list[tuple[object, ...]] = []
    for case in cases[:MAX_CASE_ROWS]:
        values = (settings[case.name].get(key, ("–", ""))[0] for key in keys)
        rows.append((case.name, *values, numeral(f"{case.realisations:,}"), str(case.seed)))
    title = tr("How the cases differ")
    if omitted := len(cases) - len(rows):
        title = tr("How the cases differ (first {shown}; {left} more in run.json)", shown=len(rows), left=omitted)
    return title, _frame(("case", *keys, "realisations", "seed"), rows)


def _frame(columns: Sequence[str], rows: Sequence[tuple[object, ...]]) -> "pd.DataFrame":
    return common.frame({name: [row[i] for row in rows] for i, name in enumerate(columns)})


def describe(model: Model, prefix: str = "") -> Iterator[tuple[str, str, str]]:
    """Key, value and meaning of every field that a checked model holds, in the order of its schema."""
    for name, field in type(model).model_fields.items():
        value = getattr(model, name)
        if isinstance(value, str) and any(isinstance(mark, DataFile) for mark in field.metadata):
            value = Path(value).name
        meaning = tr(" ".join((field.description or "").split()))
        if isinstance(value, Model):
            yield from describe(value, f"{prefix}{name}.")
        elif _are_models(value):
            for i, entry in enumerate(value[:MAX_LIST_ENTRIES]):
                yield f"{prefix}{name}.{i}", "; ".join(_field_texts(entry)), meaning if i == 0 else ""
            if len(value) > MAX_LIST_ENTRIES:
                yield f"{prefix}{name}", tr("{count} more", count=len(value) - MAX_LIST_ENTRIES), ""
        elif value is not None and value != ():
            yield f"{prefix}{name}", value_text(name, value), meaning


def _are_models(value: object) -> TypeGuard[Sequence[Model]]:
    return isinstance(value, tuple | list) and bool(value) and all(isinstance(entry, Model) for entry in value)


def _field_texts(model: Model) -> Iterator[str]:
    """A short "key value" for each field that is set."""
    for name in type(model).model_fields:
        value = getattr(model, name)
        if isinstance(value, Model):
            yield f"{name}: {', '.join(_field_texts(value))}"
        elif _are_models(value):
            yield f"{name}: {' | '.join(', '.join(_field_texts(entry)) for entry in value)}"
        elif value is not None and value != ():
            yield f"{name} {value_text(name, value)}"


def value_text(name: str, value: object) -> str:
    """The value of a key as text: angles in degrees too, lists with commas."""
    if isinstance(value, bool):
        return tr("yes") if value else tr("no")
    if isinstance(value, float):
        text = number(value, 6)
        degrees = {"_rad": "°", "_radps": "°/s"}.get(name[name.rfind("_") :]) if "_" in name else None
        return f"{text} ({number(math.degrees(value), 6)}{degrees})" if degrees and value else text
    if isinstance(value, tuple | list):
        texts = [value_text(name, entry) for entry in value]
        return ", ".join(
            f"[{text}]" if isinstance(entry, tuple | list) else text for entry, text in zip(value, texts, strict=True)
        )
    if isinstance(value, Mapping):
        return ", ".join(f"{key}: {value_text(str(key), entry)}" for key, entry in value.items())
    return str(value)

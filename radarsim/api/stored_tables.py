"""run.json and its tables as they are stored, read only if they are those that it records."""

import csv
import hashlib
import io
import json
from collections.abc import Callable, Collection, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from radarsim.errors import StoreError
from radarsim.report import atomic_files, csv_text, provenance

if TYPE_CHECKING:
    import pandas as pd


HOW_TO_REMAKE = "`radarsim report` makes it again"
Row = TypeVar("Row")


def read_content(path: Path) -> bytes | None:
    """The bytes of a file; None where there is none. Raises StoreError where it cannot be read."""
    try:
        return atomic_files.read(path)
    except (FileNotFoundError, NotADirectoryError):
        return None
    except OSError as error:
        raise StoreError(f"{path}: cannot be read: {error.strerror}") from error


def read_rows(
    path: Path,
    text: bytes,
    columns: Collection[str],
    convert: Callable[[dict[str, Any]], Row],
    kind: str,
    old_columns: Mapping[str, str],
) -> list[Row]:
    """The result of `convert` for each row of a CSV file that has these columns; StoreError, with kind, for any other
    file. old_columns: names in files of earlier versions, with the present ones."""
    try:
        table = csv.DictReader(io.StringIO(text.decode("utf-8"), newline=""), strict=True)
        table.fieldnames = [old_columns.get(name, name) for name in table.fieldnames or ()]
        rows, names = list(table), set(table.fieldnames)
    except (ValueError, csv.Error) as error:
        raise StoreError(f"{path}: cannot be read: {error}") from error
    try:
        if names >= set(columns):
            return [convert(row) for row in rows]
    except (LookupError, TypeError, ValueError):
        pass  # reported like any other damaged table
    raise StoreError(f"{path}: is no {kind}")


def read_record(folder: Path) -> dict[str, Any] | None:
    """The run.json of a folder; None where there is none. Raises StoreError where it is damaged."""
    path = folder / "run.json"
    if (text := read_content(path)) is None:
        return None
    try:
        record = json.loads(text)
        provenance.to_json(record)  # ValueError for content that no run writes, such as NaN or half a character
        if all(isinstance(record[key], dict) for key in ("cases", "outputs", "resolved")):
            return dict(record)
    except (ValueError, LookupError, TypeError, RecursionError):
        pass
    raise StoreError(f"{path}: is no record of a run; {HOW_TO_REMAKE}")


def read_table(
    folder: Path, name: str, outputs: "dict[str, str]", whole_numbers: bool = False
) -> "pd.DataFrame | None":
    """A table of a folder whose run.json records these outputs; None where the run wrote none of this name. Raises
    StoreError where it cannot be read or differs from the record."""
    path = folder / f"{name}.csv"
    if path.name not in outputs:
        return None
    try:
        text = atomic_files.read(path)
    except OSError as error:
        raise StoreError(f"{path}: cannot be read: {error.strerror}; {HOW_TO_REMAKE}") from error
    if hashlib.sha256(text).hexdigest() != outputs[path.name]:
        raise StoreError(f"{path}: altered since it was written; {HOW_TO_REMAKE}")
    try:
        return csv_text.from_csv(text, whole_numbers)
    except ValueError as error:
        raise StoreError(f"{path}: is no table; {HOW_TO_REMAKE}") from error

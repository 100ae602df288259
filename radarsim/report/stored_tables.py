"""The record and the tables of a stored result, read only if they are those that its run.json names.

All that read a result read it here (`load`, `export`, `compare`, `claims`, the index, `doctor`, `pack`). So a fault has
the same sentence everywhere: the file, what is in it, and what should be."""

import csv
import hashlib
import io
import json
import re
import time
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

from radarsim.errors import StoreError
from radarsim.report import atomic_files, csv_text, provenance
from radarsim.report.old_columns import with_current_columns

if TYPE_CHECKING:
    import pandas as pd


RECORD = "run.json"
HOW_TO_REMAKE = "`radarsim report` makes it again"
HOW_TO_REMAKE_RECORD = "`radarsim run` makes it again, and so does `radarsim report` with -n"
MAX_ATTEMPTS, PAUSE_S = 5, 0.1  # at files that fit no record: another run may be replacing both at this moment
MAX_SHOWN_CHARACTERS = 40  # of a wrong value
SHOWN_DIGITS = 12  # of a hash
NEEDED_COLUMNS = {  # what every version wrote; those of numbers follow after |
    "curves": "case filter component | k t_s sigma sigma_lo sigma_hi",
    "gains": "case filter baseline component | k t_s gain_percent gain_lo gain_hi",
}
IDENTITY = re.compile("[0-9a-f]{2,128}")
Row = TypeVar("Row")


@dataclass(frozen=True)
class StoredFiles:
    """Files of a result and its record, all of one run.

    contents: by name, of those that are as recorded; faults: a line for each that is not."""

    folder: Path
    record: Mapping[str, Any]
    contents: Mapping[str, bytes] = field(repr=False)
    faults: Mapping[str, str]

    @property
    def counts(self) -> dict[str, int]:
        """The realisations of each case."""
        return {name: case["done"] for name, case in self.record["cases"].items()}

    @property
    def table_names(self) -> tuple[str, ...]:
        """The names of the tables; a data file of the config is none."""
        names = filter(is_table, self.record["outputs"])
        return tuple(name.removesuffix(".csv") for name in names if name not in self.record.get("data_files", ()))

    def content(self, name: str) -> bytes | None:
        """The content of a file; None where the run wrote none of this name. Raises StoreError for one that cannot be
        read or differs from the record."""
        if name in self.faults:
            raise StoreError(self.faults[name])
        return self.contents.get(name)

    def table(self, name: str) -> "pd.DataFrame | None":
        """A table, with the present names of its columns; None where the run wrote none of this name. Raises StoreError
        as `content`, and for no table."""
        content = self.content(f"{name}.csv")
        if content is None:
            return None
        path = self.folder / f"{name}.csv"
        try:
            content = with_current_columns(self.record["study"], name, content)
            table = csv_text.from_csv(content, whole_numbers=True)
        except (ValueError, csv.Error) as error:
            raise StoreError(f"{path}: is no table: {_csv_fault(error)}; {HOW_TO_REMAKE}") from error
        if fault := _column_fault(name, table):
            raise StoreError(f"{path}: {fault}; {HOW_TO_REMAKE}")
        return table


def is_table(name: str) -> bool:
    """Whether an output is a table, or a data file beside them."""
    return name.endswith(".csv") and "/" not in name


def find_files(folder: Path, is_wanted: Callable[[str], bool] = is_table) -> StoredFiles | None:
    """The wanted outputs of the result in a folder; None where there is no run.json. Raises StoreError where that is
    damaged."""
    files = _look_at_files(folder, is_wanted)
    for _ in range(MAX_ATTEMPTS - 1):
        if files is None or not files.faults:
            break
        time.sleep(PAUSE_S)
        files = _look_at_files(folder, is_wanted)
    return files


def _look_at_files(folder: Path, is_wanted: Callable[[str], bool]) -> StoredFiles | None:
    """As `find_files`, at this moment: another run may be between two files."""
    record = find_record(folder)
    if record is None:
        return None
    contents, faults = dict[str, bytes](), dict[str, str]()
    for name in filter(is_wanted, record["outputs"]):
        try:
            contents[name] = _recorded_content(folder, name, record["outputs"][name])
        except StoreError as error:
            faults[name] = error.lines[0]
    return StoredFiles(folder, record, contents, faults)


def no_result(folder: Path) -> str:
    """The error for a path that is no folder of a result."""
    archive = next((path for path in (folder, *folder.parents) if path.suffix.lower() == ".zip"), None)
    if archive is not None:
        return f"{folder}: no folder of a result; `radarsim check {archive}` verifies an archive"
    if folder.is_file():
        return f"{folder}: no folder of a result, but a file; its folder is {folder.parent}"
    if not folder.exists():
        return f"{folder}: no result: there is no such folder"
    return f"{folder}: no result: there is no {RECORD} in it"


def find_record(folder: Path) -> dict[str, Any] | None:
    """The run.json of a folder; None where there is none. Raises StoreError where it is damaged."""
    path = folder / RECORD
    if (text := read_content(path)) is None:
        return None
    try:
        record = json.loads(text)
        provenance.to_json(record)  # ValueError for content that no run writes, such as NaN or half a character
        _check_record(record)
    except RecursionError:
        reason = "too deep"
    except UnicodeDecodeError as error:
        reason = f"not UTF-8 at byte {error.start + 1}"
    except ValueError as error:
        reason = str(error)
    else:
        return dict(record)
    raise StoreError(f"{path}: is no record of a run: {reason}; {HOW_TO_REMAKE_RECORD}")


def _check_record(record: Any) -> None:
    """Raise ValueError for what is not shaped as the record of a run."""
    record = _object(record, "it")
    for key, kind, words in (
        *((key, str, "a text") for key in ("config", "study", "resolved_sha256")),
        *((key, dict, "an object") for key in ("cases", "identities", "outputs", "resolved")),
    ):
        if key not in record:
            raise ValueError(f"lacks `{key}`")
        if not isinstance(record[key], kind):
            raise ValueError(f"`{key}` must be {words}, got {_short_json(record[key])}")
    for name, version in _object(record.get("versions", {}), "`versions`").items():
        if not isinstance(version, str):
            raise ValueError(f"`versions` of {name} must be a text, got {_short_json(version)}")
    for name, package in _object(record.get("packages", {}), "`packages`").items():
        details = _object(package, f"`packages` of {name}")
        if not all(isinstance(details.get(key), str) for key in ("version", "sha256")):
            raise ValueError(f"`packages` of {name} must have version and sha256, got {_short_json(package)}")
    for name, case in record["cases"].items():
        done = _object(case, f"case {name}").get("done")
        if type(done) is not int or done < 0:
            raise ValueError(f"`done` of case {name} must be a whole number, got {_short_json(done)}")
    for name, identity in record["identities"].items():
        if name not in record["cases"]:
            raise ValueError(f"`cases` lacks {name}, which `identities` has")
        if not isinstance(identity, str) or not IDENTITY.fullmatch(identity):
            raise ValueError(f"`identities` of {name} must be a hash, got {_short_json(identity)}")
    for name, digest in record["outputs"].items():
        if not isinstance(digest, str):
            raise ValueError(f"`outputs` of {name} must be a hash, got {_short_json(digest)}")
        if Path(name).is_absolute() or ".." in Path(name).parts or "\0" in name:
            raise ValueError(f"`outputs` must lie in the folder, got {_short_json(name)}")


def _object(value: Any, name: str) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise ValueError(f"{name} must be an object, got {_short_json(value)}")
    return value


def _short_json(value: object) -> str:
    """A value of JSON, shortened."""
    text = json.dumps(value, ensure_ascii=False)
    return text if len(text) <= MAX_SHOWN_CHARACTERS else text[:MAX_SHOWN_CHARACTERS] + "…"


def read_content(path: Path) -> bytes | None:
    """The bytes of a file; None where there is none. Raises StoreError where it cannot be read."""
    try:
        return atomic_files.read(path)
    except (FileNotFoundError, NotADirectoryError):
        return None
    except OSError as error:
        raise StoreError(f"{path}: cannot be read: {error.strerror}") from error


def _recorded_content(folder: Path, name: str, digest: str) -> bytes:
    """The content of a file. Raises StoreError where it is not there, or not that of this SHA-256."""
    path = folder / name
    content = read_content(path)
    if content is None:
        raise StoreError(f"{path}: missing; {HOW_TO_REMAKE}")
    if (got := hashlib.sha256(content).hexdigest()) != digest:
        hashes = f"SHA-256 {got[:SHOWN_DIGITS]}…, {RECORD} has {digest[:SHOWN_DIGITS]}…"
        raise StoreError(f"{path}: altered since it was written: {hashes}; {HOW_TO_REMAKE}")
    return content


def _column_fault(name: str, table: "pd.DataFrame") -> str | None:
    """Which column a table lacks or has with other values than numbers, as a phrase."""
    labels, _, numbers = (part.split() for part in NEEDED_COLUMNS.get(name, "|").partition("|"))
    if missing := [column for column in (*labels, *numbers) if column not in table]:
        return f"is no table of {name}: lacks the column {missing[0]}, got {', '.join(map(str, table.columns[:20]))}"
    for column in numbers:
        if len(table) and table[column].dtype.kind not in "fi":
            text = next(value for value in table[column] if not _is_number(value))
            return f"is no table of {name}: column {column} must hold numbers, got {_short_json(text)}"
    return None


def _is_number(text: object) -> bool:
    try:
        float(str(text) or "nan")
    except ValueError:
        return False
    return True


def _csv_fault(error: Exception) -> str:
    """Why bytes are no table."""
    return f"not UTF-8 at byte {error.start + 1}" if isinstance(error, UnicodeDecodeError) else str(error)


class TableKind(NamedTuple):
    """A kind of table that is read row by row: its name in messages, its columns, its old names for columns, and how
    it is made again."""

    words: str
    columns: Collection[str]
    old_columns: Mapping[str, str] = MappingProxyType({})
    remedy: str = HOW_TO_REMAKE


def read_rows(path: Path, content: bytes, kind: TableKind, convert: Callable[[dict[str, Any]], Row]) -> list[Row]:
    """The result of `convert` for each row of a CSV file. Raises StoreError for a file of another kind."""
    try:
        table = csv.DictReader(io.StringIO(content.decode("utf-8"), newline=""), strict=True)
        table.fieldnames = [kind.old_columns.get(name, name) for name in table.fieldnames or ()]
        rows = list(table)
    except (ValueError, csv.Error) as error:
        raise StoreError(f"{path}: is no {kind.words}: {_csv_fault(error)}; {kind.remedy}") from error
    if missing := [column for column in kind.columns if column not in table.fieldnames]:
        got = ", ".join(table.fieldnames[:20])
        raise StoreError(f"{path}: is no {kind.words}: lacks the column {missing[0]}, got {got}; {kind.remedy}")
    converted = []
    for number, row in enumerate(rows, 2):
        try:
            converted.append(convert(row))
        except (LookupError, TypeError, ValueError) as error:
            raise StoreError(f"{path}: is no {kind.words}: row {number}: {error}; {kind.remedy}") from error
    return converted

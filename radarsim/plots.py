"""Recorded plots: one track from a CSV file, and the estimates over it back to one.

A plots file has a header; `t_s` must rise from row to row, an empty cell means missing, other columns are ignored.
"""

import csv
import math
import os
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from radarsim.engine.results import Track
from radarsim.errors import ConfigError, StoreError

MOST_FAULTS = 20  # told at once; a file of the wrong kind would have one in each row
LARGEST = 1e18  # of any number, as in configs


def read(path: str | os.PathLike, choices: Sequence[Sequence[str]]) -> dict[str, np.ndarray]:
    """The columns (n,) of the first of `choices` that the file has, `t_s` first; not-a-number where a cell is empty.

    Raises ConfigError with all faults, each `file:row's line:column: name: what is wrong`.
    """
    try:
        with open(path, encoding="utf-8-sig", newline="") as file:
            return _columns(str(path), csv.reader(file, strict=True), choices)
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise ConfigError(f"{path}: is not UTF-8 text") from error


def _columns(path: str, rows, choices: Sequence[Sequence[str]]) -> dict[str, np.ndarray]:
    """Header, then numbers, then the order of the times."""
    faults: list[str] = []
    values: list[list[float]] = []
    lines: list[int] = []
    try:
        header = [name.strip() for name in next(rows, [])]
        wanted = _chosen(path, header, choices)
        places = [header.index(name) for name in wanted]
        for row in rows:
            if row:
                lines.append(rows.line_num)
                values.append(_numbers(f"{path}:{rows.line_num}", row, len(header), wanted, places, faults))
            if len(faults) >= MOST_FAULTS:
                raise ConfigError(*faults, f"{path}: more faults may follow")
    except csv.Error as error:
        raise ConfigError(*faults, f"{path}:{rows.line_num}: not a CSV row: {error}") from error
    if not values and not faults:
        faults.append(f"{path}: has no rows")
    array = np.array(values, dtype=float).reshape(-1, len(wanted))
    if values and not faults and np.isnan(array[:, 1:]).all():
        faults.append(f"{path}: has no measured value in {', '.join(wanted[1:])}")
    for i, j in np.argwhere(impossible(array, wanted))[:MOST_FAULTS]:
        allowed = "must be > 0" if wanted[j] == "range_m" else "must be in radians, from -2 pi to 2 pi"
        faults.append(f"{path}:{lines[i]}:{places[j] + 1}: {wanted[j]}: {allowed}, got {array[i, j]:g}")
    for i in np.flatnonzero(~(np.diff(array[:, 0]) > 0))[:MOST_FAULTS]:
        if np.isfinite(array[i : i + 2, 0]).all():
            place = f"{path}:{lines[i + 1]}:{places[0] + 1}: t_s"
            faults.append(f"{place}: must be later than the row before, got {array[i + 1, 0]:g} after {array[i, 0]:g}")
    if faults:
        raise ConfigError(*faults)
    return dict(zip(wanted, array.T.copy(), strict=True))


def impossible(array: np.ndarray, names: list[str]) -> np.ndarray:
    """Which values (n, columns) no sensor can have given: ranges not positive, angles beyond a turn (degrees?)."""
    wrong = np.zeros(array.shape, dtype=bool)
    for j, name in enumerate(names):
        if name == "range_m":
            wrong[:, j] = array[:, j] <= 0
        elif name.endswith("_rad"):
            wrong[:, j] = np.abs(array[:, j]) > 2 * np.pi
    return wrong


def _chosen(path: str, header: list[str], choices: Sequence[Sequence[str]]) -> list[str]:
    """The first choice of columns that the header holds, each once."""
    for choice in choices:
        if set(choice) <= set(header):
            twice = [name for name in choice if header.count(name) > 1]
            if twice:
                raise ConfigError(*(f"{path}:1: the column {name} is there twice" for name in twice))
            return list(choice)
    allowed = " or ".join(", ".join(choice) for choice in choices)
    raise ConfigError(f"{path}:1: must have the columns {allowed}; got {', '.join(header)[:200] or 'nothing'}")


def _numbers(
    place: str, row: list[str], width: int, names: list[str], places: list[int], faults: list[str]
) -> list[float]:
    """The wanted numbers of a row; faults are noted and stand as not-a-number."""
    if len(row) != width:
        faults.append(f"{place}: must have {width} cells as the header, got {len(row)}")
        return [math.nan] * len(names)
    return [_number(f"{place}:{p + 1}: {name}", row[p].strip(), faults) for name, p in zip(names, places, strict=True)]


def _number(place: str, text: str, faults: list[str]) -> float:
    if not text and not place.endswith(" t_s"):
        return math.nan
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not abs(value) <= LARGEST or "_" in text:
        faults.append(f"{place}: must be a finite number, got {text[:60]!r}")
        return math.nan
    return value


def rows_of(track: Track) -> list[tuple]:
    """Header and rows of a track: t_s, filter, component, unit, estimate, sigma, and the models' probabilities."""
    models = 0 if track.probability is None else track.probability.shape[2]
    header = (
        "t_s",
        "filter",
        "component",
        "unit",
        "estimate",
        "sigma",
        *(f"probability_{m + 1}" for m in range(models)),
    )
    rows = [header]
    for i, t in enumerate(track.t_s):
        for f, name in enumerate(track.filters):
            shares = () if track.probability is None else tuple(_cell(p) for p in track.probability[f, i])
            for c, (component, unit) in enumerate(track.components):
                if not math.isnan(track.estimate[f, i, c]):
                    numbers = (_cell(track.estimate[f, i, c]), _cell(track.sigma[f, i, c]))
                    rows.append((_cell(t), name, component, unit, *numbers, *shares))
    return rows


def _cell(value: float) -> str:
    return "" if math.isnan(value) else repr(float(value))


def write(track: Track, path: str | os.PathLike) -> None:
    """Write a track as CSV, whole or not at all; raises StoreError."""
    path = Path(path)
    try:
        number, temporary = tempfile.mkstemp(prefix=f".{path.name}.", dir=path.parent)
        try:
            with os.fdopen(number, "w", encoding="utf-8", newline="") as file:
                csv.writer(file, lineterminator="\n").writerows(rows_of(track))
            os.replace(temporary, path)
        except BaseException:
            os.unlink(temporary)
            raise
    except OSError as error:
        raise StoreError(f"{path}: cannot be written: {error.strerror}") from error

"""Guess which columns of a table hold the quantities whose names are unknown.

A guess is offered as an option to copy, never taken: by names that are alike, by the unit at the end of a name, and by
the cells of the first rows."""

import difflib
import math
import re
import shlex
from collections.abc import Callable, Mapping, Sequence

from radarsim.recordings.formats.units import TURNS

MIN_LIKENESS = 0.72  # of two names, by difflib
MIN_PART_LETTERS = 3  # of a name that begins or ends another
MIN_METRES = 500.0  # of the largest range: smaller numbers are kilometres
TIME_CELL = re.compile(r"\d{1,4}[-./]\d{1,2}[-./]\d{1,4}.*|\d{1,2}:\d\d.*")


def suggest_options(
    missing: Mapping[str, Sequence[str]],
    unit_of: Callable[[str, str], str],
    stems: Sequence[tuple[str, str]],
    names: Sequence[str],
    sample: Sequence[Sequence[str]],
) -> list[str]:
    """Options --column for missing quantities, their known names by ours.

    stems: name and unit of each column, '' for columns that are used; unit_of: the name of a quantity with the unit of
    a column, '' where that is no unit of it."""
    free, options = {i for i, (stem, _) in enumerate(stems) if stem}, []
    for ours, known_names in missing.items():
        scores = {
            i: _score(ours, known_names, stems[i], bool(unit_of(ours, stems[i][1])), _cells(sample, i)) for i in free
        }
        best = max(scores, key=lambda i: (scores[i], -i), default=None)
        if best is None or scores[best] <= 0:
            continue
        free.remove(best)
        name = unit_of(ours, stems[best][1]) if stems[best][1] else ""
        options.append(f"--column {name or name_by_cells(ours, _cells(sample, best))}={shlex.quote(names[best])}")
    return options


def _cells(sample: Sequence[Sequence[str]], index: int) -> list[str]:
    return [row[index].strip() for row in sample if index < len(row)]


def _score(
    ours: str, known_names: Sequence[str], stem_and_unit: tuple[str, str], has_unit: bool, cells: list[str]
) -> float:
    """How well a column fits a quantity: 0 where nothing speaks for it."""
    stem, unit = stem_and_unit
    if ours == "t_s":
        rises = _rises(cells)
        return _likeness(stem, known_names) + 2.0 * bool(cells and all(map(TIME_CELL.fullmatch, cells))) + 1.0 * rises
    if ours == "track":
        return _likeness(stem, known_names)
    has_numbers = not cells or not all(math.isnan(cell_number(cell)) for cell in cells)
    if (unit and not has_unit) or not has_numbers:
        return 0.0
    return _likeness(stem, known_names) + 1.0 * bool(unit)


def _likeness(stem: str, known_names: Sequence[str]) -> float:
    """From 0 to 2: whether a name begins or ends with a known one, or is nearly one."""
    for name in known_names:
        if min(len(name), len(stem)) >= MIN_PART_LETTERS and (
            stem.startswith(name) or name.startswith(stem) or stem.endswith(name)
        ):
            return 2.0
    best = max((difflib.SequenceMatcher(None, stem, name).ratio() for name in known_names), default=0.0)
    return best if best >= MIN_LIKENESS else 0.0


def cell_number(cell: str) -> float:
    """The number in a cell, with a decimal point or comma; not-a-number of another text."""
    try:
        return float(cell.strip().replace(",", "."))
    except ValueError:
        return math.nan


def _numbers(cells: Sequence[str]) -> list[float] | None:
    """The numbers in cells that are not empty; None where one is none."""
    numbers = [cell_number(cell) for cell in cells if cell]
    return None if any(map(math.isnan, numbers)) else numbers


def _rises(cells: Sequence[str]) -> bool:
    """Whether a column counts, as times do."""
    numbers = _numbers(cells)
    return (
        bool(numbers)
        and len(numbers or ()) > 1
        and all(later > earlier for earlier, later in zip(numbers or (), (numbers or ())[1:], strict=False))
    )


def name_by_cells(ours: str, cells: Sequence[str]) -> str:
    """The name of a quantity in the unit that its numbers suggest."""
    largest = max(map(abs, _numbers(cells) or [0.0]), default=0.0)
    if ours == "range_m":
        return "range_m" if largest >= MIN_METRES else "range_km"
    if ours == "bearing_rad":
        turns = {"rad": 6.3, "deg": 360.5, **TURNS}
        return f"bearing_{next((unit for unit, turn in turns.items() if largest <= turn), 'deg')}"
    return ours

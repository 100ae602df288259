"""Recognise wide tables: one row a scan, with columns for each of several targets or sensors.

Their names differ by a number, a letter or a word alone: `R1, R2`, `target1_range, target2_range`, `range_a, range_b`.
None of them may be taken for the only one."""

import re
import shlex
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import NamedTuple

from radarsim.recordings.formats.column_suggestions import name_by_cells
from radarsim.recordings.formats.units import split_unit

SHORT_NAMES = {  # that are known beside a number or a letter alone
    "t_s": ("t",),
    "range_m": ("r", "rng", "dist", "d", "д"),
    "bearing_rad": ("b", "brg", "azi", "a", "аз"),
    "velocity_mps": ("v", "vr", "dop"),
    "altitude_m": ("h", "z"),
}
PLACES = ("range_m", "latitude_deg", "longitude_deg")  # of which a row has one alone
LABEL_PATTERN = re.compile(r"(?P<before>.*?)[ _.\-]*(?P<label>\d+)[ _.\-]*(?P<after>\D*)")
LETTER_PATTERN = re.compile(r"(?P<before>.+?)[ _.\-]*(?P<label>[a-d])(?P<after>)")
WORD_PATTERNS = (
    re.compile(r"(?P<label>[^\W\d]+)[ _.\-]+(?P<before>.+)(?P<after>)"),
    re.compile(r"(?P<before>.+)[ _.\-]+(?P<label>[^\W\d]+)(?P<after>)"),
)
OTHER_WORDS = (  # that do not tell targets apart
    *("min", "max", "mean", "avg", "median", "std", "sigma", "rms", "sd", "var", "err", "error", "bias"),
    *("true", "truth"),
    *("raw", "rate", "slant", "ground", "horizontal", "corrected", "smoothed", "filtered", "predicted", "estimated"),
    *("gate", "bin", "cell", "m", "quality", "valid", "flag", "unit", "units", "last", "next", "start", "end", "own"),
)
TARGET_WORDS = (  # behind the name of a quantity, before the number of a target
    *("t", "target", "tgt", "trk", "track", "obj", "object", "ac", "aircraft", "ship", "boat", "radar", "sensor", "s"),
    *("ch", "channel", "station", "ziel", "spur", "цель", "рлс", "трасса"),
)


class _Column(NamedTuple):
    """A column of a wide table: whose it is, '' of a name without a label; its name without the label, its quantity,
    its index and its unit."""

    label: str
    stem: str
    quantity: str
    position: int
    unit: str


def wide_table_fault(
    names: Sequence[str],
    sample: Sequence[Sequence[str]],
    known_names: Callable[[str], Iterable[str]],
    name_with_unit: Callable[[str, str], str],
    quantities: Iterable[str],
) -> str:
    """What must be said of a table whose columns are of several targets or sensors, with the options that import each;
    '' of another.

    known_names: of a quantity; name_with_unit: a quantity's name in a unit, '' where that is none."""
    known = {name: ours for ours in quantities for name in (*SHORT_NAMES.get(ours, ()), *known_names(ours))}
    for pattern in (LABEL_PATTERN, LETTER_PATTERN, *WORD_PATTERNS):
        columns = _labelled_columns(names, known, pattern)
        by_label: dict[str, dict[str, _Column]] = {}
        for column in columns:
            by_label.setdefault(column.label, {}).setdefault(column.quantity, column)
        groups = [group for group in by_label.values() if any(ours in group for ours in PLACES)]
        if len(groups) > 1 and len({min(ours for ours in group if ours in PLACES) for group in groups}) == 1:
            ways = [" ".join(_option(column, names, sample, name_with_unit) for column in group.values())
                    for group in groups]  # fmt: skip
            place_names = [names[group[ours].position] for group in groups for ours in PLACES if ours in group]
            return (
                f"must have one target of one sensor a row; {', '.join(place_names)} are of several: import each by "
                f"itself, {'; '.join(ways)}"
            )
    return ""


def _labelled_columns(names: Sequence[str], known: Mapping[str, str], pattern: re.Pattern[str]) -> list[_Column]:
    """The columns of quantities with a label that a pattern finds; also those of the same names without one."""
    columns, plain = [], []
    for index, name in enumerate(names):
        stem, unit = split_unit(name)
        if stem in known:
            plain.append(_Column("", stem, known[stem], index, unit))
        elif (match := pattern.fullmatch(stem)) and match["label"] not in OTHER_WORDS:
            rest, inner_unit = split_unit(_name_beside(match))
            if rest in known:
                columns.append(_Column(match["label"], rest, known[rest], index, unit or inner_unit))
    stems = {column.stem for column in columns}
    has_place = any(column.quantity in PLACES and column.stem not in stems for column in plain)
    if has_place or (pattern in WORD_PATTERNS and any(column.quantity in PLACES for column in plain)):
        return []
    return [column for column in plain if column.stem in stems] + columns


def _name_beside(match: re.Match[str]) -> str:
    """The name of a quantity before or after a label: `range` of range_1, target1_range and range_target1."""
    before, after = match["before"], match["after"]
    if after:
        return "" if before in OTHER_WORDS else str(after)
    name, _, word = before.rpartition("_")
    return name if name and word in TARGET_WORDS else str(before)


def _option(
    column: _Column, names: Sequence[str], sample: Sequence[Sequence[str]], name_with_unit: Callable[[str, str], str]
) -> str:
    """The option that reads a column."""
    cells = [row[column.position].strip() for row in sample if column.position < len(row)]
    ours = (column.unit and name_with_unit(column.quantity, column.unit)) or name_by_cells(column.quantity, cells)
    return f"--column {ours}={shlex.quote(names[column.position])}"

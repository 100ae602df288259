"""The units of the columns of tables."""

import re
from collections.abc import Collection, Iterable

UNIT_COLUMN = "as in column unit"  # of quantities whose rows have several units
PERCENT = "_percent"
UNITS_BY_SUFFIX = {
    PERCENT: "%",
    "_mps2": "m/s²",
    "_mps3": "m/s³",
    "_mps": "m/s",
    "_rad": "rad",
    "_deg": "°",
    "_turns": "turns",
    "_hz": "Hz",
    "_db": "dB",
    "_m": "m",
    "_s": "s",
}
COMPONENT_COLUMN = re.compile(
    r"(\w+_)?(sigma(_all)?|bias|spread|crb(_sum)?)|floor"
)  # of errors of a component; and the intervals
INTERVAL_ENDS = ("_lo", "_hi", "_se")


def column_units(columns: Iterable[str]) -> dict[str, str]:
    """The unit of each column that has one; `UNIT_COLUMN` where the column `unit` gives it for each row."""
    names = list(columns)
    return {name: unit for name in names if (unit := _unit(name, names))}


def _unit(name: str, names: Collection[str]) -> str:
    stem = name
    for ending in INTERVAL_ENDS:
        stem = stem.removesuffix(ending)
    if unit := next((unit for suffix, unit in UNITS_BY_SUFFIX.items() if stem.endswith(suffix)), ""):
        return unit
    is_end = stem != name and stem not in names
    if is_end and f"{stem}{PERCENT}" in names:  # gain_lo of gain_percent
        return UNITS_BY_SUFFIX[PERCENT]
    return UNIT_COLUMN if "unit" in names and COMPONENT_COLUMN.fullmatch(stem) else ""

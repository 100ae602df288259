"""The units of the columns of tables."""

from collections.abc import Iterable

UNIT_COLUMN = "as in column unit"  # of quantities whose rows have several units
UNITS_BY_SUFFIX = {
    "_percent": "%",
    "_mps2": "m/s²",
    "_mps3": "m/s³",
    "_mps": "m/s",
    "_rad": "rad",
    "_deg": "°",
    "_hz": "Hz",
    "_m": "m",
    "_s": "s",
}
PERCENTAGES = ("gain_lo", "gain_hi")
COMPONENT_COLUMNS = ("sigma", "bias", "spread", "floor", "exact_sigma", "believed_sigma")  # and their intervals


def column_units(columns: Iterable[str]) -> dict[str, str]:
    """The unit of each column that has one; `UNIT_COLUMN` where the column `unit` gives it for each row."""
    names = list(columns)
    units = {name: unit for name in names if (unit := _unit(name, "unit" in names))}
    return units


def _unit(name: str, has_unit_column: bool) -> str:
    if name in PERCENTAGES:
        return "%"
    stem = name
    for ending in ("_lo", "_hi", "_se"):
        stem = stem.removesuffix(ending)
    if has_unit_column and stem in COMPONENT_COLUMNS:
        return UNIT_COLUMN
    return next((unit for suffix, unit in UNITS_BY_SUFFIX.items() if stem.endswith(suffix)), "")

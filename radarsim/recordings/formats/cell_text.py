"""Values of a log as the cells of a sheet."""

import datetime
import math
from typing import Any


def finite_number(value: Any) -> float:
    """A value as a float; NaN where it is no number or implausibly large."""
    return float(value) if isinstance(value, int | float) and abs(value) < 1e18 else math.nan


def cell_text(value: Any) -> str:
    """A value as a cell: numbers to the last digit, moments in ISO 8601, '' for any other value."""
    if isinstance(value, str):
        return value
    if isinstance(value, datetime.datetime | datetime.date):
        return value.isoformat()
    return repr(value) if isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < 1e300 else ""

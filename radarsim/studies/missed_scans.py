"""Scans without a row between the rows of a recording, for filters that do more than predict in such a scan: that test,
mix their models or end a track. With them an empty row and no row are the same."""

import math
from collections.abc import Mapping, Sequence

import numpy as np

MAX_MISSED_SCANS = 100  # of a gap; over the rest of a longer one a filter only predicts, in one step
WHOLE_PERIODS = 1e-3  # of a period: as much a time may differ from whole periods


def missed_scan_times(last_t: float, t: float, period: float) -> Sequence[float]:
    """The times of the scans between two rows; none after a last row at not-a-number."""
    periods = (t - last_t) / period
    if not periods >= 2 - WHOLE_PERIODS:
        return ()
    whole = round(periods)
    is_whole = abs(periods - whole) <= WHOLE_PERIODS
    step, count = ((t - last_t) / whole, whole) if is_whole else (period, math.floor(periods))
    return [last_t + step * k for k in range(1, min(count, MAX_MISSED_SCANS + 1))]


def with_missed_scans(t: np.ndarray, period: float) -> tuple[np.ndarray, np.ndarray]:
    """The times (m,) of rows and of the scans missed between them, and where the rows at times t (n,) are (n,)."""
    times = list[float]()
    rows = np.empty(len(t), dtype=np.int64)
    for k, time in enumerate(t.tolist()):
        times += missed_scan_times(times[-1] if times else math.nan, time, period)
        rows[k] = len(times)
        times.append(time)
    return np.array(times), rows


def leading_empty_rows(columns: Mapping[str, np.ndarray]) -> int:
    """How many rows of a track, columns (n,), stand before the first in which something was measured; 0 if none was."""
    measured = [np.isfinite(column) for name, column in columns.items() if name != "t_s"]
    has_number = np.any(measured, axis=0) if measured else np.ones(len(columns["t_s"]), dtype=bool)
    return int(np.argmax(has_number))


def without_empty_rows(columns: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Columns (n,) of a track without the rows in which nothing was measured."""
    measured = [np.isfinite(column) for name, column in columns.items() if name != "t_s"]
    has_number = np.any(measured, axis=0) if measured else np.ones(len(columns["t_s"]), dtype=bool)
    return {name: column[has_number] for name, column in columns.items()}

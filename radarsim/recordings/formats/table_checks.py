"""Tell by the numbers of a table in which unit they are, where its header does not say."""

import math
import shlex
from collections.abc import Mapping

import numpy as np

from radarsim.errors import ConfigError
from radarsim.recordings.formats import cell_times, records
from radarsim.recordings.formats.columns import Column
from radarsim.recordings.formats.records import Batch
from radarsim.recordings.formats.units import FLIGHT_LEVELS, HEIGHTS, TURNS, split_unit, turn_of
from radarsim.recordings.grouping import rows_by_name

MAX_PLAUSIBLE_MPS = 3000.0  # of a target: numbers that say more are of another unit
DEGREE_M = 111_000.0  # of latitude
DATE_STEMS = ("date", "day", "datum", "дата")
MIN_LONG_STEP_S = 300.0  # from row to row, as no sensor scans
SMALL_UNITS_S = {"ms": 1e-3, "us": 1e-6, "ns": 1e-9}
MAX_FLIGHT_LEVEL = 600.0  # hundreds of feet
MIN_JUMP_STEPS = 20.0  # of the usual steps of a bearing
TURN_TOLERANCE = 0.02  # of jumps by a turn, and of all numbers within it
HORIZON_M = 4120.0  # per root of a height in m: the radio horizon, with 4/3 of the earth's radius
RADAR_HEIGHT_M = 100.0  # of a radar of which nothing is known
MIN_HIDDEN_SHARE = 0.1  # of the plots that would lie below the horizon: more than errors and bent rays explain


def refuse_clock_digits(batch: Batch, path: str, name: str, first_cell: str) -> None:
    """Raise ConfigError if the times of a batch are times of day as 120006.25, rather than seconds."""
    if cell_times.are_clock_digits(batch.columns["t_s"]):
        raise ConfigError(f"{path}: {name}: must be in s; {first_cell!r} and the others are times of day, HHMMSS: "
                          f"--column t_hhmmss={shlex.quote(name)}")  # fmt: skip


def refuse_day_numbers(batch: Batch, path: str, name: str, has_date: bool, first_cell: str) -> None:
    """Raise ConfigError if the times of a batch are day numbers, or fractions of a day, rather than seconds.

    first_cell: the first of them. Numbers of a day follow each other in steps below MAX_DAY_STEP. Seconds in such steps
    are told from them by the speeds that they give, and by the name of their column."""
    t = batch.columns["t_s"]
    numbers = t % records.DAY_S if has_date else t
    kind = cell_times.day_numbers_of(float(np.median(numbers)))
    steps, speeds = [], []
    for rows in rows_by_name(batch.track).values():
        dt = np.diff(t[rows])
        steps.append(np.abs(dt[dt != 0]))
        if len(rows) > 2 and (half := len(rows) // 2) and (spans := np.abs(t[rows][half:] - t[rows][:-half])).all():
            speeds.append(_change_m(batch, rows, half) / spans)
    all_steps = np.concatenate([np.empty(0), *steps])
    if not kind or not all_steps.size or np.median(all_steps) >= cell_times.MAX_DAY_STEP:
        return
    is_fast = bool(speeds) and float(np.median(np.concatenate(speeds))) > MAX_PLAUSIBLE_MPS
    if is_fast or (kind != cell_times.FRACTIONS_OF_DAY and any(word in split_unit(name)[0] for word in DATE_STEMS)):
        is_fraction, column = kind == cell_times.FRACTIONS_OF_DAY, shlex.quote(name)
        description = kind if is_fraction else f"day numbers, as of {kind}"
        cure = f"--column t_days={column}"
        if kind == cell_times.SPREADSHEET:
            first_s = cell_times.day_number_s(float(numbers[0]))
            dates = [cell_times.day_text(first_s + shift * records.DAY_S) for shift in (0, cell_times.DAYS_TO_1904)]
            cure += f" ({dates[0]}); if they count from 1904 ({dates[1]}): --column t_days1904={column}"
        raise ConfigError(f"{path}: {name}: must be in s; {first_cell!r} and the others are {description}: {cure}")


def refuse_wrapped_bearings(batch: Batch, path: str, column: Column) -> None:
    """Raise ConfigError if bearings jump by a full turn of another unit than that of their column.

    Then all numbers lie within that turn, and those of a track that passes its end jump by it, but for a few of their
    usual steps."""
    numbers = batch.columns["bearing_rad"] / column.factor
    steps = np.concatenate([np.diff(numbers[rows]) for name, rows in rows_by_name(batch.track).items() if name] or [[]])
    steps = np.abs(steps[np.isfinite(steps)])
    own_turn = turn_of(column.unit)
    jumps = steps[steps > MIN_JUMP_STEPS * np.median(steps)] if steps.size else steps
    extent = float(np.ptp(numbers[np.isfinite(numbers)])) if jumps.size else 0.0
    for unit, turn in {"radian": 2 * math.pi, "deg": 360.0, **TURNS}.items():
        is_other = abs(turn / own_turn - 1) > TURN_TOLERANCE and turn < own_turn
        if is_other and abs(extent / turn - 1) < TURN_TOLERANCE and (np.abs(jumps / turn - 1) < TURN_TOLERANCE).any():
            cure = f"--column bearing_{unit}={shlex.quote(column.name)}"
            raise ConfigError(
                f"{path}: {column.name}: must be in {column.unit}; it jumps by {turn:.4g}, as bearings of {turn:.4g} a "
                f"turn do: {cure}"
            )


def long_step(batch: Batch) -> tuple[float, str] | None:
    """The median step of times from row to row of a track, s, if it is longer than any scan, and the times count
    neither from midnight nor from 1970; with the unit in which it would be none. Else None."""
    t = batch.columns["t_s"]
    first = float(t.max() if batch.kind == records.PLOTS else t.min())
    if not records.DAY_S <= first < cell_times.FIRST_DATED_S:
        return None
    steps = np.concatenate([np.empty(0), *(np.diff(t[rows]) for rows in rows_by_name(batch.track).values())])
    steps = np.abs(steps[steps != 0])
    step = float(np.median(steps)) if steps.size else 0.0
    unit = next((unit for unit, size_s in SMALL_UNITS_S.items() if step * size_s < MIN_LONG_STEP_S), "ns")
    return (step, unit) if step >= MIN_LONG_STEP_S else None


def _change_m(batch: Batch, rows: np.ndarray, half: int) -> np.ndarray:
    """By how much a track's range or latitude changes over half of its rows (n - half,), m."""
    is_plot = batch.kind == records.PLOTS
    column = batch.columns["range_m"][rows] if is_plot else DEGREE_M * batch.columns["latitude_deg"][rows]
    return np.abs(column[half:] - column[:-half])


def assumed_altitude(columns: Mapping[str, Column]) -> list[str]:
    """The name of the only column of altitudes whose unit is assumed; none where there are several, or it is stated."""
    altitudes = [columns[ours] for ours in ("altitude_m", "barometric_m") if ours in columns]
    names = [c.name for c in altitudes if c.is_assumed and split_unit(c.name)[0] not in FLIGHT_LEVELS]
    return names if len(altitudes) == 1 else []


def flight_level_factor(batch: Batch, columns: Mapping[str, Column]) -> float:
    """By what altitudes must be multiplied if they are hundreds of feet, though no unit says so; 0 where they are not.

    Then none exceeds MAX_FLIGHT_LEVEL, and a tenth of the targets would lie below the horizon, but do not as flight
    levels."""
    if batch.kind != records.PLOTS or not (names := assumed_altitude(columns)):
        return 0.0
    (column,) = (column for column in columns.values() if column.name == names[0])
    factor = HEIGHTS["fl"] / column.factor
    is_known = np.isfinite(batch.columns["altitude_m"]) & np.isfinite(batch.columns["range_m"])
    height, r = batch.columns["altitude_m"][is_known], batch.columns["range_m"][is_known]
    if not height.size or height.max() > MAX_FLIGHT_LEVEL * column.factor:
        return 0.0
    is_hidden, is_hidden_as_level = (r > horizon_m(h) for h in (height, factor * height))
    return factor if is_hidden.mean() > MIN_HIDDEN_SHARE > is_hidden_as_level.mean() else 0.0


def horizon_m(height: np.ndarray) -> np.ndarray:
    """How far a target (n,) of a height, m, can be seen, m."""
    return HORIZON_M * (np.sqrt(RADAR_HEIGHT_M) + np.sqrt(np.maximum(height, 0.0)))

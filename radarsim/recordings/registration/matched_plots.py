"""Plots with the paths of their aircraft, and how each error of a radar moves them.

If an aircraft has range R and bearing B by the positions, its plot of time t has:

    range = (1 + range_scale) R(t - time_s) + range_m,   bearing = B(t - time_s) + bearing_rad

ERRORS adds to these four biases what a radar, its clock or the positions may err by besides, each linear in its
coefficients. It moves plots in range or in bearing; a drift of the clock moves them along their paths."""

import math
from collections.abc import Callable, Iterable
from typing import NamedTuple

import numpy as np

from radarsim.constants import EARTH_RADIUS_M
from radarsim.language.translate import term
from radarsim.recordings.aircraft_match import range_bearing_offsets
from radarsim.recordings.formats.records import BIASES
from radarsim.recordings.grouping import rows_by_name

MIN_RELATIVE_SIGMA = 1e-13  # of a range, relative, and of a bearing


class MatchedPlots(NamedTuple):
    """Plots (n,), the number of each one's aircraft, and position and speed (m, 6) of an aircraft at times (m,)."""

    t_s: np.ndarray
    range_m: np.ndarray
    bearing_rad: np.ndarray
    path_numbers: np.ndarray
    states: Callable[[int, np.ndarray], np.ndarray]


class SensorError(NamedTuple):
    """An error beyond the biases: its name, the coordinate that it moves, what it goes with, and its coefficients.

    One without a name is not estimated: it only says what residuals go with. fixed: the value of a coefficient that can
    have one value alone, else NaN. widens: whether the intervals of the biases allow for it where it is possible."""

    name: str
    coordinate: str
    companion: str
    coefficients: tuple[str, ...]
    fixed: float = math.nan
    widens: bool = False


ERRORS = (
    SensorError(
        name=term("an eccentric encoder"),
        coordinate=term("bearing"),
        companion=term("bearing"),
        coefficients=("eccentricity_sin_rad", "eccentricity_cos_rad"),
    ),
    SensorError(
        name=term("a tilted antenna"),
        coordinate=term("bearing"),
        companion=term("elevation"),
        coefficients=("tilt_sin_rad", "tilt_cos_rad"),
    ),
    SensorError(
        name=term("ranges along the ground instead of slant ranges"),
        coordinate=term("range"),
        companion=term("elevation"),
        coefficients=("ground_share",),
        fixed=1.0,
    ),
    SensorError(
        name=term("wrong heights of the positions"),
        coordinate=term("range"),
        companion=term("elevation"),
        coefficients=("height_m",),
        widens=True,
    ),
    SensorError(
        name=term("an error that grows with the square of the range"),
        coordinate=term("range"),
        companion=term("range"),
        coefficients=("range_m_at_100_km",),
        widens=True,
    ),
    SensorError(
        name=term("a clock that drifts"),
        coordinate=term("range and bearing"),
        companion=term("time"),
        coefficients=("time_s_per_s",),
    ),
    SensorError("", term("range"), term("bearing"), ("range_sin_m", "range_cos_m")),
    SensorError("", term("range"), term("time"), ("range_rate", "range_rate_2")),
    SensorError("", term("range"), term("height"), ("range_per_height",)),
    SensorError("", term("bearing"), term("bearing"), ("bearing_sin_2", "bearing_cos_2")),
    SensorError("", term("bearing"), term("elevation"), ("bearing_per_elevation",)),
    SensorError("", term("bearing"), term("range"), ("bearing_per_range",)),
    SensorError("", term("bearing"), term("time"), ("bearing_rate",)),
    SensorError("", term("bearing"), term("height"), ("bearing_per_height",)),
)
COORDINATES = {key: int(error.coordinate == "bearing") for error in ERRORS for key in error.coefficients}
COEFFICIENTS = (*BIASES, *(key for error in ERRORS for key in error.coefficients))
TIME, TIME_RATE = COEFFICIENTS.index("time_s"), COEFFICIENTS.index("time_s_per_s")


def coefficient_indices(error: SensorError) -> list[int]:
    """The indices in COEFFICIENTS of an error's coefficients."""
    return [COEFFICIENTS.index(key) for key in error.coefficients]


def fitted_indices(errors: Iterable[SensorError]) -> list[int]:
    """The indices in COEFFICIENTS of the coefficients of errors that have no fixed value."""
    return [k for error in errors if math.isnan(error.fixed) for k in coefficient_indices(error)]


def fixed_values(errors: Iterable[SensorError]) -> np.ndarray:
    """The values of COEFFICIENTS that errors fix, 0 for the others."""
    values = np.zeros(len(COEFFICIENTS))
    for error in errors:
        if not math.isnan(error.fixed):
            values[coefficient_indices(error)] = error.fixed
    return values


def linearise(pairs: MatchedPlots, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Residuals (n, 2) of range and bearing, NaN where there is none, and how they fall with each of COEFFICIENTS
    (n, 2, coefficients), from values of these."""
    range_bias, range_scale, bearing_bias, time_bias = values[: len(BIASES)].tolist()
    states, since_middle_s = np.full((len(pairs.t_s), 6), np.nan), pairs.t_s - middle_s(pairs)
    lag = time_bias + values[TIME_RATE] * since_middle_s
    for number, rows in rows_by_name(pairs.path_numbers.tolist()).items():
        states[rows] = pairs.states(number, pairs.t_s[rows] - lag[rows])
    position, velocity = states[:, :3], states[:, 3:]
    errors = range_bearing_offsets(states, pairs.range_m - range_bias, pairs.bearing_rad - bearing_bias)
    r = np.linalg.norm(position, axis=1)
    errors[:, 0] -= range_scale * r
    slopes = np.zeros((len(r), 2, len(COEFFICIENTS)))
    slopes[:, 0, 0], slopes[:, 0, 1], slopes[:, 1, 2] = 1.0, r, 1.0
    slopes[:, 0, TIME] = -(1 + range_scale) * np.einsum("ni,ni->n", position, velocity) / r
    slopes[:, 1, TIME] = -(position[:, 0] * velocity[:, 2] - position[:, 2] * velocity[:, 0]) / (
        position[:, 0] ** 2 + position[:, 2] ** 2
    )
    slopes[:, :, TIME_RATE] = slopes[:, :, TIME] * since_middle_s[:, None]
    for key, column in _columns(position, since_middle_s).items():
        slopes[:, COORDINATES[key], COEFFICIENTS.index(key)] = column
    for k in set(np.flatnonzero(values)) - {*range(len(BIASES)), TIME_RATE}:
        errors -= values[k] * slopes[:, :, k]
    return errors, np.where(np.isfinite(errors)[..., None], slopes, 0.0)


def middle_s(pairs: MatchedPlots) -> float:
    """The middle of the plots' times, at which a drifting clock has the lag time_s."""
    return float(pairs.t_s.min() + pairs.t_s.max()) / 2


def smallest_sigmas(pairs: MatchedPlots) -> np.ndarray:
    """The last digits of ranges and bearings (2,)."""
    return MIN_RELATIVE_SIGMA * np.array([np.median(pairs.range_m), 1.0])


def _columns(position: np.ndarray, since_middle_s: np.ndarray) -> dict[str, np.ndarray]:
    """How plots (n,) at positions (n, 3) move with the coefficients of ERRORS, but for the clock."""
    x, y, z = position.T
    ground = np.hypot(x, z)
    r, b, elevation = np.hypot(ground, y), np.arctan2(z, x), y / ground
    from_centre = np.hypot(ground, EARTH_RADIUS_M + y)
    height = from_centre - EARTH_RADIUS_M
    return {
        "eccentricity_sin_rad": np.sin(b),
        "eccentricity_cos_rad": np.cos(b),
        "tilt_sin_rad": elevation * np.sin(b),
        "tilt_cos_rad": elevation * np.cos(b),
        "ground_share": EARTH_RADIUS_M * np.arctan2(ground, EARTH_RADIUS_M + y) - r,
        # Positions that lie too high are too far away by the share of the vertical there that is along the line.
        "height_m": -(r**2 + EARTH_RADIUS_M * y) / (from_centre * r),
        "range_m_at_100_km": (r / 1e5) ** 2,
        "range_sin_m": np.sin(b),
        "range_cos_m": np.cos(b),
        "range_rate": since_middle_s,
        "range_rate_2": since_middle_s**2,
        "range_per_height": height,
        "bearing_sin_2": np.sin(2 * b),
        "bearing_cos_2": np.cos(2 * b),
        "bearing_per_elevation": elevation,
        "bearing_per_range": r,
        "bearing_rate": since_middle_s,
        "bearing_per_height": height,
    }

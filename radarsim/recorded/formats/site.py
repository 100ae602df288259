"""A radar on the earth (WGS 84): what it sees of positions, and where its plots are. By pymap3d.

Local axes: x north, y up, z east, with the origin at the radar. Bearings are counted from north to east. Elevations are
those above the plane that is level at the radar; an aircraft far away and low lies below it.
"""

import math
import re
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from radarsim.errors import ConfigError
from radarsim.physics import frames
from radarsim.recorded.formats.records import needs

try:
    import pymap3d
except ImportError:
    pymap3d = None

CLOSE_M = 0.01  # to which a height is met when the elevation of a plot is looked for
ROUNDS = 20


class Antenna(NamedTuple):
    """The normal of an antenna: azimuth from north to east, elevation above the level, both in rad."""

    azimuth_rad: float
    elevation_rad: float


class Site:
    """Where the radar stands: latitude and longitude in degrees, height above the ellipsoid in m."""

    def __init__(self, latitude_deg: float, longitude_deg: float, height_m: float):
        if pymap3d is None:
            raise needs("pymap3d", "recordings")
        self.place = (latitude_deg, longitude_deg, height_m)

    def seen(self, columns: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Range, bearing, elevation, local position and, where speeds are known, radial velocity of positions (n,).

        A height that is not known is taken as 0, that of the sea.
        """
        lat, lon = columns["latitude_deg"], columns["longitude_deg"]
        height = np.nan_to_num(columns["altitude_m"], nan=0.0)
        east, north, up = pymap3d.geodetic2enu(lat, lon, height, *self.place)
        local = np.stack([north, up, east], axis=-1)
        return described(local) | {"velocity_mps": self._radial(columns, lat, lon, height)}

    def _radial(self, columns: dict[str, np.ndarray], lat: np.ndarray, lon: np.ndarray, h: np.ndarray) -> np.ndarray:
        """Radial velocities (n,) in m/s, positive where the range grows: speeds over ground, seen along the line."""
        up = np.nan_to_num(columns["up_mps"], nan=0.0)
        speed = np.stack(pymap3d.enu2uvw(columns["east_mps"], columns["north_mps"], up, lat, lon), axis=-1)
        target = np.stack(pymap3d.geodetic2ecef(lat, lon, h), axis=-1)
        line = target - np.stack(pymap3d.geodetic2ecef(*self.place))
        return np.einsum("ni,ni->n", speed, line) / np.linalg.norm(line, axis=-1)

    def local(self, range_m: np.ndarray, bearing_rad: np.ndarray, altitude_m: np.ndarray) -> np.ndarray:
        """Local positions (n, 3) of plots of slant range and bearing at a height (n,), all in m and rad.

        Not-a-number where the height is not known, or where no point of that range has it.
        """
        sine = np.zeros_like(range_m)
        bearing = np.degrees(bearing_rad)
        with np.errstate(invalid="ignore"):
            for _ in range(ROUNDS):
                height = pymap3d.aer2geodetic(bearing, np.degrees(np.arcsin(sine)), range_m, *self.place)[2]
                miss = altitude_m - height
                # A step of the sine lifts the point by nearly that part of the range.
                sine = np.clip(sine + miss / range_m, -1.0, 1.0)
                if not np.any(np.abs(miss[np.isfinite(miss)]) > CLOSE_M):
                    break
            sine = np.where(np.abs(miss) <= 10 * CLOSE_M, sine, np.nan)
        flat = range_m * np.sqrt(1 - sine**2)
        return np.stack([flat * np.cos(bearing_rad), range_m * sine, flat * np.sin(bearing_rad)], axis=-1)


def described(local: np.ndarray) -> dict[str, np.ndarray]:
    """Range, bearing, elevation above the level and the coordinates of local positions (n, 3) in m."""
    x, y, z = local.T
    r = np.linalg.norm(local, axis=-1)
    with np.errstate(invalid="ignore", divide="ignore"):
        elevation = np.arcsin(y / r)
    return {
        "range_m": r,
        "bearing_rad": np.arctan2(z, x) % (2 * math.pi),
        "level_elevation_rad": elevation,
        "x_m": x,
        "y_m": y,
        "z_m": z,
    }


def biconical(local: np.ndarray, antenna: Antenna) -> dict[str, np.ndarray]:
    """The angles to an antenna's axes of local positions (n, 3), rad; not-a-number behind the antenna."""
    placed = frames.to_antenna(local, frames.rotation(*antenna), 0.0)
    r = np.linalg.norm(placed, axis=-1)
    with np.errstate(invalid="ignore", divide="ignore"):
        angles = np.arcsin(placed[:, 1:] / r[:, None])
    angles[~(placed[:, 0] > 0)] = np.nan
    return {"elevation_rad": angles[:, 0], "azimuth_rad": angles[:, 1]}


def site_of(text: str) -> Site:
    """The site of `LAT,LON,HEIGHT` (degrees, degrees, m); raises ConfigError."""
    try:
        latitude, longitude, height = (float(part) for part in text.split(","))
    except ValueError:
        raise ConfigError(f"at: must be LATITUDE,LONGITUDE,HEIGHT in degrees, degrees, m; got {text!r}") from None
    faults = []
    if not -90 <= latitude <= 90:
        faults.append(f"at: the latitude must be from -90 to 90 degrees, got {latitude:g}")
    if not -180 <= longitude <= 360:
        faults.append(f"at: the longitude must be from -180 to 360 degrees, got {longitude:g}")
    if not -500 <= height <= 100e3:
        faults.append(f"at: the height must be from -500 to 100000 m, got {height:g}")
    if faults:
        raise ConfigError(*faults)
    return Site(latitude, longitude, height)


def sites_of(texts: Sequence[str]) -> tuple[Site | None, dict[str, Site]]:
    """The site of the one radar, `LAT,LON,HEIGHT`, or of each of several, `SAC/SIC=LAT,LON,HEIGHT`."""
    named = {name.strip(): site_of(place) for name, sign, place in (text.partition("=") for text in texts) if sign}
    plain = [text for text in texts if "=" not in text]
    if len(plain) > 1 or (plain and named):
        raise ConfigError(
            f"at: must be one LAT,LON,HEIGHT, or SAC/SIC=LAT,LON,HEIGHT of each radar; got {' '.join(texts)}"
        )
    if faults := [name for name in named if not re.fullmatch(r"\d{1,3}/\d{1,3}", name)]:
        raise ConfigError(*(f"at: SAC/SIC must be two numbers, as 25/12; got {name!r}" for name in faults))
    return (site_of(plain[0]) if plain else None), named


def antenna_of(text: str) -> Antenna:
    """The antenna of `AZIMUTH,ELEVATION` in degrees; raises ConfigError."""
    try:
        azimuth, elevation = (float(part) for part in text.split(","))
    except ValueError:
        raise ConfigError(f"antenna: must be AZIMUTH,ELEVATION in degrees, got {text!r}") from None
    if not (-360 <= azimuth <= 360 and -90 <= elevation <= 90):
        raise ConfigError(
            f"antenna: must be an azimuth from -360 to 360 and an elevation from -90 to 90 degrees, got {text!r}"
        )
    return Antenna(math.radians(azimuth), math.radians(elevation))

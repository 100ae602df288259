"""A radar on the earth (WGS 84): measurements of positions, and positions of its plots (by pymap3d).

Local axes: x north, y up,
z east, with the origin at the radar. Bearings are counted from north to east. Elevations are above the plane that is
level at the radar; an aircraft far away and low lies below it."""

import math
import re
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from radarsim.errors import ConfigError
from radarsim.physics import frames
from radarsim.recordings.formats.records import missing_package

try:
    import pymap3d
except ImportError:
    pymap3d = None

HEIGHT_ACCURACY_M = 0.01  # accuracy of the height when the elevation of a plot is computed
MAX_ROUNDS = 20


class Antenna(NamedTuple):
    """The normal of an antenna: azimuth from north to east, elevation above the level, both in rad."""

    azimuth_rad: float
    elevation_rad: float


class Site:
    """The site of a radar: latitude and longitude in degrees, height above the ellipsoid in m."""

    def __init__(self, latitude_deg: float, longitude_deg: float, height_m: float):
        if pymap3d is None:
            raise missing_package("pymap3d", "recordings")
        self.coordinates = (latitude_deg, longitude_deg, height_m)

    def distance_m(self, other_site: "Site") -> float:
        """The distance to another site, m."""
        return math.dist(pymap3d.geodetic2ecef(*self.coordinates), pymap3d.geodetic2ecef(*other_site.coordinates))

    def _axes(self) -> np.ndarray:
        """North, up and east (3, 3) in the axes of the earth."""
        units = ((0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (1.0, 0.0, 0.0))  # each east, north, up
        return np.array([pymap3d.enu2uvw(*unit, *self.coordinates[:2]) for unit in units])

    def rotate_states(self, other_site: "Site", states: np.ndarray) -> np.ndarray:
        """Positions and speeds (…, 6) in this site's local axes, from those in another site's."""
        rotation = other_site._axes() @ self._axes().T
        shift = (
            np.subtract(pymap3d.geodetic2ecef(*other_site.coordinates), pymap3d.geodetic2ecef(*self.coordinates))
            @ self._axes().T
        )
        return np.concatenate([states[..., :3] @ rotation + shift, states[..., 3:] @ rotation], axis=-1)

    def measure(self, columns: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Range, bearing, elevation, local position and, where speeds are known, radial velocity of positions (n,). An
        unknown height is taken as 0, sea level."""
        lat, lon = columns["latitude_deg"], columns["longitude_deg"]
        height = np.nan_to_num(columns["altitude_m"], nan=0.0)
        east, north, up = pymap3d.geodetic2enu(lat, lon, height, *self.coordinates)
        local = np.stack([north, up, east], axis=-1)
        return position_columns(local) | {"velocity_mps": self._radial(columns, lat, lon, height)}

    def _radial(self, columns: dict[str, np.ndarray], lat: np.ndarray, lon: np.ndarray, h: np.ndarray) -> np.ndarray:
        """Radial velocities (n,) in m/s, positive where the range grows: speeds over ground, seen along the line."""
        up = np.nan_to_num(columns["up_mps"], nan=0.0)
        velocity = np.stack(pymap3d.enu2uvw(columns["east_mps"], columns["north_mps"], up, lat, lon), axis=-1)
        target = np.stack(pymap3d.geodetic2ecef(lat, lon, h), axis=-1)
        line_of_sight = target - np.stack(pymap3d.geodetic2ecef(*self.coordinates))
        return np.einsum("ni,ni->n", velocity, line_of_sight) / np.linalg.norm(line_of_sight, axis=-1)

    def local_positions(self, range_m: np.ndarray, bearing_rad: np.ndarray, altitude_m: np.ndarray) -> np.ndarray:
        """Local positions (n, 3) of plots of slant range and bearing at a height (n,), all in m and rad. NaN where the
        height is unknown, or where no point of that range has it."""
        sine = np.zeros_like(range_m)
        bearing = np.degrees(bearing_rad)
        with np.errstate(invalid="ignore"):
            for _ in range(MAX_ROUNDS):
                height = pymap3d.aer2geodetic(bearing, np.degrees(np.arcsin(sine)), range_m, *self.coordinates)[2]
                height_error = altitude_m - height
                # A step of the sine lifts the point by nearly that part of the range.
                sine = np.clip(sine + height_error / range_m, -1.0, 1.0)
                if not np.any(np.abs(height_error[np.isfinite(height_error)]) > HEIGHT_ACCURACY_M):
                    break
            sine = np.where(np.abs(height_error) <= 10 * HEIGHT_ACCURACY_M, sine, np.nan)
        ground_range = range_m * np.sqrt(1 - sine**2)
        return np.stack(
            [ground_range * np.cos(bearing_rad), range_m * sine, ground_range * np.sin(bearing_rad)], axis=-1
        )


def position_columns(local: np.ndarray) -> dict[str, np.ndarray]:
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


def antenna_angles(local: np.ndarray, antenna: Antenna) -> dict[str, np.ndarray]:
    """Elevation and azimuth of local positions (n, 3) from an antenna's normal, rad; NaN behind the antenna."""
    in_antenna_axes = frames.to_antenna(local, frames.rotation(*antenna), 0.0)
    r = np.linalg.norm(in_antenna_axes, axis=-1)
    with np.errstate(invalid="ignore", divide="ignore"):
        angles = np.arcsin(in_antenna_axes[:, 1:] / r[:, None])
    angles[~(in_antenna_axes[:, 0] > 0)] = np.nan
    return {"elevation_rad": angles[:, 0], "azimuth_rad": angles[:, 1]}


def parse_site(text: str) -> Site:
    """The site of `LAT,LON,HEIGHT` (degrees, degrees, m); raises ConfigError."""
    try:
        latitude, longitude, height = (float(part) for part in text.split(","))
    except ValueError:
        raise ConfigError(f"at: must be LATITUDE,LONGITUDE,HEIGHT in degrees, degrees, m; got {text!r}") from None
    limits = (("latitude", -90, 90, "degrees"), ("longitude", -180, 360, "degrees"), ("height", -500, 100_000, "m"))
    limited_values = zip(limits, (latitude, longitude, height), strict=True)
    if faults := [(*limit, value) for limit, value in limited_values if not limit[1] <= value <= limit[2]]:
        raise ConfigError(*("at: the {} must be from {} to {} {}, got {:g}".format(*fault) for fault in faults))
    return Site(latitude, longitude, height)


def parse_sites(texts: Sequence[str]) -> tuple[Site | None, dict[str, Site]]:
    """The site of the only radar, `LAT,LON,HEIGHT`, or of each of several radars, `SAC/SIC=LAT,LON,HEIGHT`."""
    sites_by_name = {
        name.strip(): parse_site(place) for name, sign, place in (text.partition("=") for text in texts) if sign
    }
    unnamed = [text for text in texts if "=" not in text]
    if len(unnamed) > 1 or (unnamed and sites_by_name) or len(unnamed) + len(sites_by_name) < len(texts):
        must = "must be one LAT,LON,HEIGHT, or SAC/SIC=LAT,LON,HEIGHT of each radar, once"
        raise ConfigError(f"at: {must}; got {' '.join(texts)}")
    if faults := [name for name in sites_by_name if not re.fullmatch(r"\d{1,3}/\d{1,3}", name)]:
        raise ConfigError(*(f"at: SAC/SIC must be two numbers, as 25/12; got {name!r}" for name in faults))
    return (parse_site(unnamed[0]) if unnamed else None), sites_by_name


def parse_antenna(text: str) -> Antenna:
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

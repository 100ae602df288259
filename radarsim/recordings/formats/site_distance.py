"""Positions that cannot be seen from a radar: of no fix, or with swapped or turned coordinates."""

import math
from collections import Counter
from collections.abc import Mapping

import numpy as np

from radarsim.constants import EARTH_RADIUS_M
from radarsim.language.translate import term, tr
from radarsim.recordings.formats.records import POSITIONS, Batch
from radarsim.recordings.formats.sites import Site
from radarsim.recordings.formats.table_checks import horizon_m
from radarsim.recordings.formats.units import degrees_of_minutes

MAX_RADAR_DISTANCE_M = 1e6  # of a target that a radar sees along a straight line: an aircraft at 20 km from a mountain
MAX_SWAPPED_M, MIN_SWAPPED_SHARE = 500e3, 0.1  # of positions with swapped coordinates; of all
MAX_NAMED = 3  # tracks
MAX_KEPT_ROWS = 2000  # from which the cause is told
BELOW_HORIZON, MIN_HIDDEN_M = 1.2, 200e3  # horizons, and least distance, from which a target is hidden
MIN_HIDDEN_SHARE = 0.95  # of the positions
NO_FIX_REASON = term("positions at 0°, 0°, which stand for no fix")


def without_no_fix(batch: Batch, site: Site | None) -> tuple[Batch, int]:
    """A batch without the positions at latitude and longitude 0, and how many these are; all of a radar near it."""
    if batch.kind != POSITIONS or site is None:
        return batch, 0
    is_zero = (batch.columns["latitude_deg"] == 0) & (batch.columns["longitude_deg"] == 0)
    if not is_zero.any() or _distance_m(*site.coordinates[:2], np.zeros(1), np.zeros(1))[0] < MAX_RADAR_DISTANCE_M:
        return batch, 0
    return batch.rows(np.flatnonzero(~is_zero).tolist()), int(is_zero.sum())


class SiteDistance:
    """How far positions lie from the radar."""

    def __init__(self, site: Site):
        self.latitude_deg, self.longitude_deg = site.coordinates[:2]
        self.rows = self.near_rows = 0
        self.swapped_rows = Counter[str]()  # far ones of tracks, near where latitude and longitude are swapped
        self.far_km = self.swapped_km = math.nan
        self.sample: list[np.ndarray] = []

    def add(self, batch: Batch) -> None:
        """Count the positions of a batch that are near the radar."""
        lat, lon = batch.columns["latitude_deg"], batch.columns["longitude_deg"]
        if self.rows < MAX_KEPT_ROWS:
            self.sample.append(np.stack([lat, lon, batch.columns["altitude_m"]]))
        self.rows += len(lat)
        distance = _distance_m(self.latitude_deg, self.longitude_deg, lat, lon)
        self.near_rows += int((distance < MAX_RADAR_DISTANCE_M).sum())
        if not (far := np.flatnonzero(distance >= MAX_RADAR_DISTANCE_M)).size:
            return
        swapped = _distance_m(self.latitude_deg, self.longitude_deg, lon[far], lat[far])
        is_swapped = swapped < MAX_SWAPPED_M
        for name, is_near in zip((batch.track[row] for row in far), is_swapped.tolist(), strict=True):
            self.swapped_rows[name] += is_near
        if is_swapped.any():
            self.far_km = float(np.median(distance[far][is_swapped])) / 1e3
            self.swapped_km = float(np.median(swapped[is_swapped])) / 1e3

    def notes(self) -> list[str]:
        """A note on tracks of swapped coordinates beside others, if they are not few."""
        names = [name for name, count in self.swapped_rows.items() if count]
        count = self.swapped_rows.total()
        if not self.near_rows or count < MIN_SWAPPED_SHARE * self.rows:
            return []
        return [tr("{count} of {all} positions, of {names}, lie {far:.0f} km from the radar; {near:.0f} km if latitude "
                   "and longitude are swapped there", count=count, all=self.rows,
                   names=", ".join(names[:MAX_NAMED]) + " …" * (len(names) > MAX_NAMED),
                   far=self.far_km, near=self.swapped_km)]  # fmt: skip

    def fault(self) -> str | None:
        """That no position is near the radar, and what would explain it: coordinates that are swapped, turned in sign,
        or in radians."""
        if not self.rows:
            return None
        lat, lon, height = np.concatenate(self.sample, axis=1)
        signs = {
            "the longitude has the other sign, in the recording or in --at": (lat, -lon),
            "the latitude has the other sign, in the recording or in --at": (-lat, lon),
            "both have the other sign, in the recording or in --at": (-lat, -lon),
        }
        if self.near_rows:
            return self._sign_fault(lat, lon, height, signs)
        changes = signs | {
            "latitude and longitude are swapped, in the recording or in --at": (lon, lat),
            "they are in radians (--column latitude_rad=NAME --column longitude_rad=NAME)": (
                np.degrees(lat),
                np.degrees(lon),
            ),
            "they are degrees and minutes (--column latitude_ddmm=NAME --column longitude_ddmm=NAME)": (
                degrees_of_minutes(lat),
                degrees_of_minutes(lon),
            ),
        }
        distances = {cause: self._median_m(*place) for cause, place in changes.items()}
        cause = min(distances, key=distances.__getitem__)
        far = (f"at: the positions lie {self._median_m(lat, lon) / 1e3:.0f} km from it (median), none within "
               f"{MAX_RADAR_DISTANCE_M / 1e3:.0f} km")  # fmt: skip
        if distances[cause] > MAX_RADAR_DISTANCE_M:
            return f"{far}, as far as a radar sees"
        return f"{far}; {distances[cause] / 1e3:.0f} km if {cause}"

    def _sign_fault(
        self, lat: np.ndarray, lon: np.ndarray, height: np.ndarray, signs: Mapping[str, tuple[np.ndarray, np.ndarray]]
    ) -> str | None:
        """That the positions lie below the radar's horizon, and above it with the other sign."""
        horizon = horizon_m(np.nan_to_num(height, nan=0.0))
        distance = _distance_m(self.latitude_deg, self.longitude_deg, lat, lon)
        if (distance > np.maximum(BELOW_HORIZON * horizon, MIN_HIDDEN_M)).mean() < MIN_HIDDEN_SHARE:
            return None
        for cause, (other_lat, other_lon) in signs.items():
            other_distance = _distance_m(self.latitude_deg, self.longitude_deg, other_lat, other_lon)
            if (other_distance < horizon).mean() >= MIN_HIDDEN_SHARE:
                far, near = (np.median(metres) / 1e3 for metres in (distance, other_distance))
                return (f"at: the positions lie {far:.0f} km from it (median), below its horizon; {near:.0f} km if "
                        f"{cause}")  # fmt: skip
        return None

    def _median_m(self, lat: np.ndarray, lon: np.ndarray) -> float:
        return float(np.median(_distance_m(self.latitude_deg, self.longitude_deg, lat, lon)))


def _distance_m(latitude_deg: float, longitude_deg: float, lat: np.ndarray, lon: np.ndarray) -> np.ndarray:
    """Distances (n,) along a sphere (haversine), m."""
    lat_0, lon_0, lat, lon = (np.radians(angle) for angle in (latitude_deg, longitude_deg, lat, lon))
    is_place = np.abs(lat) <= math.pi / 2  # not a longitude in its place
    haversine = np.sin((lat - lat_0) / 2) ** 2 + np.cos(lat_0) * np.cos(lat) * np.sin((lon - lon_0) / 2) ** 2
    distances = 2 * EARTH_RADIUS_M * np.arcsin(np.sqrt(np.clip(haversine, 0.0, 1.0)))
    return np.where(is_place, distances, np.inf)

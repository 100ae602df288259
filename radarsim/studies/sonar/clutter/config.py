"""Keys of tracks among false and missed plots (P3): the surveyed sector, and what makes a filter a tracker."""

import math
from typing import Annotated, Literal

from pydantic import Field

from radarsim.config.fields import Design, Model, NonNegative, Number, Positive, Probability, at, cross_check, whole

FIGURES = ("track_map", "confirmation", "track_life", "false_tracks", "track_classes")
MOST_FALSE = 1e7  # in a scan of the whole sector
DEFAULTS = {
    "gate_probability": 0.99,
    "drop_after_misses": 3,
    "speed_mps": 10.0,
    "lost_beyond_sigmas": 10.0,
}


class Sector(Model):
    """The surveyed sector: false plots lie in it, and a target outside it is not seen."""

    range_m: tuple[NonNegative, Positive] = Field(description="nearest and farthest range, m")
    bearing_rad: tuple[Number, Number] = Field(description="first and last bearing, from north to east, rad")

    @cross_check
    def _order(self):
        if self.range_m[1] <= self.range_m[0]:
            yield at("range_m", "must be a smaller and a larger range")
        if not 0 < self.bearing_rad[1] - self.bearing_rad[0] <= 2 * math.pi + 1e-9:
            yield at("bearing_rad", "must be a smaller and a larger bearing, at most a full circle apart")

    def area_m2(self) -> float:
        """Its area, m²."""
        return (self.bearing_rad[1] - self.bearing_rad[0]) * (self.range_m[1] ** 2 - self.range_m[0] ** 2) / 2


class Surveyed(Model):
    """What a sonar among false plots has beside: how many they are, and where."""

    false_plots_per_km2: Annotated[NonNegative, Field(le=1e4), Design()] = Field(
        0.0, description="mean number of false plots a scan, per km² of the surveyed sector"
    )
    sector: Annotated[Sector | None, Design()] = Field(
        None, description="the surveyed sector, of filters with an association; outside it there are no plots"
    )


class Initiation(Model):
    """A track is confirmed once m of its first n scans, that of its first plot among them, gave it a plot."""

    m: whole(2, 20) = Field(description="plots that confirm a track")
    n: whole(2, 20) = Field(description="scans within which they must come, the first plot's among them")

    @cross_check
    def _order(self):
        if self.n < self.m:
            yield at("n", f"must be >= {self.m}, the plots that confirm a track")


class Tracking(Model):
    """What a filter that has to find its plots among false ones needs; without `association` none of it."""

    association: Literal["nearest", "pda", "known"] | None = Field(
        None,
        description="how plots are chosen: the nearest in the gate, probabilistic data association, or known by oracle",
    )
    gate_probability: Annotated[Probability, Field(gt=0)] | None = Field(
        None, description="probability that the gate holds the target's plot; 1: open; default 0.99"
    )
    initiation: Initiation | None = Field(None, description="m of n; default 3 of 4")
    drop_after_misses: whole(1, 1000) | None = Field(
        None, description="scans in a row without a plot after which a confirmed track is dropped; default 3"
    )
    speed_mps: Positive | None = Field(
        None,
        description="standard deviation of a target's speed in each direction, m/s, for the second gate; default 10",
    )
    lost_beyond_sigmas: Positive | None = Field(
        None,
        description="error, in standard deviations of a plot, beyond which a track has lost its target; default 10",
    )

    def tracker(self, key: str) -> float:
        """A number of the tracker, its default where it is not given."""
        given = getattr(self, key)
        return DEFAULTS[key] if given is None else given

    def m_of_n(self) -> tuple[int, int]:
        """The rule of initiation."""
        return (self.initiation.m, self.initiation.n) if self.initiation else (3, 4)

    @cross_check
    def _belongs_to_tracker(self):
        for key in (*DEFAULTS, "initiation"):
            if self.association is None and getattr(self, key) is not None:
                yield at(key, "belongs to a filter with an association: nearest, pda or known")

    @cross_check
    def _kalman_line(self):
        if self.association is not None and (self.kind != "kalman" or self.degree != 1):
            yield at("association", "needs a filter of kind kalman and degree 1")


def tracker_misfits(spec):
    """Faults of a sonar case whose filters are trackers; of one that has false plots and no tracker."""
    sensor, some = spec.sensor, [f.association is not None for f in spec.filters]
    if any(some) and not all(some):
        yield at(f"filters.{some.index(False)}.association", "is needed where another filter has one")
    if not any(some):
        if sensor.false_plots_per_km2:
            yield at("filters.0.association", "is needed among false plots: nearest, pda or known")
        return
    if sensor.sector is None:
        yield at("sensor.sector", "is needed by filters with an association")
    elif sensor.false_plots_per_km2 * sensor.sector.area_m2() / 1e6 > MOST_FALSE:
        yield at("sensor.false_plots_per_km2", f"must give at most {MOST_FALSE:.0e} false plots a scan in the sector")
    if spec.frame != "polar":
        yield at("frame", "must be polar for filters with an association")
    if sensor.error_correlation != 0.0:
        yield at("sensor.error_correlation", "must be 0 for filters with an association")
    if sensor.further:
        yield at("sensor.further", "must be empty for filters with an association")
    for key in ("sigma_depth_m", "sigma_elevation_rad"):
        if getattr(sensor, key) is not None:
            yield at(f"sensor.{key}", "must not be given for filters with an association: they track range and bearing")

"""Keys of tracks among false and missed plots (P3): the surveyed sector, and what turns a filter into a tracker."""

import math
from collections.abc import Iterator
from typing import Annotated, Literal

from pydantic import Field

from radarsim.config.fields import (
    PLAIN_SHARE,
    Added,
    At,
    Design,
    Model,
    NonNegative,
    Number,
    Positive,
    Probability,
    Whole,
    at,
    cross_check,
    key,
)
from radarsim.studies.sonar import config

FIGURES = ("track_map", "confirmation", "track_life", "false_tracks", "track_classes")
MOST_FALSE = 1e7  # in a scan of the whole sector
TRACKER = {"association": ("nearest", "pda", "known")}


class Sector(Model):
    """The surveyed sector, which contains all false plots; a target outside it is not detected."""

    range_m: tuple[NonNegative, Positive] = key("limits of range", "smallest and largest range, m")
    bearing_rad: tuple[Number, Number] = key("limits of bearing", "first and last bearing, from north to east, rad")

    @cross_check
    def _order(self) -> Iterator[At]:
        if self.range_m[1] <= self.range_m[0]:
            yield at("range_m", "must be a smaller and a larger range")
        if not 0 < self.bearing_rad[1] - self.bearing_rad[0] <= 2 * math.pi + 1e-9:
            yield at("bearing_rad", "must be a smaller and a larger bearing, at most a full circle apart")

    def area_m2(self) -> float:
        """The area of the sector, m²."""
        return (self.bearing_rad[1] - self.bearing_rad[0]) * (self.range_m[1] ** 2 - self.range_m[0] ** 2) / 2


class Sensor(config.Sensor):
    """A sonar among false plots: how many there are, and where."""

    false_plots_per_km2: Annotated[NonNegative, Field(le=1e4), Design()] = key(
        "false plots per scan",
        "mean number of false plots a scan, per km² of the surveyed sector",
        0.0,
        symbol="λ",
        unit="km⁻²",
    )
    sector: Annotated[Sector | None, Design()] = key(
        "surveyed sector", "the surveyed sector of filters with an association; there are no plots outside it", None
    )


class Initiation(Model):
    """A track is confirmed once m of its first n scans gave it a plot; the scan of its first plot counts."""

    m: Annotated[int, Whole(2, 20)] = key("plots that confirm a track", "number of plots that confirms a track")
    n: Annotated[int, Whole(2, 20)] = key(
        "scans of the confirmation rule", "number of scans, from that of the first plot on, within which they must come"
    )

    @cross_check
    def _order(self) -> Iterator[At]:
        if self.n < self.m:
            yield at("n", f"must be >= {self.m}, the number of plots that confirms a track")


class Filter(config.Filter):
    """A filter that may have to find its plots among false ones; without `association` it does not."""

    association: Literal["nearest", "pda", "known"] | None = key(
        "association",
        "how plots are chosen: the nearest in the gate, probabilistic data association, or the target's own plots, "
        "as a reference",
        None,
    )
    gate_probability: Annotated[Probability, Field(gt=0)] | None = key(
        "gate probability",
        "probability that the gate contains the target's plot; 1: an open gate; default 0.99",
        0.99,
        symbol="P_G",
        only=TRACKER,
    )
    initiation: Initiation | None = key(
        "rule of confirmation", "the m of n rule of confirmation; default 3 of 4", None, only=TRACKER
    )
    drop_after_misses: Annotated[int, Whole(1, 1000)] | None = key(
        "misses that drop a track",
        "scans in a row without a plot after which a confirmed track is dropped; default 3",
        3,
        only=TRACKER,
    )
    speed_mps: Positive | None = key(
        "σ of a target's speed",
        "standard deviation of a target's speed in each direction, m/s, for the second gate; default 10",
        10.0,
        only=TRACKER,
    )
    lost_beyond_sigmas: Positive | None = key(
        "error of a lost track",
        "error, in standard deviations of a plot, beyond which a track has lost its target; default 10",
        10.0,
        unit="σ of a plot",
        only=TRACKER,
    )

    @property
    def rule(self) -> Initiation:
        """The rule of confirmation, given or by default."""
        return self.initiation or Initiation(m=3, n=4)

    @cross_check
    def _kalman_line(self) -> Iterator[At]:
        if self.association is not None and (self.kind != "kalman" or self.degree != 1):
            yield at("association", "needs a filter of kind kalman and degree 1")


Event = Literal["false_tracks", "long_false_tracks", "ended_tracks"]


class RareTracks(Model):
    """Events that are rare: realisations drawn where they are frequent, and weights that make up for it."""

    events: Annotated[tuple[Event, ...], Field(min_length=1)] = key(
        "events that are sought",
        "false_tracks: tracks that false plots begin, of all trackers, are drawn with more plots in their gates "
        "until they are confirmed; long_false_tracks: until they end; ended_tracks: further realisations of the "
        "target's track are drawn where it ends, with more misses, and worse or false plots while it is young",
    )

    def shares(self) -> tuple[float, float, float]:
        """Shares of the laws that false tracks are drawn from: as they are, so that they are confirmed, and held on."""
        laws = ("false_tracks", "long_false_tracks")
        each = (1.0 - PLAIN_SHARE) / max(sum(event in self.events for event in laws), 1)
        found, long = (each if event in self.events else 0.0 for event in laws)
        return PLAIN_SHARE, found, long

    @property
    def seeks_false_tracks(self) -> bool:
        """Whether false tracks are drawn where they are confirmed, or held on."""
        return "false_tracks" in self.events or "long_false_tracks" in self.events

    @property
    def seeks_ends(self) -> bool:
        """Whether the target's track is drawn where it ends."""
        return "ended_tracks" in self.events

    @cross_check
    def _differ(self) -> Iterator[At]:
        if len(set(self.events)) < len(self.events):
            yield at("events", f"must differ: {self.events[0]} is there twice")


class Keys(config.Keys):
    """The keys of a case whose filters may be trackers."""

    sensor: Sensor = key("sensor", "the sonar")
    filters: tuple[Filter, ...]
    rare: Annotated[RareTracks | None, Design(), Added()] = key(
        "rare events",
        "importance sampling of false tracks, for trackers that hardly have any, and of the target's track, for "
        "those that hardly lose it: rare.csv",
        None,
    )

    @cross_check
    def _rare_fits(self) -> Iterator[At]:
        if self.rare is None:
            return
        kinds = {member.association for member in self.filters}
        if not kinds & {"nearest", "pda"}:
            yield at("rare", "needs a filter that has to find its plots, with association nearest or pda")
        elif self.rare.seeks_false_tracks and not self.sensor.false_plots_per_km2:
            yield at("rare", "needs false plots: sensor.false_plots_per_km2 must be > 0")
        elif self.rare.seeks_ends and self.sensor.detection_probability == 1:
            yield at(
                "rare.events", "ended_tracks needs plots that are missed: sensor.detection_probability must be < 1"
            )

    @cross_check
    def _trackers_fit(self) -> Iterator[At]:
        tracking = [member.association is not None for member in self.filters]
        if any(tracking) and not all(tracking):
            yield at(f"filters.{tracking.index(False)}.association", "is needed where another filter has one")
        if any(tracking):
            yield from self._tracked_sensor()
        elif self.sensor.false_plots_per_km2:
            yield at("filters.0.association", "is needed among false plots: nearest, pda or known")

    def _tracked_sensor(self) -> Iterator[At]:
        sensor = self.sensor
        if sensor.sector is None:
            yield at("sensor.sector", "is needed by filters with an association")
        elif sensor.false_plots_per_km2 * sensor.sector.area_m2() / 1e6 > MOST_FALSE:
            message = f"must give at most {MOST_FALSE:.0e} false plots a scan in the sector"
            yield at("sensor.false_plots_per_km2", message)
        if self.frame != "polar":
            yield at("frame", "must be polar for filters with an association")
        if sensor.error_correlation != 0.0:
            yield at("sensor.error_correlation", "must be 0 for filters with an association")
        if sensor.further:
            yield at("sensor.further", "must be empty for filters with an association")
        for name in ("sigma_depth_m", "sigma_elevation_rad"):
            if getattr(sensor, name) is not None:
                message = "must not be given for filters with an association: they track range and bearing"
                yield at(f"sensor.{name}", message)

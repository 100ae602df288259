"""All keys of the sonar study, and the checks between them.

Smoothing is what all cases have. In addition there are detectors of manoeuvres, filters that respond to them and uses
of a track; and trackers, which have to find their plots among false ones in a surveyed sector."""

from collections.abc import Iterator
from typing import Annotated, Literal

from pydantic import AfterValidator, Field

from radarsim.config import cross_checks, marks, rare_event_keys, study_keys
from radarsim.config.cross_checks import CheckError, check_error, cross_check
from radarsim.config.key_types import WholeNumber, key
from radarsim.config.marks import DesignMark
from radarsim.config.model import Model
from radarsim.studies.sonar.detector_keys import Detector
from radarsim.studies.sonar.filter_keys import CORRELATED, RESPONDING_KINDS, Filter
from radarsim.studies.sonar.sensor_keys import MAX_SCANS, Sensor
from radarsim.studies.sonar.target_keys import Target
from radarsim.studies.sonar.use_keys import Uses

MAX_FALSE_PLOTS = 1e7  # in a scan of the whole sector
MAX_SCAN_THRESHOLDS = 200_000  # scans x thresholds of all detectors: 10 MB of sums a block
COMPONENTS = tuple(rate + coordinate for coordinate in "rbxyde" for rate in ("", "v", "a"))
FIGURES = (
    *(f"sigma_{name}" for name in COMPONENTS),
    *("plots", "smoothing_gains", "believed", "missed", "conversion"),
    *("roc", "detection", "delay", "modes", "uses"),
    *("track_map", "confirmation", "track_life", "false_tracks", "track_classes"),
)

Event = Literal["false_tracks", "long_false_tracks", "ended_tracks"]


class RareTracks(Model):
    """Events that are rare: realisations drawn where they are frequent, and weights that make up for it."""

    events: Annotated[tuple[Event, ...], Field(min_length=1)] = key(
        "events to sample",
        "false_tracks: tracks started by false plots, of all trackers, are drawn with more plots in "
        "their gates until they are confirmed; long_false_tracks: until they end; ended_tracks: further "
        "realisations of the target's track are drawn in which it ends, with more misses, and worse or "
        "false plots while it is young",
    )

    def shares(self) -> tuple[float, float, float]:
        """Shares of the laws that false tracks are drawn from: as they are, so that they are confirmed, and held on."""
        laws = ("false_tracks", "long_false_tracks")
        law_share = (1.0 - rare_event_keys.PLAIN_SHARE) / max(sum(event in self.events for event in laws), 1)
        confirmed_share, long_share = (law_share if event in self.events else 0.0 for event in laws)
        return rare_event_keys.PLAIN_SHARE, confirmed_share, long_share

    @property
    def seeks_false_tracks(self) -> bool:
        """Whether false tracks are drawn where they are confirmed, or held on."""
        return "false_tracks" in self.events or "long_false_tracks" in self.events

    @property
    def seeks_ends(self) -> bool:
        """Whether the target's track is drawn where it ends."""
        return "ended_tracks" in self.events

    @cross_check
    def _differ(self) -> Iterator[CheckError]:
        if len(set(self.events)) < len(self.events):
            yield check_error("events", f"must differ: {self.events[0]} is there twice")


class Keys(study_keys.StudyKeys):
    """Sonar plots smoothed and extrapolated."""

    figure_names = FIGURES

    sensor: Sensor = key("sensor", "the sonar")
    target: Annotated[Target, marks.Scenario()] = key("target", "the target: the stem of a scenario, or inline")
    frame: Annotated[Literal["polar", "cartesian", "cartesian_unbiased"], DesignMark()] = key(
        "frame of coordinates",
        "coordinates of the filters; plots are converted to x, y plainly, or without bias",
        "polar",
    )
    filters: study_keys.Members[Filter] = key("filters", "the filters; all of them process the same plots")
    baseline: study_keys.Baseline = study_keys.BASELINE
    scans: Annotated[int, WholeNumber(2, MAX_SCANS), DesignMark()] = key(
        "number of scans", "number of scans of the first sonar"
    )
    detectors: Annotated[
        tuple[Detector, ...], Field(max_length=8), AfterValidator(study_keys.unique_names), DesignMark()
    ] = key("detectors", "manoeuvre detectors that are evaluated on the plots", ())
    uses: Annotated[Uses | None, DesignMark()] = key(
        "quantities derived from the track",
        "course, speed, predicted position and closest approach, with their σ; none: left out",
        None,
    )
    rare: Annotated[RareTracks | None, DesignMark(), marks.LaterKeyMark()] = key(
        "rare events",
        "importance sampling of false tracks, for trackers that hardly have any, and of the target's track, for "
        "those that hardly lose it: rare.csv",
        None,
    )

    @property
    def parts(self) -> tuple[Literal["smoothing", "manoeuvre", "clutter"], ...]:
        """The parts whose questions a case asks; the part that computes it comes last.

        `clutter`: its filters have to find their plots among false ones. `manoeuvre`: it measures detectors or uses of
        a track, or has filters that respond to manoeuvres; it answers the questions of `smoothing` too.
        """
        if any(member.association is not None for member in self.filters):
            return ("clutter",)
        return ("smoothing", "manoeuvre") if any(self.about_manoeuvres()) else ("smoothing",)

    @cross_check
    def _manoeuvres_of_known_plots(self) -> Iterator[CheckError]:
        if "clutter" in self.parts:
            for name in self.about_manoeuvres():
                yield check_error(name, "does not go with filters that have an association")

    @cross_check
    def _long_enough(self) -> Iterator[CheckError]:
        min_scans = max(cross_checks.valid_values(self.filters, lambda member: member.degree), default=0) + 1
        if self.scans < min_scans:
            yield check_error("scans", f"must be >= {min_scans} for a filter of degree {min_scans - 1}")

    @cross_check
    def _misses_within_scans(self) -> Iterator[CheckError]:
        if any(scan > self.scans for scan in self.sensor.missed_scans):
            yield check_error("sensor.missed_scans", f"must be <= {self.scans}, the last scan")

    @cross_check
    def _target_measured(self) -> Iterator[CheckError]:
        for name, unit in (("depth", "m"), ("elevation", "rad")):
            measured = getattr(self.sensor, f"sigma_{name}_{unit}") is not None
            if measured and getattr(self.target, f"{name}_{unit}", None) is None:
                yield check_error("target", f"needs {name}_{unit}, which the sonar measures")

    @cross_check
    def _elevation_in_polar(self) -> Iterator[CheckError]:
        if self.frame != "polar" and self.sensor.sigma_elevation_rad is not None:
            yield check_error("frame", "must be polar where the elevation is measured")

    @cross_check
    def _further_in_polar(self) -> Iterator[CheckError]:
        if self.frame != "polar" and self.sensor.further:
            yield check_error("frame", "must be polar where there are further sonars")

    @cross_check
    def _fluctuating_in_polar(self) -> Iterator[CheckError]:
        if self.frame != "polar" and self.target.fluctuation_mps2:
            yield check_error("frame", "must be polar for a fluctuating target")

    @cross_check
    def _correlated_in_polar(self) -> Iterator[CheckError]:
        def check(i: int, member: Filter) -> Iterator[CheckError]:
            if member.kind in CORRELATED:
                yield check_error(f"filters.{i}.kind", f"{member.kind} works only in the polar frame")

        if self.frame != "polar":
            yield from cross_checks.check_each(self.filters, check)

    @cross_check
    def _rare_fits(self) -> Iterator[CheckError]:
        if self.rare is None:
            return
        kinds = {member.association for member in self.filters}
        if not kinds & {"nearest", "pda"}:
            yield check_error("rare", "needs a filter that has to find its plots, with association nearest or pda")
        elif self.rare.seeks_false_tracks and not self.sensor.false_plots_per_km2:
            yield check_error("rare", "needs false plots: sensor.false_plots_per_km2 must be > 0")
        elif self.rare.seeks_ends and self.sensor.detection_probability == 1:
            yield check_error(
                "rare.events", "ended_tracks needs plots that are missed: sensor.detection_probability must be < 1"
            )

    @cross_check
    def _trackers_fit(self) -> Iterator[CheckError]:
        tracking = [member.association is not None for member in self.filters]
        if any(tracking) and not all(tracking):
            yield check_error(f"filters.{tracking.index(False)}.association", "is needed where another filter has one")
        if any(tracking):
            yield from self._tracked_sensor()
        elif self.sensor.false_plots_per_km2:
            yield check_error("filters.0.association", "is needed among false plots: nearest, pda or known")

    def _tracked_sensor(self) -> Iterator[CheckError]:
        sensor = self.sensor
        if sensor.sector is None:
            yield check_error("sensor.sector", "is needed by filters with an association")
        elif sensor.false_plots_per_km2 * sensor.sector.area_m2() / 1e6 > MAX_FALSE_PLOTS:
            message = f"must give at most {MAX_FALSE_PLOTS:.0e} false plots a scan in the sector"
            yield check_error("sensor.false_plots_per_km2", message)
        if self.frame != "polar":
            yield check_error("frame", "must be polar for filters with an association")
        if sensor.error_correlation != 0.0:
            yield check_error("sensor.error_correlation", "must be 0 for filters with an association")
        if sensor.further:
            yield check_error("sensor.further", "must be empty for filters with an association")
        for name in ("sigma_depth_m", "sigma_elevation_rad"):
            if getattr(sensor, name) is not None:
                message = "must not be given for filters with an association: they track range and bearing"
                yield check_error(f"sensor.{name}", message)

    def about_manoeuvres(self) -> Iterator[str]:
        """The keys that make a case one about manoeuvres: detectors, uses, kinds of filters that respond."""
        if self.detectors:
            yield "detectors"
        if self.uses is not None:
            yield "uses"
        yield from (f"filters.{i}.kind" for i, member in enumerate(self.filters) if member.kind in RESPONDING_KINDS)

    @cross_check
    def _detectors_fit(self) -> Iterator[CheckError]:
        def check(i: int, detector: Detector) -> Iterator[CheckError]:
            if detector.plots > self.scans:
                yield check_error(f"detectors.{i}.plots", f"must be <= {self.scans}, the number of scans")

        yield from cross_checks.check_each(self.detectors, check)
        if (
            self.scans * sum(cross_checks.valid_values(self.detectors, lambda detector: len(detector.levels())))
            > MAX_SCAN_THRESHOLDS
        ):
            yield check_error(
                "detectors", f"must have at most {MAX_SCAN_THRESHOLDS // self.scans} thresholds for {self.scans} scans"
            )

    @cross_check
    def _uses_fit(self) -> Iterator[CheckError]:
        if self.uses is None:
            return
        last = (self.scans - 1) * self.sensor.scan_period_s
        if any(when > last for when in self.uses.at_s or ()):
            yield check_error("uses.at_s", f"must be <= {last:g}, the time of the last scan")
        if self.target.fluctuation_mps2:
            yield check_error("uses", "needs a target that does not move at random: its future is not known")

    @cross_check
    def _responses_fit(self) -> Iterator[CheckError]:
        def check(i: int, member: Filter) -> Iterator[CheckError]:
            if member.detector is not None and member.detector.plots > self.scans:
                yield check_error(f"filters.{i}.detector.plots", f"must be <= {self.scans}, the number of scans")

        yield from cross_checks.check_each(self.filters, check)

    @cross_check
    def _manoeuvres_of_one_sonar(self) -> Iterator[CheckError]:
        if self.sensor.further:
            for name in self.about_manoeuvres():
                yield check_error(name, "does not go with further sonars")

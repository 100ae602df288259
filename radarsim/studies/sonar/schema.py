"""Keys of the sonar study (P3), put together of those of its three parts; and which of the parts a case is of."""

from typing import Annotated, Literal

from pydantic import AfterValidator, Field

from radarsim.config.fields import (
    Design,
    Name,
    NameIn,
    Scenario,
    Study,
    at,
    cross_check,
    of_each,
    readable,
    unique_names,
    whole,
)
from radarsim.studies.sonar import config
from radarsim.studies.sonar.clutter import config as clutter
from radarsim.studies.sonar.config import CORRELATED, MOST_SCANS, Target
from radarsim.studies.sonar.manoeuvre import config as manoeuvre

COMPONENTS = tuple(rate + coordinate for coordinate in "rbxyde" for rate in ("", "v", "a"))


class Sensor(clutter.Surveyed, config.Sensor):
    """A sonar: accuracies of a plot, period, how plots are missed, and false ones."""


class Filter(config.Filter, manoeuvre.Adapting, clutter.Tracking):
    """A filter of each coordinate by itself."""


class Sonar(Study):
    """Sonar plots smoothed and extrapolated."""

    figure_names = (
        *(f"sigma_{name}" for name in COMPONENTS),
        *config.FIGURES,
        *manoeuvre.FIGURES,
        *clutter.FIGURES,
    )

    sensor: Sensor = Field(description="the sonar")
    target: Annotated[Target, Scenario()] = Field(description="the target: a scenario's stem, or inline")
    frame: Annotated[Literal["polar", "cartesian", "cartesian_unbiased"], Design()] = Field(
        "polar", description="frame that the filters work in; plots are converted to x, y plainly, or without bias"
    )
    filters: Annotated[
        tuple[Filter, ...], Field(min_length=1, max_length=16), AfterValidator(unique_names), Design()
    ] = Field(description="the filters; all see the same plots")
    baseline: Annotated[Name | None, Design(), NameIn("filters")] = Field(
        None, description="name of the filter that gains are against; default: the first"
    )
    scans: Annotated[whole(2, MOST_SCANS), Design()] = Field(description="number of scans of the first sonar")
    detectors: Annotated[manoeuvre.Detectors, Design()] = Field(
        (), description="detectors of manoeuvres, measured on the plots"
    )
    uses: Annotated[manoeuvre.Uses | None, Design()] = Field(
        None, description="course, speed, predicted position and closest approach, with their σ; none: left out"
    )

    @cross_check
    def _long_enough(self):
        most = max(readable(self.filters, lambda one: one.degree), default=0) + 1
        if self.scans < most:
            yield at("scans", f"must be >= {most} for a filter of degree {most - 1}")

    @property
    def parts(self) -> tuple[Literal["smoothing", "manoeuvre", "clutter"], ...]:
        """What is asked of a case; the part that computes it comes last.

        `clutter`: its filters have to find their plots among false ones. `manoeuvre`: it measures detectors or uses of
        a track, or has filters that respond to manoeuvres; whatever is asked of smoothing is asked of it too.
        """
        if any(one.association is not None for one in self.filters):
            return ("clutter",)
        return ("smoothing", "manoeuvre") if any(manoeuvre.asked(self)) else ("smoothing",)

    @cross_check
    def _manoeuvres_of_known_plots(self):
        if "clutter" in self.parts:
            for key in manoeuvre.asked(self):
                yield at(key, "does not go with filters that have an association")

    @cross_check
    def _trackers_fit(self):
        yield from clutter.tracker_misfits(self)

    @cross_check
    def _detectors_fit(self):
        yield from manoeuvre.detector_misfits(self)

    @cross_check
    def _uses_fit(self):
        yield from manoeuvre.uses_misfits(self)

    @cross_check
    def _responses_fit(self):
        yield from manoeuvre.response_misfits(self)

    @cross_check
    def _manoeuvres_of_one_sonar(self):
        yield from manoeuvre.further_misfits(self)

    @cross_check
    def _misses_within_scans(self):
        if any(scan > self.scans for scan in self.sensor.missed_scans):
            yield at("sensor.missed_scans", f"must be <= {self.scans}, the last scan")

    @cross_check
    def _target_measured(self):
        for key, unit in (("depth", "m"), ("elevation", "rad")):
            measured = getattr(self.sensor, f"sigma_{key}_{unit}") is not None
            if measured and getattr(self.target, f"{key}_{unit}", None) is None:
                yield at("target", f"needs {key}_{unit}, which the sonar measures")

    @cross_check
    def _elevation_in_polar(self):
        if self.frame != "polar" and self.sensor.sigma_elevation_rad is not None:
            yield at("frame", "must be polar where the elevation is measured")

    @cross_check
    def _further_in_polar(self):
        if self.frame != "polar" and self.sensor.further:
            yield at("frame", "must be polar where there are further sonars")

    @cross_check
    def _fluctuating_in_polar(self):
        if self.frame != "polar" and getattr(self.target, "fluctuation_mps2", 0.0):
            yield at("frame", "must be polar for a fluctuating target")

    @cross_check
    def _correlated_in_polar(self):
        def check(i: int, one: Filter):
            if one.kind in CORRELATED:
                yield at(f"filters.{i}.kind", f"{one.kind} works in the polar frame alone")

        if self.frame != "polar":
            yield from of_each(self.filters, check)

"""Keys of the sonar study (P3): a sonar of range and bearing, what it observes, and filters of degree 1 and 2."""

from typing import Annotated, Literal

from pydantic import AfterValidator, Field

from radarsim.config.fields import (
    Correlation,
    Design,
    Display,
    Model,
    Name,
    NameIn,
    NonNegative,
    Number,
    Positive,
    Probability,
    Scenario,
    Study,
    at,
    cross_check,
    of_each,
    readable,
    unique_names,
    whole,
)
from radarsim.studies.sonar.clutter.config import Sector, Tracking, tracker_misfits
from radarsim.studies.sonar.manoeuvre.config import (
    RESPONDING_KINDS,
    Accelerating,
    Adapting,
    Detectors,
    Uses,
    answer_misfits,
    detector_misfits,
    uses_misfits,
)

MOST_SCANS = 100_000
Wide = Annotated[Positive, Field(le=0.5)]  # rad: beyond some 30 degrees an angle's error is no longer Gaussian
Derivatives = Annotated[tuple[Number, ...], Field(min_length=1, max_length=12)]


class Correlations(Model):
    """A correlation for each coordinate; one that is not named has none."""

    range: Correlation = Field(0.0, description="correlation of the range's errors")
    bearing: Correlation = Field(0.0, description="correlation of the bearing's errors")
    third: Correlation = Field(0.0, description="correlation of the errors of depth or elevation")

    def of(self, index: int) -> float:
        """Of the coordinate of that number."""
        return (self.range, self.bearing, self.third)[index]


def correlation_of(value: "float | Correlations", index: int) -> float:
    """A scalar applies to every coordinate."""
    return value.of(index) if isinstance(value, Correlations) else value


class FurtherSensor(Model):
    """A second sonar that looks at the same target at times of its own, and may see the bearing alone."""

    sigma_range_m: Positive | None = Field(
        None, description="standard deviation of a measured range, m; none: not seen"
    )
    sigma_bearing_rad: Wide | None = Field(None, description="standard deviation of a measured bearing, rad")
    scan_period_s: Positive = Field(description="time between two of its plots, s")
    first_s: NonNegative = Field(description="time of its first plot after that of the first sonar, s")


class Sensor(Model):
    """A sonar: accuracies of a plot, period, and how plots fail."""

    name: Annotated[Name | None, Display()] = Field(None, description="display name")
    sigma_range_m: Positive = Field(description="standard deviation of a measured range, m")
    sigma_bearing_rad: Wide = Field(description="standard deviation of a measured bearing, rad")
    sigma_depth_m: Positive | None = Field(
        None, description="standard deviation of a measured depth, m; none: not measured"
    )
    sigma_elevation_rad: Wide | None = Field(None, description="of a measured elevation, rad, in place of the depth")
    scan_period_s: Positive = Field(description="time between two plots, s: T0 of the paper")
    error_correlation: Correlation | Correlations = Field(
        0.0, description="correlation ρ of the errors of neighbouring plots, eq. (15); one number, or by coordinate"
    )
    detection_probability: Annotated[Probability, Field(gt=0)] = Field(
        1.0,
        description="probability that the plot of a scan comes; that of the first scan always does, save for filters "
        "with an association",
    )
    missed_scans: tuple[whole(2, MOST_SCANS), ...] = Field(
        (), description="scans, counted from 1, whose plots never come"
    )
    further: tuple[FurtherSensor, ...] = Field((), max_length=4, description="further sonars on the same target")
    false_plots_per_km2: Annotated[NonNegative, Field(le=1e4), Design()] = Field(
        0.0, description="mean number of false plots a scan, per km² of the surveyed sector"
    )
    sector: Annotated[Sector | None, Design()] = Field(
        None, description="the surveyed sector, of filters with an association; outside it there are no plots"
    )

    @cross_check
    def _consistent(self):
        if self.sigma_depth_m is not None and self.sigma_elevation_rad is not None:
            yield at("sigma_elevation_rad", "give either the depth or the elevation")

    @cross_check
    def _further_fit(self):
        if self.further and self.error_correlation != 0.0:
            yield at("error_correlation", "must be 0 where there are further sonars: their errors are unconnected")

    @cross_check
    def _further_see(self):
        if self.further and self.detection_probability < 1:
            yield at("detection_probability", "must be 1 where there are further sonars; give missed_scans")


class Polynomial(Model):
    """Coordinates that are polynomials of time, in the polar or in the cartesian frame (eq. 1)."""

    kind: Literal["polynomial"] = Field(description="each coordinate a polynomial of time")
    frame: Literal["polar", "cartesian"] = Field(description="which coordinates are polynomials")
    range_m: Derivatives | None = Field(
        None, description="range and its derivatives at the first plot: m, m/s, m/s², …"
    )
    bearing_rad: Derivatives | None = Field(None, description="bearing and its derivatives, from north to east: rad, …")
    x_m: Derivatives | None = Field(None, description="way north and its derivatives: m, m/s, m/s², …")
    y_m: Derivatives | None = Field(None, description="way east and its derivatives: m, m/s, m/s², …")
    depth_m: Derivatives | None = Field(None, description="depth and its derivatives: m, m/s, …")
    elevation_rad: Derivatives | None = Field(None, description="elevation and its derivatives: rad, rad/s, …")
    fluctuation_mps2: NonNegative = Field(
        0.0,
        description="standard deviation of a random acceleration, new at every scan: velocity walks at random, m/s²",
    )

    @cross_check
    def _coordinates(self):
        wanted = ("range_m", "bearing_rad") if self.frame == "polar" else ("x_m", "y_m")
        other = ("x_m", "y_m") if self.frame == "polar" else ("range_m", "bearing_rad")
        for key in wanted:
            if getattr(self, key) is None:
                yield at(key, f"is needed in the {self.frame} frame")
        for key in other:
            if getattr(self, key) is not None:
                yield at(key, f"does not belong to the {self.frame} frame")

    @cross_check
    def _ahead(self):
        if self.frame == "polar" and self.range_m is not None and self.range_m[0] <= 0:
            yield at("range_m", "must begin with a positive range")

    @cross_check
    def _fluctuates(self):
        if self.frame == "cartesian" and self.fluctuation_mps2:
            yield at("fluctuation_mps2", "needs the polar frame")

    def range_0(self) -> float:
        """Range at the first plot, m: scales what is lateral to an angle."""
        if self.frame == "polar":
            return self.range_m[0]
        return max((self.x_m[0] ** 2 + self.y_m[0] ** 2) ** 0.5, 1.0)


class Leg(Model):
    """A turn between two moments."""

    start_s: NonNegative = Field(description="when the turn begins, s from the first plot")
    end_s: Positive = Field(description="when it ends, s")
    rate_radps: Number = Field(description="turn rate, rad/s, positive to starboard")

    @cross_check
    def _order(self):
        if self.end_s <= self.start_s:
            yield at("end_s", "must come after start_s")


class Turning(Model):
    """A vessel at constant speed on straight legs and turns."""

    kind: Literal["turning"] = Field(description="straight legs and turns at constant speed")
    x_m: Number = Field(description="way north of the sonar at the first plot, m")
    y_m: Number = Field(description="way east of the sonar at the first plot, m")
    speed_mps: Positive = Field(description="speed, m/s")
    course_rad: Number = Field(description="course at first, from north to east, rad")
    turns: Annotated[tuple[Leg, ...], Field(min_length=1, max_length=16)] = Field(description="the turns, in order")

    @cross_check
    def _in_order(self):
        if any(later.start_s < earlier.end_s for earlier, later in zip(self.turns, self.turns[1:], strict=False)):
            yield at("turns", "must follow one another without overlap")

    def range_0(self) -> float:
        """Range at the first plot, m."""
        return max((self.x_m**2 + self.y_m**2) ** 0.5, 1.0)


Target = Annotated[Polynomial | Turning | Accelerating, Field(discriminator="kind")]
CORRELATED = ("kalman_augmented", "kalman_differenced")


class Filter(Adapting, Tracking):
    """A filter of each coordinate by itself."""

    name: Annotated[Name, Display()] = Field(description="label, unlike that of any other filter")
    kind: Literal[
        *("growing_memory", "window", "kalman", "fixed_gain", "kalman_augmented", "kalman_differenced"),
        *("adaptive", "imm"),
    ] = Field(
        description="least squares on all plots or on the last few, Kalman, fixed gains, one that knows of ρ, one that "
        "answers to a detector of manoeuvres, or two Kalman filters that interact"
    )
    degree: Literal[1, 2] = Field(1, description="degree of the polynomial: 1 a straight line, 2 a parabola")
    plots: whole(2, 1000) | None = Field(
        None, description="length of a window; or of the least-squares start of fixed_gain, by default degree + 1"
    )
    manoeuvre_variance: NonNegative | None = Field(
        None,
        description="variance of a random acceleration, (m/s²)², of degree 2 of a random jerk, (m/s³)²; "
        "for angles divided by the square of the target's range at the start",
    )
    error_correlation: Correlation | Correlations | None = Field(
        None, description="correlation that the filter assumes; default: the sonar's own"
    )

    @cross_check
    def _fits_kind(self):
        if self.plots is None and self.kind == "window":
            yield at("plots", "is needed by a window")
        if self.plots is not None and self.kind not in ("window", "fixed_gain"):
            yield at("plots", "belongs to a window, or to the start of fixed_gain")
        elif self.plots is not None and self.plots < self.degree + 1:
            yield at("plots", f"must be >= {self.degree + 1} for degree {self.degree}")

    @cross_check
    def _variance_fits_kind(self):
        if self.kind == "fixed_gain" and not self.manoeuvre_variance:
            yield at("manoeuvre_variance", "must be > 0 for fixed_gain: it decides the steady gains")
        if self.manoeuvre_variance and self.kind not in ("fixed_gain", "kalman", "kalman_augmented"):
            yield at("manoeuvre_variance", f"{self.kind} allows for no manoeuvre; take kalman or kalman_augmented")

    @cross_check
    def _correlation_fits_kind(self):
        if self.error_correlation is not None and self.kind not in CORRELATED:
            yield at("error_correlation", f"only {' and '.join(CORRELATED)} know of it")


class Sonar(Study):
    """Sonar plots smoothed and extrapolated."""

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
    detectors: Annotated[Detectors, Design()] = Field((), description="detectors of manoeuvres, measured on the plots")
    uses: Annotated[Uses | None, Design()] = Field(
        None, description="course, speed, predicted position and closest approach, with their σ; none: left out"
    )

    @cross_check
    def _long_enough(self):
        most = max(readable(self.filters, lambda one: one.degree), default=0) + 1
        if self.scans < most:
            yield at("scans", f"must be >= {most} for a filter of degree {most - 1}")

    @property
    def tracking(self) -> bool:
        """Whether its filters have to find their plots among false ones."""
        return any(f.association is not None for f in self.filters)

    @property
    def manoeuvring(self) -> bool:
        """Whether it measures detectors or uses of a track, or has filters that answer to manoeuvres."""
        return bool(self.detectors or self.uses or any(f.kind in RESPONDING_KINDS for f in self.filters))

    @cross_check
    def _trackers_fit(self):
        yield from tracker_misfits(self)

    @cross_check
    def _detectors_fit(self):
        yield from detector_misfits(self)

    @cross_check
    def _uses_fit(self):
        yield from uses_misfits(self)

    @cross_check
    def _answers_fit(self):
        yield from answer_misfits(self)

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

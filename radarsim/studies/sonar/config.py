"""Keys of the sonar study (P3) that its parts share: the sonar, what it observes, filters of degree 1 and 2."""

from typing import Annotated, Literal

from pydantic import Field

from radarsim.config.fields import (
    Correlation,
    Display,
    Model,
    Name,
    NonNegative,
    Number,
    Positive,
    Probability,
    at,
    cross_check,
    whole,
)

MOST_SCANS = 100_000
FIGURES = ("plots", "smoothing_gains", "believed", "missed", "conversion")  # beside σ of each component
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
    """A sonar: accuracies of a plot, period, and how plots are missed."""

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


class Accelerating(Model):
    """A vessel on a straight course whose speed changes at a constant rate between two moments."""

    kind: Literal["accelerating"] = Field(description="straight course, a step of acceleration along it")
    x_m: Number = Field(description="way north of the sonar at the first plot, m")
    y_m: Number = Field(description="way east of the sonar at the first plot, m")
    speed_mps: NonNegative = Field(description="speed at first, m/s")
    course_rad: Number = Field(description="course, from north to east, rad")
    acceleration_mps2: Number = Field(description="along the course while it lasts, m/s²; 0: no manoeuvre")
    start_s: NonNegative = Field(description="when the acceleration begins, s from the first plot")
    end_s: Positive | None = Field(None, description="when it ends, s; none: it lasts")

    @cross_check
    def _order(self):
        if self.end_s is not None and self.end_s <= self.start_s:
            yield at("end_s", "must come after start_s")

    def range_0(self) -> float:
        """Range at the first plot, m."""
        return max((self.x_m**2 + self.y_m**2) ** 0.5, 1.0)


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


class Filter(Model):
    """A filter of each coordinate by itself, as far as all have the same keys."""

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

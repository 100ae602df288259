"""Keys that all parts of the sonar study (P3) share: the sonar, the target, filters of degree 1 and 2."""

from collections.abc import Iterator
from typing import Annotated, ClassVar, Literal

from pydantic import Field

from radarsim.config.fields import (
    At,
    Baseline,
    Correlation,
    Design,
    Display,
    Model,
    Name,
    NonNegative,
    Number,
    Positive,
    Probability,
    Scenario,
    Study,
    Whole,
    at,
    cross_check,
    key,
    of_each,
    readable,
)

MOST_SCANS = 100_000
FIGURES = ("plots", "smoothing_gains", "believed", "missed", "conversion")  # in addition to σ of each component
AngleSigma = Annotated[Positive, Field(le=0.5)]  # rad: beyond about 30 degrees the error of an angle is not Gaussian
Derivatives = Annotated[tuple[Number, ...], Field(min_length=1, max_length=12)]


class Correlations(Model):
    """A correlation for each coordinate; zero where none is given."""

    range: Correlation = key("correlation of errors in range", "correlation of the errors in range", 0.0)
    bearing: Correlation = key("correlation of errors in bearing", "correlation of the errors in bearing", 0.0)
    third: Correlation = key(
        "correlation of errors in depth or elevation", "correlation of the errors in depth or elevation", 0.0
    )

    def of(self, index: int) -> float:
        """The correlation of one coordinate, by its number."""
        return (self.range, self.bearing, self.third)[index]


def correlation_of(value: "float | Correlations", index: int) -> float:
    """The correlation of one coordinate; a single number applies to all of them."""
    return value.of(index) if isinstance(value, Correlations) else value


class FurtherSensor(Model):
    """A further sonar that observes the same target at its own times and may measure the bearing only."""

    sigma_range_m: Positive | None = key(
        "σ of the measured range", "standard deviation of a measured range, m; none: not measured", None, symbol="σ_r"
    )
    sigma_bearing_rad: AngleSigma | None = key(
        "σ of the measured bearing", "standard deviation of a measured bearing, rad", None, symbol="σ_β"
    )
    scan_period_s: Positive = key("scan period", "time between two of its plots, s", symbol="Δt")
    first_s: NonNegative = key(
        "time of the first plot", "time of its first plot, s after the first plot of the first sonar"
    )


class Sensor(Model):
    """A sonar: accuracy of its plots, scan period, and how plots are missed."""

    name: Annotated[Name | None, Display()] = key("name", "display name", None)
    sigma_range_m: Positive = key("σ of the measured range", "standard deviation of a measured range, m", symbol="σ_r")
    sigma_bearing_rad: AngleSigma = key(
        "σ of the measured bearing", "standard deviation of a measured bearing, rad", symbol="σ_β"
    )
    sigma_depth_m: Positive | None = key(
        "σ of the measured depth", "standard deviation of a measured depth, m; none: not measured", None, symbol="σ_h"
    )
    sigma_elevation_rad: AngleSigma | None = key(
        "σ of the measured elevation",
        "standard deviation of a measured elevation, rad; replaces the depth",
        None,
        symbol="σ_ε",
    )
    scan_period_s: Positive = key("scan period", "time between two plots, s: T0 of the paper", symbol="Δt")
    error_correlation: Correlation | Correlations = key(
        "correlation of neighbouring errors",
        "correlation ρ of the errors of neighbouring plots, eq. (15); one number, or by coordinate",
        0.0,
        symbol="ρ",
    )
    detection_probability: Annotated[Probability, Field(gt=0)] = key(
        "detection probability",
        "probability that a scan gives a plot; the first scan always does, except for filters with an association",
        1.0,
        symbol="P_D",
    )
    missed_scans: tuple[Annotated[int, Whole(2, MOST_SCANS)], ...] = key(
        "missed scans", "scans, counted from 1, that never give a plot", ()
    )
    further: tuple[FurtherSensor, ...] = key("further sonars", "further sonars on the same target", (), max_length=4)

    @cross_check
    def _consistent(self) -> Iterator[At]:
        if self.sigma_depth_m is not None and self.sigma_elevation_rad is not None:
            yield at("sigma_elevation_rad", "give either the depth or the elevation")

    @cross_check
    def _further_fit(self) -> Iterator[At]:
        if self.further and self.error_correlation != 0.0:
            yield at("error_correlation", "must be 0 where there are further sonars: their errors are independent")

    @cross_check
    def _further_see(self) -> Iterator[At]:
        if self.further and self.detection_probability < 1:
            yield at("detection_probability", "must be 1 where there are further sonars; give missed_scans")


class Polynomial(Model):
    """A target whose polar or cartesian coordinates are polynomials of time (eq. 1)."""

    kind: Literal["polynomial"] = key("kind", "each coordinate is a polynomial of time")
    frame: Literal["polar", "cartesian"] = key("frame of coordinates", "which coordinates are polynomials")
    range_m: Derivatives | None = key(
        "range and its derivatives",
        "range and its derivatives at the first plot: m, m/s, m/s², …",
        only={"frame": "polar"},
    )
    bearing_rad: Derivatives | None = key(
        "bearing and its derivatives",
        "bearing and its derivatives, from north to east: rad, …",
        only={"frame": "polar"},
    )
    x_m: Derivatives | None = key(
        "distance north", "distance north and its derivatives: m, m/s, m/s², …", only={"frame": "cartesian"}
    )
    y_m: Derivatives | None = key(
        "distance east", "distance east and its derivatives: m, m/s, m/s², …", only={"frame": "cartesian"}
    )
    depth_m: Derivatives | None = key("depth and its derivatives", "depth and its derivatives: m, m/s, …", None)
    elevation_rad: Derivatives | None = key(
        "elevation and its derivatives", "elevation and its derivatives: rad, rad/s, …", None
    )
    fluctuation_mps2: NonNegative = key(
        "σ of the random acceleration of the target",
        "standard deviation, m/s², of a random acceleration that is new at every scan, so that the velocity is a "
        "random walk",
        0.0,
    )

    @cross_check
    def _ahead(self) -> Iterator[At]:
        if self.frame == "polar" and self.range_m is not None and self.range_m[0] <= 0:
            yield at("range_m", "must begin with a positive range")

    @cross_check
    def _fluctuates(self) -> Iterator[At]:
        if self.frame == "cartesian" and self.fluctuation_mps2:
            yield at("fluctuation_mps2", "needs the polar frame")

    @property
    def initial_range_m(self) -> float:
        """Range at the first plot, m; converts lateral distances to angles."""
        if self.range_m is not None:
            return self.range_m[0]
        return _from_origin(*(given[0] for given in (self.x_m, self.y_m) if given))


def _from_origin(*coordinates: float) -> float:
    """The distance from the sonar, at least 1 m."""
    return max(sum(value**2 for value in coordinates) ** 0.5, 1.0)


class Vessel(Model):
    """A vessel that starts at a given position, with a given speed and course."""

    kind: Literal["accelerating", "turning"] = key("kind", "how the vessel manoeuvres")
    x_m: Number = key("distance north", "distance north of the sonar at the first plot, m")
    y_m: Number = key("distance east", "distance east of the sonar at the first plot, m")
    speed_mps: NonNegative = key("speed", "initial speed, m/s")
    course_rad: Number = key("course", "initial course, from north to east, rad")
    fluctuation_mps2: ClassVar[float] = 0.0

    @property
    def initial_range_m(self) -> float:
        """Range at the first plot, m; converts lateral distances to angles."""
        return _from_origin(self.x_m, self.y_m)


class Accelerating(Vessel):
    """A vessel on a straight course whose speed changes at a constant rate between two times."""

    kind: Literal["accelerating"] = key("kind", "straight course with a step of acceleration along it")
    acceleration_mps2: Number = key("acceleration", "acceleration along the course, m/s²; 0: no manoeuvre", symbol="a")
    start_s: NonNegative = key("start time", "start of the acceleration, s from the first plot")
    end_s: Positive | None = key("end time", "end of the acceleration, s; none: it never ends", None)

    @cross_check
    def _order(self) -> Iterator[At]:
        if self.end_s is not None and self.end_s <= self.start_s:
            yield at("end_s", "must come after start_s")


class TimedTurn(Model):
    """A turn between two times."""

    start_s: NonNegative = key("start time", "start of the turn, s from the first plot")
    end_s: Positive = key("end time", "end of the turn, s")
    rate_radps: Number = key("turn rate", "turn rate, rad/s, positive to starboard")

    @cross_check
    def _order(self) -> Iterator[At]:
        if self.end_s <= self.start_s:
            yield at("end_s", "must come after start_s")


class Turning(Vessel):
    """A vessel at constant speed on straight legs and turns."""

    kind: Literal["turning"] = key("kind", "straight legs and turns at constant speed")
    speed_mps: Positive = key("speed", "speed, m/s")
    turns: Annotated[tuple[TimedTurn, ...], Field(min_length=1, max_length=16)] = key(
        "turns", "the turns, in order of time"
    )

    @cross_check
    def _in_order(self) -> Iterator[At]:
        if any(later.start_s < earlier.end_s for earlier, later in zip(self.turns, self.turns[1:], strict=False)):
            yield at("turns", "must follow one another without overlap")


Target = Annotated[Polynomial | Turning | Accelerating, Field(discriminator="kind")]
CORRELATED = ("kalman_augmented", "kalman_differenced")
MODELLED = ("fixed_gain", "kalman", "kalman_augmented")  # kinds that allow for a manoeuvre


class Filter(Model):
    """A filter that processes each coordinate separately: the keys that all kinds share."""

    name: Annotated[Name, Display()] = key("name", "label; must differ from those of the other filters")
    kind: Literal[
        "growing_memory", "window", "kalman", "fixed_gain", "kalman_augmented", "kalman_differenced", "adaptive", "imm"
    ] = key(
        "kind",
        "least squares on all plots or on the last few; Kalman; fixed gains; two that model correlated errors; one "
        "that responds to a manoeuvre detector; or two interacting Kalman filters",
    )
    degree: Literal[1, 2] = key(
        "degree of the polynomial", "degree of the polynomial: 1 a straight line, 2 a parabola", 1
    )
    plots: Annotated[int, Whole(2, 1000)] | None = key(
        "number of plots",
        "length of a window; or of the least-squares start of fixed_gain, by default degree + 1",
        None,
        only={"kind": ("window", "fixed_gain")},
    )
    manoeuvre_variance: NonNegative | None = key(
        "manoeuvre variance",
        "variance of a random acceleration, (m/s²)², for degree 2 of a random jerk, (m/s³)²; for angles it is "
        "divided by the square of the initial range",
        None,
        symbol="D_M",
        unit="",
        only={"kind": MODELLED},
    )
    error_correlation: Correlation | Correlations | None = key(
        "correlation of neighbouring errors",
        "correlation that the filter assumes; default: that of the sonar",
        None,
        symbol="ρ",
        only={"kind": CORRELATED},
    )

    @cross_check
    def _fits_kind(self) -> Iterator[At]:
        if self.plots is None and self.kind == "window":
            yield at("plots", "is needed by a window")
        elif self.plots is not None and self.plots < self.degree + 1:
            yield at("plots", f"must be >= {self.degree + 1} for degree {self.degree}")

    @cross_check
    def _variance_fits_kind(self) -> Iterator[At]:
        if self.kind == "fixed_gain" and not self.manoeuvre_variance:
            yield at("manoeuvre_variance", "must be > 0 for fixed_gain: it determines the steady-state gains")


class Keys(Study):
    """The keys that all cases have."""

    sensor: Sensor = key("sensor", "the sonar")
    target: Annotated[Target, Scenario()] = key("target", "the target: the stem of a scenario, or inline")
    frame: Annotated[Literal["polar", "cartesian", "cartesian_unbiased"], Design()] = key(
        "frame of coordinates",
        "coordinates in which the filters work; plots are converted to x, y plainly, or without bias",
        "polar",
    )
    filters: Annotated[tuple[Filter, ...], Field(min_length=1, max_length=16), Design()] = key(
        "filters", "the filters; all of them process the same plots"
    )
    baseline: Baseline = key(
        "baseline filter", "filter that gains are against, or a list of several; default: the first", None
    )
    scans: Annotated[int, Whole(2, MOST_SCANS), Design()] = key("number of scans", "number of scans of the first sonar")

    @cross_check
    def _long_enough(self) -> Iterator[At]:
        most = max(readable(self.filters, lambda member: member.degree), default=0) + 1
        if self.scans < most:
            yield at("scans", f"must be >= {most} for a filter of degree {most - 1}")

    @cross_check
    def _misses_within_scans(self) -> Iterator[At]:
        if any(scan > self.scans for scan in self.sensor.missed_scans):
            yield at("sensor.missed_scans", f"must be <= {self.scans}, the last scan")

    @cross_check
    def _target_measured(self) -> Iterator[At]:
        for name, unit in (("depth", "m"), ("elevation", "rad")):
            measured = getattr(self.sensor, f"sigma_{name}_{unit}") is not None
            if measured and getattr(self.target, f"{name}_{unit}", None) is None:
                yield at("target", f"needs {name}_{unit}, which the sonar measures")

    @cross_check
    def _elevation_in_polar(self) -> Iterator[At]:
        if self.frame != "polar" and self.sensor.sigma_elevation_rad is not None:
            yield at("frame", "must be polar where the elevation is measured")

    @cross_check
    def _further_in_polar(self) -> Iterator[At]:
        if self.frame != "polar" and self.sensor.further:
            yield at("frame", "must be polar where there are further sonars")

    @cross_check
    def _fluctuating_in_polar(self) -> Iterator[At]:
        if self.frame != "polar" and self.target.fluctuation_mps2:
            yield at("frame", "must be polar for a fluctuating target")

    @cross_check
    def _correlated_in_polar(self) -> Iterator[At]:
        def check(i: int, member: Filter) -> Iterator[At]:
            if member.kind in CORRELATED:
                yield at(f"filters.{i}.kind", f"{member.kind} works only in the polar frame")

        if self.frame != "polar":
            yield from of_each(self.filters, check)

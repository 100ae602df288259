"""Keys of the sonar study (P3): the sonar, the target, the filters, and what its three parts ask in addition.

Smoothing is what all cases have. In addition there are detectors of manoeuvres, filters that respond to them and uses
of a track; and trackers, which have to find their plots among false ones in a surveyed sector."""

import math
from collections.abc import Iterator
from typing import Annotated, ClassVar, Literal

from pydantic import AfterValidator, Field

from radarsim.config import fields
from radarsim.config.fields import At, Design, Model, Name, NonNegative, Number, Positive, Whole, at, cross_check, key

MOST_SCANS = 100_000
MOST_FALSE = 1e7  # in a scan of the whole sector
MOST_TESTED = 200_000  # scans x thresholds of all detectors: 10 MB of sums a block
COMPONENTS = tuple(rate + coordinate for coordinate in "rbxyde" for rate in ("", "v", "a"))
FIGURES = (
    *(f"sigma_{name}" for name in COMPONENTS),
    *("plots", "smoothing_gains", "believed", "missed", "conversion"),
    *("roc", "detection", "delay", "modes", "uses"),
    *("track_map", "confirmation", "track_life", "false_tracks", "track_classes"),
)
AngleSigma = Annotated[Positive, Field(le=0.5)]  # rad: beyond about 30 degrees the error of an angle is not Gaussian
Derivatives = Annotated[tuple[Number, ...], Field(min_length=1, max_length=12)]
Rate = Annotated[fields.Probability, Field(gt=0, lt=1)]
Rates = Annotated[tuple[Rate, ...], Field(min_length=1, max_length=32)]
Thresholds = Annotated[tuple[Positive, ...], Field(min_length=1, max_length=32)]
WindowPlots = Annotated[int, Whole(3, 100)]
TestPeriod = Annotated[int, Whole(1, 1000)]


class Correlations(Model):
    """A correlation for each coordinate; zero where none is given."""

    range: fields.Correlation = key("correlation of errors in range", "correlation of the errors in range", 0.0)
    bearing: fields.Correlation = key("correlation of errors in bearing", "correlation of the errors in bearing", 0.0)
    third: fields.Correlation = key(
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


class Sensor(Model):
    """A sonar: accuracy of its plots, scan period, how plots are missed, and false ones."""

    name: Annotated[Name | None, fields.Display()] = key("name", "display name", None)
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
    error_correlation: fields.Correlation | Correlations = key(
        "correlation of neighbouring errors",
        "correlation ρ of the errors of neighbouring plots, eq. (15); one number, or by coordinate",
        0.0,
        symbol="ρ",
    )
    detection_probability: Annotated[fields.Probability, Field(gt=0)] = key(
        "detection probability",
        "probability that a scan gives a plot; the first scan always does, except for filters with an association",
        1.0,
        symbol="P_D",
    )
    missed_scans: tuple[Annotated[int, Whole(2, MOST_SCANS)], ...] = key(
        "missed scans", "scans, counted from 1, that never give a plot", ()
    )
    further: tuple[FurtherSensor, ...] = key("further sonars", "further sonars on the same target", (), max_length=4)
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
        "standard deviation, m/s², of a random acceleration drawn anew at every scan, so that the "
        "velocity is a random walk",
        0.0,
    )

    @cross_check
    def _positive_range(self) -> Iterator[At]:
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
        return _from_origin(*(derivatives[0] for derivatives in (self.x_m, self.y_m) if derivatives))


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


# ---- detectors, uses, trackers ---------------------------------------------------------------------------------------
class Initiation(Model):
    """A track is confirmed once m of its first n scans gave it a plot; the scan of its first plot counts."""

    m: Annotated[int, Whole(2, 20)] = key("plots that confirm a track", "number of plots that confirms a track")
    n: Annotated[int, Whole(2, 20)] = key(
        "scans of the confirmation rule",
        "number of scans, from that of the first plot on, within which they must occur",
    )

    @cross_check
    def _order(self) -> Iterator[At]:
        if self.n < self.m:
            yield at("n", f"must be >= {self.m}, the number of plots that confirms a track")


def either_threshold(detector: "OwnDetector | Detector") -> Iterator[At]:
    """Check that a detector has thresholds or false alarm probabilities, not both."""
    if (detector.threshold_k is None) == (detector.false_alarm_probability is None):
        yield at("threshold_k", "give either threshold_k or false_alarm_probability")


class OwnDetector(Model):
    """The detector of an adaptive filter: it tests the acceleration of a parabola through the last plots."""

    plots: WindowPlots = key("plots of the parabola", "plots n of the parabola")
    threshold_k: Positive | None = key(
        "threshold",
        "threshold k: a manoeuvre is declared where the squared acceleration exceeds k σ_a²",
        None,
        symbol="k",
    )
    false_alarm_probability: Rate | None = key(
        "false-alarm probability",
        "replaces threshold_k: probability of an alarm in a test without a manoeuvre",
        None,
        symbol="P_F",
    )
    coordinates: Literal["each", "joint"] = key(
        "tested coordinates",
        "each: a test of each coordinate, as in the paper; joint: one test of the sum over all",
        "each",
    )
    test_every: TestPeriod = key("scans between tests", "scans from one test to the next", 1)

    @cross_check
    def _either_threshold(self) -> Iterator[At]:
        yield from either_threshold(self)


class Detector(Model):
    """A manoeuvre detector that is measured at one or several thresholds."""

    name: Annotated[Name, fields.Display()] = key("name", "label; must differ from those of the other detectors")
    plots: WindowPlots = key("plots of the parabola", "plots n of the parabola")
    threshold_k: Thresholds | None = key(
        "threshold",
        "thresholds k: a manoeuvre is declared where the squared acceleration exceeds k σ_a²",
        None,
        symbol="k",
    )
    false_alarm_probability: Rates | None = key(
        "false-alarm probability",
        "replaces threshold_k: probabilities of an alarm in a test without a manoeuvre",
        None,
        symbol="P_F",
    )
    test_every: TestPeriod = key(
        "scans between tests",
        "scans from one test to the next; from `plots` on the tests are independent and the delay is exact",
        1,
    )

    @cross_check
    def _either_threshold(self) -> Iterator[At]:
        yield from either_threshold(self)

    def levels(self) -> tuple[float, ...]:
        """The thresholds or the probabilities, whichever are given."""
        return self.threshold_k or self.false_alarm_probability or ()


class OwnShip(Model):
    """The vessel that carries the sonar, or another to be kept clear of; its course and speed are constant."""

    x_m: Number = key("distance north", "distance north of the sonar's origin at the first plot, m", 0.0)
    y_m: Number = key("distance east", "distance east of the sonar's origin at the first plot, m", 0.0)
    speed_mps: NonNegative = key("speed", "speed, m/s", 0.0)
    course_rad: Number = key("course", "course, from north to east, rad", 0.0)


class Uses(Model):
    """Quantities derived from a track: course, speed, predicted position, closest point of approach."""

    horizon_s: Positive = key("prediction horizon", "how far ahead the position is predicted, s")
    at_s: Annotated[tuple[NonNegative, ...], Field(min_length=1, max_length=16)] | None = key(
        "times", "times, s from the first plot: the scan then or the next one; default: the last scan", None
    )
    own_ship: OwnShip = key("own ship", "the vessel that the closest approach refers to", OwnShip())


# ---- filters ---------------------------------------------------------------------------------------------------------
CORRELATED = ("kalman_augmented", "kalman_differenced")
MODELLED = ("fixed_gain", "kalman", "kalman_augmented")  # kinds that allow for a manoeuvre
RESPONDING_KINDS = ("adaptive", "imm")  # kinds whose gains differ between realisations
TRACKER = {"association": ("nearest", "pda", "known")}


class Filter(Model):
    """A filter that processes each coordinate separately."""

    name: Annotated[Name, fields.Display()] = key("name", "label; must differ from those of the other filters")
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
    error_correlation: fields.Correlation | Correlations | None = key(
        "correlation of neighbouring errors",
        "correlation that the filter assumes; default: that of the sonar",
        None,
        symbol="ρ",
        only={"kind": CORRELATED},
    )
    association: Literal["nearest", "pda", "known"] | None = key(
        "association",
        "how plots are chosen: the nearest in the gate, probabilistic data association, or the target's own plots, "
        "as a reference",
        None,
    )
    gate_probability: Annotated[fields.Probability, Field(gt=0)] | None = key(
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
    detector: OwnDetector | None = key(
        "detector", "manoeuvre detector of an adaptive filter", only={"kind": "adaptive"}
    )
    response: Literal["raise_degree", "shorten_memory"] | None = key(
        "response to a manoeuvre",
        "response of an adaptive filter to a manoeuvre: a parabola that starts with the detector's plots (default), "
        "or a window of these plots while the manoeuvre lasts",
        None,
        only={"kind": "adaptive"},
    )
    end_after: Annotated[int, Whole(1, 100)] | None = key(
        "quiet tests that end a manoeuvre",
        "number of successive tests without an alarm that ends a manoeuvre; default 1",
        None,
        only={"kind": "adaptive"},
    )
    manoeuvre_variances: tuple[NonNegative, NonNegative] | None = key(
        "manoeuvre variances of the models",
        "imm: variances of its two models, steady and manoeuvring, (m/s²)², as manoeuvre_variance",
        only={"kind": "imm"},
    )
    stay_probabilities: tuple[Rate, Rate] | None = key(
        "probabilities that a model persists",
        "imm: probabilities that the steady and the manoeuvring model persist from scan to scan",
        only={"kind": "imm"},
    )

    @property
    def rule(self) -> Initiation:
        """The rule of confirmation, given or by default."""
        return self.initiation or Initiation(m=3, n=4)

    @cross_check
    def _kalman_line(self) -> Iterator[At]:
        if self.association is not None and (self.kind != "kalman" or self.degree != 1):
            yield at("association", "needs a filter of kind kalman and degree 1")

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

    @cross_check
    def _parabola(self) -> Iterator[At]:
        if self.kind == "adaptive" and self.response != "shorten_memory" and self.degree == 2:
            yield at("degree", "must be 1 where a manoeuvre raises the degree; or use response: shorten_memory")

    @cross_check
    def _second_moves_more(self) -> Iterator[At]:
        if self.manoeuvre_variances is not None and not self.manoeuvre_variances[0] < self.manoeuvre_variances[1]:
            yield at("manoeuvre_variances", "must rise: first the steady model, then the manoeuvring one")


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
        law_share = (1.0 - fields.PLAIN_SHARE) / max(sum(event in self.events for event in laws), 1)
        confirmed_share, long_share = (law_share if event in self.events else 0.0 for event in laws)
        return fields.PLAIN_SHARE, confirmed_share, long_share

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


class Keys(fields.Study):
    """Sonar plots smoothed and extrapolated."""

    figure_names = FIGURES

    sensor: Sensor = key("sensor", "the sonar")
    target: Annotated[Target, fields.Scenario()] = key("target", "the target: the stem of a scenario, or inline")
    frame: Annotated[Literal["polar", "cartesian", "cartesian_unbiased"], Design()] = key(
        "frame of coordinates",
        "coordinates of the filters; plots are converted to x, y plainly, or without bias",
        "polar",
    )
    filters: fields.Members[Filter] = key("filters", "the filters; all of them process the same plots")
    baseline: fields.Baseline = fields.BASELINE
    scans: Annotated[int, Whole(2, MOST_SCANS), Design()] = key("number of scans", "number of scans of the first sonar")
    detectors: Annotated[tuple[Detector, ...], Field(max_length=8), AfterValidator(fields.unique_names), Design()] = (
        key("detectors", "manoeuvre detectors that are evaluated on the plots", ())
    )
    uses: Annotated[Uses | None, Design()] = key(
        "uses of the track",
        "course, speed, predicted position and closest approach, with their σ; none: left out",
        None,
    )
    rare: Annotated[RareTracks | None, Design(), fields.Added()] = key(
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
    def _manoeuvres_of_known_plots(self) -> Iterator[At]:
        if "clutter" in self.parts:
            for name in self.about_manoeuvres():
                yield at(name, "does not go with filters that have an association")

    @cross_check
    def _long_enough(self) -> Iterator[At]:
        min_scans = max(fields.readable(self.filters, lambda member: member.degree), default=0) + 1
        if self.scans < min_scans:
            yield at("scans", f"must be >= {min_scans} for a filter of degree {min_scans - 1}")

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
            yield from fields.of_each(self.filters, check)

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

    def about_manoeuvres(self) -> Iterator[str]:
        """The keys that make a case one about manoeuvres: detectors, uses, kinds of filters that respond."""
        if self.detectors:
            yield "detectors"
        if self.uses is not None:
            yield "uses"
        yield from (f"filters.{i}.kind" for i, member in enumerate(self.filters) if member.kind in RESPONDING_KINDS)

    @cross_check
    def _detectors_fit(self) -> Iterator[At]:
        def check(i: int, detector: Detector) -> Iterator[At]:
            if detector.plots > self.scans:
                yield at(f"detectors.{i}.plots", f"must be <= {self.scans}, the number of scans")

        yield from fields.of_each(self.detectors, check)
        if self.scans * sum(fields.readable(self.detectors, lambda detector: len(detector.levels()))) > MOST_TESTED:
            yield at("detectors", f"must have at most {MOST_TESTED // self.scans} thresholds for {self.scans} scans")

    @cross_check
    def _uses_fit(self) -> Iterator[At]:
        if self.uses is None:
            return
        last = (self.scans - 1) * self.sensor.scan_period_s
        if any(when > last for when in self.uses.at_s or ()):
            yield at("uses.at_s", f"must be <= {last:g}, the time of the last scan")
        if self.target.fluctuation_mps2:
            yield at("uses", "needs a target that does not move at random: its future is not known")

    @cross_check
    def _responses_fit(self) -> Iterator[At]:
        def check(i: int, member: Filter) -> Iterator[At]:
            if member.detector is not None and member.detector.plots > self.scans:
                yield at(f"filters.{i}.detector.plots", f"must be <= {self.scans}, the number of scans")

        yield from fields.of_each(self.filters, check)

    @cross_check
    def _manoeuvres_of_one_sonar(self) -> Iterator[At]:
        if self.sensor.further:
            for name in self.about_manoeuvres():
                yield at(name, "does not go with further sonars")

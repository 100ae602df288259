"""Keys of the sonar study (P3) about manoeuvres: detectors, filters that respond to them, uses of a track."""

from collections.abc import Iterator
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Field

from radarsim.config.fields import (
    At,
    Display,
    Model,
    Name,
    NonNegative,
    Number,
    Positive,
    Probability,
    at,
    cross_check,
    of_each,
    readable,
    unique_names,
    whole,
)

MOST_TESTED = 200_000  # scans x thresholds of all detectors: 10 MB of sums a block
FIGURES = ("roc", "detection", "delay", "response", "modes", "uses")
RESPONDING_KINDS = ("adaptive", "imm")  # kinds of filters whose gains are each realisation's own
Rate = Annotated[Probability, Field(gt=0, lt=1)]
Rates = Annotated[tuple[Rate, ...], Field(min_length=1, max_length=32)]
Thresholds = Annotated[tuple[Positive, ...], Field(min_length=1, max_length=32)]
WindowPlots = whole(3, 100)


class OwnDetector(Model):
    """The detector of an adaptive filter: acceleration of a parabola through the last plots against its own spread."""

    plots: WindowPlots = Field(description="plots n of the parabola")
    threshold_k: Positive | None = Field(
        None, description="threshold k: a manoeuvre is declared where the squared acceleration exceeds k σ_a²"
    )
    false_alarm_probability: Rate | None = Field(
        None, description="in place of threshold_k: probability of an alarm a test without a manoeuvre"
    )
    coordinates: Literal["each", "joint"] = Field(
        "each", description="each: by coordinate, as in the paper; joint: one test of the sum over all of them"
    )
    test_every: whole(1, 1000) = Field(1, description="scans from one test to the next")

    @cross_check
    def _one_of(self):
        if (self.threshold_k is None) == (self.false_alarm_probability is None):
            yield at("threshold_k", "give either threshold_k or false_alarm_probability")


class Detector(Model):
    """A detector of manoeuvres to be measured at one or several thresholds."""

    name: Annotated[Name, Display()] = Field(description="label, unlike that of any other detector")
    plots: WindowPlots = Field(description="plots n of the parabola")
    threshold_k: Thresholds | None = Field(
        None, description="thresholds k: a manoeuvre is declared where the squared acceleration exceeds k σ_a²"
    )
    false_alarm_probability: Rates | None = Field(
        None, description="in place of threshold_k: probabilities of an alarm a test without a manoeuvre"
    )
    test_every: whole(1, 1000) = Field(
        1, description="scans from one test to the next; from `plots` on tests are independent, and the delay is exact"
    )

    @cross_check
    def _one_of(self):
        if (self.threshold_k is None) == (self.false_alarm_probability is None):
            yield at("threshold_k", "give either threshold_k or false_alarm_probability")

    def wanted(self) -> tuple[float, ...]:
        """The thresholds or the probabilities, whichever are given."""
        return self.threshold_k or self.false_alarm_probability


Detectors = Annotated[tuple[Detector, ...], Field(max_length=8), AfterValidator(unique_names)]


class OwnShip(Model):
    """The vessel that carries the sonar, or that is to be kept clear of: at the first plot, and steady."""

    x_m: Number = Field(0.0, description="way north of the sonar's origin at the first plot, m")
    y_m: Number = Field(0.0, description="way east of it, m")
    speed_mps: NonNegative = Field(0.0, description="its speed, m/s")
    course_rad: Number = Field(0.0, description="its course, from north to east, rad")


class Uses(Model):
    """What a track is used for: course, speed, predicted position, closest point of approach."""

    horizon_s: Positive = Field(description="how far ahead the position is predicted, s")
    at_s: Annotated[tuple[NonNegative, ...], Field(min_length=1, max_length=16)] | None = Field(
        None, description="when they are asked for, s from the first plot: at the scan then or next; default: the last"
    )
    own_ship: OwnShip = Field(OwnShip(), description="the vessel that the closest approach is to")


class Adapting(Model):
    """What a filter needs that responds to manoeuvres: kinds `adaptive` and `imm`."""

    detector: OwnDetector | None = Field(None, description="of an adaptive filter: what tells it of a manoeuvre")
    response: Literal["raise_degree", "shorten_memory"] | None = Field(
        None,
        description="of an adaptive filter to a manoeuvre: a parabola from the detector's plots on (default), or a "
        "window of these plots while it lasts",
    )
    end_after: whole(1, 100) | None = Field(
        None, description="tests without an alarm, in a row, that end a manoeuvre; default 1"
    )
    manoeuvre_variances: Annotated[tuple[NonNegative, NonNegative], Field()] | None = Field(
        None, description="of the two models of an imm, steady and manoeuvring, (m/s²)², as manoeuvre_variance"
    )
    stay_probabilities: Annotated[tuple[Rate, Rate], Field()] | None = Field(
        None, description="of an imm: probabilities that the steady and the manoeuvring model last from scan to scan"
    )

    @cross_check
    def _adaptive_complete(self):
        if self.kind == "adaptive" and self.detector is None:
            yield at("detector", "is needed by an adaptive filter")
        for key in ("detector", "response", "end_after"):
            if self.kind != "adaptive" and getattr(self, key) is not None:
                yield at(key, "belongs to an adaptive filter")

    @cross_check
    def _parabola(self):
        if self.kind == "adaptive" and self.response != "shorten_memory" and self.degree == 2:
            yield at("degree", "must be 1 where a manoeuvre raises the degree; or take response: shorten_memory")

    @cross_check
    def _models_complete(self):
        for key in ("manoeuvre_variances", "stay_probabilities"):
            if self.kind == "imm" and getattr(self, key) is None:
                yield at(key, "is needed by an imm")
            if self.kind != "imm" and getattr(self, key) is not None:
                yield at(key, "belongs to an imm")

    @cross_check
    def _second_moves_more(self):
        if self.manoeuvre_variances is not None and not self.manoeuvre_variances[0] < self.manoeuvre_variances[1]:
            yield at("manoeuvre_variances", "must rise: first the steady model, then the manoeuvring one")


# ---- what must go together in a whole config ----------------------------------------------------------------------
def detector_misfits(spec: Any) -> Iterator[At]:
    """Faults of the measured detectors of a sonar study."""

    def check(i: int, one: Detector):
        if one.plots > spec.scans:
            yield at(f"detectors.{i}.plots", f"must be <= {spec.scans}, the number of scans")

    yield from of_each(spec.detectors, check)
    if spec.scans * sum(readable(spec.detectors, lambda one: len(one.wanted()))) > MOST_TESTED:
        yield at("detectors", f"must have at most {MOST_TESTED // spec.scans} thresholds for {spec.scans} scans")


def uses_misfits(spec: Any) -> Iterator[At]:
    """Faults of the uses of a sonar study."""
    if spec.uses is None:
        return
    last = (spec.scans - 1) * spec.sensor.scan_period_s
    if any(when > last for when in spec.uses.at_s or ()):
        yield at("uses.at_s", f"must be <= {last:g}, the time of the last scan")
    if getattr(spec.target, "fluctuation_mps2", 0.0):
        yield at("uses", "needs a target that does not move at random: its future is not known")


def response_misfits(spec: Any) -> Iterator[At]:
    """Faults of the filters of a sonar study that respond to manoeuvres."""

    def check(i: int, one: Adapting):
        if one.detector is not None and one.detector.plots > spec.scans:
            yield at(f"filters.{i}.detector.plots", f"must be <= {spec.scans}, the number of scans")

    yield from of_each(spec.filters, check)


def further_misfits(spec: Any) -> Iterator[At]:
    """What is asked about manoeuvres is of one sonar."""
    if spec.sensor.further:
        for key in asked(spec):
            yield at(key, "does not go with further sonars")


def asked(spec: Any) -> Iterator[str]:
    """The keys by which a sonar study asks about manoeuvres: detectors, uses, kinds of filters that respond."""
    if spec.detectors:
        yield "detectors"
    if spec.uses is not None:
        yield "uses"
    yield from (f"filters.{i}.kind" for i, one in enumerate(spec.filters) if one.kind in RESPONDING_KINDS)

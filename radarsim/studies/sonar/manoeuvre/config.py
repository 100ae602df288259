"""Keys of the sonar study (P3) about manoeuvres: detectors, filters that respond to them, uses of a track."""

from collections.abc import Iterator
from typing import Annotated, Literal

from pydantic import AfterValidator, Field

from radarsim.config.fields import (
    At,
    Design,
    Display,
    Model,
    Name,
    NonNegative,
    Number,
    Positive,
    Probability,
    Whole,
    at,
    cross_check,
    key,
    of_each,
    readable,
    unique_names,
)
from radarsim.studies.sonar import config

MOST_TESTED = 200_000  # scans x thresholds of all detectors: 10 MB of sums a block
FIGURES = ("roc", "detection", "delay", "response", "modes", "uses")
RESPONDING_KINDS = ("adaptive", "imm")  # kinds of filters whose gains differ between realisations
Rate = Annotated[Probability, Field(gt=0, lt=1)]
Rates = Annotated[tuple[Rate, ...], Field(min_length=1, max_length=32)]
Thresholds = Annotated[tuple[Positive, ...], Field(min_length=1, max_length=32)]
WindowPlots = Annotated[int, Whole(3, 100)]
TestPeriod = Annotated[int, Whole(1, 1000)]


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

    name: Annotated[Name, Display()] = key("name", "label; must differ from those of the other detectors")
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


class Filter(config.Filter):
    """A filter that may respond to manoeuvres: kinds `adaptive` and `imm`."""

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
        "of the two models of an imm, steady and manoeuvring, (m/s²)², as manoeuvre_variance",
        only={"kind": "imm"},
    )
    stay_probabilities: tuple[Rate, Rate] | None = key(
        "probabilities that a model lasts",
        "of an imm: probabilities that the steady and the manoeuvring model last from scan to scan",
        only={"kind": "imm"},
    )

    @cross_check
    def _parabola(self) -> Iterator[At]:
        if self.kind == "adaptive" and self.response != "shorten_memory" and self.degree == 2:
            yield at("degree", "must be 1 where a manoeuvre raises the degree; or use response: shorten_memory")

    @cross_check
    def _second_moves_more(self) -> Iterator[At]:
        if self.manoeuvre_variances is not None and not self.manoeuvre_variances[0] < self.manoeuvre_variances[1]:
            yield at("manoeuvre_variances", "must rise: first the steady model, then the manoeuvring one")


class Keys(config.Keys):
    """The keys of a case with detectors, filters that respond to manoeuvres, or uses of a track."""

    filters: tuple[Filter, ...]
    detectors: Annotated[tuple[Detector, ...], Field(max_length=8), AfterValidator(unique_names), Design()] = key(
        "detectors", "manoeuvre detectors that are measured on the plots", ()
    )
    uses: Annotated[Uses | None, Design()] = key(
        "uses of the track",
        "course, speed, predicted position and closest approach, with their σ; none: left out",
        None,
    )

    def about_manoeuvres(self) -> Iterator[str]:
        """The keys that make a case one about manoeuvres: detectors, uses, kinds of filters that respond."""
        if self.detectors:
            yield "detectors"
        if self.uses is not None:
            yield "uses"
        yield from (f"filters.{i}.kind" for i, one in enumerate(self.filters) if one.kind in RESPONDING_KINDS)

    @cross_check
    def _detectors_fit(self) -> Iterator[At]:
        def check(i: int, detector: Detector) -> Iterator[At]:
            if detector.plots > self.scans:
                yield at(f"detectors.{i}.plots", f"must be <= {self.scans}, the number of scans")

        yield from of_each(self.detectors, check)
        if self.scans * sum(readable(self.detectors, lambda detector: len(detector.levels()))) > MOST_TESTED:
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

        yield from of_each(self.filters, check)

    @cross_check
    def _manoeuvres_of_one_sonar(self) -> Iterator[At]:
        if self.sensor.further:
            for name in self.about_manoeuvres():
                yield at(name, "does not go with further sonars")

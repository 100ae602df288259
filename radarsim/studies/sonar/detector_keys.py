"""Keys of manoeuvre detectors, measured ones and those of adaptive filters."""

from collections.abc import Iterator
from typing import Annotated, Literal

from pydantic import Field

from radarsim.config import key_types, marks
from radarsim.config.cross_checks import CheckError, check_error, cross_check
from radarsim.config.key_types import Name, Positive, WholeNumber, key
from radarsim.config.model import Model

Rate = Annotated[key_types.Probability, Field(gt=0, lt=1)]
Rates = Annotated[tuple[Rate, ...], Field(min_length=1, max_length=32)]
Thresholds = Annotated[tuple[Positive, ...], Field(min_length=1, max_length=32)]
WindowPlots = Annotated[int, WholeNumber(3, 100)]
TestPeriod = Annotated[int, WholeNumber(1, 1000)]


def either_threshold(detector: "FilterDetector | Detector") -> Iterator[CheckError]:
    """Check that a detector has thresholds or false alarm probabilities, not both."""
    if (detector.threshold_k is None) == (detector.false_alarm_probability is None):
        yield check_error("threshold_k", "give either threshold_k or false_alarm_probability")


class FilterDetector(Model):
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
    def _either_threshold(self) -> Iterator[CheckError]:
        yield from either_threshold(self)


class Detector(Model):
    """A manoeuvre detector that is measured at one or several thresholds."""

    name: Annotated[Name, marks.DisplayMark()] = key("name", "label; must differ from those of the other detectors")
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
    def _either_threshold(self) -> Iterator[CheckError]:
        yield from either_threshold(self)

    def levels(self) -> tuple[float, ...]:
        """The thresholds or the probabilities, whichever are given."""
        return self.threshold_k or self.false_alarm_probability or ()

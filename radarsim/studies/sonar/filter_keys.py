"""Keys of filters and trackers."""

from collections.abc import Iterator
from typing import Annotated, Literal

from pydantic import Field

from radarsim.config import key_types, marks
from radarsim.config.cross_checks import CheckError, check_error, cross_check
from radarsim.config.key_types import Name, NonNegative, Positive, WholeNumber, key
from radarsim.config.model import Model
from radarsim.studies.sonar.detector_keys import FilterDetector, Rate
from radarsim.studies.sonar.sensor_keys import Correlations


class Initiation(Model):
    """A track is confirmed once m of its first n scans gave it a plot; the scan of its first plot counts."""

    m: Annotated[int, WholeNumber(2, 20)] = key("plots that confirm a track", "number of plots that confirms a track")
    n: Annotated[int, WholeNumber(2, 20)] = key(
        "scans of the confirmation rule",
        "number of scans, from that of the first plot on, within which they must occur",
    )

    @cross_check
    def _order(self) -> Iterator[CheckError]:
        if self.n < self.m:
            yield check_error("n", f"must be >= {self.m}, the number of plots that confirms a track")


CORRELATED = ("kalman_augmented", "kalman_differenced")
MODELLED = ("fixed_gain", "kalman", "kalman_augmented")  # kinds that allow for a manoeuvre
RESPONDING_KINDS = ("adaptive", "imm")  # kinds whose gains differ between realisations
TRACKER = {"association": ("nearest", "pda", "known")}


class Filter(Model):
    """A filter that processes each coordinate separately."""

    name: Annotated[Name, marks.DisplayMark()] = key("name", "label; must differ from those of the other filters")
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
    plots: Annotated[int, WholeNumber(2, 1000)] | None = key(
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
        process_noise=True,
    )
    error_correlation: key_types.Correlation | Correlations | None = key(
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
    gate_probability: Annotated[key_types.Probability, Field(gt=0)] | None = key(
        "gate probability",
        "probability that the gate contains the target's plot; 1: an open gate; default 0.99",
        0.99,
        symbol="P_G",
        only=TRACKER,
    )
    initiation: Initiation | None = key(
        "rule of confirmation", "the m of n rule of confirmation; default 3 of 4", None, only=TRACKER
    )
    drop_after_misses: Annotated[int, WholeNumber(1, 1000)] | None = key(
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
    detector: FilterDetector | None = key(
        "detector", "manoeuvre detector of an adaptive filter", only={"kind": "adaptive"}
    )
    response: Literal["raise_degree", "shorten_memory"] | None = key(
        "response to a manoeuvre",
        "response of an adaptive filter to a manoeuvre: a parabola that starts with the detector's plots (default), "
        "or a window of these plots while the manoeuvre lasts",
        None,
        only={"kind": "adaptive"},
    )
    end_after: Annotated[int, WholeNumber(1, 100)] | None = key(
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
    def _kalman_line(self) -> Iterator[CheckError]:
        if self.association is not None and (self.kind != "kalman" or self.degree != 1):
            yield check_error("association", "needs a filter of kind kalman and degree 1")

    @cross_check
    def _fits_kind(self) -> Iterator[CheckError]:
        if self.plots is None and self.kind == "window":
            yield check_error("plots", "is needed by a window")
        elif self.plots is not None and self.plots < self.degree + 1:
            yield check_error("plots", f"must be >= {self.degree + 1} for degree {self.degree}")

    @cross_check
    def _variance_fits_kind(self) -> Iterator[CheckError]:
        if self.kind == "fixed_gain" and not self.manoeuvre_variance:
            yield check_error("manoeuvre_variance", "must be > 0 for fixed_gain: it determines the steady-state gains")

    @cross_check
    def _parabola(self) -> Iterator[CheckError]:
        if self.kind == "adaptive" and self.response != "shorten_memory" and self.degree == 2:
            yield check_error(
                "degree", "must be 1 where a manoeuvre raises the degree; or use response: shorten_memory"
            )

    @cross_check
    def _second_moves_more(self) -> Iterator[CheckError]:
        if self.manoeuvre_variances is not None and not self.manoeuvre_variances[0] < self.manoeuvre_variances[1]:
            yield check_error("manoeuvre_variances", "must rise: first the steady model, then the manoeuvring one")

"""Keys of the ambiguous_doppler study: a radar whose velocity folds, a target in range, filters that unfold."""

import math
from collections.abc import Iterator, Mapping
from fractions import Fraction
from typing import Annotated, Any, ClassVar, Literal, Self

from pydantic import Field, model_validator

from radarsim.config import cross_checks, key_types, marks, radial_keys, rare_event_keys, study_keys
from radarsim.config.cross_checks import CheckError, check_error, cross_check
from radarsim.config.key_types import NonNegative, Positive, Probability, WholeNumber, key
from radarsim.config.marks import DesignMark
from radarsim.config.model import Model
from radarsim.constants import STANDARD_GRAVITY_MPS2

MAX_RARE_SCANS = 64  # the search for sequences of folds precedes the run, and each shifts the noise of every scan
MAX_SCANS = 10_000  # plots and estimates of eight realisations are stored for the whole run
MAX_HYPOTHESES = 100_000
MAX_RATES = 16
MAX_RATIO = 1000  # largest whole number in the ratio of two repetition rates that have a common remainder
MAX_PROPORTION = 1e6  # largest ratio of the prior's spread to a plot's accuracy: beyond, rounding shows
MAX_FOLDS = 1e4  # spans in a standard deviation of the prior: the first scan tries that many folds
MIN_SPAN_DIFFERENCE = 1e-9  # relative difference below which two spans count as equal
BIAS_KEYS = ("bias_range_m", "bias_velocity_mps", "sigma_bias_range_m", "sigma_bias_velocity_mps")  # of range_doppler
ORACLE_SUFFIX = "with known folds"  # appended to a filter's name
DEFAULT_VELOCITY_MPS, DEFAULT_ACCELERATION_MPS2 = 300.0, 10.0  # the prior's, of a target that states no speed
VELOCITY_TO_SPEED, SPEED_CHANGE_S = 1.2, 25.0  # which give these for an aircraft of 250 m/s
LISTS_HYPOTHESES = {"doppler": "folded", "merge": "never"}  # keys of filters that keep several hypotheses

Order = Annotated[int, WholeNumber(0, 2)]


class Radar(radial_keys.Radar):
    """A coherent surveillance radar: accuracies of one plot, period of its scans, pulse repetition rates."""

    repetition_rate_hz: Positive | Annotated[tuple[Positive, ...], Field(min_length=1, max_length=MAX_RATES)] = key(
        "pulse repetition rate",
        "pulse repetition rate, Hz; the velocity is folded modulo half the wavelength times this rate; the rates of "
        "a list alternate from scan to scan (stagger)",
        symbol="F_r",
    )
    detection_probability: Annotated[Probability, Field(gt=0)] = key(
        "detection probability", "probability that a scan gives a plot", 1.0, symbol="P_D"
    )

    @property
    def rates_hz(self) -> tuple[float, ...]:
        """The repetition rates, used in turn."""
        rates = self.repetition_rate_hz
        return rates if isinstance(rates, tuple) else (rates,)

    @property
    def spans_mps(self) -> tuple[float, ...]:
        """The spans of velocity D = λF/2 of the repetition rates, m/s."""
        return tuple(self.wavelength_m * rate / 2 for rate in self.rates_hz)

    @property
    def joint_spans_mps(self) -> tuple[tuple[float, ...], ...]:
        """The span in which each pair of rates is unambiguous, m/s; zero where it has none."""
        return tuple(tuple(joint_span(span, other_span) for other_span in self.spans_mps) for span in self.spans_mps)

    @cross_check
    def _spans_differ(self) -> Iterator[CheckError]:
        spans = self.spans_mps
        for i, span in enumerate(spans):
            if any(math.isclose(span, other_span, rel_tol=MIN_SPAN_DIFFERENCE) for other_span in spans[:i]):
                yield check_error(
                    "repetition_rate_hz", f"must differ from rate to rate: two unambiguous intervals are {span:g} m/s"
                )
                return


def joint_span(span: float, other_span: float) -> float:
    """The least common multiple of two spans whose ratio is one of whole numbers up to MAX_RATIO; else zero."""
    ratio = Fraction(span / other_span).limit_denominator(MAX_RATIO)
    if (
        span == other_span
        or ratio.numerator > MAX_RATIO
        or not math.isclose(ratio, span / other_span, rel_tol=MIN_SPAN_DIFFERENCE)
    ):
        return 0.0
    return span * ratio.denominator


class Prior(Model):
    """What the filters know before the first plot: mean zero, and these standard deviations; nothing of the range."""

    sigma_velocity_mps: Positive | None = key(
        "prior σ of the radial velocity",
        "standard deviation of the radial velocity, m/s; default: 1.2 times the target's speed at the first plot, 300 "
        "where it has none",
        None,
        symbol="σ_V0",
    )
    sigma_acceleration_mps2: Positive | None = key(
        "prior σ of the radial acceleration",
        "standard deviation of the radial acceleration, m/s²; default: a change by the target's speed in 25 s, but at "
        "least its acceleration at the first plot; 10 where it has no speed",
        None,
        symbol="σ_a0",
    )

    def fitted_to(self, target: Any) -> "Prior":
        """The prior with what is not given filled in, from the target."""
        speed_mps, acceleration_mps2 = radial_keys.first_motion(target)
        defaults = (DEFAULT_VELOCITY_MPS, DEFAULT_ACCELERATION_MPS2)
        if speed_mps:
            defaults = VELOCITY_TO_SPEED * speed_mps, max(speed_mps / SPEED_CHANGE_S, acceleration_mps2)
        names = ("sigma_velocity_mps", "sigma_acceleration_mps2")
        missing = {
            name: float(f"{value:.3g}")
            for name, value in zip(names, defaults, strict=True)
            if getattr(self, name) is None
        }
        return self.model_copy(update=missing) if missing else self


def states_speed(target: Any) -> bool:
    """Whether a target's keys state its speed at the first plot, so that a prior can be fitted to it."""
    return radial_keys.first_motion(target)[0] > 0


class RandomPolynomial(Model):
    """A polynomial of the second degree that each realisation draws: velocity and acceleration at the first scan.

    Both are normal with mean zero. Range counts from any origin, so that it may become negative.
    """

    kind: Literal["random_polynomial"] = key("kind", "a polynomial of the second degree, drawn in each realisation")
    range_m: Positive = key("range", "range at the first scan, m", 100e3)
    sigma_velocity_mps: Annotated[NonNegative, Field(le=radial_keys.MAX_SPEED_MPS)] | None = key(
        "σ of the target's radial velocity",
        "standard deviation of the radial velocity, m/s; default: that of `prior`",
        None,
    )
    sigma_acceleration_mps2: Annotated[NonNegative, Field(le=radial_keys.MAX_ACCELERATION_MPS2)] | None = key(
        "σ of the target's radial acceleration",
        "standard deviation of the radial acceleration, m/s²; default: that of `prior`",
        None,
    )


class AccelerationPulse(Model):
    """A polynomial with a constant acceleration for a while; the velocity gained remains."""

    kind: Literal["acceleration_pulse"] = key("kind", "a constant acceleration for a while")
    coefficients: radial_keys.Coefficients = key("derivatives of the range at the first plot", radial_keys.COEFFICIENTS)
    acceleration_g: Annotated[key_types.Number, Field(ge=-100, le=100)] = key(
        "acceleration", "radial acceleration added, standard gravities", symbol="a", unit="g"
    )
    start_s: NonNegative = key("start time", "start time, counted from the first scan, s")
    duration_s: Positive = key("duration", "duration, s")

    def reach_m(self, t: float) -> float:
        """A bound on the range up to a time t (s)."""
        added = abs(self.acceleration_g) * STANDARD_GRAVITY_MPS2 * t**2 / 2
        return radial_keys.polynomial_reach_m(self.coefficients, t) + added


Target = Annotated[
    radial_keys.Polynomial
    | RandomPolynomial
    | radial_keys.AccelerationStart
    | AccelerationPulse
    | radial_keys.Turn
    | radial_keys.FlyBy
    | radial_keys.RecordedTarget,
    Field(discriminator="kind"),
]


class Manoeuvres(Model):
    """A class of manoeuvres: a constant radial acceleration for a while, which begins at any scan with equal chance."""

    acceleration_mps2: Positive = key("acceleration", "size of the acceleration, m/s²", symbol="a")
    duration_s: Positive = key("duration", "duration, s")


class Filter(Model):
    """A Kalman filter of range, or several of different order, with the velocity or without."""

    name: Annotated[key_types.Name, marks.DisplayMark()] = key("name", "label; every filter has its own")
    doppler: Literal["none", "unfolded", "folded", "remainder"] = key(
        "use of Doppler",
        "none: range alone; unfolded: the velocity with its true fold, a bound; folded: as measured, by hypotheses; "
        "remainder: as measured, by the Chinese remainder of two scans of different repetition rates",
    )
    orders: Annotated[tuple[Order, ...], Field(min_length=1, max_length=3)] = key(
        "orders of the models",
        "orders of its models: 2 has an acceleration, 1 a velocity, 0 a randomly moving range",
        (2,),
    )
    manoeuvre_variance: NonNegative | tuple[NonNegative, ...] = key(
        "manoeuvre variance",
        "variance of the random derivative that a model allows for: jerk (m/s³)² of order 2, acceleration (m/s²)² of"
        " order 1, velocity (m/s)² of order 0; a list for several orders, in their order",
        symbol="D_M",
        unit="",
        process_noise=True,
    )
    hypotheses: Annotated[int, WholeNumber(1, MAX_HYPOTHESES)] | None = key(
        "hypotheses kept",
        "folded: largest number of fold sequences kept; 1: the nearest fold; default: 300",
        300,
        only=LISTS_HYPOTHESES,
    )
    prune_below: Annotated[Probability, Field(lt=1)] | None = key(
        "ratio below which a hypothesis is dropped",
        "folded: a hypothesis is dropped below this ratio to the best one's probability; 0: never; default: 1e-6",
        1e-6,
        only=LISTS_HYPOTHESES,
    )
    merge: Literal["never", "each_scan"] | None = key(
        "merging of hypotheses",
        "folded: keep hypotheses over scans, or merge them into one at each scan; default: never",
        "never",
        only={"doppler": "folded"},
    )
    estimate: Literal["best", "mean"] | None = key(
        "estimate",
        "folded: the best hypothesis, or the mean of all by their probabilities; default: mean",
        "mean",
        only=LISTS_HYPOTHESES,
    )
    combine: Literal["likelihood", "expected_error", "intersection"] | None = key(
        "combination of model orders",
        "several orders: likelihood (IMM, with transitions between orders), expected_error (the linear "
        "combination of least error over `manoeuvres`), intersection (the smoothest order whose interval "
        "intersects those of all rougher ones)",
        None,
    )
    stay_probability: Annotated[Probability, Field(gt=0, lt=1)] | None = key(
        "probability that an order persists",
        "likelihood: probability that an order persists from scan to scan; default: 0.95",
        0.95,
        only={"combine": "likelihood"},
    )
    manoeuvres: Manoeuvres | None = key(
        "expected manoeuvres", "expected_error: the expected manoeuvres", only={"combine": "expected_error"}
    )

    @property
    def variances(self) -> tuple[float, ...]:
        """The manoeuvre variance of each order."""
        variance = self.manoeuvre_variance
        return variance if isinstance(variance, tuple) else (variance,)

    @property
    def folds(self) -> bool:
        """Whether it takes the velocity as measured, folded."""
        return self.doppler in ("folded", "remainder")

    @cross_check
    def _orders_and_variances(self) -> Iterator[CheckError]:
        if len(self.variances) != len(self.orders):
            count = len(self.orders)
            yield check_error(
                "manoeuvre_variance", f"must be a list of {count}, one for each order" if count > 1 else "must be one"
            )

    @cross_check
    def _orders_differ(self) -> Iterator[CheckError]:
        if list(self.orders) != sorted(set(self.orders)):
            yield check_error("orders", "must increase, without repetition")

    @cross_check
    def _combined(self) -> Iterator[CheckError]:
        if len(self.orders) > 1 and self.combine is None:
            yield check_error("combine", "is needed by several orders: likelihood, expected_error or intersection")
        elif len(self.orders) == 1 and self.combine is not None:
            yield check_error("combine", "has no effect on one order; leave it out")
        elif self.combine is not None and self.doppler == "remainder":
            yield check_error("combine", "has no doppler: remainder, which unfolds for one order")


def _carried_filter(data: Any) -> Any:
    """The keys of a filter of range_doppler as those of this study; keys without a counterpart are left as they are."""
    doppler_by_observed = {("range",): "none", ("range", "velocity"): "folded"}
    if not isinstance(data, dict) or "python" in data or not isinstance(observed := data.get("observes"), list | tuple):
        return data
    replaced = {"observes": None, "initial_scans": None, "kind": "kalman", "process_noise": "random_jerk"}
    kept_keys = {
        name: value for name, value in data.items() if name not in replaced or replaced[name] not in (None, value)
    }
    return {**kept_keys, "doppler": doppler_by_observed.get(tuple(observed), observed)}


class RareFolds(rare_event_keys.RareEvent):
    """Rare wrong folds: realisations shifted towards them, and weights that correct for the shift."""

    filter: key_types.Name = key("filter", "the filter whose wrong folds at the last scan are sampled")

    @property
    def aimed_at(self) -> str:
        return self.filter


class Keys(radial_keys.TimedStudyKeys):
    """Folded Doppler: how much it gains, and after how many scans."""

    figure_names = (
        *(f"{kind}_{component}" for component in ("r", "Vr", "ar") for kind in ("sigma", "gain", "dynamic")),
        "right",
        "lost",
        "hypotheses",
        "orders",
    )
    most_scans: ClassVar[int] = MAX_SCANS

    radar: Radar = key("radar", "the radar")
    target: Annotated[Target, marks.Scenario()] = key("target", "the target: a scenario's stem, or inline")
    prior: Annotated[Prior, DesignMark()] = key(
        "prior", "what the filters know before the first plot", Prior.model_validate({})
    )
    filters: study_keys.Members[Filter] = key("filters", "the filters; all see the same plots")
    baseline: study_keys.Baseline = study_keys.BASELINE
    scans: Annotated[Annotated[int, WholeNumber(2, MAX_SCANS)] | None, DesignMark()] = study_keys.SCANS
    duration_s: Annotated[Positive | None, DesignMark(), marks.LaterKeyMark()] = study_keys.DURATION
    rare: Annotated[RareFolds | None, DesignMark(), marks.LaterKeyMark()] = key(
        "rare wrong folds",
        "importance sampling of wrong folds, for filters that are almost always right: rare.csv",
        None,
    )

    @model_validator(mode="after")
    def _completed(self) -> Self:
        """The config with the number of scans, the prior and the target's standard deviations filled in."""
        prior = self.prior.fitted_to(self.target)
        updates = {"scans": self.plots, "duration_s": None, "prior": prior}
        if not isinstance(self.target, RandomPolynomial):
            return self.model_copy(update=updates)
        sigmas = {
            name: getattr(prior, name)
            for name in ("sigma_velocity_mps", "sigma_acceleration_mps2")
            if getattr(self.target, name) is None
        }
        return self.model_copy(update=updates | {"target": self.target.model_copy(update=sigmas)})

    @classmethod
    def convert_keys(cls, study: str, data: Mapping[str, Any]) -> dict[str, Any] | None:
        """A config of range_doppler as one of this study.

        Filters with velocity take it folded, and a filter is added that is the first of them with known folds. All
        start from the prior instead of least squares."""
        if study != "range_doppler":
            return None
        carried, filters = dict(data), data.get("filters")
        if isinstance(radar := data.get("radar"), dict):
            carried["radar"] = {name: value for name, value in radar.items() if name not in BIAS_KEYS or value != 0}
        if isinstance(filters, list):
            carried_filters = [_carried_filter(f) for f in filters]
            folded = [f for f in carried_filters if isinstance(f, dict) and f.get("doppler") == "folded"]
            oracle = [f | {"name": f"{f.get('name')} {ORACLE_SUFFIX}", "doppler": "unfolded"} for f in folded[:1]]
            carried["filters"] = [*carried_filters, *oracle]
        return carried

    @property
    def _whole_prior(self) -> Any:
        """The prior that the filters start from; checks come before it is filled in."""
        return self.prior.fitted_to(self.target)

    @cross_check
    def _prior_in_proportion(self) -> Iterator[CheckError]:
        """Refuse a prior so wide that a plot's accuracy is lost in rounding, or that the start has too many folds."""
        radar, prior = self.radar, self._whole_prior
        if prior.sigma_velocity_mps > MAX_PROPORTION * radar.sigma_velocity_mps:
            yield check_error(
                "prior.sigma_velocity_mps", f"must be at most {MAX_PROPORTION:g} times the velocity's accuracy"
            )
            return
        widest, name = max((prior.sigma_velocity_mps, "prior"), (radar.sigma_velocity_mps, "radar"))
        if widest > MAX_FOLDS * min(radar.spans_mps):
            smallest = f"{widest / MAX_FOLDS:g} m/s, {name}.sigma_velocity_mps over {MAX_FOLDS:g}"
            yield check_error("radar.repetition_rate_hz", f"its unambiguous interval must be at least {smallest}")

    @cross_check
    def _range_resolved(self) -> Iterator[CheckError]:
        radar, prior, last = self.radar, self._whole_prior, (self.plots - 1) * self.radar.scan_period_s
        if prior.sigma_acceleration_mps2 * radar.scan_period_s > MAX_PROPORTION * radar.sigma_velocity_mps:
            limit = f"{MAX_PROPORTION:g} times the velocity's accuracy a scan period"
            yield check_error("prior.sigma_acceleration_mps2", f"must be at most {limit}")
        if not isinstance(self.target, RandomPolynomial):
            yield from radial_keys.range_errors(self.target, radar, last)

    @cross_check
    def _remainders_exist(self) -> Iterator[CheckError]:
        yield from cross_checks.check_each(self.filters, self._remainder_exists)

    def _remainder_exists(self, i: int, filter_: Filter) -> Iterator[CheckError]:
        if filter_.doppler != "remainder":
            return
        joint = self.radar.joint_spans_mps
        if len(joint) == 1:
            yield check_error(f"filters.{i}.doppler", "remainder needs several rates in radar.repetition_rate_hz")
        elif not all(joint[j][k] for j in range(len(joint)) for k in range(j)):
            limit = f"in ratios of whole numbers up to {MAX_RATIO}"
            yield check_error(
                f"filters.{i}.doppler", f"remainder needs rates in radar.repetition_rate_hz that are {limit}"
            )

    @cross_check
    def _every_plot(self) -> Iterator[CheckError]:
        for i, filter_ in enumerate(self.filters):
            if filter_.combine in ("expected_error", "intersection") and self.radar.detection_probability < 1:
                yield check_error(
                    f"filters.{i}.combine", f"{filter_.combine} needs every plot: radar.detection_probability 1"
                )

    @cross_check
    def _rare_fits(self) -> Iterator[CheckError]:
        if self.rare is None:
            return
        listing = [f for f in self.filters if f.doppler == "folded" and f.merge == "never"]
        single = [f.name for f in listing if f.combine is None]
        if self.rare.filter not in single:
            names = ", ".join(single) or "there is none"
            yield check_error("rare.filter", f"must be the name of a filter of one order that lists its folds: {names}")
        if self.radar.detection_probability < 1:
            yield check_error("rare", "needs every plot: radar.detection_probability 1")
        if self.plots > MAX_RARE_SCANS:
            yield check_error("rare", f"needs at most {MAX_RARE_SCANS} scans, got {self.plots}")

    @cross_check
    def _variances_in_proportion(self) -> Iterator[CheckError]:
        yield from cross_checks.check_each(self.filters, self._variance_in_proportion)

    def _variance_in_proportion(self, i: int, filter_: Filter) -> Iterator[CheckError]:
        radar = self.radar
        powers = zip(filter_.orders, filter_.variances, strict=False)
        grown = max(math.sqrt(variance) * radar.scan_period_s**order for order, variance in powers)
        if grown > MAX_PROPORTION * radar.sigma_velocity_mps:
            limit = f"{MAX_PROPORTION:g} times the velocity's accuracy a scan"
            yield check_error(
                f"filters.{i}.manoeuvre_variance",
                f"out of proportion: its root must change velocity by at most {limit}",
            )

"""Keys of the range_doppler study (P1): a radar, a target in range, linear filters with and without the velocity."""

import math
from collections.abc import Iterator
from typing import Annotated, Literal, Self

from pydantic import AfterValidator, Field, model_validator

from radarsim.config import cross_checks, key_types, marks, radial_keys, study_keys
from radarsim.config.cross_checks import CheckError, check_error, cross_check
from radarsim.config.key_types import NonNegative, Number, Positive, key
from radarsim.config.marks import LaterKeyMark
from radarsim.config.model import Model
from radarsim.config.radial_keys import MAX_SCANS

FOLDED_STUDY = "study=ambiguous_doppler"  # takes the same config over
PLOTS_NEEDED = {1: 3, 2: 2}  # scans that determine range, velocity and acceleration, by the number of things observed


class Radar(radial_keys.Radar):
    """A surveillance radar: accuracies of one plot, the period of its scans, and what is wrong with its plots."""

    repetition_rate_hz: Positive = key(
        "pulse repetition rate",
        "pulse repetition rate, Hz: gives the unambiguous velocity; velocities are not folded",
        1000.0,
        symbol="F_r",
    )
    detection_probability: Annotated[key_types.Probability, Field(gt=0), LaterKeyMark()] = key(
        "detection probability",
        "probability that a scan gives its plot, range and velocity together",
        1.0,
        symbol="P_D",
    )
    bias_range_m: Annotated[Number, LaterKeyMark()] = key(
        "bias of the measured range", "mean error of a measured range, m", 0.0
    )
    bias_velocity_mps: Annotated[Number, LaterKeyMark()] = key(
        "bias of the measured radial velocity", "mean error of a measured velocity, m/s", 0.0
    )
    sigma_bias_range_m: Annotated[NonNegative, LaterKeyMark()] = key(
        "σ of the random bias in range",
        "standard deviation of an additional error of range, drawn once per realisation, m",
        0.0,
    )
    sigma_bias_velocity_mps: Annotated[NonNegative, LaterKeyMark()] = key(
        "σ of the random bias in radial velocity",
        "standard deviation of an additional error of velocity, drawn once per realisation, m/s",
        0.0,
    )

    @property
    def as_the_papers(self) -> bool:
        """Whether every scan gives a plot, and plots err by noise alone."""
        errors = (self.bias_range_m, self.bias_velocity_mps, self.sigma_bias_range_m, self.sigma_bias_velocity_mps)
        return self.detection_probability == 1 and not any(errors)


class JerkPulse(radial_keys.ManoeuvreStart):
    """A polynomial with a jerk for a while; the acceleration it has built up stays."""

    kind: Literal["jerk_pulse"] = key("kind", "a constant jerk for a while")
    coefficients: radial_keys.Coefficients = key("derivatives of the range at the first plot", radial_keys.COEFFICIENTS)
    jerk_mps3: Annotated[Number, Field(ge=-radial_keys.MAX_ACCELERATION_MPS2, le=radial_keys.MAX_ACCELERATION_MPS2)] = (
        key("jerk", "radial jerk added during the pulse, m/s³")
    )
    duration_s: Positive = key("duration", "length of the pulse, s")

    def reach_m(self, t: float) -> float:
        """A bound on the range up to a time t (s)."""
        return radial_keys.polynomial_reach_m(self.coefficients, t) + abs(self.jerk_mps3) * t**3 / 6


DisplacementSigma = Annotated[NonNegative, LaterKeyMark()]


class RandomFlight(Model):
    """A flight in space with a random first state: it is displaced, and flies the same accelerations."""

    sigma_position_m: DisplacementSigma = key(
        "σ of the first position",
        "standard deviation of each coordinate of its first position, drawn for each realisation, m",
        0.0,
    )
    sigma_velocity_mps: DisplacementSigma = key(
        "σ of the first velocity",
        "standard deviation of each coordinate of its first velocity, drawn for each realisation, m/s",
        0.0,
    )


class Turn(RandomFlight, radial_keys.Turn):
    """Straight flight in a plane through the radar, a turn of constant load, straight flight again."""


class FlyBy(RandomFlight, radial_keys.FlyBy):
    """Straight flight at a constant speed past the radar, at a distance."""


class RecordedFlight(RandomFlight, radial_keys.RecordedTarget):
    """A flight recorded in a file, smoothed by a spline whose derivatives are the true velocity and acceleration."""


Target = Annotated[
    radial_keys.Polynomial | radial_keys.AccelerationStart | JerkPulse | Turn | FlyBy | RecordedFlight,
    Field(discriminator="kind"),
]
Noise = Literal["random_jerk", "white_jerk", "white_acceleration"]
MINIMISED = "sigma_r", "sigma_Vr", "sigma_ar"  # the components of an error, with the key `over`


def _checked_phrase(text: str) -> str:
    """An error to minimise, or a phrase that says it with the scans. Raises ValueError."""
    if text not in MINIMISED:
        from radarsim.studies.range_doppler.minimise_keys import check_phrase

        check_phrase(text, MINIMISED)
    return text


class Best(Model):
    """A manoeuvre variance that is looked for: the one with which this filter's exact error on this target is least."""

    minimise: Annotated[str, AfterValidator(_checked_phrase)] = key(
        "error to minimise",
        "the error that is minimised: sigma_r, sigma_Vr or sigma_ar with `over`; or a phrase with the scans: worst "
        "sigma r, mean sigma Vr from 60 s, sigma r at 60 s, sigma r at the end",
    )
    over: Literal["worst", "mean", "last", "at"] | None = key(
        "taken over scans as", "value over scans from from_k on: greatest, mean or last; `at`: that at from_k", None
    )
    from_k: Annotated[int, key_types.WholeNumber(1, MAX_SCANS)] | None = key(
        "first scan that counts",
        "first scan that counts; default: the one at which the target's manoeuvre begins, else the filters settle",
        None,
    )

    @cross_check
    def _says_scans_once(self) -> Iterator[CheckError]:
        if self.minimise not in MINIMISED and self.over is not None:
            yield check_error("over", f"stands in minimise already: {self.minimise!r}")
        elif self.minimise in MINIMISED and self.over is None:
            yield check_error("over", "required key is missing: worst, mean, last or at")
        elif self.over == "at" and self.from_k is None:
            yield check_error("from_k", "required key is missing: the scan at which the error is taken")


class FilterKeys(Model):
    """What every filter has, those of packages too: what it observes, and a start by least squares."""

    name: Annotated[key_types.Name, marks.DisplayMark()] = key("name", "label; every filter has its own")
    kind: str = key("kind", "which filter it is")
    observes: tuple[Literal["range", "velocity"], ...] = key(
        "observed quantities", "measurements that it uses: [range] or [range, velocity]"
    )
    initial_scans: Annotated[int, key_types.WholeNumber(2, MAX_SCANS)] | None = key(
        "plots in the initialisation",
        "plots in its least-squares start; default and least: 3 for range, 2 with velocity",
        None,
    )

    @cross_check
    def _can_start(self) -> Iterator[CheckError]:
        if self.observes not in (("range",), ("range", "velocity")):
            yield check_error("observes", "must be [range] or [range, velocity]")
        elif self.plots_to_start < PLOTS_NEEDED[len(self.observes)]:
            min_plots = PLOTS_NEEDED[len(self.observes)]
            yield check_error(
                "initial_scans", f"must be >= {min_plots} for a filter that observes {' and '.join(self.observes)}"
            )

    @model_validator(mode="after")
    def _completed(self) -> Self:
        return self.model_copy(update={"initial_scans": self.plots_to_start})

    @property
    def plots_to_start(self) -> int:
        """Scans in the least-squares start, given or by default."""
        return self.initial_scans or PLOTS_NEEDED[len(self.observes)]


class Filter(FilterKeys):
    """A second-order Kalman filter started by least squares."""

    kind: Annotated[Literal["kalman"], LaterKeyMark()] = key("kind", "the Kalman filter of the study", "kalman")
    manoeuvre_variance: Positive | Best = key(
        "manoeuvre variance",
        "variance of the random jerk it allows for, (m/s³)²: D_M; or the error that it minimises",
        symbol="D_M",
        unit="(m/s³)²",
        process_noise=True,
    )
    process_noise: Noise = key(
        "process noise",
        "form of the allowed manoeuvre within a scan: a constant jerk (the paper's), white jerk, or a "
        "step of the acceleration; with each, the variance of the acceleration grows by D_M times the "
        "squared period per scan",
        "random_jerk",
    )


def with_completed_variance(filter_keys: Filter, scan_period_s: float) -> Filter:
    """A filter whose D_M minimises a phrase with the keys that it stands for, so that both are one case."""
    best = configured_variance(filter_keys)
    if not isinstance(best, Best) or best.minimise in MINIMISED:
        return filter_keys
    from radarsim.studies.range_doppler.minimise_keys import phrase_keys

    best = best.model_copy(update=phrase_keys(best.minimise, best.from_k, scan_period_s))
    return filter_keys.model_copy(update={"manoeuvre_variance": best})


def configured_variance(filter_keys: FilterKeys) -> float | Best:
    """A filter's D_M, (m/s³)²; not-a-number where it has none, as one of a package may."""
    return getattr(filter_keys, "manoeuvre_variance", math.nan)


class Keys(radial_keys.TimedStudyKeys):
    """Range alone against range and radial velocity."""

    figure_names = (
        *(f"{kind}_{component}" for component in ("r", "Vr", "ar") for kind in ("sigma", "gain", "dynamic")),
        "settling",
        "consistency",
    )

    radar: Radar = key("radar", "the radar")
    target: Annotated[Target, marks.Scenario()] = key("target", "the target: a scenario's stem, or inline")
    filters: study_keys.Members[Filter] = key("filters", "the filters; all see the same plots")
    baseline: study_keys.Baseline = study_keys.BASELINE
    scans: Annotated[Annotated[int, key_types.WholeNumber(2, MAX_SCANS)] | None, marks.DesignMark()] = study_keys.SCANS
    duration_s: Annotated[Positive | None, marks.DesignMark(), LaterKeyMark()] = study_keys.DURATION

    @model_validator(mode="after")
    def _completed(self) -> Self:
        filters = tuple(with_completed_variance(f, self.radar.scan_period_s) for f in self.filters)
        return self.model_copy(update={"scans": self.plots, "duration_s": None, "filters": filters})

    @cross_check
    def _long_enough(self) -> Iterator[CheckError]:
        starts = cross_checks.valid_values(
            self.filters, lambda filter_keys: (filter_keys.plots_to_start, filter_keys.name)
        )
        plots, slowest = max(starts, key=lambda start: start[0], default=(0, ""))
        if self.plots < plots:
            duration_key = "scans" if self.duration_s is None else "duration_s"
            unit_text = "" if duration_key == "scans" else " scans of radar.scan_period_s"
            yield check_error(duration_key, f"must be >= {plots}{unit_text} for the initialisation of filter {slowest}")
        yield from cross_checks.check_each(self.filters, self._counts_from)

    def _counts_from(self, i: int, filter_keys: FilterKeys) -> Iterator[CheckError]:
        best = configured_variance(filter_keys)
        if isinstance(best, Best) and not isinstance(filter_keys, Filter):
            yield check_error(
                f"filters.{i}.manoeuvre_variance",
                f"must be a number: the best one of kind {filter_keys.kind} is not known",
            )
        elif isinstance(best, Best) and (best.from_k or 0) > self.plots:
            yield check_error(f"filters.{i}.manoeuvre_variance.from_k", f"must be <= the number of scans, {self.plots}")
        elif isinstance(best, Best) and best.minimise not in MINIMISED:
            from radarsim.studies.range_doppler.minimise_keys import phrase_errors

            run = self.plots, self.radar.scan_period_s
            yield from phrase_errors(f"filters.{i}.manoeuvre_variance", best.minimise, best.from_k, *run)

    @cross_check
    def _of_every_plot(self) -> Iterator[CheckError]:
        yield from cross_checks.check_each(self.filters, self._sees_every_plot)

    def _sees_every_plot(self, i: int, filter_keys: FilterKeys) -> Iterator[CheckError]:
        if not isinstance(filter_keys, Filter) and self.radar.detection_probability < 1:
            message = (
                f"must be 1 with filter {filter_keys.name}: "
                f"gains of kind {filter_keys.kind} are made for a plot at every scan"
            )
            yield check_error("radar.detection_probability", message)

    @cross_check
    def _accuracies_in_proportion(self) -> Iterator[CheckError]:
        """Refuse accuracies of which one makes the other meaningless.

        Beyond these limits the steady covariance drowns in rounding (SciPy's solver gives up at 1e15).
        """
        radar = self.radar
        value = (radar.sigma_range_m / (radar.scan_period_s * radar.sigma_velocity_mps)) ** 2
        if not 1e-12 <= value <= 1e12:
            ratio = "(sigma_range_m / scan_period_s / sigma_velocity_mps)²"
            yield proportion_error("radar.sigma_velocity_mps", ratio, value, "from 1e-12 to 1e12")

    @cross_check
    def _variances_in_proportion(self) -> Iterator[CheckError]:
        """The same of manoeuvre variances."""
        if not any(True for _ in self._accuracies_in_proportion()):  # else that is the fault
            yield from cross_checks.check_each(self.filters, self._in_proportion)

    def _in_proportion(self, i: int, filter_keys: FilterKeys) -> Iterator[CheckError]:
        variance = configured_variance(filter_keys)
        if isinstance(variance, Best) or math.isnan(variance):
            return
        radar, dt = self.radar, self.radar.scan_period_s
        name = f"filters.{i}.manoeuvre_variance"
        in_range, in_velocity = (
            variance * dt**6 / radar.sigma_range_m**2,
            variance * dt**4 / radar.sigma_velocity_mps**2,
        )
        if not 1e-28 <= in_range <= 1e12:
            ratio = "manoeuvre_variance scan_period_s⁶ / sigma_range_m²"
            yield proportion_error(name, ratio, in_range, "from 1e-28 to 1e12")
        elif "velocity" in filter_keys.observes and in_velocity > 1e12:
            ratio = "manoeuvre_variance scan_period_s⁴ / sigma_velocity_mps²"
            yield proportion_error(name, ratio, in_velocity, "<= 1e12")

    @cross_check
    def _within_reach(self) -> Iterator[CheckError]:
        last = (self.plots - 1) * self.radar.scan_period_s
        yield from radial_keys.range_errors(self.target, self.radar, last)


def proportion_error(key: str, ratio: str, value: float, limits: str) -> CheckError:
    """The error of a key that makes a ratio of values too small or too large."""
    return check_error(key, f"out of proportion: {ratio}, here {value:.3g}, must be {limits}")


def can_fold(spec: Keys) -> bool:
    """Whether the config can be carried over to folded velocities: it has nothing that only this study knows."""
    target, has_study_filters = spec.target, all(isinstance(filter_keys, Filter) for filter_keys in spec.filters)
    has_random_flight = any(getattr(target, name, 0) for name in ("sigma_position_m", "sigma_velocity_mps"))
    noises = {getattr(filter_keys, "process_noise", "") for filter_keys in spec.filters}
    has_fixed_variances = all(isinstance(configured_variance(filter_keys), float) for filter_keys in spec.filters)
    radar = spec.radar.model_copy(update={"detection_probability": 1.0})
    return (
        has_study_filters
        and has_fixed_variances
        and noises == {"random_jerk"}
        and radar.as_the_papers
        and not has_random_flight
        and target.kind != "jerk_pulse"
    )

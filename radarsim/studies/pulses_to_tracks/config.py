"""Keys of the pulses_to_tracks study: a radar and its burst, a target in range, filters with the burst's estimator."""

import math
from collections.abc import Iterator
from typing import Annotated, Any, ClassVar, Literal, Self

from pydantic import Field, model_validator

from radarsim.config import cross_checks, key_types, marks, radial_keys, study_keys
from radarsim.config.cross_checks import CheckError, check_error, cross_check
from radarsim.config.key_types import Positive, WholeNumber, key
from radarsim.config.marks import DesignMark, DisplayMark
from radarsim.config.model import Model
from radarsim.config.radial_keys import MIN_RANGE_M, TimedStudyKeys
from radarsim.config.value_text import short_number
from radarsim.constants import Band

MAX_SCANS = 1000  # each scan has its own windows
MIN_PULSES, MAX_PULSES = 4, 4096
SWEEP_SIGMAS = 3.0  # standard deviations of the prior in the check of the repetition rate
MAX_DERIVATIVES = 1
MAX_HYPOTHESES = 1000
HYPOTHESIS_DEFAULTS = {"prune_below": 1e-6, "estimate": "mean"}  # of filters that keep several hypotheses
SEQUENCES = ("sequence", "dense", "cured")
Target = Annotated[
    radial_keys.Polynomial
    | radial_keys.AccelerationStart
    | radial_keys.Turn
    | radial_keys.FlyBy
    | radial_keys.RecordedTarget,
    Field(discriminator="kind"),
]


class Radar(radial_keys.WaveBandKeys):
    """A surveillance radar: wavelength, accuracy of a range, period of its scans. Its velocity comes from the burst."""

    name: Annotated[key_types.Name | None, DisplayMark()] = key("name", "display name", None)
    band: Annotated[Band | None, DisplayMark()] = key(
        "band", "wave band, for display: by its wavelength, or by its letter (IEEE Std 521)", None
    )
    wavelength_m: Positive = key("wavelength", "wavelength, m", symbol="λ")
    sigma_range_m: Positive = key("σ of the measured range", "standard deviation of a measured range, m", symbol="σ_r")
    scan_period_s: Positive = key("scan period", "time between two bursts, s", symbol="Δt")


class Burst(Model):
    """The coherent burst of a scan, one complex sample a pulse behind the filter that is matched to it."""

    repetition_rate_hz: Positive = key(
        "pulse repetition rate",
        "pulse repetition rate, Hz; the velocity is folded modulo λ/2 times this rate",
        symbol="F_r",
    )
    pulses: Annotated[int, WholeNumber(MIN_PULSES, MAX_PULSES)] | None = key(
        "pulses of a burst", "number of pulses; or give pulses_per_second", None, symbol="N"
    )
    pulses_per_second: Positive | None = key(
        "pulses a second",
        "ratio of pulses to the scan period, 1/s, in place of pulses: a constant share of time",
        None,
        unit="1/s",
    )
    pulse_length_s: Positive = key(
        "pulse length",
        "length of a pulse, s: the matched filter loses sinc² of it times the Doppler frequency",
        symbol="t_p",
    )
    snr_db: Annotated[key_types.Number, Field(ge=-60, le=100)] = key(
        "signal-to-noise ratio of a pulse",
        "ratio of the power of the echo to that of the noise in the sample of a pulse, dB",
        unit="dB",
        symbol="q",
    )
    snr_range_m: Positive | None = key(
        "range of the signal-to-noise ratio",
        "range at which snr_db applies, m: it falls with the fourth power of range; default: the same everywhere",
        None,
    )

    @cross_check
    def _one_number(self) -> Iterator[CheckError]:
        if (self.pulses is None) == (self.pulses_per_second is None):
            yield check_error("pulses", "give either pulses or pulses_per_second")

    @cross_check
    def _pulse_fits(self) -> Iterator[CheckError]:
        if self.pulse_length_s * self.repetition_rate_hz > 1:
            yield check_error(
                "pulse_length_s", f"must be <= 1/repetition_rate_hz, {short_number(1 / self.repetition_rate_hz)} s"
            )


class Prior(Model):
    """What is known when the track begins: the errors of a designation about the truth, drawn, Gaussian."""

    sigma_velocity_mps: Positive = key(
        "σ of the designated velocity", "standard deviation of the radial velocity, m/s", symbol="σ_V0"
    )
    sigma_acceleration_mps2: Positive = key(
        "σ of the designated acceleration", "standard deviation of the radial acceleration, m/s²", symbol="σ_a0"
    )


class Forecast(Model):
    """A forecast that is the same at each scan: errors about the truth, drawn independently, Gaussian."""

    sigma_velocity_mps: Positive = key("σ of the forecast velocity", "standard deviation of the radial velocity, m/s")
    sigma_acceleration_mps2: Positive = key(
        "σ of the forecast acceleration", "standard deviation of the radial acceleration, m/s²"
    )


class Filter(Model):
    """A Kalman filter of ranges, and of an estimator's numbers from the burst."""

    name: Annotated[key_types.Name, DisplayMark()] = key("name", "label; every filter has its own")
    observes: tuple[Literal["range", "velocity", "acceleration"], ...] = key(
        "observes", "measurements that it uses: [range], [range, velocity] or [range, velocity, acceleration]"
    )
    manoeuvre_variance: key_types.NonNegative = key(
        "manoeuvre variance",
        "variance of the random jerk it allows for, (m/s³)²; as in P1, not during its initial scans",
        symbol="D_M",
        unit="(m/s³)²",
        process_noise=True,
    )
    process_noise: Literal["random_jerk", "white_jerk", "white_acceleration"] = key(
        "process noise",
        "form of the allowed manoeuvre within a scan: a constant jerk (P1's, where the velocity "
        "determines the acceleration), white jerk, or a step of the acceleration",
        "random_jerk",
    )
    estimator: Literal["sequence", "dense", "cured", "spectrum", "fisher_bound"] | None = key(
        "estimator",
        "how the burst is estimated: P4's sequence of windows, with twice as many, with the search where coherence "
        "is short; peak of the spectrum and Fisher scoring; or ideal Gaussian errors; default: cured",
        None,
    )
    forecast: Literal["track"] | Forecast | None = key(
        "forecast",
        "where a sequence starts and how wide its first window is: track (the filter's own prediction with its "
        "covariance), or a forecast of fixed accuracy; default: track",
        None,
    )
    derivatives: Annotated[int, WholeNumber(0, MAX_DERIVATIVES)] | None = key(
        "derivatives estimated",
        "derivatives of the Doppler frequency that are estimated; default: 1 with the acceleration, else 0 (it is "
        "then taken as forecast)",
        None,
    )
    use: Literal["as_measured", "gated", "mixture"] | None = key(
        "use of an estimate",
        "as_measured: every estimate as if it had locked; gated: those near the prediction; mixture: "
        "weighted by the probability that it locked; default: as_measured",
        None,
    )
    gate_probability: Annotated[float, Field(gt=0, lt=1)] | None = key(
        "gate probability",
        "gated: probability that a locked estimate is within the gate; default: 0.999",
        0.999,
        only={"use": "gated"},
    )
    lock_probability: Annotated[float, Field(gt=0, lt=1)] | None = key(
        "lock probability",
        "mixture: prior probability that an estimate has locked; default: 0.95",
        0.95,
        only={"use": "mixture"},
    )

    hypotheses: Annotated[int, WholeNumber(1, MAX_HYPOTHESES)] | None = key(
        "hypotheses kept",
        "largest number of hypotheses kept on the folds of its velocities (and, in a mixture, on which "
        "bursts locked), as for folded velocity; default: 1, the fold nearest to the prediction",
        None,
    )
    prune_below: Annotated[key_types.Probability, Field(lt=1)] | None = key(
        "ratio below which a hypothesis is dropped",
        "several hypotheses: one is dropped below this ratio to the best one's probability; 0: never; default: 1e-6",
        None,
    )
    estimate: Literal["best", "mean"] | None = key(
        "estimate", "several hypotheses: the best one, or the mean of all by their probabilities; default: mean", None
    )

    @property
    def takes(self) -> int:
        """The number of quantities that it takes from the burst: none, the velocity, or also the acceleration."""
        return len(self.observes) - 1

    @cross_check
    def _observes_what_there_is(self) -> Iterator[CheckError]:
        allowed = ("range", "velocity", "acceleration")
        if not self.observes or self.observes != allowed[: len(self.observes)]:
            yield check_error("observes", "must be [range], [range, velocity] or [range, velocity, acceleration]")

    @cross_check
    def _keys_have_an_effect(self) -> Iterator[CheckError]:
        if self.observes == ("range",):
            for name in ("estimator", "forecast", "derivatives", "use", "hypotheses", *HYPOTHESIS_DEFAULTS):
                if getattr(self, name) is not None:
                    yield check_error(name, "has no effect on range alone; leave it out")
            return
        if self.estimator in ("spectrum", "fisher_bound") and self.forecast is not None:
            yield check_error("forecast", f"has no effect with estimator: {self.estimator}; leave it out")
        if self.estimator == "fisher_bound" and self.use not in (None, "as_measured"):
            yield check_error("use", "must be as_measured with estimator: fisher_bound, whose estimates always lock")

    @cross_check
    def _folds_by_hypotheses(self) -> Iterator[CheckError]:
        if not self.takes:
            return
        if self.estimator == "fisher_bound" and self.hypotheses is not None:
            yield check_error(
                "hypotheses", "has no effect with estimator: fisher_bound, which has the true fold; leave it out"
            )
        several = (self.hypotheses or 1) > 1
        if several and self.use == "gated":
            yield check_error(
                "use", "must be as_measured or mixture with several hypotheses, which weigh what a gate would cut"
            )
        for name in HYPOTHESIS_DEFAULTS:
            if getattr(self, name) is not None and not several:
                yield check_error(name, "has no effect without hypotheses: 2 or more; leave it out")

    @cross_check
    def _acceleration_is_estimated(self) -> Iterator[CheckError]:
        if self.takes == 2 and self.derivatives == 0:
            yield check_error("derivatives", "must be >= 1 for a filter that observes the acceleration")

    @model_validator(mode="after")
    def _completed(self) -> Self:
        """The filter with the defaults of all keys that have an effect filled in."""
        if self.takes == 0:
            return self
        defaults: dict[str, Any] = {"estimator": "cured", "derivatives": self.takes - 1, "use": "as_measured"}
        if (self.estimator or "cured") in SEQUENCES:
            defaults["forecast"] = "track"
        if self.estimator != "fisher_bound":
            defaults |= {"hypotheses": 1} | (HYPOTHESIS_DEFAULTS if (self.hypotheses or 1) > 1 else {})
        missing = {name: value for name, value in defaults.items() if getattr(self, name) is None}
        return self.model_copy(update=missing) if missing else self


class Keys(TimedStudyKeys):
    """From pulses to tracks: which accuracy a number of pulses gives, and how much a lost lock costs."""

    figure_names = (
        *(f"{kind}_{component}" for component in ("r", "Vr", "ar") for kind in ("sigma", "gain", "dynamic")),
        "locks",
        "folds",
        "measured",
        "losses",
        "threshold",
    )
    most_scans = MAX_SCANS
    in_place_of: ClassVar = {
        **TimedStudyKeys.in_place_of,
        "burst.pulses": "burst.pulses_per_second",
        "burst.pulses_per_second": "burst.pulses",
    }

    radar: Radar = key("radar", "the radar")
    burst: Burst = key("burst", "the burst of each scan")
    target: Annotated[Target, marks.Scenario()] = key("target", "the target: a scenario's stem, or inline")
    prior: Prior = key("designation", "what is known when the track begins")
    filters: study_keys.Members[Filter] = key("filters", "the filters; all see the same ranges and bursts")
    baseline: study_keys.Baseline = study_keys.BASELINE
    scans: Annotated[Annotated[int, WholeNumber(2, MAX_SCANS)] | None, DesignMark()] = study_keys.SCANS
    duration_s: Annotated[Positive | None, DesignMark()] = study_keys.DURATION

    @property
    def pulses(self) -> int:
        """The pulses of a burst, as configured or from their number per second."""
        burst = self.burst
        if burst.pulses is not None:
            return burst.pulses
        if burst.pulses_per_second is None:
            raise cross_checks.InvalidFieldError("pulses")
        return round(burst.pulses_per_second * self.radar.scan_period_s)

    @property
    def burst_s(self) -> float:
        """Length of a burst: a period for every pulse, s."""
        return self.pulses / self.burst.repetition_rate_hz

    @property
    def span_mps(self) -> float:
        """The span into which velocity folds, λF/2, m/s."""
        return self.radar.wavelength_m * self.burst.repetition_rate_hz / 2

    @model_validator(mode="after")
    def _completed(self) -> Self:
        burst = self.burst.model_copy(update={"pulses": self.pulses, "pulses_per_second": None})
        update = {"burst": burst, "scans": self.plots, "duration_s": None}
        return self.model_copy(update=update)

    @cross_check
    def _pulses_in_bounds(self) -> Iterator[CheckError]:
        if self.burst.pulses is None and not MIN_PULSES <= self.pulses <= MAX_PULSES:
            bounds = f"{MIN_PULSES} to {MAX_PULSES} pulses in radar.scan_period_s, makes {self.pulses}"
            yield check_error("burst.pulses_per_second", f"must be {bounds}")

    @cross_check
    def _burst_fits_the_scan(self) -> Iterator[CheckError]:
        if self.burst_s > self.radar.scan_period_s:
            message = f"the burst must be <= radar.scan_period_s, {short_number(self.radar.scan_period_s)} s"
            name = "pulses" if self.burst.pulses is not None else "pulses_per_second"
            yield check_error(f"burst.{name}", f"{message}, is {short_number(self.burst_s)} s")

    @cross_check
    def _rate_carries_the_derivatives(self) -> Iterator[CheckError]:
        """Refuse a burst over which the forecast acceleration could sweep the frequency past half the rate."""
        if not any(f.takes for f in self.filters):
            return
        swept_hz = 2 / self.radar.wavelength_m * SWEEP_SIGMAS * self.prior.sigma_acceleration_mps2 * self.burst_s
        if self.burst.repetition_rate_hz < 2 * swept_hz:
            swept = f"twice what {SWEEP_SIGMAS:g} σ of the prior's acceleration sweep over the burst"
            yield check_error("burst.repetition_rate_hz", f"must be >= {short_number(2 * swept_hz)} Hz, {swept}")

    @cross_check
    def _enough_pulses(self) -> Iterator[CheckError]:
        yield from cross_checks.check_each(self.filters, self._determined)

    def _determined(self, i: int, filter_: Filter) -> Iterator[CheckError]:
        parameters = 2 + (filter_.derivatives if filter_.derivatives is not None else max(filter_.takes - 1, 0))
        if filter_.takes and self.pulses < 2 * parameters:
            message = f"{self.pulses} pulses are too few for {parameters} parameters: at least {2 * parameters}"
            yield check_error(
                f"filters.{i}.derivatives" if filter_.derivatives is not None else "burst.pulses", message
            )

    @cross_check
    def _in_proportion(self) -> Iterator[CheckError]:
        dt, sigma = self.radar.scan_period_s, self.radar.sigma_range_m
        for name, value in (
            ("sigma_velocity_mps", self.prior.sigma_velocity_mps * dt),
            ("sigma_acceleration_mps2", self.prior.sigma_acceleration_mps2 * dt**2),
        ):
            if not 1e-6 <= value / sigma <= 1e6:
                message = (
                    "out of proportion: what it moves a target in a scan over sigma_range_m must be from 1e-6 to 1e6"
                )
                yield check_error(f"prior.{name}", message)

    @cross_check
    def _target_in_reach(self) -> Iterator[CheckError]:
        target: Any = self.target
        last = (self.plots - 1) * self.radar.scan_period_s
        if not math.isfinite(target.reach_m(last)) or target.reach_m(last) > 1e12:
            yield check_error("target", "must stay within 1e12 m of the radar up to the last scan")
        elif isinstance(target, radial_keys.Turn) and target.closest_m(last) < MIN_RANGE_M:
            yield check_error(
                "target", f"must not fly over the radar: it comes within {short_number(MIN_RANGE_M)} m of it"
            )

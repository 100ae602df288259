"""Keys of the discriminator study (P4): a burst, its echo, a forecast, estimators of Doppler and its derivatives."""

from collections.abc import Iterator
from itertools import pairwise
from typing import Annotated, Literal

from pydantic import Field

from radarsim.config import cross_checks, key_types, marks, rare_event_keys, study_keys
from radarsim.config.cross_checks import CheckError, check_error, cross_check
from radarsim.config.key_types import Flag, Name, Number, Positive, WholeNumber, key
from radarsim.config.marks import DesignMark, LaterKeyMark
from radarsim.config.model import Model

MAX_SAMPLES = 1_000_000
MAX_DERIVATIVES = 4
MIN_PULSES = 16
MAX_WINDOWS = 200
Share = Annotated[float, Field(gt=0.5, lt=1)]


class Burst(Model):
    """A coherent burst, sampled inside its pulses."""

    carrier_hz: Positive = key("carrier frequency", "carrier frequency, Hz", symbol="f_0")
    pulse_period_s: Positive = key("pulse repetition period", "time from pulse to pulse, s")
    pulse_length_s: Positive = key("pulse length", "length of a pulse, s")
    sampling_period_s: Positive = key("sampling period", "time from sample to sample inside a pulse, s")
    pulses: Annotated[int, WholeNumber(MIN_PULSES, MAX_SAMPLES)] = key("number of pulses", "number of pulses")
    amplitude: Positive = key("amplitude of the echo", "amplitude of the echo, in the samples' unit")
    noise_variance: Positive = key(
        "noise variance of a sample",
        "variance of the white noise in each real number sampled, in the samples' unit squared",
    )
    samples: Literal["real", "complex"] = key("samples", "output of the receiver", "real")

    @cross_check
    def _pulses_fit(self) -> Iterator[CheckError]:
        if self.pulse_length_s > self.pulse_period_s:
            yield check_error("pulse_length_s", "must be at most the pulse period")

    @cross_check
    def _few_samples(self) -> Iterator[CheckError]:
        if self.pulses * self.pulse_length_s / self.sampling_period_s > MAX_SAMPLES:
            yield check_error("sampling_period_s", f"the burst has over {MAX_SAMPLES} samples")

    @property
    def duration_s(self) -> float:
        """Length of the burst: a period for every pulse, s."""
        return self.pulses * self.pulse_period_s


class Truth(Model):
    """The echo's phase: from its derivatives, or from a radial velocity that is straight between given instants."""

    phase_rad: Number = key("initial phase", "phase at the start of the burst, rad", 0.0, symbol="φ_0")
    doppler_derivatives: Annotated[tuple[Number, ...], Field(min_length=1, max_length=MAX_DERIVATIVES + 1)] | None = (
        key(
            "Doppler frequency and its derivatives",
            "Doppler frequency and its derivatives at the start: Hz, Hz/s, Hz/s², …",
            None,
        )
    )
    times_s: Annotated[tuple[key_types.NonNegative, ...], Field(min_length=2, max_length=100)] | None = key(
        "times of the velocity profile",
        "instants of the velocity profile from the start of the burst, s; the first is 0",
        None,
    )
    velocities_mps: Annotated[tuple[Number, ...], Field(min_length=2, max_length=100)] | None = key(
        "radial velocities of the profile", "radial velocity at these instants, towards the radar positive, m/s", None
    )
    derivatives: Annotated[int, WholeNumber(0, MAX_DERIVATIVES)] = key(
        "estimated derivatives of the Doppler frequency",
        "with a velocity profile: derivatives of the Doppler frequency that are estimated",
        3,
    )

    @cross_check
    def _one_kind(self) -> Iterator[CheckError]:
        times, velocities = self.times_s, self.velocities_mps
        if (times is not None and velocities is not None) == (self.doppler_derivatives is not None):
            yield check_error("doppler_derivatives", "give either doppler_derivatives or times_s and velocities_mps")
        elif times is not None and velocities is not None and len(times) != len(velocities):
            yield check_error("velocities_mps", "must have as many values as times_s")

    @cross_check
    def _times_rise(self) -> Iterator[CheckError]:
        if self.times_s is not None and (self.times_s[0] != 0 or any(b <= a for a, b in pairwise(self.times_s))):
            yield check_error("times_s", "must begin with 0 and rise")

    @property
    def parameters(self) -> int:
        """Length of θ: the phase, the Doppler frequency and its derivatives."""
        return 1 + (self.derivatives + 1 if self.doppler_derivatives is None else len(self.doppler_derivatives))


Spreads = Annotated[tuple[Positive, ...], Field(min_length=2, max_length=MAX_DERIVATIVES + 2)]


class Prior(Model):
    """The forecast: independent Gaussian errors about the truth."""

    spread_over_potential: Spreads | None = key(
        "prior σ over the Cramér–Rao bound",
        "standard deviations over the Cramér–Rao bounds of the whole burst: phase, frequency, …",
        None,
    )
    sigma: Spreads | None = key(
        "prior σ", "standard deviations: rad, Hz, Hz/s, …; in place of spread_over_potential", None
    )
    scale: Positive = key("scale of the prior σ", "factor on all standard deviations", 1.0)
    error_scale: Positive = key(
        "true prior errors over the assumed ones",
        "ratio of the forecast's true errors to those that the estimators assume",
        1.0,
    )

    @cross_check
    def _one_kind(self) -> Iterator[CheckError]:
        if (self.spread_over_potential is None) == (self.sigma is None):
            yield check_error("spread_over_potential", "give either spread_over_potential or sigma")

    @property
    def standard_deviations(self) -> tuple[float, ...]:
        """The standard deviations as configured, absolute or over the Cramér–Rao bounds."""
        return self.sigma or self.spread_over_potential or ()


class Estimator(Model):
    """A sequence of windows that grow to the whole burst, Fisher scoring in each; or the classical rival."""

    name: Annotated[Name, marks.DisplayMark()] = key("name", "label; every estimator has its own")
    method: Literal["sequence", "ridge"] = key(
        "method",
        "sequence of discriminators, or short-time spectrum, robust fit, unwrapping, Fisher scoring",
        "sequence",
    )
    schedule: Literal["designed"] | Annotated[tuple[Positive, ...], Field(min_length=1, max_length=MAX_WINDOWS)] = key(
        "window lengths", "designed by (14)–(16), or a list of rising window lengths, s", "designed"
    )
    lock_probability: Share = key("probability of a hand-over", "probability P_Δ of a hand-over", 0.99, symbol="P_Δ")
    main_lobe_threshold: Positive = key(
        "main-lobe threshold", "c, no unit: 1 as in (10) and (14), 0.5 as in (11)", 1.0, symbol="c"
    )
    tail: Literal["gaussian", "exact"] = key(
        "distribution of the quadratic form",
        "distribution of the quadratic form: the paper's Gaussian, or the exact weighted sum of χ²",
        "gaussian",
    )
    density: Annotated[int, WholeNumber(1, 10)] = key(
        "windows per designed window", "windows per designed window; 2: one more at each geometric mean", 1
    )
    first_windows: Annotated[int, WholeNumber(1, MAX_WINDOWS)] | None = key(
        "windows used", "number of windows after which to stop; default: all", None
    )
    start: Literal["prior", "truth"] = key("first window", "where the first window starts", "prior")
    phases: Annotated[int, WholeNumber(0, 64)] = key(
        "phases tried in the first window", "phases tried in the first window; 0: the phase in closed form", 0
    )
    steps: Annotated[int, WholeNumber(1, 1000)] = key(
        "scoring steps per window", "Fisher-scoring iterations in a window, at most", 40
    )
    tolerance: Positive = key(
        "step that ends a window",
        "ε: step, in standard deviations, that ends a window",
        1e-3,
        symbol="ε",
        unit="standard deviations",
    )
    coherence_step: Flag = key(
        "steps that account for the coherence",
        "steps account for the coherence: far from the maximum the curvature is less than Fisher's",
        False,
    )
    search_points: Annotated[int, WholeNumber(0, 10)] = key(
        "points of the search on each side",
        "cure at a hand-over: points on each side along the leading direction of R_Δ; 0: none",
        0,
    )
    amplitude: Literal["known", "estimated", "as_printed"] = key(
        "amplitude", "given, or estimated from the energy by (7) corrected, or as printed (its square)", "known"
    )

    @cross_check
    def _rises(self) -> Iterator[CheckError]:
        if self.schedule != "designed" and any(b <= a for a, b in pairwise(self.schedule)):
            yield check_error("schedule", "window lengths must rise")


class Rare(rare_event_keys.RareEvent):
    """Losses of lock that are rare: bursts shifted towards them, and weights that make up for it."""

    estimator: Name = key("estimator", "the estimator whose losses of lock at its last window are sampled")

    @property
    def aimed_at(self) -> str:
        return self.estimator


class Keys(study_keys.StudyKeys):
    """Doppler frequency and its derivatives from one burst."""

    bare_keys = "estimators"
    figure_names = ("residuals", "locks", "accuracy", "lock_*")  # the last: of what a sweep varies

    burst: Burst = key("burst", "the burst")
    truth: Annotated[Truth, marks.Scenario()] = key("true phase", "the echo's phase: a scenario's stem, or inline")
    prior: Prior = key("prior", "the forecast")
    estimators: study_keys.Members[Estimator] = key("estimators", "the estimators; all see the same bursts")
    engine: Annotated[Literal["auto", "block_sums", "samples", "demodulated"], DesignMark()] = key(
        "way of simulation",
        "block_sums: exact sums over short blocks are drawn; samples: every step over every sample; demodulated: "
        "samples drawn and demodulated once; auto: block_sums where it is valid, else samples",
        "auto",
    )
    rare: Annotated[Rare | None, DesignMark(), LaterKeyMark()] = key(
        "rare losses of lock",
        "importance sampling of losses of lock, for sequences that lock almost always: rare.csv",
        None,
    )

    @cross_check
    def _prior_fits(self) -> Iterator[CheckError]:
        size = self.truth.parameters
        if len(self.prior.standard_deviations) != size:
            name = "spread_over_potential" if self.prior.sigma is None else "sigma"
            yield check_error(
                f"prior.{name}", f"must have {size} values: phase, Doppler frequency and {size - 2} derivatives"
            )

    @cross_check
    def _profile_fits(self) -> Iterator[CheckError]:
        if self.truth.times_s is not None and self.truth.times_s[-1] < self.burst.duration_s * (1 - 1e-9):
            yield check_error("truth.times_s", "must reach the end of the burst")

    @cross_check
    def _estimators_fit(self) -> Iterator[CheckError]:
        for check in (self._schedule_fits, self._ridge_fits, self._engine_fits):
            yield from cross_checks.check_each(self.estimators, check)

    def _schedule_fits(self, i: int, estimator: Estimator) -> Iterator[CheckError]:
        if estimator.schedule != "designed" and estimator.schedule[-1] > self.burst.duration_s * (1 + 1e-9):
            yield check_error(f"estimators.{i}.schedule", "must not reach beyond the burst")
        fewest = self.truth.parameters
        if estimator.schedule != "designed" and estimator.schedule[0] < (fewest - 0.5) * self.burst.pulse_period_s:
            yield check_error(
                f"estimators.{i}.schedule", f"no window must be shorter than {fewest} pulses, one a parameter"
            )

    def _ridge_fits(self, i: int, estimator: Estimator) -> Iterator[CheckError]:
        if estimator.method == "ridge" and self.burst.pulse_length_s > 1.5 * self.burst.sampling_period_s:
            yield check_error(f"estimators.{i}.method", "ridge needs one sample a pulse")
        elif estimator.method == "ridge" and self.burst.pulses < 1024:
            yield check_error(f"estimators.{i}.method", "ridge needs at least 1024 pulses")

    def _engine_fits(self, i: int, estimator: Estimator) -> Iterator[CheckError]:
        if self.engine == "block_sums" and self.needs_samples(estimator):
            yield check_error("engine", f"block_sums cannot serve estimator {estimator.name}: it needs the samples")

    @cross_check
    def _rare_fits(self) -> Iterator[CheckError]:
        if self.rare is None:
            return
        sequences = [e.name for e in self.estimators if e.method == "sequence"]
        if self.rare.estimator not in sequences:
            yield check_error(
                "rare.estimator", f"must be the name of a sequence: {', '.join(sequences) or 'there is none'}"
            )
        samples = [e.name for e in self.estimators if self.needs_samples(e)]
        if self.engine not in ("auto", "block_sums"):
            yield check_error("rare", f"needs engine block_sums, got {self.engine}")
        elif samples:
            yield check_error(
                "rare", f"needs block sums, which cannot serve estimator {samples[0]}: it needs the samples"
            )

    def needs_samples(self, estimator: Estimator) -> bool:
        """Whether an estimator looks at more than the block sums tell."""
        return estimator.method == "ridge" or estimator.amplitude != "known" or self.truth.times_s is not None

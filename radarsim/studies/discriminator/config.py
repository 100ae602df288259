"""Keys of the discriminator study (P4): a burst, its echo, a forecast, estimators of Doppler and its derivatives."""

from collections.abc import Iterator
from itertools import pairwise
from typing import Annotated, Literal

from pydantic import AfterValidator, Field

from radarsim.config import rare
from radarsim.config.fields import (
    Added,
    At,
    Design,
    Display,
    Flag,
    Model,
    Name,
    NonNegative,
    Number,
    Positive,
    Scenario,
    Study,
    Whole,
    at,
    cross_check,
    of_each,
    unique_names,
)

MOST_SAMPLES = 1_000_000
MOST_DERIVATIVES = 4
FEWEST_PULSES = 16
MOST_WINDOWS = 200
Share = Annotated[float, Field(gt=0.5, lt=1)]


class Burst(Model):
    """A coherent burst, sampled inside its pulses."""

    carrier_hz: Positive = Field(
        title="carrier frequency", json_schema_extra={"symbol": "f_0"}, description="carrier frequency, Hz"
    )
    pulse_period_s: Positive = Field(title="pulse repetition period", description="time from pulse to pulse, s")
    pulse_length_s: Positive = Field(title="pulse length", description="length of a pulse, s")
    sampling_period_s: Positive = Field(
        title="sampling period", description="time from sample to sample inside a pulse, s"
    )
    pulses: Annotated[int, Whole(FEWEST_PULSES, MOST_SAMPLES)] = Field(
        title="number of pulses", description="number of pulses"
    )
    amplitude: Positive = Field(
        title="amplitude of the echo", description="amplitude of the echo, in the samples' unit"
    )
    noise_variance: Positive = Field(
        title="noise variance of a sample",
        description="variance of the white noise in each real number sampled, in the samples' unit squared",
    )
    samples: Literal["real", "complex"] = Field("real", title="samples", description="what the receiver gives")

    @cross_check
    def _pulses_fit(self) -> Iterator[At]:
        if self.pulse_length_s > self.pulse_period_s:
            yield at("pulse_length_s", "must be at most the pulse period")

    @cross_check
    def _few_samples(self) -> Iterator[At]:
        if self.pulses * self.pulse_length_s / self.sampling_period_s > MOST_SAMPLES:
            yield at("sampling_period_s", f"the burst has over {MOST_SAMPLES} samples")

    @property
    def duration_s(self) -> float:
        """Length of the burst: a period for every pulse, s."""
        return self.pulses * self.pulse_period_s


class Truth(Model):
    """The echo's phase: from its derivatives, or from a radial velocity that is straight between given instants."""

    phase_rad: Number = Field(
        0.0,
        title="initial phase",
        json_schema_extra={"symbol": "φ_0"},
        description="phase at the start of the burst, rad",
    )
    doppler_derivatives: Annotated[tuple[Number, ...], Field(min_length=1, max_length=MOST_DERIVATIVES + 1)] | None = (
        Field(
            None,
            title="Doppler frequency and its derivatives",
            description="Doppler frequency and its derivatives at the start: Hz, Hz/s, Hz/s², …",
        )
    )
    times_s: Annotated[tuple[NonNegative, ...], Field(min_length=2, max_length=100)] | None = Field(
        None,
        title="times of the velocity profile",
        description="instants of the velocity profile from the start of the burst, s; the first is 0",
    )
    velocities_mps: Annotated[tuple[Number, ...], Field(min_length=2, max_length=100)] | None = Field(
        None,
        title="radial velocities of the profile",
        description="radial velocity at these instants, towards the radar positive, m/s",
    )
    derivatives: Annotated[int, Whole(0, MOST_DERIVATIVES)] = Field(
        3,
        title="estimated derivatives of the Doppler frequency",
        description="with a velocity profile: derivatives of the Doppler frequency that are estimated",
    )

    @cross_check
    def _one_kind(self) -> Iterator[At]:
        times, velocities = self.times_s, self.velocities_mps
        if (times is not None and velocities is not None) == (self.doppler_derivatives is not None):
            yield at("doppler_derivatives", "give either doppler_derivatives or times_s and velocities_mps")
        elif times is not None and velocities is not None and len(times) != len(velocities):
            yield at("velocities_mps", "must have as many values as times_s")

    @cross_check
    def _times_rise(self) -> Iterator[At]:
        if self.times_s is not None and (self.times_s[0] != 0 or any(b <= a for a, b in pairwise(self.times_s))):
            yield at("times_s", "must begin with 0 and rise")

    @property
    def parameters(self) -> int:
        """Length of θ: the phase, the Doppler frequency and its derivatives."""
        return 1 + (self.derivatives + 1 if self.doppler_derivatives is None else len(self.doppler_derivatives))


Spreads = Annotated[tuple[Positive, ...], Field(min_length=2, max_length=MOST_DERIVATIVES + 2)]


class Prior(Model):
    """The forecast: independent Gaussian errors about the truth."""

    spread_over_potential: Spreads | None = Field(
        None,
        title="prior σ over the potential σ",
        description="standard deviations over the potential ones of the whole burst: phase, frequency, …",
    )
    sigma: Spreads | None = Field(
        None, title="prior σ", description="standard deviations: rad, Hz, Hz/s, …; in place of the former"
    )
    scale: Positive = Field(1.0, title="scale of the prior σ", description="factor on all standard deviations")
    error_scale: Positive = Field(
        1.0,
        title="true prior errors over the assumed ones",
        description="factor between the forecast's true errors and those that the estimators believe in",
    )

    @cross_check
    def _one_kind(self) -> Iterator[At]:
        if (self.spread_over_potential is None) == (self.sigma is None):
            yield at("spread_over_potential", "give either spread_over_potential or sigma")

    @property
    def given(self) -> tuple[float, ...]:
        """Whichever is given."""
        return self.sigma or self.spread_over_potential or ()


class Estimator(Model):
    """A sequence of windows that grow to the whole burst, Fisher scoring in each; or the classical rival."""

    name: Annotated[Name, Display()] = Field(title="name", description="label; every estimator has its own")
    method: Literal["sequence", "ridge"] = Field(
        "sequence",
        title="method",
        description="sequence of discriminators, or short-time spectrum, robust fit, unwrapping, scoring",
    )
    schedule: Literal["designed"] | Annotated[tuple[Positive, ...], Field(min_length=1, max_length=MOST_WINDOWS)] = (
        Field(
            "designed",
            title="window lengths",
            description="designed by (14)–(16), or a list of rising window lengths, s",
        )
    )
    lock_probability: Share = Field(
        0.99,
        title="probability of a hand-over",
        json_schema_extra={"symbol": "P_Δ"},
        description="probability P_Δ of a hand-over",
    )
    main_lobe_threshold: Positive = Field(
        1.0,
        title="main-lobe threshold",
        json_schema_extra={"symbol": "c"},
        description="c, no unit: 1 as in (10) and (14), 0.5 as in (11)",
    )
    tail: Literal["gaussian", "exact"] = Field(
        "gaussian",
        title="law of the quadratic form",
        description="law of the quadratic form: the paper's Gaussian, or the weighted sum of χ² itself",
    )
    density: Annotated[int, Whole(1, 10)] = Field(
        1,
        title="windows for each designed one",
        description="windows for each designed one; 2: one at each geometric mean between",
    )
    first_windows: Annotated[int, Whole(1, MOST_WINDOWS)] | None = Field(
        None, title="windows used", description="stop after so many windows; default: all"
    )
    start: Literal["prior", "truth"] = Field("prior", title="first window", description="where the first window starts")
    phases: Annotated[int, Whole(0, 64)] = Field(
        0,
        title="phases tried in the first window",
        description="phases tried in the first window; 0: the phase in closed form",
    )
    steps: Annotated[int, Whole(1, 1000)] = Field(
        40, title="scoring steps per window", description="scoring steps in a window, at most"
    )
    tolerance: Positive = Field(
        1e-3,
        title="step that ends a window",
        json_schema_extra={"symbol": "ε", "unit": "standard deviations"},
        description="ε: step, in standard deviations, that ends a window",
    )
    coherence_step: Flag = Field(
        False,
        title="steps that account for the coherence",
        description="let steps account for the coherence: far from the maximum the curvature is less than Fisher's",
    )
    search_points: Annotated[int, Whole(0, 10)] = Field(
        0,
        title="points of the search on each side",
        description="cure at a hand-over: points on each side along the leading direction of R_Δ; 0: none",
    )
    amplitude: Literal["known", "estimated", "as_printed"] = Field(
        "known",
        title="amplitude",
        description="given, or estimated from the energy by (7) corrected, or as printed (its square)",
    )

    @cross_check
    def _rises(self) -> Iterator[At]:
        if self.schedule != "designed" and any(b <= a for a, b in pairwise(self.schedule)):
            yield at("schedule", "window lengths must rise")


class Rare(rare.RareEvent):
    """Losses of lock that are rare: bursts shifted towards them, and weights that make up for it."""

    estimator: Name = Field(
        title="estimator", description="the estimator whose losses of lock at its last window are sought"
    )

    @property
    def aimed_at(self) -> str:
        return self.estimator


class Keys(Study):
    """Doppler frequency and its derivatives from one burst."""

    bare_keys = "estimators"
    figure_names = ("residuals", "locks", "accuracy", "lock_*")  # the last: of what a sweep varies

    burst: Burst = Field(title="burst", description="the burst")
    truth: Annotated[Truth, Scenario()] = Field(
        title="true phase", description="the echo's phase: a scenario's stem, or inline"
    )
    prior: Prior = Field(title="prior", description="the forecast")
    estimators: Annotated[
        tuple[Estimator, ...], Field(min_length=1, max_length=16), AfterValidator(unique_names), Design()
    ] = Field(title="estimators", description="the estimators; all see the same bursts")
    engine: Annotated[Literal["auto", "block_sums", "samples", "demodulated"], Design()] = Field(
        "auto",
        title="way of simulation",
        description="block_sums: exact sums over short blocks are drawn; samples: every step over every sample; "
        "demodulated: samples drawn and demodulated once; auto: block_sums where it is valid, else samples",
    )
    rare: Annotated[Rare | None, Design(), Added()] = Field(
        None,
        title="rare losses of lock",
        description="importance sampling of losses of lock, for sequences that lock almost always: rare.csv",
    )

    @cross_check
    def _prior_fits(self) -> Iterator[At]:
        size = self.truth.parameters
        if len(self.prior.given) != size:
            key = "spread_over_potential" if self.prior.sigma is None else "sigma"
            yield at(f"prior.{key}", f"must have {size} values: phase, Doppler frequency and {size - 2} derivatives")

    @cross_check
    def _profile_fits(self) -> Iterator[At]:
        if self.truth.times_s is not None and self.truth.times_s[-1] < self.burst.duration_s * (1 - 1e-9):
            yield at("truth.times_s", "must reach the end of the burst")

    @cross_check
    def _estimators_fit(self) -> Iterator[At]:
        for check in (self._schedule_fits, self._ridge_fits, self._engine_fits):
            yield from of_each(self.estimators, check)

    def _schedule_fits(self, i: int, estimator: Estimator) -> Iterator[At]:
        if estimator.schedule != "designed" and estimator.schedule[-1] > self.burst.duration_s * (1 + 1e-9):
            yield at(f"estimators.{i}.schedule", "must not reach beyond the burst")
        fewest = self.truth.parameters
        if estimator.schedule != "designed" and estimator.schedule[0] < (fewest - 0.5) * self.burst.pulse_period_s:
            yield at(f"estimators.{i}.schedule", f"no window must be shorter than {fewest} pulses, one a parameter")

    def _ridge_fits(self, i: int, estimator: Estimator) -> Iterator[At]:
        if estimator.method == "ridge" and self.burst.pulse_length_s > 1.5 * self.burst.sampling_period_s:
            yield at(f"estimators.{i}.method", "ridge needs one sample a pulse")
        elif estimator.method == "ridge" and self.burst.pulses < 1024:
            yield at(f"estimators.{i}.method", "ridge needs at least 1024 pulses")

    def _engine_fits(self, i: int, estimator: Estimator) -> Iterator[At]:
        if self.engine == "block_sums" and self.needs_samples(estimator):
            yield at("engine", f"block_sums cannot serve estimator {estimator.name}: it needs the samples")

    @cross_check
    def _rare_fits(self) -> Iterator[At]:
        if self.rare is None:
            return
        sequences = [e.name for e in self.estimators if e.method == "sequence"]
        if self.rare.estimator not in sequences:
            yield at("rare.estimator", f"must be the name of a sequence: {', '.join(sequences) or 'there is none'}")
        samples = [e.name for e in self.estimators if self.needs_samples(e)]
        if self.engine not in ("auto", "block_sums"):
            yield at("rare", f"needs engine block_sums, got {self.engine}")
        elif samples:
            yield at("rare", f"needs block sums, which cannot serve estimator {samples[0]}: it needs the samples")

    def needs_samples(self, estimator: Estimator) -> bool:
        """Whether an estimator looks at more than the block sums tell."""
        return estimator.method == "ridge" or estimator.amplitude != "known" or self.truth.times_s is not None

"""P1 (Gorshkov & Zavizhenets 2017): range-only against range + Doppler Kalman filters of the second order."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from radarsim.config.experiment import Case
from radarsim.engine.moments import Layout
from radarsim.engine.results import Axes
from radarsim.errors import ConfigError
from radarsim.kernels import linear
from radarsim.physics.motion import process_noise
from radarsim.studies.noise import noise_key
from radarsim.studies.range_doppler import exact, filters, patterns, tuning, world
from radarsim.studies.range_doppler.config import Best, Keys
from radarsim.studies.range_doppler.kernels import missed
from radarsim.studies.range_doppler.propagation import Plots

COMPONENTS = (("r", "m"), ("Vr", "m/s"), ("ar", "m/s2"))
BLOCK = 4096  # 8 chunks of 512; 0.4 ms with two filters and 15 scans
PATTERN_SCANS = 60  # of a run with missed plots: beyond, the mean over patterns takes minutes


@dataclass(frozen=True, kw_only=True)
class RangeDopplerAxes(Axes):
    """Labels of P1's sums, and what its tables need beside them: F filters, K scans, components r, Vr, ar.

    believed (F, K, 3, 3) is the covariance that a filter believes, in m, m/s, m/s²; zero where it has no estimate, and
    where plots may be missed, as then it differs from realisation to realisation. exact_nees (F, K) is the expectation
    of eᵀP⁻¹e per estimated component, no unit; exact_gain (F, K, 3) the gain in per cent against the baseline, where
    both have an estimate. observes (F,) is 1 for filters of the range, 2 for those of range and velocity;
    manoeuvre_variance (F,) their D_M in (m/s³)²; process_noise the forms of their Q. sigma (2,) holds the standard
    deviations of the plots, m and m/s; C_theta is σ_r²/(Δt²σ_V²) (eq. 11), no unit. speed_mps is the target's greatest
    radial speed at a scan. plain: every scan has its plot, which errs by noise alone, as in the paper.
    """

    believed: np.ndarray
    exact_nees: np.ndarray
    exact_gain: np.ndarray
    observes: np.ndarray
    manoeuvre_variance: np.ndarray
    process_noise: tuple[str, ...]
    sigma: np.ndarray
    scan_period_s: float
    C_theta: float
    wavelength_m: float
    repetition_rate_hz: float
    speed_mps: float
    plain: bool

    @property
    def exact_gains(self) -> np.ndarray:
        return self.exact_gain


@dataclass(frozen=True)
class Plan:
    """All that a block needs: of the paper's world a problem for all gains alike, of any other one for each its own.

    gaussian: whether the errors are, with the exact bias and σ of the axes, and in sums of the common kind.
    """

    layout: Layout
    axes: RangeDopplerAxes
    problem: linear.Problem | missed.Problem
    gaussian: bool
    block: int = BLOCK


@dataclass(frozen=True)
class Designed:
    """A case's filters and what they see: truth x (K, 3) at times t (K,), plots, D_M (F,), gains of full detection.

    drawn (K, 3, 1 + C): how the truth of realisations leaves the model beyond x, as `world.drawn_defects` has it.
    asked_from_k, roughly: as of the case.
    """

    spec: Keys
    t: np.ndarray
    x: np.ndarray
    drawn: np.ndarray
    plots: Plots
    variances: tuple[float, ...]
    filters: tuple[filters.LinearFilter, ...]
    asked_from_k: int = 0
    roughly: bool = False

    @property
    def dt(self) -> float:
        """Scan period, s."""
        return self.spec.radar.scan_period_s

    @property
    def noises(self) -> list[np.ndarray]:
        """Q (3, 3) of each filter."""
        pairs = zip(self.spec.filters, self.variances, strict=True)
        return [process_noise(f.process_noise, variance, self.dt) for f, variance in pairs]


def designed(case: Case) -> Designed:
    """The filters of a case, designed; raises ConfigError for a target that cannot be."""
    spec: Keys = case.spec
    dt = spec.radar.scan_period_s
    t, x = world.true_motion(case)
    drawn = world.drawn_defects(spec.target, t, x)
    plots = plots_of(spec)._replace(of_truth=drawn.shape[2] - 1)
    try:
        variances = tuning.manoeuvre_variances(spec.filters, tuning.Seen(plots, x, dt, drawn))
    except ValueError as error:
        raise ConfigError(f"{case.name}: filters: manoeuvre_variance: {error}") from None
    made = (
        filters.design(len(f.observes), f.plots_to_start, variance, plots.sigma, dt, len(t), f.process_noise)
        for f, variance in zip(spec.filters, variances, strict=True)
    )
    return Designed(spec, t, x, drawn, plots, variances, tuple(made), case.asked_from_k, case.roughly)


def plots_of(spec: Keys) -> Plots:
    """What the plots of a config's radar are."""
    radar = spec.radar
    return Plots(
        np.array([radar.sigma_range_m, radar.sigma_velocity_mps]),
        np.array([radar.bias_range_m, radar.bias_velocity_mps]),
        np.array([radar.sigma_bias_range_m, radar.sigma_bias_velocity_mps]),
        radar.detection_probability,
    )


def prepare(case: Case) -> Plan:
    """Design the filters of a case, its truth, and the exact values of its errors."""
    made = designed(case)
    labels = axes(made)
    count, scans = len(made.filters), len(made.t)
    if labels.plain and not world.is_drawn(made.spec.target):
        return Plan(Layout(**linear.shapes(count, scans)), labels, shared_gains(case, made, labels).plain(), True)
    return Plan(Layout(**missed.shapes(count, scans)), labels, own_gains(case, made, labels).plain(), False)


def shortened(case: Case, at_s: float | None, at_k: int | None) -> Case:
    """The case up to a time (s) or scan: what comes later changes no error there, but by a D_M that is looked for."""
    spec: Keys = case.spec
    world.true_motion(case)
    if any(isinstance(f.manoeuvre_variance, Best) for f in spec.filters):
        return case
    until = spec.plots
    if at_k is not None and at_k > 0:
        until = min(at_k, until)
    elif at_s is not None and 0 <= at_s < until * spec.radar.scan_period_s:
        until = min(int(at_s / spec.radar.scan_period_s) + 2, until)  # the scans before and after it
    scans = max(until, *(f.plots_to_start for f in spec.filters))
    return replace(case, spec=spec.model_copy(update={"scans": scans}), asked_from_k=max(1, until - 1))


def exact_but_for(case: Case) -> str:
    """What σ of missed plots is, where not every pattern of plots is followed on its own."""
    spec: Keys = case.spec
    if spec.radar.detection_probability == 1 or 2**spec.plots <= patterns.WHOLE:
        return ""
    return "a mean over patterns of plots, of which nearly equal ones are merged: right to about a ten-thousandth"


def shared_gains(case: Case, made: Designed, labels: RangeDopplerAxes) -> linear.Problem:
    """The paper's world for the kernel in which all realisations share the gains."""
    longest = max(d.start for d in made.filters)
    return linear.Problem(
        key=noise_key(case, "plots"),
        truth=made.x,
        sigma=made.plots.sigma,
        dt=made.dt,
        observes=labels.observes,
        start=np.array([d.start for d in made.filters]),
        weights=np.stack([np.pad(d.weights, ((0, 0), (0, 0), (0, longest - d.start))) for d in made.filters]),
        gains=np.stack([d.gains for d in made.filters]),
        baseline=labels.baseline,
    )


def own_gains(case: Case, made: Designed, labels: RangeDopplerAxes) -> missed.Problem:
    """Any other world for the kernel in which each realisation has gains of its own."""
    upper = np.triu_indices(3)
    return missed.Problem(
        keys=np.stack([noise_key(case, what) for what in ("plots", "misses", "drawn")]),
        truth=made.x,
        sigma=made.plots.sigma,
        bias=made.plots.bias,
        sigma_bias=made.plots.sigma_bias,
        sigma_state=world.sigma_state(made.spec.target),
        sigma_flight=world.sigma_flight(made.spec.target),
        flight=world.flight(made.spec.target, made.t),
        detection=made.plots.detection,
        dt=made.dt,
        observes=labels.observes,
        start=np.array([d.start for d in made.filters]),
        Q=np.stack([Q[upper] for Q in made.noises]),
        baseline=labels.baseline,
    )


def axes(made: Designed) -> RangeDopplerAxes:
    """Labels and exact values."""
    spec, radar = made.spec, made.spec.radar
    names = tuple(f.name for f in spec.filters)
    baseline = names.index(spec.baseline) if spec.baseline else 0
    available = np.stack([d.available for d in made.filters])
    known = exact_values(made, baseline) if radar.detection_probability == 1 else exact_means(made, baseline)
    return RangeDopplerAxes(
        filters=names,
        components=COMPONENTS,
        k=np.arange(1, len(made.t) + 1),
        t_s=made.t,
        available=available,
        baseline=baseline,
        exact_sigma=np.where(available, known.sigma, np.nan),
        exact_bias=np.where(available, known.bias, np.nan),
        believed=known.believed,
        exact_nees=known.nees,
        exact_gain=known.gain,
        observes=np.array([d.observes for d in made.filters]),
        manoeuvre_variance=np.array(made.variances),
        process_noise=tuple(f.process_noise for f in spec.filters),
        sigma=made.plots.sigma,
        scan_period_s=made.dt,
        C_theta=float(made.plots.sigma[0] ** 2 / (made.dt**2 * made.plots.sigma[1] ** 2)),
        wavelength_m=radar.wavelength_m,
        repetition_rate_hz=radar.repetition_rate_hz,
        speed_mps=float(np.abs(made.x[:, 1]).max()),
        plain=radar.as_the_papers,
    )


@dataclass(frozen=True)
class Known:
    """Exact values: sigma, bias and gain (F, K, 3), NEES (F, K), and the believed covariance (F, K, 3, 3)."""

    sigma: np.ndarray
    bias: np.ndarray
    gain: np.ndarray
    nees: np.ndarray
    believed: np.ndarray


def exact_values(made: Designed, baseline: int) -> Known:
    """Of filters that get every plot."""
    sigma, plots = made.plots.sigma, made.plots
    errors = [exact.error_recursion(d.weights, d.gains, d.observes, made.x, sigma, made.dt) for d in made.filters]
    bias, covariance = np.stack([b for b, _ in errors]), np.stack([S for _, S in errors])
    if not made.spec.radar.as_the_papers:
        of = np.stack([exact.bias_response(d.weights, d.gains, d.observes, made.dt) for d in made.filters])
        bias = bias + of @ plots.bias
        covariance = covariance + np.einsum("fkic,c,fkjc->fkij", of, plots.sigma_bias**2, of)
    if made.drawn.any():
        of = np.stack(
            [exact.defect_response(d.weights, d.gains, d.observes, made.drawn, made.dt) for d in made.filters]
        )
        bias = bias + of[..., 0]
        covariance = covariance + np.einsum("fkic,fkjc->fkij", of[..., 1:], of[..., 1:])
    available, believed = (np.stack([getattr(d, what) for d in made.filters]) for what in ("available", "believed"))
    moment = covariance + bias[..., :, None] * bias[..., None, :]
    root = np.sqrt(np.diagonal(covariance, axis1=2, axis2=3) + bias**2)
    return Known(root, bias, gains(root, root[baseline]), nees_of(believed, bias, moment, available), believed)


def nees_of(believed: np.ndarray, bias: np.ndarray, moment: np.ndarray, available: np.ndarray) -> np.ndarray:
    """The expectation (F, K) of eᵀP⁻¹e per estimated component."""
    return exact.normalised_error(believed, bias, moment, available)[0]


def gains(sigma: np.ndarray, base: np.ndarray) -> np.ndarray:
    """Relative gains in per cent (eq. 17)."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return 100 * (1 - sigma / base)


def exact_means(made: Designed, baseline: int) -> Known:
    """Of filters that miss plots, as means over the patterns: not-a-number where these are too many to be exact."""
    shape = (len(made.filters), len(made.t), 3)
    sigma, bias, gain = (np.full(shape, np.nan) for _ in range(3))
    nees = np.full(shape[:2], np.nan)
    if len(made.t) <= PATTERN_SCANS:
        own = [patterns.Design(d.observes, d.start, Q) for d, Q in zip(made.filters, made.noises, strict=True)]
        base = means(own[baseline], own, made)
        for f, design in enumerate(own):
            of = base if f == baseline else means(design, [own[baseline]], made)
            sigma[f], bias[f], nees[f] = of.sigma, of.bias, of.nees
            gain[f] = gains(of.beside[0], base.beside[f])
    return Known(sigma, bias, gain, nees, np.zeros((*shape, 3)))


@dataclass(frozen=True)
class Means:
    """As `patterns.Mixture`, where known: sigma and bias (K, 3), nees (K,), sigma beside G others (G, K, 3)."""

    sigma: np.ndarray
    bias: np.ndarray
    nees: np.ndarray
    beside: np.ndarray


_MEANS: dict[tuple, Means] = {}  # of the last filters and worlds: a filter of the range is the same at any σ_V
MOST_MEANS = 32


def means(design: patterns.Design, beside: Sequence[patterns.Design], made: Designed) -> Means:
    """The means of one filter over the patterns; those of the last that were asked for are kept."""
    seen = [part[: design.observes] for part in made.plots[:3]]
    arrays = (design.Q, *seen, made.x, made.drawn)
    others = tuple((one.observes, one.start) for one in beside)
    asked = made.dt, made.asked_from_k, made.roughly, made.plots.detection
    key = (design[:2], others, *asked, *(array.tobytes() for array in arrays))
    found = _MEANS.pop(key) if key in _MEANS else over_patterns(design, beside, made)
    if len(_MEANS) >= MOST_MEANS:
        del _MEANS[next(iter(_MEANS))]
    _MEANS[key] = found
    return found


def over_patterns(design: patterns.Design, beside: Sequence[patterns.Design], made: Designed) -> Means:
    """The means of one filter over the patterns, of which as many are kept as it takes."""

    def kept(most: int) -> patterns.Mixture:
        return patterns.mixture(design, made.plots, made.x, made.dt, most, beside, made.drawn, made.asked_from_k)

    if made.roughly or 2 ** len(made.t) <= patterns.WHOLE:
        whole = kept(patterns.KEPT[0] if made.roughly else patterns.WHOLE)
        return Means(np.sqrt(whole.moment), whole.bias, whole.nees, np.sqrt(whole.beside))
    mixtures = map(kept, patterns.KEPT)
    coarse, fine = next(mixtures), next(mixtures)
    while not patterns.settled(fine, coarse, made.asked_from_k) and (finer := next(mixtures, None)) is not None:
        coarse, fine = fine, finer
    known = patterns.close(fine.moment, coarse.moment)
    whole_state = patterns.close(fine.nees, coarse.nees) & known.all(axis=1)
    others = np.where(patterns.close(fine.beside, coarse.beside), np.sqrt(fine.beside), np.nan)
    sigma, bias = (np.where(known, values, np.nan) for values in (np.sqrt(fine.moment), fine.bias))
    return Means(sigma, bias, np.where(whole_state, fine.nees, np.nan), others)


def simulate(plan: Plan, first: int, count: int) -> np.ndarray:
    """Sums of one block, in the order of the plan's layout."""
    if isinstance(plan.problem, missed.Problem):
        own = missed.Sums(**{name: np.zeros(shape) for name, shape in plan.layout.shapes.items()})
        missed.simulate_block(plan.problem, first, count, own)
        return plan.layout.pack(**own._asdict())
    sums = linear.Sums(**{name: np.zeros(shape) for name, shape in plan.layout.shapes.items()})
    linear.simulate_block(plan.problem, first, count, sums)
    return plan.layout.pack(**sums._asdict())

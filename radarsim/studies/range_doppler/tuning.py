"""The manoeuvre variance with which a filter's exact error on a target is least, `manoeuvre_variance: {minimise: …}`.

Many variances run through the exact recursion side by side. D_M is looked for in units of σ_r²/Δt⁶, from a memory far
longer than the run to none at all, first ten to a decade, then ever closer about the best; it is given to four digits,
which lie within the flat bottom of the curve and are the same on every machine.

The filters of a case, designed, and what they see; NumPy alone."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from radarsim.config.experiment import Case
from radarsim.errors import ConfigError
from radarsim.kernels.algebra import pack
from radarsim.physics import process_noise
from radarsim.studies.range_doppler import filters, given
from radarsim.studies.range_doppler.config import Best, Filter, Keys, variance_of
from radarsim.studies.range_doppler.filters import Plots, defects, least_squares_start, scans, started

# ---- tuning ----------------------------------------------------------------------------------------------------------
LEAST, MOST = 1e-12, 1e8  # D_M Δt⁶/σ_r²; the least is lowered for long runs
TO_VELOCITY = 1e12  # most of D_M Δt⁴/σ_V², as the config's check has it
A_DECADE, CLOSER, POINTS = 10, 3, 21
FEW, ABOUT, A_DECADE_FEW = 512, 1.5, 4  # patterns; decades about the best without misses, and variances in each
ALIKE = 1e-9
COMPONENTS = {"sigma_r": 0, "sigma_Vr": 1, "sigma_ar": 2}


class Seen(NamedTuple):
    """What filters see: plots, of a truth x (K, 3) at scans dt (s) apart, drawn as `filters.defects` takes it."""

    plots: Plots
    x: np.ndarray
    dt: float
    drawn: np.ndarray | None = None


def manoeuvre_variances(filters: tuple[Filter, ...], seen: Seen) -> tuple[float, ...]:
    """D_M of each filter, (m/s³)²: as given, or the best for these plots; not-a-number where it has none."""
    return tuple(
        best(filter_, variance, seen) if isinstance(variance, Best) else variance
        for filter_ in filters
        for variance in (variance_of(filter_),)
    )


def best(filter_: Filter, criterion: Best, seen: Seen) -> float:
    """The manoeuvre variance that a filter's config asks for, (m/s³)², for these plots."""
    low, high = limits(len(seen.x), seen.plots.sigma, seen.dt)
    without_misses = seen._replace(plots=seen.plots._replace(detection=1.0))

    def cost(logs: np.ndarray, inputs: Seen) -> np.ndarray:
        return objective(criterion, errors(filter_, 10.0**logs, inputs))

    grid = np.linspace(low, high, round((high - low) * A_DECADE) + 1)
    middle = closer(grid, lambda logs: cost(logs, without_misses), CLOSER)
    if seen.plots.detection < 1:
        around_best = np.arange(-ABOUT, ABOUT + 1e-9, 1 / A_DECADE_FEW)
        middle = closer(np.clip(middle + around_best, low, high), lambda logs: cost(logs, seen), 1)
    return float(f"{10.0**middle:.4g}")


def closer(grid: np.ndarray, cost: Callable[[np.ndarray], np.ndarray], times: int) -> float:
    """The number of least cost, looked for on a grid (n,) and then `times` closer about the best so far."""
    for _ in range(times + 1):
        costs = cost(grid)
        index = int(np.argmax(costs <= costs.min() * (1 + ALIKE)))  # of what is level, the least D_M
        middle = float(grid[index])
        grid = np.linspace(grid[max(index - 1, 0)], grid[min(index + 1, len(grid) - 1)], POINTS)
    return middle


def limits(scans: int, sigma: np.ndarray, dt: float) -> tuple[float, float]:
    """Logarithms to ten of the least and the greatest D_M that are looked at; sigma (2,) of the plots."""
    unit = sigma[0] ** 2 / dt**6
    smallest = min(LEAST, (3.0 * scans) ** -6)
    return float(np.log10(smallest * unit)), float(np.log10(min(MOST * unit, TO_VELOCITY * sigma[1] ** 2 / dt**4)))


def at_a_limit(variance: float, scans: int, sigma: np.ndarray, dt: float) -> bool:
    """Whether a D_M is the least or the greatest that is looked at: then there is no best one between; sigma (2,)."""
    low, high = limits(scans, sigma, dt)
    return not low + 1e-3 < np.log10(variance) < high - 1e-3


def objective(criterion: Best, sigma: np.ndarray) -> np.ndarray:
    """What is to be least (B,), of σ (B, K, 3)."""
    sigma_of_component = sigma[:, criterion.from_k - 1 :, COMPONENTS[criterion.minimise]]
    if np.isnan(sigma_of_component).all():
        raise ValueError("no filter has an estimate there")
    if criterion.over == "last":
        return sigma_of_component[:, -1]
    return np.asarray(
        np.nanmax(sigma_of_component, axis=1) if criterion.over == "worst" else np.nanmean(sigma_of_component, axis=1)
    )


def errors(filter_: Filter, variances: np.ndarray, seen: Seen) -> np.ndarray:
    """σ (B, K, 3) of a filter with each of the manoeuvre variances (B,); not-a-number where it has no estimate."""
    observes, start = len(filter_.observes), filter_.plots_to_start
    Q = np.stack([process_noise(filter_.process_noise, float(v), seen.dt) for v in variances], axis=2)
    if seen.plots.detection < 1:
        from radarsim.studies.range_doppler.patterns import Design, mixture  # loads the compiler

        designs = (Design(observes, start, tuple(map(float, pack(filter_)))) for filter_ in np.moveaxis(Q, 2, 0))
        mixtures = (mixture(design, seen.plots, seen.x, seen.dt, FEW, random_truth=seen.drawn) for design in designs)
        return np.stack([np.sqrt(filter_.moment) for filter_ in mixtures])
    return side_by_side(observes, start, Q, seen)


def side_by_side(observes: int, start: int, Q: np.ndarray, seen: Seen) -> np.ndarray:
    """σ (B, K, 3) of filters that differ in Q (3, 3, B), every scan with its plot."""
    plots, sigma = seen.plots, np.full((Q.shape[2], len(seen.x), 3), np.nan)
    defect = defects(seen.x, seen.dt, plots, seen.drawn)
    sigma[:, : start - 1, :observes] = np.sqrt(plots.sigma**2 + plots.bias**2 + plots.sigma_bias**2)[:observes]
    weights, believed = least_squares_start(observes, start, plots.sigma, seen.dt)
    first = started(weights, believed, plots, defect, seen.dt)
    sigma[:, start - 1] = np.sqrt(first.second_moments()[:, 0])
    packed = pack(np.moveaxis(Q, 2, 0))
    for k, errors in enumerate(scans(first, observes, plots, packed, defect[start:], seen.dt), start):
        sigma[:, k] = np.sqrt(errors.second_moments().T)
    return sigma


# ---- design ----------------------------------------------------------------------------------------------------------
@dataclass(frozen=True)
class Designed:
    """A case's filters and what they see: truth x (K, 3) at times t (K,), plots, D_M (F,), gains of full detection.

    drawn (K, 3, 1 + C): how the truth of realisations leaves the model beyond x, as `filters.drawn_defects` has it.
    asked_from_k, roughly: as of the case."""

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
    def plain(self) -> bool:
        """Whether this is the paper's world: every scan has its plot, which errs by noise alone, of one truth."""
        return self.spec.radar.as_the_papers and not filters.is_drawn(self.spec.target)

    @property
    def observes(self) -> np.ndarray:
        """What each filter (F,) observes: 1 the range, 2 the velocity too."""
        return np.array([d.observes for d in self.filters])


def designed(case: Case) -> Designed:
    """The filters of a case, designed; raises ConfigError for a target that cannot be."""
    spec: Keys = case.spec
    dt = spec.radar.scan_period_s
    t, x = filters.true_motion(case)
    random_truth = filters.drawn_defects(spec.target, t, x)
    plots = plots_of(spec)._replace(of_truth=random_truth.shape[2] - 1)
    try:
        variances = manoeuvre_variances(spec.filters, Seen(plots, x, dt, random_truth))
    except ValueError as error:
        raise ConfigError(f"{case.name}: filters: manoeuvre_variance: {error}") from None
    linear_filters = (
        filters.design(len(f.observes), f.plots_to_start, variance, plots.sigma, dt, len(t), f.process_noise)
        if isinstance(f, Filter)
        else given.designed(f, plots.sigma, t)
        for f, variance in zip(spec.filters, variances, strict=True)
    )
    return Designed(spec, t, x, random_truth, plots, variances, tuple(linear_filters), case.asked_from_k, case.roughly)


def plots_of(spec: Keys) -> Plots:
    """What the plots of a config's radar are."""
    radar = spec.radar
    return Plots(
        np.array([radar.sigma_range_m, radar.sigma_velocity_mps]),
        np.array([radar.bias_range_m, radar.bias_velocity_mps]),
        np.array([radar.sigma_bias_range_m, radar.sigma_bias_velocity_mps]),
        radar.detection_probability,
    )

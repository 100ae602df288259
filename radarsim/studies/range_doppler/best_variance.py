"""The manoeuvre variance with which a filter's exact error on a target is least, `manoeuvre_variance: {minimise: …}`.

Many variances run through the exact recursion side by side. D_M is looked for in units of σ_r²/Δt⁶, from a memory far
longer than the run to none at all, first ten to a decade, then ever closer about the best; it is given to four digits,
which lie within the flat bottom of the curve and are the same on every machine."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from radarsim.kernels.kalman_algebra import pack
from radarsim.physics.motion import process_noise
from radarsim.studies import counted_scans
from radarsim.studies.range_doppler import settling
from radarsim.studies.range_doppler.config import Best, Filter, Target, configured_variance
from radarsim.studies.range_doppler.error_recursion import Plots, defects, scans, start_errors
from radarsim.studies.range_doppler.filter_design import least_squares_start

MIN_VARIANCE, MAX_VARIANCE = 1e-12, 1e8  # D_M Δt⁶/σ_r²; the least is lowered for long runs
MAX_VELOCITY_RATIO = 1e12  # most of D_M Δt⁴/σ_V², as the config's check has it
POINTS_PER_DECADE, REFINEMENTS, POINTS = 10, 3, 21
# With missed plots: patterns; decades about the best without misses, and variances in each of them.
ROUGH_PATTERNS, DECADES_AROUND, ROUGH_POINTS_PER_DECADE = 512, 1.5, 4
LEVEL_TOLERANCE = 1e-9
COMPONENTS = {"sigma_r": 0, "sigma_Vr": 1, "sigma_ar": 2}


class FilterInputs(NamedTuple):
    """What filters see: plots of a truth x (K, 3) at scans dt (s) apart.

    random_truth: the random truth as `error_recursion.defects` takes it."""

    plots: Plots
    x: np.ndarray
    dt: float
    random_truth: np.ndarray | None = None

    @property
    def without_misses(self) -> "FilterInputs":
        """The same with a plot at every scan."""
        return self._replace(plots=self.plots._replace(detection=1.0))


def manoeuvre_variances(
    filters: tuple[Filter, ...], criteria: Sequence[Best | None], filter_inputs: FilterInputs
) -> tuple[float, ...]:
    """D_M of each filter, (m/s³)²: as given, or the best for these plots; not-a-number where it has none."""
    return tuple(
        variance if not isinstance(variance, Best) else best_variance(filter_, criterion or variance, filter_inputs)
        for filter_, criterion in zip(filters, criteria, strict=True)
        for variance in [configured_variance(filter_)]
    )


def complete_criteria(
    filters: tuple[Filter, ...], target: Target, filter_inputs: FilterInputs
) -> tuple[Best | None, ...]:
    """What each filter's D_M minimises, with the first scan that counts; None where its D_M is given.

    By default that scan is the same for all filters: that of the manoeuvre, else the one at which they have settled
    with the D_M that are best once they have started, with a plot at every scan."""
    variances = [configured_variance(filter_) for filter_ in filters]
    criteria = [variance if isinstance(variance, Best) else None for variance in variances]
    undecided = [(f, given) for f, given in zip(filters, criteria, strict=True) if given and given.from_k is None]
    if not undecided:
        return tuple(criteria)
    scans, plots, dt = len(filter_inputs.x), filter_inputs.plots, filter_inputs.dt
    started, settled = settling.started_scan([f for f, _ in undecided], plots.detection, scans), []
    t, start_s = dt * np.arange(scans), counted_scans.target_start_s(target)
    if counted_scans.manoeuvre_scan(start_s, t) is None:
        for filter_, criterion in undecided:
            early = with_first_scan(criterion, min(started, scans))
            variance = best_variance(filter_, early, filter_inputs.without_misses)
            options = variance, tuple(map(float, plots.sigma)), dt, plots.detection, scans
            settled.append(settling.settled_scans(filter_, *options)[COMPONENTS[early.minimise]])
    k = counted_scans.counted_scans(start_s, t, started, settled, every=False).k
    return tuple(criterion and with_first_scan(criterion, criterion.from_k or k) for criterion in criteria)


def with_first_scan(criterion: Best, k: int) -> Best:
    """A criterion with the first scan that counts."""
    return criterion.model_copy(update={"from_k": k})


def best_variance(filter_: Filter, criterion: Best, filter_inputs: FilterInputs) -> float:
    """The manoeuvre variance with which a filter meets a complete criterion best, (m/s³)², for these plots."""
    low, high = limits(len(filter_inputs.x), filter_inputs.plots.sigma, filter_inputs.dt)

    def cost(logs: np.ndarray, inputs: FilterInputs) -> np.ndarray:
        return objective(criterion, errors(filter_, 10.0**logs, inputs))

    grid = np.linspace(low, high, round((high - low) * POINTS_PER_DECADE) + 1)
    middle = refine_minimum(grid, lambda logs: cost(logs, filter_inputs.without_misses), REFINEMENTS)
    if filter_inputs.plots.detection < 1:
        around_best = np.arange(-DECADES_AROUND, DECADES_AROUND + 1e-9, 1 / ROUGH_POINTS_PER_DECADE)
        middle = refine_minimum(np.clip(middle + around_best, low, high), lambda logs: cost(logs, filter_inputs), 1)
    return float(f"{10.0**middle:.4g}")


def refine_minimum(grid: np.ndarray, cost: Callable[[np.ndarray], np.ndarray], times: int) -> float:
    """The number with the lowest cost, searched for on a grid (n,), which is refined `times` times about the best."""
    for _ in range(times + 1):
        costs = cost(grid)
        index = int(np.argmax(costs <= costs.min() * (1 + LEVEL_TOLERANCE)))  # of what is level, the least D_M
        middle = float(grid[index])
        grid = np.linspace(grid[max(index - 1, 0)], grid[min(index + 1, len(grid) - 1)], POINTS)
    return middle


def limits(scans: int, sigma: np.ndarray, dt: float) -> tuple[float, float]:
    """Logarithms to ten of the least and the greatest D_M that are looked at; sigma (2,) of the plots."""
    unit = sigma[0] ** 2 / dt**6
    smallest = min(MIN_VARIANCE, (3.0 * scans) ** -6)
    return float(np.log10(smallest * unit)), float(
        np.log10(min(MAX_VARIANCE * unit, MAX_VELOCITY_RATIO * sigma[1] ** 2 / dt**4))
    )


def is_at_limit(variance: float, scans: int, sigma: np.ndarray, dt: float) -> bool:
    """Whether a D_M is the least or the greatest that is looked at: then there is no best one between; sigma (2,)."""
    low, high = limits(scans, sigma, dt)
    return not low + 1e-3 < np.log10(variance) < high - 1e-3


def objective(criterion: Best, sigma: np.ndarray) -> np.ndarray:
    """The criterion's value (B,), to be minimised, from σ (B, K, 3)."""
    assert criterion.from_k is not None  # as complete_criteria leaves it
    sigma_of_component = sigma[:, criterion.from_k - 1 :, COMPONENTS[criterion.minimise]]
    if np.isnan(sigma_of_component).all():
        raise ValueError("no filter has an estimate there")
    if criterion.over in ("last", "at"):
        return sigma_of_component[:, -1 if criterion.over == "last" else 0]
    return np.asarray(
        np.nanmax(sigma_of_component, axis=1) if criterion.over == "worst" else np.nanmean(sigma_of_component, axis=1)
    )


def errors(filter_: Filter, variances: np.ndarray, filter_inputs: FilterInputs) -> np.ndarray:
    """σ (B, K, 3) of a filter with each of the manoeuvre variances (B,); not-a-number where it has no estimate."""
    observes, start = len(filter_.observes), filter_.plots_to_start
    Q = np.stack([process_noise(filter_.process_noise, float(v), filter_inputs.dt) for v in variances], axis=2)
    if filter_inputs.plots.detection < 1:
        from radarsim.studies.range_doppler.missed_plot_patterns import (
            Design,
            mixture,  # loads the compiler
        )

        designs = (Design(observes, start, tuple(map(float, pack(covariance)))) for covariance in np.moveaxis(Q, 2, 0))
        mixtures = (
            mixture(
                design,
                filter_inputs.plots,
                filter_inputs.x,
                filter_inputs.dt,
                ROUGH_PATTERNS,
                random_truth=filter_inputs.random_truth,
            )
            for design in designs
        )
        return np.stack([np.sqrt(pattern_mixture.moment) for pattern_mixture in mixtures])
    return errors_of_variants(observes, start, Q, filter_inputs)


def errors_of_variants(observes: int, start: int, Q: np.ndarray, filter_inputs: FilterInputs) -> np.ndarray:
    """σ (B, K, 3) of filters that differ in Q (3, 3, B), every scan with its plot."""
    plots, sigma = filter_inputs.plots, np.full((Q.shape[2], len(filter_inputs.x), 3), np.nan)
    defect = defects(filter_inputs.x, filter_inputs.dt, plots, filter_inputs.random_truth)
    sigma[:, : start - 1, :observes] = np.sqrt(plots.sigma**2 + plots.bias**2 + plots.sigma_bias**2)[:observes]
    weights, believed = least_squares_start(observes, start, plots.sigma, filter_inputs.dt)
    first = start_errors(weights, believed, plots, defect, filter_inputs.dt)
    sigma[:, start - 1] = np.sqrt(first.second_moments()[:, 0])
    packed = pack(np.moveaxis(Q, 2, 0))
    for k, errors in enumerate(scans(first, observes, plots, packed, defect[start:], filter_inputs.dt), start):
        sigma[:, k] = np.sqrt(errors.second_moments().T)
    return sigma

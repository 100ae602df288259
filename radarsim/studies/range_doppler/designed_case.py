"""A case's filters, designed, and the plots and truth that they see; NumPy alone."""

from dataclasses import dataclass

import numpy as np

from radarsim.config.experiment import Case
from radarsim.errors import ConfigError
from radarsim.studies.range_doppler import filter_design, package_filters, scenario
from radarsim.studies.range_doppler.best_variance import FilterInputs, complete_criteria, manoeuvre_variances
from radarsim.studies.range_doppler.config import Best, Filter, Keys
from radarsim.studies.range_doppler.error_recursion import Plots


@dataclass(frozen=True)
class DesignedCase:
    """A case's filters and what they see: truth x (K, 3) at times t (K,), plots, D_M (F,), gains of full detection.

    random_truth (K, 3, 1 + C): how the truth of realisations leaves the model beyond x, from `scenario.random_defects`.
    criteria (F,): what a filter's D_M minimises, None where it is given. asked_from_k, roughly: as of the case."""

    spec: Keys
    t: np.ndarray
    x: np.ndarray
    random_truth: np.ndarray
    plots: Plots
    variances: tuple[float, ...]
    criteria: tuple[Best | None, ...]
    filters: tuple[filter_design.LinearFilter, ...]
    asked_from_k: int = 0
    roughly: bool = False

    @property
    def dt(self) -> float:
        """Scan period, s."""
        return self.spec.radar.scan_period_s

    @property
    def plain(self) -> bool:
        """Whether this is the paper's world: every scan has its plot, which errs by noise alone, of one truth."""
        return self.spec.radar.as_the_papers and not scenario.is_random(self.spec.target)

    @property
    def observes(self) -> np.ndarray:
        """What each filter (F,) observes: 1 the range, 2 the velocity too."""
        return np.array([d.observes for d in self.filters])


def design_case(case: Case) -> DesignedCase:
    """Design the filters of a case; raises ConfigError where a manoeuvre variance cannot be found."""
    spec: Keys = case.spec
    dt = spec.radar.scan_period_s
    t, x = scenario.true_motion(case)
    random_truth = scenario.random_defects(spec.target, t, x)
    plots = radar_plots(spec)._replace(of_truth=random_truth.shape[2] - 1)
    try:
        filter_inputs = FilterInputs(plots, x, dt, random_truth)
        criteria = complete_criteria(spec.filters, spec.target, filter_inputs)
        variances = manoeuvre_variances(spec.filters, criteria, filter_inputs)
    except ValueError as error:
        raise ConfigError(f"{case.name}: filters: manoeuvre_variance: {error}") from None
    linear_filters = (
        filter_design.design(len(f.observes), f.plots_to_start, variance, plots.sigma, dt, len(t), f.process_noise)
        if isinstance(f, Filter)
        else package_filters.design_filter(f, plots.sigma, t)
        for f, variance in zip(spec.filters, variances, strict=True)
    )
    filters = tuple(linear_filters)
    return DesignedCase(spec, t, x, random_truth, plots, variances, criteria, filters, case.asked_from_k, case.roughly)


def radar_plots(spec: Keys) -> Plots:
    """What the plots of a config's radar are."""
    radar = spec.radar
    return Plots(
        np.array([radar.sigma_range_m, radar.sigma_velocity_mps]),
        np.array([radar.bias_range_m, radar.bias_velocity_mps]),
        np.array([radar.sigma_bias_range_m, radar.sigma_bias_velocity_mps]),
        radar.detection_probability,
    )

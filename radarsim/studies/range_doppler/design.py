"""The filters of a case, designed, and what they see; NumPy alone."""

from dataclasses import dataclass

import numpy as np

from radarsim.config.experiment import Case
from radarsim.errors import ConfigError
from radarsim.studies.range_doppler import filters, tuning, world
from radarsim.studies.range_doppler.config import Keys
from radarsim.studies.range_doppler.propagation import Plots


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
    def plain(self) -> bool:
        """Whether this is the paper's world: every scan has its plot, which errs by noise alone, of one truth."""
        return self.spec.radar.as_the_papers and not world.is_drawn(self.spec.target)

    @property
    def observes(self) -> np.ndarray:
        """What each filter (F,) observes: 1 the range, 2 the velocity too."""
        return np.array([d.observes for d in self.filters])


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

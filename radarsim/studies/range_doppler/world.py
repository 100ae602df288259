"""The world of P1: the true range of a target at the scans."""

import numpy as np

from radarsim.config.experiment import Case
from radarsim.studies.radial import checked_truth
from radarsim.studies.range_doppler.config import Keys, Target


def scan_times(spec: Keys) -> np.ndarray:
    """Times (K,) of the scans, s from the first."""
    return np.arange(spec.plots) * spec.radar.scan_period_s


def sigma_state(target: Target) -> np.ndarray:
    """Standard deviations (3,) with which range, velocity and acceleration at the first plot are drawn."""
    drawn: tuple[float, ...] = getattr(target, "sigma_coefficients", ())
    return np.array([*drawn, 0.0, 0.0, 0.0])[:3]


def true_motion(case: Case) -> tuple[np.ndarray, np.ndarray]:
    """Times (K,) of the scans and the truth (K, 3) of a case; raises ConfigError for a target that cannot be."""
    t = scan_times(case.spec)
    return t, checked_truth(case.spec.target, t, case.name)

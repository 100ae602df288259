"""The target's true motion: a mean, and the motions that each realisation adds to it."""

from typing import Any

import numpy as np

from radarsim.physics import targets
from radarsim.studies import radial_truth


def truth(target: Any, t: np.ndarray, case: str) -> np.ndarray:
    """Mean range, radial velocity and acceleration (K, 3) of a configured target at times t (K,), in m, m/s, m/s².

    Raises ConfigError, with the name of the case, for an impossible target."""
    if target.kind == "random_polynomial":
        return targets.polynomial((target.range_m,), t)
    return radial_truth.checked_truth(target, t, case)


def random_motion_sigma(target: Any) -> np.ndarray:
    """Standard deviations (2,) of the velocity (m/s) and acceleration (m/s²) that each realisation draws, or zeros."""
    sigmas = (getattr(target, name, 0.0) for name in ("sigma_velocity_mps", "sigma_acceleration_mps2"))
    return np.array([value or 0.0 for value in sigmas])


def unit_motions(t: np.ndarray) -> np.ndarray:
    """The motions (2, K, 3) that an added velocity of 1 m/s, and an acceleration of 1 m/s², cause at times t (K,)."""
    ones, zeros = np.ones_like(t), np.zeros_like(t)
    return np.stack([np.stack([t, ones, zeros], axis=1), np.stack([t**2 / 2, t, ones], axis=1)])

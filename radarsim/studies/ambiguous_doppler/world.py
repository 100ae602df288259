"""What is observed, without the plots' noise: a mean motion, and the motions that a realisation adds to it."""

from typing import Any

import numpy as np

from radarsim.physics import targets
from radarsim.studies import radial


def truth(target: Any, t: np.ndarray, case: str) -> np.ndarray:
    """Mean range, radial velocity and acceleration (K, 3) of a configured target at times t (K,), in m, m/s, m/s².

    Raises ConfigError, with the name of the case, for a target that cannot be.
    """
    if target.kind == "random_polynomial":
        return targets.polynomial((target.range_m,), t)
    return radial.checked_truth(target, t, case)


def spread(target: Any) -> np.ndarray:
    """Standard deviations (2,) of the velocity (m/s) and acceleration (m/s²) that each realisation draws, or zeros."""
    own = (getattr(target, name, 0.0) for name in ("sigma_velocity_mps", "sigma_acceleration_mps2"))
    return np.array([value or 0.0 for value in own])


def drawn_motions(t: np.ndarray) -> np.ndarray:
    """What a drawn velocity of 1 m/s, and an acceleration of 1 m/s², add to the motion: (2, K, 3) at times t (K,)."""
    one, zero = np.ones_like(t), np.zeros_like(t)
    return np.stack([np.stack([t, one, zero], axis=1), np.stack([t**2 / 2, t, one], axis=1)])

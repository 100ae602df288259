"""When a target manoeuvres, and the phase of each scan."""

import math

import numpy as np

from radarsim.studies.sonar.target_keys import Accelerating, Target, Turning


def manoeuvre_times(target: Target) -> tuple[float, float] | None:
    """Start and end of a target's manoeuvre, s; None if it does not manoeuvre, or moves at random."""
    if isinstance(target, Turning):
        turns = [turn for turn in target.turns if turn.rate_radps]
        return (turns[0].start_s, turns[-1].end_s) if turns else None
    if isinstance(target, Accelerating):
        end = math.inf if target.end_s is None else target.end_s
        return (target.start_s, end) if target.acceleration_mps2 else None
    derivatives = (target.range_m, target.bearing_rad) if target.frame == "polar" else (target.x_m, target.y_m)
    curved = any(any(coefficients[2:]) for coefficients in derivatives if coefficients)
    return (0.0, math.inf) if curved else None


def phases(target: Target, t: np.ndarray) -> np.ndarray:
    """0 before the manoeuvre, 1 during it, 2 after it, at every time (K,); its effects show one scan later."""
    times = manoeuvre_times(target)
    if times is None:
        return np.zeros(len(t), dtype=np.int64)
    return (t > times[0]).astype(np.int64) + (t > times[1])

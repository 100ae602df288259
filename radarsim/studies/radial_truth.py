"""The truth of a target in range that the keys of `config.radial_keys` describe."""

from typing import Any

import numpy as np

from radarsim.config import radial_keys
from radarsim.constants import STANDARD_GRAVITY_MPS2
from radarsim.errors import ConfigError
from radarsim.physics import recorded_course, targets


def truth(target: Any, t: np.ndarray) -> np.ndarray:
    """Range, radial velocity and acceleration (K, 3) of a configured target at times t (K,), in m, m/s, m/s².

    For a target with random coefficients: with the means. Raises ValueError for an impossible target."""
    match target.kind:
        case "polynomial":
            return targets.polynomial(target.coefficients, t)
        case "acceleration_start":
            return targets.acceleration_start(target.coefficients, target.acceleration_mps2, target.start_s, t)
        case "acceleration_pulse":
            size = target.acceleration_g * STANDARD_GRAVITY_MPS2
            return targets.acceleration_pulse(target.coefficients, size, target.start_s, target.duration_s, t)
        case "jerk_pulse":
            start = target.start_s
            return targets.jerk_pulse(target.coefficients, target.jerk_mps3, start, target.duration_s, t)
        case "turn":
            leg = target.range_m, target.speed_mps, target.aspect_rad
            return targets.turn(*leg, target.acceleration_g, target.start_s, target.duration_s, t)
        case "fly_by":
            return targets.fly_by(target.distance_m, target.speed_mps, target.start_range_m, t)
        case "recorded":
            return recorded_flight(target.file, t)
    raise ValueError(f"no such target: {target.kind}")


def resting_target(target: Any) -> Any:
    """A target that keeps the range of a configured one at the first plot; one that is drawn, as it is."""
    if target.kind == "random_polynomial":
        return target
    first_range_m = float(truth(target, np.zeros(1))[0, 0])
    return radial_keys.Polynomial(kind="polynomial", coefficients=(first_range_m,))


def recorded_flight(file: str, t: np.ndarray) -> np.ndarray:
    """The radial motion (K, 3) of a recorded flight at times t (K,); raises ValueError where it is too short."""
    times, positions = recorded_course.read_points(file)
    lasts = float(times[-1] - times[0])
    if t[-1] > lasts:
        enough = int(np.searchsorted(t, lasts, side="right"))
        raise ValueError(f"the flight lasts {lasts:g} s, the last of {len(t)} scans is at {t[-1]:g} s; {enough} fit in")
    return recorded_course.radial_motion(recorded_course.smooth_course(times, positions, t))


def checked_truth(target: Any, t: np.ndarray, case: str) -> np.ndarray:
    """As `truth`, (K, 3) at times t (K,); raises ConfigError, naming the case, for an impossible target."""
    try:
        x = truth(target, t)
    except recorded_course.CourseError as error:
        raise ConfigError(*error.faults) from None
    except ValueError as error:
        raise ConfigError(f"{case}: target: {error}") from None
    if not (x[:, 0] > 0).all():
        k = int(np.flatnonzero(x[:, 0] <= 0)[0])
        fault = f"its range must stay > 0, is {x[k, 0]:g} m at {t[k]:g} s, scan {k + 1} of {len(t)}"
        raise ConfigError(f"{case}: target: {fault}")
    return x

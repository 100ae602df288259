"""The scan times, the true motion of the target, and the random part of it.

What is drawn is either the first range, velocity and acceleration of a polynomial, which a filter started by least
squares forgets; or the position and velocity at the start of a flight in space: its accelerations do not change, but
the radar sees another motion in range."""

from itertools import pairwise

import numpy as np

from radarsim.config.experiment import Case
from radarsim.errors import ConfigError
from radarsim.physics import recorded_course, targets
from radarsim.physics.motion import transition
from radarsim.studies.radial_truth import checked_truth
from radarsim.studies.range_doppler.config import FlyBy, Keys, RandomFlight, RecordedFlight, Target, Turn

MIN_DISTANCE_SIGMA = 6.0  # standard deviations of a drawn flight that its middle stays away from the radar
NODES = {2: 6, 3: 6, 4: 5, 6: 4}  # of the mean over so many numbers drawn, in each: to 1e-6 of what they add, at APART
MAX_RANDOM_SCANS = 300  # of a flight that is drawn: beyond, its exact errors are not given
NEGLIGIBLE_SHARE = 1e-10  # of the variance of what is drawn, that is left out
NODES_AT_ONCE = 256  # nodes


def scan_times(spec: Keys) -> np.ndarray:
    """Times (K,) of the scans, s from the first."""
    return np.arange(spec.plots) * spec.radar.scan_period_s


def sigma_flight(target: Target) -> np.ndarray:
    """Standard deviations (6,) with which x, y, z (m) and vx, vy, vz (m/s) at the first plot are drawn. Of a flight in
    a plane through the radar, within the plane."""
    if not isinstance(target, RandomFlight):
        return np.zeros(6)
    axes = np.array([1.0, 1.0, 1.0 if isinstance(target, RecordedFlight) else 0.0])
    return np.concatenate([target.sigma_position_m * axes, target.sigma_velocity_mps * axes])


def is_random(target: Target) -> bool:
    """Whether realisations have targets of their own."""
    return bool(sigma_flight(target).any())


def flight(target: Target, t: np.ndarray) -> np.ndarray:
    """States (K, 9) as (x, vx, ax, y, …) of the middle of a drawn flight, at times t (K,); (0, 9) where none is."""
    match target:
        case _ if not sigma_flight(target).any():
            return np.zeros((0, 9))
        case Turn():
            leg = target.range_m, target.speed_mps, target.aspect_rad
            return targets.turn_in_space(*leg, target.acceleration_g, target.start_s, target.duration_s, t)
        case FlyBy():
            return targets.fly_by_in_space(target.distance_m, target.speed_mps, target.start_range_m, t)
        case RecordedFlight():
            return recorded_course.smooth_course(*recorded_course.read_points(target.file), t)
    raise ValueError(f"no flight: {target.kind}")


def true_motion(case: Case) -> tuple[np.ndarray, np.ndarray]:
    """Times (K,) of the scans and the truth (K, 3) of a case, of a drawn one that of the middle. Raises ConfigError for
    a target that cannot be."""
    target, t = case.spec.target, scan_times(case.spec)
    x = checked_truth(target, t, case.name)
    spread = sigma_flight(target)
    min_range_m = np.hypot(np.max(spread[:3]), np.max(spread[3:]) * t) * MIN_DISTANCE_SIGMA
    if (x[:, 0] < min_range_m).any():
        k = int(np.argmax(x[:, 0] < min_range_m))
        fault = f"its random spread may reach the radar: at {t[k]:g} s it is {x[k, 0]:.4g} m away"
        raise ConfigError(
            f"{case.name}: target: {fault}, {MIN_DISTANCE_SIGMA:g} standard deviations are {min_range_m[k]:.4g} m"
        )
    return t, x


def random_defects(target: Target, t: np.ndarray, x: np.ndarray) -> np.ndarray:
    """How the truth of realisations leaves the filters' model, beyond what the middle x (K, 3) does: (K, 3, 1 + C).

    At every scan F x − x⁺ from the scan before, whose first two moments are these: column 0 its mean, the others its
    covariance as the sum of their products. Not-a-number where the run is too long for it. One column of zeros where
    nothing is drawn that matters."""
    spread, path = sigma_flight(target), flight(target, t)
    scans = len(t)
    if not len(path):
        return np.zeros((scans, 3, 1))
    if scans > MAX_RANDOM_SCANS:
        return np.full((scans, 3, 1), np.nan)
    dt = float(t[1])
    unit = np.array([1.0, dt, dt**2])
    middle_defect = model_defects(x[None], dt)[0]
    total, products = np.zeros(3 * scans), np.zeros((3 * scans, 3 * scans))
    for weights, shifts in displacements(spread):
        deviations = ((model_defects(displaced_motion(path, shifts, t), dt) - middle_defect) * unit).reshape(
            len(weights), -1
        )
        total += weights @ deviations
        products += deviations.T @ (weights[:, None] * deviations)
    variances, vectors = np.linalg.eigh(products - np.outer(total, total))
    is_relevant = variances > NEGLIGIBLE_SHARE * max(variances[-1], 0.0) / len(variances)
    columns = vectors[:, is_relevant][:, ::-1] * np.sqrt(variances[is_relevant][::-1])
    moments: np.ndarray = np.column_stack([total, columns]).reshape(scans, 3, -1) / unit[:, None]
    return moments


def model_defects(x: np.ndarray, dt: float) -> np.ndarray:
    """F x − x⁺ of truths x (M, K, 3), at every scan from the one before; zero at the first."""
    defect: np.ndarray = np.zeros_like(x)
    defect[:, 1:] = x[:, :-1] @ transition(dt).T - x[:, 1:]
    return defect


def displacements(spread: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    """Weights (M,) and displacements (M, 6) whose weighted means are those over what is drawn, some at a time.
    Gauss–Hermite quadrature in each number that is drawn; spread (6,) are their standard deviations."""
    random_numbers = np.flatnonzero(spread)
    nodes, weights = np.polynomial.hermite_e.hermegauss(NODES[len(random_numbers)])
    points = np.stack(np.meshgrid(*[nodes] * len(random_numbers), indexing="ij"), axis=-1).reshape(
        -1, len(random_numbers)
    )
    point_weights = np.stack(np.meshgrid(*[weights / weights.sum()] * len(random_numbers), indexing="ij"), axis=-1)
    shifts = np.zeros((len(points), 6))
    shifts[:, random_numbers] = points * spread[random_numbers]
    weights_of_points = point_weights.reshape(-1, len(random_numbers)).prod(axis=1)
    bounds = [*range(0, len(weights_of_points), NODES_AT_ONCE), len(weights_of_points)]
    return [(weights_of_points[a:b], shifts[a:b]) for a, b in pairwise(bounds)]


def displaced_motion(path: np.ndarray, shifts: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Range, radial velocity and acceleration (M, K, 3) of a flight (K, 9), displaced at first by shifts (M, 6)."""
    moves = shifts[:, None, 3:]
    position = path[:, 0::3] + shifts[:, None, :3] + moves * t[:, None]
    velocity, acceleration = path[:, 1::3] + moves, path[:, 2::3]
    r = np.sqrt((position**2).sum(axis=2))
    radial = (position * velocity).sum(axis=2) / r
    return np.stack([r, radial, ((velocity**2).sum(axis=2) + (position * acceleration).sum(axis=2) - radial**2) / r], 2)

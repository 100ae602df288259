"""P3's scene: what a configured sonar observes, which scans give plots, and the filters in the coordinates' units."""

import math
from dataclasses import dataclass

import numpy as np

from radarsim.config.experiment import Case
from radarsim.errors import ConfigError
from radarsim.studies.sonar import conversion, target_motion
from radarsim.studies.sonar.config import Keys
from radarsim.studies.sonar.filter_design import FilterSpec, Plots
from radarsim.studies.sonar.filter_keys import CORRELATED
from radarsim.studies.sonar.sensor_keys import Sensor, coordinate_correlation
from radarsim.studies.sonar.target_keys import Polynomial, Target, Turning

NEAREST_M = 1e-3  # a course through the sonar passes it at the distance of a rounding, at rates without meaning
MAX_OPEN_SCANS = 9  # scans that may be missed up to which all patterns are enumerated for exact values: 512


@dataclass(frozen=True)
class Scene:
    """What is observed at K times in C coordinates."""

    t: np.ndarray  #: (K,) in s
    truth: np.ndarray  #: (K, C, 3) in the frame of the filters
    polar: np.ndarray  #: (K, C, 3) as measured
    sigma: np.ndarray  #: (K, C) of the plots, infinite where a coordinate is not measured
    nominal: np.ndarray  #: (C,) σ of a plot in the frame of the filters
    rho: np.ndarray  #: (C,)
    walk: np.ndarray  #: (C,) standard deviation of a random acceleration
    certain: np.ndarray  #: (K,) 1 where a scan always gives a plot, 0 where it never does, else -1
    period: float
    probability: float

    def plots(self, c: int, detected: np.ndarray) -> Plots:
        """The plots of coordinate c for patterns `detected` (M, K')."""
        scans = detected.shape[1]
        weight = detected * (self.nominal[c] / self.sigma[:scans, c]) ** 2
        return Plots(self.t[:scans], weight, self.period, self.nominal[c])

    def patterns(self) -> tuple[np.ndarray, np.ndarray]:
        """All patterns (M, K') of plots in the first scans, with their probabilities (M,).

        K' is the number of scans up to which there are at most 2 ** MOST_OPEN patterns."""
        reach = int(np.searchsorted(np.cumsum(self.certain < 0), MAX_OPEN_SCANS, side="right"))
        free = np.flatnonzero(self.certain[:reach] < 0)
        detected = np.tile(np.maximum(self.certain[:reach], 0), (2 ** len(free), 1))
        detected[:, free] = (np.arange(2 ** len(free))[:, None] >> np.arange(len(free))) & 1
        count = detected[:, free].sum(axis=1)
        return detected, self.probability**count * (1 - self.probability) ** (len(free) - count)


def build_scene(case: Case) -> Scene:
    """The scene of a case. Raises ConfigError where the target reaches the sonar, from where it has no bearing."""
    spec: Keys = case.spec
    sensor = spec.sensor
    third, third_sigma = third_coordinate(sensor)
    t, sigma = schedule(sensor, spec.scans)
    with np.errstate(invalid="ignore", divide="ignore"):
        polar, cartesian = courses(spec.target, t, third)
    if not (is_far_enough := polar[:, 0, 0] > NEAREST_M).all():
        k = int(np.argmin(is_far_enough))
        requirement = f"its range must stay > {NEAREST_M:g} m"
        fault = f"{requirement}, is {polar[k, 0, 0]:.3g} m at {t[k]:g} s, plot {k + 1} of {len(t)}"
        raise ConfigError(f"{case.name}: target: {fault}")
    if third is not None:
        first_sonar = np.isin(np.arange(len(t)), np.flatnonzero(sigma[:, 0] == sensor.sigma_range_m))
        sigma = np.column_stack([sigma, np.where(first_sonar, third_sigma, np.inf)])
    nominal = sigma[0].copy()
    if spec.frame != "polar":
        xx, _, yy = conversion.convert_plainly(*polar[0, :2, 0], *nominal[:2])[2]
        nominal[:2] = np.sqrt(xx), np.sqrt(yy)
    certain = np.full(len(t), 1 if sensor.detection_probability == 1 else -1)
    certain[0] = 1
    certain[[k - 1 for k in sensor.missed_scans if k <= len(t)]] = 0
    return Scene(
        t=t,
        truth=polar if spec.frame == "polar" else cartesian,
        polar=polar,
        sigma=sigma,
        nominal=nominal,
        rho=np.array([coordinate_correlation(sensor.error_correlation, c) for c in range(sigma.shape[1])]),
        walk=spec.target.fluctuation_mps2 * lateral_scale(spec, 1),
        certain=certain,
        period=sensor.scan_period_s,
        probability=sensor.detection_probability,
    )


def third_coordinate(sensor: Sensor) -> tuple[str | None, float]:
    """The name and σ of the third coordinate, or None and 0."""
    if sensor.sigma_depth_m is not None:
        return "depth", sensor.sigma_depth_m
    return ("elevation", sensor.sigma_elevation_rad) if sensor.sigma_elevation_rad is not None else (None, 0.0)


def schedule(sensor: Sensor, scans: int) -> tuple[np.ndarray, np.ndarray]:
    """Times (K,) of all sonars' plots, in order, and σ (K, 2) of range and bearing, infinite where not measured."""
    t = [np.arange(scans) * sensor.scan_period_s]
    sigma = [np.tile([sensor.sigma_range_m, sensor.sigma_bearing_rad], (scans, 1))]
    for further_sensor in sensor.further:
        times = np.arange(further_sensor.first_s, t[0][-1] + 1e-9, further_sensor.scan_period_s)
        t.append(times)
        spread = [np.inf if s is None else s for s in (further_sensor.sigma_range_m, further_sensor.sigma_bearing_rad)]
        sigma.append(np.tile(spread, (len(times), 1)))
    order = np.argsort(np.concatenate(t), kind="stable")
    return np.concatenate(t)[order], np.concatenate(sigma)[order]


def courses(target: Target, t: np.ndarray, third: str | None) -> tuple[np.ndarray, np.ndarray]:
    """States (K, C, 3) of a target in polar and in cartesian coordinates; the third coordinate is the same in both."""
    polar: tuple[np.ndarray, ...]
    cartesian: tuple[np.ndarray, ...]
    if isinstance(target, Polynomial) and target.range_m and target.bearing_rad:
        polar = target_motion.polynomial_states([target.range_m, target.bearing_rad], t)
        cartesian = target_motion.cartesian_states(*polar)
    else:
        cartesian = _cartesian_course(target, t)
        polar = target_motion.polar_states(*cartesian)
    if third is None:
        return np.stack(polar, axis=1), np.stack(cartesian, axis=1)
    more = target_motion.polynomial_states(
        [getattr(target, {"depth": "depth_m", "elevation": "elevation_rad"}[third])], t
    )
    return np.stack([*polar, *more], axis=1), np.stack([*cartesian, *more], axis=1)


def _cartesian_course(target: Target, t: np.ndarray) -> tuple[np.ndarray, ...]:
    """States (K, 3) in x and y of a target that is given in the cartesian frame."""
    if isinstance(target, Polynomial):
        return target_motion.polynomial_states([target.x_m or (), target.y_m or ()], t)
    start = (target.x_m, target.y_m, target.speed_mps, target.course_rad)
    if isinstance(target, Turning):
        return target_motion.turning_states(
            *start, [(turn.start_s, turn.end_s, turn.rate_radps) for turn in target.turns], t
        )
    end = math.inf if target.end_s is None else target.end_s
    return target_motion.accelerating_states(*start, target.acceleration_mps2, target.start_s, end, t)


def lateral_scale(spec: Keys, power: int) -> np.ndarray:
    """Factors (C,) from a lateral (m/s²)^power to the units of each coordinate: 1, for angles 1 / range^power."""
    third, _ = third_coordinate(spec.sensor)
    angle = spec.target.initial_range_m ** -float(power)
    factors = [1.0, angle if spec.frame == "polar" else 1.0]
    return np.array(factors if third is None else [*factors, 1.0 if third == "depth" else angle])


def filter_specs(spec: Keys) -> list[FilterSpec]:
    """The filters of a case, in the units of each coordinate."""
    scale = lateral_scale(spec, 2)
    specs = []
    for member in spec.filters:
        filter_correlation = member.error_correlation
        rho = spec.sensor.error_correlation if filter_correlation is None else filter_correlation
        correlated = member.kind in CORRELATED
        specs.append(
            FilterSpec(
                kind=member.kind,
                size=member.degree + 1,
                length=member.plots or 0,
                variance=(member.manoeuvre_variance or 0.0) * scale,
                rho=np.array([coordinate_correlation(rho, c) if correlated else 0.0 for c in range(len(scale))]),
            )
        )
    return specs

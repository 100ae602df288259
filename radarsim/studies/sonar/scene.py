"""P3's scene: what a configured sonar observes, which plots come, and the filters in the units of each coordinate."""

import math
from dataclasses import dataclass

import numpy as np

from radarsim.studies.sonar import banks, filters
from radarsim.studies.sonar import world as models
from radarsim.studies.sonar.config import correlation_of

MOST_OPEN = 9  # scans that may be missed up to which all patterns are enumerated for exact values: 512


@dataclass(frozen=True)
class Scene:
    """What is looked at: K times, C coordinates.

    t (K,) s; truth (K, C, 3) in the working frame, polar (K, C, 3) as measured; sigma (K, C) of the plots, infinite
    where a coordinate is not measured; nominal (C,) plots' σ in the working frame; rho (C,); walk (C,) a random
    acceleration; certain (K,) 1, 0 or -1 as in kernels.patterns.Observation.
    """

    t: np.ndarray
    truth: np.ndarray
    polar: np.ndarray
    sigma: np.ndarray
    nominal: np.ndarray
    rho: np.ndarray
    walk: np.ndarray
    certain: np.ndarray
    period: float
    probability: float


def schedule(sensor, scans: int) -> tuple[np.ndarray, np.ndarray]:
    """Times (K,) of all sonars' plots, in order, and σ (K, 2) of range and bearing, infinite where not measured."""
    t = [np.arange(scans) * sensor.scan_period_s]
    sigma = [np.tile([sensor.sigma_range_m, sensor.sigma_bearing_rad], (scans, 1))]
    for other in sensor.further:
        times = np.arange(other.first_s, t[0][-1] + 1e-9, other.scan_period_s)
        t.append(times)
        spread = [np.inf if s is None else s for s in (other.sigma_range_m, other.sigma_bearing_rad)]
        sigma.append(np.tile(spread, (len(times), 1)))
    order = np.argsort(np.concatenate(t), kind="stable")
    return np.concatenate(t)[order], np.concatenate(sigma)[order]


def courses(target, t: np.ndarray, third: str | None) -> tuple[np.ndarray, np.ndarray]:
    """States (K, C, 3) of a target in polar and in cartesian coordinates; a third coordinate is the same in both."""
    if target.kind == "turning":
        turns = [(leg.start_s, leg.end_s, leg.rate_radps) for leg in target.turns]
        flat = models.turning(target.x_m, target.y_m, target.speed_mps, target.course_rad, turns, t)
        polar = models.polar_states(*flat)
    elif target.kind == "accelerating":
        end = math.inf if target.end_s is None else target.end_s
        vessel = (target.x_m, target.y_m, target.speed_mps, target.course_rad, target.acceleration_mps2)
        flat = models.accelerating(*vessel, target.start_s, end, t)
        polar = models.polar_states(*flat)
    elif target.frame == "polar":
        polar = models.polynomials([target.range_m, target.bearing_rad], t)
        flat = models.cartesian_states(*polar)
    else:
        flat = models.polynomials([target.x_m, target.y_m], t)
        polar = models.polar_states(*flat)
    if third is None:
        return np.stack(polar, axis=1), np.stack(flat, axis=1)
    beside = models.polynomials([getattr(target, {"depth": "depth_m", "elevation": "elevation_rad"}[third])], t)
    return np.stack([*polar, *beside], axis=1), np.stack([*flat, *beside], axis=1)


def third_of(sensor) -> tuple[str | None, float]:
    """Name and σ of the third coordinate, if there is one."""
    if sensor.sigma_depth_m is not None:
        return "depth", sensor.sigma_depth_m
    return ("elevation", sensor.sigma_elevation_rad) if sensor.sigma_elevation_rad is not None else (None, 0.0)


def scene(spec) -> Scene:
    """The scene of a case."""
    sensor, target = spec.sensor, spec.target
    third, spread = third_of(sensor)
    t, sigma = schedule(sensor, spec.scans)
    polar, flat = courses(target, t, third)
    if third is not None:
        own = np.isin(np.arange(len(t)), np.flatnonzero(sigma[:, 0] == sensor.sigma_range_m))
        sigma = np.column_stack([sigma, np.where(own, spread, np.inf)])
    nominal = sigma[0].copy()
    if spec.frame != "polar":
        xx, _, yy = models.converted(*polar[0, :2, 0], *nominal[:2])[2]
        nominal[:2] = np.sqrt(xx), np.sqrt(yy)
    walk = getattr(target, "fluctuation_mps2", 0.0)
    certain = np.full(len(t), 1 if sensor.detection_probability == 1 else -1)
    certain[0] = 1
    certain[[k - 1 for k in sensor.missed_scans if k <= len(t)]] = 0
    return Scene(
        t=t,
        truth=polar if spec.frame == "polar" else flat,
        polar=polar,
        sigma=sigma,
        nominal=nominal,
        rho=np.array([correlation_of(sensor.error_correlation, c) for c in range(sigma.shape[1])]),
        walk=walk * angular(spec, 1),
        certain=certain,
        period=sensor.scan_period_s,
        probability=sensor.detection_probability,
    )


def angular(spec, power: int) -> np.ndarray:
    """What turns a lateral (m/s²)^power into the units of each coordinate (C,): 1, and 1 / range^power for angles."""
    third, _ = third_of(spec.sensor)
    angle = spec.target.range_0() ** -float(power)
    units = [1.0, angle if spec.frame == "polar" else 1.0, {"depth": 1.0, "elevation": angle}.get(third, 0.0)]
    return np.array(units[: 2 if third is None else 3])


# ---- the filters --------------------------------------------------------------------------------------------------
def filter_specs(spec) -> list[banks.FilterSpec]:
    """The filters of a case, in the units of each coordinate."""
    found, coordinates = [], len(angular(spec, 2))
    for f in spec.filters:
        rho = spec.sensor.error_correlation if f.error_correlation is None else f.error_correlation
        known = f.kind in ("kalman_augmented", "kalman_differenced")
        found.append(
            banks.FilterSpec(
                kind=f.kind,
                size=f.degree + 1,
                length=f.plots or 0,
                variance=(f.manoeuvre_variance or 0.0) * angular(spec, 2),
                rho=np.array([correlation_of(rho, c) if known else 0.0 for c in range(coordinates)]),
            )
        )
    return found


def plots_of(seen: Scene, c: int, detected: np.ndarray) -> filters.Plots:
    """Plots of coordinate c under patterns `detected` (M, K)."""
    weight = detected * (seen.nominal[c] / seen.sigma[: detected.shape[1], c]) ** 2
    return filters.Plots(seen.t[: detected.shape[1]], weight, seen.period, seen.nominal[c])


def patterns(seen: Scene) -> tuple[np.ndarray, np.ndarray]:
    """All patterns (M, K') of plots that come in the first scans, as far as there are not too many, and their
    probabilities.
    """
    open_scans = np.cumsum(seen.certain < 0)
    reach = int(np.searchsorted(open_scans, MOST_OPEN, side="right"))
    free = np.flatnonzero(seen.certain[:reach] < 0)
    detected = np.tile(np.maximum(seen.certain[:reach], 0), (2 ** len(free), 1))
    detected[:, free] = (np.arange(2 ** len(free))[:, None] >> np.arange(len(free))) & 1
    number = detected[:, free].sum(axis=1)
    return detected, seen.probability**number * (1 - seen.probability) ** (len(free) - number)

"""Configured trackers and the field of false plots as arrays for the kernels."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from radarsim.studies.sonar.clutter.kernels.false_plots import Cells, Field
from radarsim.studies.sonar.clutter.kernels.gate import KNOWN, NEAREST, OPEN_GATE, PDA
from radarsim.studies.sonar.clutter.kernels.single_tracks import Trackers
from radarsim.studies.sonar.config import Keys
from radarsim.studies.sonar.scene import lateral_scale
from radarsim.studies.sonar.sensor_keys import Sector

ASSOCIATIONS = {"nearest": NEAREST, "pda": PDA, "known": KNOWN}
THRESHOLDS = np.arange(0.0, 15.5, 0.5)  # of the score, in natural logarithms
CELL_SIGMAS = 8.0  # size of a cell in σ of a plot, in each direction; about the size of a settled gate
MAX_MEAN_IN_CELL = 4.0  # mean number of false plots: more cells to look at, but fewer plots outside the gate
MAX_CELLS = 1 << 22


@dataclass(frozen=True)
class TrackerSpec:
    """A configured tracker.

    speed in m/s; lost in σ of a plot; variance (2,) of a manoeuvre in each coordinate."""

    association: str
    gate_probability: float
    m: int
    n: int
    misses: int
    speed: float
    lost: float
    variance: np.ndarray


class Conditions(NamedTuple):
    """What trackers know about the plots.

    period in s, sigma (2,) in m and rad, probability of detection, density of false plots per m²."""

    period: float
    sigma: np.ndarray
    detection: float
    density: float


def tracking_conditions(spec: Keys) -> Conditions:
    """The conditions that the trackers of a case assume."""
    sensor = spec.sensor
    sigma = np.array([sensor.sigma_range_m, sensor.sigma_bearing_rad])
    return Conditions(sensor.scan_period_s, sigma, sensor.detection_probability, sensor.false_plots_per_km2 / 1e6)


def tracker_specs(spec: Keys) -> list[TrackerSpec]:
    """The trackers of a case."""
    members: Any = spec.filters  # completed: with every key of a tracker
    return [
        TrackerSpec(
            member.association,
            member.gate_probability,
            member.rule.m,
            member.rule.n,
            member.drop_after_misses,
            member.speed_mps,
            member.lost_beyond_sigmas,
            (member.manoeuvre_variance or 0.0) * lateral_scale(spec, 2),
        )
        for member in members
    ]


def gate_threshold(probability: float) -> float:
    """χ² with two degrees of freedom that an innovation stays below with this probability; a large number for 1."""
    return -2.0 * math.log1p(-probability) if probability < 1 else OPEN_GATE


def poisson_cdf(mean: float) -> np.ndarray:
    """Distribution function (J,) of a Poisson number, until it is 1 to the last digit."""
    term, total, out = math.exp(-mean), 0.0, []
    for j in range(1, 100_000):
        total += term
        out.append(min(total, 1.0))
        term *= mean / j
        if j > mean and term < 1e-18:
            break
    return np.array([*out[:-1], 1.0])


def field(key: np.ndarray, sector: Sector, conditions: Conditions) -> Field:
    """The field of false plots in a sector; key (2,) of its noise.

    Cells measure CELL_SIGMAS σ of a plot at the mean range of the sector, and contain fewer false plots than
    MAX_MEAN_IN_CELL in the mean."""
    near, far = sector.range_m
    b0, b1 = sector.bearing_rad
    q0, q1 = near**2 / 2, far**2 / 2
    middle = math.sqrt(q0 + q1)
    sigma, density = conditions.sigma, conditions.density
    area = (CELL_SIGMAS * sigma[0] * middle) * (CELL_SIGMAS * sigma[1])
    scale = min(1.0, math.sqrt(MAX_MEAN_IN_CELL / max(density * area, 1e-12)))
    nq = max(1, round((q1 - q0) / (scale * CELL_SIGMAS * sigma[0] * middle)))
    nb = max(1, round((b1 - b0) / (scale * CELL_SIGMAS * sigma[1])))
    while nq * nb > MAX_CELLS:
        nq, nb = max(1, nq // 2), max(1, nb // 2)
    dq, db = (q1 - q0) / nq, (b1 - b0) / nb
    ring = abs(b1 - b0 - 2 * math.pi) < 1e-9
    return Field(key, poisson_cdf(density * dq * db), Cells(q0, dq, nq, b0, db, nb, ring, density))


def trackers(specs: Sequence[TrackerSpec], conditions: Conditions) -> Trackers:
    """Trackers as arrays for the kernels."""
    variance = np.stack([spec.variance for spec in specs])
    return Trackers(
        association=np.array([ASSOCIATIONS[spec.association] for spec in specs]),
        chi_square=np.array([gate_threshold(spec.gate_probability) for spec in specs]),
        gate_probability=np.array([spec.gate_probability for spec in specs]),
        m=np.array([float(spec.m) for spec in specs]),
        n=np.array([float(spec.n) for spec in specs]),
        misses=np.array([float(spec.misses) for spec in specs]),
        speed=np.array([spec.speed for spec in specs]),
        lost=np.array([spec.lost for spec in specs]),
        manoeuvre=variance * conditions.period**4 / conditions.sigma**2,
        score_thresholds=THRESHOLDS,
        **conditions._asdict(),
    )

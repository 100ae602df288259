"""Labels and exact laws of the sums of trackers among false plots.

P3's trackers and the field of false plots as arrays for the kernels.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from radarsim.studies.sonar.clutter.kernels.tracker import KNOWN, NEAREST, OPEN, PDA, Cells, Field, Trackers
from radarsim.studies.sonar.config import Keys, Sector
from radarsim.studies.sonar.kernels.patterns import Detections
from radarsim.studies.sonar.kernels.shared_gains import World
from radarsim.studies.sonar.scene import lateral_scale
from radarsim.studies.sonar.world import SonarAxes


# ---- axes ------------------------------------------------------------------------------------------------------------
@dataclass(frozen=True, kw_only=True)
class ClutterAxes(SonarAxes):
    """Labels and exact laws of F trackers, and the arrays that both the kernels and a map of one realisation read.

    Attributes:
        associations: how each filter chooses its plots: nearest, pda or known.
        thresholds: (T,) thresholds of a track's score, in natural logarithms.
        exact_confirmed: (F, K) probability that a track of the target was confirmed by each scan; NaN where no law is
            known.
        exact_begun: (F, K) probability that a track begun by a false plot is confirmed at each scan; NaN likewise.
        area_m2: area of the surveyed sector, m².
        world: the target and its plots.
        detections: which scans give a plot of the target.
        field: the false plots among which the target is tracked.
    """

    associations: tuple[str, ...]
    thresholds: np.ndarray
    exact_confirmed: np.ndarray
    exact_begun: np.ndarray
    area_m2: float
    world: World
    detections: Detections
    field: Field


# ---- filters ---------------------------------------------------------------------------------------------------------
ASSOCIATIONS = {"nearest": NEAREST, "pda": PDA, "known": KNOWN}
THRESHOLDS = np.arange(0.0, 15.5, 0.5)  # of the score, in natural logarithms
CELL = 8.0  # size of a cell in σ of a plot, in each direction; about the size of a settled gate
MOST_IN_CELL = 4.0  # mean number of false plots: more cells to look at, but fewer plots outside the gate
MOST_CELLS = 1 << 22


@dataclass(frozen=True)
class TrackerSpec:
    """A configured tracker; speed in m/s, lost in σ of a plot, variance (2,) of a manoeuvre in each coordinate."""

    association: str
    gate_probability: float
    m: int
    n: int
    misses: int
    speed: float
    lost: float
    variance: np.ndarray


class Conditions(NamedTuple):
    """What trackers know of the plots: period in s, sigma (2,) in m and rad, detection probability, and the density of
    false plots per m².
    """

    period: float
    sigma: np.ndarray
    detection: float
    density: float


def conditions(spec: Keys) -> Conditions:
    """The conditions of a case."""
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
    return -2.0 * math.log1p(-probability) if probability < 1 else OPEN


def poisson_share(mean: float) -> np.ndarray:
    """Distribution function (J,) of a Poisson number, up to where it is 1 to the last digit."""
    term, total, out = math.exp(-mean), 0.0, []
    for j in range(1, 100_000):
        total += term
        out.append(min(total, 1.0))
        term *= mean / j
        if j > mean and term < 1e-18:
            break
    return np.array([*out[:-1], 1.0])


def field(key: np.ndarray, sector: Sector, given: Conditions) -> Field:
    """The field of false plots of a sector; key (2,) of its noise.

    Cells have the size of the plots' σ at the mean range of the sector, times CELL, and contain fewer false plots than
    MOST_IN_CELL in the mean.
    """
    near, far = sector.range_m
    b0, b1 = sector.bearing_rad
    q0, q1 = near**2 / 2, far**2 / 2
    middle = math.sqrt(q0 + q1)
    sigma, density = given.sigma, given.density
    area = (CELL * sigma[0] * middle) * (CELL * sigma[1])
    scale = min(1.0, math.sqrt(MOST_IN_CELL / max(density * area, 1e-12)))
    nq = max(1, round((q1 - q0) / (scale * CELL * sigma[0] * middle)))
    nb = max(1, round((b1 - b0) / (scale * CELL * sigma[1])))
    while nq * nb > MOST_CELLS:
        nq, nb = max(1, nq // 2), max(1, nb // 2)
    dq, db = (q1 - q0) / nq, (b1 - b0) / nb
    ring = abs(b1 - b0 - 2 * math.pi) < 1e-9
    return Field(key, poisson_share(density * dq * db), Cells(q0, dq, nq, b0, db, nb, ring, density))


def trackers(specs: Sequence[TrackerSpec], given: Conditions) -> Trackers:
    """The arrays of trackers that know these conditions."""
    variance = np.stack([one.variance for one in specs])
    return Trackers(
        association=np.array([ASSOCIATIONS[one.association] for one in specs]),
        gate=np.array([gate_threshold(one.gate_probability) for one in specs]),
        inside=np.array([one.gate_probability for one in specs]),
        m=np.array([float(one.m) for one in specs]),
        n=np.array([float(one.n) for one in specs]),
        misses=np.array([float(one.misses) for one in specs]),
        speed=np.array([one.speed for one in specs]),
        lost=np.array([one.lost for one in specs]),
        manoeuvre=variance * given.period**4 / given.sigma**2,
        thresholds=THRESHOLDS,
        **given._asdict(),
    )

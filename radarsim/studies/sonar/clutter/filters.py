"""Trackers of P3 and the field of false plots as the arrays that the kernels take."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from radarsim.studies.sonar.clutter.kernels import tracker as kernels
from radarsim.studies.sonar.clutter.kernels.field import KNOWN, NEAREST, OPEN, PDA, Field

ASSOCIATIONS = {"nearest": NEAREST, "pda": PDA, "known": KNOWN}
THRESHOLDS = np.arange(0.0, 15.5, 0.5)  # of the score, in natural logarithms
CELL = 8.0  # a cell in σ of a plot, each way; about a settled gate
MOST_IN_CELL = 4.0  # mean number of false plots: fewer plots are looked at in vain, but more cells
MOST_CELLS = 1 << 22


@dataclass(frozen=True)
class TrackerSpec:
    """A tracker as chosen; speed in m/s, lost in σ of a plot, variance (2,) of the manoeuvre by coordinate."""

    association: str
    gate_probability: float
    m: int
    n: int
    misses: int
    speed: float
    lost: float
    variance: np.ndarray


def gate_threshold(probability: float) -> float:
    """χ² of two degrees of freedom below which an innovation lies with that probability; a large number for 1."""
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


def field(key: np.ndarray, sector, density: float, sigma: np.ndarray) -> Field:
    """The field of false plots of a sector (range_m, bearing_rad), density per m²; sigma (2,) of a plot, m and rad.

    Cells follow the plots' σ at the sector's mean range, and hold fewer false plots than MOST_IN_CELL.
    """
    near, far = sector.range_m
    b0, b1 = sector.bearing_rad
    q0, q1 = near**2 / 2, far**2 / 2
    middle = math.sqrt(q0 + q1)
    area = (CELL * sigma[0] * middle) * (CELL * sigma[1])
    scale = min(1.0, math.sqrt(MOST_IN_CELL / max(density * area, 1e-12)))
    nq = max(1, round((q1 - q0) / (scale * CELL * sigma[0] * middle)))
    nb = max(1, round((b1 - b0) / (scale * CELL * sigma[1])))
    while nq * nb > MOST_CELLS:
        nq, nb = max(1, nq // 2), max(1, nb // 2)
    dq, db = (q1 - q0) / nq, (b1 - b0) / nb
    ring = abs(b1 - b0 - 2 * math.pi) < 1e-9
    return Field(key, poisson_share(density * dq * db), q0, dq, nq, b0, db, nb, ring, density)


def trackers(
    specs: Sequence[TrackerSpec], period: float, sigma: np.ndarray, detection: float, density: float
) -> kernels.Trackers:
    """Trackers that know the detection probability and the density (per m²) of false plots."""
    variance = np.stack([one.variance for one in specs])
    return kernels.Trackers(
        association=np.array([ASSOCIATIONS[one.association] for one in specs]),
        gate=np.array([gate_threshold(one.gate_probability) for one in specs]),
        inside=np.array([one.gate_probability for one in specs]),
        m=np.array([float(one.m) for one in specs]),
        n=np.array([float(one.n) for one in specs]),
        misses=np.array([float(one.misses) for one in specs]),
        speed=np.array([one.speed for one in specs]),
        lost=np.array([one.lost for one in specs]),
        manoeuvre=variance * period**4 / sigma**2,
        detection=float(detection),
        density=float(density),
        period=float(period),
        sigma=sigma,
        thresholds=THRESHOLDS,
    )

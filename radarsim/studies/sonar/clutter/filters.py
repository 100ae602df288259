"""Labels and exact laws of the sums of trackers among false plots.

P3's trackers and the field of false plots as arrays for the kernels. Exact laws of track initiation: m of n without
false plots; pairs of false plots by quadrature."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from radarsim.studies.sonar.clutter.kernels.tracker import KNOWN, NEAREST, OPEN_GATE, PDA, Cells, Field, Trackers
from radarsim.studies.sonar.config import Keys, Sector
from radarsim.studies.sonar.kernels.patterns import Detections
from radarsim.studies.sonar.kernels.shared_gains import World
from radarsim.studies.sonar.scene import lateral_scale
from radarsim.studies.sonar.world import SonarAxes


# ---- axes ------------------------------------------------------------------------------------------------------------
@dataclass(frozen=True, kw_only=True)
class ClutterAxes(SonarAxes):
    """Labels and exact laws of F trackers, and the arrays that both the kernels and a map of one realisation read."""

    associations: tuple[str, ...]  #: how each filter chooses its plots: nearest, pda or known.
    thresholds: np.ndarray  #: (T,) thresholds of a track's score, in natural logarithms.
    #: (F, K) probability that a track of the target was confirmed by each scan; NaN where no law is known.
    exact_confirmed: np.ndarray
    #: (F, K) probability that a track begun by a false plot is confirmed at each scan; NaN likewise.
    exact_begun: np.ndarray
    area_m2: float  #: area of the surveyed sector, m².
    world: World  #: the target and its plots.
    detections: Detections  #: which scans give a plot of the target.
    field: Field  #: the false plots among which the target is tracked.


# ---- filters ---------------------------------------------------------------------------------------------------------
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
        gate=np.array([gate_threshold(spec.gate_probability) for spec in specs]),
        inside=np.array([spec.gate_probability for spec in specs]),
        m=np.array([float(spec.m) for spec in specs]),
        n=np.array([float(spec.n) for spec in specs]),
        misses=np.array([float(spec.misses) for spec in specs]),
        speed=np.array([spec.speed for spec in specs]),
        lost=np.array([spec.lost for spec in specs]),
        manoeuvre=variance * conditions.period**4 / conditions.sigma**2,
        thresholds=THRESHOLDS,
        **conditions._asdict(),
    )


# ---- initiation ------------------------------------------------------------------------------------------------------
def confirmation_probabilities(probability: np.ndarray, m: int, n: int) -> np.ndarray:
    """Probability (K,) that a track of the target was confirmed by each scan, without false plots and with open gates.

    probability (K,) of a plot at each scan. The law is that of a Markov chain over the age of the track and its plots
    so far: a plot begins a track where there is none; the track is confirmed with its m-th plot, and given up once m
    plots in its first n scans cannot be reached."""
    idle, tracks, confirmed, out = 1.0, np.zeros((n + 1, m + 1)), 0.0, np.zeros(len(probability))
    for k, p in enumerate(probability):
        next_tracks = np.zeros_like(tracks)
        begun, next_idle = idle * p, idle * (1 - p)
        for age in range(1, n):
            for hits in range(1, m):
                share = tracks[age, hits]
                if hits + 1 == m:
                    confirmed += share * p
                else:
                    next_tracks[age + 1, hits + 1] += share * p
                if hits + (n - age - 1) >= m:
                    next_tracks[age + 1, hits] += share * (1 - p)
                else:
                    next_idle += share * (1 - p)
        next_tracks[1, 1] += begun
        idle, tracks, out[k] = next_idle, next_tracks, confirmed
    return out


def false_pair_probabilities(
    sector: Sector, conditions: Conditions, tracker: TrackerSpec, scans: int, nodes: int = 48
) -> np.ndarray:
    """Probability (K,) that a track begun by a false plot at scan 1 is confirmed at each scan by the rule 2 of n.

    Before its second plot the predicted position of a track is its first plot, and its gate is an ellipse in range and
    bearing of known size: the number of false plots in the part of it within the sector is a Poisson number. The
    quadrature runs over the position of the first plot, uniform in area, and over the ellipse."""
    (near, far), (b0, b1) = sector.range_m, sector.bearing_rad
    u, w = np.polynomial.legendre.leggauss(nodes)
    u, w = (u + 1) / 2, w / 2
    r, b = np.sqrt(2 * (0.5 * (near**2 + (far**2 - near**2) * u))), b0 + (b1 - b0) * u
    gate = gate_threshold(tracker.gate_probability)
    variance_r, variance_b = 2 * conditions.sigma**2
    out, no_plot = np.zeros(scans), np.ones((nodes, nodes))
    for k in range(1, min(tracker.n, scans)):
        reach = tracker.speed * k * conditions.period
        half_r, half_b = np.sqrt(gate * (variance_r + reach**2)), np.sqrt(gate * (variance_b + (reach / r) ** 2))
        mean = conditions.density * _ellipse_areas(r, b, half_r, half_b, sector)
        out[k] = np.einsum("i,j,ij->", w, w, no_plot * -np.expm1(-mean))
        no_plot *= np.exp(-mean)
    return out


def _ellipse_areas(
    r: np.ndarray, b: np.ndarray, half_r: float, half_b: np.ndarray, sector: Sector, nodes: int = 64
) -> np.ndarray:
    """Areas (i, j), m², within the sector of the ellipses about (r_i, b_j) with half-axes half_r and half_b_i."""
    (near, far), (b0, b1) = sector.range_m, sector.bearing_rad
    u, w = np.polynomial.legendre.leggauss(nodes)
    low, high = np.maximum(r - half_r, near), np.minimum(r + half_r, far)
    x = low[:, None] + (high - low)[:, None] * (u + 1) / 2  # (i, nodes)
    half = half_b[:, None] * np.sqrt(np.maximum(1 - ((x - r[:, None]) / half_r) ** 2, 0.0))
    last = np.minimum(b[None, :, None] + half[:, None], b1)
    first = np.maximum(b[None, :, None] - half[:, None], b0)
    inside = np.maximum(last - first, 0.0)
    if abs(b1 - b0 - 2 * math.pi) < 1e-9:  # a full circle has no edges in bearing
        inside = np.minimum(2 * half[:, None], 2 * math.pi) + 0 * inside
    return np.einsum("n,in,ijn->ij", w / 2, x, inside) * (high - low)[:, None]

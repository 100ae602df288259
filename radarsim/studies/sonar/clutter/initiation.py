"""Exact laws of track initiation: m of n without false plots; pairs of false plots by quadrature."""

import math

import numpy as np

from radarsim.studies.sonar.clutter.tracker_design import Conditions, TrackerSpec, gate_threshold
from radarsim.studies.sonar.sensor_keys import Sector


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

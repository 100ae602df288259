"""Exact laws of track initiation: m of n without false plots, pairs of false plots by quadrature."""

import math

import numpy as np


def confirmed_by(probability: np.ndarray, m: int, n: int) -> np.ndarray:
    """Probability (K,) that a track of the target was confirmed by each scan, without false plots and with open gates.

    probability (K,) of a plot at each scan. A Markov chain over the age of the track and its plots so far: a plot where
    there is no track begins one; it is confirmed with its m-th plot, and given up once m of its first n scans cannot be
    reached. What a gate shuts out is not in it.
    """
    idle, tracks, found, out = 1.0, np.zeros((n + 1, m + 1)), 0.0, np.zeros(len(probability))
    for k, p in enumerate(probability):
        moved = np.zeros_like(tracks)
        begun, still = idle * p, idle * (1 - p)
        for age in range(1, n):
            for hits in range(1, m):
                there = tracks[age, hits]
                if hits + 1 == m:
                    found += there * p
                else:
                    moved[age + 1, hits + 1] += there * p
                if hits + (n - age - 1) >= m:
                    moved[age + 1, hits] += there * (1 - p)
                else:
                    still += there * (1 - p)
        moved[1, 1] += begun
        idle, tracks, out[k] = still, moved, found
    return out


def false_pairs(
    range_m: tuple[float, float],
    bearing_rad: tuple[float, float],
    density: float,
    sigma: np.ndarray,
    rule,
    period: float,
    scans: int,
    nodes: int = 48,
) -> np.ndarray:
    """Probability (K,) that a track begun by a false plot at scan 1 is confirmed at each scan by the rule 2 of n.

    Until its second plot a track's foretold place is its first plot, and its gate an ellipse in range and bearing whose
    size is known: the number of false plots in it, cut by the sector's edges, is a Poisson number. Quadrature over the
    first plot's place (uniform in area) and over the ellipse; density per m², sigma (2,) of a plot in m and rad, rule
    with n, speed and gate_probability.
    """
    u, w = np.polynomial.legendre.leggauss(nodes)
    u, w = (u + 1) / 2, w / 2
    q = 0.5 * (range_m[0] ** 2 + (range_m[1] ** 2 - range_m[0] ** 2) * u)
    r, b = np.sqrt(2 * q), bearing_rad[0] + (bearing_rad[1] - bearing_rad[0]) * u
    gate = -2 * math.log1p(-rule.gate_probability) if rule.gate_probability < 1 else 1e30
    out, none = np.zeros(scans), np.ones((nodes, nodes))
    for k in range(1, min(rule.n, scans)):
        reach = rule.speed * k * period
        wide, high = (
            np.sqrt(gate * (2 * sigma[0] ** 2 + reach**2)),
            np.sqrt(gate * (2 * sigma[1] ** 2 + (reach / r) ** 2)),
        )
        mean = density * _area(r, b, wide, high, range_m, bearing_rad)
        out[k] = np.einsum("i,j,ij->", w, w, none * -np.expm1(-mean))
        none *= np.exp(-mean)
    return out


def _area(r, b, wide: float, high: np.ndarray, range_m, bearing_rad, nodes: int = 64) -> np.ndarray:
    """Areas (i, j), m², of the ellipses about (r_i, b_j), half-axes wide and high_i, within the sector."""
    u, w = np.polynomial.legendre.leggauss(nodes)
    low, top = np.maximum(r - wide, range_m[0]), np.minimum(r + wide, range_m[1])
    x = low[:, None] + (top - low)[:, None] * (u + 1) / 2  # (i, nodes)
    half = high[:, None] * np.sqrt(np.maximum(1 - ((x - r[:, None]) / wide) ** 2, 0.0))
    right = np.minimum(b[None, :, None] + half[:, None], bearing_rad[1])
    left = np.maximum(b[None, :, None] - half[:, None], bearing_rad[0])
    inside = np.maximum(right - left, 0.0)
    full = abs(bearing_rad[1] - bearing_rad[0] - 2 * math.pi) < 1e-9
    if full:
        inside = np.minimum(2 * half[:, None], 2 * math.pi) + 0 * inside
    return np.einsum("n,in,ijn->ij", w / 2, x, inside) * (top - low)[:, None]

"""The floor under σ of a sonar's target (P3): of a polynomial, in the frame in which it moves or in the other one."""

import numpy as np

from radarsim.physics import transition
from radarsim.studies import floor as floors
from radarsim.studies.floor import Bound, Floor
from radarsim.studies.sonar.config import Keys, Polynomial
from radarsim.studies.sonar.scene import lateral_scale
from radarsim.studies.sonar.world import GivenPlotsAxes, step_correlations


def floor(spec: Keys, axes: GivenPlotsAxes) -> Floor | None:
    """Of polynomials; of a course that turns or speeds up none is defined. Of the first degree in each coordinate, or
    of its own where that is higher. None is computed where errors are correlated and plots missed at random, or a
    fluctuating target has either."""
    target, t = spec.target, np.asarray(axes.t_s, dtype=float)
    if not isinstance(target, Polynomial):
        return None
    seen = np.isfinite(axes.sigma_of_plots)
    free = np.flatnonzero(seen.any(axis=1))[1:] if spec.sensor.detection_probability < 1 else np.zeros(0, dtype=int)
    correlated = bool(np.any(axes.rho))
    size = axes.available.shape[2] // seen.shape[1]
    if target.fluctuation_mps2:
        bound = None if correlated or free.size else fluctuating(target, spec, axes, t, size)
        return None if bound is None else Floor(floors.POSTERIOR, (bound,) * len(axes.filters), bound)
    if correlated and free.size:
        return None
    rows, maps = derivatives(target, spec, axes, t, size)
    reached = spec.frame == target.frame == "polar"
    information = np.zeros((len(t), rows.shape[2], rows.shape[2]))
    for c in range(rows.shape[1]):
        information += products(rows[:, c], axes.sigma_of_plots[:, c], float(axes.rho[c]), t, axes.scan_period_s)
    none = np.zeros(information.shape[1:])
    if not free.size:
        bound = floors.static(none, information, maps, reached)
    else:
        chance = seen.any(axis=1).astype(float)
        chance[free] = spec.sensor.detection_probability
        needed = tuple(1 + j for _ in range(seen.shape[1]) for j in range(size))
        settles = rows.shape[2] - 2 * (rows.shape[1] - 1)  # no less than a coordinate has coefficients: others have two
        bound = floors.missed(none, information, maps, chance, np.repeat(seen, size, axis=1), needed, settles)
    return Floor(floors.CRB, (bound,) * len(axes.filters), bound)


def products(row: np.ndarray, sigma: np.ndarray, rho: float, t: np.ndarray, period: float) -> np.ndarray:
    """Information (K, p, p) of the plots of one coordinate with derivatives (K, p); sigma infinite where there is none.
    Of correlated errors a plot adds what it differs by from the one before."""
    found = np.zeros((*row.shape, row.shape[1]))
    there = np.flatnonzero(np.isfinite(sigma))
    steps = step_correlations(rho, t[there], period)
    for i, k in enumerate(there):
        fresh = row[k] - (steps[i] * row[there[i - 1]] if i else 0.0)
        found[k] = np.outer(fresh, fresh) / (sigma[k] ** 2 * (1 - steps[i] ** 2))
    return found


def derivatives(
    target: Polynomial, spec: Keys, axes: GivenPlotsAxes, t: np.ndarray, size: int
) -> tuple[np.ndarray, np.ndarray]:
    """Derivatives of the measured coordinates (K, C, p), and of the components (K, C · size, p), by the coefficients of
    the target, all coordinates' one after the other."""
    polar = axes.polar
    plane = (target.range_m, target.bearing_rad) if target.frame == "polar" else (target.x_m, target.y_m)
    third = (target.depth_m if spec.sensor.sigma_depth_m is not None else target.elevation_rad) or ()
    sizes = [max(2, len(given or ())) for given in (*plane, third)][: polar.shape[1]]
    states = np.zeros((len(t), len(sizes), 3, sum(sizes)))
    begin = 0
    for c, own in enumerate(sizes):
        states[:, c, :, begin : begin + own] = floors.polynomial(t, own)
        begin += own
    measured = states if target.frame == "polar" else to_polar(states, polar)
    if (spec.frame == "polar") == (target.frame == "polar"):
        shown = states
    else:
        shown = to_polar(states, polar) if spec.frame == "polar" else to_cartesian(states, polar)
    return measured[:, :, 0], shown[:, :, :size].reshape(len(t), -1, begin)


def to_polar(states: np.ndarray, polar: np.ndarray) -> np.ndarray:
    """Derivatives (K, C, 3, p) of range and bearing and their rates, of those of x and y; not of second rates, which
    are not-a-number. polar (K, C, 3) the target's."""
    (r, vr, _), (b, vb, _) = (polar[:, c].T[..., None] for c in range(2))
    (x, vx, _), (y, vy, _) = (np.moveaxis(states[:, c], 1, 0) for c in range(2))
    c, s, made = np.cos(b), np.sin(b), states.copy()
    made[:, :2, 2] = np.nan
    of_r, of_b = c * x + s * y, (c * y - s * x) / r
    made[:, 0, 0], made[:, 1, 0] = of_r, of_b
    made[:, 0, 1] = c * vx + s * vy + r * vb * of_b
    made[:, 1, 1] = (c * vy - s * vx - vr * of_b - vb * of_r) / r
    return made


def to_cartesian(states: np.ndarray, polar: np.ndarray) -> np.ndarray:
    """Derivatives (K, C, 3, p) of x and y and their rates, of those of range and bearing; else as `to_polar`."""
    (r, vr, _), (b, vb, _) = (polar[:, c].T[..., None] for c in range(2))
    (of_r, of_vr, _), (of_b, of_vb, _) = (np.moveaxis(states[:, c], 1, 0) for c in range(2))
    c, s, made = np.cos(b), np.sin(b), states.copy()
    made[:, :2, 2] = np.nan
    along, across = of_vr - r * vb * of_b, vr * of_b + vb * of_r + r * of_vb
    made[:, 0, 0], made[:, 1, 0] = c * of_r - s * r * of_b, s * of_r + c * r * of_b
    made[:, 0, 1], made[:, 1, 1] = c * along - s * across, s * along + c * across
    return made


def fluctuating(target: Polynomial, spec: Keys, axes: GivenPlotsAxes, t: np.ndarray, size: int) -> Bound:
    """At times t (K,), of a target with a random acceleration, constant between scans: coordinate by coordinate."""
    walk = target.fluctuation_mps2 * lateral_scale(spec, 1)
    given = (target.range_m, target.bearing_rad, target.depth_m or target.elevation_rad)
    sigma_of_plots, made = axes.sigma_of_plots, []
    for c, own in enumerate(given[: sigma_of_plots.shape[1]]):
        n = max(2, len(own or ()))
        dt, information = np.diff(t, prepend=t[0]), np.zeros((len(t), n, n))
        information[:, 0, 0] = sigma_of_plots[:, c] ** -2.0
        pushed = np.pad(np.stack([dt**2 / 2, dt], axis=1) * walk[c], ((0, 0), (0, n - 2)))
        F, Q = np.stack([transition(step, n) for step in dt]), pushed[:, :, None] * pushed[:, None, :]
        made.append(floors.moving(np.zeros((n, n)), information, F, Q, size))
    sigma, waited, smoothed = (np.concatenate(part, axis=-1) for part in zip(*(one[:3] for one in made), strict=True))
    return Bound(sigma, waited, smoothed, made[0].patterns)

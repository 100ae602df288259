"""The floor under σ of a sonar's target (P3): of a polynomial, in the frame in which it moves or in the other one."""

import numpy as np

from radarsim.physics.motion import transition
from radarsim.studies.floors import bound as floors_bound
from radarsim.studies.floors import missed_plots, moving, static
from radarsim.studies.floors.bound import Bound, Floor
from radarsim.studies.sonar.axes import GivenPlotsAxes
from radarsim.studies.sonar.config import Keys
from radarsim.studies.sonar.plot_errors import step_correlations
from radarsim.studies.sonar.scene import lateral_scale
from radarsim.studies.sonar.target_keys import Polynomial


def floor(spec: Keys, axes: GivenPlotsAxes) -> Floor | None:
    """The floor under σ of a target whose coordinates are polynomials; None for a course that turns or accelerates.

    Each polynomial is of the first degree, or of the target's own degree where that is higher. No floor is computed
    where errors are correlated and plots are missed at random, nor where a fluctuating target has either."""
    target, t = spec.target, np.asarray(axes.t_s, dtype=float)
    if not isinstance(target, Polynomial):
        return None
    is_measured = np.isfinite(axes.sigma_of_plots)
    random_scans = (
        np.flatnonzero(is_measured.any(axis=1))[1:] if spec.sensor.detection_probability < 1 else np.zeros(0, dtype=int)
    )
    correlated = bool(np.any(axes.rho))
    size = axes.available.shape[2] // is_measured.shape[1]
    if target.fluctuation_mps2:
        bound = None if correlated or random_scans.size else fluctuating(target, spec, axes, t, size)
        return None if bound is None else Floor(floors_bound.POSTERIOR, (bound,) * len(axes.filters), bound)
    if correlated and random_scans.size:
        return None
    rows, maps = derivatives(target, spec, axes, t, size)
    reached = spec.frame == target.frame == "polar"
    information = np.zeros((len(t), rows.shape[2], rows.shape[2]))
    for c in range(rows.shape[1]):
        information += products(rows[:, c], axes.sigma_of_plots[:, c], float(axes.rho[c]), t, axes.scan_period_s)
    no_prior = np.zeros(information.shape[1:])
    if not random_scans.size:
        bound = static.static_bound(no_prior, information, maps, reached)
    else:
        detection_probability = is_measured.any(axis=1).astype(float)
        detection_probability[random_scans] = spec.sensor.detection_probability
        needed = tuple(1 + j for _ in range(is_measured.shape[1]) for j in range(size))
        # At least the coefficients of one coordinate: the others have two.
        settling_scans = rows.shape[2] - 2 * (rows.shape[1] - 1)
        bound = missed_plots.missed_plots_bound(
            no_prior,
            information,
            maps,
            detection_probability,
            np.repeat(is_measured, size, axis=1),
            needed,
            settling_scans,
        )
    return Floor(floors_bound.CRB, (bound,) * len(axes.filters), bound)


def products(row: np.ndarray, sigma: np.ndarray, rho: float, t: np.ndarray, period: float) -> np.ndarray:
    """Information (K, p, p) in the plots of one coordinate with derivatives (K, p); sigma infinite without a plot.

    With correlated errors a plot adds the information in its difference from the previous one."""
    information = np.zeros((*row.shape, row.shape[1]))
    measured_scans = np.flatnonzero(np.isfinite(sigma))
    steps = step_correlations(rho, t[measured_scans], period)
    for i, k in enumerate(measured_scans):
        fresh = row[k] - (steps[i] * row[measured_scans[i - 1]] if i else 0.0)
        information[k] = np.outer(fresh, fresh) / (sigma[k] ** 2 * (1 - steps[i] ** 2))
    return information


def derivatives(
    target: Polynomial, spec: Keys, axes: GivenPlotsAxes, t: np.ndarray, size: int
) -> tuple[np.ndarray, np.ndarray]:
    """Derivatives of the measured coordinates (K, C, p) and of the components (K, C · size, p).

    With respect to the p coefficients of the target, of all coordinates one after the other."""
    polar = axes.polar
    plane = (target.range_m, target.bearing_rad) if target.frame == "polar" else (target.x_m, target.y_m)
    third = (target.depth_m if spec.sensor.sigma_depth_m is not None else target.elevation_rad) or ()
    sizes = [max(2, len(derivatives_given or ())) for derivatives_given in (*plane, third)][: polar.shape[1]]
    states = np.zeros((len(t), len(sizes), 3, sum(sizes)))
    start = 0
    for c, coefficient_count in enumerate(sizes):
        states[:, c, :, start : start + coefficient_count] = static.polynomial(t, coefficient_count)
        start += coefficient_count
    measured = states if target.frame == "polar" else to_polar(states, polar)
    if (spec.frame == "polar") == (target.frame == "polar"):
        component_states = states
    else:
        component_states = to_polar(states, polar) if spec.frame == "polar" else to_cartesian(states, polar)
    return measured[:, :, 0], component_states[:, :, :size].reshape(len(t), -1, start)


def to_polar(states: np.ndarray, polar: np.ndarray) -> np.ndarray:
    """Derivatives (K, C, 3, p) of range, bearing and their rates, from those of x and y; NaN for second rates.

    polar (K, C, 3) are the target's states."""
    (r, vr, _), (b, vb, _) = (polar[:, c].T[..., None] for c in range(2))
    (x, vx, _), (y, vy, _) = (np.moveaxis(states[:, c], 1, 0) for c in range(2))
    c, s, result = np.cos(b), np.sin(b), states.copy()
    result[:, :2, 2] = np.nan
    d_r, d_b = c * x + s * y, (c * y - s * x) / r
    result[:, 0, 0], result[:, 1, 0] = d_r, d_b
    result[:, 0, 1] = c * vx + s * vy + r * vb * d_b
    result[:, 1, 1] = (c * vy - s * vx - vr * d_b - vb * d_r) / r
    return result


def to_cartesian(states: np.ndarray, polar: np.ndarray) -> np.ndarray:
    """Derivatives (K, C, 3, p) of x, y and their rates, from those of range and bearing; otherwise as `to_polar`."""
    (r, vr, _), (b, vb, _) = (polar[:, c].T[..., None] for c in range(2))
    (d_r, d_vr, _), (d_b, d_vb, _) = (np.moveaxis(states[:, c], 1, 0) for c in range(2))
    c, s, result = np.cos(b), np.sin(b), states.copy()
    result[:, :2, 2] = np.nan
    along, across = d_vr - r * vb * d_b, vr * d_b + vb * d_r + r * d_vb
    result[:, 0, 0], result[:, 1, 0] = c * d_r - s * r * d_b, s * d_r + c * r * d_b
    result[:, 0, 1], result[:, 1, 1] = c * along - s * across, s * along + c * across
    return result


def fluctuating(target: Polynomial, spec: Keys, axes: GivenPlotsAxes, t: np.ndarray, size: int) -> Bound:
    """The bound at times t (K,) for a target with a random acceleration, constant between scans, by coordinate."""
    walk = target.fluctuation_mps2 * lateral_scale(spec, 1)
    derivatives_by_coordinate = (target.range_m, target.bearing_rad, target.depth_m or target.elevation_rad)
    sigma_of_plots, bounds = axes.sigma_of_plots, []
    for c, coordinate_derivatives in enumerate(derivatives_by_coordinate[: sigma_of_plots.shape[1]]):
        n = max(2, len(coordinate_derivatives or ()))
        dt, information = np.diff(t, prepend=t[0]), np.zeros((len(t), n, n))
        information[:, 0, 0] = sigma_of_plots[:, c] ** -2.0
        pushed = np.pad(np.stack([dt**2 / 2, dt], axis=1) * walk[c], ((0, 0), (0, n - 2)))
        F, Q = np.stack([transition(step, n) for step in dt]), pushed[:, :, None] * pushed[:, None, :]
        bounds.append(moving.moving_bound(np.zeros((n, n)), information, F, Q, size))
    arrays = zip(*(bound[:3] for bound in bounds), strict=True)
    sigma, lagged, smoothed = (np.concatenate(columns, axis=-1) for columns in arrays)
    return Bound(sigma, lagged, smoothed, bounds[0].patterns)

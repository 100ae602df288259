"""Fit a radar's biases by robust least squares, with intervals by clusters.

If an aircraft has range R and bearing B by the positions, its plot of time t has:

    range = (1 + range_scale) R(t - time_s) + range_m,   bearing = B(t - time_s) + bearing_rad

with errors that are independent between aircraft: registration to a reference by least squares (Dana 1990,
Registration: a prerequisite for multiple sensor tracking, in Bar-Shalom, Multitarget-multisensor tracking: advanced
applications). The squares are Tukey's biweight after Huber's function, each in units of the median absolute residual
(Huber 1981, Robust statistics, ch. 7).

Intervals are by clusters, so that errors may be correlated within an aircraft: variance and degrees of freedom of Bell
and McCaffrey (2002, Survey Methodology 28, 169), for the linear model that has the pseudo-residuals of the robust
estimate as its errors (Huber, sec. 7.6). A bias that moves the plots as other biases do is taken as 0 and reported as
unknown."""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from radarsim.language.translate import tr
from radarsim.recordings.aircraft_match import range_bearing_offsets
from radarsim.recordings.formats.records import BIASES
from radarsim.recordings.grouping import rows_by_name
from radarsim.recordings.registration.result import Adjustment, Bias

OPTIONAL_BIASES = ("range_scale", "time_s")  # taken as 0 if they cannot be distinguished from the others
MAX_VARIANCE_INFLATION = 100.0  # of the variance of a bias by the others, from which they cannot be distinguished
MIN_MOVEMENT_SIGMAS = 10.0  # σ of a plot that an aircraft must move for its lag to show
MIN_AIRCRAFT, MIN_CLUSTERS = 4, 20  # fewer aircraft are cut into about so many pieces
HUBER_LIMIT, BIWEIGHT_LIMIT = 1.345, 4.685  # of 95 % efficiency for normal errors
MAD_TO_SIGMA = 1.4826  # σ of normal errors over their median absolute value
MIN_RELATIVE_SIGMA = 1e-13  # of a range, relative, and of a bearing
MAX_ROUNDS, CONVERGENCE_STEP = 60, 1e-6


class MatchedPlots(NamedTuple):
    """Plots (n,), the number of each one's aircraft, and position and speed (m, 6) of an aircraft at times (m,)."""

    t_s: np.ndarray
    range_m: np.ndarray
    bearing_rad: np.ndarray
    path_numbers: np.ndarray
    states: Callable[[int, np.ndarray], np.ndarray]


def fit_biases(pairs: MatchedPlots) -> Adjustment:
    """The biases of plots, by robust least squares."""
    reasons = _unobservable_biases(pairs)
    is_used = np.array([not reasons.get(key) for key in BIASES])
    values, sigma = _huber_fit(pairs, is_used)
    for _ in range(MAX_ROUNDS):
        errors, slopes = _linearise(pairs, values)
        step, length = _bias_step(errors, slopes, sigma, _biweight_weights(errors / sigma), is_used)
        values = values + step
        if length < CONVERGENCE_STEP:
            break
    errors, slopes = _linearise(pairs, values)
    # How far biases of 1 move a plot, in the last digits of its numbers: a bias that moves no plot by one is zero.
    movement_per_bias = np.abs(slopes / _smallest_sigmas(pairs)[:, None]).max(axis=(0, 1))
    u, slopes, clusters = errors / sigma, slopes / sigma[:, None], _cluster_numbers(pairs)
    weights = _biweight_weights(u)
    half_widths = _half_widths(u, slopes, clusters, is_used)
    values, half_widths = np.where((np.abs(values) + half_widths) * movement_per_bias > 1, [values, half_widths], 0.0)
    lags = {
        number: _aircraft_lag(u[rows], slopes[rows, :, 3])
        for number, rows in rows_by_name(pairs.path_numbers.tolist()).items()
    }
    biases = [
        Bias(key, math.nan, math.nan, math.nan, reasons[key]) if reasons.get(key) else Bias(key, v, v - h, v + h)
        for key, v, h in zip(BIASES, values.tolist(), half_widths.tolist(), strict=True)
    ]
    outliers = int(((weights == 0) & np.isfinite(u)).any(axis=1).sum())
    return Adjustment(
        tuple(biases), (float(sigma[0]), float(sigma[1])), errors, outliers, len(set(clusters.tolist())), lags
    )


def _linearise(pairs: MatchedPlots, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Residuals (n, 2) of range and bearing, NaN where there is none, and their derivatives (n, 2, biases)."""
    range_bias, range_scale, bearing_bias, time_bias = values.tolist()
    states = np.full((len(pairs.t_s), 6), np.nan)
    for number, rows in rows_by_name(pairs.path_numbers.tolist()).items():
        states[rows] = pairs.states(number, pairs.t_s[rows] - time_bias)
    position, velocity = states[:, :3], states[:, 3:]
    errors = range_bearing_offsets(states, pairs.range_m - range_bias, pairs.bearing_rad - bearing_bias)
    r = np.linalg.norm(position, axis=1)
    errors[:, 0] -= range_scale * r
    slopes = np.zeros((len(r), 2, len(BIASES)))
    slopes[:, 0, 0], slopes[:, 0, 1], slopes[:, 1, 2] = 1.0, r, 1.0
    slopes[:, 0, 3] = -(1 + range_scale) * np.einsum("ni,ni->n", position, velocity) / r
    slopes[:, 1, 3] = -(position[:, 0] * velocity[:, 2] - position[:, 2] * velocity[:, 0]) / (
        position[:, 0] ** 2 + position[:, 2] ** 2
    )
    return errors, np.where(np.isfinite(errors)[..., None], slopes, 0.0)


def _huber_fit(pairs: MatchedPlots, is_used: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Biases and σ (2,) of range and bearing by Huber's function, from biases of 0."""
    values = np.zeros(len(BIASES))
    smallest = _smallest_sigmas(pairs)
    for _ in range(MAX_ROUNDS):
        errors, slopes = _linearise(pairs, values)
        sigma = np.array([_robust_sigma(errors[:, k], smallest[k]) for k in range(2)])
        with np.errstate(divide="ignore"):
            weights = np.nan_to_num(np.minimum(1.0, HUBER_LIMIT / np.abs(errors / sigma)))
        step, length = _bias_step(errors, slopes, sigma, weights, is_used)
        values = values + step
        if length < CONVERGENCE_STEP:
            break
    errors, _ = _linearise(pairs, values)
    return values, np.maximum([_biweight_sigma(errors[:, k]) for k in range(2)], smallest)


def _robust_sigma(errors: np.ndarray, smallest: float) -> float:
    finite = errors[np.isfinite(errors)]
    return max(MAD_TO_SIGMA * float(np.median(np.abs(finite))), smallest) if len(finite) else math.inf


def _biweight_sigma(errors: np.ndarray) -> float:
    """σ of normal errors, of which some may be outliers, by the biweight midvariance (Lax 1985, JASA 80, 736)."""
    finite = errors[np.isfinite(errors)]
    limit = 9 * float(np.median(np.abs(finite))) if len(finite) else math.inf
    inner = finite[np.abs(finite) < limit]
    if not len(inner):
        return limit  # there are none, or most are zero
    v = (inner / limit) ** 2
    return math.sqrt(len(finite) * float((inner**2 * (1 - v) ** 4).sum())) / float(((1 - v) * (1 - 5 * v)).sum())


def _biweight_weights(u: np.ndarray) -> np.ndarray:
    return np.where(np.abs(u) < BIWEIGHT_LIMIT, (1 - (u / BIWEIGHT_LIMIT) ** 2) ** 2, 0.0)


def _bias_step(
    errors: np.ndarray, slopes: np.ndarray, sigma: np.ndarray, weights: np.ndarray, is_used: np.ndarray
) -> tuple[np.ndarray, float]:
    """Change of the biases (4,) by weighted least squares, and the largest in standard errors of it alone."""
    design = slopes[..., is_used] * (np.sqrt(weights) / sigma)[..., None]
    target = np.nan_to_num(errors) * np.sqrt(weights) / sigma
    size = np.sqrt((design**2).sum(axis=(0, 1)))
    size[size == 0] = 1.0
    step = np.zeros(len(is_used))
    step[is_used] = np.linalg.lstsq((design / size).reshape(-1, is_used.sum()), target.ravel(), rcond=1e-12)[0] / size
    return step, float(np.abs(step[is_used] * size).max())


def _unobservable_biases(pairs: MatchedPlots) -> dict[str, str]:
    """The biases that the plots cannot determine, and why: from where the targets are, not from what was measured."""
    errors, slopes = _linearise(pairs, np.zeros(len(BIASES)))
    sigma = _plot_sigmas(pairs, errors)
    reasons: dict[str, str] = {}
    if not math.isfinite(sigma[1]):
        reasons["bearing_rad"] = tr("there are no bearings")
    movement, farthest = _largest_movements(pairs, sigma)
    if movement < MIN_MOVEMENT_SIGMAS:
        reasons["time_s"] = tr("the targets hardly move ({distance:.3g} m at most)", distance=farthest)
    design = (slopes / sigma[:, None]).reshape(-1, len(BIASES))
    while True:
        used = [k for k, name in enumerate(BIASES) if name not in reasons]
        columns = design[:, used] / np.linalg.norm(design[:, used], axis=0)
        likeness = {}
        for column_index in (used.index(k) for k in used if BIASES[k] in OPTIONAL_BIASES):
            remaining_columns = np.delete(columns, column_index, axis=1)
            shares = np.linalg.lstsq(remaining_columns, columns[:, column_index], rcond=1e-12)[0]
            # 1 over the variance inflation
            unexplained = float(((columns[:, column_index] - remaining_columns @ shares) ** 2).sum())
            partner = int(np.delete(used, column_index)[np.abs(shares).argmax()])
            likeness[used[column_index]] = (unexplained, partner)
        k = min(likeness, key=likeness.__getitem__, default=-1)
        if k < 0 or likeness[k][0] * MAX_VARIANCE_INFLATION >= 1:
            return reasons
        reasons[BIASES[k]] = _likeness_message(BIASES[k], BIASES[likeness[k][1]], slopes)


def _plot_sigmas(pairs: MatchedPlots, errors: np.ndarray) -> np.ndarray:
    """σ of range and bearing (2,) from differences of successive plots of an aircraft, which biases hardly change.

    Infinite if there are no differences."""
    order = np.lexsort((pairs.t_s, pairs.path_numbers))
    steps = np.diff(errors[order], axis=0)[np.diff(pairs.path_numbers[order]) == 0]
    smallest = _smallest_sigmas(pairs)
    return np.array([_robust_sigma(steps[:, k] / math.sqrt(2), smallest[k]) for k in range(2)])


def _smallest_sigmas(pairs: MatchedPlots) -> np.ndarray:
    return MIN_RELATIVE_SIGMA * np.array([np.median(pairs.range_m), 1.0])


def _largest_movements(pairs: MatchedPlots, sigma: np.ndarray) -> tuple[float, float]:
    """The largest movement of an aircraft in range or bearing, in σ of a plot, and its largest distance moved, m."""
    largest, farthest = 0.0, 0.0
    for number, rows in rows_by_name(pairs.path_numbers.tolist()).items():
        position = pairs.states(number, pairs.t_s[rows])[:, :3]
        r = np.linalg.norm(position, axis=1)
        b = np.unwrap(np.arctan2(position[:, 2], position[:, 0]))
        largest = max(largest, float(np.ptp(r) / sigma[0]), float(np.ptp(b) / sigma[1]))
        farthest = max(farthest, float(np.linalg.norm(np.ptp(position, axis=0))))
    return largest, farthest


def _likeness_message(key: str, partner: str, slopes: np.ndarray) -> str:
    """Why a bias cannot be distinguished from another."""
    speed, r = -slopes[:, 0, 3], slopes[:, 0, 1]
    subject, values, unit = {
        "range_scale, range_m": (tr("ranges"), r / 1e3, "km"),
        "time_s, range_m": (tr("radial speeds"), speed, "m/s"),
        "time_s, bearing_rad": (tr("turns of bearing"), np.degrees(-slopes[:, 1, 3]), "°/s"),
    }.get(f"{key}, {partner}", (tr("ratios of radial speed and range"), speed / np.maximum(r, 1.0), "1/s"))
    lo, hi = np.quantile(values, (0.05, 0.95)).tolist()
    return tr(
        "the {what} are alike ({lo:.3g} to {hi:.3g} {unit}), so that it shows as {other} does, which holds if it is 0",
        **{"what": subject, "lo": lo, "hi": hi, "unit": tr(unit), "other": partner},
    )


def _aircraft_lag(u: np.ndarray, slope: np.ndarray) -> tuple[float, float]:
    """The lag of one aircraft and its σ by Huber's function, from residuals and slopes (n, 2) in σ; NaN where nothing
    moves."""
    is_informative = np.isfinite(u) & (slope != 0)
    u, slope, lag, error = u[is_informative], slope[is_informative], math.nan, math.inf
    for _ in range(MAX_ROUNDS if len(u) else 0):
        residuals = u - slope * np.nan_to_num(lag)
        scale = _robust_sigma(residuals, MIN_RELATIVE_SIGMA)
        weight = np.minimum(1.0, HUBER_LIMIT * scale / np.maximum(np.abs(residuals), MIN_RELATIVE_SIGMA))
        power = float((weight * slope**2).sum())
        lag, error = float((weight * slope * u).sum()) / power, scale / math.sqrt(power)
    return lag, error


def _cluster_numbers(pairs: MatchedPlots) -> np.ndarray:
    """The cluster number of each plot (n,): its aircraft, or a piece of its flight if there are few aircraft."""
    rows_by_aircraft = rows_by_name(pairs.path_numbers.tolist()).values()
    pieces = 1 if len(rows_by_aircraft) >= MIN_AIRCRAFT else math.ceil(MIN_CLUSTERS / len(rows_by_aircraft))
    clusters = np.zeros(len(pairs.t_s), dtype=int)
    parts = (part for rows in rows_by_aircraft for part in np.array_split(rows[np.argsort(pairs.t_s[rows])], pieces))
    for number, part in enumerate(parts):
        clusters[part] = number
    return clusters


def _half_widths(u: np.ndarray, slopes: np.ndarray, clusters: np.ndarray, is_used: np.ndarray) -> np.ndarray:
    """Half the width of each bias's 95 % interval (4,), from residuals (n, 2), NaN where there is none, and slopes
    (n, 2, 4), both in σ."""
    from scipy.stats import t as student

    v = np.where(np.isfinite(u), np.minimum((u / BIWEIGHT_LIMIT) ** 2, 1.0), 1.0)
    mean_slope = np.sqrt(((1 - v) * (1 - 5 * v)).sum(axis=0) / np.maximum(np.isfinite(u).sum(axis=0), 1))
    mean_slope = np.where(mean_slope > 0, mean_slope, 1.0)  # of bearings, where there are none
    design, errors = slopes[..., is_used] * mean_slope[:, None], np.nan_to_num(u) * (1 - v) ** 2 / mean_slope
    size = np.sqrt((design**2).sum(axis=(0, 1)))
    design = design / size
    inverse = np.linalg.inv(np.einsum("nki,nkj->ij", design, design))
    variance, lengths, projections = np.zeros_like(inverse), [], []
    for rows in rows_by_name(clusters.tolist()).values():
        q, basis = np.linalg.qr(design[rows].reshape(-1, len(size)))
        leverage, axes = np.linalg.eigh(np.eye(len(basis)) - basis @ inverse @ basis.T)
        spread = basis.T @ (axes * np.where(leverage > 1e-9, leverage, np.inf) ** -0.5) @ axes.T
        score = spread @ (q.T @ errors[rows].ravel())
        variance += np.outer(score, score)
        influence = spread.T @ inverse
        lengths.append((influence**2).sum(axis=0))
        projections.append(basis.T @ influence)
    length, projection = np.array(lengths), np.array(projections)  # (clusters, biases), (clusters, biases, biases)
    cross_terms = np.einsum("gij,ik,gkj->gj", projection, inverse, projection)
    products = np.einsum("gij,gkj->jik", projection, projection)
    trace = (length - cross_terms).sum(axis=0)
    square = (length**2 - 2 * length * cross_terms).sum(axis=0)
    square += np.einsum("ik,jkl,lm,jmi->j", inverse, products, inverse, products)
    half_widths = np.zeros(len(is_used))
    half_widths[is_used] = student.ppf(0.975, trace**2 / square) * np.sqrt(np.diag(inverse @ variance @ inverse)) / size
    return half_widths

"""Fit a radar's biases by robust least squares, with intervals by clusters.

`matched_plots` has the model: registration to a reference by least squares (Dana 1990, Registration: a prerequisite for
multiple sensor tracking, in Bar-Shalom, Multitarget-multisensor tracking: advanced applications). Errors that the four
biases do not hold are looked for in what these leave (`model_check`), and fitted with them.

A bias that moves the plots as other biases do is taken as 0 and reported as unknown."""

import math

import numpy as np

from radarsim.language.translate import tr
from radarsim.recordings.formats.records import BIASES
from radarsim.recordings.grouping import rows_by_name
from radarsim.recordings.registration.cluster_errors import half_widths
from radarsim.recordings.registration.matched_plots import (
    COEFFICIENTS,
    MIN_RELATIVE_SIGMA,
    TIME,
    MatchedPlots,
    fitted_indices,
    fixed_values,
    linearise,
    smallest_sigmas,
)
from radarsim.recordings.registration.model_check import MAX_VARIANCE_INFLATION, ModelCheck, ModelChecker
from radarsim.recordings.registration.result import Adjustment, Bias, Finding
from radarsim.recordings.registration.robust_fit import (
    CONVERGENCE_STEP,
    HUBER_LIMIT,
    MAX_ROUNDS,
    biweight_weights,
    robust_fit,
    robust_sigma,
)

OPTIONAL_BIASES = ("range_scale", "time_s")  # taken as 0 if they cannot be distinguished from the others
MIN_MOVEMENT_SIGMAS = 10.0  # σ of a plot that an aircraft must move for its lag to show
MIN_AIRCRAFT, MIN_CLUSTERS = 4, 20  # fewer aircraft are cut into about so many pieces


def fit_biases(pairs: MatchedPlots) -> Adjustment:
    """The biases of plots, and the further errors that they show, by robust least squares."""
    reasons, smallest = _unobservable_biases(pairs), smallest_sigmas(pairs)
    is_used = np.array([key in BIASES and key not in reasons for key in COEFFICIENTS])
    fit = robust_fit(lambda values: linearise(pairs, values), np.zeros(len(COEFFICIENTS)), is_used, smallest)
    sigma_of_biases_alone, clusters = fit.sigma, _cluster_numbers(pairs)
    check = ModelCheck((), {}, (), np.tile([np.inf, -np.inf], (len(COEFFICIENTS), 1)))
    if len(set(pairs.path_numbers.tolist())) >= MIN_AIRCRAFT:
        check = ModelChecker(fit, is_used, clusters, smallest).check()
    if check.causes:
        is_used[fitted_indices(check.causes)] = True
        start = np.where(is_used, fit.values, fixed_values(check.causes))
        fit = robust_fit(lambda values: linearise(pairs, values), start, is_used, smallest)
    # How far biases of 1 move a plot, in the last digits of its numbers: a bias that moves no plot by one is zero.
    movement_per_bias = np.abs(fit.slopes / smallest[:, None]).max(axis=(0, 1))
    width = half_widths(fit, clusters, is_used)
    values, width = np.where((np.abs(fit.values) + width) * movement_per_bias > 1, [fit.values, width], 0.0)
    allowance = np.where(is_used[:, None], check.allowance, [np.inf, -np.inf])
    lo, hi = np.minimum(values - width, allowance[:, 0]), np.maximum(values + width, allowance[:, 1])
    rows = zip(COEFFICIENTS, values.tolist(), lo.tolist(), hi.tolist(), strict=True)
    estimates = {key: Bias(key, value, low, high) for key, value, low, high in rows}
    unknown = {key: Bias(key, math.nan, math.nan, math.nan, why) for key, why in reasons.items()}
    u, slopes = fit.errors / fit.sigma, fit.slopes / fit.sigma[:, None]
    return Adjustment(
        biases=tuple({**estimates, **unknown}[key] for key in BIASES),
        sigma=_pair(fit.sigma),
        residuals=fit.errors,
        outliers=int(((biweight_weights(u) == 0) & np.isfinite(u)).any(axis=1).sum()),
        clusters=len(set(clusters.tolist())),
        lags={
            number: _aircraft_lag(u[rows], slopes[rows, :, TIME])
            for number, rows in rows_by_name(pairs.path_numbers.tolist()).items()
        },
        coefficients=tuple(estimates[COEFFICIENTS[k]] for k in fitted_indices(check.causes)),
        findings=_findings(check),
        sigma_of_biases_alone=_pair(sigma_of_biases_alone),
        sigma_of_steps=_pair(_plot_sigmas(pairs, fit.errors)),
    )


def _pair(values: np.ndarray) -> tuple[float, float]:
    return float(values[0]), float(values[1])


def _findings(check: ModelCheck) -> tuple[Finding, ...]:
    return tuple(
        Finding(
            error.coordinate,
            error.companion,
            error.name,
            error.coefficients if error.name and math.isnan(error.fixed) else (),
            tuple(rival.name for rival in check.rivals.get(error.name, ())),
        )
        for error in (*check.causes, *check.unexplained)
    )


def _unobservable_biases(pairs: MatchedPlots) -> dict[str, str]:
    """The biases that the plots cannot determine, and why: from where the targets are, not from what was measured."""
    errors, slopes = linearise(pairs, np.zeros(len(COEFFICIENTS)))
    slopes = slopes[..., : len(BIASES)]
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
    smallest = smallest_sigmas(pairs)
    return np.array([robust_sigma(steps[:, k] / math.sqrt(2), smallest[k]) for k in range(2)])


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
        scale = robust_sigma(residuals, MIN_RELATIVE_SIGMA)
        weight = np.minimum(1.0, HUBER_LIMIT * scale / np.maximum(np.abs(residuals), MIN_RELATIVE_SIGMA))
        power = float((weight * slope**2).sum())
        before, lag, error = lag, float((weight * slope * u).sum()) / power, scale / math.sqrt(power)
        if abs(lag - before) < CONVERGENCE_STEP * error:
            break
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

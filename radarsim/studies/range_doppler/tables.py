"""Tables of filters that measure range and radial velocity (P1).

With missed plots `n` of `curves.csv` is how many realisations have an estimate at that scan, and a gain counts
those in which both filters have one; `exact_sigma` is the mean over all patterns of plots, empty where these are too
many."""

from collections.abc import Sequence
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from radarsim.engine.results import CaseResult
from radarsim.report import case_selection, consistency_tables, interval_notes, key_labels, statistics
from radarsim.report import tables as common
from radarsim.studies.counted_scans import SETTLED, first_for_good
from radarsim.studies.range_doppler import package_filters, steady_state
from radarsim.studies.range_doppler.study import RangeDopplerAxes

if TYPE_CHECKING:
    import pandas as pd

PERIODS = 10  # the paper: a manoeuvre variance is good when the error settles in under ten scan periods

Result = CaseResult[RangeDopplerAxes]
table = common.TableMakers()


def follows_the_model(result: Result) -> bool:
    """Whether the target moves as the filters take it to, by no more than a square of the time."""
    target = result.spec.target
    return target.kind == "polynomial" and not any(target.coefficients[3:])


def has_individual_gains(result: Result) -> bool:
    """Whether each realisation had gains of its own, so that the sums count those with an estimate."""
    return "both" in result.sums


STEADY = (
    *(
        "case",
        "filter",
        "manoeuvre_variance",
        "component",
        "unit",
        "steady_sigma",
        "last_sigma",
        "last_sigma_lo",
        "last_sigma_hi",
    ),
    *("settling_periods", "settling_s", "under_10_periods", "best"),
)


@table.add_of_all_cases("steady")
def steady(results: Sequence[Result]) -> "pd.DataFrame":
    """Steady σ against settling, both exact, of every case, filter and component; and σ measured at the last scan.

    Cases whose target breaks the filters' model have no steady error and no rows; nor have those whose plots may be
    missed or are biased, nor a filter of a package whose gains still change at the end.

    manoeuvre_variance [(m/s³)²]: D_M of the filter's model
    steady_sigma [unit]: σ in steady state, exact
    last_sigma ± [unit]: σ measured at the last scan
    settling_periods, settling_s [scan periods, s]: time from which on the exact σ stays within 5 % of its steady value
        to the end of the run; `inf` if it does not
    under_10_periods: whether it settles in under ten scan periods
    best: whether its steady σ is the least of those that do, among the D_M tried for one radar
    """
    rows = [row for result in results if follows_the_model(result) and result.axes.plain for row in _steady(result)]
    if not rows:
        return common.frame({name: [] for name in STEADY})
    table = common.frame({name: [row[i] for row in rows] for i, name in enumerate(STEADY[:-1])})
    stem = table["case"].str.split(" ").str[0]
    family = table.groupby([stem, table["filter"], table["component"]], sort=False)
    has_choice = family["manoeuvre_variance"].transform("nunique") > 1
    qualified_sigma = table["steady_sigma"].where(table["under_10_periods"] & has_choice)
    lowest = qualified_sigma.groupby([stem, table["filter"], table["component"]], sort=False).transform("min")
    table["best"] = qualified_sigma.eq(lowest)
    return table


def steady_sigma(axes: RangeDopplerAxes, f: int) -> np.ndarray | None:
    """Exact σ (3,) of a filter in steady state, a plot at every scan; None for a package's filter without one."""
    period = axes.scan_period_s
    if noise := axes.process_noise[f]:
        return _settled(int(axes.observes[f]), float(axes.manoeuvre_variance[f]), tuple(axes.sigma), period, noise)
    true = package_filters.steady_state(axes.steady_gain[f], axes.sigma, period)
    return None if true is None else np.sqrt(np.diag(true))


@lru_cache(1024)  # three tables and the answer ask for it
def _settled(observes: int, variance: float, sigma: tuple[float, ...], period: float, noise: str) -> np.ndarray:
    return np.sqrt(np.diag(steady_state.steady_state(observes, variance, np.array(sigma), period, noise)[1]))


def _steady(result: Result) -> list[tuple]:
    axes = result.axes
    measured_sigma = statistics.errors(result.sums["error"], common.realisation_counts(result)).sigma
    t, period, rows = np.asarray(axes.t_s, dtype=float), axes.scan_period_s, []
    for f, name in enumerate(axes.filters):
        variance, steady_values = float(axes.manoeuvre_variance[f]), steady_sigma(axes, f)
        if steady_values is None:
            continue
        for c, (component, unit) in enumerate(axes.components):
            scan_indices = np.flatnonzero(axes.available[f, :, c])
            if not scan_indices.size:
                continue
            steady_value, exact_sigma = float(steady_values[c]), axes.exact_sigma[f, scan_indices, c]
            exact_estimate = statistics.Estimate(exact_sigma, exact_sigma, exact_sigma)
            settling_s = settling(exact_estimate, t[scan_indices], steady_value).value
            last_sigma = (end[f, scan_indices[-1], c] for end in measured_sigma)
            rows.append(
                (
                    *(result.name, name, variance, component, unit, steady_value, *last_sigma),
                    *(settling_s / period, settling_s, bool(settling_s < PERIODS * period * (1 - 1e-9))),
                )
            )
    return rows


def settling(sigma: statistics.Estimate, t: np.ndarray, steady_value: float) -> statistics.Estimate:
    """Time from which σ over t (K,) stays within 5 % of steady_value; infinite where it does not."""
    low, high = steady_value * (1 - SETTLED), steady_value * (1 + SETTLED)
    touches = (sigma.hi >= low) & (sigma.lo <= high)
    inside = (sigma.lo >= low) & (sigma.hi <= high)
    middle = (sigma.value >= low) & (sigma.value <= high)
    return statistics.Estimate(*(_for_good(settled, t) for settled in (middle, touches, inside)))


def _for_good(settled: np.ndarray, t: np.ndarray) -> float:
    first = first_for_good(settled)
    return float(t[first]) if first < len(t) else np.inf


def _case_curves(result: Result) -> common.Columns:
    variance = np.diagonal(result.axes.believed, axis1=2, axis2=3)
    if has_individual_gains(result):
        with np.errstate(invalid="ignore"):
            variance = np.asarray(result.sums["believed"]) / np.asarray(result.sums["estimates"])
    return common.curve_columns(result, np.sqrt(variance))


@table.add_of_all_cases("curves")
def curves(results: Sequence[Result]) -> "pd.DataFrame":
    """As everywhere; where plots may be missed, rows that few realisations decide are marked though σ is exact."""
    table = common.join_columns(map(_case_curves, results))
    return _with_notes(table, table, results)


def _with_notes(table: "pd.DataFrame", curves: "pd.DataFrame", results: Sequence[Result]) -> "pd.DataFrame":
    """Curves or gains with notes on heavy tails in the cases whose plots may be missed."""
    missing = table["case"].isin([result.name for result in results if has_individual_gains(result)]).to_numpy()
    if not missing.any():
        return table
    notes = interval_notes.heavy_tail_notes(*interval_notes.estimate_counts(table, {"curves": curves}, results))
    notes = np.where(missing, notes, "")
    return table.assign(note=notes) if (notes != "").any() else table


@table("consistency")
def _normalised_errors(result: Result) -> common.Columns:
    """NEES of all components that a filter estimates at a scan; the bounds are shared among all scans of a filter.

    Where plots may be missed, of the realisations in which the filter has started, `n`.
    """
    axes = result.axes
    is_available: np.ndarray
    if has_individual_gains(result):
        nees_sums = np.asarray(result.sums["nees"])
        is_available, size = nees_sums[..., 0] > 0, np.full(nees_sums.shape[:2], 3)
        n = nees_sums[..., 0].astype(np.int64)
        mean = statistics.mean_square(nees_sums[..., 1], nees_sums[..., 2], nees_sums[..., 0])
    else:
        is_available, size = np.asarray(axes.available.any(axis=2)), axes.available.sum(axis=2)
        n, mean = np.full(is_available.shape, result.count), nees(result)
    f, k = indices = np.nonzero(is_available)
    scan_counts = is_available.sum(axis=1)[f]
    bounds = statistics.normalised_bounds(size[indices] * n[indices], scan_counts)
    mean = statistics.Estimate(*(part[indices] for part in mean))
    return {
        **common.label_columns(result, f, k),
        "n": n[indices],
        **consistency_tables.normalised_square_columns("nees", mean, bounds, axes.exact_nees[indices]),
    }


def nees(result: Result) -> statistics.Estimate:
    """Mean of eᵀP⁻¹e per estimated component (F, K), P the believed covariance, with its interval.

    From Σe and the Σ of products of two components. The errors of this study are Gaussian, so that these give the
    spread too: of mean m and second moment M = E eeᵀ, var eᵀP⁻¹e = 2 tr (P⁻¹M)² - 2 (mᵀP⁻¹m)²."""
    from radarsim.kernels.second_order import COMPONENT_PAIRS  # loads the compiler

    axes, P, n = result.axes, result.axes.believed, result.count
    error, first = np.asarray(result.sums["error"]), np.asarray(result.sums["error"])[..., 0] / n
    second = np.zeros(P.shape)
    for (i, j), crossed in zip(COMPONENT_PAIRS, np.moveaxis(result.sums["cross"], -1, 0), strict=True):
        second[..., i, j] = second[..., j, i] = crossed / n
    for i in range(3):
        second[..., i, i] = error[..., i, 1] / n
    mean, variance = steady_state.normalised_error(P, first, second, axes.available)
    interval = statistics.mean_square(n * mean, n * (variance + mean**2), n)
    return statistics.Estimate(mean, interval.lo, interval.hi)


@table("radar")
def _radar(result: Result) -> common.Columns:
    """What a radar makes of its target.

    C_theta: σ_r²/(Δt²σ_V²) (eq. 11)
    speed_mps: the target's greatest radial speed at a scan
    doppler_hz, doppler_per_repetition_rate: its Doppler frequency 2V/λ, also over the repetition rate
    unambiguous_velocity_mps: unambiguous velocity interval λF/2
    """
    axes = result.axes
    doppler = 2 * axes.speed_mps / axes.wavelength_m
    row = {
        **{"case": result.name, "C_theta": axes.C_theta, "speed_mps": axes.speed_mps, "doppler_hz": doppler},
        "doppler_per_repetition_rate": doppler / axes.repetition_rate_hz,
        "unambiguous_velocity_mps": span_mps(result),
    }
    return common.columns_from_rows([row])


@table.add_of_all_cases("gains")
def _gains_where_missed(results: Sequence[Result]) -> "pd.DataFrame | None":
    """As everywhere; where plots may be missed, of realisations in which both filters have an estimate."""
    if not any(has_individual_gains(result) for result in results):
        return None
    return _with_notes(common.gains(results), common.join_columns(map(_case_curves, results)), results)


tables = table.make


def span_mps(result: Result) -> float:
    """The span λF/2 of velocities that a radar tells apart, m/s."""
    return result.axes.wavelength_m * result.axes.repetition_rate_hz / 2


def inputs(results: Sequence[Result]) -> "pd.DataFrame":
    """The inputs, for the page: a row for each distinct radar, with the D_M of its filters."""
    radars: dict[tuple, list[Result]] = {}
    for members in case_selection.group_by_config(results).values():
        for result in members:
            radar_keys, theta = result.spec.radar, result.axes.C_theta
            numbers = (
                radar_keys.sigma_range_m,
                radar_keys.sigma_velocity_mps,
                radar_keys.scan_period_s,
                radar_keys.wavelength_m,
                theta,
            )
            radars.setdefault(
                (key_labels.config_stem(result), key_labels.without_markup(key_labels.config_device(result)), *numbers),
                [],
            ).append(result)
    rows = []
    for (_, *radar), members in radars.items():
        variances = sorted({float(v) for result in members for v in result.axes.manoeuvre_variance if not np.isnan(v)})
        scans = sorted({result.spec.scans for result in members})
        detection = ", ".join(
            map(key_labels.format_value, sorted({result.spec.radar.detection_probability for result in members}))
        )
        other_values = (
            ", ".join(key_labels.format_value(v, powers=True) for v in variances),
            ", ".join(map(str, scans)),
            detection,
        )
        rows.append((*radar, *other_values))
    has_missed_plots = any(row[-1] != "1" for row in rows)
    names = INPUTS if has_missed_plots else INPUTS[:-1]
    return common.frame({name: [row[i] for row in rows] for i, name in enumerate(names)})


INPUTS = ("radar", "σ_r, m", "σ_V, m/s", "Δt, s", "λ, m", "C_θ", "D_M, (m/s³)²", "scans", "P_D")

"""Tables of filters that measure range and radial velocity (P1).

With missed plots `n` of `curves.csv` is how many realisations have an estimate at that scan, and a gain counts
those in which both filters have one; `exact_sigma` is the mean over all patterns of plots, empty where these are too
many."""

from collections.abc import Sequence
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from radarsim.engine.results import CaseResult
from radarsim.report import notes, panels, statistics
from radarsim.report import tables as common
from radarsim.studies.range_doppler import filters, given
from radarsim.studies.range_doppler.study import RangeDopplerAxes

if TYPE_CHECKING:
    import pandas as pd

PERIODS = 10  # the paper: a manoeuvre variance is good when the error settles in under ten scan periods
SETTLED = 0.05  # within this share of the steady value, for good; the paper gives no tolerance

Result = CaseResult[RangeDopplerAxes]
table = common.Tables()


def follows_the_model(result: Result) -> bool:
    """Whether the target moves as the filters take it to, by no more than a square of the time."""
    target = result.spec.target
    return target.kind == "polynomial" and not any(target.coefficients[3:])


def own_gains(result: Result) -> bool:
    """Whether each realisation had gains of its own, so that the sums tell who had an estimate; see kernels.missed."""
    return "both" in result.sums


def gains(results: Sequence[Result]) -> "pd.DataFrame":
    """Paired gains over the realisations in which both the filter and the baseline have an estimate."""
    parts = (_own_gains(one) if own_gains(one) else {**common.gains([one])} for one in results)
    return common.joined(parts, common.GAINS)


def _own_gains(result: Result) -> common.Columns:
    axes, b = result.axes, result.axes.baseline
    both = np.asarray(result.sums["both"])
    mask = axes.available[b] & (both[..., 0] > 0)
    mask[b] = False
    at = f, k, c = common.shown(result, mask)
    n, own, own_4, base, base_4 = (both[at][:, j] for j in range(5))
    of = statistics.gain(own, own_4, base, base_4, np.asarray(result.sums["paired"])[at], n)
    return {
        **common.leading(
            result, f, k, baseline=np.full(f.size, axes.filters[b], dtype=object), **common.components(result, c)
        ),
        "gain_percent|gain": of,
        "exact_percent": axes.exact_gains[at],
    }


STEADY = (
    *("case", "filter", "manoeuvre_variance", "component", "unit", "steady_sigma", "last_sigma", "last_lo", "last_hi"),
    *("settling_periods", "settling_s", "under_10_periods", "best"),
)


@table.whole("steady")
def steady(results: Sequence[Result]) -> "pd.DataFrame":
    """Steady σ against settling, both exact, of every case, filter and component; and σ measured at the last scan.

    Cases whose target breaks the filters' model have no steady error and no rows; nor have those whose plots may be
    missed or are biased, nor a filter of a package whose gains still change at the end.

    manoeuvre_variance [(m/s³)²]: D_M of the filter's model
    steady_sigma [unit]: σ in steady state, exact
    last_sigma ± last [unit]: σ measured at the last scan
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
    several = family["manoeuvre_variance"].transform("nunique") > 1
    good = table["steady_sigma"].where(table["under_10_periods"] & several)
    least = good.groupby([stem, table["filter"], table["component"]], sort=False).transform("min")
    table["best"] = good.eq(least)
    return table


def steady_sigma(axes: RangeDopplerAxes, f: int) -> np.ndarray | None:
    """Exact σ (3,) that a filter comes to where every scan has its plot; None of a package's that comes to none."""
    period = axes.scan_period_s
    if noise := axes.process_noise[f]:
        return _settled(int(axes.observes[f]), float(axes.manoeuvre_variance[f]), tuple(axes.sigma), period, noise)
    true = given.steady_state(axes.settled_gain[f], axes.sigma, period)
    return None if true is None else np.sqrt(np.diag(true))


@lru_cache(1024)  # three tables and the answer ask for it
def _settled(observes: int, variance: float, sigma: tuple[float, ...], period: float, noise: str) -> np.ndarray:
    return np.sqrt(np.diag(filters.steady_state(observes, variance, np.array(sigma), period, noise)[1]))


def _steady(result: Result) -> list[tuple]:
    axes = result.axes
    of = statistics.errors(result.sums["error"], common.realisations(result)).sigma
    t, period, rows = np.asarray(axes.t_s, dtype=float), axes.scan_period_s, []
    for f, name in enumerate(axes.filters):
        variance, in_the_long_run = float(axes.manoeuvre_variance[f]), steady_sigma(axes, f)
        if in_the_long_run is None:
            continue
        for c, (component, unit) in enumerate(axes.components):
            at = np.flatnonzero(axes.available[f, :, c])
            if not at.size:
                continue
            last, known = float(in_the_long_run[c]), axes.exact_sigma[f, at, c]
            when = settling(statistics.Estimate(known, known, known), t[at], last).value
            rows.append(
                (
                    *(result.name, name, variance, component, unit, last, *(end[f, at[-1], c] for end in of)),
                    *(when / period, when, bool(when < PERIODS * period * (1 - 1e-9))),
                )
            )
    return rows


def settling(sigma: statistics.Estimate, t: np.ndarray, last: float) -> statistics.Estimate:
    """Time from which σ over t (K,) stays within 5 % of the steady value `last`; infinite where it does not."""
    low, high = last * (1 - SETTLED), last * (1 + SETTLED)
    touches = (sigma.hi >= low) & (sigma.lo <= high)
    inside = (sigma.lo >= low) & (sigma.hi <= high)
    middle = (sigma.value >= low) & (sigma.value <= high)
    return statistics.Estimate(*(_for_good(settled, t) for settled in (middle, touches, inside)))


def _for_good(settled: np.ndarray, t: np.ndarray) -> float:
    wrong = np.flatnonzero(~settled)
    first = wrong[-1] + 1 if wrong.size else 0
    return float(t[first]) if first < len(t) else np.inf


@table("curves")
def _curves(result: Result) -> common.Columns:
    """As everywhere."""
    variance = np.diagonal(result.axes.believed, axis1=2, axis2=3)
    if own_gains(result):
        with np.errstate(invalid="ignore"):
            variance = np.asarray(result.sums["believed"]) / np.asarray(result.sums["estimates"])
    return common.curve_columns(result, np.sqrt(variance))


def curves(results: Sequence[Result]) -> "pd.DataFrame":
    """The table `curves` alone."""
    return common.joined(map(_curves, results))


@table("consistency")
def _normalised_errors(result: Result) -> common.Columns:
    """NEES of all components that a filter estimates at a scan; the bounds are shared among all scans of a filter.

    Where plots may be missed, of the realisations in which the filter has started, `n`.
    """
    axes = result.axes
    there: np.ndarray
    if own_gains(result):
        counted = np.asarray(result.sums["nees"])
        there, size, n = counted[..., 0] > 0, np.full(counted.shape[:2], 3), counted[..., 0].astype(np.int64)
        mean = statistics.mean_square(counted[..., 1], counted[..., 2], counted[..., 0])
    else:
        there, size = np.asarray(axes.available.any(axis=2)), axes.available.sum(axis=2)
        n, mean = np.full(there.shape, result.count), nees(result)
    f, k = at = np.nonzero(there)
    looks = there.sum(axis=1)[f]
    bounds = statistics.normalised_bounds(size[at] * n[at], looks)
    mean = statistics.Estimate(*(part[at] for part in mean))
    return {**common.leading(result, f, k), "n": n[at], **notes.normalised("nees", mean, bounds, axes.exact_nees[at])}


def nees(result: Result) -> statistics.Estimate:
    """Mean of eᵀP⁻¹e per estimated component (F, K), P the believed covariance, with its interval.

    From Σe and the Σ of products of two components. The errors of this study are Gaussian, so that these give the
    spread too: of mean m and second moment M = E eeᵀ, var eᵀP⁻¹e = 2 tr (P⁻¹M)² - 2 (mᵀP⁻¹m)²."""
    from radarsim.kernels.linear import CROSSED  # loads the compiler

    axes, P, n = result.axes, result.axes.believed, result.count
    error, first = np.asarray(result.sums["error"]), np.asarray(result.sums["error"])[..., 0] / n
    second = np.zeros(P.shape)
    for (i, j), crossed in zip(CROSSED, np.moveaxis(result.sums["cross"], -1, 0), strict=True):
        second[..., i, j] = second[..., j, i] = crossed / n
    for i in range(3):
        second[..., i, i] = error[..., i, 1] / n
    mean, variance = filters.normalised_error(P, first, second, axes.available)
    interval = statistics.mean_square(n * mean, n * (variance + mean**2), n)
    return statistics.Estimate(mean, interval.lo, interval.hi)


@table("radar")
def _radar(result: Result) -> common.Columns:
    """What a radar makes of its target.

    C_theta: σ_r²/(Δt²σ_V²) (eq. 11)
    speed_mps: the target's greatest radial speed at a scan
    doppler_hz, doppler_per_repetition_rate: its Doppler frequency 2V/λ, also over the repetition rate
    unambiguous_velocity_mps: unambiguous span of velocity λF/2
    """
    axes = result.axes
    doppler = 2 * axes.speed_mps / axes.wavelength_m
    row = {
        **{"case": result.name, "C_theta": axes.C_theta, "speed_mps": axes.speed_mps, "doppler_hz": doppler},
        "doppler_per_repetition_rate": doppler / axes.repetition_rate_hz,
        "unambiguous_velocity_mps": span_mps(result),
    }
    return common.of_rows([row])


@table.whole("gains")
def _gains_where_missed(results: Sequence[Result]) -> "pd.DataFrame | None":
    """As everywhere; where plots may be missed, of realisations in which both filters have an estimate."""
    return gains(results) if any(own_gains(result) for result in results) else None


tables = table.made


def span_mps(result: Result) -> float:
    """The span λF/2 of velocities that a radar tells apart, m/s."""
    return result.axes.wavelength_m * result.axes.repetition_rate_hz / 2


def inputs(results: Sequence[Result]) -> "pd.DataFrame":
    """What was put in, for the page: a row for each radar that differs from the others, with the D_M tried on it."""
    radars: dict[tuple, list[Result]] = {}
    for members in panels.families(results).values():
        for result in members:
            of, theta = result.spec.radar, result.axes.C_theta
            given = (of.sigma_range_m, of.sigma_velocity_mps, of.scan_period_s, of.wavelength_m, theta)
            radars.setdefault((panels.stem(result), panels.plain(panels.device(result)), *given), []).append(result)
    rows = []
    for (_, *radar), members in radars.items():
        tried = sorted({float(v) for result in members for v in result.axes.manoeuvre_variance if not np.isnan(v)})
        scans = sorted({result.spec.scans for result in members})
        seen = ", ".join(map(panels.number, sorted({result.spec.radar.detection_probability for result in members})))
        last = (", ".join(panels.number(v, powers=True) for v in tried), ", ".join(map(str, scans)), seen)
        rows.append((*radar, *last))
    missed = any(row[-1] != "1" for row in rows)
    names = INPUTS if missed else INPUTS[:-1]
    return common.frame({name: [row[i] for row in rows] for i, name in enumerate(names)})


INPUTS = ("radar", "σ_r, m", "σ_V, m/s", "Δt, s", "λ, m", "C_θ", "D_M, (m/s³)²", "scans", "P_D")

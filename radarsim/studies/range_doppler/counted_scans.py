"""From which scan on errors are compared: from the target's manoeuvre on, else once the filters have settled.

The error of a young track is large whatever the filter, the more so where plots may be missed: a worst error that
includes it says how the filter was started."""

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import Literal, NamedTuple, cast

import numpy as np

from radarsim.config.radial_keys import ManoeuvreStart
from radarsim.studies.range_doppler import error_recursion, filter_design, package_filters, steady_state
from radarsim.studies.range_doppler.config import Filter, FilterKeys, Keys, Target

SETTLED = 0.05  # within this share of the steady value, for good; the paper gives no tolerance
PLOTS_SHARE = 0.99  # of the realisations, which have the plots to settle


class CountedScans(NamedTuple):
    """The first scan that counts, from 1, its time, s, and why it is the first."""

    k: int
    t_s: float
    reason: Literal["manoeuvre", "settled", "last"]


def counted_scans(
    target: Target, t: np.ndarray, started: int, settled: Sequence[int], every: bool = True
) -> CountedScans:
    """The scans that count, of those at times t (K,): from the manoeuvre on, but not before the scan at which filters
    have started; else from the last of the scans at which they settle, which may lie beyond the run. Of a run in which
    they do not settle, the last scan.

    every: count only scans at which every filter has settled, not those at which all have that settle in the run."""
    reason: Literal["manoeuvre", "settled", "last"] = "manoeuvre"
    if (k := manoeuvre_scan(target, t)) is None:
        k, reason = max((scan for scan in settled if every or scan <= len(t)), default=len(t) + 1), "settled"
    k = max(k, started)
    if k > len(t):
        k, reason = len(t), "last"
    return CountedScans(k, float(t[k - 1]), reason)


def case_scans(spec: Keys, variances: np.ndarray, component: int) -> CountedScans:
    """The scans that count for the errors of a case's filters, with D_M (F,), in a component."""
    radar, scans = spec.radar, spec.plots
    t = radar.scan_period_s * np.arange(scans)
    sigma, detection = (radar.sigma_range_m, radar.sigma_velocity_mps), radar.detection_probability
    settled = [
        settled_scans(filter_, float(variance), sigma, radar.scan_period_s, detection, scans)[component]
        for filter_, variance in zip(spec.filters, variances, strict=True)
    ]
    return counted_scans(spec.target, t, started_scan(spec.filters, detection, scans), settled)


def manoeuvre_scan(target: Target, t: np.ndarray) -> int | None:
    """The scan, from 1, at which a target begins to manoeuvre; None where it does not within times t (K,)."""
    if not isinstance(target, ManoeuvreStart) or target.start_s > t[-1]:
        return None
    return int(np.searchsorted(t, target.start_s)) + 1


def started_scan(filters: Sequence[FilterKeys], detection: float, scans: int) -> int:
    """The scan, from 1, at which all filters have started; scans + 1 where they do not."""
    return max(scan_with_plots(f.plots_to_start, detection, scans) for f in filters)


def scan_with_plots(plots: int, detection: float, scans: int) -> int:
    """The scan, from 1, at which nearly all realisations have so many plots; scans + 1 where that is later."""
    if detection == 1:
        return min(plots, scans + 1)
    share = 0.0
    for k in range(plots, scans + 1):  # the plot that completes them is that of scan k
        ways = math.lgamma(k) - math.lgamma(plots) - math.lgamma(k - plots + 1)
        share += math.exp(ways + plots * math.log(detection) + (k - plots) * math.log1p(-detection))
        if share >= PLOTS_SHARE:
            return k
    return scans + 1


@lru_cache(1024)
def settled_scans(
    filter_: FilterKeys, variance: float, sigma: tuple[float, ...], dt: float, detection: float, scans: int
) -> tuple[int, ...]:
    """The scan, from 1, from which on σ of each component is within 5 % of its steady value, on a target as the filter
    takes it to be; scans + 1 where that is later. With missed plots: the scan by which nearly all realisations have as
    many plots. sigma: of range and velocity."""
    plot_sigma, t = np.array(sigma), dt * np.arange(scans)
    if isinstance(filter_, Filter):
        options = len(filter_.observes), filter_.plots_to_start, variance, plot_sigma, dt, scans
        designed = filter_design.design(*options, filter_.process_noise)
        steady = steady_state.steady_state(len(filter_.observes), variance, plot_sigma, dt, filter_.process_noise)[1]
        recursion = error_recursion.error_recursion
    else:
        designed = package_filters.design_filter(cast(package_filters.GivenGains, filter_), plot_sigma, t)
        of_package = package_filters.steady_state(package_filters.steady_gain(designed), plot_sigma, dt)
        if of_package is None:
            return (scans + 1,) * 3
        steady, recursion = of_package, package_filters.error_recursion
    covariance = recursion(designed, error_recursion.Plots(plot_sigma), np.zeros((scans, 3)), dt)[1]
    ratio = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2) / np.diagonal(steady))
    is_settled = designed.available & (np.abs(ratio - 1) <= SETTLED)
    return tuple(
        scan_with_plots(first_for_good(is_settled[:, c]) + 1, detection, scans) for c in range(is_settled.shape[1])
    )


def first_for_good(is_settled: np.ndarray) -> int:
    """The index from which on all of (K,) are true; K where the last is not."""
    wrong = np.flatnonzero(~is_settled)
    return int(wrong[-1]) + 1 if wrong.size else 0

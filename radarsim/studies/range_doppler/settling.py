"""From which scan on errors of a radar's filters count: the exact rule of when they have settled."""

from collections.abc import Sequence
from functools import lru_cache
from typing import cast

import numpy as np

from radarsim.studies.counted_scans import (
    SETTLED,
    CountedScans,
    counted_scans,
    first_for_good,
    scan_with_plots,
    target_start_s,
)
from radarsim.studies.range_doppler import error_recursion, filter_design, package_filters, steady_state
from radarsim.studies.range_doppler.config import Filter, FilterKeys, Keys


def case_scans(spec: Keys, variances: np.ndarray, component: int) -> CountedScans:
    """The scans that count for the errors of a case's filters, with D_M (F,), in a component."""
    radar, scans = spec.radar, spec.plots
    t = radar.scan_period_s * np.arange(scans)
    sigma, detection = (radar.sigma_range_m, radar.sigma_velocity_mps), radar.detection_probability
    settled = [
        settled_scans(filter_, float(variance), sigma, radar.scan_period_s, detection, scans)[component]
        for filter_, variance in zip(spec.filters, variances, strict=True)
    ]
    return counted_scans(target_start_s(spec.target), t, started_scan(spec.filters, detection, scans), settled)


def started_scan(filters: Sequence[FilterKeys], detection: float, scans: int) -> int:
    """The scan, from 1, at which all filters have started; scans + 1 where they do not."""
    return max(scan_with_plots(f.plots_to_start, detection, scans) for f in filters)


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

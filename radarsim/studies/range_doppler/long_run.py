"""The long run of a case, and the time from which its errors count."""

from dataclasses import replace

import numpy as np

from radarsim.config import radial_keys
from radarsim.config.experiment import Case
from radarsim.studies.counted_scans import CountedScans, scan_with_plots
from radarsim.studies.long_run import no_long_run
from radarsim.studies.range_doppler import scenario, settling, steady_state
from radarsim.studies.range_doppler.config import MAX_SCANS, Best, Filter, Keys, configured_variance
from radarsim.studies.range_doppler.designed_case import design_case

SETTLING_TIMES = 8  # to a fraction of 0.05⁸ of the first error, by the time in which it falls to a twentieth
SETTLING_TIMES_MISSED = 3  # where plots may be missed: to 10⁻⁴, as the means over patterns, which are rough beyond
MAX_EXACT_SCANS = 60  # so many scans
MAX_ROUGH_SCANS = 2000
MIN_SCANS = 32
COMPONENTS = ("r", "Vr", "ar")


def counted_scans(case: Case, component: str | None) -> CountedScans:
    """The scans that count for the errors of a case's filters in a component, by default the range."""
    variances = np.array(_variances(case))
    index = COMPONENTS.index(component) if component in COMPONENTS else 0
    return settling.case_scans(case.spec, variances, index)


def steady_sigma(case: Case) -> np.ndarray | None:
    """The exact σ (F, 3) of filters in steady state; None with missed or biased plots, or a filter of a package."""
    spec: Keys = case.spec
    if not spec.radar.as_the_papers or not all(isinstance(filter_, Filter) for filter_ in spec.filters):
        return None
    sigma, dt = np.array([spec.radar.sigma_range_m, spec.radar.sigma_velocity_mps]), spec.radar.scan_period_s
    covariances = [
        steady_state.steady_state(len(filter_.observes), variance, sigma, dt, filter_.process_noise)[1]
        for filter_, variance in zip(spec.filters, _variances(case), strict=True)
    ]
    return np.sqrt(np.stack([np.diag(covariance) for covariance in covariances]))


def in_the_long_run(case: Case) -> Case:
    """The case on a target that keeps its range, with so many scans that its filters have settled at the last. Raises
    ConfigError where that takes too many."""
    spec: Keys = case.spec
    variances = _variances(case)
    scans = _scans_to_settle(spec, variances)
    if scans is None:
        raise no_long_run(case, "the filters settle too late to be computed")
    first_range_m = float(scenario.true_motion(case)[1][0, 0])
    target = radial_keys.Polynomial(kind="polynomial", coefficients=(first_range_m,))
    filters = tuple(
        filter_.model_copy(update={"manoeuvre_variance": variance}) if isinstance(filter_, Filter) else filter_
        for filter_, variance in zip(spec.filters, variances, strict=True)
    )
    changes = {"scans": scans, "target": target, "filters": filters}
    roughly = case.roughly or (spec.radar.detection_probability < 1 and scans > MAX_EXACT_SCANS)
    return replace(case, spec=spec.model_copy(update=changes), asked_from_k=max(1, scans - 1), roughly=roughly)


def _variances(case: Case) -> tuple[float, ...]:
    """D_M of each filter, those that are looked for as found on the case's own target."""
    variances = [configured_variance(filter_) for filter_ in case.spec.filters]
    if any(isinstance(variance, Best) for variance in variances):
        return design_case(case).variances
    return tuple(variance for variance in variances if not isinstance(variance, Best))


def _scans_to_settle(spec: Keys, variances: tuple[float, ...]) -> int | None:
    """The scans after which all filters are steady; None where that takes too many."""
    radar, scans = spec.radar, MIN_SCANS
    sigma, dt = (radar.sigma_range_m, radar.sigma_velocity_mps), radar.scan_period_s
    while scans < MAX_SCANS:
        plots = max(
            max(settling.settled_scans(filter_, variance, sigma, dt, 1.0, scans))
            for filter_, variance in zip(spec.filters, variances, strict=True)
        )
        if plots <= scans:
            break
        scans *= 2
    else:
        return None
    if radar.detection_probability == 1:
        return min(max(SETTLING_TIMES * plots, MIN_SCANS), MAX_SCANS)
    enough = scan_with_plots(SETTLING_TIMES_MISSED * plots, radar.detection_probability, MAX_SCANS)
    settled = scan_with_plots(plots, radar.detection_probability, MAX_SCANS)
    if enough <= MAX_EXACT_SCANS or settled > MAX_EXACT_SCANS:
        return max(enough, MIN_SCANS) if enough <= MAX_ROUGH_SCANS else None
    return MAX_EXACT_SCANS

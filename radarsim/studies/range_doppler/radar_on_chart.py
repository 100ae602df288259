"""Where a radar stands among the cases of any radar: its Λ and c, and its gains over time."""

from dataclasses import dataclass

import numpy as np

from radarsim.config.experiment import Case
from radarsim.studies.range_doppler import closed_form, steady_state
from radarsim.studies.range_doppler.study import RangeDopplerAxes, prepare


@dataclass(frozen=True)
class RadarOnChart:
    """A radar on the chart: its inputs and dimensionless groups, its steady gains (3,), exact and for short periods.

    inputs are σ_r (m), σ_V (m/s), Δt (s), D_M ((m/s³)²). t_s (n,) and gain (n, 3), per cent, belong to the scans at
    which both filters have all estimates."""

    name: str
    inputs: tuple[float, float, float, float]
    tau_1_s: float
    tau_2_s: float
    groups: closed_form.Groups
    exact_gain: np.ndarray
    limit_gain: np.ndarray
    t_s: np.ndarray
    gain: np.ndarray


def place_case(case: Case) -> RadarOnChart | None:
    """Place a case by its first filter of the range and its first of range and velocity; None without both."""
    axes: RangeDopplerAxes = prepare(case).axes
    shipped = np.array([form != "" for form in axes.process_noise])  # not of a package
    kinds = [np.flatnonzero(shipped & (axes.observes == observes)) for observes in (1, 2)]
    if not all(len(kind) for kind in kinds):
        return None
    range_filter, velocity_filter = (int(kind[0]) for kind in kinds)
    variance = float(axes.manoeuvre_variance[velocity_filter])
    sigma_r, sigma_V = map(float, axes.sigma)
    inputs = (sigma_r, sigma_V, axes.scan_period_s, variance)
    tau_1, tau_2 = sigma_r / sigma_V, closed_form.filter_memory(sigma_r, variance)
    groups = closed_form.dimensionless_groups(*inputs)
    common_scans = np.flatnonzero((axes.available[range_filter] & axes.available[velocity_filter]).all(axis=1))
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = axes.exact_sigma[velocity_filter, common_scans] / axes.exact_sigma[range_filter, common_scans]
    gain = axes.exact_gains[velocity_filter, common_scans] if range_filter == axes.baseline else 100 * (1 - ratio)
    errors = [
        steady_state.steady_state(observes, float(axes.manoeuvre_variance[f]), axes.sigma, axes.scan_period_s)[1]
        for observes, f in ((1, range_filter), (2, velocity_filter))
    ]
    exact_gain = 100 * (1 - np.sqrt(np.diag(errors[1]) / np.diag(errors[0])))
    limit_gain = closed_form.steady_gains(groups.c)
    return RadarOnChart(case.name, inputs, tau_1, tau_2, groups, exact_gain, limit_gain, axes.t_s[common_scans], gain)


def corrected_gains(place: RadarOnChart) -> np.ndarray:
    """The closed form's steady gains (3,) with the first order of the period."""
    return closed_form.steady_gains(place.groups.c, place.inputs[2] / place.tau_2_s)

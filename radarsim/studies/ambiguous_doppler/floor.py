"""The floor under σ with folded velocities, for a random polynomial, and for one common to all realisations.

A folded velocity has no more information than an unfolded one, so that the bound of range and velocity holds for it."""

from typing import Any

import numpy as np

from radarsim.engine.results import Axes
from radarsim.studies.ambiguous_doppler import scenario
from radarsim.studies.floors import bound as floors_bound
from radarsim.studies.floors import missed_plots, static
from radarsim.studies.floors.bound import Bound, Floor


def floor(spec: Any, axes: Axes) -> Floor | None:
    """The floor of each filter; None for targets that manoeuvre.

    The first range of a random polynomial is not random: the bound holds for estimators that shift with it, as all do
    that take the first range from a plot."""
    target, radar, t = spec.target, spec.radar, np.asarray(axes.t_s, dtype=float)
    if is_random := target.kind == "random_polynomial":
        spread = np.array([np.inf, *scenario.random_motion_sigma(target)])
        unknown = np.flatnonzero(spread)
        prior, maps = np.diag(spread[unknown] ** -2.0), static.polynomial(t, 3)[..., unknown]
    elif target.kind == "polynomial":
        size = max(3, len(target.coefficients))
        prior, maps = np.zeros((size, size)), static.polynomial(t, size)
    else:
        return None
    sigma = np.array([radar.sigma_range_m, radar.sigma_velocity_mps])

    def bound(observes: int) -> Bound:
        rows = maps[:, :observes] / sigma[:observes, None]
        information = np.einsum("kdi,kdj->kij", rows, rows)
        if radar.detection_probability == 1:
            return static.static_bound(prior, information, maps)
        detection, plot_counts = np.full(len(t), radar.detection_probability), np.ones((len(t), 3), dtype=int)
        settling_scans = -(-int((prior.diagonal() == 0).sum()) // observes)
        return missed_plots.missed_plots_bound(
            prior, information, maps, detection, plot_counts, (1, 1, 1), settling_scans
        )

    ranges, both = bound(1), bound(2)
    floors_by_doppler = {"none": ranges, "unfolded": both}
    folded = both._replace(is_attained=False)
    kind = floors_bound.POSTERIOR if is_random else floors_bound.CRB
    return Floor(kind, tuple(floors_by_doppler.get(options.doppler, folded) for options in spec.filters), folded)

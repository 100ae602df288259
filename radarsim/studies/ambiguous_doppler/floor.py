"""The floor under σ with velocities that fold: of a drawn polynomial, and of one that is the same in all realisations.

A folded velocity tells no more than one with its fold, so that the bound of range and velocity holds for it too."""

from typing import Any

import numpy as np

from radarsim.engine.results import Axes
from radarsim.studies import floor as floors
from radarsim.studies.ambiguous_doppler import filters
from radarsim.studies.floor import Bound, Floor


def floor(spec: Any, axes: Axes) -> Floor | None:
    """The first range of a drawn polynomial is not drawn: under estimators that shift with it, as all do that take the
    first range from a plot. Of manoeuvres none is defined."""
    target, radar, t = spec.target, spec.radar, np.asarray(axes.t_s, dtype=float)
    if drawn := target.kind == "random_polynomial":
        spread = np.array([np.inf, *filters.spread(target)])
        unknown = np.flatnonzero(spread)
        prior, maps = np.diag(spread[unknown] ** -2.0), floors.polynomial(t, 3)[..., unknown]
    elif target.kind == "polynomial":
        size = max(3, len(target.coefficients))
        prior, maps = np.zeros((size, size)), floors.polynomial(t, size)
    else:
        return None
    sigma = np.array([radar.sigma_range_m, radar.sigma_velocity_mps])

    def below(observes: int) -> Bound:
        rows = maps[:, :observes] / sigma[:observes, None]
        gained = np.einsum("kdi,kdj->kij", rows, rows)
        if radar.detection_probability == 1:
            return floors.static(prior, gained, maps)
        chance, each = np.full(len(t), radar.detection_probability), np.ones((len(t), 3), dtype=int)
        settles = -(-int((prior.diagonal() == 0).sum()) // observes)
        return floors.missed(prior, gained, maps, chance, each, (1, 1, 1), settles)

    ranges, both = below(1), below(2)
    ways = {"none": ranges, "unfolded": both}
    folded = both._replace(reached=False)
    kind = floors.POSTERIOR if drawn else floors.CRB
    return Floor(kind, tuple(ways.get(one.doppler, folded) for one in spec.filters), folded)

"""The floor under σ of a track of range, velocity and acceleration from bursts: of a polynomial that is designated."""

from typing import Any

import numpy as np

from radarsim.studies.floors import bound as floors_bound
from radarsim.studies.floors import static
from radarsim.studies.floors.bound import Bound, Floor
from radarsim.studies.pulses_to_tracks.axes import PulsesAxes


def floor(spec: Any, axes: PulsesAxes) -> Floor | None:
    """The floor of each filter; None for targets that are no polynomial.

    A burst measures velocity and acceleration no better than its Cramér–Rao bounds; the designation counts as a
    measurement. The polynomial estimated is of the second degree, or of the target's if that is higher."""
    if spec.target.kind != "polynomial":
        return None
    t, size = np.asarray(axes.t_s, dtype=float), max(3, len(spec.target.coefficients))
    maps, prior = static.polynomial(t, size), np.zeros((size, size))
    prior[1, 1], prior[2, 2] = spec.prior.sigma_velocity_mps**-2.0, spec.prior.sigma_acceleration_mps2**-2.0
    bounds_by_value: dict[bytes, Bound] = {}
    for bound in axes.bound:
        sigma = np.column_stack([np.full(len(t), spec.radar.sigma_range_m), bound])
        rows = np.where(np.isnan(sigma)[..., None], 0.0, maps / sigma[..., None])
        if bound.tobytes() not in bounds_by_value:
            bounds_by_value[bound.tobytes()] = static.static_bound(prior, np.einsum("kdi,kdj->kij", rows, rows), maps)
    return Floor(floors_bound.CRB, tuple(bounds_by_value[bound.tobytes()] for bound in axes.bound))

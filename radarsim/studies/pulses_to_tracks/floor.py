"""The floor under σ of a track of range, velocity and acceleration from bursts: of a polynomial that is designated."""

from typing import Any

import numpy as np

from radarsim.studies import floor as floors
from radarsim.studies.floor import Bound, Floor
from radarsim.studies.pulses_to_tracks.study import PulsesAxes


def floor(spec: Any, axes: PulsesAxes) -> Floor | None:
    """A burst measures velocity and acceleration no better than its Fisher bounds; the designation is a measurement.
    Of the second degree, or of the target's own where that is higher; of other motions none is defined."""
    if spec.target.kind != "polynomial":
        return None
    t, size = np.asarray(axes.t_s, dtype=float), max(3, len(spec.target.coefficients))
    maps, known = floors.polynomial(t, size), np.zeros((size, size))
    known[1, 1], known[2, 2] = spec.prior.sigma_velocity_mps**-2.0, spec.prior.sigma_acceleration_mps2**-2.0
    found: dict[bytes, Bound] = {}
    for bound in axes.bound:
        sigma = np.column_stack([np.full(len(t), spec.radar.sigma_range_m), bound])
        rows = np.where(np.isnan(sigma)[..., None], 0.0, maps / sigma[..., None])
        if bound.tobytes() not in found:
            found[bound.tobytes()] = floors.static(known, np.einsum("kdi,kdj->kij", rows, rows), maps)
    return Floor(floors.CRB, tuple(found[bound.tobytes()] for bound in axes.bound))

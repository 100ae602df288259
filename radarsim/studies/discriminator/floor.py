"""The floor under σ of a burst's parameters (P4), window by window."""

import numpy as np

from radarsim.studies.discriminator.config import Keys
from radarsim.studies.discriminator.study import DiscriminatorAxes
from radarsim.studies.floors.bound import CRB, LAGS, Bound, Floor


def floor(spec: Keys, axes: DiscriminatorAxes) -> Floor | None:
    """The bound from the samples of a window and the forecast together, both taken as measurements.

    None for a velocity profile, which is no polynomial, and where forecasts err by less than is assumed; no bound for
    an estimator that starts at the truth."""
    if spec.truth.doppler_derivatives is None or spec.prior.error_scale < 1:
        return None
    no_values = np.full(axes.posterior_sigma.shape[1:], np.nan)
    bounds = tuple(
        None
        if value.start == "truth"
        else Bound(sigma, np.stack([no_values] * len(LAGS)), no_values, ("",) * len(sigma), is_attained=False)
        for value, sigma in zip(spec.estimators, axes.posterior_sigma, strict=True)
    )
    return Floor(CRB, bounds, t_s=axes.duration_s)

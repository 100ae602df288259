"""The floor under σ of a burst's parameters (P4), window by window."""

import numpy as np

from radarsim.studies.discriminator.config import Keys
from radarsim.studies.discriminator.study import DiscriminatorAxes
from radarsim.studies.floor import CRB, LAGS, Bound, Floor


def floor(spec: Keys, axes: DiscriminatorAxes) -> Floor | None:
    """What the samples of a window and the forecast tell together, taken as measurements. Of a profile, which is no
    polynomial, none is defined; nor where forecasts err by less than is assumed, or an estimator starts at the
    truth."""
    if spec.truth.doppler_derivatives is None or spec.prior.error_scale < 1:
        return None
    none = np.full(axes.posterior_sigma.shape[1:], np.nan)
    each = tuple(
        None
        if value.start == "truth"
        else Bound(sigma, np.stack([none] * len(LAGS)), none, ("",) * len(sigma), reached=False)
        for value, sigma in zip(spec.estimators, axes.posterior_sigma, strict=True)
    )
    return Floor(CRB, each, t_s=axes.duration_s)

"""The bound for motion without noise: a function of parameters that stay.

Everything that moves without noise is a function of parameters θ (p,) that stay the same; a scan adds information (p,
p) on it."""

import numpy as np

from radarsim.studies.floors.bound import LAGS, Bound, decompose_information, sigma_from_information


def static_bound(prior: np.ndarray, gained: np.ndarray, maps: np.ndarray, reached: bool = True) -> Bound:
    """The bound for parameters that stay.

    prior (p, p): their information before the first scan; gained (K, p, p): that of each scan's plots; maps (K, C, p):
    the derivatives of the components by the parameters."""
    J = decompose_information(prior + np.cumsum(gained, axis=0))
    scans = len(gained)

    def sigma_after(lag: int) -> np.ndarray:
        sigma = np.full(maps.shape[:2], np.nan)
        sigma[: scans - lag] = sigma_from_information(tuple(part[lag:] for part in J), maps[: scans - lag])
        return sigma

    last = tuple(part[-1:] for part in J)
    lagged_sigma = np.stack([sigma_after(lag) if lag < scans else np.full(maps.shape[:2], np.nan) for lag in LAGS])
    return Bound(sigma_after(0), lagged_sigma, sigma_from_information(last, maps), ("",) * scans, reached)


def polynomial(t: np.ndarray, size: int, components: int = 3) -> np.ndarray:
    """Derivatives (K, components, size) of value, rate, … at times t (K,) by the `size` coefficients Σ cᵢ tⁱ/i!."""
    derivatives = np.zeros((len(t), components, size))
    for j in range(min(components, size)):
        power = np.ones_like(t)
        for i in range(j, size):
            derivatives[:, j, i] = power
            power = power * t / (i - j + 1)
    return derivatives

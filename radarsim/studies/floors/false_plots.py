"""How much of a plot's information is left where plots are missed and false ones lie about it.

With the errors of plots in units of their own, Gaussian in m numbers, and false plots of Poisson's law, even in these,
the Fisher information of the plots of a scan on what they measure is that of the target's plot times one factor q: the
information reduction factor of Niu, Willett & Bar-Shalom (IEEE Trans. SP 49, 2001, 1325; Hernandez, Farina & Ristic,
IEEE Trans. AES 42, 2006). It is the mean square of the score: a sum over plots z of w z, w the probability that z is
the target's. A bound with it is one on estimators that are given the plots but not their origin."""

import functools

import numpy as np

REACH = 6.5  # standard deviations beyond which a plot cannot be the target's
MAX_SAMPLES, MIN_SAMPLES, MAX_PLOTS = 1 << 14, 1 << 9, 1_000_000  # scans, and false plots of all of them
NODES = 9  # densities of a table
NEGLIGIBLE = 1e-9  # false plots in a unit of volume
UNIT_BALL = {2: np.pi, 3: 4 / 3 * np.pi}


def information_shares(detection: float, densities: np.ndarray, m: int) -> np.ndarray:
    """q (K,) at densities (K,) of false plots per product of standard deviations, 2 or 3 of them.

    By samples of scans; between NODES densities by their logarithm, a straight line."""
    shares, dense = np.full(densities.shape, detection, dtype=float), densities > NEGLIGIBLE
    if not dense.any():
        return shares
    logs = np.log(densities[dense])
    nodes = np.linspace(logs.min(), logs.max(), NODES) if np.ptp(logs) > 0 else logs[:1]
    values = [information_share(detection, float(np.exp(node)), m) for node in nodes]
    shares[dense] = np.interp(logs, nodes, values)
    return shares


@functools.cache
def information_share(detection: float, density: float, m: int) -> float:
    """q at one density, to about 0.3 %."""
    draw, expected = np.random.default_rng(2001), density * UNIT_BALL[m] * REACH**m
    samples = int(np.clip(MAX_PLOTS / expected, MIN_SAMPLES, MAX_SAMPLES))
    target = draw.normal(size=(samples, m))
    owner = np.repeat(np.arange(samples), draw.poisson(expected, samples))
    direction = draw.normal(size=(owner.size, m))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    false = direction * REACH * draw.uniform(size=(owner.size, 1)) ** (1 / m)

    def likelihood(z: np.ndarray) -> np.ndarray:
        """Of plots that are the target's, over that of false ones."""
        ratio: np.ndarray = detection / density * np.exp(-0.5 * (z**2).sum(axis=1)) / (2 * np.pi) ** (m / 2)
        return ratio

    sums = np.zeros((samples, m))
    weights = likelihood(false)
    total = np.bincount(owner, weights, samples) + (1 - detection)
    for j in range(m):
        sums[:, j] = np.bincount(owner, weights * false[:, j], samples)
    own = likelihood(target)
    with_target = ((sums + own[:, None] * target) / (total + own)[:, None]) ** 2
    without = (sums / np.where(total > 0, total, 1.0)[:, None]) ** 2
    # Less the square of the target's own plot, whose mean is known: the rest varies less.
    change = with_target.sum(axis=1) - (target**2).sum(axis=1)
    return float(detection * (1 + change.mean() / m) + (1 - detection) * without.sum(axis=1).mean() / m)

"""A likelihood of recorded plots along some of what can explain them: keys of the config, and beside them outliers, a
bias, errors that last from plot to plot."""

from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import Any

import numpy as np

from radarsim.studies.interface import BIAS, CORRELATION, EXPLANATIONS, OUTLIERS, Likelihood

ROUGH = 0.01  # to which explanations are compared, in the logarithm of a key and of the likelihood
LOWEST, HIGHEST = np.log(1e-4), np.log(1e4)  # of a key's factor
MOST_BIAS = 50.0  # in σ of the velocity
SHARES = {OUTLIERS: (1e-3, 0.4, 3.0), CORRELATION: (1e-3, 0.99, 0.0)}  # least, most, logit from which it is searched
FAR_FROM_ZERO = 1e4  # times what counts as zero of a key
IMPOSSIBLE = -1e300  # what counts as the logarithm of no likelihood: a search needs a number
NOTHING: Mapping[str, float] = MappingProxyType({})
STARTS = (-2.0, 0.0, 2.0)  # of a search
Progress = Callable[[int], None]


def silent(evaluations: int) -> None:
    """Progress that nobody sees."""


def units(likelihood: Likelihood) -> np.ndarray:
    """From where each key is searched: as the config states it; one that it states as zero, far from what counts so."""
    near_zero = np.asarray(likelihood.stated) <= likelihood.least
    return np.where(near_zero, FAR_FROM_ZERO * np.asarray(likelihood.least), likelihood.stated)


class Counted:
    """A likelihood that counts how often it is found."""

    def __init__(self, of: Likelihood, progress: Progress, count: int = 0):
        self.of, self.progress, self.count = of, progress, count
        self.keys, self.stated = of.keys, of.stated

    def __call__(self, values: np.ndarray, explained: Mapping[str, float]) -> float:
        self.count += 1
        self.progress(self.count)
        return self.of(values, **explained)


def value(likelihood: Counted, changed: Mapping[str, float]) -> float:
    """The likelihood with some of the explanations at work."""
    stated = zip(likelihood.keys, likelihood.stated, strict=True)
    values = np.array([changed.get(key, value) for key, value in stated])
    found = likelihood(values, {what: changed[what] for what in EXPLANATIONS if what in changed})
    return found if np.isfinite(found) else IMPOSSIBLE


class Along:
    """A likelihood along some explanations, each on the scale on which it is searched; others held at a value."""

    def __init__(self, likelihood: Counted, whats: Sequence[str], held: Mapping[str, float] = NOTHING):
        unit = dict(zip(likelihood.keys, units(likelihood.of).tolist(), strict=True))
        self.likelihood, self.held = likelihood, held
        self.scales = {what: _scale(what, unit) for what in whats}

    def searched(self, values: Mapping[str, float]) -> np.ndarray:
        return np.array([back(values[what]) for what, (_, back) in self.scales.items()])

    def natural(self, at: np.ndarray) -> dict[str, float]:
        return {what: of(x) for (what, (of, _)), x in zip(self.scales.items(), at, strict=True)}

    def __call__(self, at: np.ndarray) -> float:
        return value(self.likelihood, {**self.held, **self.natural(at)})


def best(
    likelihood: Counted, whats: Sequence[str], start: Mapping[str, float], held: Mapping[str, float] = NOTHING
) -> tuple[dict[str, float], float]:
    """Where the likelihood is largest along some explanations, others held, and its logarithm there: roughly, from
    three starts of the last one."""
    along, last = Along(likelihood, whats, held), whats[-1]
    tops = [climbed(along, {**start, last: along.scales[last][0](first)}) for first in STARTS]
    return max(tops, key=lambda top: top[1])


def climbed(along: Along, start: Mapping[str, float]) -> tuple[dict[str, float], float]:
    """The top that is reached from a start, and the logarithm of the likelihood there, roughly."""
    from scipy.optimize import minimize

    def cost(at: np.ndarray) -> float:
        return -along(at)

    at = along.searched(start)
    simplex = np.concatenate([at[None], at + 0.5 * np.eye(len(at))])
    options: Any = {"initial_simplex": simplex, "xatol": ROUGH, "fatol": ROUGH, "maxfev": 400}
    found = minimize(cost, at, method="Nelder-Mead", options=options)
    return along.natural(found.x), -float(found.fun)


def _scale(what: str, unit: dict[str, float]) -> tuple[Callable[[float], float], Callable[[float], float]]:
    """From what is searched to the value of an explanation, and back; unit: of each key."""
    if what == BIAS:
        return lambda x: float(np.clip(x, -MOST_BIAS, MOST_BIAS)), lambda value: value
    if what in SHARES:
        least, most, rare = SHARES[what]
        return (
            lambda x: float(np.clip(1 / (1 + np.exp(rare - x)), least, most)),
            lambda value: rare - float(np.log(1 / value - 1)),
        )
    return (
        lambda x: unit[what] * float(np.exp(np.clip(x, LOWEST, HIGHEST))),
        lambda value: float(np.log(value / unit[what])),
    )

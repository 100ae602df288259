"""Maximise a likelihood along some of its keys and explanations, with rough accuracy."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from statistics import NormalDist
from types import MappingProxyType
from typing import Any

import numpy as np

from radarsim.studies.error_law import BIAS, CORRELATION, EXPLANATIONS, MANOEUVRES, OUTLIERS, STATED_ERRORS, ErrorLaw
from radarsim.studies.recording_interface import Likelihood

ROUGH_ACCURACY = 0.01  # relative accuracy, of a key and of the likelihood, to which explanations are compared
MIN_LOG_FACTOR, MAX_LOG_FACTOR = np.log(1e-4), np.log(1e4)  # of a key's factor
MAX_BIAS_SIGMAS = 50.0  # in σ of the velocity
SHARE_LIMITS = {
    OUTLIERS: (1e-3, 0.4, 3.0),
    CORRELATION: (1e-3, 0.99, 0.0),
    MANOEUVRES: (1e-3, 0.4, 3.0),
}  # least, most, logit at the start of the search
LEAST_SHARE_MARGIN = 1.5  # times the least: a share below it explains nothing, whatever else has moved with it
FAR_FROM_ZERO = 1e4  # times the value of a key that counts as zero
IMPOSSIBLE_LOG_LIKELIHOOD = -1e300  # stands for the logarithm of zero likelihood: a search needs a number
NO_VALUES: Mapping[str, float] = MappingProxyType({})
RIVAL_STARTS = (0.03, 0.2)  # of the share of hard manoeuvres
CLEAR_RIVAL_GAIN = 3.0  # of the log-likelihood, a factor of twenty, from which one of two explanations is clear
CLEAR_GAIN_OF_TURNING = 7.0  # of outliers where the target plainly turns: hard intervals describe a turn ill
MANOEUVRE_KEY = "manoeuvre_variance"
SEARCH_STARTS = (-2.0, 0.0, 2.0)  # of a search
Progress = Callable[[int, int | None], None]  # likelihoods computed, and their expected number where known


def half_chi2(probability: float) -> float:
    """Half a point of chi-square with one degree of freedom. SciPy's statistics would take a second to import."""
    return 0.5 * NormalDist().inv_cdf((1 + probability) / 2) ** 2


def no_progress(evaluations: int, expected: int | None = None) -> None:
    """Ignore progress."""


def is_least_share(name: str, value: float) -> bool:
    """Whether the value of an explanation is the least that is tried: then others explain the plots."""
    return name in SHARE_LIMITS and value < LEAST_SHARE_MARGIN * SHARE_LIMITS[name][0]


def starting_values(likelihood: Likelihood) -> np.ndarray:
    """Starting values of the keys: the configured ones; a key that is zero starts far above what counts as zero."""
    is_zero = np.asarray(likelihood.stated) <= likelihood.zero_limits
    return np.where(is_zero, FAR_FROM_ZERO * np.asarray(likelihood.zero_limits), likelihood.stated)


def single_explanations(likelihood: Likelihood) -> list[str]:
    """The explanations that are tried by themselves: hard manoeuvres are compared with outliers alone."""
    return [name for name in likelihood.explains if name != MANOEUVRES]


class CountedLikelihood:
    """A likelihood that counts its evaluations and reports progress; law: of the errors, besides what is tried."""

    def __init__(
        self,
        likelihood: Likelihood,
        progress: Progress,
        count: int = 0,
        expected: int | None = None,
        law: ErrorLaw = STATED_ERRORS,
    ):
        self.likelihood, self.progress, self.count, self.expected = likelihood, progress, count, expected
        self.keys, self.stated, self.law = likelihood.keys, likelihood.stated, law

    def __call__(self, values: np.ndarray, law: ErrorLaw) -> float:
        self.count += 1
        self.progress(self.count, self.expected and max(self.expected, self.count))
        return self.likelihood(values, law)


def log_likelihood(likelihood: CountedLikelihood, changes: Mapping[str, float]) -> float:
    """The log-likelihood with some keys changed and some explanations applied."""
    configured = zip(likelihood.keys, likelihood.stated, strict=True)
    values = np.array([changes.get(key, value) for key, value in configured])
    explanations: dict[str, Any] = {name: changes[name] for name in EXPLANATIONS if name in changes}
    result = likelihood(values, replace(likelihood.law, **explanations))
    return result if np.isfinite(result) else IMPOSSIBLE_LOG_LIKELIHOOD


class LikelihoodSlice:
    """A likelihood as a function of some keys and explanations on their search scales; others are fixed."""

    def __init__(self, likelihood: CountedLikelihood, names: Sequence[str], fixed: Mapping[str, float] = NO_VALUES):
        starting = dict(zip(likelihood.keys, starting_values(likelihood.likelihood).tolist(), strict=True))
        self.likelihood, self.fixed = likelihood, fixed
        self.scales = {name: _search_scale(name, starting) for name in names}

    def to_search(self, values: Mapping[str, float]) -> np.ndarray:
        return np.array([to_search(values[name]) for name, (_, to_search) in self.scales.items()])

    def to_values(self, point: np.ndarray) -> dict[str, float]:
        return {name: to_value(x) for (name, (to_value, _)), x in zip(self.scales.items(), point, strict=True)}

    def __call__(self, point: np.ndarray) -> float:
        return log_likelihood(self.likelihood, {**self.fixed, **self.to_values(point)})


def maximise(
    likelihood: CountedLikelihood,
    names: Sequence[str],
    start: Mapping[str, float],
    fixed: Mapping[str, float] = NO_VALUES,
) -> tuple[dict[str, float], float]:
    """The maximum of the likelihood along some explanations, others held, and its logarithm there: roughly, from three
    starts of the last one."""
    slice_, last_name = LikelihoodSlice(likelihood, names, fixed), names[-1]
    maxima = [
        climb(slice_, {**start, last_name: slice_.scales[last_name][0](last_start)}) for last_start in SEARCH_STARTS
    ]
    return max(maxima, key=lambda maximum: maximum[1])


def climb(slice_: LikelihoodSlice, start: Mapping[str, float]) -> tuple[dict[str, float], float]:
    """The maximum reached from a start with rough accuracy, and its log-likelihood."""
    from scipy.optimize import minimize

    def cost(start_point: np.ndarray) -> float:
        return -slice_(start_point)

    point = slice_.to_search(start)
    simplex = np.concatenate([point[None], point + 0.5 * np.eye(len(point))])
    options: Any = {"initial_simplex": simplex, "xatol": ROUGH_ACCURACY, "fatol": ROUGH_ACCURACY, "maxfev": 400}
    result = minimize(cost, point, method="Nelder-Mead", options=options)
    return slice_.to_values(result.x), -float(result.fun)


@dataclass(frozen=True)
class Rival:
    """Hard manoeuvres in place of outliers: their share of the intervals, and by how much the logarithm of the
    likelihood is larger than with outliers; is_turning: whether both need a larger manoeuvre variance than stated."""

    share: float
    gain: float
    is_turning: bool = False

    @property
    def is_clear(self) -> bool:
        return self.gain > CLEAR_RIVAL_GAIN or -self.gain > (
            CLEAR_GAIN_OF_TURNING if self.is_turning else CLEAR_RIVAL_GAIN
        )


def rival_of_outliers(likelihood: CountedLikelihood, values: Mapping[str, float]) -> Rival | None:
    """Compare outliers, of the given values of keys and explanations, with hard manoeuvres, each with all keys fitted;
    None where the likelihood knows no hard manoeuvres."""
    if MANOEUVRES not in likelihood.likelihood.explains or CORRELATION in values:
        return None
    configured = dict(zip(likelihood.keys, starting_values(likelihood.likelihood).tolist(), strict=True))
    zero_limits = dict(zip(likelihood.keys, np.asarray(likelihood.likelihood.zero_limits).tolist(), strict=True))
    fixed = {name: value for name, value in values.items() if name != OUTLIERS}
    keys = [key for key in likelihood.keys if fixed.get(key, configured[key]) > zero_limits[key]]
    maxima = {}
    for name, shares in ((OUTLIERS, [values[OUTLIERS]]), (MANOEUVRES, RIVAL_STARTS)):
        slice_ = LikelihoodSlice(likelihood, [*keys, name], fixed)
        starts = ({**configured, **fixed, name: share} for share in shares)
        maxima[name] = max((climb(slice_, start) for start in starts), key=lambda maximum: maximum[1])
    stated = dict(zip(likelihood.keys, np.asarray(likelihood.likelihood.stated).tolist(), strict=True))
    is_turning = fixed.get(MANOEUVRE_KEY, 0.0) > stated.get(MANOEUVRE_KEY, np.inf)
    return Rival(maxima[MANOEUVRES][0][MANOEUVRES], maxima[MANOEUVRES][1] - maxima[OUTLIERS][1], is_turning)


def _search_scale(name: str, starting: dict[str, float]) -> tuple[Callable[[float], float], Callable[[float], float]]:
    """Functions from the search scale to the value of a key or an explanation, and back.

    starting: the starting value of each key."""
    if name == BIAS:
        return lambda x: float(np.clip(x, -MAX_BIAS_SIGMAS, MAX_BIAS_SIGMAS)), lambda value: value
    if name in SHARE_LIMITS:
        minimum, maximum, offset = SHARE_LIMITS[name]
        return (
            lambda x: float(np.clip(1 / (1 + np.exp(offset - x)), minimum, maximum)),
            lambda value: offset - float(np.log(1 / value - 1)),
        )
    return (
        lambda x: starting[name] * float(np.exp(np.clip(x, MIN_LOG_FACTOR, MAX_LOG_FACTOR))),
        lambda value: float(np.log(value / starting[name])),
    )

"""What is wrong with the config's numbers, if anything is, from the likelihood along each of them.

Each explanation alone (a σ, the manoeuvre variance, a bias of the velocity, outliers) is fitted to the plots. The one
that raises the likelihood most is named, if it raises it more than chance does in one recording of twenty, all
explanations together; then the search goes on beside it. What a recording with sound numbers says is: nothing wrong.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from radarsim.recorded.fit import IMPOSSIBLE, LEAST_ROWS, Progress, polished, silent, units
from radarsim.recorded.follow import Followed, recorded_of
from radarsim.studies.interface import BIAS, OUTLIERS, Likelihood

LEVEL = 0.05  # of finding something where nothing is wrong
MOST_FOUND = 3
ROUGH = 0.01  # to which explanations are compared, in the logarithm of a key and of the likelihood
LOWEST, HIGHEST = np.log(1e-4), np.log(1e4)  # of a key's factor
MOST_BIAS = 50.0  # in σ of the velocity
SHARES = (1e-3, 0.4)  # of outliers


@dataclass(frozen=True)
class Finding:
    """One explanation: the key (or OUTLIERS, BIAS), its value (a share; a bias in σ), and the gain of the logarithm of
    the likelihood over what was found before."""

    what: str
    value: float
    gain: float


@dataclass(frozen=True)
class Compared:
    """How much better than each filter the best one predicts the plots: differences of the logarithm of the likelihood
    of the numbers that all of them take."""

    best: str
    behind: dict[str, float]


@dataclass(frozen=True)
class Advice:
    """What the likelihood says of a config's filters over recorded plots: which is best, and what is wrong with its
    numbers; rows: how many it was asked of."""

    compared: Compared
    findings: list[Finding]
    rows: int


def advised(followed: Followed, progress: Progress = silent) -> Advice | None:
    """Advice from the first rows of each track; none where the study has no likelihood of recorded plots. progress is
    called with the number of likelihoods found."""
    case, of = followed.case, recorded_of(followed.case)
    heads = [one.head for one in followed.tracks.values()] or [followed.head]
    long = [head for head in heads if len(head["t_s"]) >= LEAST_ROWS]
    if not long:
        return None
    asked = some(long, of.rows_asked)
    found = [of.likelihood(case, member.name, asked) for member in case.spec.members]
    known = [one for one in found if one is not None]
    if not known:
        return None
    best = compared(known)
    (chosen,) = (one for one in known if one.filter == best.best)
    return Advice(best, findings(chosen, progress), chosen.rows)


def some(heads: Sequence[Mapping[str, np.ndarray]], most: int) -> list[Mapping[str, np.ndarray]]:
    """The beginnings of tracks, columns (n,) each, up to `most` rows altogether; as many tracks as possible."""
    share = max(most // len(heads), LEAST_ROWS)
    chosen = heads[: max(most // share, 1)]
    return [{name: column[:share] for name, column in head.items()} for head in chosen]


class _Counted:
    """A likelihood that counts how often it is found."""

    def __init__(self, of: Likelihood, progress: Progress):
        self.of, self.progress, self.count = of, progress, 0
        self.keys, self.stated = of.keys, of.stated

    def __call__(self, values: np.ndarray, outliers: float, bias: float) -> float:
        self.count += 1
        self.progress(self.count)
        return self.of(values, outliers, bias)


def findings(likelihood: Likelihood, progress: Progress = silent) -> list[Finding]:
    """What is wrong with the stated numbers, the weightiest first; empty where nothing is."""
    from scipy.stats import chi2

    of, whats = _Counted(likelihood, progress), [*likelihood.keys, *likelihood.explains]
    needed = 0.5 * float(chi2.ppf(1 - LEVEL / len(whats), 1))
    chosen: list[str] = []
    start: dict[str, float] = {}
    reached, found = _value(of, {}), []
    while len(chosen) < min(MOST_FOUND, len(whats)):
        trials = {what: _best(of, [*chosen, what], start) for what in whats if what not in chosen}
        what = max(trials, key=lambda name: trials[name][1])
        values, top = trials[what]
        if top - reached < needed:
            break
        values, top = _exactly(of, values)
        found.append(Finding(what, values[what], top - reached))
        chosen, start, reached = [*chosen, what], values, top
    final = start
    return [Finding(one.what, final[one.what], one.gain) for one in found]


def compared(likelihoods: Sequence[Likelihood]) -> Compared:
    """Which filter predicts the plots best, as stated."""
    sums = {one.filter: one.by_number(np.asarray(one.stated)) for one in likelihoods}
    common = set.intersection(*(set(parts) for parts in sums.values()))
    totals = {name: sum(parts[number] for number in common) for name, parts in sums.items()}
    best = max(totals, key=lambda name: totals[name])
    return Compared(best, {name: totals[best] - total for name, total in totals.items()})


def _value(likelihood: _Counted, changed: dict[str, float]) -> float:
    """The likelihood with some of the explanations at work."""
    stated = zip(likelihood.keys, likelihood.stated, strict=True)
    values = np.array([changed.get(key, value) for key, value in stated])
    found = likelihood(values, changed.get(OUTLIERS, 0.0), changed.get(BIAS, 0.0))
    return found if np.isfinite(found) else IMPOSSIBLE


class _Along:
    """A likelihood along some explanations, each on the scale on which it is searched."""

    def __init__(self, likelihood: _Counted, whats: Sequence[str]):
        unit = dict(zip(likelihood.keys, units(likelihood.of).tolist(), strict=True))
        self.likelihood, self.scales = likelihood, {what: _scale(what, unit) for what in whats}

    def searched(self, values: Mapping[str, float]) -> np.ndarray:
        return np.array([back(values[what]) for what, (_, back) in self.scales.items()])

    def natural(self, at: np.ndarray) -> dict[str, float]:
        return {what: of(x) for (what, (of, _)), x in zip(self.scales.items(), at, strict=True)}

    def __call__(self, at: np.ndarray) -> float:
        return _value(self.likelihood, self.natural(at))


def _best(likelihood: _Counted, whats: Sequence[str], start: dict[str, float]) -> tuple[dict[str, float], float]:
    """Where the likelihood is largest along some explanations, and its logarithm there: roughly, from three starts of
    the last one."""
    from scipy.optimize import minimize

    along, best = _Along(likelihood, whats), (start, -np.inf)

    def cost(at: np.ndarray) -> float:
        return -along(at)

    for first in (-2.0, 0.0, 2.0):
        at = along.searched({**start, whats[-1]: along.scales[whats[-1]][0](first)})
        simplex = np.concatenate([at[None], at + 0.5 * np.eye(len(at))])
        options: Any = {"initial_simplex": simplex, "xatol": ROUGH, "fatol": ROUGH, "maxfev": 400}
        found = minimize(cost, at, method="Nelder-Mead", options=options)
        if -found.fun > best[1]:
            best = along.natural(found.x), -float(found.fun)
    return best


def _exactly(likelihood: _Counted, near: dict[str, float]) -> tuple[dict[str, float], float]:
    """The top near values that were found roughly: what is printed must not hang on a processor's last digits."""
    along = _Along(likelihood, list(near))
    at = polished(along, along.searched(near))
    return along.natural(at), along(at)


def _scale(what: str, unit: dict[str, float]) -> tuple[Callable[[float], float], Callable[[float], float]]:
    """From what is searched to the value of an explanation, and back; unit: of each key."""
    if what == BIAS:
        return lambda x: float(np.clip(x, -MOST_BIAS, MOST_BIAS)), lambda value: value
    if what == OUTLIERS:
        return (
            lambda x: float(np.clip(1 / (1 + np.exp(3 - x)), *SHARES)),
            lambda value: 3 - float(np.log(1 / value - 1)),
        )
    return (
        lambda x: unit[what] * float(np.exp(np.clip(x, LOWEST, HIGHEST))),
        lambda value: float(np.log(value / unit[what])),
    )

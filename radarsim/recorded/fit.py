"""What recorded plots say of the config's numbers: by the likelihood of the innovations of a filter.

The filter's predictions give each plot a density; their product is the likelihood of the numbers that it was built
with (Schweppe 1965). Estimates are where it is largest; an interval holds the values of a key at which the largest
likelihood over all other keys is within half the 95 % point of chi-square of it (profile likelihood).
"""

import math
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from radarsim.config.experiment import Experiment
from radarsim.errors import ConfigError
from radarsim.recorded import doppler, plots
from radarsim.recorded.along import IMPOSSIBLE, Counted, Progress, best, silent, units
from radarsim.recorded.follow import by_track, one_case, recorded_of, refuse_borrowed
from radarsim.studies.interface import OUTLIERS, Likelihood

HALF_CHI2_95 = 1.9207294103470  # half the 95 % point of chi-square with one degree of freedom
LEAST_ROWS = 10  # of a track; shorter ones say next to nothing
FIRST_STEP, ROUGH = 0.3, 1e-4  # of a search, and where it stands still before it is carried on, in the same logarithms
REACH = 1e4  # how many times larger or smaller than the estimate an end of an interval is looked for
EVALUATIONS = 2000
# To which a top and an end of an interval are found, in the logarithm of a key; the likelihood's own to a tenth. That
# is far finer than what is printed: which way a search goes hangs on last digits, and these differ between processors.
CLOSE = 1e-6
STEP = 1e-3  # over which a slope is taken, in the logarithm of a key
LEAST_SHARE, MOST_SHARE = 1e-6, 0.5  # of outliers; less is none
FINER, LEAP = 1e-3, 0.01  # what counts as zero is this part of before where the likelihood leaps by more there


@dataclass(frozen=True)
class Fitted:
    """One key: the value that fits best, its 95 % interval, and whether the plots tell it from all other values.

    lo is 0 where the key may as well be zero, hi infinite where it has no upper end.
    """

    key: str
    stated: float
    value: float
    lo: float
    hi: float
    identifiable: bool


@dataclass(frozen=True)
class Fit:
    """What was fitted: filter, tracks and plots used, the keys, the share of outliers where they were allowed for, and
    by how much the logarithm of the likelihood is above that of the stated values; and what else the plots have, of
    EXPLANATIONS, with its value: then the intervals do not hold."""

    filter: str
    tracks: int
    rows: int
    keys: tuple[Fitted, ...]
    outliers: float | None
    gain: float
    beside: tuple[str, float] | None = None


def likelihood_of(experiment: Experiment, source: str | os.PathLike, filter_name: str | None = None) -> Likelihood:
    """The likelihood of a filter of an experiment's one case over all tracks of a file; of the one that takes the most
    of a plot where none is named. Raises ConfigError."""
    case = one_case(experiment, "fit", f"radarsim fit {{}} {os.fspath(source)}")
    refuse_borrowed(case, "likelihood")
    of = recorded_of(case)
    names = [member.name for member in case.spec.members]
    if filter_name is not None and filter_name not in names:
        raise ConfigError(f"filter: must be one of {', '.join(names)}; got {filter_name}")
    tracks = _tracks(source, of.columns(case.spec), of.from_any_origin)
    long = [columns for columns in tracks if len(columns["t_s"]) >= LEAST_ROWS]
    if not long:
        raise ConfigError(f"{source}: must have a track of at least {LEAST_ROWS} rows")
    if same := [name for name in long[0] if name != "t_s" and all(np.ptp(one[name]) == 0 for one in long)]:
        raise ConfigError(f"{source}: {same[0]}: must differ between plots, or no σ can be told; all are the same")
    found = of.likelihood(case, filter_name, long)
    folding = doppler.folded(case, long)
    if folding and found is not None and doppler.VELOCITY in found.by_number(np.asarray(found.stated)):
        raise ConfigError(f"{source}: {doppler.said(folding, source, case)}")
    if found is None:
        asked = f"filter {filter_name}" if filter_name else f"no filter of {case.name}"
        raise ConfigError(
            f"{asked}: {'has' if filter_name is None else 'has no'} likelihood of recorded plots to fit by: "
            "its kind has no model of the target's motion"
        )
    return found


def _tracks(
    source: str | os.PathLike, choices: Sequence[Sequence[str]], any_origin: bool
) -> list[dict[str, np.ndarray]]:
    """The columns (n,) of each track of a file of plots."""
    parts: dict[str | None, list[dict[str, np.ndarray]]] = {}
    for piece in plots.pieces(source, choices, any_origin=any_origin):
        for own in by_track(piece):
            if own.name != "":
                parts.setdefault(own.name, []).append(own.columns)
    return [{key: np.concatenate([part[key] for part in pieces]) for key in pieces[0]} for pieces in parts.values()]


def fit(
    experiment: Experiment,
    source: str | os.PathLike,
    filter_name: str | None = None,
    robust: bool = False,
    progress: Progress = silent,
) -> Fit:
    """The config's numbers as the plots of a file have them; robust: allowing for outliers. progress is called with the
    number of likelihoods found. Raises ConfigError."""
    return fitted(likelihood_of(experiment, source, filter_name), robust, progress)


def fitted(likelihood: Likelihood, robust: bool = False, progress: Progress = silent) -> Fit:
    """The keys of a likelihood where it is largest, with profile intervals. Raises ConfigError where it is asked to
    allow for outliers and cannot, or the plots have no likelihood whatever the keys."""
    if robust and OUTLIERS not in likelihood.explains:
        raise ConfigError(f"robust: the likelihood of filter {likelihood.filter} cannot allow for outliers")
    search = _Search(likelihood, robust, progress)
    while any(coarse := [search.steps_at_zero(i) for i in range(len(likelihood.keys))]):
        likelihood.least = np.where(coarse, FINER * np.asarray(likelihood.least), likelihood.least)
        search = _Search(likelihood, robust, progress)
    if search.top <= IMPOSSIBLE:
        raise ConfigError(f"filter {likelihood.filter} cannot take the plots: `radarsim track` says at which row")
    share = float(search.natural(search.best)[-1]) if robust else None
    if share is not None and share > 0.99 * MOST_SHARE:
        raise ConfigError("robust: half of the plots would have to be outliers: their errors are of another law (few "
                          "different values?); fit without it")  # fmt: skip
    keys = tuple(search.interval(i) for i in range(len(likelihood.keys)))
    stated = likelihood(np.array(likelihood.stated), 0.0)
    gain = search.top - stated
    return Fit(likelihood.filter, likelihood.tracks, likelihood.rows, keys, share, gain, _beside(search, likelihood))


def _beside(search: "_Search", likelihood: Likelihood) -> tuple[str, float] | None:
    """What explains the plots beside the keys that fit them best, with its value: that which raises the top most, if by
    more than chance does in one recording of twenty."""
    from scipy.stats import chi2

    counted = Counted(likelihood, search.progress, search.evaluations)
    fitted = search.natural(search.best).tolist()
    held = dict(zip((*likelihood.keys, OUTLIERS), fitted, strict=False))
    asked = [what for what in likelihood.explains if what not in held]
    found = [best(counted, [what], {}, held) for what in asked]
    if not found:
        return None
    values, top = max(found, key=lambda one: one[1])
    needed = 0.5 * float(chi2.ppf(0.95 ** (1 / len(found)), 1))
    return next(iter(values.items())) if top > search.top + needed else None


def polished(value: Callable[[np.ndarray], float], at: np.ndarray) -> np.ndarray:
    """The top of a likelihood near one that a simplex has found, by quasi-Newton steps. A simplex compares, and stands
    still where last digits decide: at their root. A difference over STEP is 10⁻⁷ wrong by them, and so is the top."""
    from scipy.optimize import minimize

    def slope(at: np.ndarray) -> np.ndarray:
        return np.array([(value(at - step) - value(at + step)) / (2 * STEP) for step in STEP * np.eye(at.size)])

    def cost(at: np.ndarray) -> float:
        return -value(at)

    bounds = [(x - FIRST_STEP, x + FIRST_STEP) for x in at]
    found = minimize(cost, at, method="L-BFGS-B", jac=slope, bounds=bounds, options={"gtol": CLOSE, "ftol": 0.0})
    return found.x if -found.fun >= value(at) else at


class _Search:
    """The maximum of a likelihood, and its profile along each key. Searched are logarithms of the keys, and the logit
    of the share of outliers."""

    def __init__(self, likelihood: Likelihood, robust: bool, progress: Progress):
        self.likelihood, self.robust, self.progress, self.evaluations = likelihood, robust, progress, 0
        start, self.lowest = np.log(units(likelihood)), np.log(likelihood.least)
        self.highest = start + math.log(REACH)
        if robust:
            start, self.lowest, self.highest = (
                np.append(keys, _logit(share))
                for keys, share in ((start, 0.05), (self.lowest, LEAST_SHARE), (self.highest, MOST_SHARE))
            )
        self.best, self.top = self._climbed(start, None, FIRST_STEP, ROUGH)
        # A second start far away: the likelihood of manoeuvre and plot errors may have two hills.
        for factor in (0.1, 10.0):
            moved = self.best + math.log(factor) * np.append(
                np.ones(len(likelihood.stated)), np.zeros(int(self.robust))
            )
            other, top = self._climbed(moved, None, FIRST_STEP, ROUGH)
            if top > self.top + 1e-6:
                self.best, self.top = other, top
        self.best = polished(self._value, self._climbed(self.best, None, ROUGH, CLOSE)[0])
        self.top = self._value(self.best)
        self.raised = {i: self._raised(i) for i in range(start.size) if self._maybe_zero(i)}

    def natural(self, searched: np.ndarray) -> np.ndarray:
        """The keys, and the share of outliers at the end where they are allowed for: at most MOST_SHARE, for all plots
        as outliers of a tenth of the σ are as likely as none."""
        count = len(self.likelihood.stated)
        keys = np.exp(np.clip(searched[:count], -200, 200))
        keys = np.where(keys <= self.likelihood.least, 0.0, keys)
        share = 1 / (1 + np.exp(-searched[count:]))
        return np.append(keys, np.minimum(share, MOST_SHARE)) if self.robust else keys

    def _value(self, searched: np.ndarray) -> float:
        values = self.natural(searched)
        self.evaluations += 1
        self.progress(self.evaluations)
        count = len(self.likelihood.stated)
        found = self.likelihood(values[:count], float(values[count]) if self.robust else 0.0)
        return found if math.isfinite(found) else IMPOSSIBLE

    def _climbed(self, start: np.ndarray, held: int | None, step: float, close: float) -> tuple[np.ndarray, float]:
        """The top reached from a start, one coordinate held or none, and the logarithm of the likelihood there; with
        first steps of `step`, until the search stands still within `close`, and does so again when it begins anew from
        there: on a plain a simplex may shrink before it has found the way up."""
        from scipy.optimize import minimize

        free = np.array([i for i in range(len(start)) if i != held])
        whole = start.copy()

        def cost(part: np.ndarray) -> float:
            whole[free] = part
            return -self._value(whole)

        if not free.size:
            return start, self._value(start)
        at, top, gain = start[free], IMPOSSIBLE, math.inf
        while gain > close:
            simplex = np.concatenate([at[None], at + step * np.eye(free.size)])
            options: Any = {"initial_simplex": simplex, "xatol": close, "fatol": close / 10, "maxfev": EVALUATIONS}
            found = minimize(cost, at, method="Nelder-Mead", options=options)
            at, top, gain = found.x, -float(found.fun), -float(found.fun) - top
        whole[free] = at
        return whole, top

    def _profile(self, i: int, at: float, near: np.ndarray) -> tuple[float, np.ndarray]:
        """The largest likelihood with key i held at the logarithm `at`, and where that is."""
        start = near.copy()
        start[i] = at
        found = [self._climbed(start, i, FIRST_STEP, CLOSE)]
        if others := {j: log for j, log in self.raised.items() if j != i}:
            start[list(others)] = list(others.values())
            found.append(self._climbed(start, i, FIRST_STEP, CLOSE))
        where, top = max(found, key=lambda one: one[1])
        return top, where

    def steps_at_zero(self, i: int) -> bool:
        """Whether the likelihood leaps where a key is small enough to count as zero: it is not small enough then."""
        above, zero = (self._sliced(i, self.lowest[i] + sign * CLOSE) for sign in (1, -1))
        return zero > IMPOSSIBLE and above > IMPOSSIBLE and abs(above - zero) > LEAP

    def _maybe_zero(self, i: int) -> bool:
        """Whether the plots hardly tell a key, or the share of outliers, from zero: near zero its logarithm is a plain
        without slope, on which a search stands still, though it has to rise where another one is held too low. Asked a
        little above zero: a σ of nothing is no filter's."""
        return self._sliced(i, self.lowest[i] + CLOSE) > self.top - HALF_CHI2_95

    def _raised(self, i: int) -> float:
        """The logarithm of such a key from which a search sees the slope: where the likelihood falls above the top."""
        log = max(float(self.best[i]), float(self.lowest[i]))
        while self._sliced(i, log) > self.top - HALF_CHI2_95 and log < self.highest[i]:
            log += 1.0
        return log

    def _sliced(self, i: int, log: float) -> float:
        """The likelihood with one key changed and all others at the top."""
        at = self.best.copy()
        at[i] = log
        return self._value(at)

    def interval(self, i: int) -> Fitted:
        """The 95 % profile interval of key i."""
        limit = self.top - HALF_CHI2_95
        lo, hi = (self._end(i, direction, limit) for direction in (-1, 1))
        value = float(self.natural(self.best)[i])
        least = self.lowest[i]
        ends = (0.0 if lo is None or lo <= least else math.exp(lo), math.inf if hi is None else math.exp(hi))
        stated = float(self.likelihood.stated[i])
        return Fitted(self.likelihood.keys[i], stated, value, *ends, ends[0] > 0 and math.isfinite(ends[1]))

    def _end(self, i: int, direction: int, limit: float) -> float | None:
        """The logarithm of key i at which the profile falls to a limit; None where it does not within REACH."""
        from scipy.optimize import brentq

        least = float(self.lowest[i])
        near, step = self.best, 0.1
        home = inside = max(float(self.best[i]), least)
        if direction > 0 and i in self.raised:  # from zero the end may be farther than REACH: up to there it is not
            home = inside = max(inside, self.raised[i] - 1.0)
        while abs(inside - home) < math.log(REACH):
            outside = inside + direction * step
            top, found = self._profile(i, outside, near)
            if top < limit:
                start = near

                def above(at: float, start: np.ndarray = start) -> float:
                    return self._profile(i, at, start)[0] - limit

                return float(brentq(above, min(inside, outside), max(inside, outside), xtol=CLOSE))
            if outside < least:
                return None
            near, inside, step = found, outside, 2 * step
        return None


def _logit(share: float) -> float:
    return math.log(share / (1 - share))


def settings(found: Fit) -> dict[str, float]:
    """What to write into the config, by key, to four digits; keys that the plots do not tell stay as they are."""
    return {one.key: float(f"{one.value:.4g}") for one in found.keys if one.identifiable}


def as_json(found: Fit) -> list[dict[str, object]]:
    """The keys as `fit --json` prints them; an interval without an upper end has none there."""
    return [
        {
            "key": one.key,
            "value": one.value,
            "lo": one.lo,
            "hi": one.hi if math.isfinite(one.hi) else None,
            "identifiable": one.identifiable,
        }
        for one in found.keys
    ]

"""Errors in the config's numbers, if any, by the likelihood along each of them.

Each explanation alone (a σ, the manoeuvre variance, a bias of the velocity, outliers, errors correlated from plot to
plot) is fitted to the plots. The one that raises the likelihood most is named, if it raises it by more than chance does
in one recording of twenty, over all explanations; then the search continues with it included. A recording with correct
numbers yields: nothing wrong.

The filter used is the one that takes most columns of a plot. One that takes fewer says nothing about the rest, and may
predict the ranges best just because the velocities are bad.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from radarsim.config.experiment import Case
from radarsim.recorded.fit import (
    HALF_CHI2_95,
    LEAST_ROWS,
    Along,
    Counted,
    Folding,
    Progress,
    best,
    climbed,
    folded,
    polished,
    silent,
    some,
    value,
)
from radarsim.recorded.follow import Followed, borrowed, recorded_of
from radarsim.studies.interface import Likelihood, Turning

LEVEL = 0.05  # of a false finding
MOST_FOUND = 3


@dataclass(frozen=True)
class Finding:
    """One explanation: the key (or one of EXPLANATIONS), its value (a share; a bias in σ; a correlation), and the
    increase of the log-likelihood over the findings before.

    from_zero: whether the plots distinguish a key's value from zero. turning: the cost of a smaller manoeuvre variance.
    """

    what: str
    value: float
    gain: float
    from_zero: bool = True
    turning: Turning | None = None


@dataclass(frozen=True)
class Compared:
    """By how much the best filter predicts the plots better than each other: differences of the log-likelihood of the
    numbers that all of them take. fullest: the best predictor among those that take most columns of a plot."""

    best: str
    behind: dict[str, float]
    fullest: str


@dataclass(frozen=True)
class Asked:
    """The rows used: so many altogether, of so many stretches of rows, spread over all tracks and the whole time."""

    rows: int
    stretches: int


@dataclass(frozen=True)
class Advice:
    """Advice from the likelihood of a config's filters over recorded plots: the best filter; the errors in the numbers
    of the one that takes most columns; the rows used. folding: where the velocities are folded, and nothing else is
    examined."""

    compared: Compared
    findings: list[Finding]
    asked: Asked
    folding: Folding | None = None


def advised(followed: Followed, progress: Progress = silent) -> Advice | None:
    """Advice from rows of all tracks over the whole time; none where the study has no likelihood of recorded plots.
    progress is called with the number of likelihoods computed."""
    case, of = followed.case, recorded_of(followed.case)
    every = list(followed.tracks.values()) or [followed]
    long = [part for one in every for part in one.sample.stretches() if len(part["t_s"]) >= LEAST_ROWS]
    if not long or borrowed(case, "likelihood"):
        return None
    chosen = some(long, of.rows_asked)
    known = {one.filter: one for member in case.spec.members if (one := of.likelihood(case, member.name, chosen))}
    if not known:
        return None
    found = compared(list(known.values()))
    asked = Asked(sum(len(part["t_s"]) for part in chosen), len(chosen))
    if (folding := folded(case, long)) is not None:
        return Advice(found, [], asked, folding)
    one = known[found.fullest]
    return Advice(found, [_judged(case, one, each) for each in findings(one, progress)], asked)


def _judged(case: Case, likelihood: Likelihood, found: Finding) -> Finding:
    """A finding with the cost of a smaller manoeuvre variance."""
    stated = dict(zip(likelihood.keys, likelihood.stated.tolist(), strict=True))
    if found.value >= stated.get(found.what, -np.inf):
        return found
    turning = recorded_of(case).in_a_turn(case, likelihood.filter, {found.what: found.value})
    return replace(found, turning=turning)


def findings(likelihood: Likelihood, progress: Progress = silent) -> list[Finding]:
    """Errors in the stated numbers, the weightiest first; empty where nothing is wrong."""
    from scipy.stats import chi2

    of, whats = Counted(likelihood, progress), [*likelihood.keys, *likelihood.explains]
    needed = 0.5 * float(chi2.ppf(1 - LEVEL / len(whats), 1))
    chosen: list[str] = []
    start: dict[str, float] = {}
    reached, found = value(of, {}), []
    while len(chosen) < min(MOST_FOUND, len(whats)):
        trials = {what: best(of, [*chosen, what], start) for what in whats if what not in chosen}
        what = max(trials, key=lambda name: trials[name][1])
        values, top = trials[what]
        if top - reached < needed:
            break
        values, top = _exactly(of, values)
        found.append(Finding(what, values[what], top - reached))
        chosen, start, reached = [*chosen, what], values, top
    return [replace(one, value=start[one.what], from_zero=_from_zero(of, one.what, start, reached)) for one in found]


def _from_zero(likelihood: Counted, what: str, found: dict[str, float], top: float) -> bool:
    """Whether the plots distinguish a key from zero, whatever the other keys are: tested where it is smaller than
    stated."""
    stated = dict(zip(likelihood.keys, likelihood.stated.tolist(), strict=True))
    if what not in stated or found[what] >= stated[what]:
        return True
    others = {one: value for one, value in (stated | found).items() if one != what}
    # An interval ends where it first leaves the maximum: in x and y a needle of σ = 0 across and kilometres along,
    # which turns with each measured bearing, explains errors across too.
    smaller = (float(likelihood.of.least[likelihood.keys.index(what)]), found[what] / 2)
    return any(climbed(Along(likelihood, list(others), {what: at}), others)[1] < top - HALF_CHI2_95 for at in smaller)


def compared(likelihoods: Sequence[Likelihood]) -> Compared:
    """Which filter predicts the plots best, with the stated numbers."""
    sums = {one.filter: one.by_number(np.asarray(one.stated)) for one in likelihoods}
    common = set.intersection(*(set(parts) for parts in sums.values()))
    totals = {name: sum(parts[number] for number in common) for name, parts in sums.items()}
    best = max(totals, key=lambda name: totals[name])
    most = max(len(parts) for parts in sums.values())
    full = {name: sum(parts.values()) for name, parts in sums.items() if len(parts) == most}
    return Compared(
        best, {name: totals[best] - total for name, total in totals.items()}, max(full, key=full.__getitem__)
    )


def _exactly(likelihood: Counted, near: dict[str, float]) -> tuple[dict[str, float], float]:
    """The maximum near roughly found values: printed numbers must not depend on a processor's last digits."""
    along = Along(likelihood, list(near))
    at = polished(along, along.searched(near))
    return along.natural(at), along(at)

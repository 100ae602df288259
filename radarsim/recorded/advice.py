"""What is wrong with the config's numbers, if anything is, from the likelihood along each of them.

Each explanation alone (a σ, the manoeuvre variance, a bias of the velocity, outliers, errors that last from plot to
plot) is fitted to the plots. The one that raises the likelihood most is named, if it raises it more than chance does in
one recording of twenty, all explanations together; then the search goes on beside it. What a recording with sound
numbers says is: nothing wrong.

Asked is the filter that takes most of a plot. One that takes less of it has nothing to say of the rest, and may predict
the ranges best for the very reason that the velocities are bad.
"""

from collections.abc import Mapping, Sequence
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
    value,
)
from radarsim.recorded.follow import Followed, borrowed, recorded_of
from radarsim.studies.interface import Likelihood, Turning

LEVEL = 0.05  # of finding something where nothing is wrong
MOST_FOUND = 3


@dataclass(frozen=True)
class Finding:
    """One explanation: the key (or one of EXPLANATIONS), its value (a share; a bias in σ; a correlation), and the gain
    of the logarithm of the likelihood over what was found before.

    from_zero: whether the plots tell a key's value from zero. turning: what a smaller manoeuvre variance would cost.
    """

    what: str
    value: float
    gain: float
    from_zero: bool = True
    turning: Turning | None = None


@dataclass(frozen=True)
class Compared:
    """How much better than each filter the best one predicts the plots: differences of the logarithm of the likelihood
    of the numbers that all of them take. fullest: the one that predicts best among those that take most of a plot."""

    best: str
    behind: dict[str, float]
    fullest: str


@dataclass(frozen=True)
class Asked:
    """Which rows were asked: so many altogether, the first `each` of so many tracks (None where the file has one)."""

    rows: int
    each: int
    tracks: int | None


@dataclass(frozen=True)
class Advice:
    """What the likelihood says of a config's filters over recorded plots: which is best; what is wrong with the numbers
    of the one that takes most of a plot; of which rows. folding: where the velocities are folded, and nothing else is
    looked for."""

    compared: Compared
    findings: list[Finding]
    asked: Asked
    folding: Folding | None = None


def advised(followed: Followed, progress: Progress = silent) -> Advice | None:
    """Advice from the first rows of each track; none where the study has no likelihood of recorded plots. progress is
    called with the number of likelihoods found."""
    case, of = followed.case, recorded_of(followed.case)
    heads = [one.head for one in followed.tracks.values()] or [followed.head]
    long = [head for head in heads if len(head["t_s"]) >= LEAST_ROWS]
    if not long or borrowed(case, "likelihood"):
        return None
    chosen = some(long, of.rows_asked)
    known = {one.filter: one for member in case.spec.members if (one := of.likelihood(case, member.name, chosen))}
    if not known:
        return None
    found = compared(list(known.values()))
    rows = sum(len(head["t_s"]) for head in chosen)
    asked = Asked(rows, max(len(head["t_s"]) for head in chosen), len(chosen) if followed.tracks else None)
    if (folding := folded(case, long)) is not None:
        return Advice(found, [], asked, folding)
    one = known[found.fullest]
    return Advice(found, [_judged(case, one, each) for each in findings(one, progress)], asked)


def _judged(case: Case, likelihood: Likelihood, found: Finding) -> Finding:
    """A finding with what a smaller manoeuvre variance would cost."""
    stated = dict(zip(likelihood.keys, likelihood.stated.tolist(), strict=True))
    if found.value >= stated.get(found.what, -np.inf):
        return found
    turning = recorded_of(case).in_a_turn(case, likelihood.filter, {found.what: found.value})
    return replace(found, turning=turning)


def some(heads: Sequence[Mapping[str, np.ndarray]], most: int) -> list[Mapping[str, np.ndarray]]:
    """The beginnings of tracks, columns (n,) each, up to `most` rows altogether; as many tracks as possible."""
    share = max(most // len(heads), LEAST_ROWS)
    chosen = heads[: max(most // share, 1)]
    return [{name: column[:share] for name, column in head.items()} for head in chosen]


def findings(likelihood: Likelihood, progress: Progress = silent) -> list[Finding]:
    """What is wrong with the stated numbers, the weightiest first; empty where nothing is."""
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
    """Whether the plots tell a key from zero, whatever the other keys are: asked of one that is smaller than stated."""
    stated = dict(zip(likelihood.keys, likelihood.stated.tolist(), strict=True))
    if what not in stated or found[what] >= stated[what]:
        return True
    zero = {what: float(likelihood.of.least[likelihood.keys.index(what)])}
    others = {one: value for one, value in (stated | found).items() if one != what}
    return climbed(Along(likelihood, list(others), zero), others)[1] < top - HALF_CHI2_95


def compared(likelihoods: Sequence[Likelihood]) -> Compared:
    """Which filter predicts the plots best, as stated."""
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
    """The top near values that were found roughly: what is printed must not hang on a processor's last digits."""
    along = Along(likelihood, list(near))
    at = polished(along, along.searched(near))
    return along.natural(at), along(at)

"""What is compared: cases of stored results, and which answers to which."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

from radarsim.language import term

if TYPE_CHECKING:
    import pandas as pd


class Series(NamedTuple):
    """A measured quantity of a stored table: its columns, that of exact values; whether it is compared in per cent."""

    table: str
    value: str
    lo: str
    hi: str
    exact: str
    words: str
    unit: str
    ratio: bool


SERIES = (
    Series("curves", "sigma", "sigma_lo", "sigma_hi", "exact_sigma", "σ", "", True),
    Series("gains", "gain_percent", "gain_lo", "gain_hi", "exact_percent", "gain", "%", False),
    Series("locks", "lock_rate", "lock_lo", "lock_hi", "", term("rate of locks"), "", False),
    Series("probabilities", "probability", "probability_lo", "probability_hi", "", "probability", "", False),
)
LABELS = ("filter", "component", "model")  # that say which line a row is of; the time says where on it


@dataclass(frozen=True)
class Side:
    """One case of one stored result.

    label is what it is called here; noise what its random numbers and its world depend on, None where that is not
    known; count its realisations; tables its rows of the stored tables, by name.
    """

    run: str
    case: str
    label: str
    noise: str | None
    count: int
    tables: "Mapping[str, pd.DataFrame]" = field(repr=False)

    def rest(self) -> str:
        """The name of the case without its config's: the swept keys."""
        return self.case.partition(" ")[2]


class Pair(NamedTuple):
    """A side, and the one that it is compared with."""

    side: Side
    against: Side

    @property
    def common_noise(self) -> bool:
        """Whether both are of the same measurements: study, seed, target and sensor, and as many realisations."""
        return self.side.noise is not None and self.side.noise == self.against.noise


def pairs(runs: Sequence[Sequence[Side]]) -> tuple[list[Pair], list[str]]:
    """Each further run's cases against those of the first, and a line for each case that none answers to.

    A run of a single case is set beside every case of the other one; else cases of the same swept values, or the same
    name, answer to one another.
    """
    first, found, alone = runs[0], [], []
    for run in runs[1:]:
        own = [Pair(side, other) for side in run for other in first if min(len(run), len(first)) == 1]
        if not own:
            named = {other.case: other for other in first} | {other.rest(): other for other in first if other.rest()}
            answering = {side.label: named.get(side.rest() or side.case) for side in run}
            own = [Pair(side, other) for side in run if (other := answering[side.label]) is not None]
            alone += [f"{label}: no such case in {first[0].run}" for label, other in answering.items() if other is None]
        found += own
    return found, alone

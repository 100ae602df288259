"""Sides of a comparison, cases of stored results, and which are partners."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

from radarsim.report.quantities import COMMON, Quantity

if TYPE_CHECKING:
    import pandas as pd


LABELS = ("filter", "component", "model")  # that identify the line of a row; the time identifies its point


@dataclass(frozen=True)
class Side:
    """One case of one stored result.

    label: its name here; noise: a hash of all that its measurements depend on, None where unknown; count: its
    realisations; tables: its rows of the stored tables, by name; measured: the quantities of its study."""

    run: str
    case: str
    label: str
    noise: str | None
    count: int
    tables: "Mapping[str, pd.DataFrame]" = field(repr=False)
    measured: tuple[Quantity, ...] = COMMON

    def swept_keys(self) -> str:
        """The name of the case without its config's: the swept keys."""
        return self.case.partition(" ")[2]


class Pair(NamedTuple):
    """A side, and the one it is compared with."""

    side: Side
    reference: Side

    @property
    def common_noise(self) -> bool:
        """Whether both use the same measurements: study, seed, target and sensor, and as many realisations."""
        return self.side.noise is not None and self.side.noise == self.reference.noise


def pairs(runs: Sequence[Sequence[Side]]) -> tuple[list[Pair], list[str]]:
    """Each further run's cases against those of the first, and a line for each case without a partner.

    A run of a single case is compared with every case of the other; else cases with the same swept values, or the same
    name, are partners."""
    first, matched, unmatched = runs[0], list[Pair](), list[str]()
    by_name = {side.case: side for side in first} | {side.swept_keys(): side for side in first if side.swept_keys()}
    for run in runs[1:]:
        if min(len(run), len(first)) == 1:
            matched += [Pair(side, against) for side in run for against in first]
            continue
        partners = [(side, by_name.get(side.swept_keys() or side.case)) for side in run]
        matched += [Pair(side, against) for side, against in partners if against is not None]
        unmatched += [f"{side.label}: no such case in {first[0].run}" for side, against in partners if against is None]
    return matched, unmatched

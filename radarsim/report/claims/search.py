"""The joint search: which readings of a paper give most of the numbers that it prints.

Every number is computed under every combination of the choices' values. A number comes out under the strict rule if it
rounds to what is printed, and under the granular one if it is as near as the print's own steps allow.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from radarsim.language import term, tr

TO_THE_DIGIT = term("to the printed digit {count} of {of} come out as shipped")
TO_THE_STEPS = term("to the steps of the print {count} of {of} come out as shipped")


@dataclass(frozen=True)
class Printed:
    """A number that a paper prints: the claim that it belongs to, what it is, and the values that count as it."""

    claim: str
    what: str
    unit: str
    printed: str
    strict: tuple[float, float]
    granular: tuple[float, float]


@dataclass(frozen=True)
class Fine:
    """The strict rule on a finer grid of one choice, all others as shipped: values (m) and strict (n, m)."""

    values: Sequence[float]
    strict: np.ndarray


@dataclass(frozen=True)
class Search:
    """Printed numbers (n) under all combinations of the values of some choices.

    axes: key of a choice → its values, the shipped one given by `shipped`. strict and granular (n, *lengths of axes)
    say whether a number comes out, `values` what it is. fine: for choices whose values are numbers without steps.
    read_as says in words what strict and granular are.
    """

    paper: str
    printed: Sequence[Printed]
    axes: Mapping[str, Sequence[str]]
    shipped: Mapping[str, str]
    strict: np.ndarray
    granular: np.ndarray
    values: np.ndarray
    fine: Mapping[str, Fine] = field(default_factory=dict)
    read_as: str = ""

    @property
    def readings(self) -> int:
        """How many combinations there are."""
        return int(self.strict[0].size)

    @cached_property
    def place(self) -> tuple[int, ...]:
        """Where the shipped combination stands."""
        return tuple(list(values).index(self.shipped[key]) for key, values in self.axes.items())

    def count(self, granular: bool) -> np.ndarray:
        """How many printed numbers come out, at every combination."""
        return (self.granular if granular else self.strict).sum(axis=0)

    def best(self, granular: bool) -> tuple[int, ...]:
        """That with most of them; of several that with most under the other rule, then nearest the shipped."""
        own, other = self.count(granular), self.count(not granular)
        score = own.astype(np.int64) * (len(self.printed) + 1) + other
        tied = np.argwhere(score == score.max())
        changed = (tied != np.array(self.place)).sum(axis=1)
        return tuple(int(i) for i in tied[np.argmin(changed)])

    def taken(self, place: tuple[int, ...]) -> dict[str, str]:
        """The values of the choices at a combination."""
        return {key: values[i] for (key, values), i in zip(self.axes.items(), place, strict=True)}

    def measured(self, place: tuple[int, ...]) -> np.ndarray:
        """The numbers (n,) at a combination."""
        return np.moveaxis(self.values, 0, -1)[place]

    def sentence(self) -> str:
        """What the search comes to."""
        of, place = len(self.printed), self.place
        parts = []
        for granular, rule in ((False, TO_THE_DIGIT), (True, TO_THE_STEPS)):
            count = self.count(granular)
            best = int(count.max())
            own = int(count[place])
            words = tr(rule, count=own, of=of)
            if best > own:
                words += tr(", {count} with {name}", count=best, name=self.words(self.best(granular)))
            else:
                words += tr(", and no reading gives more")
            parts.append(words)
        return tr("{count:,} readings: {said}.", count=self.readings, said="; ".join(parts))

    def words(self, place: tuple[int, ...]) -> str:
        """What a combination takes otherwise than shipped."""
        other = [f"{key}: {value}" for key, value in self.taken(place).items() if value != self.shipped[key]]
        return "; ".join(other) or tr("as shipped")

    def windows(self, key: str) -> list[str]:
        """The values of one choice, all others as shipped, at which each number comes out to the printed digit."""
        if key in self.fine:
            fine = self.fine[key]
            return [_intervals(fine.values, row) for row in fine.strict]
        axis = list(self.axes).index(key)
        place: list[int | slice] = list(self.place)
        place[axis] = slice(None)
        values = self.axes[key]
        rows = self.strict[(slice(None), *place)]
        return [_listed(values, row) for row in rows]


def _intervals(values: Sequence[float], held: np.ndarray) -> str:
    """Runs of a grid at which something holds: `0.00083 … 0.001`."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], held.astype(int), [0]])))
    runs = [(values[a], values[b - 1]) for a, b in zip(edges[::2], edges[1::2], strict=True)]
    return ", ".join(f"{a:.3g}" if a == b else f"{a:.3g} … {b:.3g}" for a, b in runs) or "none"


def _listed(values: Sequence[str], held: np.ndarray) -> str:
    if held.all():
        return "all"
    try:
        return _intervals([float(value) for value in values], held)
    except ValueError:
        return ", ".join(value for value, holds in zip(values, held, strict=True) if holds) or "none"

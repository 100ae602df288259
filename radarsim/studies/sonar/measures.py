"""How P3's claims find the cases that they mean, by what these are, and the filters in them."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from radarsim.engine.results import CaseResult
from radarsim.report import claims
from radarsim.report.claims import Missing
from radarsim.report.statistics import Estimate


@dataclass(frozen=True)
class CaseKey:
    """A case that claims mean: its name in words, and how it is found among results, None where it is not there."""

    name: str
    find: Callable[[Sequence[CaseResult]], CaseResult | None]

    def __str__(self) -> str:
        return self.name


class Evidence(claims.Evidence):
    """Finds the cases of P3 by their keys."""

    def case(self, key: CaseKey) -> CaseResult:
        """The case that a key means; raises Missing."""
        found = key.find(self.results)
        if found is None:
            raise Missing(key)
        return found

    def filter(self, key: CaseKey, kind: str, degree: int = 1, plots: int | None = None) -> str:
        """The name of a case's first filter of that kind, without process noise; raises Missing."""
        for _, f in self.members(self.case(key)):
            if (f.kind, f.degree) == (kind, degree) and f.plots == plots and not f.manoeuvre_variance:
                return f.name
        raise Missing((key, kind))

    def index(self, key: CaseKey, name: str) -> int:
        """Place of a filter in the sums."""
        return self.case(key).axes.filters.index(name)


Measure = Callable[[Evidence], Estimate]

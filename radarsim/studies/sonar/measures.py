"""How P3's claims find the cases that they mean, by what these are, and the filters in them."""

from collections.abc import Callable

from radarsim.engine.results import CaseResult
from radarsim.report import claims
from radarsim.report.claims import Missing

Key = str | tuple[str, float]  # a case that claims mean, by name, or by name and a value
Find = Callable[..., CaseResult | None]  # of the results, and of the value where the key has one
FOUND: dict[str, Find] = {}  # by name, None where it is not there; the parts' measures say how


class Evidence(claims.Evidence):
    """Finds the cases of P3 by their keys."""

    def case(self, key: Key) -> CaseResult:
        """The case that a key means; raises Missing."""
        name, *value = (key,) if isinstance(key, str) else key
        found = FOUND[str(name)](self.results, *value)
        if found is None:
            raise Missing((key,))
        return found

    def filter(self, key: Key, kind: str, degree: int = 1, plots: int | None = None) -> str:
        """The name of a case's first filter of that kind, without process noise; raises Missing."""
        for _, f in self.members(self.case(key)):
            if (f.kind, f.degree) == (kind, degree) and f.plots == plots and not f.manoeuvre_variance:
                return f.name
        raise Missing((key, kind))

    def index(self, key: Key, name: str) -> int:
        """Place of a filter in the sums."""
        return self.case(key).axes.filters.index(name)

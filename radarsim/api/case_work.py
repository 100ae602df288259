"""A case as the engine sees it: its identity, its block length and its sums."""

import os
from collections.abc import Iterator
from functools import cached_property
from typing import TYPE_CHECKING, Any

from radarsim.config.experiment import Case
from radarsim.errors import ConfigError
from radarsim.studies.interface import Plan
from radarsim.studies.registry import study

if TYPE_CHECKING:
    import numpy as np


NON_FINITE_REASONS = {  # by the name of the sums
    "error": "not finite",
    "believed": "with a covariance that is not positive and finite",
}
MAX_EXPLAINED = 20  # pairs of filter and scan, for each of the sums


class CaseWork:
    """A case as the engine sees it: identity, block length and sums. Pickles as the case alone."""

    def __init__(self, case: Case):
        self.case = case

    def __reduce__(self) -> tuple[type["CaseWork"], tuple[Case]]:
        return CaseWork, (self.case,)

    @cached_property
    def plan(self) -> Plan:
        """The prepared plan, made when first needed."""
        if os.environ.get("NUMBA_DISABLE_JIT", "0") not in ("", "0"):
            raise ConfigError("NUMBA_DISABLE_JIT is set: without the compiler no block is simulated; unset it")
        return study(self.case.study).prepare(self.case)

    @cached_property
    def plans(self) -> tuple[Plan, ...]:
        """The plans of the case, of each further baseline and of the user's filters; their sums are concatenated."""
        case_study = study(self.case.study)
        plans = (self.plan, *(case_study.prepare(companion) for companion in self.case.companions))
        if not self.case.user_filters:
            return plans
        from radarsim.studies.user_filters import sums

        return (*plans, sums.prepare(case_study, self.case, self.plan))

    @cached_property
    def identity(self) -> str:
        """See `radarsim.studies.identity`."""
        from radarsim.studies.identity import identity

        return identity(self.case)

    @property
    def block(self) -> int:
        """Realisations in a block; depends on the study only."""
        return self.plan.block

    @property
    def size(self) -> int:
        """Length of the vector of sums."""
        return sum(plan.layout.size for plan in self.plans)

    def simulate(self, first: int, count: int) -> "np.ndarray":
        """Sums (size,) over realisations first … first + count - 1."""
        import numpy as np

        study_plans = self.plans[:-1] if self.case.user_filters else self.plans
        sums = [study(self.case.study).simulate(plan, first, count) for plan in study_plans]
        if self.case.user_filters:
            from radarsim.studies.user_filters import sums as user_filters_sums

            user_plan: Any = self.plans[-1]
            sums.append(user_filters_sums.simulate(user_plan, first, count))
        return sums[0] if len(sums) == 1 else np.concatenate(sums)

    def unpack(self, values: "np.ndarray") -> "Iterator[dict[str, np.ndarray]]":
        """The named sums of each plan, from the vector of all sums (size,)."""
        for plan in self.plans:
            yield plan.layout.unpack(values)
            values = values[plan.layout.size :]

    def explain(self, first: int, count: int) -> list[str]:
        """Lines that say at which filter and scan the sums of these realisations are not finite, and in how many."""
        import numpy as np  # `radarsim list` does without it

        axes, layout = self.plan.axes, self.plan.layout
        shape = len(axes.filters), len(axes.k)
        names = [name for name in NON_FINITE_REASONS if layout.shapes.get(name, ())[:2] == shape]
        counts = {name: np.zeros(shape, dtype=int) for name in names}
        for i in range(first, first + count):
            sums = layout.unpack(self.simulate(i, 1))
            for name in names:
                counts[name] += ~np.isfinite(sums[name]).reshape(*shape, -1).all(axis=2)
        return [
            f"{self.case.name}: filter {axes.filters[f]!r}, scan {axes.k[k]}: "
            f"{counts[name][f, k]} of {count} realisations {NON_FINITE_REASONS[name]}"
            for name in names
            for f, k in np.argwhere(counts[name])[:MAX_EXPLAINED]
        ]

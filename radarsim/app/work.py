"""A case as the engine sees it."""

import os
from functools import cached_property

import numpy as np

from radarsim.config.experiment import Case
from radarsim.errors import ConfigError
from radarsim.studies.identity import identity
from radarsim.studies.interface import Plan
from radarsim.studies.registry import study


class CaseWork:
    """A case as the engine sees it: an identity, a block length, and sums to be made. Pickles as the case alone."""

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
    def identity(self) -> str:
        """See `radarsim.studies.identity`."""
        return identity(self.case)

    @property
    def block(self) -> int:
        """Realisations in a block; depends on the study only."""
        return self.plan.block

    @property
    def size(self) -> int:
        """Length of the vector of sums."""
        return self.plan.layout.size

    def simulate(self, first: int, count: int) -> np.ndarray:
        """Sums (size,) over realisations first … first + count - 1."""
        return study(self.case.study).simulate(self.plan, first, count)

    def explain(self, first: int, count: int) -> list[str]:
        """Where the sums of these realisations are not finite, one line a filter, scan and number of realisations."""
        axes, layout = self.plan.axes, self.plan.layout
        bad = np.zeros((len(axes.filters), len(axes.k)), dtype=int)
        for i in range(first, first + count):
            error = layout.unpack(self.simulate(i, 1))["error"]
            bad += ~np.isfinite(error).all(axis=(2, 3))
        return [
            f"{self.case.name}: filter {axes.filters[f]!r}, scan {axes.k[k]}: "
            f"{bad[f, k]} of {count} realisations not finite"
            for f, k in np.argwhere(bad)[:20]
        ]

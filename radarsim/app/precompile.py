"""Compiling before the first run: what `radarsim compile` does."""

import time
from collections.abc import Iterator, Sequence
from typing import NamedTuple

from radarsim.app.configs import load, lookup
from radarsim.app.work import CaseWork
from radarsim.errors import ConfigError


class Compiled(NamedTuple):
    """What the kernels of a config took: CPU seconds, next to nothing where their machine code was kept."""

    config: str
    seconds: float


def compiled(configs: Sequence[str]) -> Iterator[Compiled]:
    """Compile the kernels of configs, of all shipped ones where none is named, and keep their machine code.

    A realisation of each case is simulated and forgotten. Raises ConfigError where the machine code cannot be kept.
    """
    from radarsim.kernels import cache

    for name in configs or lookup.stems("configs"):
        started = time.process_time()
        for case in load(name).cases:
            CaseWork(case).simulate(0, 1)
            if "write" in cache.troubles:
                raise ConfigError(cache.troubles["write"])
        yield Compiled(name, time.process_time() - started)

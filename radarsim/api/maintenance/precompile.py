"""`radarsim compile`: all kernels of configs compiled now."""

import time
from collections.abc import Iterator, Sequence
from typing import NamedTuple

from radarsim.api.case_work import CaseWork
from radarsim.api.configs import config_stems, load
from radarsim.errors import ConfigError


class CompiledConfig(NamedTuple):
    """Compilation of a config's kernels: CPU seconds, almost none where machine code was cached."""

    config: str
    seconds: float


def compile_configs(configs: Sequence[str]) -> Iterator[CompiledConfig]:
    """Compile the kernels of configs (default: all shipped ones) and cache their machine code. One realisation of each
    case is simulated and discarded. Raises ConfigError where the machine code cannot be cached."""
    from radarsim.kernels.cache import troubles

    for name in configs or config_stems():
        started = time.process_time()
        for case in load(name).cases:
            CaseWork(case).simulate(0, 1)
            if lines := [troubles[kind] for kind in ("write", "compiler") if kind in troubles]:
                raise ConfigError(*lines)
        yield CompiledConfig(name, time.process_time() - started)

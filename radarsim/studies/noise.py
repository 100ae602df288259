"""The names of noise streams."""

import numpy as np

from radarsim.config.experiment import Case
from radarsim.config.identity import digest, world_keys


def noise_key(case: Case, stream_name: str) -> np.ndarray:
    """The key (2,) of a named noise stream of a case: the same for cases that differ only in their filters."""
    from radarsim.kernels.random import stream  # loads the compiler, which `radarsim list` does without

    keyed_by = case.spec if case.noise_keys is None else case.noise_keys
    return stream(case.seed, f"{case.study}:{stream_name}:{digest(world_keys(keyed_by))}")

"""The names of noise streams."""

import numpy as np

from radarsim.config.experiment import Case, digest, world


def noise_key(case: Case, what: str) -> np.ndarray:
    """Key (2,) of the noise stream `what` of a case: the same for cases that differ only in their filters."""
    from radarsim.kernels.random import stream  # loads the compiler, which `radarsim list` does without

    keyed_by = case.spec if case.noise_of is None else case.noise_of
    return stream(case.seed, f"{case.study}:{what}:{digest(world(keyed_by))}")

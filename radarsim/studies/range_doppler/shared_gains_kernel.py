"""The kernel and its problem for a case in the paper's world, in which all realisations share the gains.

Imported only to simulate: it loads the compiler."""

import numpy as np

from radarsim.config.experiment import Case
from radarsim.kernels import second_order as kernel
from radarsim.studies.noise import noise_key
from radarsim.studies.range_doppler.designed_case import DesignedCase


def problem(case: Case, design: DesignedCase, baseline: int) -> kernel.Problem:
    """What is simulated, as the kernel takes it."""
    longest = max(d.start for d in design.filters)
    problem = kernel.Problem(
        key=noise_key(case, "plots"),
        truth=design.x,
        sigma=design.plots.sigma,
        dt=design.dt,
        observes=design.observes,
        start=np.array([d.start for d in design.filters]),
        weights=np.stack([np.pad(d.weights, ((0, 0), (0, 0), (0, longest - d.start))) for d in design.filters]),
        gains=np.stack([d.gains for d in design.filters]),
        baseline=baseline,
    )
    return problem.plain()

"""The kernel and its problem for a case outside the paper's world, in which each realisation has gains of its own.

Imported only to simulate: it loads the compiler."""

import numpy as np

from radarsim.config.experiment import Case
from radarsim.kernels.kalman_algebra import pack
from radarsim.studies.noise import noise_key
from radarsim.studies.range_doppler import scenario
from radarsim.studies.range_doppler.designed_case import DesignedCase
from radarsim.studies.range_doppler.kernels import missed_block as kernel


def problem(case: Case, design: DesignedCase, baseline: int) -> kernel.Problem:
    """What is simulated, as the kernel takes it."""
    problem = kernel.Problem(
        keys=np.stack([noise_key(case, stream) for stream in ("plots", "misses", "drawn")]),
        truth=design.x,
        sigma=design.plots.sigma,
        bias=design.plots.bias,
        sigma_bias=design.plots.sigma_bias,
        sigma_flight=scenario.sigma_flight(design.spec.target),
        flight=scenario.flight(design.spec.target, design.t),
        detection=design.plots.detection,
        dt=design.dt,
        observes=design.observes,
        start=np.array([d.start for d in design.filters]),
        Q=np.array([d.noise for d in design.filters]),
        baseline=baseline,
        has_given_gains=np.array([d.has_given_gains for d in design.filters]),
        gains=np.stack([d.gains for d in design.filters]),
        believed=np.stack(pack(np.stack([d.believed for d in design.filters])), axis=-1),
    )
    return problem.plain()

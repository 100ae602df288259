"""The kernel's problem of a case outside the paper's world, in which each realisation has gains of its own.

Imported only to simulate: it loads the compiler."""

import numpy as np

from radarsim.config.experiment import Case
from radarsim.engine.sums import Layout
from radarsim.kernels.kalman_algebra import pack
from radarsim.studies.noise import noise_key
from radarsim.studies.range_doppler import scenario
from radarsim.studies.range_doppler.designed_case import DesignedCase
from radarsim.studies.range_doppler.kernels import missed_block


def problem(case: Case, design: DesignedCase, baseline: int) -> missed_block.Problem:
    """What is simulated, as the kernel takes it."""
    problem = missed_block.Problem(
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


def layout(design: DesignedCase) -> Layout:
    """The arrays of the sums, and their shapes."""
    return Layout(**missed_block.shapes(len(design.filters), len(design.t)))


def errors(problem: missed_block.Problem, first: int, count: int) -> np.ndarray:
    """The errors (F, count, K, 3) of the realisations of a block; NaN where a filter has no estimate."""
    return missed_block.errors(problem, first, count)


def sums(problem: missed_block.Problem, layout_of_sums: Layout, first: int, count: int) -> np.ndarray:
    """Sums (size,) of one block, in the order of the layout."""
    block_sums = missed_block.Sums(**{name: np.zeros(shape) for name, shape in layout_of_sums.shapes.items()})
    missed_block.simulate_block(problem, first, count, block_sums)
    return layout_of_sums.pack(**block_sums._asdict())

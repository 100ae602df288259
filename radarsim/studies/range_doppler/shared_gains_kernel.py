"""The kernel's problem of a case in the paper's world, in which all realisations share the gains.

Imported only to simulate: it loads the compiler."""

import numpy as np

from radarsim.config.experiment import Case
from radarsim.engine.sums import Layout
from radarsim.kernels import second_order
from radarsim.studies.noise import noise_key
from radarsim.studies.range_doppler.designed_case import DesignedCase


def problem(case: Case, design: DesignedCase, baseline: int) -> second_order.Problem:
    """What is simulated, as the kernel takes it."""
    longest = max(d.start for d in design.filters)
    problem = second_order.Problem(
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


def layout(design: DesignedCase) -> Layout:
    """The arrays of the sums, and their shapes."""
    return Layout(**second_order.shapes(len(design.filters), len(design.t)))


def errors(problem: second_order.Problem, first: int, count: int) -> np.ndarray:
    """The errors (F, count, K, 3) of the realisations of a block; NaN where a filter has no estimate."""
    return second_order.errors(problem, first, count)


def sums(problem: second_order.Problem, layout_of_sums: Layout, first: int, count: int) -> np.ndarray:
    """Sums (size,) of one block, in the order of the layout."""
    block_sums = second_order.Sums(**{name: np.zeros(shape) for name, shape in layout_of_sums.shapes.items()})
    second_order.simulate_block(problem, first, count, block_sums)
    return layout_of_sums.pack(**block_sums._asdict())

"""The kernels' problem of a case, and the sums of a block. Imported only to simulate: it loads the compiler."""

import numpy as np

from radarsim.config.experiment import Case
from radarsim.engine.sums import Layout
from radarsim.kernels import second_order
from radarsim.kernels.kalman_algebra import pack
from radarsim.studies.noise import noise_key
from radarsim.studies.range_doppler import scenario
from radarsim.studies.range_doppler.designed_case import DesignedCase
from radarsim.studies.range_doppler.kernels import missed_block

Problem = second_order.Problem | missed_block.Problem


def problem(case: Case, design: DesignedCase, baseline: int) -> Problem:
    """For the paper's world a problem with shared gains, for any other one with gains of each realisation."""
    make_problem = shared_gains if design.plain else individual_gains
    return make_problem(case, design, baseline).plain()


def layout(design: DesignedCase) -> Layout:
    """The arrays of the sums, and their shapes."""
    size = len(design.filters), len(design.t)
    return Layout(**second_order.shapes(*size) if design.plain else missed_block.shapes(*size))


def shared_gains(case: Case, design: DesignedCase, baseline: int) -> second_order.Problem:
    """The paper's world for the kernel in which all realisations share the gains."""
    longest = max(d.start for d in design.filters)
    return second_order.Problem(
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


def individual_gains(case: Case, design: DesignedCase, baseline: int) -> missed_block.Problem:
    """Any other world for the kernel in which each realisation has gains of its own."""
    return missed_block.Problem(
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
        given=np.array([d.given for d in design.filters]),
        gains=np.stack([d.gains for d in design.filters]),
        believed=np.stack(pack(np.stack([d.believed for d in design.filters])), axis=-1),
    )


def errors(simulated_problem: Problem, first: int, count: int) -> np.ndarray:
    """The errors (F, count, K, 3) of the realisations of a block; NaN where a filter has no estimate."""
    if isinstance(simulated_problem, missed_block.Problem):
        return missed_block.errors(simulated_problem, first, count)
    return second_order.errors(simulated_problem, first, count)


def sums(simulated_problem: Problem, layout_of_sums: Layout, first: int, count: int) -> np.ndarray:
    """Sums (size,) of one block, in the order of the layout."""
    if isinstance(simulated_problem, missed_block.Problem):
        block_sums = missed_block.Sums(**{name: np.zeros(shape) for name, shape in layout_of_sums.shapes.items()})
        missed_block.simulate_block(simulated_problem, first, count, block_sums)
        return layout_of_sums.pack(**block_sums._asdict())
    linear_sums = second_order.Sums(**{name: np.zeros(shape) for name, shape in layout_of_sums.shapes.items()})
    second_order.simulate_block(simulated_problem, first, count, linear_sums)
    return layout_of_sums.pack(**linear_sums._asdict())

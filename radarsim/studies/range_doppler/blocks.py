"""What the kernels are given of a case, and the sums of a block. Imported to simulate: it loads the compiler."""

import numpy as np

from radarsim.config.experiment import Case
from radarsim.engine.results import Layout
from radarsim.kernels import linear
from radarsim.kernels.algebra import pack
from radarsim.studies.noise import noise_key
from radarsim.studies.range_doppler import filters
from radarsim.studies.range_doppler.kernels import missed
from radarsim.studies.range_doppler.tuning import Designed

Problem = linear.Problem | missed.Problem


def problem(case: Case, design: Designed, baseline: int) -> Problem:
    """For the paper's world a problem with shared gains, for any other one with gains of each realisation."""
    make_problem = shared_gains if design.plain else own_gains
    return make_problem(case, design, baseline).plain()


def layout(design: Designed) -> Layout:
    """The arrays of the sums, and their shapes."""
    size = len(design.filters), len(design.t)
    return Layout(**linear.shapes(*size) if design.plain else missed.shapes(*size))


def shared_gains(case: Case, design: Designed, baseline: int) -> linear.Problem:
    """The paper's world for the kernel in which all realisations share the gains."""
    longest = max(d.start for d in design.filters)
    return linear.Problem(
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


def own_gains(case: Case, design: Designed, baseline: int) -> missed.Problem:
    """Any other world for the kernel in which each realisation has gains of its own."""
    return missed.Problem(
        keys=np.stack([noise_key(case, stream) for stream in ("plots", "misses", "drawn")]),
        truth=design.x,
        sigma=design.plots.sigma,
        bias=design.plots.bias,
        sigma_bias=design.plots.sigma_bias,
        sigma_flight=filters.sigma_flight(design.spec.target),
        flight=filters.flight(design.spec.target, design.t),
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
    if isinstance(simulated_problem, missed.Problem):
        return missed.errors(simulated_problem, first, count)
    return linear.errors(simulated_problem, first, count)


def sums(simulated_problem: Problem, layout_of_sums: Layout, first: int, count: int) -> np.ndarray:
    """Sums (size,) of one block, in the order of the layout."""
    if isinstance(simulated_problem, missed.Problem):
        block_sums = missed.Sums(**{name: np.zeros(shape) for name, shape in layout_of_sums.shapes.items()})
        missed.simulate_block(simulated_problem, first, count, block_sums)
        return layout_of_sums.pack(**block_sums._asdict())
    linear_sums = linear.Sums(**{name: np.zeros(shape) for name, shape in layout_of_sums.shapes.items()})
    linear.simulate_block(simulated_problem, first, count, linear_sums)
    return layout_of_sums.pack(**linear_sums._asdict())

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


def problem(case: Case, made: Designed, baseline: int) -> Problem:
    """For the paper's world a problem with shared gains, for any other one with gains of each realisation."""
    of = shared_gains if made.plain else own_gains
    return of(case, made, baseline).plain()


def layout(made: Designed) -> Layout:
    """The arrays of the sums, and their shapes."""
    shapes = (linear if made.plain else missed).shapes(len(made.filters), len(made.t))
    return Layout(**shapes)


def shared_gains(case: Case, made: Designed, baseline: int) -> linear.Problem:
    """The paper's world for the kernel in which all realisations share the gains."""
    longest = max(d.start for d in made.filters)
    return linear.Problem(
        key=noise_key(case, "plots"),
        truth=made.x,
        sigma=made.plots.sigma,
        dt=made.dt,
        observes=made.observes,
        start=np.array([d.start for d in made.filters]),
        weights=np.stack([np.pad(d.weights, ((0, 0), (0, 0), (0, longest - d.start))) for d in made.filters]),
        gains=np.stack([d.gains for d in made.filters]),
        baseline=baseline,
    )


def own_gains(case: Case, made: Designed, baseline: int) -> missed.Problem:
    """Any other world for the kernel in which each realisation has gains of its own."""
    return missed.Problem(
        keys=np.stack([noise_key(case, what) for what in ("plots", "misses", "drawn")]),
        truth=made.x,
        sigma=made.plots.sigma,
        bias=made.plots.bias,
        sigma_bias=made.plots.sigma_bias,
        sigma_flight=filters.sigma_flight(made.spec.target),
        flight=filters.flight(made.spec.target, made.t),
        detection=made.plots.detection,
        dt=made.dt,
        observes=made.observes,
        start=np.array([d.start for d in made.filters]),
        Q=np.array([d.noise for d in made.filters]),
        baseline=baseline,
        given=np.array([d.given for d in made.filters]),
        gains=np.stack([d.gains for d in made.filters]),
        believed=np.stack(pack(np.stack([d.believed for d in made.filters])), axis=-1),
    )


def errors(of: Problem, first: int, count: int) -> np.ndarray:
    """The errors (F, count, K, 3) of the realisations of a block; NaN where a filter has no estimate."""
    return (missed if isinstance(of, missed.Problem) else linear).errors(of, first, count)


def sums(of: Problem, where: Layout, first: int, count: int) -> np.ndarray:
    """Sums (size,) of one block, in the order of the layout."""
    if isinstance(of, missed.Problem):
        own = missed.Sums(**{name: np.zeros(shape) for name, shape in where.shapes.items()})
        missed.simulate_block(of, first, count, own)
        return where.pack(**own._asdict())
    shared = linear.Sums(**{name: np.zeros(shape) for name, shape in where.shapes.items()})
    linear.simulate_block(of, first, count, shared)
    return where.pack(**shared._asdict())

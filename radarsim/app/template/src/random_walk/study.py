"""The numbers: `prepare` makes a plan of a case, once; `simulate` makes the sums of one block of realisations."""

from dataclasses import dataclass

import numpy as np
from radarsim.config.experiment import Case
from radarsim.engine.results import Axes, Layout
from radarsim.studies.noise import noise_key

from random_walk import filters, kernels

COMPONENTS = (("x", "m"),)  # Yours: names and units of the errors shown
BLOCK = 4096  # Yours: realisations in a block, fixed for the study; some milliseconds of work


@dataclass(frozen=True)
class Plan:
    """The data of a block, F filters over K scans; see `kernels.simulate_block`."""

    layout: Layout
    axes: Axes
    key: np.ndarray
    sigma: float
    step: float
    gains: np.ndarray
    block: int = BLOCK
    gaussian = True  # Yours: whether all errors are Gaussian with the exact bias and σ of the axes


def prepare(case: Case) -> Plan:
    """Design the filters of a case, and the exact values of their errors."""
    spec, scans = case.spec, case.spec.scans
    sigma, step = spec.sensor.sigma_x_m, spec.target.sigma_step_m
    gains = np.stack([filters.design(one, sigma, step, scans) for one in spec.filters])
    shape = (*gains.shape, 1)
    exact_sigma = np.sqrt([filters.error_variance(row, sigma, step) for row in gains]).reshape(shape)
    names = tuple(one.name for one in spec.filters)
    axes = Axes(
        filters=names,
        components=COMPONENTS,
        k=np.arange(1, scans + 1),
        t_s=np.arange(scans) * spec.sensor.scan_period_s,
        available=np.ones(shape, dtype=bool),
        baseline=names.index(spec.baseline) if spec.baseline else 0,
        exact_sigma=exact_sigma,  # NaN where no exact value is known
        exact_bias=np.zeros(shape),
    )
    # Yours: the sums. From `error` and `paired` radarsim makes the tables curves and gains; others you make yourself.
    layout = Layout(error=(*shape, 4), paired=shape)
    return Plan(layout, axes, noise_key(case, "plots"), sigma, step, gains)


def simulate(plan: Plan, first: int, count: int) -> np.ndarray:
    """Sums of realisations first … first + count - 1, in the order of the plan's layout."""
    sums = {name: np.zeros(shape) for name, shape in plan.layout.shapes.items()}
    kernels.simulate_block(
        plan.key, first, count, plan.sigma, plan.step, plan.gains, plan.axes.baseline, sums["error"], sums["paired"]
    )
    return plan.layout.pack(**sums)

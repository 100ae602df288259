"""Smoothing and extrapolation of sonar plots (P3): missed plots, correlated errors, several sonars, two frames.

Where the pattern of plots is the same in all realisations, gains are computed once and errors are Gaussian; else they
go along with each realisation's own plots.
"""

from dataclasses import dataclass

import numpy as np

from radarsim.config.experiment import Case
from radarsim.engine.moments import Layout
from radarsim.studies.sonar import banks
from radarsim.studies.sonar import study as base
from radarsim.studies.sonar.axes import GivenPlotsAxes
from radarsim.studies.sonar.detectors import detector_arrays, detector_tests
from radarsim.studies.sonar.exact_values import exact_values
from radarsim.studies.sonar.kernels import shared_gains as kernels
from radarsim.studies.sonar.scene import Scene, filter_specs, scene


@dataclass(frozen=True)
class SharedPlan:
    """A plan of filters whose gains all realisations share; believed (F, K, C, 3) are their variances."""

    layout: Layout
    axes: GivenPlotsAxes
    world: kernels.World
    bank: kernels.SharedBank
    believed: np.ndarray
    block: int = base.BLOCK
    gaussian = True

    def simulate(self, first: int, count: int) -> np.ndarray:
        """Sums of one block, in the order of the layout."""
        sums = base.empty_sums(*self.bank.known.shape)
        kernels.simulate_block(self.world, self.bank, first, count, self.axes.baseline, sums)
        sums.believed[:] = count * self.believed
        sums.estimates[:] = count * (self.bank.known[..., None] > np.arange(3))
        return base.packed(self.layout, sums)


def prepare(case: Case) -> SharedPlan | base.RealisationPlan:
    """Design the filters of a case and compute the exact values of its errors."""
    seen = scene(case.spec)
    shared = case.spec.frame == "polar" and (seen.certain >= 0).all()
    return _shared_plan(case, seen) if shared else _realisation_plan(case, seen)


def _shared_plan(case: Case, seen: Scene) -> SharedPlan:
    spec, specs = case.spec, filter_specs(case.spec)
    size = max(one.size for one in specs)
    designs = base.designs(specs, seen, np.maximum(seen.certain, 0)[None])
    bank = banks.shared_bank(specs, designs)
    covariance = np.array([[one.covariance[0] for one in row] for row in designs])
    return SharedPlan(
        layout=Layout(**base.shapes(*bank.known.shape, size)),
        axes=base.axes(spec, seen, specs, exact_values(seen, designs, np.ones(1), size), bank.known),
        world=base.world(case, seen),
        bank=bank,
        believed=np.diagonal(covariance, axis1=3, axis2=4).transpose(0, 2, 1, 3),
    )


def _realisation_plan(case: Case, seen: Scene) -> base.RealisationPlan:
    spec, specs = case.spec, filter_specs(case.spec)
    size, (K, C) = max(one.size for one in specs), seen.sigma.shape
    detected, probability = base.detection_patterns(spec, seen)
    tests = detector_tests([], [], [])
    values = exact_values(seen, base.designs(specs, seen, detected), probability, size)
    return base.RealisationPlan(
        layout=Layout(**base.shapes(len(specs), K, C, size)),
        axes=base.axes(spec, seen, specs, values, None),
        world=base.world(case, seen),
        bank=banks.per_realisation_bank(specs, seen.t, seen.period, seen.nominal, tests),
        observation=base.observation(case, seen),
        detectors=detector_arrays(tests, np.zeros(K, dtype=np.int64), C),
        kept=np.zeros(0, dtype=np.int64),
    )

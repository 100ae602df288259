"""Smoothing and extrapolation of sonar plots (P3): missed plots, correlated errors, several sonars, two frames.

Where all realisations have the same pattern of plots, gains are computed once and errors are Gaussian. Otherwise each
realisation has gains of its own.
"""

from dataclasses import dataclass

import numpy as np

from radarsim.config.experiment import Case
from radarsim.engine.results import Layout
from radarsim.studies.sonar import filters
from radarsim.studies.sonar import study as base
from radarsim.studies.sonar.exact import exact_values
from radarsim.studies.sonar.filters import detector_arrays
from radarsim.studies.sonar.kernels import shared_gains as kernels
from radarsim.studies.sonar.scene import Scene, build_scene, filter_specs
from radarsim.studies.sonar.world import GivenPlotsAxes


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
        """The sums of one block, in the order of the layout."""
        sums = base.empty_sums(*self.bank.known.shape)
        kernels.simulate_block(self.world, self.bank, first, count, self.axes.baseline, sums)
        sums.believed[:] = count * self.believed
        sums.estimates[:] = count * (self.bank.known[..., None] > np.arange(3))
        return base.packed(self.layout, sums)


def prepare(case: Case) -> SharedPlan | base.RealisationPlan:
    """Design the filters of a case and compute the exact values of its errors."""
    scene, specs = build_scene(case), filter_specs(case.spec)
    if case.spec.frame == "polar" and (scene.certain >= 0).all():
        return _shared_plan(case, scene, specs)
    K, C = scene.sigma.shape
    return base.realisation_plan(case, scene, specs, detector_arrays([], [], np.zeros(K, dtype=np.int64), C))


def _shared_plan(case: Case, scene: Scene, specs: list[filters.FilterSpec]) -> SharedPlan:
    size = max(one.size for one in specs)
    designs = base.designs(specs, scene, np.maximum(scene.certain, 0)[None])
    bank = filters.shared_bank(specs, designs)
    F, K, C = bank.known.shape
    covariance = np.array([[design.covariance[0] for design in row] for row in designs])
    values = exact_values(scene, designs, np.ones(1), size)
    return SharedPlan(
        layout=Layout(**base.shapes(F, K, C, size)),
        axes=base.axes(case.spec, scene, specs, values, bank.known),
        world=base.world(case, scene),
        bank=bank,
        believed=np.diagonal(covariance, axis1=3, axis2=4).transpose(0, 2, 1, 3),
    )

"""Smoothing: prepare a case, simulate a block."""

from dataclasses import dataclass

import numpy as np

from radarsim.config.experiment import Case
from radarsim.engine.sums import Layout
from radarsim.studies.sonar import detector_arrays, filter_banks, filter_design
from radarsim.studies.sonar.axes import GivenPlotsAxes
from radarsim.studies.sonar.block_sums import empty_sums, flatten_errors, pack_sums, shapes
from radarsim.studies.sonar.exact_errors import exact_values
from radarsim.studies.sonar.kernel_inputs import designs, kernel_world
from radarsim.studies.sonar.kernels import shared_gains
from radarsim.studies.sonar.kernels import world as kernels_world
from radarsim.studies.sonar.labels import given_plots_axes
from radarsim.studies.sonar.realisation_plan import BLOCK, RealisationPlan, realisation_plan
from radarsim.studies.sonar.scene import Scene, build_scene, filter_specs


@dataclass(frozen=True)
class SharedPlan:
    """A plan of filters whose gains all realisations share; believed (F, K, C, 3) are their variances."""

    layout: Layout
    axes: GivenPlotsAxes
    world: kernels_world.World
    bank: shared_gains.SharedBank
    believed: np.ndarray
    block: int = BLOCK
    gaussian = True

    def simulate(self, first: int, count: int) -> np.ndarray:
        """The sums of one block, in the order of the layout."""
        sums, _ = self._simulated(first, count, 0)
        sums.believed[:] = count * self.believed
        sums.estimates[:] = count * (self.bank.estimated_sizes[..., None] > np.arange(3))
        return pack_sums(self.layout, sums)

    def errors(self, first: int, count: int) -> np.ndarray:
        """The errors (F, count, K, C S) of one block's realisations."""
        return flatten_errors(self._simulated(first, count, count)[1])

    def _simulated(self, first: int, count: int, error_count: int) -> tuple[shared_gains.Sums, np.ndarray]:
        """The sums of one block, and the errors (F, K, C, S, error_count) of all its realisations or of none."""
        sums = empty_sums(*self.bank.estimated_sizes.shape)
        errors = np.empty((*self.bank.estimated_sizes.shape, self.bank.size.max(), error_count))
        shared_gains.simulate_block(self.world, self.bank, first, count, self.axes.baseline, sums, errors)
        return sums, errors


def prepare(case: Case) -> SharedPlan | RealisationPlan:
    """Design the filters of a case and compute the exact values of its errors."""
    scene, specs = build_scene(case), filter_specs(case.spec)
    if case.spec.frame == "polar" and (scene.certain >= 0).all():
        return _shared_plan(case, scene, specs)
    K, C = scene.sigma.shape
    return realisation_plan(case, scene, specs, detector_arrays.detector_arrays([], [], np.zeros(K, dtype=np.int64), C))


def _shared_plan(case: Case, scene: Scene, specs: list[filter_design.FilterSpec]) -> SharedPlan:
    size = max(filter_spec.size for filter_spec in specs)
    designs_by_filter = designs(specs, scene, np.maximum(scene.certain, 0)[None])
    bank = filter_banks.shared_bank(specs, designs_by_filter)
    F, K, C = bank.estimated_sizes.shape
    covariance = np.array([[design.covariance[0] for design in row] for row in designs_by_filter])
    values = exact_values(scene, designs_by_filter, np.ones(1), size)
    return SharedPlan(
        layout=Layout(**shapes(F, K, C, size)),
        axes=given_plots_axes(case.spec, scene, specs, values, bank.estimated_sizes),
        world=kernel_world(case, scene),
        bank=bank,
        believed=np.diagonal(covariance, axis1=3, axis2=4).transpose(0, 2, 1, 3),
    )

"""The plan of a case whose filters have different gains in each realisation."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from radarsim.config.experiment import Case
from radarsim.engine.sums import Layout
from radarsim.studies.sonar import filter_banks, filter_design
from radarsim.studies.sonar.axes import GivenPlotsAxes
from radarsim.studies.sonar.block_sums import empty_sums, flatten_errors, pack_sums, shapes
from radarsim.studies.sonar.exact_errors import exact_values
from radarsim.studies.sonar.kernel_inputs import designs, kernel_conversion, kernel_detections, kernel_world
from radarsim.studies.sonar.kernels import detector, plots, realisation_gains
from radarsim.studies.sonar.kernels import world as kernels_world
from radarsim.studies.sonar.labels import given_plots_axes
from radarsim.studies.sonar.scene import Scene

BLOCK = 4096


@dataclass(frozen=True)
class RealisationPlan:
    """A plan of filters whose gains differ between realisations; kept (A,) are the scans whose estimates are stored."""

    layout: Layout
    axes: GivenPlotsAxes
    world: kernels_world.World
    detections: plots.Detections
    conversion: plots.Conversion
    bank: realisation_gains.RealisationBank
    detectors: detector.Detectors
    stored_scans: np.ndarray
    block: int = BLOCK
    gaussian = False

    def simulate(self, first: int, count: int) -> np.ndarray:
        """The sums of one block, in the order of the layout."""
        return pack_sums(self.layout, self.block_sums(first, count).errors)

    def errors(self, first: int, count: int) -> np.ndarray:
        """The errors (F, count, K, C S) of one block's realisations."""
        return flatten_errors(self.block_sums(first, count, count).realisation_errors)

    def block_sums(self, first: int, count: int, error_count: int = 0) -> realisation_gains.BlockSums:
        """The sums of one block as the kernels compute them, and the errors of all its realisations or of none."""
        F, K, C = self.bank.carry.shape
        D, G, T = self.detectors.threshold.shape
        alarms = detector.Alarms(np.zeros((D, G, K)), np.zeros((D, G, T, K)), np.zeros((D, G, T, K)))
        estimates = np.zeros((len(self.stored_scans), F, 2, 6, count))
        errors = np.full((F, K, C, int(self.bank.size.max()), error_count), np.nan)
        modes = np.zeros((F, K, C, 3))
        sums = realisation_gains.BlockSums(empty_sums(F, K, C), alarms, modes, self.stored_scans, estimates, errors)
        inputs = (self.world, self.detections, self.conversion, self.bank, self.detectors)
        realisation_gains.simulate_block(*inputs, first, count, self.axes.baseline, sums)
        return sums


def realisation_plan(
    case: Case, scene: Scene, specs: Sequence[filter_design.FilterSpec], detectors: detector.Detectors
) -> RealisationPlan:
    """The plan of a case whose gains differ between realisations, with exact values by patterns of plots.

    No values are known in the cartesian frames, where weights depend on the plots."""
    spec, (K, C), size = case.spec, scene.sigma.shape, max(filter_spec.size for filter_spec in specs)
    if spec.frame == "polar":
        detected, probability = scene.patterns()
        values = exact_values(scene, designs(specs, scene, detected), probability, size)
    else:
        values = exact_values(scene, [[]] * len(specs), np.zeros(0), size)
    return RealisationPlan(
        layout=Layout(**shapes(len(specs), K, C, size)),
        axes=given_plots_axes(spec, scene, specs, values),
        world=kernel_world(case, scene),
        detections=kernel_detections(case, scene),
        conversion=kernel_conversion(case, scene),
        bank=filter_banks.per_realisation_bank(specs, scene.t, scene.period, scene.nominal, detectors),
        detectors=detectors,
        stored_scans=np.zeros(0, dtype=np.int64),
    )

"""Manoeuvres: prepare a case, simulate a block.

Sums for D detectors, G groups (each coordinate, then all jointly), T thresholds and K scans: `tested`, `alarms`,
`first` as in `kernels.detector.Alarms`; `modes` (F, K, C, 3) as in `kernels.realisation_gains.BlockSums`; and for A
times `uses` (F, A, U, 5): n, Σe, Σe², Σe⁴ and Σ of the first-order variance."""

from dataclasses import dataclass

import numpy as np

from radarsim.config.experiment import Case
from radarsim.engine.sums import Layout
from radarsim.studies.sonar import axes as sonar_axes
from radarsim.studies.sonar import block_sums, realisation_plan
from radarsim.studies.sonar.config import Keys
from radarsim.studies.sonar.filter_keys import RESPONDING_KINDS
from radarsim.studies.sonar.kernels.detector import Detectors
from radarsim.studies.sonar.manoeuvre import track_uses
from radarsim.studies.sonar.manoeuvre.alarm_laws import exact_alarms, independent
from radarsim.studies.sonar.manoeuvre.axes import ManoeuvreAxes
from radarsim.studies.sonar.manoeuvre.phases import manoeuvre_times
from radarsim.studies.sonar.manoeuvre.responses import all_detectors, responding_filters, thresholds
from radarsim.studies.sonar.manoeuvre.use_errors import use_sums, uses_axes
from radarsim.studies.sonar.scene import Scene, build_scene, filter_specs


@dataclass(frozen=True, kw_only=True)
class Plan(realisation_plan.RealisationPlan):
    """A plan of a case with detectors, filters that respond to manoeuvres, or uses of a track."""

    axes: ManoeuvreAxes
    spec: Keys
    scene: Scene

    def simulate(self, first: int, count: int) -> np.ndarray:
        """The sums of one block, in the order of the layout."""
        sums = self.block_sums(first, count)
        detector_count = len(self.spec.detectors)
        part_sums = {name: values[:detector_count] for name, values in sums.alarms._asdict().items()} | {
            "modes": sums.modes
        }
        if self.spec.uses and self.axes.uses:
            part_sums["uses"] = use_sums(
                self.spec.uses, self.spec.frame, self.axes.uses, self.scene.t[self.stored_scans], sums.kept_estimates
            )
        return block_sums.pack_sums(self.layout, sums.errors, **part_sums)


def prepare(case: Case) -> Plan:
    """Design the filters and detectors of a case, and compute the exact values of their errors and alarms."""
    spec, scene = case.spec, build_scene(case)
    specs = responding_filters(spec, filter_specs(spec))
    detectors = all_detectors(spec, scene, specs)
    plan = realisation_plan.realisation_plan(case, scene, specs, detectors)
    use_scans = np.zeros(0, dtype=np.int64)
    if spec.uses:
        use_scans = np.searchsorted(scene.t, np.array(spec.uses.at_s or [scene.t[-1]]) - 1e-9)
    more = shapes(spec, detectors, len(scene.t), len(use_scans))
    fields = vars(plan) | {"stored_scans": use_scans, "layout": Layout(**plan.layout.shapes, **more)}
    return Plan(**fields | {"axes": axes(spec, scene, plan.axes, detectors.phase, use_scans)}, spec=spec, scene=scene)


def axes(
    spec: Keys, scene: Scene, common: sonar_axes.GivenPlotsAxes, phase: np.ndarray, use_scans: np.ndarray
) -> ManoeuvreAxes:
    """Labels of a case and its exact laws; phase (K,) of the manoeuvre, use_scans (A,)."""
    alarms, shifts = exact_alarms(spec, scene)
    return ManoeuvreAxes(
        **vars(common),
        exact_alarms=alarms,
        shifts=shifts,
        thresholds=tuple(thresholds(detector, len(scene.nominal)) for detector in spec.detectors),
        independent=tuple(independent(detector, scene) for detector in spec.detectors),
        phase=phase,
        manoeuvre_s=manoeuvre_times(spec.target),
        uses=uses_axes(spec.uses, spec, scene, use_scans) if spec.uses else None,
    )


def shapes(spec: Keys, detectors: Detectors, K: int, A: int) -> dict[str, tuple[int, ...]]:
    """Shapes of the sums that a case has in addition to the common ones."""
    G, T = detectors.threshold.shape[1:]
    D, F = len(spec.detectors), len(spec.filters)
    sums: dict[str, tuple[int, ...]] = {}
    if D:
        sums |= {"tested": (D, G, K), "alarms": (D, G, T, K), "first": (D, G, T, K)}
    if any(member.kind in RESPONDING_KINDS for member in spec.filters):
        sums["modes"] = (F, K, G - 1, 3)
    if spec.uses:
        sums["uses"] = (F, A, len(track_uses.QUANTITIES), 5)
    return sums

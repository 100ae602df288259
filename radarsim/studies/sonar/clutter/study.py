"""Tracks among false and missed plots: prepare a case, simulate a block.

The errors in the sums of `sonar.block_sums` are those of the tracks kept, which are confirmed and on the target. The
sums `counts`, `begun`, `ratios` and `scores` are described in `kernels.track_sums`. Where false tracks are sought
(`rare`), `held` and `drawn` of `kernels.rare_false_tracks` are in place of `begun`, and the scores of false tracks are
those of the plain ones. Where ends of the target's track are sought, they are those of further realisations: `ended`
and `ended_drawn` of `kernels.rare_ends`."""

from dataclasses import dataclass

import numpy as np

from radarsim.config.experiment import Case
from radarsim.engine.sums import Layout
from radarsim.studies.noise import noise_key
from radarsim.studies.sonar import block_sums, kernel_inputs, labels, realisation_plan
from radarsim.studies.sonar.clutter import initiation, tracker_design
from radarsim.studies.sonar.clutter.axes import ClutterAxes
from radarsim.studies.sonar.clutter.end_laws import end_laws
from radarsim.studies.sonar.clutter.kernels import blocks, rare_false_tracks
from radarsim.studies.sonar.clutter.kernels import track_sums as kernels_track_sums
from radarsim.studies.sonar.clutter.kernels.false_plots import Field
from radarsim.studies.sonar.clutter.kernels.rare_end_laws import EndLaws
from radarsim.studies.sonar.clutter.kernels.rare_ends import END_KINDS, EndSums, simulate_ends
from radarsim.studies.sonar.clutter.kernels.single_tracks import Trackers, workspace
from radarsim.studies.sonar.clutter.target_detections import detected_plots
from radarsim.studies.sonar.config import Keys
from radarsim.studies.sonar.exact_errors import exact_values
from radarsim.studies.sonar.kernels.plots import Detections
from radarsim.studies.sonar.scene import Scene, build_scene, filter_specs

COORDINATES, SIZE = 2, 2  # range and bearing, each a straight line


@dataclass(frozen=True)
class Plan:
    """A plan of trackers of a target and of false tracks."""

    layout: Layout
    axes: ClutterAxes
    trackers: Trackers
    false_track_field: Field  #: false plots among which false tracks live
    false_track_key: np.ndarray  #: (2,) key of the stream of their first plots
    false_track_laws: rare_false_tracks.FalseTrackLaws | None = (
        None  #: how false tracks are drawn where they are rare; None: as they are
    )
    #: how further tracks of the target are drawn where its ends are rare; None: there are none
    end_laws: EndLaws | None = None
    block: int = realisation_plan.BLOCK
    gaussian = False

    def simulate(self, first: int, count: int) -> np.ndarray:
        """The sums of one block, in the order of the layout."""
        axes = self.axes
        F, K = len(axes.filters), len(axes.k)
        sums = block_sums.empty_sums(F, K, COORDINATES)
        part_sums = {
            name: np.zeros(shape) for name, shape in kernels_track_sums.shapes(F, K, len(axes.thresholds)).items()
        }
        track_sums, work = kernels_track_sums.TrackSums(sums, **part_sums), workspace(F)
        inputs = (axes.world, axes.detections, axes.field, self.trackers)
        blocks.simulate_block(*inputs, work, first, count, track_sums)
        if self.false_track_laws is not None:
            weighted = rare_false_tracks.WeightedSums(np.zeros((F, K, 4)), np.zeros((F, 3)))
            weighted_inputs = (self.false_track_key, self.false_track_field, self.false_track_laws, self.trackers)
            rare_false_tracks.simulate_false_tracks(
                *weighted_inputs, work, axes.world.dt, first, count, part_sums["scores"][1], weighted
            )
            part_sums |= weighted._asdict()
        elif axes.field.cells.density > 0:
            false_inputs = (self.false_track_key, self.false_track_field, self.trackers)
            blocks.simulate_false_tracks(*false_inputs, work, axes.world.dt, first, count, track_sums)
        if self.end_laws is not None:
            ended = EndSums(np.zeros((F, K, END_KINDS, 4)), np.zeros((F, 3)))
            simulate_ends(*inputs, self.end_laws, work, first, count, ended)
            part_sums |= ended._asdict()
        return block_sums.pack_sums(self.layout, sums, **part_sums)

    def errors(self, first: int, count: int) -> np.ndarray:
        """The errors (F, count, K, C S) of the confirmed tracks on the target, not-a-number where there is none."""
        axes, (F, K, values) = self.axes, self.axes.available.shape
        work, errors = workspace(F), np.full((F, count, K, values), np.nan)
        shapes = kernels_track_sums.shapes(F, K, len(axes.thresholds))
        for i in range(count):
            sums = block_sums.empty_sums(F, K, COORDINATES)
            track_sums = kernels_track_sums.TrackSums(sums, **{name: np.zeros(shape) for name, shape in shapes.items()})
            blocks.simulate_block(
                axes.world, axes.detections, axes.field, self.trackers, work, first + i, 1, track_sums
            )
            error, estimates = (part[:, :, :, :SIZE].reshape(F, K, values, -1) for part in (sums.error, sums.estimates))
            errors[:, i] = np.where(estimates[..., 0] > 0, error[..., 0], np.nan)
        return errors


def prepare(case: Case) -> Plan:
    """Design the trackers of a case, and compute the exact laws of their errors and of initiation."""
    spec, scene = case.spec, build_scene(case)
    conditions, specs = tracker_design.tracking_conditions(spec), tracker_design.tracker_specs(spec)
    F, K = len(specs), len(scene.t)
    common = block_sums.shapes(F, K, COORDINATES, SIZE)
    del common["paired"]  # trackers keep tracks in different realisations
    part_shapes, labels = (
        kernels_track_sums.shapes(F, K, len(tracker_design.THRESHOLDS)),
        axes(case, scene, specs, conditions),
    )
    shift = laws_of_ends = None
    if spec.rare is not None and spec.rare.seeks_false_tracks:
        del part_shapes["begun"]
        part_shapes |= {"held": (F, K, 4), "drawn": (F, 3)}
        shift = rare_false_tracks.FalseTrackLaws(
            noise_key(case, "rare"), noise_key(case, "rare plots"), np.array(spec.rare.shares())
        )
    if spec.rare is not None and spec.rare.seeks_ends:
        part_shapes |= {"ended": (F, K, END_KINDS, 4), "ended_drawn": (F, 3)}
        laws_of_ends = end_laws(case, specs, conditions, labels)
    return Plan(
        layout=Layout(**common, **part_shapes),
        axes=labels,
        trackers=tracker_design.trackers(specs, conditions),
        false_track_field=tracker_design.field(noise_key(case, "seeds"), spec.sensor.sector, conditions),
        false_track_key=noise_key(case, "places"),
        false_track_laws=shift,
        end_laws=laws_of_ends,
    )


def axes(
    case: Case, scene: Scene, specs: list[tracker_design.TrackerSpec], conditions: tracker_design.Conditions
) -> ClutterAxes:
    """The labels of a case, with the exact σ of filters with known association and the exact laws of initiation."""
    spec, detections = case.spec, detected_plots(case, scene)
    F, K = len(specs), len(scene.t)
    min_plots = np.array([2 if tracker_spec.association == "known" else tracker_spec.m for tracker_spec in specs])
    available = np.broadcast_to((np.arange(1, K + 1) >= min_plots[:, None])[..., None, None], (F, K, COORDINATES, SIZE))
    values = reference_values(spec, scene, detections.certain)
    confirmed, begun = initiation_laws(spec, specs, conditions, detections)
    return ClutterAxes(
        **labels.common_labels(spec, scene, np.full(F, SIZE), available, values),
        associations=tuple(tracker_spec.association for tracker_spec in specs),
        thresholds=tracker_design.THRESHOLDS,
        exact_confirmed=confirmed,
        exact_begun=begun,
        area_m2=spec.sensor.sector.area_m2(),
        world=kernel_inputs.kernel_world(case, scene),
        detections=detections,
        field=tracker_design.field(noise_key(case, "false"), spec.sensor.sector, conditions),
    )


def initiation_laws(
    spec: Keys, specs: list[tracker_design.TrackerSpec], conditions: tracker_design.Conditions, detections: Detections
) -> tuple[np.ndarray, np.ndarray]:
    """Probabilities (F, K) that a track of the target was confirmed by each scan, and that a false one is at a scan.

    NaN where no law is known: the first needs open gates and no false plots, the second a rule 2 of n."""
    probability = np.where(detections.certain < 0, detections.probability, detections.certain)
    confirmed, begun = np.full((2, len(specs), len(probability)), np.nan)
    for f, tracker_spec in enumerate(specs):
        if tracker_spec.association == "known":
            continue
        if conditions.density == 0 and tracker_spec.gate_probability == 1:
            confirmed[f] = initiation.confirmation_probabilities(probability, tracker_spec.m, tracker_spec.n)
        if tracker_spec.m == 2 and spec.sensor.sector:
            begun[f] = initiation.false_pair_probabilities(
                spec.sensor.sector, conditions, tracker_spec, len(probability)
            )
    return confirmed, begun


def reference_values(spec: Keys, scene: Scene, certain: np.ndarray) -> dict[str, np.ndarray]:
    """Exact errors, as `exact_values` returns them, of filters with known association."""
    is_known = np.array([member.association == "known" for member in spec.filters])
    if (certain < 0).any() or certain[0] == 0:
        is_known[:] = False
    specs = [
        filter_spec if has_known_plots else None
        for filter_spec, has_known_plots in zip(filter_specs(spec), is_known, strict=True)
    ]
    designs = [
        kernel_inputs.designs([filter_spec], scene, certain[None].astype(float))[0] if filter_spec else []
        for filter_spec in specs
    ]
    return exact_values(scene, designs, np.ones(1), SIZE)

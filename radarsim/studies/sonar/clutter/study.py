"""P3's second half: tracks among false and missed plots.

The errors in the sums of `sonar.study` are those of the tracks kept, which are confirmed and on the target. The sums
`counts`, `begun`, `ratios` and `scores` are described in `kernels.counts`. Where false tracks are sought (`rare`),
`held` and `drawn` of `kernels.rare` are in place of `begun`, and the scores of false tracks are those of the plain
ones. Where ends of the target's track are sought, they are those of further realisations: `ended` and `ended_drawn`
of `kernels.ends`.
"""

from dataclasses import dataclass

import numpy as np

from radarsim.config.experiment import Case
from radarsim.engine.moments import Layout
from radarsim.studies.noise import noise_key
from radarsim.studies.sonar import study as base
from radarsim.studies.sonar.clutter import exact
from radarsim.studies.sonar.clutter import filters as design
from radarsim.studies.sonar.clutter import rare as sought
from radarsim.studies.sonar.clutter import world as observed
from radarsim.studies.sonar.clutter.axes import ClutterAxes
from radarsim.studies.sonar.clutter.config import Keys
from radarsim.studies.sonar.clutter.kernels import blocks, counts, rare
from radarsim.studies.sonar.clutter.kernels.ends import KINDS, Ends, EndSums, simulate_ends
from radarsim.studies.sonar.clutter.kernels.field import Field
from radarsim.studies.sonar.clutter.kernels.tracker import Trackers, workspace
from radarsim.studies.sonar.exact_values import exact_values
from radarsim.studies.sonar.kernels.patterns import Detections
from radarsim.studies.sonar.scene import Scene, build_scene, filter_specs

COORDINATES, SIZE = 2, 2  # range and bearing, each a straight line


@dataclass(frozen=True)
class Plan:
    """A plan of trackers of a target and of false tracks.

    field_about_false holds the false plots among which false tracks live; seeds (2,) is the key of the stream of their
    first plots. shift: how false tracks are drawn where they are rare; None: as they are. ends: how further tracks of
    the target are drawn where its ends are rare; None: there are none.
    """

    layout: Layout
    axes: ClutterAxes
    trackers: Trackers
    field_about_false: Field
    seeds: np.ndarray
    shift: rare.Shift | None = None
    ends: Ends | None = None
    block: int = base.BLOCK
    gaussian = False

    def simulate(self, first: int, count: int) -> np.ndarray:
        """The sums of one block, in the order of the layout."""
        axes = self.axes
        F, K = len(axes.filters), len(axes.k)
        sums = base.empty_sums(F, K, COORDINATES)
        own = {name: np.zeros(shape) for name, shape in counts.shapes(F, K, len(axes.thresholds)).items()}
        track_sums, work = counts.TrackSums(sums, **own), workspace(F)
        inputs = (axes.world, axes.detections, axes.field, self.trackers)
        blocks.simulate_block(*inputs, work, first, count, track_sums)
        if self.shift is not None:
            weighted = rare.WeightedSums(np.zeros((F, K, 4)), np.zeros((F, 3)))
            drawn = (self.seeds, self.field_about_false, self.shift, self.trackers)
            rare.simulate_false(*drawn, work, axes.world.dt, first, count, own["scores"][1], weighted)
            own |= weighted._asdict()
        elif axes.field.cells.density > 0:
            false = (self.seeds, self.field_about_false, self.trackers)
            blocks.simulate_false(*false, work, axes.world.dt, first, count, track_sums)
        if self.ends is not None:
            ended = EndSums(np.zeros((F, K, KINDS, 4)), np.zeros((F, 3)))
            simulate_ends(*inputs, self.ends, work, first, count, ended)
            own |= ended._asdict()
        return base.packed(self.layout, sums, **own)


def prepare(case: Case) -> Plan:
    """Design the trackers of a case, and compute the exact laws of their errors and of initiation."""
    spec, scene = case.spec, build_scene(case)
    given, specs = design.conditions(spec), design.tracker_specs(spec)
    F, K = len(specs), len(scene.t)
    common = base.shapes(F, K, COORDINATES, SIZE)
    del common["paired"]  # trackers keep tracks in different realisations
    own, labels, shift, drawn = counts.shapes(F, K, len(design.THRESHOLDS)), axes(case, scene, specs, given), None, None
    if spec.rare is not None and spec.rare.seeks_false_tracks:
        del own["begun"]
        own |= {"held": (F, K, 4), "drawn": (F, 3)}
        shift = rare.Shift(noise_key(case, "rare"), noise_key(case, "rare plots"), np.array(spec.rare.shares()))
    if spec.rare is not None and spec.rare.seeks_ends:
        own |= {"ended": (F, K, KINDS, 4), "ended_drawn": (F, 3)}
        drawn = sought.ends(case, specs, given, labels)
    return Plan(
        layout=Layout(**common, **own),
        axes=labels,
        trackers=design.trackers(specs, given),
        field_about_false=design.field(noise_key(case, "seeds"), spec.sensor.sector, given),
        seeds=noise_key(case, "places"),
        shift=shift,
        ends=drawn,
    )


def axes(case: Case, scene: Scene, specs: list[design.TrackerSpec], given: design.Conditions) -> ClutterAxes:
    """Labels; exact σ of filters that know the target's plots, where all detections are certain; laws of initiation."""
    spec, detections = case.spec, observed.detections(case, scene)
    F, K = len(specs), len(scene.t)
    least = np.array([2 if one.association == "known" else one.m for one in specs])
    available = np.broadcast_to((np.arange(1, K + 1) >= least[:, None])[..., None, None], (F, K, COORDINATES, SIZE))
    values = reference_values(spec, scene, detections.certain)
    confirmed, begun = initiation_laws(spec, specs, given, detections)
    return ClutterAxes(
        **base.common_labels(spec, scene, np.full(F, SIZE), available, values),
        associations=tuple(one.association for one in specs),
        thresholds=design.THRESHOLDS,
        exact_confirmed=confirmed,
        exact_begun=begun,
        area_m2=spec.sensor.sector.area_m2(),
        world=base.world(case, scene),
        detections=detections,
        field=design.field(noise_key(case, "false"), spec.sensor.sector, given),
    )


def initiation_laws(
    spec: Keys, specs: list[design.TrackerSpec], given: design.Conditions, detections: Detections
) -> tuple[np.ndarray, np.ndarray]:
    """Probabilities (F, K) that a track of the target was confirmed by each scan, and one begun by a false plot at it.

    NaN where no law is known: the first needs open gates and no false plots, the second a rule 2 of n.
    """
    probability = np.where(detections.certain < 0, detections.probability, detections.certain)
    confirmed, begun = np.full((2, len(specs), len(probability)), np.nan)
    for f, one in enumerate(specs):
        if one.association == "known":
            continue
        if given.density == 0 and one.gate_probability == 1:
            confirmed[f] = exact.confirmed_by(probability, one.m, one.n)
        if one.m == 2 and spec.sensor.sector:
            begun[f] = exact.false_pairs(spec.sensor.sector, given, one, len(probability))
    return confirmed, begun


def reference_values(spec: Keys, scene: Scene, certain: np.ndarray) -> dict[str, np.ndarray]:
    """Exact errors, as `exact_values` returns them, of filters that know the target's plots."""
    known = np.array([member.association == "known" for member in spec.filters])
    if (certain < 0).any() or certain[0] == 0:
        known[:] = False
    specs = [one if is_known else None for one, is_known in zip(filter_specs(spec), known, strict=True)]
    designs = [base.designs([one], scene, certain[None].astype(float))[0] if one else [] for one in specs]
    return exact_values(scene, designs, np.ones(1), SIZE)

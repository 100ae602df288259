"""Which scans give a plot of the target among false plots: only those in which it is within the surveyed sector.

How the target's track is drawn where it ends: laws that lead there, prepared for the kernels.

A track ends after misses in a row, or because of what such a run leads to: its gate grows, a false plot falls into it,
its velocity carries it away. So there is a law for each of some lengths of a run, under which a run of that length
comes in the scans that are left. Were misses independent, with the probability p of a plot that is missed or outside
the gate, the probability V(i, k) that it comes, with i misses in a row before scan k, would be known by recursion, and
to draw a miss with the probability h = p V(i + 1, k + 1) / V(i, k) would give all tracks with such a run the same
weight, 1 / V: Doob's transform, of no variance (Juneja and Shahabuddin 2006, Handbooks in Operations Research and
Management Science 13, 291). Here it is as near to that as misses are to being independent.

A young track may also be wrong from its first plots on: because of their errors, so that the next plots are outside its
gate one after the other, or because one of them is false. So there is a law for the track of each number of plots
from its confirmation on, under which the errors that lead there are stretched, and two under which a false plot
is in its gate, beside the target's or in place of it.

P3's second half: tracks among false and missed plots.

The errors in the sums of `sonar.study` are those of the tracks kept, which are confirmed and on the target. The sums
`counts`, `begun`, `ratios` and `scores` are described in `kernels.tracker`. Where false tracks are sought (`rare`),
`held` and `drawn` of `kernels.rare` are in place of `begun`, and the scores of false tracks are those of the plain
ones. Where ends of the target's track are sought, they are those of further realisations: `ended` and `ended_drawn`
of the same."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from radarsim.config.experiment import Case
from radarsim.config.fields import PLAIN_SHARE
from radarsim.engine.results import Layout
from radarsim.studies.noise import noise_key
from radarsim.studies.sonar import study
from radarsim.studies.sonar.clutter import filters
from radarsim.studies.sonar.clutter.filters import ClutterAxes, Conditions, TrackerSpec, gate_threshold
from radarsim.studies.sonar.clutter.kernels import rare, tracker
from radarsim.studies.sonar.clutter.kernels.rare import END_KINDS, EndLaws, EndSums, simulate_ends
from radarsim.studies.sonar.clutter.kernels.tracker import Field, Trackers, workspace
from radarsim.studies.sonar.config import Keys, Sector
from radarsim.studies.sonar.exact import exact_values
from radarsim.studies.sonar.kernels.patterns import Detections
from radarsim.studies.sonar.scene import Scene, build_scene, filter_specs


# ---- world -----------------------------------------------------------------------------------------------------------
def detected_plots(case: Case, scene: Scene) -> Detections:
    """Which scans give a plot of the target."""
    open_scans = np.where(scene.certain == 0, 0, 1 if scene.probability == 1 else -1)  # the first one too
    certain = np.where(is_within_sector(case.spec.sensor.sector, scene), open_scans, 0)
    return Detections(noise_key(case, "misses"), certain, scene.probability)


def is_within_sector(sector: Sector, scene: Scene) -> np.ndarray:
    """Whether the target is within the sector at each scan (K,)."""
    (near, far), (first, last) = sector.range_m, sector.bearing_rad
    r, b = scene.polar[:, 0, 0], scene.polar[:, 1, 0]
    return (near <= r) & (r <= far) & (first + np.mod(b - first, 2 * np.pi) <= last)


# ---- rare ------------------------------------------------------------------------------------------------------------
MAX_RUN_LENGTHS = 6
LATE_PLOTS = 3  # number of plots after the confirmation whose errors may still lead a track astray
FALSE_PLOT_LAWS = 2  # a false plot beside the target's, and one in place of it
PLOTS_OUTSIDE = 3  # plots in a row that then leave the gate: more follow by themselves
MAX_RUN = 20  # misses in a row: a track that survives more is dropped, or far off, before


def run_lengths(misses: int) -> np.ndarray:
    """Lengths (R,) of the runs of misses that have a law: evenly from one miss to those that drop a track."""
    longest = min(misses, MAX_RUN)
    return np.unique(np.round(np.linspace(1, longest, min(longest, MAX_RUN_LENGTHS)))).astype(np.int64)


def run_probabilities(miss: np.ndarray, length: int) -> np.ndarray:
    """Probability (length + 1, K + 1) that a run of `length` misses comes from scan k on, after i misses in a row.

    miss (K,): the probability of a miss at each scan."""
    out = np.zeros((length + 1, len(miss) + 1))
    out[length] = 1.0
    for k in range(len(miss) - 1, -1, -1):
        out[:length, k] = miss[k] * out[1:, k + 1] + (1.0 - miss[k]) * out[0, k + 1]
    return out


def undetected_probabilities(probability: np.ndarray, inside: float, length: int) -> np.ndarray:
    """Probability (length, K), as drawn, that the target is not detected at scan k after i misses in a row.

    probability (K,) of detection as it is; inside: probability that the gate contains a plot. A miss has probability h
    if the target is not detected with probability 1 - (1 - h) / inside, since plots outside the gate are misses too.
    Where detection is certain, or not possible, nothing is shifted."""
    p = 1.0 - probability * inside
    run_probability = run_probabilities(p, length)
    missed, hit = p * run_probability[1:, 1:], (1.0 - p) * run_probability[0, 1:]
    with np.errstate(invalid="ignore"):
        hit_share = np.where(missed + hit > 0.0, hit / (missed + hit), 1.0 - p)
    shifted = np.clip(1.0 - hit_share / inside, 1.0 - probability, 1.0)
    return np.where((probability > 0.0) & (probability < 1.0), shifted, 1.0 - probability)


def error_directions(t: np.ndarray, min_plots: int) -> np.ndarray:
    """The shortest errors (1 + LATE_PLOTS, J) of J plots at t (J,), s, that bring PLOTS_OUTSIDE plots out of the gate.

    The gate is that of a track after `min_plots` and more plots, a line fitted to them by least squares, as a track
    without manoeuvres begins. The innovations of the next plots are rows A of the errors, each with its own variance
    S = |A|²; all of them are √S at the errors Aᵀ(A Aᵀ)⁻¹√S, the shortest such errors, in units of the root of a gate.
    Zero where there are too few plots."""
    out = np.zeros((1 + LATE_PLOTS, len(t)))
    for row, j in zip(out, range(min_plots, len(t) - PLOTS_OUTSIDE + 1), strict=False):
        A = np.zeros((PLOTS_OUTSIDE, len(t)))
        for h in range(PLOTS_OUTSIDE):
            line = np.stack([np.ones(j), t[:j] - t[j + h]])
            A[h, :j], A[h, j + h] = -np.linalg.solve(line @ line.T, line)[0], 1.0
        row[:] = A.T @ np.linalg.solve(A @ A.T, np.linalg.norm(A, axis=1))
    return out


def stretch_factors(gate: np.ndarray, radius: np.ndarray) -> np.ndarray:
    """Factors s (F, n) that stretch errors along directions of radius (F, n), for gates (F, 1), χ² of two components.

    s² is half the smallest square with which plots leave the gate: best for the tail of a Gaussian of two components.
    """
    return np.sqrt(np.maximum(gate * radius**2 / 2.0, 2.0))


def family_shares(plain: float, sizes: Sequence[int]) -> np.ndarray:
    """Shares (1 + laws,) of the law itself and of the laws in families of these sizes; families have equal shares."""
    family_share = (1.0 - plain) / max(sum(size > 0 for size in sizes), 1)
    return np.concatenate([[plain], *(np.full(size, family_share / size) for size in sizes if size)])


def end_laws(case: Case, specs: Sequence[TrackerSpec], conditions: Conditions, labels: ClutterAxes) -> EndLaws:
    """The laws from which the target's track of each tracker is drawn."""
    certain, t, F, K = labels.detections.certain, np.asarray(labels.t_s, dtype=float), len(specs), len(labels.k)
    probability = np.where(certain < 0, labels.detections.probability, certain)
    runs = [run_lengths(tracker_spec.misses) for tracker_spec in specs]
    scans = [np.flatnonzero(certain != 0)[: tracker_spec.m + LATE_PLOTS + PLOTS_OUTSIDE] for tracker_spec in specs]
    max_runs, longest, J = max(map(len, runs)), max(int(run[-1]) for run in runs), max(map(len, scans))
    length, young = np.zeros((F, max_runs), dtype=np.int64), np.full((F, J), -1, dtype=np.int64)
    shares, shifted = np.zeros((F, 1 + max_runs + 1 + LATE_PLOTS + FALSE_PLOT_LAWS)), np.ones((F, max_runs, longest, K))
    direction, radius = np.zeros((F, 1 + LATE_PLOTS, J)), np.zeros((F, 1 + LATE_PLOTS))
    for f, (tracker_spec, run, scan_indices) in enumerate(zip(specs, runs, scans, strict=True)):
        length[f, : len(run)], young[f, : len(scan_indices)] = run, scan_indices
        direction[f, :, : len(scan_indices)] = error_directions(t[scan_indices], tracker_spec.m)
        radius[f] = np.linalg.norm(direction[f], axis=1)
        far_laws = (
            np.flatnonzero(radius[f] > 0.0) if tracker_spec.gate_probability < 1.0 else np.empty(0, dtype=np.int64)
        )
        tracker_shares = family_shares(
            PLAIN_SHARE, (len(run), len(far_laws), FALSE_PLOT_LAWS * (conditions.density > 0.0))
        )
        law_indices = [
            0,
            *range(1, 1 + len(run)),
            *(1 + max_runs + far_laws),
            *(range(-FALSE_PLOT_LAWS, 0) if conditions.density > 0.0 else []),
        ]
        shares[f, law_indices] = tracker_shares
        for j, run_length in enumerate(run):
            shifted[f, j, :run_length] = undetected_probabilities(
                probability, tracker_spec.gate_probability, int(run_length)
            )
    gates = np.array([[gate_threshold(tracker_spec.gate_probability)] for tracker_spec in specs])
    return EndLaws(
        choice=noise_key(case, "rare ends"),
        plots=noise_key(case, "rare plots about the target"),
        shares=shares,
        length=length,
        undetected=shifted,
        young=young,
        direction=direction / np.maximum(radius, 1e-300)[..., None],
        stretch=stretch_factors(gates, radius),
    )


# ---- study -----------------------------------------------------------------------------------------------------------
COORDINATES, SIZE = 2, 2  # range and bearing, each a straight line


@dataclass(frozen=True)
class Plan:
    """A plan of trackers of a target and of false tracks."""

    layout: Layout
    axes: ClutterAxes
    trackers: Trackers
    field_about_false: Field  #: false plots among which false tracks live
    seeds: np.ndarray  #: (2,) key of the stream of their first plots
    shift: rare.FalseTrackLaws | None = None  #: how false tracks are drawn where they are rare; None: as they are
    #: how further tracks of the target are drawn where its ends are rare; None: there are none
    ends: EndLaws | None = None
    block: int = study.BLOCK
    gaussian = False

    def simulate(self, first: int, count: int) -> np.ndarray:
        """The sums of one block, in the order of the layout."""
        axes = self.axes
        F, K = len(axes.filters), len(axes.k)
        sums = study.empty_sums(F, K, COORDINATES)
        part_sums = {name: np.zeros(shape) for name, shape in tracker.shapes(F, K, len(axes.thresholds)).items()}
        track_sums, work = tracker.TrackSums(sums, **part_sums), workspace(F)
        inputs = (axes.world, axes.detections, axes.field, self.trackers)
        tracker.simulate_block(*inputs, work, first, count, track_sums)
        if self.shift is not None:
            weighted = rare.WeightedSums(np.zeros((F, K, 4)), np.zeros((F, 3)))
            weighted_inputs = (self.seeds, self.field_about_false, self.shift, self.trackers)
            rare.simulate_false_tracks(
                *weighted_inputs, work, axes.world.dt, first, count, part_sums["scores"][1], weighted
            )
            part_sums |= weighted._asdict()
        elif axes.field.cells.density > 0:
            false_inputs = (self.seeds, self.field_about_false, self.trackers)
            tracker.simulate_false_tracks(*false_inputs, work, axes.world.dt, first, count, track_sums)
        if self.ends is not None:
            ended = EndSums(np.zeros((F, K, END_KINDS, 4)), np.zeros((F, 3)))
            simulate_ends(*inputs, self.ends, work, first, count, ended)
            part_sums |= ended._asdict()
        return study.packed(self.layout, sums, **part_sums)


def prepare(case: Case) -> Plan:
    """Design the trackers of a case, and compute the exact laws of their errors and of initiation."""
    spec, scene = case.spec, build_scene(case)
    conditions, specs = filters.tracking_conditions(spec), filters.tracker_specs(spec)
    F, K = len(specs), len(scene.t)
    common = study.shapes(F, K, COORDINATES, SIZE)
    del common["paired"]  # trackers keep tracks in different realisations
    part_shapes, labels = tracker.shapes(F, K, len(filters.THRESHOLDS)), axes(case, scene, specs, conditions)
    shift = laws_of_ends = None
    if spec.rare is not None and spec.rare.seeks_false_tracks:
        del part_shapes["begun"]
        part_shapes |= {"held": (F, K, 4), "drawn": (F, 3)}
        shift = rare.FalseTrackLaws(
            noise_key(case, "rare"), noise_key(case, "rare plots"), np.array(spec.rare.shares())
        )
    if spec.rare is not None and spec.rare.seeks_ends:
        part_shapes |= {"ended": (F, K, END_KINDS, 4), "ended_drawn": (F, 3)}
        laws_of_ends = end_laws(case, specs, conditions, labels)
    return Plan(
        layout=Layout(**common, **part_shapes),
        axes=labels,
        trackers=filters.trackers(specs, conditions),
        field_about_false=filters.field(noise_key(case, "seeds"), spec.sensor.sector, conditions),
        seeds=noise_key(case, "places"),
        shift=shift,
        ends=laws_of_ends,
    )


def axes(case: Case, scene: Scene, specs: list[filters.TrackerSpec], conditions: filters.Conditions) -> ClutterAxes:
    """The labels of a case, with the exact σ of filters with known association and the exact laws of initiation."""
    spec, detections = case.spec, detected_plots(case, scene)
    F, K = len(specs), len(scene.t)
    min_plots = np.array([2 if tracker_spec.association == "known" else tracker_spec.m for tracker_spec in specs])
    available = np.broadcast_to((np.arange(1, K + 1) >= min_plots[:, None])[..., None, None], (F, K, COORDINATES, SIZE))
    values = reference_values(spec, scene, detections.certain)
    confirmed, begun = initiation_laws(spec, specs, conditions, detections)
    return ClutterAxes(
        **study.common_labels(spec, scene, np.full(F, SIZE), available, values),
        associations=tuple(tracker_spec.association for tracker_spec in specs),
        thresholds=filters.THRESHOLDS,
        exact_confirmed=confirmed,
        exact_begun=begun,
        area_m2=spec.sensor.sector.area_m2(),
        world=study.world(case, scene),
        detections=detections,
        field=filters.field(noise_key(case, "false"), spec.sensor.sector, conditions),
    )


def initiation_laws(
    spec: Keys, specs: list[filters.TrackerSpec], conditions: filters.Conditions, detections: Detections
) -> tuple[np.ndarray, np.ndarray]:
    """Probabilities (F, K) that a track of the target was confirmed by each scan, and that a false one is at a scan.

    NaN where no law is known: the first needs open gates and no false plots, the second a rule 2 of n."""
    probability = np.where(detections.certain < 0, detections.probability, detections.certain)
    confirmed, begun = np.full((2, len(specs), len(probability)), np.nan)
    for f, tracker_spec in enumerate(specs):
        if tracker_spec.association == "known":
            continue
        if conditions.density == 0 and tracker_spec.gate_probability == 1:
            confirmed[f] = filters.confirmation_probabilities(probability, tracker_spec.m, tracker_spec.n)
        if tracker_spec.m == 2 and spec.sensor.sector:
            begun[f] = filters.false_pair_probabilities(spec.sensor.sector, conditions, tracker_spec, len(probability))
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
        study.designs([filter_spec], scene, certain[None].astype(float))[0] if filter_spec else []
        for filter_spec in specs
    ]
    return exact_values(scene, designs, np.ones(1), SIZE)

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
from radarsim.studies.sonar import study as base
from radarsim.studies.sonar.clutter import filters
from radarsim.studies.sonar.clutter.filters import ClutterAxes, Conditions, TrackerSpec, gate_threshold
from radarsim.studies.sonar.clutter.kernels import rare, tracker
from radarsim.studies.sonar.clutter.kernels.rare import KINDS, Ends, EndSums, simulate_ends
from radarsim.studies.sonar.clutter.kernels.tracker import Field, Trackers, workspace
from radarsim.studies.sonar.config import Keys, Sector
from radarsim.studies.sonar.exact import exact_values
from radarsim.studies.sonar.kernels.patterns import Detections
from radarsim.studies.sonar.scene import Scene, build_scene, filter_specs


# ---- world -----------------------------------------------------------------------------------------------------------
def detected_plots(case: Case, scene: Scene) -> Detections:
    """Which scans give a plot of the target."""
    open_scans = np.where(scene.certain == 0, 0, 1 if scene.probability == 1 else -1)  # the first one too
    certain = np.where(within(case.spec.sensor.sector, scene), open_scans, 0)
    return Detections(noise_key(case, "misses"), certain, scene.probability)


def within(sector: Sector, scene: Scene) -> np.ndarray:
    """Whether the target is within the sector at each scan (K,)."""
    (near, far), (first, last) = sector.range_m, sector.bearing_rad
    r, b = scene.polar[:, 0, 0], scene.polar[:, 1, 0]
    return (near <= r) & (r <= far) & (first + np.mod(b - first, 2 * np.pi) <= last)


# ---- rare ------------------------------------------------------------------------------------------------------------
MOST_RUNS = 6
FURTHER = 3  # plots after that which confirms a track, up to which it may be wrong by their errors
FALSE = 2  # laws of false plots: beside the target's, and in place of it
OUT = 3  # plots in a row that then leave its gate: more follow by themselves
LONGEST = 20  # misses in a row that are drawn for: a track that needs more is dropped, or far off, before


def lengths(misses: int) -> np.ndarray:
    """Lengths (R,) of the runs that are drawn for: from one miss to those that drop a track, even, six at most."""
    longest = min(misses, LONGEST)
    return np.unique(np.round(np.linspace(1, longest, min(longest, MOST_RUNS)))).astype(np.int64)


def chances(miss: np.ndarray, length: int) -> np.ndarray:
    """Probability (length + 1, K + 1) that a run of so many misses comes from scan k on, with i in a row before it.

    miss (K,): the probability of a miss at each scan."""
    out = np.zeros((length + 1, len(miss) + 1))
    out[length] = 1.0
    for k in range(len(miss) - 1, -1, -1):
        out[:length, k] = miss[k] * out[1:, k + 1] + (1.0 - miss[k]) * out[0, k + 1]
    return out


def undetected(probability: np.ndarray, inside: float, length: int) -> np.ndarray:
    """Probability (length, K) that the target is not detected at scan k, with i misses in a row before it, as drawn.

    probability (K,) of detection as it is; inside: that the gate contains a plot. A miss is drawn with h if this is
    drawn with 1 - (1 - h) / inside, since plots outside the gate are misses too. Where detection is certain, or not
    possible, nothing is shifted."""
    p = 1.0 - probability * inside
    to_come = chances(p, length)
    missed, hit = p * to_come[1:, 1:], (1.0 - p) * to_come[0, 1:]
    with np.errstate(invalid="ignore"):
        hits = np.where(missed + hit > 0.0, hit / (missed + hit), 1.0 - p)
    drawn = np.clip(1.0 - hits / inside, 1.0 - probability, 1.0)
    return np.where((probability > 0.0) & (probability < 1.0), drawn, 1.0 - probability)


def directions(t: np.ndarray, least: int) -> np.ndarray:
    """The shortest errors (1 + FURTHER, J) of J plots at t (J,), s, with which OUT plots in a row leave a track's gate.

    Of the track after `least` and more plots, a line fitted to them by least squares, as a track without manoeuvres
    begins. The innovations of the next OUT plots are rows A of the errors, each with its own variance S = |A|²; all of
    them are √S at the errors Aᵀ(A Aᵀ)⁻¹√S, the shortest with which they are, in units of the root of a gate. Zero where
    there are too few plots."""
    out = np.zeros((1 + FURTHER, len(t)))
    for row, j in zip(out, range(least, len(t) - OUT + 1), strict=False):
        A = np.zeros((OUT, len(t)))
        for h in range(OUT):
            line = np.stack([np.ones(j), t[:j] - t[j + h]])
            A[h, :j], A[h, j + h] = -np.linalg.solve(line @ line.T, line)[0], 1.0
        row[:] = A.T @ np.linalg.solve(A @ A.T, np.linalg.norm(A, axis=1))
    return out


def stretch(gate: np.ndarray, radius: np.ndarray) -> np.ndarray:
    """How much (F, n) errors along directions of radius (F, n) are stretched for gates (F, 1), χ² of two components.

    s² is half the least square with which plots leave the gate, the best for the tail of a Gaussian of two components.
    """
    return np.sqrt(np.maximum(gate * radius**2 / 2.0, 2.0))


def family_shares(plain: float, sizes: Sequence[int]) -> np.ndarray:
    """Shares (1 + laws,) of the law itself and of laws in families of these sizes: equal for all families there are."""
    each = (1.0 - plain) / max(sum(size > 0 for size in sizes), 1)
    return np.concatenate([[plain], *(np.full(size, each / size) for size in sizes if size)])


def ends(case: Case, specs: Sequence[TrackerSpec], given: Conditions, labels: ClutterAxes) -> Ends:
    """How the target's track of each tracker is drawn."""
    certain, t, F, K = labels.detections.certain, np.asarray(labels.t_s, dtype=float), len(specs), len(labels.k)
    probability = np.where(certain < 0, labels.detections.probability, certain)
    runs = [lengths(one.misses) for one in specs]
    scans = [np.flatnonzero(certain != 0)[: one.m + FURTHER + OUT] for one in specs]
    most, longest, J = max(map(len, runs)), max(int(run[-1]) for run in runs), max(map(len, scans))
    length, young = np.zeros((F, most), dtype=np.int64), np.full((F, J), -1, dtype=np.int64)
    shares, drawn = np.zeros((F, 1 + most + 1 + FURTHER + FALSE)), np.ones((F, most, longest, K))
    direction, radius = np.zeros((F, 1 + FURTHER, J)), np.zeros((F, 1 + FURTHER))
    for f, (one, run, at) in enumerate(zip(specs, runs, scans, strict=True)):
        length[f, : len(run)], young[f, : len(at)] = run, at
        direction[f, :, : len(at)] = directions(t[at], one.m)
        radius[f] = np.linalg.norm(direction[f], axis=1)
        far = np.flatnonzero(radius[f] > 0.0) if one.gate_probability < 1.0 else np.empty(0, dtype=np.int64)
        own = family_shares(PLAIN_SHARE, (len(run), len(far), FALSE * (given.density > 0.0)))
        laws = [0, *range(1, 1 + len(run)), *(1 + most + far), *(range(-FALSE, 0) if given.density > 0.0 else [])]
        shares[f, laws] = own
        for j, each in enumerate(run):
            drawn[f, j, :each] = undetected(probability, one.gate_probability, int(each))
    gates = np.array([[gate_threshold(one.gate_probability)] for one in specs])
    return Ends(
        choice=noise_key(case, "rare ends"),
        plots=noise_key(case, "rare plots about the target"),
        shares=shares,
        length=length,
        undetected=drawn,
        young=young,
        direction=direction / np.maximum(radius, 1e-300)[..., None],
        stretch=stretch(gates, radius),
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
    shift: rare.Shift | None = None  #: how false tracks are drawn where they are rare; None: as they are
    #: how further tracks of the target are drawn where its ends are rare; None: there are none
    ends: Ends | None = None
    block: int = base.BLOCK
    gaussian = False

    def simulate(self, first: int, count: int) -> np.ndarray:
        """The sums of one block, in the order of the layout."""
        axes = self.axes
        F, K = len(axes.filters), len(axes.k)
        sums = base.empty_sums(F, K, COORDINATES)
        own = {name: np.zeros(shape) for name, shape in tracker.shapes(F, K, len(axes.thresholds)).items()}
        track_sums, work = tracker.TrackSums(sums, **own), workspace(F)
        inputs = (axes.world, axes.detections, axes.field, self.trackers)
        tracker.simulate_block(*inputs, work, first, count, track_sums)
        if self.shift is not None:
            weighted = rare.WeightedSums(np.zeros((F, K, 4)), np.zeros((F, 3)))
            drawn = (self.seeds, self.field_about_false, self.shift, self.trackers)
            rare.simulate_false(*drawn, work, axes.world.dt, first, count, own["scores"][1], weighted)
            own |= weighted._asdict()
        elif axes.field.cells.density > 0:
            false = (self.seeds, self.field_about_false, self.trackers)
            tracker.simulate_false(*false, work, axes.world.dt, first, count, track_sums)
        if self.ends is not None:
            ended = EndSums(np.zeros((F, K, KINDS, 4)), np.zeros((F, 3)))
            simulate_ends(*inputs, self.ends, work, first, count, ended)
            own |= ended._asdict()
        return base.packed(self.layout, sums, **own)


def prepare(case: Case) -> Plan:
    """Design the trackers of a case, and compute the exact laws of their errors and of initiation."""
    spec, scene = case.spec, build_scene(case)
    given, specs = filters.conditions(spec), filters.tracker_specs(spec)
    F, K = len(specs), len(scene.t)
    common = base.shapes(F, K, COORDINATES, SIZE)
    del common["paired"]  # trackers keep tracks in different realisations
    own, labels = tracker.shapes(F, K, len(filters.THRESHOLDS)), axes(case, scene, specs, given)
    shift = drawn = None
    if spec.rare is not None and spec.rare.seeks_false_tracks:
        del own["begun"]
        own |= {"held": (F, K, 4), "drawn": (F, 3)}
        shift = rare.Shift(noise_key(case, "rare"), noise_key(case, "rare plots"), np.array(spec.rare.shares()))
    if spec.rare is not None and spec.rare.seeks_ends:
        own |= {"ended": (F, K, KINDS, 4), "ended_drawn": (F, 3)}
        drawn = ends(case, specs, given, labels)
    return Plan(
        layout=Layout(**common, **own),
        axes=labels,
        trackers=filters.trackers(specs, given),
        field_about_false=filters.field(noise_key(case, "seeds"), spec.sensor.sector, given),
        seeds=noise_key(case, "places"),
        shift=shift,
        ends=drawn,
    )


def axes(case: Case, scene: Scene, specs: list[filters.TrackerSpec], given: filters.Conditions) -> ClutterAxes:
    """Labels; exact σ of filters that know the target's plots, where all detections are certain; laws of initiation."""
    spec, detections = case.spec, detected_plots(case, scene)
    F, K = len(specs), len(scene.t)
    least = np.array([2 if one.association == "known" else one.m for one in specs])
    available = np.broadcast_to((np.arange(1, K + 1) >= least[:, None])[..., None, None], (F, K, COORDINATES, SIZE))
    values = reference_values(spec, scene, detections.certain)
    confirmed, begun = initiation_laws(spec, specs, given, detections)
    return ClutterAxes(
        **base.common_labels(spec, scene, np.full(F, SIZE), available, values),
        associations=tuple(one.association for one in specs),
        thresholds=filters.THRESHOLDS,
        exact_confirmed=confirmed,
        exact_begun=begun,
        area_m2=spec.sensor.sector.area_m2(),
        world=base.world(case, scene),
        detections=detections,
        field=filters.field(noise_key(case, "false"), spec.sensor.sector, given),
    )


def initiation_laws(
    spec: Keys, specs: list[filters.TrackerSpec], given: filters.Conditions, detections: Detections
) -> tuple[np.ndarray, np.ndarray]:
    """Probabilities (F, K) that a track of the target was confirmed by each scan, and one begun by a false plot at it.

    NaN where no law is known: the first needs open gates and no false plots, the second a rule 2 of n."""
    probability = np.where(detections.certain < 0, detections.probability, detections.certain)
    confirmed, begun = np.full((2, len(specs), len(probability)), np.nan)
    for f, one in enumerate(specs):
        if one.association == "known":
            continue
        if given.density == 0 and one.gate_probability == 1:
            confirmed[f] = filters.confirmed_by(probability, one.m, one.n)
        if one.m == 2 and spec.sensor.sector:
            begun[f] = filters.false_pairs(spec.sensor.sector, given, one, len(probability))
    return confirmed, begun


def reference_values(spec: Keys, scene: Scene, certain: np.ndarray) -> dict[str, np.ndarray]:
    """Exact errors, as `exact_values` returns them, of filters that know the target's plots."""
    known = np.array([member.association == "known" for member in spec.filters])
    if (certain < 0).any() or certain[0] == 0:
        known[:] = False
    specs = [one if is_known else None for one, is_known in zip(filter_specs(spec), known, strict=True)]
    designs = [base.designs([one], scene, certain[None].astype(float))[0] if one else [] for one in specs]
    return exact_values(scene, designs, np.ones(1), SIZE)

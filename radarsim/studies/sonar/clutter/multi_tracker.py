"""All tracks of one tracker over the plots of many scans: for recorded plots, and for the map.

The steps are those of the kernels, with a track in each lane. In addition tracks compete for plots: a plot goes to the
nearest track, confirmed tracks before tentative ones, and plots that no track takes begin new tracks."""

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np

from radarsim.studies.sonar.clutter.kernels import gate as kernels_gate
from radarsim.studies.sonar.clutter.kernels import track_prediction, track_rules, track_update
from radarsim.studies.sonar.clutter.tracker_design import Conditions, TrackerSpec, trackers
from radarsim.studies.sonar.kernels.chunks import CHUNK


@dataclass
class TrackHistory:
    """A track: its lane (chunk, index), its state under the rules, and the estimates at each of its scans.

    scans holds the numbers of the scans; states (n, 4) r, vr, b, vb with variances (n, 4), NaN for rates not yet known;
    scores (n,); predictions (n, 5) the predicted position and the covariance of its innovation."""

    lane: tuple[int, int]
    state: int = track_rules.TENTATIVE
    age: int = 1
    hits: int = 1
    misses: int = 0
    since: float = 0.0
    score: float = 0.0
    was_confirmed: bool = False
    scans: list[int] = field(default_factory=list)
    states: list[np.ndarray] = field(default_factory=list)
    variances: list[np.ndarray] = field(default_factory=list)
    scores: list[float] = field(default_factory=list)
    predictions: list[np.ndarray] = field(default_factory=list)


class MultiTracker:
    """All tracks of one tracker, alive and ended."""

    def __init__(self, spec: TrackerSpec, conditions: Conditions):
        arrays = trackers([spec], conditions)
        self.spec, self.conditions, self.manoeuvre = spec, conditions, arrays.manoeuvre[0]
        association, chi_square = int(arrays.association[0]), arrays.chi_square[0]
        self.rule = kernels_gate.AssociationRule(
            association, chi_square, conditions.detection, spec.gate_probability, conditions.density, spec.speed
        )
        self.chunks: list[track_prediction.Tracks] = []
        self.free: list[tuple[int, int]] = []
        self.alive: list[TrackHistory] = []
        self.ended: list[TrackHistory] = []

    def process(self, scan: int, dt: float, r: np.ndarray, b: np.ndarray) -> None:
        """Process the plots (n,) of a scan, dt after the last one."""
        predicted = self._predicted(dt)
        innovations, distance = self._distances(predicted, r, b)
        owner = self._owners(distance)
        associations = [np.zeros((6, CHUNK)) for _ in self.chunks]
        for a, track in enumerate(self.alive):
            self._associate(track, predicted[a], innovations[:, a, owner == a], associations)
        new = [self._begin(r[p], b[p], associations) for p in np.flatnonzero(owner < 0)]
        for chunk, rows in zip(self.chunks, associations, strict=True):
            joint = self.rule.association == kernels_gate.PDA
            track_update.update(chunk, dt, self.conditions.period, self.conditions.sigma, self.manoeuvre, joint, rows)
        for track, gate in zip(self.alive, predicted, strict=True):
            self._judge(track)
            track.predictions.append(gate)
        for track in new:
            track.predictions.append(np.full(5, np.nan))
        self.alive += new
        for track in self.alive:
            self._record(track, scan)
        self._remove_ended()

    def _predicted(self, dt: float) -> np.ndarray:
        """Positions and innovation covariances (A, 5) of live tracks; after one plot widened by the target speed."""
        rows = []
        for chunk in self.chunks:
            rows.append(np.empty((5, CHUNK)))
            track_prediction.predict(chunk, dt, self.conditions.period, self.conditions.sigma, self.manoeuvre, rows[-1])
        out = np.array([rows[c][:, i] for c, i in (track.lane for track in self.alive)]).reshape(-1, 5)
        for track, row in zip(self.alive, out, strict=True):
            track.since += dt
            if not self._settled(track):
                reach = self.spec.speed * track.since
                row[2] += reach**2
                row[4] += (reach / max(row[0], kernels_gate.MIN_RANGE_M)) ** 2
        return out

    def _settled(self, track: TrackHistory) -> bool:
        chunk, i = track.lane
        return bool(self.chunks[chunk].plots[i] > 1.5)

    def _distances(self, predicted: np.ndarray, r: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Innovations (2, A, n), bearings within half a circle, and their normalised squares (A, n)."""
        nu_r = r - predicted[:, :1]
        nu_b = np.mod(b - predicted[:, 1:2] + np.pi, 2 * np.pi) - np.pi
        rr, rb, bb = (predicted[:, j, None] for j in (2, 3, 4))
        return np.stack([nu_r, nu_b]), (bb * nu_r**2 - 2 * rb * nu_r * nu_b + rr * nu_b**2) / (rr * bb - rb**2)

    def _owners(self, distance: np.ndarray) -> np.ndarray:
        """The track (n,) that each plot goes to, -1 for none: the nearest track, but confirmed tracks first.

        Only probabilistic association takes more than one plot, and only for a track of two plots or more."""
        owner = np.full(distance.shape[1], -1)
        takes_several = np.array(
            [self.rule.association == kernels_gate.PDA and self._settled(track) for track in self.alive]
        )
        confirmed = np.array([track.state == track_rules.CONFIRMED for track in self.alive])
        busy = np.zeros(len(self.alive), dtype=bool)
        for group in (confirmed, ~confirmed) if len(self.alive) else ():
            a, p = np.nonzero((distance <= self.rule.chi_square) & group[:, None])
            order = np.argsort(distance[a, p], kind="stable")
            for track, plot in zip(a[order], p[order], strict=True):
                if owner[plot] < 0 and (takes_several[track] or not busy[track]):
                    owner[plot], busy[track] = track, True
        return owner

    def _associate(
        self, track: TrackHistory, gate: np.ndarray, innovations: np.ndarray, associations: list[np.ndarray]
    ) -> None:
        """Associate a track with the plots that it owns, by their innovations (2, n); write to its chunk's rows."""
        nu = np.ascontiguousarray(innovations)
        result = kernels_gate.associate_innovations(self.rule, self._settled(track), gate[0], tuple(gate[2:]), *nu)
        chunk, i = track.lane
        associations[chunk][:, i] = result.has_plot, result.nu_r, result.nu_b, result.rr, result.rb, result.bb
        track.age, track.score = track.age + 1, track.score + result.score
        if result.has_plot:
            track.hits, track.misses, track.since = track.hits + 1, 0, 0.0
        else:
            track.misses += 1

    def _begin(self, r: float, b: float, associations: list[np.ndarray]) -> TrackHistory:
        """A track of one plot, in a free lane."""
        if not self.free:
            self.free = [(len(self.chunks), i) for i in reversed(range(CHUNK))]
            self.chunks.append(track_prediction.no_tracks())
            associations.append(np.zeros((6, CHUNK)))
        chunk, i = self.free.pop()
        track_prediction.clear_track(self.chunks[chunk], i)
        associations[chunk][:, i] = 1.0, r, b, 0.0, 0.0, 0.0
        return TrackHistory((chunk, i))

    def _judge(self, track: TrackHistory) -> None:
        rule = float(self.spec.m), float(self.spec.n), float(self.spec.misses)
        state = track_rules.next_state(track.state, float(track.hits), float(track.misses), float(track.age), *rule)
        chunk, i = track.lane
        uncertain = self.chunks[chunk].P[:, 0, i].max() > self.spec.lost**2
        track.state = track_rules.NONE if track.state == track_rules.CONFIRMED and uncertain else state
        track.was_confirmed |= track.state == track_rules.CONFIRMED

    def _record(self, track: TrackHistory, scan: int) -> None:
        chunk, i = track.lane
        tracks = self.chunks[chunk]
        unit = np.repeat(self.conditions.sigma, 2) / np.tile([1.0, self.conditions.period], 2)
        x, P = tracks.x[:, :2, i].ravel(), tracks.P[:, [0, 3], i].ravel()
        is_known = np.array([True, self._settled(track)] * 2)
        track.scans.append(scan)
        track.states.append(np.where(is_known, x, np.nan))
        track.variances.append(np.where(is_known, P * unit**2, np.nan))
        track.scores.append(track.score)

    def _remove_ended(self) -> None:
        ended = [track for track in self.alive if track.state == track_rules.NONE]
        self.alive = [track for track in self.alive if track.state != track_rules.NONE]
        self.free += [track.lane for track in ended]
        self.ended += ended

    def confirmed(self) -> list[TrackHistory]:
        """The tracks that were confirmed at some time, ordered by their first scan."""
        tracks = (track for track in (*self.ended, *self.alive) if track.was_confirmed)
        return sorted(tracks, key=lambda track: track.scans[0])


def confirmed_tracks(
    spec: TrackerSpec, conditions: Conditions, scans: Iterable[tuple[float, np.ndarray, np.ndarray]]
) -> list[TrackHistory]:
    """The confirmed tracks over scans (t, r (n,), b (n,)) in order of time."""
    multi_tracker, last = MultiTracker(spec, conditions), None
    for k, (t, r, b) in enumerate(scans):
        multi_tracker.process(k, 0.0 if last is None else t - last, r, b)
        last = t
    return multi_tracker.confirmed()

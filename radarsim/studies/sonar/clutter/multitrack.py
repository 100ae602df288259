"""All tracks of one tracker over the plots of many scans, among themselves: for recorded plots, and for the map.

The steps are the kernels' own, one track in each lane. Beyond what they do for a single track, tracks compete: a plot
goes to the track that it is nearest to, confirmed tracks before tentative ones, and what no track took begins a track.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np

from radarsim.studies.sonar.clutter.filters import TrackerSpec, trackers
from radarsim.studies.sonar.clutter.kernels import tracker as kernels
from radarsim.studies.sonar.clutter.kernels.field import CLOSEST, PDA, Rule, associate_innovations
from radarsim.studies.sonar.clutter.kernels.tracks import Tracks, clear, no_tracks, predict, update
from radarsim.studies.sonar.kernels.steps import CHUNK


@dataclass
class TrackHistory:
    """One track: its lane, its state under the rules, and the estimates at each of its scans.

    scans holds their numbers; states (n, 4) r, vr, b, vb with variances (n, 4), not-a-number for rates not yet known;
    scores (n,); gates (n, 5) the predicted place and its innovation covariance.
    """

    lane: tuple[int, int]
    state: int = kernels.TENTATIVE
    age: int = 1
    hits: int = 1
    misses: int = 0
    since: float = 0.0
    score: float = 0.0
    found: bool = False
    scans: list = field(default_factory=list)
    states: list = field(default_factory=list)
    variances: list = field(default_factory=list)
    scores: list = field(default_factory=list)
    gates: list = field(default_factory=list)


class MultiTracker:
    """The tracks of one tracker, alive and ended."""

    def __init__(self, spec: TrackerSpec, period: float, sigma: np.ndarray, detection: float, density: float):
        arrays = trackers([spec], period, sigma, detection, density)
        self.spec, self.period, self.sigma, self.arrays = spec, period, sigma, arrays
        self.rule = Rule(
            int(arrays.association[0]),
            arrays.gate[0],
            arrays.detection,
            arrays.inside[0],
            arrays.density,
            arrays.speed[0],
        )
        self.chunks: list[Tracks] = []
        self.free: list[tuple[int, int]] = []
        self.alive: list[TrackHistory] = []
        self.ended: list[TrackHistory] = []

    def process(self, scan: int, dt: float, r: np.ndarray, b: np.ndarray) -> None:
        """Process the plots (n,) of a scan, dt after the last one."""
        predicted = self._predicted(dt)
        innovations, distance = self._distances(predicted, r, b)
        owner = self._owners(distance)
        taken = [np.zeros((6, CHUNK)) for _ in self.chunks]
        for a, track in enumerate(self.alive):
            self._associate(track, predicted[a], innovations[:, a, owner == a], taken)
        new = [self._begin(r[p], b[p], taken) for p in np.flatnonzero(owner < 0)]
        for chunk, rows in zip(self.chunks, taken, strict=True):
            joint = self.rule.association == PDA
            update(chunk, dt, self.period, self.sigma, self.arrays.manoeuvre[0], joint, rows)
        for track, gate in zip(self.alive, predicted, strict=True):
            self._judge(track)
            track.gates.append(gate)
        for track in new:
            track.gates.append(np.full(5, np.nan))
        self.alive += new
        for track in self.alive:
            self._record(track, scan)
        self._remove_ended()

    def _predicted(self, dt: float) -> np.ndarray:
        """Places and innovation covariances (A, 5) of the tracks alive; of one plot the speed of targets widens it."""
        rows = []
        for chunk in self.chunks:
            rows.append(np.empty((5, CHUNK)))
            predict(chunk, dt, self.period, self.sigma, self.arrays.manoeuvre[0], rows[-1])
        out = np.array([rows[c][:, i] for c, i in (track.lane for track in self.alive)]).reshape(-1, 5)
        for track, row in zip(self.alive, out, strict=True):
            track.since += dt
            if not self._settled(track):
                reach = self.spec.speed * track.since
                row[2] += reach**2
                row[4] += (reach / max(row[0], CLOSEST)) ** 2
        return out

    def _settled(self, track: TrackHistory) -> bool:
        chunk, i = track.lane
        return bool(self.chunks[chunk].plots[i] > 1.5)

    def _distances(self, predicted: np.ndarray, r: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Innovations (2, A, n), bearings turned to within half a circle, and their squares (A, n) by S⁻¹."""
        nu_r = r - predicted[:, :1]
        nu_b = np.mod(b - predicted[:, 1:2] + np.pi, 2 * np.pi) - np.pi
        rr, rb, bb = (predicted[:, j, None] for j in (2, 3, 4))
        return np.stack([nu_r, nu_b]), (bb * nu_r**2 - 2 * rb * nu_r * nu_b + rr * nu_b**2) / (rr * bb - rb**2)

    def _owners(self, distance: np.ndarray) -> np.ndarray:
        """The track (n,) that each plot goes to, -1 for none: the nearest, confirmed tracks first.

        Only probabilistic association takes more than one plot, and only for a track of two plots or more.
        """
        owner = np.full(distance.shape[1], -1)
        several = np.array([self.rule.association == PDA and self._settled(track) for track in self.alive])
        confirmed = np.array([track.state == kernels.CONFIRMED for track in self.alive])
        busy = np.zeros(len(self.alive), dtype=bool)
        for group in (confirmed, ~confirmed) if len(self.alive) else ():
            a, p = np.nonzero((distance <= self.rule.gate) & group[:, None])
            order = np.argsort(distance[a, p], kind="stable")
            for track, plot in zip(a[order], p[order], strict=True):
                if owner[plot] < 0 and (several[track] or not busy[track]):
                    owner[plot], busy[track] = track, True
        return owner

    def _associate(
        self, track: TrackHistory, gate: np.ndarray, innovations: np.ndarray, taken: list[np.ndarray]
    ) -> None:
        """Let a track take of the plots that it owns, by their innovations (2, n); into the rows of its chunk."""
        nu = np.ascontiguousarray(innovations)
        found = associate_innovations(self.rule, self._settled(track), gate[0], tuple(gate[2:]), *nu)
        chunk, i = track.lane
        taken[chunk][:, i] = found.taken, found.nu_r, found.nu_b, found.rr, found.rb, found.bb
        track.age, track.score = track.age + 1, track.score + found.score
        if found.taken:
            track.hits, track.misses, track.since = track.hits + 1, 0, 0.0
        else:
            track.misses += 1

    def _begin(self, r: float, b: float, taken: list[np.ndarray]) -> TrackHistory:
        """A track of one plot, in a free lane."""
        if not self.free:
            self.free = [(len(self.chunks), i) for i in reversed(range(CHUNK))]
            self.chunks.append(no_tracks())
            taken.append(np.zeros((6, CHUNK)))
        chunk, i = self.free.pop()
        clear(self.chunks[chunk], i)
        taken[chunk][:, i] = 1.0, r, b, 0.0, 0.0, 0.0
        return TrackHistory((chunk, i))

    def _judge(self, track: TrackHistory) -> None:
        rules = float(self.spec.m), float(self.spec.n), float(self.spec.misses)
        now = kernels.next_state(track.state, float(track.hits), float(track.misses), float(track.age), *rules)
        chunk, i = track.lane
        uncertain = self.chunks[chunk].P[:, 0, i].max() > self.spec.lost**2
        track.state = kernels.NONE if track.state == kernels.CONFIRMED and uncertain else now
        track.found |= track.state == kernels.CONFIRMED

    def _record(self, track: TrackHistory, scan: int) -> None:
        chunk, i = track.lane
        tracks, unit = self.chunks[chunk], np.repeat(self.sigma, 2) / np.tile([1.0, self.period], 2)
        x, P = tracks.x[:, :2, i].ravel(), tracks.P[:, [0, 3], i].ravel()
        known = np.array([True, self._settled(track)] * 2)
        track.scans.append(scan)
        track.states.append(np.where(known, x, np.nan))
        track.variances.append(np.where(known, P * unit**2, np.nan))
        track.scores.append(track.score)

    def _remove_ended(self) -> None:
        over = [track for track in self.alive if track.state == kernels.NONE]
        self.alive = [track for track in self.alive if track.state != kernels.NONE]
        self.free += [track.lane for track in over]
        self.ended += over

    def confirmed(self) -> list[TrackHistory]:
        """The tracks that were confirmed, by their first scan."""
        return sorted((track for track in (*self.ended, *self.alive) if track.found), key=lambda track: track.scans[0])


def confirmed_tracks(
    spec: TrackerSpec,
    period: float,
    sigma: np.ndarray,
    detection: float,
    density: float,
    scans: Iterable[tuple[float, np.ndarray, np.ndarray]],
) -> list[TrackHistory]:
    """The confirmed tracks over scans (t, r (n,), b (n,)) in order of time; density per m²."""
    tracker, last = MultiTracker(spec, period, sigma, detection, density), None
    for k, (t, r, b) in enumerate(scans):
        tracker.process(k, 0.0 if last is None else t - last, r, b)
        last = t
    return tracker.confirmed()

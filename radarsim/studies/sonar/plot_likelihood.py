"""The likelihood of recorded sonar plots under a filter."""

import itertools
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from radarsim.config.experiment import Case
from radarsim.kernels.gap_noise import manoeuvre_noise
from radarsim.kernels.kalman_algebra import unpack
from radarsim.kernels.likelihood import log_likelihood_of_tracks, start_factor, with_lasting_errors
from radarsim.physics.motion import transition
from radarsim.studies.error_law import CORRELATION, MANOEUVRES, OUTLIERS, STATED_ERRORS, ErrorLaw
from radarsim.studies.gross_errors import data_span, soundness_by_column, without_gross_starts
from radarsim.studies.recording_interface import ALL_KINDS, track_batches, usual_interval_s
from radarsim.studies.sonar import conversion
from radarsim.studies.sonar.scene import lateral_scale, third_coordinate
from radarsim.studies.sonar.tracking import BEARING, RANGE, THIRD_COLUMN_AND_KEY, unwrap_bearings

MODELLED_KINDS = ("growing_memory", "kalman")  # kinds that model the target's motion and white errors
STARTING_PLOTS = 3  # complete plots from which the likelihood determines the state of a track
WIDE_RATE_SIGMAS = 1e3  # σ of a plot by which a rate may differ, in an interval, from that of the first two plots
MIN_SIGMA_SHARE = 1e-4  # of a configured σ: less counts as zero
MIN_MANOEUVRE_SHARE = 1e-8  # of the variance that moves a target by a σ of a plot: less counts as zero


class PlotLikelihood:
    """The likelihood of tracks under a filter's model.

    A polynomial of the filter's degree in each coordinate, whose next derivative is random, and independent errors of
    range, bearing and a third coordinate. The state before the first complete plot is taken as unknown."""

    def __init__(self, case: Case, number: int, tracks: Sequence[Mapping[str, np.ndarray]]):
        self.spec: Any = case.spec
        # Errors that last are of range and bearing, which in other frames are not measured along one direction each.
        self.explains: tuple[str, ...] = (OUTLIERS, CORRELATION) if self.spec.frame == "polar" else (OUTLIERS,)
        member, scale = self.spec.filters[number], lateral_scale(self.spec, 2)
        self.filter, self.tracks, self.size = member.name, len(tracks), member.degree + 1
        self.rows, self.usual_s = sum(len(columns["t_s"]) for columns in tracks), usual_interval_s(tracks)
        sensor = self.spec.sensor
        third, third_sigma = third_coordinate(sensor)
        sigma = {RANGE: sensor.sigma_range_m, BEARING: sensor.sigma_bearing_rad}
        sigma |= {THIRD_COLUMN_AND_KEY[third][1]: third_sigma} if third else {}
        self.coordinates = len(sigma)
        configured = list(sigma.values())
        smallest = [MIN_SIGMA_SHARE * configured_sigma for configured_sigma in sigma.values()]
        names = list(sigma)
        if member.kind == "kalman":
            names.append(f"filters.{number}.manoeuvre_variance")
            configured.append(member.manoeuvre_variance or 0.0)
            smallest.append(MIN_MANOEUVRE_SHARE * (sensor.sigma_range_m / sensor.scan_period_s**self.size) ** 2)
        self.keys, self.stated, self.zero_limits = tuple(names), np.array(configured), np.array(smallest)
        if member.kind == "kalman":
            self.explains = (*self.explains, MANOEUVRES)
        self.given_tracks, self.columns = list(tracks), tuple(name for name in tracks[0] if name != "t_s")
        self.outlier_kinds = self.columns if self.spec.frame == "polar" else ALL_KINDS
        self.far_kinds: tuple[str, ...] = ()
        self.has_offsets = self.outlier_kinds != ALL_KINDS
        self.is_smooth = True
        self.span = data_span(tracks, self.columns)
        if self.spec.frame != "polar":
            self.span[:2] = 2 * max(float(np.nanmax(np.abs(track["range_m"]), initial=0.0)) for track in tracks)
        smooth_tracks = [{**track, "bearing_rad": unwrap_bearings(track["bearing_rad"])} for track in tracks]
        self.cleaned_tracks = [without_gross_starts(track, self.columns, STARTING_PLOTS) for track in smooth_tracks]
        problems = (self._problem(number, track, scale) for number, track in enumerate(self.cleaned_tracks))
        whole_problems = (problem for problem in problems if problem is not None)
        self.batches = [_joined(batch) for batch in track_batches(whole_problems, lambda problem: len(problem.t))]

    def _problem(self, track: int, columns: Mapping[str, np.ndarray], scale: np.ndarray) -> "_TracksProblem | None":
        """A track from its first complete plot on; None if it has none."""
        z, C, size = np.stack([columns[name] for name in self.columns]), self.coordinates, self.size
        is_whole = np.isfinite(z).all(axis=0)
        if not is_whole.any():
            return None
        is_used = np.isfinite(z).T.copy()
        if self.spec.frame != "polar":
            is_used[:, :2] = is_used[:, :2].all(axis=1, keepdims=True)
        first = int(is_whole.argmax())
        rows = first + np.flatnonzero(is_used[first:].any(axis=1))
        t, z, is_used, is_whole = columns["t_s"][rows], z[:, rows], is_used[rows], is_whole[rows]
        steps = np.diff(t, prepend=t[0])
        eye = np.eye(C)
        F = np.stack([np.kron(eye, transition(step, size)) for step in steps])
        period = self.spec.sensor.scan_period_s
        noises = [unpack(manoeuvre_noise(1.0, step, period, size))[:size, :size] for step in steps.tolist()]
        Q = np.stack([np.kron(np.diag(scale), noise) for noise in noises])
        first_scored_row = int(np.searchsorted(np.cumsum(is_whole), STARTING_PLOTS, side="right"))
        usual_interval_s = float(np.median(steps[1:])) if len(steps) > 1 else period
        rates = WIDE_RATE_SIGMAS * usual_interval_s ** -np.arange(1.0, size)
        is_used[0] = False  # it starts the track
        second_whole = int(is_whole[1:].argmax()) + 1 if is_whole[1:].any() else 0
        z, t = np.where(np.isfinite(z), z, 0.0), t - t[0]
        numbers = np.array([len(t)]), np.array([second_whole]), np.array([first_scored_row])
        problem = _TracksProblem([(track, rows)], F, Q, z, is_used, t, rates[None], *numbers)
        _, directions, variance = self._numbers(problem, self.stated[:C])  # the stated errors, whatever is tried
        position_sigma = np.sqrt(np.diag(directions[0].T @ np.diag(variance[0]) @ directions[0]))
        return problem._replace(rates=np.outer(rates, position_sigma)[None])

    def _numbers(self, problem: "_TracksProblem", sigma: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Positions (n, C) in the frame of the filters, independent directions, and variances (n, C) along these.

        The directions (n, C, C) are rows."""
        n, C = problem.is_used.shape
        directions, variance = np.tile(np.eye(C), (n, 1, 1)), np.tile(sigma**2, (n, 1))
        positions = problem.z.T.copy()
        if self.spec.frame != "polar":
            convert = conversion.convert_plainly if self.spec.frame == "cartesian" else conversion.convert_unbiased
            x, y, _ = convert(*problem.z[:2], *sigma[:2])
            is_plain = self.spec.frame == "cartesian"
            weighting = problem.z[:2] if is_plain else conversion.weighting_positions(*problem.z[:2])
            xx, xy, yy = convert(*weighting, *sigma[:2])[2]
            values, vectors = np.linalg.eigh(np.stack([xx, xy, xy, yy], axis=1).reshape(n, 2, 2))
            positions[:, 0], positions[:, 1] = x, y
            variance[:, :2], directions[:, :2, :2] = np.maximum(values, 0.0), np.swapaxes(vectors, 1, 2)
        return positions, directions, variance

    def _start(
        self, problem: "_TracksProblem", sigma: np.ndarray, outliers: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """The states (T, d) at the first rows of tracks, and their covariances (T, d, d)."""
        C, size, firsts = self.coordinates, self.size, problem.first_rows
        positions, directions, variance = self._numbers(problem, sigma)
        x, P = np.zeros((len(firsts), C * size)), np.zeros((len(firsts), C * size, C * size))
        x[:, ::size] = positions[firsts]
        has_rate = problem.second_whole > 0
        seconds = (firsts + problem.second_whole)[has_rate]
        x[has_rate, 1::size] = (positions[seconds] - positions[firsts[has_rate]]) / problem.t[seconds, None]
        factors = np.sqrt([start_factor(row) for row in outliers])
        start = np.einsum("tij,ti,tik->tjk", directions[firsts], variance[firsts], directions[firsts])
        P[:, ::size, ::size] = start * np.outer(factors, factors)
        for i in range(1, size):
            P[:, np.arange(C) * size + i, np.arange(C) * size + i] = problem.rates[:, i - 1] ** 2
        return x, P

    def _tracks_score(
        self, problem: "_TracksProblem", values: np.ndarray, law: ErrorLaw
    ) -> tuple[np.ndarray, np.ndarray]:
        """The log-densities (n, C) of the numbers of some tracks, and their probabilities to be no outliers."""
        sigma, C, size = values[: self.coordinates], self.coordinates, self.size
        outliers, correlation = law.outlier_rows(C), law.correlation
        manoeuvre = float(values[C]) if len(values) > C else 0.0
        positions, directions, variance = self._numbers(problem, sigma)
        H = np.zeros((*directions.shape[:2], C * size))
        H[:, :, ::size] = directions
        z = np.einsum("nij,nj->ni", directions, positions)
        x, P = self._start(problem, sigma, outliers)
        model, scale, white = (x, P, problem.F, problem.Q, H), manoeuvre, 1.0
        if correlation:
            error_loading = np.zeros((C * size, C))
            coordinates = np.arange(C)
            error_loading[coordinates * size, coordinates] = -sigma
            intervals = np.diff(problem.t, prepend=0.0)
            intervals[problem.first_rows] = 0.0
            lasting = correlation ** (intervals / self.usual_s)
            model = with_lasting_errors(x, P, error_loading, problem.F, manoeuvre * problem.Q, H, variance, lasting)
            scale, white = 1.0, 0.0
        score, soundness = np.empty((2, *z.shape))
        errors = outliers, problem.first_scored_rows, law.manoeuvres, self.span, white
        log_likelihood_of_tracks(
            problem.lengths, *model, z, variance, problem.is_used, scale, *errors, score, soundness
        )
        return score, soundness

    def _score(self, values: np.ndarray, law: ErrorLaw) -> float:
        """The sum over all tracks; the first plots, which find the state, are left out."""
        return sum(float(self._tracks_score(batch, values, law)[0][batch.is_scored].sum()) for batch in self.batches)

    def __call__(self, values: np.ndarray, law: ErrorLaw = STATED_ERRORS) -> float:
        """The logarithm of the likelihood; a bias is not part of the model."""
        return self._score(values, law)

    def soundness(self, values: np.ndarray, law: ErrorLaw) -> list[dict[str, np.ndarray]]:
        """The probability of each number that it is no outlier; in x and y of range and bearing together."""
        judged = []
        for batch in self.batches:
            soundness = self._tracks_score(batch, values, law)[1]
            if self.spec.frame != "polar":
                soundness[:, :2] = soundness[:, :2].min(axis=1, keepdims=True)
            parts = np.split(soundness, batch.first_rows[1:])
            judged += [(*track_and_rows, part) for track_and_rows, part in zip(batch.tracks, parts, strict=True)]
        return soundness_by_column(self.columns, self.given_tracks, self.cleaned_tracks, judged)

    def by_number(self, values: np.ndarray) -> dict[str, float]:
        """The logarithm of the likelihood of complete plots: their numbers are not independent in every frame."""
        return {"plot": self._score(values, STATED_ERRORS)}


class _TracksProblem(NamedTuple):
    """Recorded tracks as the kernel needs them, one after the other, each from its first complete plot on."""

    tracks: list[tuple[int, np.ndarray]]  #: of each its number, and which of its rows these are
    F: np.ndarray  #: (n, d, d) transitions
    Q: np.ndarray  #: (n, d, d) process noise of unit variance
    z: np.ndarray  #: (C, n) values as measured
    is_used: np.ndarray  #: (n, C) which values update the state
    t: np.ndarray  #: (n,) from the first plot of a track
    rates: np.ndarray  #: (tracks, size - 1, C) σ of the rates of each order before the first plot
    lengths: np.ndarray  #: (tracks,) the numbers of rows
    second_whole: np.ndarray  #: (tracks,) row of the second complete plot in a track, 0 if there is none
    first_scored_rows: np.ndarray  #: (tracks,) row in a track from which the state is known

    @property
    def first_rows(self) -> np.ndarray:
        """The first row (tracks,) of each track."""
        return np.cumsum(self.lengths) - self.lengths

    @property
    def is_scored(self) -> np.ndarray:
        """Whether the state is known before a row (n,)."""
        return np.arange(len(self.t)) >= np.repeat(self.first_rows + self.first_scored_rows, self.lengths)


def _joined(problems: Sequence[_TracksProblem]) -> _TracksProblem:
    """The tracks of several problems as one."""
    first, F, Q, z, *arrays = zip(*problems, strict=True)
    return _TracksProblem(
        list(itertools.chain(*first)), np.concatenate(F), np.concatenate(Q), np.concatenate(z, axis=1),
        *map(np.concatenate, arrays),
    )  # fmt: skip


def likelihood(
    case: Case, filter_name: str | None, tracks: Sequence[Mapping[str, np.ndarray]]
) -> PlotLikelihood | None:
    """The likelihood of tracks under a filter; without a name, under the first Kalman filter with a manoeuvre variance.

    Without such a filter, under the first one that models the target. None if the filter does not model it."""
    members = case.spec.filters
    candidates = [i for i, member in enumerate(members) if member.kind in MODELLED_KINDS and member.association is None]
    if filter_name is None:
        kalman = [i for i in candidates if members[i].kind == "kalman" and members[i].manoeuvre_variance]
        candidates = [*kalman, *candidates][:1]
    else:
        candidates = [i for i in candidates if members[i].name == filter_name]
    return PlotLikelihood(case, candidates[0], tracks) if candidates else None

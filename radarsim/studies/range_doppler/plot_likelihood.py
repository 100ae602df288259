"""How likely recorded plots are under a filter's model."""

import itertools
import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from radarsim.config.experiment import Case
from radarsim.kernels.kalman_algebra import unpack
from radarsim.kernels.likelihood import log_likelihood_of_tracks, start_factor, with_lasting_errors
from radarsim.physics.motion import transitions
from radarsim.studies.error_law import EXPLANATIONS, STATED_ERRORS, ErrorLaw
from radarsim.studies.gross_errors import data_span, soundness_by_column, without_gross_starts
from radarsim.studies.range_doppler.config import Filter, Keys
from radarsim.studies.range_doppler.filter_design import noise_by_time, observation
from radarsim.studies.range_doppler.kernels import recorded_rows
from radarsim.studies.range_doppler.tracking import MEASURED, START_RANGES, configured_variances
from radarsim.studies.recording_interface import track_batches, usual_interval_s

MIN_MANOEUVRE = 1e-6  # of the stated manoeuvre variance, which counts as none
WIDE_VELOCITY_MPS, WIDE_ACCELERATION_MPS2 = 3e4, 3e3  # standard deviations before the first plot: nothing is known


def likelihood_filter(spec: Keys, filter_name: str | None) -> Filter | None:
    """The filter of a name, where there is one, else the one that takes most of a plot; None: a package's filter."""
    same_name = [f for f in spec.filters if f.name == filter_name]
    study_filters = [f for f in same_name or spec.filters if isinstance(f, Filter)]
    return max(study_filters, key=lambda candidate: len(candidate.observes), default=None)


class PlotLikelihood:
    """How likely tracks are under a filter's model: range and velocity of independent errors, acceleration that the
    filter's process noise changes. The state before the first plot is taken as unknown, whatever start the config
    states."""

    explains: tuple[str, ...] = EXPLANATIONS

    def __init__(self, case: Case, filter_name: str | None, tracks: Sequence[Mapping[str, np.ndarray]]):
        options = likelihood_filter(case.spec, filter_name)
        assert options is not None
        self.filter, self.tracks = options.name, len(tracks)
        variance = configured_variances(case)[case.spec.filters.index(options)]
        self.rows, self.usual_s = sum(len(columns["t_s"]) for columns in tracks), usual_interval_s(tracks)
        radar, self.observes = case.spec.radar, len(options.observes)
        sigmas = {"radar.sigma_range_m": radar.sigma_range_m, "radar.sigma_velocity_mps": radar.sigma_velocity_mps}
        configured = dict(list(sigmas.items())[: self.observes]) | {"manoeuvre_variance": variance}
        self.keys, self.stated = tuple(configured), np.array(list(configured.values()), dtype=float)
        self.zero_limits = self.stated * np.array([1e-4] * self.observes + [MIN_MANOEUVRE])
        self.noise = noise_by_time(options.process_noise, 1.0, radar.scan_period_s)
        self.columns = self.outlier_kinds = tuple(name for name, _ in MEASURED[: self.observes])
        self.far_kinds: tuple[str, ...] = ()
        self.has_offsets = True
        self.is_smooth = True
        self.span = data_span(tracks, self.columns)
        self.given_tracks = list(tracks)
        self.cleaned_tracks = [without_gross_starts(columns, self.columns, START_RANGES) for columns in tracks]
        problems = (self._problem(number, columns) for number, columns in enumerate(self.cleaned_tracks))
        whole_problems = (problem for problem in problems if problem is not None)
        self.batches = [_joined(batch) for batch in track_batches(whole_problems, lambda problem: len(problem.z))]

    def _problem(self, track: int, columns: Mapping[str, np.ndarray]) -> "_Problem | None":
        """A track from its first range on; None where it has none."""
        z = np.stack([columns[name] for name in self.columns], axis=1)
        present = np.isfinite(z)
        if not present[:, 0].any():
            return None
        first = int(present[:, 0].argmax())
        rows = first + np.flatnonzero(present[first:].any(axis=1))
        t, z, present = columns["t_s"][rows], z[rows], present[rows]
        first_scored_row = int(np.searchsorted(np.cumsum(present[:, 0]), START_RANGES, side="right"))
        present[0, 0] = False  # it starts the track
        dt = np.diff(t, prepend=t[0])
        Q = np.empty((len(dt), 6))
        recorded_rows.fill_noise(self.noise, dt, Q)
        H = np.tile(observation(self.observes), (len(t), 1, 1))
        model = transitions(dt), unpack(Q.T), H
        start = np.array([[z[0, 0], 0.0, 0.0]])
        numbers = np.where(present, z, 0.0), present, dt / self.usual_s
        is_scored = np.arange(len(t)) >= first_scored_row
        counts = np.array([first_scored_row]), np.array([len(t)])
        return _Problem([(track, rows)], *model, *numbers, is_scored, start, *counts)

    def _score(self, batch: "_Problem", values: np.ndarray, law: ErrorLaw) -> tuple[np.ndarray, np.ndarray]:
        """The log-densities (n, m) of the numbers of some tracks, and their probabilities to be no outliers."""
        outliers, correlation = law.outlier_rows(self.observes), law.correlation
        variances, manoeuvre = np.square(values[: self.observes]), float(values[self.observes])
        start = np.diag([start_factor(outliers[0]) * variances[0], WIDE_VELOCITY_MPS**2, WIDE_ACCELERATION_MPS2**2])
        P = np.tile(start, (len(batch.lengths), 1, 1))
        score, soundness, spread = (*np.empty((2, *batch.z.shape)), np.tile(variances, (len(batch.z), 1)))
        offset = np.zeros(self.observes)
        offset[1:] = law.bias * values[1 : self.observes]
        z = batch.z - offset if law.bias else batch.z
        model, scale, white = (batch.start.copy(), P, batch.F, batch.Q, batch.H), manoeuvre, 1.0
        if correlation:
            error_covariance = np.zeros((3, self.observes))  # it is where the first plot is, and errs by its error
            error_covariance[0, 0] = -math.sqrt(variances[0])
            noise, shares_left = manoeuvre * batch.Q, correlation**batch.intervals
            model = with_lasting_errors(batch.start, P, error_covariance, batch.F, noise, batch.H, spread, shares_left)
            scale, white = 1.0, 0.0
        numbers = z, spread, batch.present, scale
        errors = outliers, batch.first_scored_rows, law.manoeuvres, self.span, white
        log_likelihood_of_tracks(batch.lengths, *model, *numbers, *errors, score, soundness)
        return score, soundness

    def _scores(self, values: np.ndarray, law: ErrorLaw) -> np.ndarray:
        """Sums over all tracks for each number that counts; the first plots, which find the state, are left out."""
        total = np.zeros(self.observes)
        for batch in self.batches:
            score, _ = self._score(batch, values, law)
            total += score[batch.is_scored].sum(axis=0)
        return total

    def __call__(self, values: np.ndarray, law: ErrorLaw = STATED_ERRORS) -> float:
        """The logarithm of the likelihood; bias: of the velocity, in its σ."""
        return float(self._scores(values, law).sum())

    def soundness(self, values: np.ndarray, law: ErrorLaw) -> list[dict[str, np.ndarray]]:
        """The probability of each number that it is no outlier; zero of gross errors before the start."""
        judged = []
        for batch in self.batches:
            parts = np.split(self._score(batch, values, law)[1], np.cumsum(batch.lengths)[:-1])
            judged += [(*track_and_rows, part) for track_and_rows, part in zip(batch.tracks, parts, strict=True)]
        return soundness_by_column(self.columns, self.given_tracks, self.cleaned_tracks, judged)

    def by_number(self, values: np.ndarray) -> dict[str, float]:
        """The sums of range and velocity."""
        total = self._scores(values, STATED_ERRORS)
        return {name: float(part) for name, part in zip(self.columns, total, strict=True)}


class _Problem(NamedTuple):
    """Tracks for the kernel, one after the other: of each its number, and its rows from the first range on."""

    tracks: list[tuple[int, np.ndarray]]
    F: np.ndarray  #: (n, 3, 3) transitions to each row
    Q: np.ndarray  #: (n, 3, 3) process noise of unit variance
    H: np.ndarray  #: (n, m, 3)
    z: np.ndarray  #: (n, m) the numbers
    present: np.ndarray  #: (n, m) which numbers count
    intervals: np.ndarray  #: (n,) time since the row before, in usual intervals
    is_scored: np.ndarray  #: (n,) whether the state is known before the row
    start: np.ndarray  #: (tracks, 3) the states at the first rows
    first_scored_rows: np.ndarray  #: (tracks,) of each, the row from which the state is known
    lengths: np.ndarray  #: (tracks,) the numbers of their rows


def _joined(problems: list[_Problem]) -> _Problem:
    """The tracks of several problems as one."""
    first, *arrays = zip(*problems, strict=True)
    return _Problem(list(itertools.chain(*first)), *map(np.concatenate, arrays))

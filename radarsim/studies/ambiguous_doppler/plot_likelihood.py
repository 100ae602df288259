"""The likelihood of recorded plots under a filter, over all its hypotheses."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from radarsim.config.experiment import Case
from radarsim.kernels.likelihood import FAR, NEAR, start_factor
from radarsim.studies.ambiguous_doppler import filter_design
from radarsim.studies.ambiguous_doppler.fold_resolver import FoldResolver
from radarsim.studies.ambiguous_doppler.followers import list_limits, packed_motion, prior_covariance
from radarsim.studies.ambiguous_doppler.kernels import recorded_rows
from radarsim.studies.ambiguous_doppler.tracking import MEASURED, plot_rows
from radarsim.studies.error_law import BIAS, OUTLIERS, STATED_ERRORS, ErrorLaw
from radarsim.studies.gross_errors import data_span, soundness_by_column, without_gross_starts
from radarsim.studies.recording_interface import usual_interval_s

# σ by which hypotheses differ that are merged: the logarithm of the likelihood of 120 rows is right to 0.005, and leaps
# by 0.002 with a key. Where the longest list is dropped instead, by 0.05; a tenth of outliers would need thousands.
MERGE_DISTANCE = 0.2
MIN_SIGMA_RATIO, MIN_VARIANCE_RATIO = 1e-4, 1e-6  # to the configured values: smaller ones count as zero


class PlotLikelihood:
    """The likelihood of tracks under a filter: the density of each range and folded velocity over all its hypotheses.

    The state before the first plot has the prior's distribution."""

    explains: tuple[str, ...] = (OUTLIERS, BIAS)

    def __init__(self, case: Case, options: Any, tracks: Sequence[Mapping[str, np.ndarray]]):
        self.spec: Any = case.spec
        self.options, self.filter, self.tracks = options, options.name, len(tracks)
        self.rows, self.usual_s = sum(len(columns["t_s"]) for columns in tracks), usual_interval_s(tracks)
        radar, filter_index = case.spec.radar, list(case.spec.filters).index(options)
        self.observes = 1 if options.doppler == "none" else 2
        configured = {"radar.sigma_range_m": radar.sigma_range_m, "radar.sigma_velocity_mps": radar.sigma_velocity_mps}
        configured = dict(list(configured.items())[: self.observes])
        configured[f"filters.{filter_index}.manoeuvre_variance"] = options.variances[0]
        self.keys, self.stated = tuple(configured), np.array(list(configured.values()), dtype=float)
        one_sigma_variance = (radar.sigma_velocity_mps / radar.scan_period_s ** options.orders[0]) ** 2  # in a scan
        self.zero_limits = np.array([MIN_SIGMA_RATIO] * self.observes + [MIN_VARIANCE_RATIO]) * np.append(
            self.stated[: self.observes], self.stated[-1] or one_sigma_variance
        )
        if self.observes == 1:
            self.explains = (OUTLIERS,)
        (self.member,) = filter_design.members(options)
        self.columns = self.outlier_kinds = tuple(name for name, _ in MEASURED[: self.observes])
        self.is_folded = self.member.doppler == "folded"
        # Off by some σ of a folded velocity is off by another fold, or by nearly half a span: as a far one.
        self.far_kinds = self.columns[1:] if self.is_folded else ()
        self.has_offsets = True
        self.is_smooth = not self.is_folded or list_limits(options)[0]
        self.span = np.append(data_span(tracks, self.columns), 0.0)[:2]
        self.given_tracks = list(tracks)
        self.cleaned_tracks = [
            without_gross_starts(columns, self.columns[:1], recorded_rows.START_RANGES) for columns in tracks
        ]
        self.problems = [self._problem(columns) for columns in self.cleaned_tracks]

    def _problem(self, columns: Mapping[str, np.ndarray]) -> "_Problem":
        """The arrays of a track for the kernel."""
        is_kept = np.any([np.isfinite(columns[name]) for name in self.columns], axis=0, keepdims=True)[0]
        is_kept[:1] = True
        columns = {name: column[is_kept] for name, column in columns.items()}
        dt = np.diff(columns["t_s"], prepend=columns["t_s"][0])
        steps, step_indices = np.unique(dt, return_inverse=True)
        period = self.spec.radar.scan_period_s
        motions = [packed_motion(self.member.order, 1.0, step, period) for step in steps.tolist()]
        f, q = (np.array([motion[i] for motion in motions], dtype=float)[step_indices] for i in (1, 2))
        rows = np.array(plot_rows(columns))
        folds = FoldResolver(self.spec.radar)
        for row in rows:
            folds.begin_row(row[0], row[3])
            row[3] = folds.span
        return _Problem(f, q, rows[:, 1:], np.flatnonzero(is_kept))

    def _track_scores(self, values: np.ndarray, law: ErrorLaw) -> list[np.ndarray]:
        """For each track the log-densities of its ranges and velocities, and their probabilities to be no outliers
        (2, n, 2); empty if a row cannot be taken."""
        sigma, outliers = np.ones(2), np.zeros((2, 4))
        outliers[: self.observes] = law.outlier_rows(self.observes)
        if self.is_folded:
            outliers[1, [NEAR, FAR]] = 0.0, outliers[1, [NEAR, FAR]].sum()
        sigma[: self.observes] = values[: self.observes]
        reach = (1 if self.options.hypotheses == 1 else 2) if self.is_folded else 0
        merge, max_count, min_ratio = list_limits(self.options)
        prior, result = np.array(prior_covariance(self.member, self.spec)), []
        for problem in self.problems:
            scores = np.empty((2, len(problem.rows), 2))
            rows = self._velocities(problem.rows, law.bias * sigma[1])
            present = np.isfinite(rows[:, :2])
            arguments = np.where(np.isfinite(rows), rows, 0.0), present, prior, sigma**2, float(values[-1])
            hypotheses, errors = (
                (reach, merge, max_count, min_ratio, MERGE_DISTANCE),
                (outliers, self.span, start_factor(outliers[0])),
            )
            if not recorded_rows.log_likelihood(problem.F, problem.Q, *arguments, *hypotheses, *errors, *scores):
                return []
            result.append(scores)
        return result

    def _scores(self, values: np.ndarray, law: ErrorLaw) -> np.ndarray:
        """Log likelihoods (2,) of range and velocity over all tracks; minus infinity if a row cannot be taken."""
        scores, total = self._track_scores(values, law), np.zeros(2)
        for score, _ in scores:
            total += score.sum(axis=0)
        return total if scores else np.full(2, -np.inf)

    def _velocities(self, rows: np.ndarray, offset: float) -> np.ndarray:
        """The rows (n, 3) with velocities as the filter takes them, minus an offset."""
        shifted = rows.copy()
        shifted[:, 1] -= offset
        if self.member.doppler == "none":
            shifted[:, 1] = np.nan
        if self.member.doppler == "remainder":
            folds = FoldResolver(self.spec.radar)
            for i in np.flatnonzero(np.isfinite(shifted[:, 1])):
                folds.span = shifted[i, 2]
                shifted[i, 1] = folds.remainder(shifted[i, 1])
        return shifted

    def __call__(self, values: np.ndarray, law: ErrorLaw = STATED_ERRORS) -> float:
        """The log likelihood. bias: of the velocity, in units of its σ; correlation and manoeuvres are ignored."""
        return float(self._scores(values, law).sum())

    def soundness(self, values: np.ndarray, law: ErrorLaw) -> list[dict[str, np.ndarray]]:
        """The probability of each number that it is no outlier."""
        scores = self._track_scores(values, law)
        judged = [
            (i, problem.numbers, part[:, : self.observes])
            for i, (problem, (_, part)) in enumerate(zip(self.problems, scores, strict=False))
        ]
        return soundness_by_column(self.columns, self.given_tracks, self.cleaned_tracks, judged)

    def by_number(self, values: np.ndarray) -> dict[str, float]:
        """The log likelihoods of range and velocity."""
        total = self._scores(values, STATED_ERRORS)
        return {name: float(score) for name, score in zip(self.columns, total, strict=False)}


class _Problem(NamedTuple):
    """A track for the kernel: motions F (n, 5) and Q (n, 6) to each row, of unit variance, and rows (n, 3).

    A row holds range, velocity and span; numbers (n,): those of the rows in the track."""

    F: np.ndarray
    Q: np.ndarray
    rows: np.ndarray
    numbers: np.ndarray

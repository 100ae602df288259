"""The likelihood of recorded plots under a bank of models."""

from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from radarsim.config.experiment import Case
from radarsim.kernels.lanes import WIDTH
from radarsim.kernels.likelihood import FAR, FAR_WIDTH, NEAR, start_factor
from radarsim.studies.error_law import OUTLIERS, STATED_ERRORS, ErrorLaw
from radarsim.studies.gross_errors import data_span, soundness_by_column, without_gross_starts
from radarsim.studies.multimodel import model_bank
from radarsim.studies.multimodel.config import Filter, Keys, Sensor
from radarsim.studies.multimodel.kernels import filter_strip, layout
from radarsim.studies.multimodel.kernels.hypothesis import work_arrays
from radarsim.studies.multimodel.kernels.likelihood import log_likelihood
from radarsim.studies.multimodel.kernels.robust_likelihood import LAW_ROWS, fill_laws, robust_log_likelihood
from radarsim.studies.multimodel.scenario import intervals, local_plots, sensor_frame
from radarsim.studies.multimodel.study import banks, filter_numbers
from radarsim.studies.multimodel.tracking import lane_rows, sigmas
from radarsim.studies.recording_interface import usual_interval_s

UPPER = np.triu_indices(3)  # elements of a packed covariance
MIN_VALUE_RATIO = 1e-4  # to a key's configured value: smaller values count as zero


class PlotLikelihood:
    """The likelihood of tracks under a filter: the density that its bank of models gives each plot.

    The first three valid plots start the track. Its keys are the sensor's σ and the acceleration of the model with the
    largest. As a function of the keys, hypotheses are merged by moments: under the other rules, which choose between
    hypotheses, it is discontinuous."""

    def __init__(self, case: Case, filter_index: int, tracks: Sequence[Mapping[str, np.ndarray]]):
        self.spec: Keys = case.spec
        self.options = self.spec.filters[filter_index]
        self.filter, self.tracks = self.options.name, len(tracks)
        self.rows, self.usual_s = sum(len(columns["t_s"]) for columns in tracks), usual_interval_s(tracks)
        # If the filter computes the plot's covariance, outliers cannot have a wider one.
        self.explains: tuple[str, ...] = (OUTLIERS,) if self.options.covariance_at == "plot" else ()
        spreads = [model.sigma_acceleration_mps2 for model in self.options.models]
        self.hardest = int(np.argmax(spreads))
        names = sigmas(self.spec)["plot"]
        self.keys = (*names, f"filters.{filter_index}.models.{self.hardest}.sigma_acceleration_mps2")
        self.stated = np.array([*self.spec.sensor.sigma, spreads[self.hardest]])
        self.zero_limits = np.append(MIN_VALUE_RATIO * self.stated[:3], MIN_VALUE_RATIO * (self.stated[3] or 1.0))
        self.far_kinds: tuple[str, ...] = ()
        self.has_offsets = True
        self.is_smooth = True
        self.given_tracks, self.columns = list(tracks), tuple(name for name in tracks[0] if name != "t_s")
        self.outlier_kinds = self.columns
        self.spans = data_span(tracks, self.columns)
        self.cleaned_tracks = [without_gross_starts(columns, self.columns, layout.START) for columns in tracks]
        self.measured = np.concatenate(
            [np.stack([columns[name] for name in self.columns], axis=1) for columns in self.cleaned_tracks]
        )
        is_valid = local_plots(self.spec.sensor, self.measured)[2]
        last_rows = np.cumsum([len(columns["t_s"]) for columns in tracks])
        times_and_starts = (
            (columns["t_s"], end - len(columns["t_s"])) for columns, end in zip(tracks, last_rows, strict=True)
        )
        problems = (
            _make_problem(self.spec, self.options, number, t, first, is_valid[first : first + len(t)])
            for number, (t, first) in enumerate(times_and_starts)
        )
        self.problems = [problem for problem in problems if problem is not None]
        self.frame = sensor_frame(self.spec.sensor)
        self.models = model_bank.model_rows([model.motion for model in self.options.models], spreads).ravel()
        self.rules = {merge: filter_numbers(self.options, merge) for merge in ("moment", self.options.merge)}
        self.probabilities = model_bank.stationary(model_bank.transition_matrix(self.options.transition))
        # Positions and covariances of plots are linear in the variances of the sensor.
        self.exact_plots = self._plots(np.zeros(3))
        self.plot_parts = np.stack([self._plots(one) - self.exact_plots for one in np.eye(3)])
        self.directions, self.log_determinants = self._measured_directions(is_valid)

    def _track_scores(
        self, values: np.ndarray, merge: str, law: ErrorLaw
    ) -> list[tuple["_Problem", np.ndarray, np.ndarray]]:
        """For each track the log-densities (n,) of its later plots, and the probabilities (n, 3) of their numbers to be
        no outliers, for given values of the keys and a merging rule."""
        models, rules = self.models.copy(), self.rules[merge]
        models[layout.MODEL_NUMBERS * (self.hardest + 1) - 1] = values[3]
        plots = self.exact_plots + np.tensordot(np.square(values[:3]), self.plot_parts, 1)
        outliers, result = law.outlier_rows(3), []
        is_robust = bool(outliers[:, [NEAR, FAR]].any())
        laws = np.zeros((3, LAW_ROWS, WIDTH))
        fill_laws(laws, outliers, values[:3], self._far_ratios(values[:3]))
        covariance = slice(layout.COVARIANCE, layout.DETECTED)
        extra_variances = np.array([start_factor(row) - 1 for row in outliers]) * np.square(values[:3])
        extra_covariances = np.tensordot(extra_variances, self.plot_parts[:, :, covariance], 1)
        for problem in self.problems:
            start, later = plots[problem.start_rows], plots[problem.later_plots]
            start[:, covariance] += extra_covariances[problem.start_rows]
            work, numbers = work_arrays()
            filter_strip.start_strip(work, numbers, lane_rows(start), problem.weights, self.probabilities)
            score, soundness = np.empty(len(later)), np.ones((len(later), 3))
            arguments = models, problem.transitions, problem.intervals, problem.times, rules
            if is_robust:
                directions = self.directions[problem.later_plots]
                robust_log_likelihood(work, numbers, later, directions, *arguments, laws, score, soundness)
                score += self.log_determinants[problem.later_plots]
            else:
                log_likelihood(work, numbers, lane_rows(later), *arguments, self.frame, score)
            result.append((problem, score, soundness))
        return result

    def _measured_directions(self, is_valid: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The directions (n, 9) along which the numbers of plots are measured, 1 or rad by m, and the logarithm (n,) of
        their determinant; zero where no plot is."""
        shifts = np.stack([_root(part) for part in self.plot_parts[:, :, layout.COVARIANCE : layout.DETECTED]], axis=2)
        directions, log_determinants = np.zeros((len(is_valid), 3, 3)), np.zeros(len(is_valid))
        directions[is_valid] = np.linalg.pinv(shifts[is_valid])
        log_determinants[is_valid] = -np.linalg.slogdet(shifts[is_valid])[1]
        # At the zenith no direction changes the azimuth.
        return directions.reshape(-1, 9), np.where(np.isfinite(log_determinants), log_determinants, 0.0)

    def _far_ratios(self, sigmas: np.ndarray) -> np.ndarray:
        """The ratio (3,) of the widest law of far outliers to the least wide, for each number.

        The widest spans the data in the number, whatever the σ of the others: else one σ would grow with the outliers
        of another number."""
        least = FAR_WIDTH * sigmas
        return np.maximum(np.divide(self.spans, least, out=np.ones(3), where=sigmas > 0), 1.0)

    def _sensor(self, sigmas: Iterable[float]) -> Sensor:
        """The sensor with other σ."""
        names = [key.partition(".")[2] for key in self.keys[:3]]
        return self.spec.sensor.model_copy(update=dict(zip(names, map(float, sigmas), strict=True)))

    def _plots(self, sigmas: Iterable[float]) -> np.ndarray:
        """The plots (n, PLOT) as the kernels take them, for given σ of the sensor."""
        z, R, is_valid = local_plots(self._sensor(sigmas), self.measured)
        return np.concatenate([z, R, is_valid[:, None]], axis=1)

    def __call__(self, values: np.ndarray, law: ErrorLaw = STATED_ERRORS) -> float:
        """The log likelihood; of the explanations only outliers are part of the model."""
        return self._total(values, "moment", law)

    def _total(self, values: np.ndarray, merge: str, law: ErrorLaw) -> float:
        """The log likelihood of all tracks."""
        return sum(float(score.sum()) for _, score, _ in self._track_scores(values, merge, law))

    def soundness(self, values: np.ndarray, law: ErrorLaw) -> list[dict[str, np.ndarray]]:
        """The probability of each number that it is no outlier."""
        scores = self._track_scores(values, "moment", law)
        judged = [(problem.track, problem.later_rows, soundness) for problem, _, soundness in scores]
        return soundness_by_column(self.columns, self.given_tracks, self.cleaned_tracks, judged)

    def by_number(self, values: np.ndarray) -> dict[str, float]:
        """The log likelihood of the plots, with the filter's own merging rule."""
        return {"plot": self._total(values, self.options.merge, STATED_ERRORS)}


def _root(packed: np.ndarray) -> np.ndarray:
    """The vectors (n, 3), up to their signs, whose outer products with themselves are covariances packed (n, 6)."""
    matrices = np.empty((len(packed), 3, 3))
    matrices[:, UPPER[0], UPPER[1]] = matrices[:, UPPER[1], UPPER[0]] = packed
    largest = packed[:, [0, 3, 5]].argmax(axis=1)
    rows_of_largest = matrices[np.arange(len(packed)), largest]
    length = np.sqrt(rows_of_largest[np.arange(len(packed)), largest])[:, None]
    return np.divide(rows_of_largest, length, out=np.zeros_like(rows_of_largest), where=length > 0)


class _Problem(NamedTuple):
    """A track for the kernel: the rows and weights of the plots that start it, and the later plots.

    For these the number of the interval before each, the distinct intervals (s), the transition probabilities, and
    their rows in the track of this number."""

    track: int
    start_rows: np.ndarray
    weights: np.ndarray
    later_plots: slice
    intervals: np.ndarray
    times: np.ndarray
    transitions: np.ndarray
    later_rows: np.ndarray


def _make_problem(
    spec: Keys, options: Filter, track: int, t: np.ndarray, start: int, is_valid: np.ndarray
) -> _Problem | None:
    """A track of a number, at times t (n,), that begins at row `start` of all plots; None if it never starts.

    is_valid (n,): which of its plots are valid."""
    start_rows = np.flatnonzero(is_valid)[: layout.START]
    if len(start_rows) < layout.START or start_rows[-1] + 1 == len(t):
        return None
    index, times = intervals(t[start_rows[-1] :])
    transitions = banks(spec.model_copy(update={"filters": (options,)}), times).transitions[0]
    weights = model_bank.start_weights(t[start_rows], spec.start_acceleration_mps2)
    return _Problem(
        track,
        start + start_rows,
        weights,
        slice(start + start_rows[-1] + 1, start + len(t)),
        index[1:].copy(),
        times,
        transitions,
        np.arange(start_rows[-1] + 1, len(t)),
    )

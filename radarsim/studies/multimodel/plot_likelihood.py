"""The likelihood of recorded plots under a bank of models."""

from collections.abc import Iterable, Mapping, Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from radarsim.config.experiment import Case
from radarsim.kernels.lanes import WIDTH, rows
from radarsim.kernels.likelihood import FAR, FAR_COUNT, FAR_WIDTH, NEAR, start_factor
from radarsim.studies.error_law import OUTLIERS, STATED_ERRORS, ErrorLaw, OutlierLaw
from radarsim.studies.gross_errors import data_span, soundness_by_column, without_gross_starts
from radarsim.studies.multimodel import model_bank
from radarsim.studies.multimodel.config import Filter, Keys, Sensor
from radarsim.studies.multimodel.kernels import filter_strip, layout, likelihood
from radarsim.studies.multimodel.kernels.hypothesis import work_arrays
from radarsim.studies.multimodel.kernels.likelihood import STRIPS
from radarsim.studies.multimodel.scenario import intervals, local_plots, sensor_frame
from radarsim.studies.multimodel.study import banks
from radarsim.studies.multimodel.tracking import lane_rows, sigmas
from radarsim.studies.recording_interface import ALL_KINDS, usual_interval_s

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
        self.outlier_kinds = ALL_KINDS
        self.far_kinds: tuple[str, ...] = ()
        self.has_offsets = True
        self.is_smooth = True
        self.given_tracks, self.columns = list(tracks), tuple(name for name in tracks[0] if name != "t_s")
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
        self.probabilities = model_bank.stationary(model_bank.transition_matrix(self.options.transition))
        # How far (3, n, 3) an error of 1 m or 1 rad in each number moves a plot.
        self.unit_shifts = np.stack([_root(local_plots(self._sensor(one), self.measured)[1]) for one in np.eye(3)])
        # A search moves one key at a time.
        self._bank, self._plots = lru_cache(2)(self._calculate_bank), lru_cache(2)(self._calculate_plots)

    def _track_scores(
        self, values: np.ndarray, merge: str, law: ErrorLaw
    ) -> list[tuple["_Problem", np.ndarray, np.ndarray]]:
        """For each track the log-densities (n,) of its later plots, and the probabilities (n, 3) of their numbers to be
        no outliers, for given values of the keys and a merging rule."""
        design, rules = self._bank(float(values[3]), merge)
        plots, shifts = self._plots(*values[:3].tolist()), values[:3, None, None] * self.unit_shifts
        outliers, result = law.outlier_rows(1)[0], []
        strips = STRIPS if outliers[NEAR] + outliers[FAR] > 0 else 1
        # A number is an outlier in two of the strips: with its whole plot, or alone.
        chance = 2 / (1 + (STRIPS - 1) * (outliers[NEAR] + outliers[FAR]))
        growth_at_start = start_factor(outliers * [chance, chance, 1.0, 1.0])
        new_numbers = np.tile(work_arrays()[1], (strips, 1))
        for problem in self.problems:
            start, later = plots[problem.start_rows], plots[problem.later_plots]
            start[:, layout.COVARIANCE : layout.COVARIANCE + 6] *= growth_at_start
            works, numbers = rows(strips * layout.WORK).reshape(strips, -1), new_numbers.copy()
            for work, state in zip(works, numbers, strict=True):
                filter_strip.start_strip(work, state, lane_rows(start), problem.weights, self.probabilities)
            law_plots = rows(strips * later.size)
            by_law = law_plots.reshape(strips, *later.shape, WIDTH)
            by_law[:] = later[:, :, None]
            if strips > 1:
                later_shifts = shifts[:, problem.later_plots]
                self._spread_outliers(by_law, later_shifts, values[:3], OutlierLaw(*outliers.tolist()))
            score, soundness = np.empty(len(later)), np.empty((len(later), 3))
            arguments = design, problem.transitions, problem.intervals, problem.times, rules, self.frame
            likelihood.log_likelihood(
                works, numbers, law_plots.reshape(strips, -1), *arguments, outliers, score, soundness
            )
            result.append((problem, score, soundness))
        return result

    def _calculate_bank(self, sigma_acceleration_mps2: float, merge: str) -> tuple[np.ndarray, np.ndarray]:
        """The numbers of the models, and those of the filter, for the largest acceleration and a merging rule."""
        models = list(self.options.models)
        update = {"sigma_acceleration_mps2": sigma_acceleration_mps2}
        models[self.hardest] = models[self.hardest].model_copy(update=update)
        options = self.options.model_copy(update={"models": tuple(models), "merge": merge})
        filter_bank = banks(self.spec.model_copy(update={"filters": (options,)}), np.ones(1))
        return filter_bank.models[0, : layout.MODEL_NUMBERS * len(models)], filter_bank.numbers[0]

    def _calculate_plots(self, *sensor_sigmas: float) -> np.ndarray:
        """The plots (n, PLOT) as the kernel takes them, for given σ of the sensor."""
        z, R, is_valid = local_plots(self._sensor(sensor_sigmas), self.measured)
        return np.concatenate([z, R, is_valid[:, None]], axis=1)

    def _sensor(self, sigmas: Iterable[float]) -> Sensor:
        """The sensor with other σ."""
        names = [key.partition(".")[2] for key in self.keys[:3]]
        return self.spec.sensor.model_copy(update=dict(zip(names, map(float, sigmas), strict=True)))

    def _spread_outliers(self, plots: np.ndarray, shifts: np.ndarray, sigmas: np.ndarray, law: OutlierLaw) -> None:
        """Give plots (STRIPS, n, PLOT, WIDTH) the means and covariances of each law of their errors. shifts (3, n, 3):
        by one σ of each number; sigmas (3,): these.

        The widest law of a number spans the data in it, whatever the σ of the others: else one σ would grow with the
        outliers of another number."""
        means, covariances = np.split(plots[:, :, : layout.DETECTED], [layout.COVARIANCE], axis=2)
        far = slice(2, 2 + FAR_COUNT)
        covariances[0, :, :, 1] *= law.near_width**2
        covariances[0, :, :, far] = 0.0
        for strip, (shift, span, sigma) in enumerate(zip(shifts, self.spans, sigmas, strict=True), 1):
            part = (shift[:, UPPER[0]] * shift[:, UPPER[1]])[:, :, None]
            ratio = max(span / (FAR_WIDTH * sigma), 1.0) if sigma > 0 else 1.0
            far_variances = (FAR_WIDTH * ratio ** np.linspace(0, 1, FAR_COUNT)) ** 2
            covariances[0, :, :, far] += far_variances * part
            means[strip, :, :, 0] += law.offset * shift
            means[strip, :, :, 1] -= law.offset * shift
            covariances[strip, :, :, :2] += law.spread**2 * part
            covariances[strip, :, :, far] += (far_variances - 1) * part

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

"""The likelihood of recorded plots under a bank of models."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from radarsim.config.experiment import Case
from radarsim.studies.multimodel import model_bank
from radarsim.studies.multimodel.config import Filter, Keys
from radarsim.studies.multimodel.kernels import filter_strip, layout, likelihood
from radarsim.studies.multimodel.kernels.hypothesis import work_arrays
from radarsim.studies.multimodel.scenario import intervals, local_plots, sensor_frame
from radarsim.studies.multimodel.study import banks
from radarsim.studies.multimodel.tracking import lane_rows, sigmas
from radarsim.studies.recording_interface import OUTLIERS, usual_interval_s

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
        self.least = np.append(MIN_VALUE_RATIO * self.stated[:3], MIN_VALUE_RATIO * (self.stated[3] or 1.0))
        self.measured = np.concatenate([np.stack(list(columns.values())[1:], axis=1) for columns in tracks])
        is_valid = local_plots(self.spec.sensor, self.measured)[2]
        last_rows = np.cumsum([len(columns["t_s"]) for columns in tracks])
        times_and_starts = (
            (columns["t_s"], end - len(columns["t_s"])) for columns, end in zip(tracks, last_rows, strict=True)
        )
        problems = (
            _make_problem(self.spec, self.options, t, first, is_valid[first : first + len(t)])
            for t, first in times_and_starts
        )
        self.problems = [problem for problem in problems if problem is not None]
        self.frame = sensor_frame(self.spec.sensor)
        self.probabilities = model_bank.stationary(model_bank.transition_matrix(self.options.transition))

    def _score(self, values: np.ndarray, merge: str, outliers: float) -> float:
        """The log likelihood of all tracks, for given values of the keys and a merging rule."""
        names = [key.partition(".")[2] for key in self.keys[:3]]
        sensor = self.spec.sensor.model_copy(update=dict(zip(names, values[:3].tolist(), strict=True)))
        models = list(self.options.models)
        update = {"sigma_acceleration_mps2": float(values[3])}
        models[self.hardest] = models[self.hardest].model_copy(update=update)
        options = self.options.model_copy(update={"models": tuple(models), "merge": merge})
        filter_bank = banks(self.spec.model_copy(update={"filters": (options,)}), np.ones(1))
        design, numbers = filter_bank.models[0, : layout.MODEL_NUMBERS * len(models)], filter_bank.numbers[0]
        z, R, is_valid = local_plots(sensor, self.measured)
        plots, total = np.concatenate([z, R, is_valid[:, None]], axis=1), 0.0
        for problem in self.problems:
            work, state = work_arrays()
            filter_strip.start_strip(
                work, state, lane_rows(plots[problem.start_rows]), problem.weights, self.probabilities
            )
            later_plots, score = lane_rows(plots[problem.later_plots]), np.empty(len(problem.intervals))
            arguments = design, problem.transitions, problem.intervals, problem.times, numbers, self.frame
            likelihood.log_likelihood(work, state, later_plots, *arguments, outliers, score)
            total += float(score.sum())
        return total

    def __call__(self, values: np.ndarray, outliers: float = 0.0, bias: float = 0.0, correlation: float = 0.0) -> float:
        """The log likelihood; bias and correlation are ignored."""
        return self._score(values, "moment", outliers)

    def by_number(self, values: np.ndarray) -> dict[str, float]:
        """The log likelihood of the plots, with the filter's own merging rule."""
        return {"plot": self._score(values, self.options.merge, 0.0)}


class _Problem(NamedTuple):
    """A track for the kernel: the rows and weights of the plots that start it, and the later plots.

    For these the number of the interval before each, the distinct intervals (s), and the transition probabilities."""

    start_rows: np.ndarray
    weights: np.ndarray
    later_plots: slice
    intervals: np.ndarray
    times: np.ndarray
    transitions: np.ndarray


def _make_problem(spec: Keys, options: Filter, t: np.ndarray, start: int, is_valid: np.ndarray) -> _Problem | None:
    """A track at times t (n,) that begins at row `start` of all plots; None if it never starts.

    is_valid (n,): which of its plots are valid."""
    start_rows = np.flatnonzero(is_valid)[: layout.START]
    if len(start_rows) < layout.START or start_rows[-1] + 1 == len(t):
        return None
    index, times = intervals(t[start_rows[-1] :])
    transitions = banks(spec.model_copy(update={"filters": (options,)}), times).transitions[0]
    weights = model_bank.start_weights(t[start_rows], spec.start_acceleration_mps2)
    return _Problem(
        start + start_rows,
        weights,
        slice(start + start_rows[-1] + 1, start + len(t)),
        index[1:].copy(),
        times,
        transitions,
    )

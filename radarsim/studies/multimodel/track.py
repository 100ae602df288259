"""Recorded plots: the study's filters over them, their likelihood under a filter, and plots of simulated
realisations."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from radarsim.config.experiment import Case
from radarsim.engine.results import Track
from radarsim.kernels.lanes import WIDTH, rows
from radarsim.studies.interface import OUTLIERS, Draw, Drawn, RecordedPlots, usual_interval_s
from radarsim.studies.multimodel import world
from radarsim.studies.multimodel.config import Filter, Keys
from radarsim.studies.multimodel.kernels import records as rec
from radarsim.studies.multimodel.kernels import strip as strips
from radarsim.studies.multimodel.kernels.hypothesis import work_arrays
from radarsim.studies.multimodel.kernels.strip import STRIP
from radarsim.studies.multimodel.study import COMPONENTS, banks, prepare
from radarsim.studies.multimodel.world import intervals, local_plots, sensor_frame
from radarsim.studies.multimodel.world import truth as scan_times

CHUNK_ROWS = 4096  # recorded plots filtered at a time
TESTED = (("plot", 3),)
MIN_VALUE_RATIO = 1e-4  # to a key's configured value: smaller values count as zero


def columns(spec: Keys) -> tuple[tuple[str, ...], ...]:
    """The columns that `track` reads of a file of recorded plots."""
    if spec.sensor.sigma_range_m is None:
        return (("t_s", "x_m", "y_m", "z_m"),)
    return (("t_s", "range_m", "elevation_rad", "azimuth_rad"),)


def sigmas(spec: Keys) -> dict[str, tuple[str, ...]]:
    """The sensor's standard deviations for each tested quantity: all, as the plot is tested as a whole."""
    biconical = ("sigma_range_m", "sigma_elevation_rad", "sigma_azimuth_rad")
    names = biconical if spec.sensor.sigma_range_m is not None else ("sigma_x_m", "sigma_y_m", "sigma_z_m")
    return {"plot": tuple(f"sensor.{name}" for name in names)}


def drawing(case: Case) -> Draw:
    """The function that draws plots of realisations of a case."""
    world, scans, biconical = prepare(case).world, scan_times(case)[0], case.spec.sensor.sigma_range_m is not None
    truth, sigma = world.plot_truth, world.frame[rec.SIGMA : rec.SIGMA + 3]
    exact = truth[:, rec.COORDINATES :].T
    if biconical:
        exact = np.stack([truth[:, rec.RANGE], *np.arcsin(truth[:, [rec.ELEVATION, rec.AZIMUTH]]).T])
    names = columns(case.spec)[0][1:]

    def draw(first: int, count: int) -> Drawn:
        plots = np.empty((3, count, len(scans)))
        work = rows(strips.RANDOM), rows(STRIP * rec.PLOT)
        strips.fill_noise(world.keys, world.frame, truth, rec.START, first, *work, plots)
        for plot, exact_column, plot_sigma in zip(plots, exact, sigma, strict=True):
            plot *= plot_sigma
            plot += exact_column
        true_columns = np.broadcast_to(exact[:, None], plots.shape) if biconical else ()
        true_plots = {f"true_{name}": column for name, column in zip(names, true_columns, strict=False)}
        state = np.broadcast_to(world.truth, (count, *world.truth.shape))
        return Drawn(scans, dict(zip(names, plots, strict=True)), COMPONENTS, state, true_plots, first)

    return draw


class _FilterState(NamedTuple):
    """A filter between chunks: its options, the kernel's memory and whole numbers."""

    options: Filter
    work: np.ndarray
    numbers: np.ndarray


class Tracker:
    """The filters of a case over recorded plots, chunk by chunk in flat memory.

    The first three valid plots start the track (see `world.local_plots`). At the times of other plots the estimate is
    extrapolated."""

    most_rows: int | None = None
    several: bool = False

    def __init__(self, case: Case):
        self.spec = case.spec
        self.names = tuple(f.name for f in self.spec.filters)
        self.max_models = max(len(f.models) for f in self.spec.filters)
        self.states = [_FilterState(options, *work_arrays()) for options in self.spec.filters]
        self.start_plots: list[tuple[float, np.ndarray]] = []
        self.has_started, self.last_t = False, 0.0

    def feed(self, recorded: Mapping[str, np.ndarray]) -> Track:
        """The estimates over the next rows: columns (n,), not-a-number where a value is missing."""
        t = recorded["t_s"]
        z, R, is_valid = local_plots(self.spec.sensor, np.stack(list(recorded.values())[1:], axis=1))
        shape = (len(self.names), len(t))
        estimate, sigma = np.full((2, *shape, rec.STATES), np.nan)
        probability, nis = np.full((*shape, self.max_models), np.nan), np.full((*shape, 1), np.nan)
        plots = np.concatenate([z, R, is_valid[:, None]], axis=1)
        first = self._first_row(t, plots)
        for f, state in enumerate(self.states) if first < len(t) else ():
            out, is_tested = self._run_filter(state, t, plots, first)
            size = len(state.options.models)
            estimate[f, first:] = out[:, : rec.STATES]
            sigma[f, first:] = np.sqrt(np.maximum(out[:, rec.VARIANCE : rec.VARIANCE + rec.STATES], 0.0))
            probability[f, first:, :size] = out[:, rec.MODELS : rec.MODELS + size]
            nis[f, first:, 0] = np.where(is_tested, out[:, rec.INNOVATION], np.nan)
        self.has_started, self.last_t = len(self.start_plots) == rec.START, t[-1]
        residual = np.where(is_valid[:, None], z, np.nan)[None] - estimate[..., 0::3]
        spread = R[None][..., [0, 3, 5]] - sigma[..., 0::3] ** 2  # of residuals after the update
        residual_sigma = np.where(np.isfinite(residual), np.sqrt(np.maximum(spread, 0.0)), np.nan)
        labels = (("x_m", "m"), ("y_m", "m"), ("z_m", "m"))
        shares = probability if self.max_models > 1 else None
        return Track(
            self.names,
            COMPONENTS,
            t,
            estimate,
            sigma,
            shares,
            labels,
            residual,
            TESTED,
            nis,
            residual_sigma=residual_sigma,
        )

    def _first_row(self, t: np.ndarray, plots: np.ndarray) -> int:
        """The first row with an estimate: that of the third valid plot; zero once the track has started."""
        if self.has_started:
            return 0
        for k in np.flatnonzero(plots[:, rec.DETECTED]):
            self.start_plots.append((t[k], plots[k]))
            if len(self.start_plots) == rec.START:
                return int(k)
        return len(t)

    def _run_filter(
        self, state: _FilterState, t: np.ndarray, plots: np.ndarray, first: int
    ) -> tuple[np.ndarray, np.ndarray]:
        """Outputs (n', OUTPUT) of a filter from row `first` on, and which of them have a tested innovation."""
        outputs, first_row = [], first
        if not self.has_started:
            outputs, first_row = [self._start_filter(state)], first + 1
        frame = sensor_frame(self.spec.sensor)
        for start in range(first_row, len(t), CHUNK_ROWS):
            stop = min(start + CHUNK_ROWS, len(t))
            previous_t = t[start - 1] if start else self.last_t
            outputs.append(_run_chunk(self.spec, state, np.append(previous_t, t[start:stop]), plots[start:stop], frame))
        is_tested = plots[first:, rec.DETECTED] > 0
        if not self.has_started:
            is_tested[0] = False
        return np.concatenate(outputs), is_tested

    def _start_filter(self, state: _FilterState) -> np.ndarray:
        """Start a filter from the three plots; returns its outputs (1, OUTPUT) at the third."""
        times = np.array([time for time, _ in self.start_plots])
        start_plots = np.stack([plot for _, plot in self.start_plots])
        weights = world.start_weights(times, self.spec.start_acceleration_mps2)
        probabilities = world.stationary(world.transition_matrix(state.options.transition))
        strips.start_strip(state.work, state.numbers, lane_rows(start_plots), weights, probabilities)
        out = np.zeros((1, rec.OUTPUT))
        out[0, : rec.STATES], out[0, rec.VARIANCE : rec.VARIANCE + rec.STATES] = _start_estimate(start_plots, weights)
        out[0, rec.MODELS : rec.MODELS + len(probabilities)] = probabilities
        return out


def track(case: Case, recorded: dict[str, np.ndarray]) -> Track:
    """The filters of a case over complete recorded columns (n,) at once; see `Tracker`."""
    return Tracker(case).feed(recorded)


def _run_chunk(spec: Keys, state: _FilterState, t: np.ndarray, plots: np.ndarray, frame: np.ndarray) -> np.ndarray:
    """Outputs (n, OUTPUT) of a filter over the next n plots; t (n + 1,) begins with the time of the previous row."""
    index, times = intervals(t)
    filter_bank = banks(spec.model_copy(update={"filters": (state.options,)}), times)
    size, count = filter_bank.numbers[0, rec.SIZE], len(plots)
    state.numbers[rec.PREPARED] = -1  # the intervals of this chunk are numbered from 0
    out, reported = rows(count * rec.OUTPUT), np.ones(count, dtype=np.int64)
    interval_arrays = index[1:].copy(), times
    model_arrays = filter_bank.models[0, : rec.MODEL_NUMBERS * size], filter_bank.transitions[0]
    strips.filter_strip(
        *(state.work, state.numbers, lane_rows(plots), 0, count),
        *(*model_arrays, *interval_arrays, filter_bank.numbers[0], frame, reported, out),
    )
    return out.reshape(count, rec.OUTPUT, WIDTH)[:, :, 0].copy()


def _start_estimate(start_plots: np.ndarray, weights: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Mean and variances (9,) of a track at its third plot; start_plots (3, PLOT)."""
    a, b, g = weights.reshape(3, 3)
    mean, variance = np.zeros(9), np.tile(g**2, 3)
    mean[0::3], mean[1::3] = a @ start_plots[:, :3], b @ start_plots[:, :3]
    variances = start_plots[:, [rec.COVARIANCE, rec.COVARIANCE + 3, rec.COVARIANCE + 5]]  # xx, yy, zz
    variance[0::3] += a**2 @ variances
    variance[1::3] += b**2 @ variances
    return mean, variance


def lane_rows(plots: np.ndarray) -> np.ndarray:
    """Plots (n, PLOT) as rows of eight equal lanes."""
    repeated = rows(plots.size)
    repeated.reshape(-1, WIDTH)[:] = plots.reshape(-1, 1)
    return repeated


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
        self.probabilities = world.stationary(world.transition_matrix(self.options.transition))

    def _score(self, values: np.ndarray, merge: str, outliers: float) -> float:
        """The log likelihood of all tracks, for given values of the keys and a merging rule."""
        names = [key.partition(".")[2] for key in self.keys[:3]]
        sensor = self.spec.sensor.model_copy(update=dict(zip(names, values[:3].tolist(), strict=True)))
        models = list(self.options.models)
        update = {"sigma_acceleration_mps2": float(values[3])}
        models[self.hardest] = models[self.hardest].model_copy(update=update)
        options = self.options.model_copy(update={"models": tuple(models), "merge": merge})
        filter_bank = banks(self.spec.model_copy(update={"filters": (options,)}), np.ones(1))
        design, numbers = filter_bank.models[0, : rec.MODEL_NUMBERS * len(models)], filter_bank.numbers[0]
        z, R, is_valid = local_plots(sensor, self.measured)
        plots, total = np.concatenate([z, R, is_valid[:, None]], axis=1), 0.0
        for problem in self.problems:
            work, state = work_arrays()
            strips.start_strip(work, state, lane_rows(plots[problem.start_rows]), problem.weights, self.probabilities)
            later_plots, score = lane_rows(plots[problem.later_plots]), np.empty(len(problem.intervals))
            arguments = design, problem.transitions, problem.intervals, problem.times, numbers, self.frame
            strips.log_likelihood(work, state, later_plots, *arguments, outliers, score)
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
    start_rows = np.flatnonzero(is_valid)[: rec.START]
    if len(start_rows) < rec.START or start_rows[-1] + 1 == len(t):
        return None
    index, times = intervals(t[start_rows[-1] :])
    transitions = banks(spec.model_copy(update={"filters": (options,)}), times).transitions[0]
    weights = world.start_weights(t[start_rows], spec.start_acceleration_mps2)
    return _Problem(
        start + start_rows,
        weights,
        slice(start + start_rows[-1] + 1, start + len(t)),
        index[1:].copy(),
        times,
        transitions,
    )


class Recorded(RecordedPlots):
    """The study's part in `radarsim track` and `radarsim simulate`."""

    rows_asked = 2000

    columns, sigmas = staticmethod(columns), staticmethod(sigmas)
    drawing, tracker = staticmethod(drawing), staticmethod(Tracker)

    def scan_period_s(self, spec: Keys) -> float:
        return spec.sensor.scan_period_s

    def likelihood(
        self, case: Case, filter_name: str | None, tracks: Sequence[Mapping[str, np.ndarray]]
    ) -> PlotLikelihood:
        names = [member.name for member in case.spec.filters]
        return PlotLikelihood(case, 0 if filter_name is None else names.index(filter_name), tracks)

"""The study's filters over recorded plots, and the plots of simulated realisations."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from radarsim.config.experiment import Case
from radarsim.kernels.lanes import WIDTH, rows
from radarsim.studies.multimodel import model_bank
from radarsim.studies.multimodel.config import Filter, Keys
from radarsim.studies.multimodel.kernels import filter_strip, layout
from radarsim.studies.multimodel.kernels import plots as kernels_plots
from radarsim.studies.multimodel.kernels.hypothesis import work_arrays
from radarsim.studies.multimodel.kernels.plots import STRIP
from radarsim.studies.multimodel.scenario import intervals, local_plots, sensor_frame
from radarsim.studies.multimodel.scenario import true_states as scan_times
from radarsim.studies.multimodel.study import COMPONENTS, banks, prepare
from radarsim.studies.plot_arrays import DrawPlots, SimulatedPlots
from radarsim.studies.recording_interface import Track

CHUNK_ROWS = 4096  # recorded plots filtered at a time
TESTED = (("plot", 3),)


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


def drawing(case: Case) -> DrawPlots:
    """The function that draws plots of realisations of a case."""
    world, scans, biconical = prepare(case).world, scan_times(case)[0], case.spec.sensor.sigma_range_m is not None
    truth, sigma = world.plot_truth, world.frame[layout.SIGMA : layout.SIGMA + 3]
    exact = truth[:, layout.COORDINATES :].T
    if biconical:
        exact = np.stack([truth[:, layout.RANGE], *np.arcsin(truth[:, [layout.ELEVATION, layout.AZIMUTH]]).T])
    names = columns(case.spec)[0][1:]

    def draw(first: int, count: int) -> SimulatedPlots:
        plots = np.empty((3, count, len(scans)))
        work = rows(kernels_plots.RANDOM), rows(STRIP * layout.PLOT)
        kernels_plots.fill_noise(world.keys, world.frame, truth, layout.START, first, *work, plots)
        for plot, exact_column, plot_sigma in zip(plots, exact, sigma, strict=True):
            plot *= plot_sigma
            plot += exact_column
        true_columns = np.broadcast_to(exact[:, None], plots.shape) if biconical else ()
        true_plots = {f"true_{name}": column for name, column in zip(names, true_columns, strict=False)}
        state = np.broadcast_to(world.truth, (count, *world.truth.shape))
        return SimulatedPlots(scans, dict(zip(names, plots, strict=True)), COMPONENTS, state, true_plots, first)

    return draw


class _FilterState(NamedTuple):
    """A filter between chunks: its options, the kernel's memory and whole numbers."""

    options: Filter
    work: np.ndarray
    numbers: np.ndarray


class Tracker:
    """The filters of a case over recorded plots, chunk by chunk in flat memory.

    The first three valid plots start the track (see `scenario.local_plots`). At the times of other plots the estimate
    is extrapolated."""

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
        estimate, sigma = np.full((2, *shape, layout.STATES), np.nan)
        probability, nis = np.full((*shape, self.max_models), np.nan), np.full((*shape, 1), np.nan)
        plots = np.concatenate([z, R, is_valid[:, None]], axis=1)
        first = self._first_row(t, plots)
        for f, state in enumerate(self.states) if first < len(t) else ():
            out, is_tested = self._run_filter(state, t, plots, first)
            size = len(state.options.models)
            estimate[f, first:] = out[:, : layout.STATES]
            sigma[f, first:] = np.sqrt(np.maximum(out[:, layout.VARIANCE : layout.VARIANCE + layout.STATES], 0.0))
            probability[f, first:, :size] = out[:, layout.MODELS : layout.MODELS + size]
            nis[f, first:, 0] = np.where(is_tested, out[:, layout.INNOVATION], np.nan)
        self.has_started, self.last_t = len(self.start_plots) == layout.START, t[-1]
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
        for k in np.flatnonzero(plots[:, layout.DETECTED]):
            self.start_plots.append((t[k], plots[k]))
            if len(self.start_plots) == layout.START:
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
        is_tested = plots[first:, layout.DETECTED] > 0
        if not self.has_started:
            is_tested[0] = False
        return np.concatenate(outputs), is_tested

    def _start_filter(self, state: _FilterState) -> np.ndarray:
        """Start a filter from the three plots; returns its outputs (1, OUTPUT) at the third."""
        times = np.array([time for time, _ in self.start_plots])
        start_plots = np.stack([plot for _, plot in self.start_plots])
        weights = model_bank.start_weights(times, self.spec.start_acceleration_mps2)
        probabilities = model_bank.stationary(model_bank.transition_matrix(state.options.transition))
        filter_strip.start_strip(state.work, state.numbers, lane_rows(start_plots), weights, probabilities)
        out = np.zeros((1, layout.OUTPUT))
        out[0, : layout.STATES], out[0, layout.VARIANCE : layout.VARIANCE + layout.STATES] = _start_estimate(
            start_plots, weights
        )
        out[0, layout.MODELS : layout.MODELS + len(probabilities)] = probabilities
        return out


def track(case: Case, recorded: dict[str, np.ndarray]) -> Track:
    """The filters of a case over complete recorded columns (n,) at once; see `Tracker`."""
    return Tracker(case).feed(recorded)


def _run_chunk(spec: Keys, state: _FilterState, t: np.ndarray, plots: np.ndarray, frame: np.ndarray) -> np.ndarray:
    """Outputs (n, OUTPUT) of a filter over the next n plots; t (n + 1,) begins with the time of the previous row."""
    index, times = intervals(t)
    filter_bank = banks(spec.model_copy(update={"filters": (state.options,)}), times)
    size, count = filter_bank.numbers[0, layout.SIZE], len(plots)
    state.numbers[layout.PREPARED] = -1  # the intervals of this chunk are numbered from 0
    out, reported = rows(count * layout.OUTPUT), np.ones(count, dtype=np.int64)
    interval_arrays = index[1:].copy(), times
    model_arrays = filter_bank.models[0, : layout.MODEL_NUMBERS * size], filter_bank.transitions[0]
    filter_strip.filter_strip(
        *(state.work, state.numbers, lane_rows(plots), 0, count),
        *(*model_arrays, *interval_arrays, filter_bank.numbers[0], frame, reported, out),
    )
    return out.reshape(count, layout.OUTPUT, WIDTH)[:, :, 0].copy()


def _start_estimate(start_plots: np.ndarray, weights: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Mean and variances (9,) of a track at its third plot; start_plots (3, PLOT)."""
    a, b, g = weights.reshape(3, 3)
    mean, variance = np.zeros(9), np.tile(g**2, 3)
    mean[0::3], mean[1::3] = a @ start_plots[:, :3], b @ start_plots[:, :3]
    variances = start_plots[:, [layout.COVARIANCE, layout.COVARIANCE + 3, layout.COVARIANCE + 5]]  # xx, yy, zz
    variance[0::3] += a**2 @ variances
    variance[1::3] += b**2 @ variances
    return mean, variance


def lane_rows(plots: np.ndarray) -> np.ndarray:
    """Plots (n, PLOT) as rows of eight equal lanes."""
    repeated = rows(plots.size)
    repeated.reshape(-1, WIDTH)[:] = plots.reshape(-1, 1)
    return repeated

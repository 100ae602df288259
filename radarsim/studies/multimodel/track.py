"""Recorded plots: the study's filters over them, how likely they are under a filter, and the plots of one simulated
realisation as such a record."""

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

CHUNK = 4096  # recorded plots filtered at a time
TESTED = (("plot", 3),)
LEAST = 1e-4  # of a key's stated value, which counts as zero


def columns(spec: Keys) -> tuple[tuple[str, ...], ...]:
    """The columns that `track` reads of a file of recorded plots."""
    if spec.sensor.sigma_range_m is None:
        return (("t_s", "x_m", "y_m", "z_m"),)
    return (("t_s", "range_m", "elevation_rad", "azimuth_rad"),)


def sigmas(spec: Keys) -> dict[str, tuple[str, ...]]:
    """Which of the sensor's standard deviations stand behind what is tested: all, for the plot is tested as a whole."""
    biconical = ("sigma_range_m", "sigma_elevation_rad", "sigma_azimuth_rad")
    names = biconical if spec.sensor.sigma_range_m is not None else ("sigma_x_m", "sigma_y_m", "sigma_z_m")
    return {"plot": tuple(f"sensor.{name}" for name in names)}


def drawing(case: Case) -> Draw:
    """The plots of realisations of a case."""
    world, scans, biconical = prepare(case).world, scan_times(case)[0], case.spec.sensor.sigma_range_m is not None
    truth, sigma = world.plot_truth, world.frame[rec.SIGMA : rec.SIGMA + 3]
    exact = truth[:, rec.COORDINATES :].T
    if biconical:
        exact = np.stack([truth[:, rec.RANGE], *np.arcsin(truth[:, [rec.ELEVATION, rec.AZIMUTH]]).T])
    names = columns(case.spec)[0][1:]

    def draw(first: int, count: int) -> Drawn:
        plots = np.empty((3, count, len(scans)))
        room = rows(strips.RANDOM), rows(STRIP * rec.PLOT)
        strips.fill_noise(world.keys, world.frame, truth, rec.START, first, *room, plots)
        for plot, true, one in zip(plots, exact, sigma, strict=True):
            plot *= one
            plot += true
        same = np.broadcast_to(exact[:, None], plots.shape) if biconical else ()
        true_plots = {f"true_{name}": column for name, column in zip(names, same, strict=False)}
        state = np.broadcast_to(world.truth, (count, *world.truth.shape))
        return Drawn(scans, dict(zip(names, plots, strict=True)), COMPONENTS, state, true_plots, first)

    return draw


class _State(NamedTuple):
    """A filter between chunks: its keys, the kernel's memory and whole numbers."""

    options: Filter
    work: np.ndarray
    numbers: np.ndarray


class Tracker:
    """The filters of a case over recorded plots, chunk by chunk in flat memory. A plot counts where it is whole and in
    front of the antenna; the first three that count start the track. At the times of the others the estimate is the
    extrapolated one."""

    most_rows: int | None = None
    several: bool = False

    def __init__(self, case: Case):
        self.spec = case.spec
        self.names = tuple(f.name for f in self.spec.filters)
        self.most = max(len(f.models) for f in self.spec.filters)
        self.states = [_State(options, *work_arrays()) for options in self.spec.filters]
        self.held: list[tuple[float, np.ndarray]] = []
        self.begun, self.last = False, 0.0

    def feed(self, recorded: Mapping[str, np.ndarray]) -> Track:
        """The estimates over the next rows: columns (n,), not-a-number where a value is missing."""
        t = recorded["t_s"]
        z, R, whole = local_plots(self.spec.sensor, np.stack(list(recorded.values())[1:], axis=1))
        shape = (len(self.names), len(t))
        estimate, sigma = np.full((2, *shape, rec.STATES), np.nan)
        probability, nis = np.full((*shape, self.most), np.nan), np.full((*shape, 1), np.nan)
        plots = np.concatenate([z, R, whole[:, None]], axis=1)
        first = self._first(t, plots)
        for f, state in enumerate(self.states) if first < len(t) else ():
            out, tested = self._tracked(state, t, plots, first)
            size = len(state.options.models)
            estimate[f, first:] = out[:, : rec.STATES]
            sigma[f, first:] = np.sqrt(np.maximum(out[:, rec.VARIANCE : rec.VARIANCE + rec.STATES], 0.0))
            probability[f, first:, :size] = out[:, rec.MODELS : rec.MODELS + size]
            nis[f, first:, 0] = np.where(tested, out[:, rec.INNOVATION], np.nan)
        self.begun, self.last = len(self.held) == rec.START, t[-1]
        residual = np.where(whole[:, None], z, np.nan)[None] - estimate[..., 0::3]
        spread = R[None][..., [0, 3, 5]] - sigma[..., 0::3] ** 2  # of residuals after the update
        believed = np.where(np.isfinite(residual), np.sqrt(np.maximum(spread, 0.0)), np.nan)
        labels = (("x_m", "m"), ("y_m", "m"), ("z_m", "m"))
        shares = probability if self.most > 1 else None
        return Track(
            self.names, COMPONENTS, t, estimate, sigma, shares, labels, residual, TESTED, nis, residual_sigma=believed
        )

    def _first(self, t: np.ndarray, plots: np.ndarray) -> int:
        """The first row with an estimate: that of the third whole plot, or all once the track has begun."""
        if self.begun:
            return 0
        for k in np.flatnonzero(plots[:, rec.DETECTED]):
            self.held.append((t[k], plots[k]))
            if len(self.held) == rec.START:
                return int(k)
        return len(t)

    def _tracked(self, state: _State, t: np.ndarray, plots: np.ndarray, first: int) -> tuple[np.ndarray, np.ndarray]:
        """Outputs (n', OUTPUT) of one filter from row `first` on, and where an innovation was tested."""
        found, begin = [], first
        if not self.begun:
            found, begin = [self._started(state)], first + 1
        frame = sensor_frame(self.spec.sensor)
        for start in range(begin, len(t), CHUNK):
            stop = min(start + CHUNK, len(t))
            before = t[start - 1] if start else self.last
            found.append(_filtered(self.spec, state, np.append(before, t[start:stop]), plots[start:stop], frame))
        tested = plots[first:, rec.DETECTED] > 0
        if not self.begun:
            tested[0] = False
        return np.concatenate(found), tested

    def _started(self, state: _State) -> np.ndarray:
        """Start a filter from the three plots; its outputs (1, OUTPUT) at the third."""
        times, began = np.array([at for at, _ in self.held]), np.stack([plot for _, plot in self.held])
        weights = world.start_weights(times, self.spec.start_acceleration_mps2)
        chances = world.stationary(world.transition_matrix(state.options.transition))
        strips.start_strip(state.work, state.numbers, _lanes(began), weights, chances)
        out = np.zeros((1, rec.OUTPUT))
        out[0, : rec.STATES], out[0, rec.VARIANCE : rec.VARIANCE + rec.STATES] = _at_start(began, weights)
        out[0, rec.MODELS : rec.MODELS + len(chances)] = chances
        return out


def track(case: Case, recorded: dict[str, np.ndarray]) -> Track:
    """The filters of a case over whole recorded columns (n,) at once; see `Tracker`."""
    return Tracker(case).feed(recorded)


def _filtered(spec: Keys, state: _State, t: np.ndarray, plots: np.ndarray, frame: np.ndarray) -> np.ndarray:
    """Outputs (n, OUTPUT) over the next n plots of one filter; t (n + 1,) with the time of the row before."""
    index, times = intervals(t)
    own = banks(spec.model_copy(update={"filters": (state.options,)}), times)
    size, count = own.numbers[0, rec.SIZE], len(plots)
    state.numbers[rec.PREPARED] = -1  # the intervals of this chunk are numbered from 0
    out, reported = rows(count * rec.OUTPUT), np.ones(count, dtype=np.int64)
    scans = index[1:].copy(), times
    design = own.models[0, : rec.MODEL_NUMBERS * size], own.transitions[0]
    strips.filter_strip(
        *(state.work, state.numbers, _lanes(plots), 0, count), *(*design, *scans, own.numbers[0], frame, reported, out)
    )
    return out.reshape(count, rec.OUTPUT, WIDTH)[:, :, 0].copy()


def _at_start(began: np.ndarray, weights: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Mean and variances (9,) of a track at its third plot; began (3, PLOT)."""
    a, b, g = weights.reshape(3, 3)
    mean, variance = np.zeros(9), np.tile(g**2, 3)
    mean[0::3], mean[1::3] = a @ began[:, :3], b @ began[:, :3]
    own = began[:, [rec.COVARIANCE, rec.COVARIANCE + 3, rec.COVARIANCE + 5]]  # xx, yy, zz
    variance[0::3] += a**2 @ own
    variance[1::3] += b**2 @ own
    return mean, variance


def _lanes(plots: np.ndarray) -> np.ndarray:
    """Plots (n, PLOT) as rows of eight equal lanes."""
    found = rows(plots.size)
    found.reshape(-1, WIDTH)[:] = plots.reshape(-1, 1)
    return found


class PlotLikelihood:
    """How likely tracks are under a filter: the density that its bank of models gives each plot. The first three whole
    plots start the track. Its keys are the sensor's σ and the acceleration of the hardest manoeuvring model.

    As a function of the keys, hypotheses are merged by moments: under the other rules, which choose between hypotheses,
    it leaps."""

    def __init__(self, case: Case, number: int, tracks: Sequence[Mapping[str, np.ndarray]]):
        self.spec: Keys = case.spec
        self.options = self.spec.filters[number]
        self.filter, self.tracks = self.options.name, len(tracks)
        self.rows, self.usual_s = sum(len(columns["t_s"]) for columns in tracks), usual_interval_s(tracks)
        # Where the plot's covariance is made by the filter, outliers cannot be given a wider one.
        self.explains: tuple[str, ...] = (OUTLIERS,) if self.options.covariance_at == "plot" else ()
        spreads = [model.sigma_acceleration_mps2 for model in self.options.models]
        self.hardest = int(np.argmax(spreads))
        names = sigmas(self.spec)["plot"]
        self.keys = (*names, f"filters.{number}.models.{self.hardest}.sigma_acceleration_mps2")
        self.stated = np.array([*self.spec.sensor.sigma, spreads[self.hardest]])
        self.least = np.append(LEAST * self.stated[:3], LEAST * (self.stated[3] or 1.0))
        self.measured = np.concatenate([np.stack(list(columns.values())[1:], axis=1) for columns in tracks])
        whole, ends = local_plots(self.spec.sensor, self.measured)[2], np.cumsum([len(one["t_s"]) for one in tracks])
        parts = ((one["t_s"], end - len(one["t_s"])) for one, end in zip(tracks, ends, strict=True))
        found = (_problem(self.spec, self.options, t, first, whole[first : first + len(t)]) for t, first in parts)
        self.problems = [one for one in found if one is not None]
        self.frame = sensor_frame(self.spec.sensor)
        self.chances = world.stationary(world.transition_matrix(self.options.transition))

    def _score(self, values: np.ndarray, merge: str, outliers: float) -> float:
        """The logarithm of the likelihood of all tracks, with other values of the keys and a rule of merges."""
        names = [key.partition(".")[2] for key in self.keys[:3]]
        sensor = self.spec.sensor.model_copy(update=dict(zip(names, values[:3].tolist(), strict=True)))
        models = list(self.options.models)
        hardest = {"sigma_acceleration_mps2": float(values[3])}
        models[self.hardest] = models[self.hardest].model_copy(update=hardest)
        options = self.options.model_copy(update={"models": tuple(models), "merge": merge})
        own = banks(self.spec.model_copy(update={"filters": (options,)}), np.ones(1))
        design, numbers = own.models[0, : rec.MODEL_NUMBERS * len(models)], own.numbers[0]
        z, R, whole = local_plots(sensor, self.measured)
        plots, total = np.concatenate([z, R, whole[:, None]], axis=1), 0.0
        for one in self.problems:
            work, state = work_arrays()
            strips.start_strip(work, state, _lanes(plots[one.began]), one.weights, self.chances)
            following, score = _lanes(plots[one.following]), np.empty(len(one.intervals))
            given = design, one.transitions, one.intervals, one.times, numbers, self.frame
            strips.log_likelihood(work, state, following, *given, outliers, score)
            total += float(score.sum())
        return total

    def __call__(self, values: np.ndarray, outliers: float = 0.0, bias: float = 0.0, correlation: float = 0.0) -> float:
        """The logarithm of the likelihood; neither a bias nor a correlation is looked for."""
        return self._score(values, "moment", outliers)

    def by_number(self, values: np.ndarray) -> dict[str, float]:
        """Of the plot as a whole, with the filter's own rule of merges."""
        return {"plot": self._score(values, self.options.merge, 0.0)}


class _Problem(NamedTuple):
    """A track for the kernel: which of all plots start it, and with which weights; those that follow, the number of the
    interval before each of these, the different intervals (s), and the models' transition probabilities over them."""

    began: np.ndarray
    weights: np.ndarray
    following: slice
    intervals: np.ndarray
    times: np.ndarray
    transitions: np.ndarray


def _problem(spec: Keys, options: Filter, t: np.ndarray, start: int, whole: np.ndarray) -> _Problem | None:
    """A track at times t (n,) whose plots, of which some are whole (n,), begin at row `start` of all; None where it
    never starts."""
    began = np.flatnonzero(whole)[: rec.START]
    if len(began) < rec.START or began[-1] + 1 == len(t):
        return None
    index, times = intervals(t[began[-1] :])
    transitions = banks(spec.model_copy(update={"filters": (options,)}), times).transitions[0]
    weights = world.start_weights(t[began], spec.start_acceleration_mps2)
    return _Problem(
        start + began, weights, slice(start + began[-1] + 1, start + len(t)), index[1:].copy(), times, transitions
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

"""Plots of the range_doppler study: those of one realisation, and the study's filters over recorded ones."""

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from radarsim.config.experiment import Case
from radarsim.constants import STANDARD_GRAVITY_MPS2
from radarsim.engine.results import Track
from radarsim.kernels import linear
from radarsim.kernels.algebra import pack, unpack
from radarsim.kernels.hypotheses import lasting, log_likelihood
from radarsim.physics import transition
from radarsim.studies.interface import EXPLANATIONS, Draw, Drawn, RecordedPlots, Turning, usual_interval_s
from radarsim.studies.range_doppler import config
from radarsim.studies.range_doppler.config import FOLDED, MOST_SCANS, Filter, FilterKeys, Keys, Turn, can_fold
from radarsim.studies.range_doppler.filters import least_squares, noise_by_time, observation
from radarsim.studies.range_doppler.given import GivenGains, Scans, followed
from radarsim.studies.range_doppler.kernels import missed
from radarsim.studies.range_doppler.study import COMPONENTS, prepare
from radarsim.studies.range_doppler.tuning import designed

STARTING = 3  # ranges of a track from which its state is found, in the likelihood
LEAST_MANOEUVRE = 1e-6  # of the stated manoeuvre variance, which counts as none
WIDE_VELOCITY_MPS, WIDE_ACCELERATION_MPS2 = 3e4, 3e3  # standard deviations before the first plot: nothing is known
LONGEST_START = 200  # plots in which a start is looked for; a file of velocities alone never has one
TURN_G, TURN_SPEED_MPS, TURNED_DEG = 3.0, 250.0, 90.0  # a turn as an aircraft flies it
SETTLED = 60  # scans before and after it
FARTHER_M = 60e3  # than the flight is long, so that it does not meet the radar
MEASURED = (("range_m", 1), ("velocity_mps", 1))
SIGMAS: dict[str, tuple[str, ...]] = {
    "range_m": ("radar.sigma_range_m",),
    "velocity_mps": ("radar.sigma_velocity_mps",),
}


def drawing(case: Case) -> Draw:
    """The plots of realisations of a case."""
    plan = prepare(case)
    problem = plan.problem

    def draw(first: int, count: int) -> Drawn:
        if isinstance(problem, missed.Problem):
            plots, truth = missed.simulate_plots(problem, first, count)
        else:
            plots = linear.simulate_plots(problem, first, count)
            truth = np.broadcast_to(problem.truth, (count, *problem.truth.shape))
        columns = {name: plots[..., i] for i, (name, _) in enumerate(MEASURED)}
        return Drawn(plan.axes.t_s, columns, COMPONENTS, truth, first=first)

    return draw


def variances_of(case: Case) -> Sequence[float]:
    """D_M of each filter, (m/s³)²: as given, or the best on the config's target."""
    spec: Keys = case.spec
    fixed_variances = [variance for variance in map(config.variance_of, spec.filters) if isinstance(variance, float)]
    return fixed_variances if len(fixed_variances) == len(spec.filters) else designed(case).variances


class Tracker:
    """The filters of a case over recorded plots, chunk by chunk in flat memory.

    A filter starts by least squares as soon as it has taken as many plots as the config's `initial_scans` says and
    these determine range, velocity and acceleration; before, its estimates are the plots. Then the Kalman filter of the
    study goes from row to row, its gains computed for the interval and for what the row holds. Where the config leaves
    the manoeuvre variance to be looked for, it is the best one on the config's target. A filter of a package makes its
    gains for the times of the whole recording and for what each row holds."""

    several = False

    def __init__(self, case: Case):
        spec: Keys = case.spec
        self.names = tuple(f.name for f in spec.filters)
        self.sigma = np.array([spec.radar.sigma_range_m, spec.radar.sigma_velocity_mps])
        period = spec.radar.scan_period_s
        self.filters = [
            _One(f, noise_by_time(f.process_noise, variance, period), self.sigma)
            if isinstance(f, Filter)
            else _Given(f, self.sigma)
            for f, variance in zip(spec.filters, variances_of(case), strict=True)
        ]
        self.most_rows = None if all(isinstance(f, Filter) for f in spec.filters) else MOST_SCANS

    def feed(self, recorded: Mapping[str, np.ndarray]) -> Track:
        """The estimates over the next rows: columns (n,), not-a-number where a value is missing."""
        t, z = recorded["t_s"], np.stack([recorded["range_m"], recorded["velocity_mps"]], axis=1)
        outputs = [track_filter.feed(t, z) for track_filter in self.filters]
        estimate, sigma, nis = (np.stack([part[i] for part in outputs]) for i in range(3))
        residual = z[None] - estimate[..., :2]
        is_used = np.arange(2) < np.array([track_filter.observes for track_filter in self.filters])[:, None]
        # A number that was taken in has drawn the estimate to itself; of another the errors add.
        spread = self.sigma**2 + np.where(is_used[:, None], -1.0, 1.0) * sigma[..., :2] ** 2
        for filter_spread, track_filter in zip(spread, self.filters, strict=True):
            if isinstance(track_filter, _Given):
                filter_spread[len(t) - len(track_filter.left) :] = track_filter.left
        residual_sigma = np.where(np.isfinite(residual), np.sqrt(np.maximum(spread, 0.0)), np.nan)
        labels = (("range_m", "m"), ("velocity_mps", "m/s"))
        return Track(
            self.names,
            COMPONENTS,
            t,
            estimate,
            sigma,
            None,
            labels,
            residual,
            MEASURED,
            nis,
            residual_sigma=residual_sigma,
        )


class _Starting(ABC):
    """A filter before its start: the plots that it is to be started from; then its state and covariance."""

    def __init__(self, options: FilterKeys, sigma: np.ndarray):
        self.observes, self.needed, self.sigma = len(options.observes), options.plots_to_start, sigma
        self.x: np.ndarray | None = None
        self.P = np.zeros(6)
        self.last = 0.0
        self.held: list[tuple[float, np.ndarray]] = []

    def feed(self, t: np.ndarray, z: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Estimates, standard deviations (n, 3), and normalised innovations squared (n, 2) over the next rows."""
        n = len(t)
        estimate, sigma, nis = np.full((n, 3), np.nan), np.full((n, 3), np.nan), np.full((n, 2), np.nan)
        is_used = np.isfinite(z) & (np.arange(2) < self.observes)
        k = 0
        while self.x is None and k < n:
            self._begin(t[k], np.where(is_used[k], z[k], np.nan))
            if self.x is None:
                estimate[k, :2] = np.where(is_used[k], z[k], np.nan)
                sigma[k, :2] = np.where(is_used[k], self.sigma, np.nan)
            else:
                estimate[k], sigma[k] = self.x, np.sqrt(self.P[[0, 3, 5]])
            k += 1
        if k < n:
            estimate[k:], sigma[k:], nis[k:] = self.after(k, t, z, is_used)
        self.last = t[-1]
        return estimate, sigma, nis

    @abstractmethod
    def after(
        self, k: int, t: np.ndarray, z: np.ndarray, is_used: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The outputs of `feed` for the rows from k on, where the filter has started; is_used: the numbers it takes."""

    def _begin(self, t: float, z: np.ndarray) -> None:
        """Take one more plot, and start from all so far where they suffice."""
        if np.isfinite(z).any():
            self.held = [*self.held[-(LONGEST_START - 1) :], (t, z)]
        if len(self.held) < self.needed or not np.isfinite(z).any():
            return
        times = np.array([plot_time for plot_time, _ in self.held]) - t
        values = np.stack([plot for _, plot in self.held])
        solution = least_squares(times, np.isfinite(values), self.sigma)
        if solution is not None:
            weights, covariance = solution
            self.x, self.P = np.einsum("ijk,kj->i", weights, np.nan_to_num(values)), np.array(pack(covariance))
            self.held = []


class _One(_Starting):
    """A filter of the study: chunk by chunk."""

    def __init__(self, options: Filter, noise: np.ndarray, sigma: np.ndarray):
        super().__init__(options, sigma)
        self.noise = noise

    def after(
        self, k: int, t: np.ndarray, z: np.ndarray, is_used: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        dt = np.diff(t[k:], prepend=self.last if k == 0 else t[k - 1])
        n = len(dt)
        outputs = np.empty((n, 3)), np.empty((n, 3)), np.full((n, 2), np.nan)
        inputs = self.x, self.P, dt, np.where(is_used, z, 0.0)[k:], is_used[k:].astype(float), self.sigma**2, self.noise
        missed.filter_rows(*inputs, *outputs)
        return outputs


class _Given(_Starting):
    """A filter of a package, over a whole recording at once; left (n, 2): variances of what plots differ by from it."""

    def __init__(self, options: GivenGains, sigma: np.ndarray):
        super().__init__(options, sigma)
        self.options, self.left = options, np.empty((0, 2))

    def after(
        self, k: int, t: np.ndarray, z: np.ndarray, is_used: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        assert self.x is not None  # it has started
        scans = Scans(t, is_used, self.sigma, k, unpack(self.P))
        estimate, sigma, nis, self.left = followed(self.options, scans, self.x, z)
        return estimate, sigma, nis


def in_a_turn(case: Case, filter_name: str, variance: float) -> Turning:
    """The largest exact error of range (m) of a filter over a flight of TURN, as stated and with another manoeuvre
    variance: straight flight until the filter has settled, the turn, and straight flight again, no plot missed."""
    dt = case.spec.radar.scan_period_s
    (options,) = (
        variance_of_filter for variance_of_filter in case.spec.filters if variance_of_filter.name == filter_name
    )
    configured = variances_of(case)[case.spec.filters.index(options)]
    variances = {"stated": configured, "changed": variance}
    turn_s = math.radians(TURNED_DEG) / (TURN_G * STANDARD_GRAVITY_MPS2 / TURN_SPEED_MPS)
    start_s, scans = SETTLED * dt, 2 * SETTLED + math.ceil(turn_s / dt)
    target = Turn.model_validate(
        {
            "kind": "turn",
            "range_m": TURN_SPEED_MPS * (scans * dt) + FARTHER_M,
            "speed_mps": TURN_SPEED_MPS,
            "aspect_rad": math.pi,
            "acceleration_g": TURN_G,
            "start_s": start_s,
            "duration_s": turn_s,
        }
    )
    filters = tuple(
        options.model_copy(update={"name": name, "manoeuvre_variance": variance_of_filter})
        for name, variance_of_filter in variances.items()
    )
    radar = case.spec.radar.model_copy(update={"detection_probability": 1.0})
    changes = {"radar": radar, "target": target, "filters": filters, "baseline": "stated", "scans": scans}
    axes = prepare(replace(case, spec=case.spec.model_copy(update=changes))).axes
    worst = axes.exact_sigma[:, SETTLED:, 0].max(axis=1)
    return Turning(*COMPONENTS[0], TURN_G, *worst.tolist())


def likely(spec: Keys, filter_name: str | None) -> Filter | None:
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
        options = likely(case.spec, filter_name)
        assert options is not None
        self.filter, self.tracks = options.name, len(tracks)
        variance = variances_of(case)[case.spec.filters.index(options)]
        self.rows, self.usual_s = sum(len(columns["t_s"]) for columns in tracks), usual_interval_s(tracks)
        radar, self.observes = case.spec.radar, len(options.observes)
        sigmas = {"radar.sigma_range_m": radar.sigma_range_m, "radar.sigma_velocity_mps": radar.sigma_velocity_mps}
        configured = dict(list(sigmas.items())[: self.observes]) | {"manoeuvre_variance": variance}
        self.keys, self.stated = tuple(configured), np.array(list(configured.values()), dtype=float)
        self.least = self.stated * np.array([1e-4] * self.observes + [LEAST_MANOEUVRE])
        self.noise = noise_by_time(options.process_noise, 1.0, radar.scan_period_s)
        self.problems = [problem for columns in tracks if (problem := self._problem(columns)) is not None]

    def _problem(self, columns: Mapping[str, np.ndarray]) -> "_Problem | None":
        """A track from its first range on; None where it has none."""
        has_range = np.isfinite(columns["range_m"])
        if not has_range.any():
            return None
        first = int(has_range.argmax())
        t = columns["t_s"][first:]
        dt = np.diff(t, prepend=t[0])
        z = np.stack([columns["range_m"], columns["velocity_mps"]], axis=1)[first:, : self.observes]
        present = np.isfinite(z)
        present[0, 0] = False  # it starts the track
        F, Q = np.stack([transition(step) for step in dt]), unpack(missed.noise_over(self.noise, dt))
        H = np.tile(observation(self.observes), (len(t), 1, 1))
        settled = int(np.searchsorted(np.cumsum(has_range[first:]), STARTING, side="right"))
        return _Problem(F, Q, H, np.where(np.isfinite(z), z, 0.0), present, settled, dt / self.usual_s)

    def _scores(self, values: np.ndarray, outliers: float, bias: float, correlation: float) -> np.ndarray:
        """Sums over all tracks for each number that counts; the first plots, which find the state, are left out."""
        manoeuvre = float(values[self.observes])
        variances, total = np.square(values[: self.observes]), np.zeros(self.observes)
        offset = np.zeros(self.observes)
        offset[1:] = bias * values[1 : self.observes]
        for problem in self.problems:
            x, P = np.zeros(3), np.diag([variances[0], WIDE_VELOCITY_MPS**2, WIDE_ACCELERATION_MPS2**2])
            x[0] = problem.z[0, 0]
            score, spread = np.empty(problem.z.shape), np.tile(variances, (len(problem.z), 1))
            z = problem.z - offset if bias else problem.z
            model, scale, white = (x, P, problem.F, problem.Q, problem.H), manoeuvre, 1.0
            if correlation:
                error_covariance = np.zeros((3, self.observes))  # it is where the first plot is, and errs by its error
                error_covariance[0, 0] = -math.sqrt(variances[0])
                model = lasting(
                    x,
                    P,
                    error_covariance,
                    problem.F,
                    manoeuvre * problem.Q,
                    problem.H,
                    spread,
                    correlation**problem.intervals,
                )
                scale, white = 1.0, 0.0
            log_likelihood(*model, z, spread, problem.there, scale, outliers, white, score)
            total += score[problem.settled :].sum(axis=0)
        return total

    def __call__(self, values: np.ndarray, outliers: float = 0.0, bias: float = 0.0, correlation: float = 0.0) -> float:
        """The logarithm of the likelihood; bias: of the velocity, in its σ."""
        return float(self._scores(values, outliers, bias, correlation).sum())

    def by_number(self, values: np.ndarray) -> dict[str, float]:
        """The sums of range and velocity."""
        total = self._scores(values, 0.0, 0.0, 0.0)
        return {name: float(part) for (name, _), part in zip(MEASURED[: self.observes], total, strict=False)}


class _Problem(NamedTuple):
    """A track for the kernel: transitions and process noises of unit variance (n, 3, 3), the rows (n, m, 3) of its
    numbers (n, m), which of these count, the row from which the state is known, and the time (n,) since the row before
    in usual intervals."""

    F: np.ndarray
    Q: np.ndarray
    H: np.ndarray
    z: np.ndarray
    there: np.ndarray
    settled: int
    intervals: np.ndarray


class Recorded(RecordedPlots):
    """The study's part in `radarsim track` and `radarsim simulate`."""

    drawing, tracker = staticmethod(drawing), staticmethod(Tracker)

    def likelihood(
        self, case: Case, filter_name: str | None, tracks: Sequence[Mapping[str, np.ndarray]]
    ) -> PlotLikelihood | None:
        return PlotLikelihood(case, filter_name, tracks) if likely(case.spec, filter_name) else None

    def columns(self, spec: Keys) -> Sequence[Sequence[str]]:
        return (("t_s", "range_m", "velocity_mps"),)

    def sigmas(self, spec: Keys) -> Mapping[str, Sequence[str]]:
        return SIGMAS

    def scan_period_s(self, spec: Keys) -> float:
        return spec.radar.scan_period_s

    def span_mps(self, spec: Keys) -> float | None:
        radar = spec.radar
        return (
            radar.wavelength_m * radar.repetition_rate_hz / 2
            if "repetition_rate_hz" in radar.model_fields_set
            else None
        )

    def unfolding(self, spec: Keys, span_mps: float) -> Sequence[str]:
        rate = f"radar.repetition_rate_hz={2 * span_mps / spec.radar.wavelength_m:.6g}"
        return (FOLDED, *([] if self.span_mps(spec) == span_mps else [rate])) if can_fold(spec) else ()

    def in_a_turn(self, case: Case, filter_name: str, values: Mapping[str, float]) -> Turning | None:
        variance = values.get("manoeuvre_variance")
        return None if variance is None else in_a_turn(case, filter_name, variance)

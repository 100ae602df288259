"""P1's filters over recorded plots, and the plots of simulated realisations."""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence

import numpy as np

from radarsim.config.experiment import Case
from radarsim.config.radial_keys import MAX_SCANS
from radarsim.kernels import second_order
from radarsim.kernels.kalman_algebra import pack, unpack
from radarsim.studies.missed_scans import with_missed_scans
from radarsim.studies.plot_arrays import DrawPlots, SimulatedPlots
from radarsim.studies.range_doppler import config
from radarsim.studies.range_doppler.config import Filter, FilterKeys, Keys
from radarsim.studies.range_doppler.designed_case import design_case
from radarsim.studies.range_doppler.filter_design import least_squares, noise_by_time
from radarsim.studies.range_doppler.kernels import missed_block, recorded_rows
from radarsim.studies.range_doppler.package_filters import GivenGains, Scans, filter_recorded
from radarsim.studies.range_doppler.study import COMPONENTS, prepare
from radarsim.studies.recording_interface import Track

START_RANGES = 3  # ranges of a track from which its state is found, in the likelihood
MAX_START_PLOTS = 200  # plots in which a start is looked for; a file of velocities alone never has one
MEASURED = (("range_m", 1), ("velocity_mps", 1))


def simulated_plots(case: Case) -> DrawPlots:
    """The plots of realisations of a case."""
    plan = prepare(case)
    problem = plan.problem

    def draw(first: int, count: int) -> SimulatedPlots:
        if isinstance(problem, missed_block.Problem):
            plots, truth = missed_block.simulate_plots(problem, first, count)
        else:
            plots = second_order.simulate_plots(problem, first, count)
            truth = np.broadcast_to(problem.truth, (count, *problem.truth.shape))
        columns = {name: plots[..., i] for i, (name, _) in enumerate(MEASURED)}
        return SimulatedPlots(plan.axes.t_s, columns, COMPONENTS, truth, first=first)

    return draw


def configured_variances(case: Case) -> Sequence[float]:
    """D_M of each filter, (m/s³)²: as given, or the best on the config's target."""
    spec: Keys = case.spec
    fixed_variances = [
        variance for variance in map(config.configured_variance, spec.filters) if isinstance(variance, float)
    ]
    return fixed_variances if len(fixed_variances) == len(spec.filters) else design_case(case).variances


class Tracker:
    """The filters of a case over recorded plots, chunk by chunk in flat memory.

    A filter starts by least squares as soon as it has taken as many plots as the config's `initial_scans` says and
    these determine range, velocity and acceleration; before, its estimates are the plots. Then the Kalman filter of the
    study goes from row to row, its gains computed for the interval and for what the row holds; an empty row is none.
    Where the config leaves the manoeuvre variance to be looked for, it is the best one on the config's target. A filter
    of a package makes its gains for the times of the whole recording, missed scans included, and for what each row
    holds."""

    several = False

    def __init__(self, case: Case):
        spec: Keys = case.spec
        self.names = tuple(f.name for f in spec.filters)
        self.sigma = np.array([spec.radar.sigma_range_m, spec.radar.sigma_velocity_mps])
        period = spec.radar.scan_period_s
        self.filters = [
            _KalmanTrackFilter(f, noise_by_time(f.process_noise, variance, period), self.sigma)
            if isinstance(f, Filter)
            else _GainsTrackFilter(f, self.sigma, period)
            for f, variance in zip(spec.filters, configured_variances(case), strict=True)
        ]
        self.most_rows = None if all(isinstance(f, Filter) for f in spec.filters) else MAX_SCANS

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
            if isinstance(track_filter, _GainsTrackFilter):
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


class _TrackFilter(ABC):
    """A filter before its start: the plots that it is to be started from; then its state and covariance."""

    def __init__(self, options: FilterKeys, sigma: np.ndarray):
        self.observes, self.needed, self.sigma = len(options.observes), options.plots_to_start, sigma
        self.x: np.ndarray | None = None
        self.P = np.zeros(6)
        self.last_t = np.zeros(1)
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
                estimate[k], sigma[k], self.last_t[0] = self.x, np.sqrt(self.P[[0, 3, 5]]), t[k]
            k += 1
        if k < n:
            estimate[k:], sigma[k:], nis[k:] = self.after(k, t, z, is_used)
        return estimate, sigma, nis

    @abstractmethod
    def after(
        self, k: int, t: np.ndarray, z: np.ndarray, is_used: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The outputs of `feed` for the rows from k on, where the filter has started; is_used: the numbers it takes."""

    def _begin(self, t: float, z: np.ndarray) -> None:
        """Take one more plot, and start from all so far where they suffice."""
        if np.isfinite(z).any():
            self.held = [*self.held[-(MAX_START_PLOTS - 1) :], (t, z)]
        if len(self.held) < self.needed or not np.isfinite(z).any():
            return
        times = np.array([plot_time for plot_time, _ in self.held]) - t
        values = np.stack([plot for _, plot in self.held])
        solution = least_squares(times, np.isfinite(values), self.sigma)
        if solution is not None:
            weights, covariance = solution
            self.x, self.P = np.einsum("ijk,kj->i", weights, np.nan_to_num(values)), np.array(pack(covariance))
            self.held = []


class _KalmanTrackFilter(_TrackFilter):
    """A filter of the study: chunk by chunk."""

    def __init__(self, options: Filter, noise: np.ndarray, sigma: np.ndarray):
        super().__init__(options, sigma)
        self.noise = noise

    def after(
        self, k: int, t: np.ndarray, z: np.ndarray, is_used: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        n, state = len(t) - k, (self.x, self.P, self.last_t)
        outputs = np.empty((n, 3)), np.empty((n, 3)), np.full((n, 2), np.nan)
        plots = t[k:], np.where(is_used, z, 0.0)[k:], is_used[k:].astype(float), self.sigma**2
        recorded_rows.filter_rows(*state, *plots, self.noise, *outputs)
        return outputs


class _GainsTrackFilter(_TrackFilter):
    """A filter of a package, over a whole recording at once; left (n, 2): variances of what plots differ by from it."""

    def __init__(self, options: GivenGains, sigma: np.ndarray, period: float):
        super().__init__(options, sigma)
        self.options, self.period, self.left = options, period, np.empty((0, 2))

    def after(
        self, k: int, t: np.ndarray, z: np.ndarray, is_used: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        assert self.x is not None  # it has started
        times, rows = with_missed_scans(t, self.period)
        is_there, plots = np.zeros((len(times), 2), dtype=bool), np.full((len(times), 2), np.nan)
        is_there[rows], plots[rows] = is_used, z
        start = int(rows[k - 1]) + 1
        scans = Scans(times, is_there, self.sigma, start, unpack(self.P))
        outputs = filter_recorded(self.options, scans, self.x, plots)
        estimate, sigma, nis, self.left = (values[rows[k:] - start] for values in outputs)
        return estimate, sigma, nis

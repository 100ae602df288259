"""How likely recorded plots are under a filter's model."""

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from radarsim.config.experiment import Case
from radarsim.kernels.kalman_algebra import unpack
from radarsim.kernels.likelihood import log_likelihood, with_lasting_errors
from radarsim.physics.motion import transition
from radarsim.studies.range_doppler.config import Filter, Keys
from radarsim.studies.range_doppler.filter_design import noise_by_time, observation
from radarsim.studies.range_doppler.kernels import recorded_rows
from radarsim.studies.range_doppler.tracking import MEASURED, START_RANGES, configured_variances
from radarsim.studies.recording_interface import EXPLANATIONS, usual_interval_s

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
        self.least = self.stated * np.array([1e-4] * self.observes + [MIN_MANOEUVRE])
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
        F, Q = np.stack([transition(step) for step in dt]), unpack(recorded_rows.noise_over(self.noise, dt))
        H = np.tile(observation(self.observes), (len(t), 1, 1))
        settled = int(np.searchsorted(np.cumsum(has_range[first:]), START_RANGES, side="right"))
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
                model = with_lasting_errors(
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

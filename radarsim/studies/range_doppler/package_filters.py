"""Filters of packages: gains that do not depend on the data, by scan, from which all else follows.

A package derives a class from `GivenGains` and names it by an entry point of the group `radarsim.filters`. The class
holds the keys of its `kind` and makes its gains; the start by least squares, the covariance that the filter believes,
its exact errors, the kernel and recorded plots are as for the study's own filters."""

from abc import abstractmethod
from collections.abc import Callable
from typing import Any, ClassVar, NamedTuple

import numpy as np

from radarsim.kernels.kalman_algebra import constant_acceleration, pack, unpack
from radarsim.physics.motion import is_covariance, transition
from radarsim.studies.range_doppler.config import FilterKeys
from radarsim.studies.range_doppler.error_recursion import Plots, defects, start_errors
from radarsim.studies.range_doppler.filter_design import LinearFilter, least_squares_start, update_covariance
from radarsim.user_code.errors import call_user_function, user_code_error

STEADY_TOLERANCE = 1e-9  # relative change of a gain from one scan to the next that counts as none


class Scans(NamedTuple):
    """What gains are made for: K scans, or rows of recorded plots and the scans missed between them: a start and the
    rows after it.

    t_s (K,) are their times, s; there (K, 2): where range and velocity come and are observed; sigma (2,) are the
    standard deviations of these, m and m/s. start is the scan, from 1, at which the least-squares start ends, and
    covariance (3, 3) that of its range, velocity and acceleration, m, m/s, m/s²."""

    t_s: np.ndarray
    there: np.ndarray
    sigma: np.ndarray
    start: int
    covariance: np.ndarray

    def kalman(self, noise: Callable[[float], np.ndarray]) -> np.ndarray:
        """Gains (K, 3, 2) of the study's Kalman filter; noise(dt) is the covariance (3, 3) that a time dt (s) adds."""
        gains, R = np.zeros((len(self.t_s), 3, 2)), self.sigma**2
        P: Any = tuple(map(float, pack(self.covariance)))
        F, Q, noise_dt = constant_acceleration(0.0), P, 0.0
        for k in range(self.start, len(self.t_s)):
            dt = float(self.t_s[k] - self.t_s[k - 1])
            if dt != noise_dt:
                F, Q, noise_dt = constant_acceleration(dt), tuple(map(float, pack(noise(dt)))), dt
            P, gains[k, :, 0], gains[k, :, 1] = update_covariance(P, F, Q, R, self.there[k])
        return gains

    def errors(self, gains: np.ndarray, noise: Callable[[float], np.ndarray]) -> np.ndarray:
        """Covariances (K, 3, 3) of the errors that gains (K, 3, 2) leave: of the plots and of noise(dt)."""
        covariances, R = np.zeros((len(self.t_s), 3, 3)), np.diag(self.sigma**2)
        covariances[self.start - 1] = self.covariance
        F, Q, noise_dt = np.eye(3), np.zeros((3, 3)), 0.0
        for k in range(self.start, len(self.t_s)):
            dt, K = float(self.t_s[k] - self.t_s[k - 1]), gains[k]
            if dt != noise_dt:
                F, Q, noise_dt = transition(dt), noise(dt), dt
            I_minus_KH = np.eye(3) - K @ OBSERVED
            covariances[k] = I_minus_KH @ (F @ covariances[k - 1] @ F.T + Q) @ I_minus_KH.T + K @ R @ K.T
        return covariances


OBSERVED = np.eye(2, 3)  # H: a plot is the range and the velocity of the state


class GivenGains(FilterKeys):
    """A filter of a package: its keys beside `name`, `kind`, `observes` and `initial_scans`, and its gains.

    `kind: Literal["NAME"] = key("kind", "what it is")`, with the name of the entry point, is what configs ask for.
    """

    study: ClassVar[str] = "range_doppler"

    @abstractmethod
    def gains(self, scans: Scans) -> np.ndarray:
        """Gains (K, 3, 2) of range, velocity and acceleration on the errors of the predicted range and velocity.

        They are read from the scan after the start on, and of numbers that come and that the filter observes.
        """

    def noise(self, dt_s: float) -> np.ndarray:
        """The covariance (3, 3) that the filter takes a target's motion to add in a time, in m, m/s, m/s².

        It enters what the filter believes of its errors, not its gains. Default: none.
        """
        return np.zeros((3, 3))


def package_filter_class() -> type[GivenGains]:
    """What filters of packages are derived from."""
    return GivenGains


def check_gains(gains_filter: GivenGains, scans: Scans) -> np.ndarray:
    """The gains (K, 3, 2) of a filter of a package, zero where they are not read. Raises ConfigError where it fails."""
    gains = _numbers(gains_filter, gains_filter.gains, (len(scans.t_s), 3, 2), scans)
    read = scans.there & (np.arange(1, len(gains) + 1) > scans.start)[:, None]
    gains = np.where(read[:, None, :], gains, 0.0)
    if not np.isfinite(gains).all():
        k = int(np.argmax(~np.isfinite(gains).all(axis=(1, 2)))) + 1
        raise user_code_error(
            gains_filter.gains,
            f"must make finite gains, those of scan {k} are {gains[k - 1].tolist()}",
            owner=_name(gains_filter),
        )
    return gains


def noise_of(gains_filter: GivenGains) -> Callable[[float], np.ndarray]:
    """`noise` of a filter of a package; raises ConfigError where it gives no covariance (3, 3)."""

    def noise(dt_s: float) -> np.ndarray:
        covariance = _numbers(gains_filter, gains_filter.noise, (3, 3), dt_s)
        if not (np.isfinite(covariance).all() and is_covariance(covariance)):
            message = f"must give a covariance, finite, symmetric and not negative, got {covariance.tolist()}"
            raise user_code_error(gains_filter.noise, message, owner=_name(gains_filter))
        return covariance

    return noise


def _name(gains_filter: GivenGains) -> str:
    return f"filter {gains_filter.name}: kind {gains_filter.kind}: "


def _numbers(
    gains_filter: GivenGains, function: Callable[..., Any], shape: tuple[int, ...], *arguments: Any
) -> np.ndarray:
    """The numbers of this shape that a function of a filter gives. Raises ConfigError where it gives others."""
    value = call_user_function(function, *arguments, owner=_name(gains_filter))
    try:
        numbers = np.asarray(value, dtype=float)
    except (TypeError, ValueError):
        raise user_code_error(
            function, f"must give numbers {shape}, got {value!r}"[:200], owner=_name(gains_filter)
        ) from None
    if numbers.shape != shape:
        raise user_code_error(
            function, f"must give numbers {shape}, got {numbers.shape or 'one number'}", owner=_name(gains_filter)
        )
    return numbers


def design_filter(gains_filter: GivenGains, sigma: np.ndarray, t: np.ndarray) -> LinearFilter:
    """A filter of a package over scans at equal intervals t (K,), each with its plot; sigma (2,) of range, velocity."""
    dt, observes, start = float(t[1]), len(gains_filter.observes), gains_filter.plots_to_start
    weights, covariance = least_squares_start(observes, start, sigma, dt)
    scans = Scans(t, np.broadcast_to(np.arange(2) < observes, (len(t), 2)), sigma, start, covariance)
    gains = check_gains(gains_filter, scans)
    noise = noise_of(gains_filter)
    believed = scans.errors(gains, noise)
    available = np.ones((len(t), 3), dtype=bool)
    available[: start - 1, observes:] = False
    believed[: start - 1, range(observes), range(observes)] = sigma[:observes] ** 2
    return LinearFilter(
        observes, start, weights, gains, believed, available, tuple(map(float, pack(noise(dt)))), has_given_gains=True
    )


def error_recursion(
    filter_: LinearFilter, plots: Plots, truth: np.ndarray, dt: float, random_truth: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """As `error_recursion.error_recursion`, of given gains: lasting errors E (K, 3, C), covariance S (K, 3, 3)."""
    defect, start_index = defects(truth, dt, plots, random_truth), filter_.start - 1
    E, S = np.zeros_like(defect), np.zeros((len(truth), 3, 3))
    E[:start_index, : filter_.observes] = plots.inputs[: filter_.observes]
    S[:start_index, range(filter_.observes), range(filter_.observes)] = plots.sigma[: filter_.observes] ** 2
    start = start_errors(filter_.weights, filter_.believed[start_index], plots, defect, dt)
    E[start_index], S[start_index] = start.E[:, :, 0], unpack(start.S)
    F, R = transition(dt), np.diag(plots.sigma**2)
    for k in range(filter_.start, len(truth)):
        K = filter_.gains[k]
        I_minus_KH = np.eye(3) - K @ OBSERVED
        E[k] = I_minus_KH @ (F @ E[k - 1] + defect[k]) + K @ plots.inputs
        S[k] = I_minus_KH @ F @ S[k - 1] @ F.T @ I_minus_KH.T + K @ R @ K.T
    return E, S


def steady_gain(filter_: LinearFilter) -> np.ndarray:
    """The gain (3, 2) of a filter of a package at its end, not-a-number where it still changes there, or of another."""
    previous_gain, final_gain = filter_.gains[-2:]
    steady = filter_.has_given_gains and np.allclose(previous_gain, final_gain, rtol=STEADY_TOLERANCE, atol=0)
    return np.where(steady, final_gain, np.nan)


def steady_state(gain: np.ndarray, sigma: np.ndarray, dt: float) -> np.ndarray | None:
    """The true covariance (3, 3) that a gain (3, 2) leaves in the long run; None where it leaves none."""
    from scipy.linalg import solve_discrete_lyapunov

    I_minus_KH = np.eye(3) - gain @ OBSERVED
    if np.isnan(gain).any() or np.abs(np.linalg.eigvals(I_minus_KH @ transition(dt))).max() >= 1:
        return None
    return np.asarray(solve_discrete_lyapunov(I_minus_KH @ transition(dt), gain @ np.diag(sigma**2) @ gain.T))


def filter_recorded(
    gains_filter: GivenGains, scans: Scans, x: np.ndarray, z: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Estimates, standard deviations (n, 3), and normalised innovations squared (n, 2) over the rows after the start.

    x (3,) is the state at the start, z (K, 2) are the plots. The velocity's innovation is what the range's leaves of
    it. Last, the variances (n, 2) of the differences between plots and estimates."""
    gains = check_gains(gains_filter, scans)
    noise = noise_of(gains_filter)
    P, R = scans.errors(gains, noise), np.diag(scans.sigma**2)
    rows = range(scans.start, len(z))
    estimate, nis, residual_variance = np.empty((len(rows), 3)), np.empty((len(rows), 2)), np.empty((len(rows), 2))
    for row, k in enumerate(rows):
        dt, present = float(scans.t_s[k] - scans.t_s[k - 1]), scans.there[k]
        F = transition(dt)
        x = F @ x
        S = (F @ P[k - 1] @ F.T + noise(dt))[:2, :2] + R
        e = np.where(present, z[k] - x[:2], 0.0)
        range_share = S[0, 1] / S[0, 0] if present[0] else 0.0
        velocity_nis = (e[1] - range_share * e[0]) ** 2 / (S[1, 1] - range_share * S[0, 1])
        nis[row] = np.where(present, (e[0] ** 2 / S[0, 0], velocity_nis), np.nan)
        remaining = np.eye(2) - gains[k][:2]
        residual_variance[row] = np.diag(remaining @ S @ remaining.T)
        estimate[row] = x = x + gains[k] @ e
    return estimate, np.sqrt(np.diagonal(P[scans.start :], axis1=1, axis2=2)), nis, residual_variance

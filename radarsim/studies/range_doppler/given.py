"""Filters of packages: gains that do not depend on the data, by scan, from which all else follows.

A package derives a class from `GivenGains` and names it by an entry point of the group `radarsim.filters`. The class
holds the keys of its `kind` and makes its gains; the start by least squares, the covariance that the filter believes,
its exact errors, the kernel and recorded plots are as for the study's own filters."""

from abc import abstractmethod
from collections.abc import Callable
from typing import Any, ClassVar, NamedTuple

import numpy as np

from radarsim.failures import call, fault
from radarsim.kernels.algebra import constant_acceleration, pack, unpack
from radarsim.physics import is_covariance, transition
from radarsim.studies.range_doppler.config import FilterKeys
from radarsim.studies.range_doppler.filters import LinearFilter, Plots, defects, least_squares_start, started, updated

STEADY = 1e-9  # relative change of a gain from one scan to the next that counts as none


class Scans(NamedTuple):
    """What gains are made for: K scans, or rows of recorded plots: a start and the rows after it.

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
        F, Q, over = constant_acceleration(0.0), P, 0.0
        for k in range(self.start, len(self.t_s)):
            dt = float(self.t_s[k] - self.t_s[k - 1])
            if dt != over:
                F, Q, over = constant_acceleration(dt), tuple(map(float, pack(noise(dt)))), dt
            P, gains[k, :, 0], gains[k, :, 1] = updated(P, F, Q, R, self.there[k])
        return gains

    def errors(self, gains: np.ndarray, noise: Callable[[float], np.ndarray]) -> np.ndarray:
        """Covariances (K, 3, 3) of the errors that gains (K, 3, 2) leave: of the plots and of noise(dt)."""
        made, R = np.zeros((len(self.t_s), 3, 3)), np.diag(self.sigma**2)
        made[self.start - 1] = self.covariance
        F, Q, over = np.eye(3), np.zeros((3, 3)), 0.0
        for k in range(self.start, len(self.t_s)):
            dt, K = float(self.t_s[k] - self.t_s[k - 1]), gains[k]
            if dt != over:
                F, Q, over = transition(dt), noise(dt), dt
            kept = np.eye(3) - K @ OBSERVED
            made[k] = kept @ (F @ made[k - 1] @ F.T + Q) @ kept.T + K @ R @ K.T
        return made


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


def own_filters() -> type[GivenGains]:
    """What filters of packages are derived from."""
    return GivenGains


def checked(one: GivenGains, scans: Scans) -> np.ndarray:
    """The gains (K, 3, 2) of a filter of a package, zero where they are not read. Raises ConfigError where it fails."""
    made = _numbers(one, one.gains, (len(scans.t_s), 3, 2), scans)
    read = scans.there & (np.arange(1, len(made) + 1) > scans.start)[:, None]
    made = np.where(read[:, None, :], made, 0.0)
    if not np.isfinite(made).all():
        k = int(np.argmax(~np.isfinite(made).all(axis=(1, 2)))) + 1
        raise fault(
            one.gains, f"must make finite gains, those of scan {k} are {made[k - 1].tolist()}", owner=_name(one)
        )
    return made


def noise_of(one: GivenGains) -> Callable[[float], np.ndarray]:
    """`noise` of a filter of a package; raises ConfigError where it gives no covariance (3, 3)."""

    def noise(dt_s: float) -> np.ndarray:
        made = _numbers(one, one.noise, (3, 3), dt_s)
        if not (np.isfinite(made).all() and is_covariance(made)):
            words = f"must give a covariance, finite, symmetric and not negative, got {made.tolist()}"
            raise fault(one.noise, words, owner=_name(one))
        return made

    return noise


def _name(one: GivenGains) -> str:
    return f"filter {one.name}: kind {one.kind}: "


def _numbers(one: GivenGains, function: Callable[..., Any], shape: tuple[int, ...], *arguments: Any) -> np.ndarray:
    """The numbers of this shape that a function of a filter gives. Raises ConfigError where it gives others."""
    given = call(function, *arguments, owner=_name(one))
    try:
        made = np.asarray(given, dtype=float)
    except (TypeError, ValueError):
        raise fault(function, f"must give numbers {shape}, got {given!r}"[:200], owner=_name(one)) from None
    if made.shape != shape:
        raise fault(function, f"must give numbers {shape}, got {made.shape or 'one number'}", owner=_name(one))
    return made


def designed(one: GivenGains, sigma: np.ndarray, t: np.ndarray) -> LinearFilter:
    """A filter of a package over scans at equal intervals t (K,), each with its plot; sigma (2,) of range, velocity."""
    dt, observes, start = float(t[1]), len(one.observes), one.plots_to_start
    weights, covariance = least_squares_start(observes, start, sigma, dt)
    scans = Scans(t, np.broadcast_to(np.arange(2) < observes, (len(t), 2)), sigma, start, covariance)
    made = checked(one, scans)
    noise = noise_of(one)
    believed = scans.errors(made, noise)
    available = np.ones((len(t), 3), dtype=bool)
    available[: start - 1, observes:] = False
    believed[: start - 1, range(observes), range(observes)] = sigma[:observes] ** 2
    return LinearFilter(
        observes, start, weights, made, believed, available, tuple(map(float, pack(noise(dt)))), given=True
    )


def error_recursion(
    one: LinearFilter, plots: Plots, truth: np.ndarray, dt: float, drawn: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """As `filters.error_recursion`, of gains that are given: lasting errors E (K, 3, C), covariance S (K, 3, 3)."""
    defect, begun = defects(truth, dt, plots, drawn), one.start - 1
    E, S = np.zeros_like(defect), np.zeros((len(truth), 3, 3))
    E[:begun, : one.observes] = plots.inputs[: one.observes]
    S[:begun, range(one.observes), range(one.observes)] = plots.sigma[: one.observes] ** 2
    start = started(one.weights, one.believed[begun], plots, defect, dt)
    E[begun], S[begun] = start.E[:, :, 0], unpack(start.S)
    F, R = transition(dt), np.diag(plots.sigma**2)
    for k in range(one.start, len(truth)):
        K = one.gains[k]
        kept = np.eye(3) - K @ OBSERVED
        E[k] = kept @ (F @ E[k - 1] + defect[k]) + K @ plots.inputs
        S[k] = kept @ F @ S[k - 1] @ F.T @ kept.T + K @ R @ K.T
    return E, S


def settled(one: LinearFilter) -> np.ndarray:
    """The gain (3, 2) of a filter of a package at its end, not-a-number where it still changes there, or of another."""
    before, last = one.gains[-2:]
    steady = one.given and np.allclose(before, last, rtol=STEADY, atol=0)
    return np.where(steady, last, np.nan)


def steady_state(gain: np.ndarray, sigma: np.ndarray, dt: float) -> np.ndarray | None:
    """The true covariance (3, 3) that a gain (3, 2) leaves in the long run; None where it leaves none."""
    from scipy.linalg import solve_discrete_lyapunov

    kept = np.eye(3) - gain @ OBSERVED
    if np.isnan(gain).any() or np.abs(np.linalg.eigvals(kept @ transition(dt))).max() >= 1:
        return None
    return np.asarray(solve_discrete_lyapunov(kept @ transition(dt), gain @ np.diag(sigma**2) @ gain.T))


def followed(
    one: GivenGains, scans: Scans, x: np.ndarray, z: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Estimates, standard deviations (n, 3), and normalised innovations squared (n, 2) over the rows after the start.

    x (3,) is the state at the start, z (K, 2) are the plots. The velocity's innovation is what the range's leaves of
    it. Last, the variances (n, 2) of the differences between plots and estimates."""
    made = checked(one, scans)
    noise = noise_of(one)
    P, R = scans.errors(made, noise), np.diag(scans.sigma**2)
    rows = range(scans.start, len(z))
    estimate, nis, left = np.empty((len(rows), 3)), np.empty((len(rows), 2)), np.empty((len(rows), 2))
    for row, k in enumerate(rows):
        dt, there = float(scans.t_s[k] - scans.t_s[k - 1]), scans.there[k]
        F = transition(dt)
        x = F @ x
        S = (F @ P[k - 1] @ F.T + noise(dt))[:2, :2] + R
        e = np.where(there, z[k] - x[:2], 0.0)
        known = S[0, 1] / S[0, 0] if there[0] else 0.0
        of_velocity = (e[1] - known * e[0]) ** 2 / (S[1, 1] - known * S[0, 1])
        nis[row] = np.where(there, (e[0] ** 2 / S[0, 0], of_velocity), np.nan)
        kept = np.eye(2) - made[k][:2]
        left[row] = np.diag(kept @ S @ kept.T)
        estimate[row] = x = x + made[k] @ e
    return estimate, np.sqrt(np.diagonal(P[scans.start :], axis1=1, axis2=2)), nis, left

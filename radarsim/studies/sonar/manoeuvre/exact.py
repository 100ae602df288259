"""Labels and exact laws of the sums of a case about manoeuvres: detectors, responding filters, uses of a track.

The degree of a sliding window switched by the detector (3), exactly: the window that the paper advises, 5–6 plots.

At each scan the straight line and the parabola through the last m plots are at hand, and the acceleration of a parabola
through the last n. All three are linear in the plots, so that they are jointly Gaussian, and the mean square error of
the one that an alarm picks has a closed form. One coordinate, white errors, equal intervals, any course.

Quantities derived from a track, with their first-order σ: course, speed, predicted position, closest approach.

A track gives value and rate of two coordinates, range and bearing or x (north) and y (east): state (…, 2, 2), and for
each coordinate the variance of the value, the covariance, and the variance of the rate: (…, 2, 3). The coordinates are
filtered separately, so their errors are independent. Course and speed are assumed to be constant.

Exact laws of P3's manoeuvre detector: false alarms, detection, and delay where tests are independent.

The statistic is â²/σ_a² (P3 eq. 3, with the estimate that the paper omits), where â is the acceleration of a
parabola through n plots. â is linear in the plots, so it is Gaussian where their errors are. The statistic of one
coordinate is χ² with one degree of freedom, noncentral by (mean of â / σ_a)² in a manoeuvre; the sum over C coordinates
is χ² with C degrees of freedom. This holds for any deterministic course."""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from radarsim.studies.sonar.world import GivenPlotsAxes, Values


# ---- axes ------------------------------------------------------------------------------------------------------------
@dataclass(frozen=True, kw_only=True)
class UsesAxes:
    """True values of the quantities derived from a track, at A times."""

    scans: np.ndarray  #: (A,) scans, counted from 0.
    true: np.ndarray  #: (A, 6) true values of `QUANTITIES`.
    closing_mps: np.ndarray  #: (A,) speed of the target relative to the own ship, m/s.


@dataclass(frozen=True, kw_only=True)
class ManoeuvreAxes(GivenPlotsAxes):
    """Labels and exact laws of D measured detectors, on G groups: each coordinate, then all of them jointly."""

    exact_alarms: np.ndarray  #: (D, G, T, K) probability of an alarm at a test; NaN where no law is known.
    shifts: np.ndarray  #: (D, G, K) mean of the estimated acceleration in units of its σ; NaN likewise.
    thresholds: tuple[np.ndarray, ...]  #: (G, T) thresholds of each detector.
    independent: tuple[bool, ...]  #: whether each detector's tests are independent of one another.
    phase: np.ndarray  #: (K,) 0 before the manoeuvre, 1 during it, 2 after it.
    manoeuvre_s: tuple[float, float] | None  #: start and end of the manoeuvre, s from the first plot; None without one.
    uses: UsesAxes | None  #: the quantities derived from a track; None where the config does not ask for them.


# ---- switched --------------------------------------------------------------------------------------------------------
class SwitchedWindow(NamedTuple):
    """σ (K,) of a straight line, of a parabola, and of the one of both that an alarm selects, through m plots."""

    line: np.ndarray
    parabola: np.ndarray
    switched: np.ndarray


def switched_window(
    course: np.ndarray, sigma: float, dt: float, memory: int, plots: int, threshold_k: float
) -> SwitchedWindow:
    """σ at every scan from the `memory`-th on, for the true values course (K,) and a detector of `plots` plots.

    There is an alarm if the squared acceleration exceeds k times its own variance. An alarm selects the parabola,
    otherwise the straight line is used."""
    line, parabola = (_last_value(memory, degree, dt) for degree in (1, 2))
    acceleration = np.zeros(memory)
    acceleration[memory - plots :] = _acceleration(plots, dt)
    windows = np.lib.stride_tricks.sliding_window_view(course, memory)
    truth = course[memory - 1 :]
    spread = sigma * np.linalg.norm(acceleration)
    limit = np.sqrt(threshold_k) * spread
    mean = windows @ acceleration
    low, high = (-limit - mean) / spread, (limit - mean) / spread
    squares = []
    for weights in (line, parabola):
        bias = windows @ weights - truth
        slope = float(sigma**2 * (weights @ acceleration) / spread)  # of the error on the acceleration, per σ of it
        residual_variance = float(sigma**2 * weights @ weights - slope**2)
        squares.append(
            (bias**2 + slope**2 + residual_variance, _mean_square_in_alarms(bias, slope, residual_variance, low, high))
        )
    (line_square, line_in_alarms), (parabola_square, parabola_in_alarms) = squares
    return SwitchedWindow(
        *(
            np.sqrt(mean_square)
            for mean_square in (line_square, parabola_square, line_square - line_in_alarms + parabola_in_alarms)
        )
    )


def _mean_square_in_alarms(
    bias: np.ndarray, slope: float, residual_variance: float, low: np.ndarray, high: np.ndarray
) -> np.ndarray:
    """E e² over the realisations with an alarm, z < low or z > high; e = bias + slope z + an independent error."""
    from scipy.special import ndtr

    density_low, density_high = (np.exp(-(z**2) / 2) / np.sqrt(2 * np.pi) for z in (low, high))
    share = ndtr(low) + ndtr(-high)
    first = density_high - density_low
    second = share + high * density_high - low * density_low
    return (bias**2 + residual_variance) * share + 2 * bias * slope * first + slope**2 * second


def _last_value(plots: int, degree: int, dt: float) -> np.ndarray:
    """Weights (n,) of the value at the last plot of a polynomial through n plots."""
    powers = (dt * np.arange(1 - plots, 1))[:, None] ** np.arange(degree + 1)
    return np.linalg.pinv(powers)[0]


def _acceleration(plots: int, dt: float) -> np.ndarray:
    """Weights (n,) of the acceleration of a parabola through n plots."""
    powers = (dt * np.arange(1 - plots, 1))[:, None] ** np.arange(3)
    return 2 * np.linalg.pinv(powers)[2]


# ---- uses ------------------------------------------------------------------------------------------------------------
QUANTITIES = (("course", "rad"), ("speed", "m/s"), ("x_ahead", "m"), ("y_ahead", "m"), ("cpa", "m"), ("t_cpa", "s"))


def stack_last(parts: list[np.ndarray]) -> np.ndarray:
    """Stack arrays of one shape (…,) along a last axis.

    Each array stays contiguous in memory, which saves a quarter of the time."""
    return np.moveaxis(np.stack(parts), 0, -1)


def cartesian_track(state: np.ndarray, polar: bool) -> np.ndarray:
    """x, y and their rates (…, 4) of a state."""
    if not polar:
        return stack_last([state[..., 0, 0], state[..., 1, 0], state[..., 0, 1], state[..., 1, 1]])
    (r, vr), (b, vb) = np.moveaxis(state, (-2, -1), (0, 1))
    c, s = np.cos(b), np.sin(b)
    return stack_last([r * c, r * s, vr * c - r * vb * s, vr * s + r * vb * c])


def uses(track: np.ndarray, ship: np.ndarray, horizon: float) -> np.ndarray:
    """The QUANTITIES (…, 6) of x, y and their rates (…, 4).

    ship (…, 4) are those of the vessel that the closest approach refers to; horizon in s. t_cpa counts from now, and is
    negative where the closest approach has passed."""
    x, y, vx, vy = np.moveaxis(track, -1, 0)
    px, py, wx, wy = np.moveaxis(track - ship, -1, 0)
    square = wx**2 + wy**2
    with np.errstate(divide="ignore", invalid="ignore"):  # a target without relative motion has no closest approach
        cpa, t_cpa = np.abs(px * wy - py * wx) / np.sqrt(square), -(px * wx + py * wy) / square
    position_ahead = x + horizon * vx, y + horizon * vy
    return stack_last([np.arctan2(vy, vx), np.hypot(vx, vy), *position_ahead, cpa, t_cpa])


def gradients(track: np.ndarray, ship: np.ndarray, horizon: float) -> np.ndarray:
    """Derivatives (…, 6, 4) of the QUANTITIES with respect to x, y and their rates.

    Let u be the unit vector from the own ship to the target at the closest approach, which is normal to the relative
    velocity; then d cpa = u · (dp + t_cpa dv). At a distance of zero u is one of the two normals and the first order
    fails, because a distance cannot be negative."""
    vx, vy = track[..., 2], track[..., 3]
    px, py, wx, wy = np.moveaxis(track - ship, -1, 0)
    zeros, ones, horizons = np.zeros_like(vx), np.ones_like(vx), np.full_like(vx, horizon)
    with np.errstate(divide="ignore", invalid="ignore"):
        power, speed, fast = vx**2 + vy**2, np.hypot(vx, vy), wx**2 + wy**2
        t_cpa = -(px * wx + py * wy) / fast
        side = np.where(px * wy - py * wx < 0, -1.0, 1.0) / np.sqrt(fast)
        ux, uy = side * wy, -side * wx
        rows = [
            [zeros, zeros, -vy / power, vx / power],
            [zeros, zeros, vx / speed, vy / speed],
            [ones, zeros, horizons, zeros],
            [zeros, ones, zeros, horizons],
            [ux, uy, ux * t_cpa, uy * t_cpa],
            [-wx / fast, -wy / fast, -(px + 2 * t_cpa * wx) / fast, -(py + 2 * t_cpa * wy) / fast],
        ]
    return np.moveaxis(np.stack([np.stack(row) for row in rows]), (0, 1), (-2, -1))


def variances(state: np.ndarray, P: np.ndarray, polar: bool, ship: np.ndarray, horizon: float) -> np.ndarray:
    """First-order variances (…, 6) of the QUANTITIES from the covariances (…, 2, 3) of the two coordinates."""
    track = cartesian_track(state, polar)
    x, y, vx, vy = (track[..., None, i] for i in range(4))
    g = np.moveaxis(gradients(track, ship, horizon), -1, 0)
    if polar:
        b, vb = state[..., None, 1, 0], state[..., None, 1, 1]
        c, s = np.cos(b), np.sin(b)
        value = g[0] * c + g[1] * s + vb * (g[3] * c - g[2] * s), g[1] * x - g[0] * y + g[3] * vx - g[2] * vy
        rate = g[2] * c + g[3] * s, g[3] * x - g[2] * y
    else:
        value, rate = (g[0], g[1]), (g[2], g[3])
    variance = np.zeros(1)
    for coordinate in range(2):
        a, d = value[coordinate], rate[coordinate]
        xx, xv, vv = (P[..., coordinate, i, None] for i in range(3))
        variance = variance + a * a * xx + 2 * a * d * xv + d * d * vv
    return variance


def errors(estimated: np.ndarray, true: np.ndarray) -> np.ndarray:
    """Errors of estimated QUANTITIES (…, 6), the course within half a turn."""
    error = estimated - true
    error[..., 0] = np.remainder(error[..., 0] + np.pi, 2 * np.pi) - np.pi
    return error


# ---- exact -----------------------------------------------------------------------------------------------------------
def threshold(false_alarm: Values, coordinates: int | np.ndarray = 1) -> Any:
    """Threshold k of a test that gives an alarm with this probability without a manoeuvre; broadcasts."""
    from scipy import stats  # here, because it takes a second to load

    return stats.chi2.isf(false_alarm, coordinates)


def false_alarm(k: Values, coordinates: int | np.ndarray = 1) -> Any:
    """Probability of an alarm in a test without a manoeuvre: 0.317 at the paper's k = 1; broadcasts."""
    from scipy import stats  # here, because it takes a second to load

    return stats.chi2.sf(k, coordinates)


def detection(k: Values, shift: Values, coordinates: int = 1) -> Any:
    """The probability of an alarm in a test where the mean of â is `shift` σ_a from zero; broadcasts.

    For several coordinates the shift is the root of the sum of squares."""
    from scipy import special, stats  # here, because they take a second to load

    if coordinates == 1:
        return special.ndtr(shift - np.sqrt(k)) + special.ndtr(-shift - np.sqrt(k))
    central = np.asarray(shift) == 0
    noncentrality = np.where(central, 1.0, np.square(shift))
    return np.where(central, stats.chi2.sf(k, coordinates), stats.ncx2.sf(k, coordinates, noncentrality))


def shift_for(probability: float, k: float) -> float:
    """The acceleration, in σ_a, that a test of one coordinate at threshold k detects with this probability.

    Zero if false alarms alone reach the probability. At k = 1 and 0.683 it is 1.456."""
    from scipy.optimize import brentq

    if detection(k, 0.0) >= probability:
        return 0.0
    return float(brentq(lambda shift: detection(k, shift) - probability, 0.0, np.sqrt(k) + 10.0, xtol=1e-12))


def acceleration_law(
    weights: np.ndarray, course: np.ndarray, C: np.ndarray, pushes: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Mean and variance (M,) of an acceleration with weights (M, n) of the plots.

    course (n,) holds the true values, C (n, n) is the covariance of the errors, and pushes (n, m) holds what m
    independent unit accelerations add to the values."""
    moved = weights @ pushes
    return weights @ course, np.einsum("mi,ij,mj->m", weights, C, weights) + (moved**2).sum(axis=1)


def probability_by_then(p: np.ndarray) -> np.ndarray:
    """Probability (…, n) that a first event has come by each of n independent tests of probabilities p (…, n).

    Tests of overlapping windows are not independent; their law is multivariate normal and has no closed form. For them
    this is an upper bound if the target does not manoeuvre and errors are white (Šidák 1967), because alarms come in
    runs."""
    return 1 - np.cumprod(1 - p, axis=-1)

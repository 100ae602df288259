"""Sonar plots of one realisation, and filters that are given their plots over recorded ones."""

from collections.abc import Mapping

import numpy as np

from radarsim.config.experiment import Case
from radarsim.engine.results import Track
from radarsim.kernels import random
from radarsim.studies.noise import noise_key
from radarsim.studies.sonar import banks, filters
from radarsim.studies.sonar import study as base
from radarsim.studies.sonar import world as models
from radarsim.studies.sonar.kernels import shared_gains as kernels
from radarsim.studies.sonar.responding import estimate_recorded
from radarsim.studies.sonar.scene import Scene, filter_specs, scene, third_of

MOST_ROWS = 200_000  # that the filters take: their designs stand in memory as a whole
UNITS = {"m": "m", "m/s": "mps", "m/s2": "mps2", "rad": "rad", "rad/s": "radps", "rad/s2": "radps2"}
RANGE, BEARING = "sensor.sigma_range_m", "sensor.sigma_bearing_rad"
OPTIMAL = ("growing_memory", "window", "kalman")  # whose residuals' variance is known, if errors are white
LEAST_FREEDOM = 1e-6  # of a plot's variance; less is a plot that the estimate goes through


def plot_columns(spec) -> tuple[tuple[str, ...], ...]:
    """The columns that `track` reads of a file of recorded plots."""
    third, _ = third_of(spec.sensor)
    more = {"depth": ("depth_m",), "elevation": ("elevation_rad",)}.get(third, ())
    return (("t_s", "range_m", "bearing_rad", *more),)


def sigmas(spec) -> dict[str, tuple[str, ...]]:
    """Which of the sensor's standard deviations stand behind each number that is measured."""
    third, _ = third_of(spec.sensor)
    own = {"range_m": (RANGE,), "bearing_rad": (BEARING,)}
    if spec.frame != "polar":
        own = {"x_m": (RANGE, BEARING), "y_m": (RANGE, BEARING)}
    more = {"depth": ("depth_m", "sensor.sigma_depth_m"), "elevation": ("elevation_rad", "sensor.sigma_elevation_rad")}
    return own | ({more[third][0]: (more[third][1],)} if third else {})


def simulated(case: Case, realisation: int) -> dict[str, np.ndarray]:
    """The plots of one realisation of the study and the truth, columns (K,).

    Not-a-number where a plot is missed, or where a further sonar does not measure that coordinate.
    """
    spec, seen = case.spec, scene(case.spec)
    drawn = _drawn(case, seen, realisation)
    C = seen.truth.shape[1]
    deviation, error = drawn[:, :C, 2:], drawn[:, :C, 1]
    truth = seen.truth.copy()
    truth[..., :2] += deviation
    if spec.frame == "polar":
        values, exact = drawn[:, :C, 0], truth[..., 0]
    else:
        values, exact = seen.polar[..., 0] + error, seen.polar[..., 0]
    there = (_detected(case, seen, realisation) > 0)[:, None] & np.isfinite(seen.sigma)
    t, *names = plot_columns(spec)[0]
    columns = {t: seen.t} | dict(zip(names, np.where(there, values, np.nan).T, strict=True))
    columns |= {f"true_{name}": exact[:, c] for c, name in enumerate(names)}
    flat = truth.reshape(len(seen.t), -1)
    true = {f"true_{name}_{UNITS[unit]}": flat[:, i] for i, (name, unit) in enumerate(base.labels(spec, 3))}
    return columns | true


def _drawn(case: Case, seen: Scene, realisation: int) -> np.ndarray:
    """Plot, error, and deviation of value and rate from the course (K, C, 4) of a realisation."""
    world = base.world(case, seen)
    held = np.zeros((world.truth.shape[1], 4, 1))
    made = np.empty((len(seen.t), *held.shape[:2]))
    for k in range(len(seen.t)):
        kernels.move_and_measure(world, realisation, k, held)
        made[k] = held[:, :, 0]
    return made


def _detected(case: Case, seen: Scene, realisation: int) -> np.ndarray:
    """Whether each scan has a plot (K,), as `kernels.patterns.detect`."""
    key, detected, a, b = noise_key(case, "misses"), seen.certain.copy(), np.empty(1), np.empty(1)
    for k in np.flatnonzero(seen.certain < 0):
        random.fill_uniform_pairs(key, realisation, int(k), a, b)
        detected[k] = int(a[0] < seen.probability)
    return detected


class Tracker:
    """The filters of a case over recorded plots.

    Windows and bulk designs reach back over many rows, so all are taken in one piece: `most_rows` tells the reader to.
    Bearings are made continuous from plot to plot, so an estimate may leave -pi … pi. In the cartesian frames a plot
    needs both range and bearing. Further sonars of the config play no part: all plots are taken as the first one's.
    """

    most_rows = MOST_ROWS
    several = False

    def __init__(self, case: Case):
        self.spec = case.spec

    def specs(self) -> list[banks.FilterSpec]:
        """The filters."""
        return filter_specs(self.spec)

    def derived(
        self, t: np.ndarray, x: np.ndarray, P: np.ndarray, known: np.ndarray
    ) -> tuple[tuple[tuple[str, str], ...], np.ndarray, np.ndarray]:
        """What is made of the tracks beside: names and units of U quantities, values and their σ (F, n, U).

        t (n,) from the first plot; x (F, n, C, 3), P (F, n, C, 3, 3) and known (F, n, C, 3). Here: nothing.
        """
        none = np.zeros((*x.shape[:2], 0))
        return (), none, none

    def feed(self, recorded: Mapping[str, np.ndarray]) -> Track:
        """The estimates over all rows: columns (n,), not-a-number where a value is missing."""
        spec, specs = self.spec, self.specs()
        t = recorded["t_s"] - recorded["t_s"][0]
        z, weight, sigma = measured(spec, list(recorded.values())[1:])
        x, P, known = _estimated(specs, t, spec.sensor.scan_period_s, z, weight, sigma)
        size = max(one.size for one in specs)
        flat = (len(specs), len(t), len(z) * size)
        variance = np.diagonal(P, axis1=3, axis2=4)
        estimate = np.where(known, x, np.nan)[..., :size].reshape(flat)
        spread = np.where(known, np.sqrt(np.maximum(variance, 0.0)), np.nan)[..., :size].reshape(flat)
        names, values, their_spread = self.derived(t, x, P, known)
        residual, nis = self._residuals(z, weight, sigma, estimate[..., ::size], spread[..., ::size])
        measures = tuple(sigmas(spec))
        return Track(
            filters=tuple(f.name for f in spec.filters),
            components=(*base.labels(spec, size), *names),
            t_s=recorded["t_s"],
            estimate=np.concatenate([estimate, values], axis=2),
            sigma=np.concatenate([spread, their_spread], axis=2),
            measured=tuple((name, name.rpartition("_")[2]) for name in measures),
            residual=residual,
            tested=tuple((name, 1) for name in measures),
            nis=nis,
        )

    def _residuals(
        self, z: np.ndarray, weight: np.ndarray, sigma: np.ndarray, value: np.ndarray, spread: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Residuals and their normalised squares (F, n, C) of plots z (C, n); value and its σ `spread` (F, n, C)."""
        residual = np.where(weight > 0, z, np.nan).T[None] - value
        with np.errstate(divide="ignore", invalid="ignore"):
            variance = np.where(weight > 0, sigma[:, None] ** 2 / weight, np.nan).T[None]
            freedom = variance - spread**2
            # For least squares and Kalman filters the residual left after the update has variance R - P, and its square
            # over that is the squared innovation over its own.
            nis = np.where(freedom > LEAST_FREEDOM * variance, residual**2 / freedom, np.nan)
        nis[[f.kind not in OPTIMAL for f in self.spec.filters]] = np.nan
        return residual, nis


def _estimated(
    specs: list[banks.FilterSpec], t: np.ndarray, period: float, z: np.ndarray, weight: np.ndarray, sigma: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Estimates (F, n, C, 3), covariances (F, n, C, 3, 3), which are known (F, n, C, 3), over plots as `measured`."""
    plots = [filters.Plots(t, w[None], period, unit) for w, unit in zip(weight, sigma, strict=True)]
    x, P = np.zeros((len(specs), len(t), len(z), 3)), np.zeros((len(specs), len(t), len(z), 3, 3))
    known = np.zeros(x.shape, dtype=bool)
    responding = [f for f, one in enumerate(specs) if one.response]
    if responding:
        x[responding], P[responding] = estimate_recorded([specs[f] for f in responding], t, period, sigma, z, weight)
    for f, one in enumerate(specs):
        for c in range(len(z)):
            if not one.response:
                x[f, :, c], P[f, :, c] = banks.apply_filter(one, c, plots[c], z[c])
            known[f, :, c] = np.arange(3) < np.minimum(plots[c].moments()[0], one.size)[:, None]
    return x, P, known


def measured(spec, columns: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Plots (C, n), their weights (C, n), zero where missing, and nominal σ (C,), in the frame that the filters work
    in.
    """
    sensor = spec.sensor
    third, other = third_of(sensor)
    sigma = np.array([sensor.sigma_range_m, sensor.sigma_bearing_rad, *([other] if third else [])])
    z = np.stack(columns)
    z[1] = continuous(z[1])
    weight = np.isfinite(z).astype(float)
    if spec.frame != "polar":
        detected = np.flatnonzero(weight[:2].all(axis=0))
        plain = spec.frame == "cartesian" or not len(detected)
        place = z[:2, detected] if plain else models.places(*z[:2, detected])
        convert = models.converted if spec.frame == "cartesian" else models.converted_unbiased
        x, y, _ = convert(*z[:2, detected], *sigma[:2])
        xx, _, yy = convert(*place, *sigma[:2])[2]
        weight[:2], z[:2] = 0.0, 0.0
        sigma[:2] = np.sqrt([xx[0], yy[0]]) if len(detected) else 1.0
        z[0, detected], z[1, detected] = x, y
        weight[0, detected], weight[1, detected] = sigma[0] ** 2 / xx, sigma[1] ** 2 / yy
    return np.where(weight > 0, z, 0.0), weight, sigma


def continuous(bearing: np.ndarray) -> np.ndarray:
    """Bearings (n,) without jumps of a full turn between neighbouring plots; gaps stay."""
    seen = np.isfinite(bearing)
    out = bearing.copy()
    out[seen] = np.unwrap(bearing[seen])
    return out

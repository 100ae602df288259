"""Plots of the sonar study: those of one realisation, and the study's filters over recorded ones."""

import numpy as np

from radarsim.config.experiment import Case
from radarsim.engine.results import Track
from radarsim.kernels import random
from radarsim.studies.interface import RecordedPlots
from radarsim.studies.noise import noise_key
from radarsim.studies.sonar import study as sonar
from radarsim.studies.sonar.clutter import track as clutter
from radarsim.studies.sonar.kernels import shared_gains as kernels
from radarsim.studies.sonar.scene import Scene, scene, third_of
from radarsim.studies.sonar.study import labels, plot_columns

MOST_ROWS = 200_000  # that the filters take: their designs stand in memory as a whole
UNITS = {"m": "m", "m/s": "mps", "m/s2": "mps2", "rad": "rad", "rad/s": "radps", "rad/s2": "radps2"}
RANGE, BEARING = "sensor.sigma_range_m", "sensor.sigma_bearing_rad"
OPTIMAL = ("growing_memory", "window", "kalman")  # whose residuals' variance is known, if errors are white
LEAST_FREEDOM = 1e-6  # of a plot's variance; less is a plot that the estimate goes through


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

    Not-a-number where a plot is missed, or where a further sonar does not measure that coordinate. Among false plots
    the rows of a scan are all that it gave.
    """
    spec, seen = case.spec, scene(case.spec)
    if spec.tracking:
        return clutter.simulated(case, seen, sonar.world(case, seen), realisation)
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
    told = {f"true_{name}_{UNITS[unit]}": flat[:, i] for i, (name, unit) in enumerate(labels(spec, 3))}
    return columns | told


def _drawn(case: Case, seen: Scene, realisation: int) -> np.ndarray:
    """Plot, error, and deviation of value and rate from the course (K, C, 4) of a realisation."""
    world = sonar.world(case, seen)
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
    several: there may be plots of the same time, which trackers among false plots choose from.
    """

    most_rows = MOST_ROWS

    def __init__(self, case: Case):
        self.case, self.several = case, case.spec.tracking

    def feed(self, recorded: dict[str, np.ndarray]) -> Track:
        """The estimates over all rows: columns (n,), not-a-number where a value is missing."""
        spec = self.case.spec
        if spec.tracking:
            return clutter.track(self.case, recorded)
        made = sonar.track(self.case, recorded)
        z, weight, sigma = sonar.measured(spec, list(recorded.values())[1:])
        at = [made.components.index(coordinate) for coordinate in sonar.coordinates(spec)]
        residual = np.where(weight > 0, z, np.nan).T[None] - made.estimate[..., at]
        with np.errstate(divide="ignore", invalid="ignore"):
            variance = np.where(weight > 0, sigma[:, None] ** 2 / weight, np.nan).T[None]
            freedom = variance - made.sigma[..., at] ** 2
            # For least squares and Kalman filters the residual left after the update has variance R - P, and its square
            # over that is the squared innovation over its own.
            nis = np.where(freedom > LEAST_FREEDOM * variance, residual**2 / freedom, np.nan)
        nis[[f.kind not in OPTIMAL for f in spec.filters]] = np.nan
        names = tuple(sigmas(spec))
        units = tuple((name, name.rpartition("_")[2]) for name in names)
        tested = tuple((name, 1) for name in names)
        return Track(
            *(made.filters, made.components, made.t_s, made.estimate, made.sigma, made.probability),
            *(units, residual, tested, nis),
        )


class Recorded(RecordedPlots):
    """The study's part in `radarsim track` and `radarsim simulate`."""

    def columns(self, spec):
        return plot_columns(spec)

    def sigmas(self, spec):
        return sigmas(spec)

    def scan_period_s(self, spec):
        return spec.sensor.scan_period_s

    def simulated(self, case, realisation):
        return simulated(case, realisation)

    def tracker(self, case):
        return Tracker(case)

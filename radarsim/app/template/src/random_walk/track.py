"""The study's filters over recorded plots: `radarsim simulate` and `radarsim track`.

Yours: the columns of your sensor. A study without recorded plots needs neither this file nor the offer `recorded`.
"""

import numpy as np
from radarsim.config.experiment import Case
from radarsim.engine.results import Track
from radarsim.studies.interface import RecordedPlots

from random_walk import kernels
from random_walk.study import COMPONENTS, prepare


class Tracker:
    """The filters of a case over recorded plots, chunk by chunk; an empty cell is a missing plot."""

    most_rows = None
    several = False

    def __init__(self, case: Case):
        spec = case.spec
        self.names = tuple(one.name for one in spec.filters)
        self.filters = [_One(one, spec) for one in spec.filters]

    def feed(self, columns) -> Track:
        """The estimates over the next rows: columns (n,), NaN where a value is missing."""
        t, z = columns["t_s"], columns["x_m"]
        rows = np.array([[one.step(at, plot) for at, plot in zip(t, z, strict=True)] for one in self.filters])
        estimate, sigma, nis = np.moveaxis(rows[..., None], 2, 0)  # each (F, n, 1)
        measured = (("x_m", "m"),)
        residual = z[None, :, None] - estimate
        return Track(self.names, COMPONENTS, t, estimate, sigma, None, measured, residual, (("x_m", 1),), nis)


class _One:
    """One filter: estimate x, its variance P, the time of the last row."""

    def __init__(self, options, spec):
        self.gain, self.R = options.gain, spec.sensor.sigma_x_m**2
        self.per_second = spec.target.sigma_step_m**2 / spec.sensor.scan_period_s
        self.x = self.P = self.last = np.nan

    def step(self, t: float, z: float) -> tuple[float, float, float]:
        """Estimate, standard deviation and normalised innovation squared after one row."""
        started, nis = not np.isnan(self.x), np.nan
        if started:
            self.P += self.per_second * (t - self.last)
            if not np.isnan(z):
                K = self.gain or self.P / (self.P + self.R)
                nis = (z - self.x) ** 2 / (self.P + self.R)
                self.x, self.P = self.x + K * (z - self.x), (1 - K) ** 2 * self.P + K**2 * self.R
        elif not np.isnan(z):
            self.x, self.P = z, self.R
        self.last = t
        return self.x, np.sqrt(self.P), nis


class Recorded(RecordedPlots):
    """The study's part in `radarsim simulate` and `radarsim track`."""

    def columns(self, spec):
        return (("t_s", "x_m"),)

    def sigmas(self, spec):
        return {"x_m": ("sensor.sigma_x_m",)}

    def scan_period_s(self, spec):
        return spec.sensor.scan_period_s

    def simulated(self, case, realisation):
        plan = prepare(case)
        x, z = np.empty(len(plan.axes.k)), np.empty(len(plan.axes.k))
        kernels.simulate_plots(plan.key, realisation, plan.sigma, plan.step, x, z)
        return {"t_s": plan.axes.t_s, "x_m": z, "true_x_m": x}

    def tracker(self, case):
        return Tracker(case)

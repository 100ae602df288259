"""Plots of the study: those of one realisation, as a run draws them, and its filters over recorded ones."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from radarsim.config.experiment import Case
from radarsim.engine.results import Track
from radarsim.errors import ConfigError
from radarsim.kernels.lanes import WIDTH
from radarsim.studies.ambiguous_doppler import filters
from radarsim.studies.ambiguous_doppler.kernels import records, sums
from radarsim.studies.ambiguous_doppler.study import COMPONENTS, prepare
from radarsim.studies.interface import RecordedPlots, true_column

COLUMNS = ("t_s", "range_m", "velocity_mps")
FARTHEST = 9.0  # standard deviations of the velocity's innovation up to which folds are looked at


def simulated(case: Case, realisation: int) -> dict[str, np.ndarray]:
    """The plots of one realisation, velocity folded, not-a-number where missed; and the truth; columns (K,)."""
    plan = prepare(case)
    first = realisation - realisation % WIDTH
    plots, _ = sums.simulated(plan.world, plan.banks, first)
    own = plots[:, :, realisation - first]
    came = own[:, records.CAME] > 0
    measured = {
        "t_s": plan.axes.t_s,
        "range_m": np.where(came, own[:, records.RANGE], np.nan),
        "velocity_mps": np.where(came, own[:, records.VELOCITY], np.nan),
    }
    truth = own[:, records.TRUTH : records.TRUTH + 3]
    return measured | dict(zip((true_column(*one) for one in COMPONENTS), truth.T, strict=True))


class Tracker:
    """The filters of a case over recorded plots at any times, chunk by chunk in flat memory.

    A recorded velocity counts as folded where a filter says `folded`, and as it stands where it says `unfolded`. With
    several repetition rates the scan that a row is of follows from its time.
    """

    most_rows: int | None = None
    several: bool = False

    def __init__(self, case: Case):
        combined = [i for i, one in enumerate(case.spec.filters) if one.combine]
        if combined:
            fault = "track follows filters of one order"
            raise ConfigError(*(f"{case.name}: filters.{i}.combine: {fault}" for i in combined))
        self.names = tuple(one.name for one in case.spec.filters)
        self.filters = [_One(one, case.spec) for one in case.spec.filters]

    def feed(self, columns: Mapping[str, np.ndarray]) -> Track:
        """The estimates over the next rows: columns (n,), not-a-number where a value is missing."""
        t, z, v = (columns[name] for name in COLUMNS)
        made = [[one.step(*row) for row in zip(t, z, v, strict=True)] for one in self.filters]
        estimate, sigma = np.moveaxis(np.array(made).reshape(len(made), len(t), 2, 3), 2, 0)
        return Track(self.names, COMPONENTS, t, estimate, sigma)


class _One:
    """One filter: states (n, 3) of its hypotheses, logarithms of their weights (n,), the common covariance (3, 3)."""

    def __init__(self, options: Any, spec: Any):
        (self.member,) = filters.members(options)
        self.options, self.radar = options, spec.radar
        self.x, self.w = np.zeros((1, 3)), np.zeros(1)
        self.P = np.diag([0.0, *filters.prior_variances(self.member.order, spec.prior)])
        self.known = np.array(self.member.components)
        self.last = np.nan
        self.began = self.started = False

    def step(self, t: float, z: float, v: float) -> tuple[np.ndarray, np.ndarray]:
        """Estimate (3,) and standard deviations (3,) after one row; not-a-number before the first range."""
        if self.began:
            F, Q = filters.model(self.member.order, self.member.manoeuvre_variance, t - self.last)
            self.x, self.P = self.x @ F.T, F @ self.P @ F.T + Q
        self.began, self.last = True, t
        if not np.isnan(z):
            self._take_range(z)
        if self.started and not np.isnan(v) and self.member.doppler != "none":
            self._take_velocity(t, v)
        if not self.started:
            return np.full(3, np.nan), np.full(3, np.nan)
        p = np.exp(self.w - self.w.max())
        p /= p.sum()
        best = self.x[np.argmax(self.w)]
        mean = best if self.options.estimate == "best" else p @ self.x
        variance = np.diagonal(self.P) + p @ (self.x - mean) ** 2
        return np.where(self.known, mean, np.nan), np.where(self.known, np.sqrt(variance), np.nan)

    def _take_range(self, z: float) -> None:
        variance = self.radar.sigma_range_m**2
        if not self.started:  # before the first range none is known
            self.x[:, 0], self.P[0], self.P[:, 0] = z, 0.0, 0.0
            self.P[0, 0], self.started = variance, True
            return
        S, e = self.P[0, 0] + variance, z - self.x[:, 0]
        gain = self.P[:, 0] / S
        self.w = self.w - e**2 / (2 * S)
        self.x, self.P = self.x + e[:, None] * gain, self.P - np.outer(gain, gain) * S

    def _take_velocity(self, t: float, v: float) -> None:
        S = self.P[1, 1] + self.radar.sigma_velocity_mps**2
        gain = self.P[:, 1] / S
        e = (v - self.x[:, 1])[:, None]
        if self.member.doppler == "folded":
            spans = self.radar.spans_mps
            D = spans[round(t / self.radar.scan_period_s) % len(spans)]
            farthest = 0 if self.options.hypotheses == 1 else int(FARTHEST * np.sqrt(S) / D) + 1
            e = e - D * np.rint(e / D) + D * np.arange(-farthest, farthest + 1)
        w = self.w[:, None] - e**2 / (2 * S)
        x = self.x[:, None, :] + e[..., None] * gain
        self.P = self.P - np.outer(gain, gain) * S
        self.x, self.w = x.reshape(-1, 3), w.ravel() - w.max()
        if self.options.merge == "each_scan":
            p = np.exp(self.w) / np.exp(self.w).sum()
            mean = p @ self.x
            self.P = self.P + np.einsum("n,ni,nj->ij", p, self.x - mean, self.x - mean)
            self.x, self.w = mean[None], np.zeros(1)
        elif self.member.doppler == "folded":
            kept = np.flatnonzero(np.exp(self.w) >= self.options.prune_below)
            kept = kept[np.argsort(-self.w[kept], kind="stable")[: self.options.hypotheses]]
            self.x, self.w = self.x[kept], self.w[kept]


class Recorded(RecordedPlots):
    """The study's part in `radarsim track` and `radarsim simulate`."""

    def columns(self, spec: Any) -> Sequence[Sequence[str]]:
        return (COLUMNS,)

    def sigmas(self, spec: Any) -> Mapping[str, Sequence[str]]:
        return {"range_m": ("radar.sigma_range_m",), "velocity_mps": ("radar.sigma_velocity_mps",)}

    def scan_period_s(self, spec: Any) -> float:
        return spec.radar.scan_period_s

    def simulated(self, case: Case, realisation: int) -> Mapping[str, np.ndarray]:
        return simulated(case, realisation)

    def tracker(self, case: Case) -> Tracker:
        return Tracker(case)

"""Plots of the study: those of one realisation, as a run draws them; its filters over recorded ones, and how likely
these are under a filter."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from radarsim.config.experiment import Case
from radarsim.engine.results import Track
from radarsim.errors import ConfigError
from radarsim.kernels.lanes import WIDTH
from radarsim.studies.ambiguous_doppler import filters
from radarsim.studies.ambiguous_doppler.kernels import records, sums
from radarsim.studies.ambiguous_doppler.study import COMPONENTS, prepare
from radarsim.studies.interface import BIAS, RecordedPlots, true_column

COLUMNS = ("t_s", "range_m", "velocity_mps")
SPAN = "span_mps"  # a further column: what each velocity is ambiguous by, where the file says so
MEASURED = (("range_m", "m"), ("velocity_mps", "m/s"))
CERTAIN = 4.0  # standard deviations of the velocity's innovation that half a span must hold for the fold to be certain
LEAST_SIGMA, LEAST_MANOEUVRE = 1e-4, 1e-6  # of the stated values, which count as zero
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

    A recorded velocity counts as folded where a filter says `folded`, and as it stands where it says `unfolded`. It is
    folded by the span that stands beside it, else by the config's; with several repetition rates the scan that a row is
    of follows from its time. Innovations of the velocity are tested where the fold is certain.
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
        rows = rows_of(columns)
        made = [[one.step(*row) for row in rows] for one in self.filters]
        estimate, sigma, residual, nis = (
            np.array([[getattr(row, name) for row in own] for own in made]) for name in _Step._fields
        )
        tested = tuple((name, 1) for name, _ in MEASURED)
        t = columns["t_s"]
        return Track(self.names, COMPONENTS, t, estimate, sigma, None, MEASURED, residual, tested, nis)


def rows_of(columns: Mapping[str, np.ndarray]) -> list[tuple[float, ...]]:
    """The rows of recorded plots: time, range, velocity and its span, not-a-number where a value is missing."""
    spans = columns.get(SPAN, np.full(len(columns["t_s"]), np.nan))
    return list(zip(*(columns[name].tolist() for name in COLUMNS), spans.tolist(), strict=True))


class _Step(NamedTuple):
    """What one row made of a filter: estimate and σ (3,), residuals of range and velocity after the update (2,), and
    the squares of their innovations over their variances (2,); not-a-number where there is none."""

    estimate: np.ndarray
    sigma: np.ndarray
    residual: np.ndarray
    nis: np.ndarray


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
        self.nis, self.log_density = np.full(2, np.nan), np.zeros(2)  # of the last row, for range and velocity

    def step(self, t: float, z: float, v: float, span: float = np.nan) -> _Step:
        """The estimate after one row; not-a-number before the first range."""
        if self.began:
            F, Q = filters.model(self.member.order, self.member.manoeuvre_variance, t - self.last)
            self.x, self.P = self.x @ F.T, F @ self.P @ F.T + Q
        self.began, self.last = True, t
        self.nis, self.log_density = np.full(2, np.nan), np.zeros(2)
        if np.isnan(span):
            spans = self.radar.spans_mps
            span = spans[round(t / self.radar.scan_period_s) % len(spans)]
        if not np.isnan(z):
            self._take_range(z)
        if self.started and not np.isnan(v) and self.member.doppler != "none":
            self._take_velocity(v, span)
        if not self.started:
            return _Step(*np.full((2, 3), np.nan), *np.full((2, 2), np.nan))
        p = np.exp(self.w - self.w.max())
        p /= p.sum()
        best = self.x[np.argmax(self.w)]
        mean = best if self.options.estimate == "best" else p @ self.x
        variance = np.diagonal(self.P) + p @ (self.x - mean) ** 2
        estimate, sigma = np.where(self.known, mean, np.nan), np.where(self.known, np.sqrt(variance), np.nan)
        residual = np.array([z, v]) - estimate[:2]
        if self.member.doppler == "folded":
            residual[1] -= span * np.rint(residual[1] / span)
        return _Step(estimate, sigma, residual, self.nis)

    def _take_range(self, z: float) -> None:
        variance = self.radar.sigma_range_m**2
        if not self.started:  # before the first range none is known
            self.x[:, 0], self.P[0], self.P[:, 0] = z, 0.0, 0.0
            self.P[0, 0], self.started = variance, True
            return
        S, e = self.P[0, 0] + variance, z - self.x[:, 0]
        gain = self.P[:, 0] / S
        self._judge(0, e[:, None], S)
        self.w = self.w - e**2 / (2 * S)
        self.x, self.P = self.x + e[:, None] * gain, self.P - np.outer(gain, gain) * S

    def _take_velocity(self, v: float, D: float) -> None:
        S = self.P[1, 1] + self.radar.sigma_velocity_mps**2
        gain = self.P[:, 1] / S
        e = (v - self.x[:, 1])[:, None]
        if self.member.doppler == "folded":
            farthest = 0 if self.options.hypotheses == 1 else int(FARTHEST * np.sqrt(S) / D) + 1
            e = e - D * np.rint(e / D) + D * np.arange(-farthest, farthest + 1)
        self._judge(1, e, S)
        if self.member.doppler == "folded" and 2 * CERTAIN * np.sqrt(S) > D:
            self.nis[1] = np.nan
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

    def _judge(self, number: int, e: np.ndarray, S: float) -> None:
        """Note a number's innovations e (n, folds) before they are taken in: the square over the variance S of that of
        the most probable hypothesis, and the logarithm of the density that all of them give the number."""
        self.nis[number] = np.min(e[np.argmax(self.w)] ** 2) / S
        powers = (self.w[:, None] - e**2 / (2 * S)).ravel()
        most, whole = powers.max(), self.w.max()
        given = most + np.log(np.exp(powers - most).sum()) - whole - np.log(np.exp(self.w - whole).sum())
        self.log_density[number] = given - 0.5 * np.log(2 * np.pi * S)


class PlotLikelihood:
    """How likely tracks are under a filter: the density that all its hypotheses give each range and velocity, folded
    as it is. The state before the first plot is as the prior says."""

    explains: tuple[str, ...] = (BIAS,)

    def __init__(self, case: Case, options: Any, tracks: Sequence[Mapping[str, np.ndarray]]):
        self.spec: Any = case.spec
        self.options, self.filter, self.tracks = options, options.name, len(tracks)
        self.rows = sum(len(columns["t_s"]) for columns in tracks)
        radar, number = case.spec.radar, list(case.spec.filters).index(options)
        self.observes = 1 if options.doppler == "none" else 2
        stated = {"radar.sigma_range_m": radar.sigma_range_m, "radar.sigma_velocity_mps": radar.sigma_velocity_mps}
        stated = dict(list(stated.items())[: self.observes])
        stated[f"filters.{number}.manoeuvre_variance"] = options.variances[0]
        self.keys, self.stated = tuple(stated), np.array(list(stated.values()), dtype=float)
        moved = (radar.sigma_velocity_mps / radar.scan_period_s ** options.orders[0]) ** 2  # by a σ in a scan
        self.least = np.array([LEAST_SIGMA] * self.observes + [LEAST_MANOEUVRE]) * np.append(
            self.stated[: self.observes], self.stated[-1] or moved
        )
        self.recorded = [rows_of(columns) for columns in tracks]
        if self.observes == 1:
            self.explains = ()

    def _scores(self, values: np.ndarray, bias: float) -> np.ndarray:
        """Sums (2,) over all tracks for range and velocity."""
        changed = dict(zip(("sigma_range_m", "sigma_velocity_mps"), values[: self.observes].tolist(), strict=False))
        radar = self.spec.radar.model_copy(update=changed)
        spec = self.spec.model_copy(update={"radar": radar})
        options = self.options.model_copy(update={"manoeuvre_variance": float(values[-1])})
        offset, total = bias * radar.sigma_velocity_mps, np.zeros(2)
        for rows in self.recorded:
            one = _One(options, spec)
            for t, z, v, span in rows:
                one.step(t, z, v - offset, span)
                total += one.log_density
        return total

    def __call__(self, values: np.ndarray, outliers: float = 0.0, bias: float = 0.0) -> float:
        """The logarithm of the likelihood; outliers are not allowed for; bias: of the velocity, in its σ."""
        return float(self._scores(values, bias).sum())

    def by_number(self, values: np.ndarray) -> dict[str, float]:
        """The sums of range and velocity."""
        return {
            name: float(part)
            for (name, _), part in zip(MEASURED[: self.observes], self._scores(values, 0.0), strict=False)
        }


class Recorded(RecordedPlots):
    """The study's part in `radarsim track` and `radarsim simulate`."""

    rows_asked = 100

    def columns(self, spec: Any) -> Sequence[Sequence[str]]:
        return ((*COLUMNS, SPAN), COLUMNS)

    def sigmas(self, spec: Any) -> Mapping[str, Sequence[str]]:
        return {"range_m": ("radar.sigma_range_m",), "velocity_mps": ("radar.sigma_velocity_mps",)}

    def scan_period_s(self, spec: Any) -> float:
        return spec.radar.scan_period_s

    def simulated(self, case: Case, realisation: int) -> Mapping[str, np.ndarray]:
        return simulated(case, realisation)

    def tracker(self, case: Case) -> Tracker:
        return Tracker(case)

    def likelihood(
        self, case: Case, filter_name: str | None, tracks: Sequence[Mapping[str, np.ndarray]]
    ) -> PlotLikelihood | None:
        known = [one for one in case.spec.filters if one.combine is None]
        if filter_name is None:  # of what a recording has, velocities that fold, that which keeps most hypotheses
            known = [one for one in known if one.doppler == "folded"] or known
            known.sort(key=lambda one: (one.merge == "never", one.hypotheses or 0, one.estimate == "mean"))
        else:
            known = [one for one in known if one.name == filter_name]
        return PlotLikelihood(case, known[-1], tracks) if known else None

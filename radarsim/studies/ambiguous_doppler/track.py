"""Plots of the study: those of one realisation, as a run draws them; its filters over recorded ones, and how likely
these are under a filter."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from radarsim.config.experiment import Case
from radarsim.engine.results import Track
from radarsim.errors import PlotFault
from radarsim.kernels.lanes import WIDTH
from radarsim.studies.ambiguous_doppler import followers
from radarsim.studies.ambiguous_doppler.kernels import records, sums
from radarsim.studies.ambiguous_doppler.study import COMPONENTS, prepare
from radarsim.studies.interface import BIAS, RecordedPlots, true_column

COLUMNS = ("t_s", "range_m", "velocity_mps")
SPAN = "span_mps"  # a further column: what each velocity is ambiguous by, where the file says so
MEASURED = (("range_m", "m"), ("velocity_mps", "m/s"))
UNFOLDS, UNFOLDS_WAVELENGTH_M = "ambiguous_rls2", 0.15  # a shipped config for folded velocities of any radar
LEAST_SIGMA, LEAST_MANOEUVRE = 1e-4, 1e-6  # of the stated values, which count as zero


def simulated(case: Case, realisation: int) -> dict[str, np.ndarray]:
    """The plots of one realisation, velocity folded, not-a-number where missed; and the truth; columns (K,)."""
    plan = prepare(case)
    first = realisation - realisation % WIDTH
    plots, _ = sums.simulated(plan.world, plan.banks, first)
    own = plots[:, :, realisation - first]
    detected = own[:, records.DETECTED] > 0
    measured = {
        "t_s": plan.axes.t_s,
        "range_m": np.where(detected, own[:, records.RANGE], np.nan),
        "velocity_mps": np.where(detected, own[:, records.VELOCITY], np.nan),
    }
    truth = own[:, records.TRUTH : records.TRUTH + 3]
    return measured | dict(zip((true_column(*one) for one in COMPONENTS), truth.T, strict=True))


class Tracker:
    """The filters of a case over recorded plots at any times, chunk by chunk in flat memory.

    A recorded velocity counts as folded where a filter says `folded` or `remainder`, and as it stands where it says
    `unfolded`. It is folded by the span that stands beside it, else by the config's; with several repetition rates the
    scan that a row is of follows from its time. Innovations of the velocity are tested where the fold is certain.
    """

    most_rows: int | None = None
    several: bool = False

    def __init__(self, case: Case):
        self.names = tuple(one.name for one in case.spec.filters)
        self.filters = [followers.follower(one, case.spec) for one in case.spec.filters]
        self.errors = np.array([case.spec.radar.sigma_range_m, case.spec.radar.sigma_velocity_mps])
        # A number that was taken in has drawn the estimate to itself; of another the errors add.
        self.drawn = np.array([[-1.0, 1.0 if one.doppler == "none" else -1.0] for one in case.spec.filters])

    def feed(self, columns: Mapping[str, np.ndarray]) -> Track:
        """The estimates over the next rows: columns (n,), not-a-number where a value is missing.

        Raises PlotFault for a row that leaves too many folds, or is beyond a filter's digits.
        """
        rows = rows_of(columns)
        made = [stepped(one, rows) for one in self.filters]
        gathered = {
            name: np.array([[getattr(row, name) for row in own] for own in made]) for name in followers.Row._fields
        }
        spread = self.errors**2 + self.drawn[:, None] * gathered["sigma"][..., :2] ** 2
        finite = np.isfinite(gathered["residual"])
        return Track(
            filters=self.names,
            components=COMPONENTS,
            t_s=columns["t_s"],
            measured=MEASURED,
            tested=tuple((name, 1) for name, _ in MEASURED),
            residual_sigma=np.where(finite, np.sqrt(np.maximum(spread, 0.0)), np.nan),
            **gathered,
        )


def stepped(one: Any, rows: Sequence[tuple[float, ...]]) -> list[followers.Row]:
    """What rows made of a filter, one after the other; raises PlotFault with the row."""
    made: list[followers.Row] = []
    try:
        with np.errstate(invalid="ignore"):  # a variance lost in rounding: not-a-number, which whoever follows refuses
            for row in rows:
                made.append(one.step(*row))
    except PlotFault as fault:
        fault.row = len(made)
        raise
    return made


def rows_of(columns: Mapping[str, np.ndarray]) -> list[tuple[float, ...]]:
    """The rows of recorded plots: time, range, velocity and its span, not-a-number where a value is missing."""
    spans = columns.get(SPAN, np.full(len(columns["t_s"]), np.nan))
    return list(zip(*(columns[name].tolist() for name in COLUMNS), spans.tolist(), strict=True))


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
        """Sums (2,) over all tracks for range and velocity; minus infinity where a filter cannot take a row."""
        changed = dict(zip(("sigma_range_m", "sigma_velocity_mps"), values[: self.observes].tolist(), strict=False))
        radar = self.spec.radar.model_copy(update=changed)
        spec = self.spec.model_copy(update={"radar": radar})
        options = self.options.model_copy(update={"manoeuvre_variance": float(values[-1])})
        offset, total = bias * radar.sigma_velocity_mps, np.zeros(2)
        for rows in self.recorded:
            one = followers.single(options, spec)
            for t, z, v, span in rows:
                try:
                    one.step(t, z, v - offset, span)
                except PlotFault:
                    return np.full(2, -np.inf)
                total += one.log_density
        return total

    def __call__(self, values: np.ndarray, outliers: float = 0.0, bias: float = 0.0, correlation: float = 0.0) -> float:
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
    from_any_origin = True
    simulated, tracker = staticmethod(simulated), staticmethod(Tracker)

    def columns(self, spec: Any) -> Sequence[Sequence[str]]:
        return ((*COLUMNS, SPAN), COLUMNS)

    def sigmas(self, spec: Any) -> Mapping[str, Sequence[str]]:
        return {"range_m": ("radar.sigma_range_m",), "velocity_mps": ("radar.sigma_velocity_mps",)}

    def scan_period_s(self, spec: Any) -> float:
        return spec.radar.scan_period_s

    def unfolding(self, span_mps: float) -> tuple[str, str]:
        return UNFOLDS, f"radar.repetition_rate_hz={2 * span_mps / UNFOLDS_WAVELENGTH_M:.6g}"

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

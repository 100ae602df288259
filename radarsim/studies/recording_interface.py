"""What a study offers for simulated and recorded plots: drawing them, its filters over them, their likelihood."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from threading import RLock
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol, TypeVar

from radarsim.errors import ConfigError
from radarsim.studies.error_law import CLEAR_RISE, OUTLIERS, STATED_ERRORS, ErrorLaw
from radarsim.studies.plot_arrays import TRUTH_PREFIX, UNITS_IN_NAMES, DrawPlots, SimulatedPlots

if TYPE_CHECKING:
    import numpy as np

    from radarsim.config.experiment import Case


Item = TypeVar("Item")
BATCH_ROWS = 20_000  # of tracks that a kernel takes together


@dataclass(frozen=True)
class Track:
    """Estimates over recorded plots, F filters at n times: the output of `radarsim track`.

    t_s (n,); estimate and sigma (F, n, C), NaN where a filter has none, in the components' units; probability (F, n, M)
    of a filter's models, NaN beyond its own, or None where the study has no models.

    For checks of the stated accuracies, if the study gives them: residual (F, n, D), plot minus estimate, of the
    measured (name, unit), and residual_sigma (F, n, D), its σ predicted by the filter; nis (F, n, Q), the squared
    innovation over its predicted variance, of the tested (name, degrees of freedom); NaN where there is no plot or no
    freedom.

    Where filters find several tracks, a filter is listed once for each: numbers (F,) identify them, score (F, n) is the
    logarithm of the likelihood ratio that the track is a target's."""

    filters: tuple[str, ...]
    components: tuple[tuple[str, str], ...]
    t_s: "np.ndarray"
    estimate: "np.ndarray"
    sigma: "np.ndarray"
    probability: "np.ndarray | None" = None
    measured: tuple[tuple[str, str], ...] = ()
    residual: "np.ndarray | None" = None
    tested: tuple[tuple[str, int], ...] = ()
    nis: "np.ndarray | None" = None
    numbers: "np.ndarray | None" = None
    score: "np.ndarray | None" = None
    residual_sigma: "np.ndarray | None" = None


def with_rows_before(track: Track, t_s: "np.ndarray") -> Track:
    """A track at times t_s (n,), of which it has the last ones: without estimates at the others."""
    import numpy as np

    count = len(t_s) - len(track.t_s)
    rows: dict[str, Any] = {}
    for name in ("estimate", "sigma", "probability", "residual", "nis", "score", "residual_sigma"):
        values = getattr(track, name)
        if values is not None:
            rows[name] = np.concatenate([np.full((len(values), count, *values.shape[2:]), np.nan), values], axis=1)
    return replace(track, t_s=t_s, **rows)


class Tracker(Protocol):
    """The filters of a case over recorded plots, chunk by chunk.

    most_rows: how many rows it takes, all at once; None: any number, chunk by chunk in constant memory. several:
    whether a row may have the same time as the previous one, as plots of one scan do."""

    @property
    def most_rows(self) -> int | None: ...
    @property
    def several(self) -> bool: ...

    def feed(self, columns: Mapping[str, "np.ndarray"]) -> "Track":
        """The estimates over the next rows: columns (n,), NaN where a value is missing. Raises PlotFault for a row that
        a filter cannot take."""


MAX_PREPARED = 4  # cases that stay prepared: those whose plots were drawn last


ALL_KINDS: tuple[str, ...] = ("",)  # the one law of outliers of all numbers of a plot


class Likelihood(Protocol):
    """The likelihood of recorded plots under a filter, as a function of the config keys that it was designed with.

    filter: its name; tracks and rows: numbers of them; keys: dotted names; stated (n,): their values in the config;
    zero_limits (n,): values of them that count as zero; explains: other explanations of plots that it can include, of
    EXPLANATIONS; usual_s: the usual interval between plots; outlier_kinds: the columns with outlier laws of their own,
    or ALL_KINDS: all have one law; far_kinds: those of which outliers have any size alone; has_offsets: whether near
    outliers are off to either side, else they are spread alone;
    is_smooth: false where it leaps with the keys, as hypotheses are dropped."""

    filter: str
    tracks: int
    rows: int
    keys: tuple[str, ...]
    stated: "np.ndarray"
    zero_limits: "np.ndarray"
    explains: tuple[str, ...]
    usual_s: float
    outlier_kinds: tuple[str, ...]
    far_kinds: tuple[str, ...]
    has_offsets: bool
    is_smooth: bool

    def __call__(self, values: "np.ndarray", law: ErrorLaw = STATED_ERRORS) -> float:
        """The log-likelihood of values (n,) of the keys. law: only with explanations in `explains`."""

    def soundness(self, values: "np.ndarray", law: ErrorLaw) -> "Sequence[Mapping[str, np.ndarray]]":
        """The times t_s of each track, and the probability of each number that it is no outlier, by column; (n,)."""

    def by_number(self, values: "np.ndarray") -> Mapping[str, float]:
        """The same for the keys alone, summed for each number of a plot, by its column; NaN where it is unknown."""


FEW_OUTLIERS = ErrorLaw(outliers=0.01)


def likeliest(likelihoods: "Sequence[Likelihood]") -> Likelihood:
    """The filter that predicts the plots best with its stated keys; where they plainly have outliers, apart from
    these."""
    best = max(likelihoods, key=lambda likelihood: sum(likelihood.by_number(likelihood.stated).values()))
    if not all(OUTLIERS in likelihood.explains for likelihood in likelihoods):
        return best
    if best(best.stated, FEW_OUTLIERS) <= best(best.stated) + CLEAR_RISE:
        return best
    return max(likelihoods, key=lambda likelihood: likelihood(likelihood.stated, FEW_OUTLIERS))


def track_batches(tracks: "Iterable[Item]", row_count: "Callable[[Item], int]") -> "Iterator[list[Item]]":
    """Tracks in batches of about BATCH_ROWS rows: one call of a kernel for each of many short tracks would take most of
    the time, and arrays of all rows too much memory."""
    batch, rows = list["Item"](), 0
    for track in tracks:
        batch.append(track)
        rows += row_count(track)
        if rows >= BATCH_ROWS:
            yield batch
            batch, rows = [], 0
    if batch:
        yield batch


def usual_interval_s(tracks: "Sequence[Mapping[str, np.ndarray]]") -> float:
    """The usual interval between plots of tracks, columns (n,) each: the median of their medians; 1 without any."""
    import numpy as np

    medians = [float(np.median(np.diff(track["t_s"]))) for track in tracks if len(track["t_s"]) > 1]
    return float(np.median(medians)) if medians else 1.0


class TurnError(NamedTuple):
    """The largest standard error of a component in a turn, as a config states it and with other values."""

    component: str
    unit: str
    acceleration_g: float
    stated: float
    changed: float


class RecordingInterface(ABC):
    """How a study simulates plots and takes recorded ones: `radarsim simulate`, `track` and `fit`.

    A study has `drawing`, or the slower `simulated`; the other one follows.

    rows_asked: number of rows that the advice of `radarsim track` uses for its likelihood, so that it takes seconds.
    from_any_origin: whether ranges count from any point, so that they may be negative. of_any_keys: whether it uses
    only methods of the study, so that it cannot ignore keys."""

    rows_asked: int = 3000
    from_any_origin: bool = False
    of_any_keys: bool = False

    @abstractmethod
    def columns(self, spec: Any) -> Sequence[Sequence[str]]:
        """The columns to read, `t_s` first; the first of these choices that a file has is taken."""

    def columns_of(self, spec: Any, filter_keys: Any) -> Sequence[str]:
        """The columns that a filter needs to take a plot. Default: none, it takes what is read."""
        return ()

    @abstractmethod
    def sigmas(self, spec: Any) -> Mapping[str, Sequence[str]]:
        """The keys of the standard deviations of each measured number."""

    @abstractmethod
    def scan_period_s(self, spec: Any) -> float:
        """The config's time between two plots."""

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        for name, counterpart in (("simulated", "drawing"), ("drawing", "simulated")):
            if name in vars(cls) and counterpart not in vars(
                cls
            ):  # what a base class has of the other one is of its plots
                setattr(cls, counterpart, vars(RecordingInterface)[counterpart])
        if cls.drawing is RecordingInterface.drawing and cls.simulated is RecordingInterface.simulated:
            raise TypeError(f"{cls.__name__} must have `drawing` or `simulated`")

    def drawing(self, case: "Case") -> DrawPlots:
        """Prepare a case; the result draws the plots of realisations first … first + count - 1.

        Default: one after the other by `simulated`."""
        return lambda first, count: _one_by_one(self, case, first, count)

    def simulated(self, case: "Case", realisation: int) -> Mapping[str, "np.ndarray"]:
        """The plots of one realisation, as a run draws them, and the truth in columns true_…; columns (n,).

        Default: by `drawing`."""
        return self.draw_plots(case, realisation, 1).rows(0)

    def draw_plots(self, case: "Case", first: int, count: int) -> SimulatedPlots:
        """The plots of realisations first … first + count - 1; the case is prepared only once."""
        with _LOCK:
            draw = next(
                (draw for plots_type, last_case, draw in _LAST if last_case is case and plots_type is type(self)), None
            )
            if draw is None:
                draw = self.drawing(case)
                _LAST[:] = [*_LAST[1 - MAX_PREPARED :], (type(self), case, draw)]
        return draw(first, count)

    @abstractmethod
    def tracker(self, case: "Case") -> Tracker:
        """The filters of a case before their first plot."""

    def likelihood(
        self, case: "Case", filter_name: str | None, tracks: "Sequence[Mapping[str, np.ndarray]]"
    ) -> "Likelihood | None":
        """The likelihood of tracks, columns (n,) each, under a filter, by default one that uses most of a plot.

        Default: not known; `radarsim fit` refuses its configs."""
        return None

    def span_mps(self, spec: Any) -> float | None:
        """The span of unambiguous velocities of a config's radar, m/s; None, the default, if it is not stated."""
        return None

    def unfolding(self, spec: Any, span_mps: float) -> Sequence[str]:
        """The settings `KEY=VALUE` by which a config allows for velocities folded by this span; none by default."""
        return ()

    def unfolds(self, spec: Any, filter_keys: Any = None) -> bool:
        """Whether a filter of a config, by default any, unfolds velocities. Default: no."""
        return False

    def in_a_turn(self, case: "Case", filter_name: str, values: Mapping[str, float]) -> "TurnError | None":
        """The largest error of a filter in a turn, as stated and with other values of its keys. Default: not known."""
        return None


_LOCK, _LAST = RLock(), list[tuple[type[RecordingInterface], "Case", DrawPlots]]()


def _one_by_one(plots: RecordingInterface, case: "Case", first: int, count: int) -> SimulatedPlots:
    """The plots of a study that has only `simulated`."""
    import numpy as np

    simulated = [plots.simulated(case, i) for i in range(first, first + count)]
    t_s = simulated[0]["t_s"]
    if not all(np.array_equal(arrays["t_s"], t_s) for arrays in simulated) or not (np.diff(t_s) > 0).all():
        raise ConfigError(f"study {case.study}: has plots of several realisations only if its `drawing` gives them")
    columns = {name: np.stack([arrays[name] for arrays in simulated]) for name in simulated[0] if name != "t_s"}
    true_columns = {name: column for name, column in columns.items() if name.startswith(TRUTH_PREFIX)}
    units = {short: unit for unit, short in UNITS_IN_NAMES.items()}
    name_parts = [name.removeprefix(TRUTH_PREFIX).rpartition("_") for name in true_columns]
    components = tuple((name, units.get(unit, unit)) for name, _, unit in name_parts)
    measured = {name: column for name, column in columns.items() if name not in true_columns}
    return SimulatedPlots(t_s, measured, components, np.stack([*true_columns.values()], axis=-1), first=first)

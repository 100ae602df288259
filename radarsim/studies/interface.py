"""The interface of a study: one paper's experiment.

A study is an object of a class derived from `Study`. Its abstract methods are required; the others are optional, with
the defaults in their docstrings. Methods import what they need when they are called, so that `radarsim list` loads no
kernels. The shipped studies are examples.

The numbers come from two of them: `prepare` makes a plan of a case, once; `simulate` makes the sums of one block of
realisations. Everything else derives from these sums."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from threading import RLock
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

from radarsim.errors import ConfigError

if TYPE_CHECKING:
    import numpy as np
    import pandas as pd
    import xarray

    from radarsim.config.experiment import Case, Experiment
    from radarsim.config.fields import Model
    from radarsim.config.fields import Study as Keys
    from radarsim.engine.results import Axes, CaseResult, Layout, Track
    from radarsim.report.drawing import Chart, Figure
    from radarsim.report.quantities import Component, Quantity
    from radarsim.report.sentences import Sentence
    from radarsim.studies.floor import Floor


class Plan(Protocol):
    """The result of `prepare`; a study's own plan adds the arrays that its kernels take.

    block: realisations in a block, from the study alone, never from N, threads or the machine. layout: names and shapes
    of the arrays of sums. axes: the quantities that are summed. gaussian: whether all errors are Gaussian, with
    the exact bias and σ of the axes."""

    @property
    def block(self) -> int: ...
    @property
    def layout(self) -> "Layout": ...
    @property
    def axes(self) -> "Axes": ...
    @property
    def gaussian(self) -> bool: ...


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


TRUE = "true_"  # prefix of the names of columns that hold the truth
UNITS_IN_NAMES = {"m/s": "mps", "m/s2": "mps2", "rad/s": "radps", "rad/s2": "radps2"}  # other units stand as they are


def true_column(component: str, unit: str) -> str:
    """The column with the true values of a component of the state: `true_Vr_mps`."""
    plain = unit.translate(str.maketrans("²³⁴⁵", "2345"))
    return f"{TRUE}{component}_{UNITS_IN_NAMES.get(plain, plain.replace('/', 'p'))}"


@dataclass(frozen=True)
class World:
    """What a filter may know beforehand.

    t_s (K,) times of the scans, s; columns: what is measured, units in the names; sigma: its standard deviations, where
    the config states them; components: names and units of the state; keys: the config, as YAML has it;
    case: what the case is called.
    """

    t_s: "np.ndarray"
    columns: tuple[str, ...]
    sigma: Mapping[str, float]
    components: tuple[tuple[str, str], ...]
    keys: Mapping[str, Any]
    case: str = ""


def column(columns: "Mapping[str, np.ndarray]", name: str) -> "np.ndarray":
    """A column of plots by its name; the KeyError names those that are there."""
    if name not in columns:
        raise KeyError(f"{name}: plots have {', '.join(columns)}")
    return columns[name]


@dataclass(frozen=True, eq=False, repr=False)
class Drawn:
    """The plots of n realisations from number `first` on, exactly those of a run, and the truth at times t_s (K,), s.

    columns (n, K)  what is measured, by name and unit, not-a-number where missing; (n, K, M) where a scan may have
                    several plots: these come first, the rest is not-a-number, and M is as large as needed
    truth (n, K, C) the true state, its components by name and unit; beside: further columns, true_…, of either shape

    seed: of the noise; world: what a filter may know beforehand, a `World`. A function for `radarsim.judge` can be
    called with these plots: it reads `plots["range_m"]`, t_s, world. Arrays may be views that cannot be written."""

    t_s: "np.ndarray"
    columns: "Mapping[str, np.ndarray]"
    components: tuple[tuple[str, str], ...]
    truth: "np.ndarray"
    beside: "Mapping[str, np.ndarray]" = field(default_factory=dict)
    first: int = 0
    seed: int = 0
    known: Callable[[], World] | None = None  # the world, made when asked for

    def __getitem__(self, name: str) -> "np.ndarray":
        return column(self.columns, name)

    @property
    def world(self) -> World:
        """See the class."""
        assert self.known is not None  # as in what `radarsim.plots` gives
        return self.known()

    @property
    def n(self) -> int:
        """How many realisations there are."""
        return len(self.truth)

    @property
    def several(self) -> bool:
        """Whether a scan may have several plots."""
        return any(column.ndim == 3 for column in self.columns.values())

    def __repr__(self) -> str:
        names = ", ".join(f"{name} ({unit})" for name, unit in self.components)
        numbers = f"{self.first} … {self.first + self.n - 1}, {len(self.t_s)} scans"
        return f"<plots of realisations {numbers}: {', '.join(self.columns)}; truth {names}>"

    def truth_of(self, components: Sequence[tuple[str, str]]) -> "np.ndarray":
        """The truth (n, K, C) of these components, which may be fewer than all or in another order."""
        names = [true_column(*component) for component in self.components]
        chosen = [names.index(true_column(*component)) for component in components]
        return self.truth if chosen == list(range(len(names))) else self.truth[..., chosen]

    def arrays(self) -> "dict[str, np.ndarray]":
        """All arrays (n, K) or (n, K, M): what is measured, then the truth in columns true_…."""
        names = (true_column(*component) for component in self.components)
        state = {name: self.truth[..., c] for c, name in enumerate(names)}
        return {**self.columns, **self.beside, **state}

    def table(self) -> "dict[str, np.ndarray]":
        """All realisations one after the other as columns (rows,): `realisation`, `t_s`, what is measured, the truth.

        There is one row per scan. Where a scan may have several plots, there is one row per plot, or one without values
        where a scan has none; the truth is then that in `beside`."""
        import numpy as np

        n, K = self.truth.shape[:2]
        columns = {"realisation": np.arange(self.first, self.first + n)[:, None], "t_s": self.t_s[None]}
        if not self.several:
            return {name: np.broadcast_to(v, (n, K)).flatten() for name, v in (columns | self.arrays()).items()}
        columns |= {**self.columns, **self.beside}
        has_row = np.any([np.isfinite(column) for column in self.columns.values()], axis=0)
        has_row[..., 0] = True
        wide = ((name, values if values.ndim == 3 else values[..., None]) for name, values in columns.items())
        return {name: np.broadcast_to(values, has_row.shape)[has_row] for name, values in wide}

    def rows(self, i: int) -> "dict[str, np.ndarray]":
        """One of the realisations, counted from 0, with the columns of `table` except its number."""
        selected = ({name: v[i : i + 1] for name, v in values.items()} for values in (self.columns, self.beside))
        realisation = Drawn(self.t_s, next(selected), self.components, self.truth[i : i + 1], next(selected)).table()
        return {name: column for name, column in realisation.items() if name != "realisation"}

    def to_xarray(self) -> "xarray.Dataset":
        """All arrays as a dataset of xarray, which must be installed; its dimensions are realisation, t_s and plot."""
        import numpy as np

        try:
            import xarray
        except ImportError as error:
            raise ConfigError("to_xarray needs the package xarray: pip install 'radarsim[xarray]'") from error
        axes = ("realisation", "t_s", "plot")
        units = {true_column(name, unit): {"units": unit} for name, unit in self.components}
        data = {name: (axes[: v.ndim], v, units.get(name, {})) for name, v in self.arrays().items()}
        return xarray.Dataset(data, {axes[0]: np.arange(self.first, self.first + self.n), axes[1]: self.t_s})


Draw = Callable[[int, int], Drawn]
MAX_PREPARED = 4  # cases that stay prepared: those whose plots were drawn last

OUTLIERS, BIAS, CORRELATION = EXPLANATIONS = ("outliers", "bias", "correlation")


class Likelihood(Protocol):
    """The likelihood of recorded plots under a filter, as a function of the config keys that it was designed with.

    filter: its name; tracks and rows: numbers of them; keys: dotted names; stated (n,): their values in the config;
    least (n,): values of them that count as zero; explains: other explanations of plots that it can include, of
    EXPLANATIONS; usual_s: the usual interval between plots."""

    filter: str
    tracks: int
    rows: int
    keys: tuple[str, ...]
    stated: "np.ndarray"
    least: "np.ndarray"
    explains: tuple[str, ...]
    usual_s: float

    def __call__(
        self, values: "np.ndarray", outliers: float = 0.0, bias: float = 0.0, correlation: float = 0.0
    ) -> float:
        """The log-likelihood of values (n,) of the keys. Only explanations in `explains` may be given.

        outliers: the share of plots with ten times their σ; bias: a constant error of a number that can show one, in
        its σ; correlation: of the errors of neighbouring plots, at the recording's usual interval."""

    def by_number(self, values: "np.ndarray") -> Mapping[str, float]:
        """The same for the keys alone, summed for each number of a plot, by its column; NaN where it is unknown."""


def usual_interval_s(tracks: "Sequence[Mapping[str, np.ndarray]]") -> float:
    """The usual interval between plots of tracks, columns (n,) each: the median of their medians; 1 without any."""
    import numpy as np

    medians = [float(np.median(np.diff(track["t_s"]))) for track in tracks if len(track["t_s"]) > 1]
    return float(np.median(medians)) if medians else 1.0


class Turning(NamedTuple):
    """The largest standard error of a component in a turn, as a config states it and with other values."""

    component: str
    unit: str
    acceleration_g: float
    stated: float
    changed: float


class RecordedPlots(ABC):
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
                setattr(cls, counterpart, vars(RecordedPlots)[counterpart])
        if cls.drawing is RecordedPlots.drawing and cls.simulated is RecordedPlots.simulated:
            raise TypeError(f"{cls.__name__} must have `drawing` or `simulated`")

    def drawing(self, case: "Case") -> Draw:
        """Prepare a case; the result draws the plots of realisations first … first + count - 1.

        Default: one after the other by `simulated`."""
        return lambda first, count: _one_by_one(self, case, first, count)

    def simulated(self, case: "Case", realisation: int) -> Mapping[str, "np.ndarray"]:
        """The plots of one realisation, as a run draws them, and the truth in columns true_…; columns (n,).

        Default: by `drawing`."""
        return self.drawn(case, realisation, 1).rows(0)

    def drawn(self, case: "Case", first: int, count: int) -> Drawn:
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
        """The likelihood of tracks, columns (n,) each, under a filter, by default that which uses most of a plot.

        Default: not known; `radarsim fit` refuses its configs."""
        return None

    def span_mps(self, spec: Any) -> float | None:
        """The span of unambiguous velocities of a config's radar, m/s; None, the default, if it is not stated."""
        return None

    def unfolding(self, spec: Any, span_mps: float) -> Sequence[str]:
        """The settings `KEY=VALUE` by which a config allows for velocities folded by this span; none by default."""
        return ()

    def unfolds(self, filter_keys: Any = None) -> bool:
        """Whether a filter, by default any filter of the study, unfolds velocities. Default: no."""
        return False

    def in_a_turn(self, case: "Case", filter_name: str, values: Mapping[str, float]) -> "Turning | None":
        """The largest error of a filter in a turn, as stated and with other values of its keys. Default: not known."""
        return None


_LOCK, _LAST = RLock(), list[tuple[type[RecordedPlots], "Case", Draw]]()


def _one_by_one(plots: RecordedPlots, case: "Case", first: int, count: int) -> Drawn:
    """The plots of a study that has only `simulated`."""
    import numpy as np

    simulated = [plots.simulated(case, i) for i in range(first, first + count)]
    t_s = simulated[0]["t_s"]
    if not all(np.array_equal(arrays["t_s"], t_s) for arrays in simulated) or not (np.diff(t_s) > 0).all():
        raise ConfigError(f"study {case.study}: has plots of several realisations only if its `drawing` gives them")
    columns = {name: np.stack([arrays[name] for arrays in simulated]) for name in simulated[0] if name != "t_s"}
    true_columns = {name: column for name, column in columns.items() if name.startswith(TRUE)}
    units = {short: unit for unit, short in UNITS_IN_NAMES.items()}
    name_parts = [name.removeprefix(TRUE).rpartition("_") for name in true_columns]
    components = tuple((name, units.get(unit, unit)) for name, _, unit in name_parts)
    measured = {name: column for name, column in columns.items() if name not in true_columns}
    return Drawn(t_s, measured, components, np.stack([*true_columns.values()], axis=-1), first=first)


class Paper(NamedTuple):
    """The paper whose claims a study judges: how tables cite it, its page in docs/, lists of a config to which members
    may be added, keys that only shorten a run, and by the stem of a config claims of other configs that it holds."""

    paper: str
    page: str = ""
    may_grow: tuple[str, ...] = ()
    may_shorten: tuple[str, ...] = ()
    held_too: Mapping[str, tuple[str, ...]] = MappingProxyType({})


class Study(ABC):
    """A study. `name` is the value of `study:` in YAML, `about` one line for `radarsim list`."""

    name: str
    about: str
    filters: Mapping[str, str]  # for `radarsim list`: keys of filters, and what they choose
    model: int = 1  # raised by an edit that changes numbers, so that no earlier block is used
    exact_errors: bool = True  # False: exact_sigma is a bound, which a filter need not reach
    draws_sweeps: bool = False  # True: `figures` draws sweeps as well, in place of the common figures

    # ---- what is asked -------------------------------------------------------------------------------------------
    @abstractmethod
    def keys(self) -> "type[Keys]":
        """The YAML keys: a subclass of `radarsim.config.fields.Study`."""

    def own_filters(self) -> "type[Model] | None":
        """The base class for keys of filters from other packages, see `radarsim.studies.registry.filters`.

        Default: none, the study takes no such filters."""
        return None

    # ---- numbers -------------------------------------------------------------------------------------------------
    @abstractmethod
    def prepare(self, case: "Case") -> Plan:
        """The plan of a case: truth, matrices, gains, exact values. Raises ConfigError for an impossible case."""

    def computing_modules(self, spec: Any, plots: bool) -> Sequence[str]:
        """The modules that prepare and simulate the cases with these keys, read the keys, and, with plots, draw plots.

        Stored blocks belong to the sources of these modules and of all that they import, directly or not: see
        `radarsim.studies.sources`. Default: the module of the class, with what its methods import."""
        return (type(self).__module__,)

    @abstractmethod
    def simulate(self, plan: Any, first: int, count: int) -> "np.ndarray":
        """The sums of realisations first … first + count − 1, in the order of the plan's layout.

        Realisation i has the same noise in any block, whatever N, threads or machine.
        """

    def errors(self, plan: Any, first: int, count: int) -> "np.ndarray":
        """The errors (F, count, K, C) of the same realisations' estimates, not-a-number where a filter has none.

        Elements that are not available by the axes may hold anything. Default: from the sums of each realisation."""
        import numpy as np

        errors = np.empty((count, *np.shape(plan.axes.available)))
        for i in range(count):
            sums = plan.layout.unpack(self.simulate(plan, first + i, 1))
            errors[i] = sums["error"][..., 0]
            if "estimates" in sums:
                errors[i][sums["estimates"] == 0] = np.nan
        return np.moveaxis(errors, 0, 1)

    def shortened(self, case: "Case", at_s: float | None, at_k: int | None) -> "Case":
        """A case with the same exact errors at a time (s) or scan that is cheaper to prepare. Default: the case itself.
        Raises ConfigError where the whole case is impossible."""
        return case

    def exact_but_for(self, case: "Case") -> str:
        """A qualification of a case's exact values, as text, where they are approximate in the digits printed.

        Default: an empty string, they are exact."""
        return ""

    def floor(self, spec: Any, axes: "Axes") -> "Floor | None":
        """The lower bound on σ of any estimator of a case, by its keys and the axes of its plan; see `studies.floor`.

        Default: none is known."""
        return None

    def costly(self, case: "Case") -> bool:
        """Whether a case's exact errors are slow to compute, and much faster with `Case.roughly`. Default: no."""
        return False

    def quantities(self, spec: Any = None) -> "tuple[Quantity, ...]":
        """The quantities that a case measures; without spec, any case. Default: σ and gain, of the common tables."""
        from radarsim.report.quantities import COMMON

        return COMMON

    def relabelled(self, axes: "Axes", case: "Case") -> "Axes":
        """The axes of a plan with the display names of a case of the same identity. Default: names of filters."""
        return replace(axes, filters=tuple(member.name for member in case.spec.members))

    def seconds_per_update(self, plan: Any) -> Mapping[str, float]:
        """CPU seconds of one update of one realisation, by filter. Default: not measured."""
        return {}

    def seconds_at_most(self, plan: Any) -> float | None:
        """An upper bound on CPU seconds for one realisation on any processor, from operation counts, not simulation.

        `radarsim check` times a few realisations, unless this bound shows that all are short. Default: not known."""
        return None

    # ---- what is shown -------------------------------------------------------------------------------------------
    @abstractmethod
    def tables(self, results: "Sequence[CaseResult]") -> "dict[str, pd.DataFrame]":
        """The study's own tables by the stem of their file; a table `curves` or `gains` replaces the common one."""

    def curves(self, results: "Sequence[CaseResult]") -> "pd.DataFrame":
        """The table `curves` alone. Default: the common one."""
        from radarsim.report import tables

        return tables.curves(results)

    def gains(self, results: "Sequence[CaseResult]") -> "pd.DataFrame":
        """The table `gains` alone. Default: the common one."""
        from radarsim.report import tables

        return tables.gains(results)

    def floors(self, results: "Sequence[CaseResult]") -> "pd.DataFrame":
        """The floors of these results and the bounds of smoothing, row by row as in `curves`."""
        from radarsim.studies import floor

        return floor.floors(self, results)

    def table(self, name: str, results: "Sequence[CaseResult]", column: str = "") -> "pd.DataFrame | None":
        """The table of a name that has this column; None if there is none. A common one is made without the others."""
        common_tables = {"curves": self.curves, "gains": self.gains, "floor": self.floors}.get(name)
        table = None if common_tables is None else common_tables(results)
        return self.tables(results).get(name) if table is None or (column and column not in table) else table

    @abstractmethod
    def figures(
        self, results: "Sequence[CaseResult]", tables: "Mapping[str, pd.DataFrame]", experiment: "Experiment"
    ) -> "dict[str, Figure]":
        """Descriptions of the figures by the stem of their file, from results and all their tables."""

    def shown(self) -> "Sequence[Component]":
        """The components with letters and words, for figures of user filters. Default: range and its rates."""
        return ()

    def drawn_from(self) -> Mapping[str, Sequence[str]]:
        """The tables behind figures, by the prefix of the figure's name. Default: none.

        Not needed for a figure with the name of its table, nor for names that begin with sigma, gain or sweep."""
        return {}

    @abstractmethod
    def question(self, experiment: "Experiment") -> str:
        """The question of an experiment, in one sentence."""

    @abstractmethod
    def answer(
        self, results: "Sequence[CaseResult]", tables: "Mapping[str, pd.DataFrame]"
    ) -> "Sequence[str | Sentence]":
        """The answer: sentences with numbers and 95 % intervals. A `Sentence` names the intervals that it rests on,
        for warnings; a plain text is taken to rest on σ and gain of every filter at the last scan."""

    def warnings(self, experiment: "Experiment") -> Sequence[str]:
        """Settings that are allowed but hardly intended, a line each; the run continues. Default: none."""
        return ()

    def inputs(self, results: "Sequence[CaseResult]") -> "pd.DataFrame | None":
        """A table of the inputs, for the report. Default: none."""
        return None

    def cost(self, tables: "Mapping[str, pd.DataFrame]", run: Mapping[str, Any]) -> "pd.DataFrame | None":
        """A table of the filters' cost, for the report; run is as in run.json. Default: none."""
        return None

    # ---- beside --------------------------------------------------------------------------------------------------
    def recording_interface(self) -> RecordedPlots | None:
        """Its simulated and recorded plots. Default: none; `track` and `simulate` refuse its configs."""
        return None

    def chart(self, cases: "Sequence[Case]", references: "Sequence[Case]") -> "Chart | None":
        """A chart for all radars, with these cases on it and others for comparison. Default: none."""
        return None

    def shipped(self) -> Path | None:
        """The folder with the study's own `configs/` and `scenarios/`. Default: none."""
        return None

"""What a study is: one paper's question, as the rest of radarsim sees it.

A study is an object of a class derived from `Study`. Its abstract methods are required; the others are optional and do
what their docstrings say where a study does not define them. Methods import what they need when they are called, so
that `radarsim list` loads no kernels.

The numbers come from two of them: `prepare` makes a plan of a case, once; `simulate` makes the sums of one block of
realisations. Everything else is made of these sums.

A study whose files have the usual names need not write the class: see `radarsim.studies.folder`.
"""

import re
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from threading import RLock
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, Protocol

from radarsim.errors import ConfigError

if TYPE_CHECKING:
    import numpy as np
    import pandas as pd

    from radarsim.config.experiment import Case, Experiment
    from radarsim.config.fields import Model
    from radarsim.config.fields import Study as Keys
    from radarsim.engine.results import Axes, CaseResult, Layout, Track
    from radarsim.report.claims import PaperClaims
    from radarsim.report.claims.declared import Shipped
    from radarsim.report.claims.over import PaperReadings
    from radarsim.report.drawing import Chart, Figure
    from radarsim.report.quantities import Quantity


class Plan(Protocol):
    """What `prepare` makes of a case; beside this it holds the arrays that the study's kernels take.

    block is how many realisations a block holds: from the study alone, never from N, threads or the machine. layout
    names the arrays of the sums and their shapes. axes say what the sums are of. gaussian: whether all errors are
    Gaussian, with the exact bias and σ of the axes.
    """

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

    most_rows is how many rows it takes, all at once; None: any number, chunk by chunk in flat memory. several: whether
    rows may have the time of the row before, as plots of one scan do.
    """

    most_rows: int | None
    several: bool

    def feed(self, columns: Mapping[str, "np.ndarray"]) -> "Track":
        """The estimates over the next rows: columns (n,), not-a-number where a value is missing.

        Raises PlotFault for a row that a filter cannot take.
        """


TRUE = "true_"  # what the names of columns that hold the truth begin with
IN_NAMES = {"m/s": "mps", "m/s2": "mps2", "rad/s": "radps", "rad/s2": "radps2"}  # units; others stand as they are


def true_column(component: str, unit: str) -> str:
    """The column of plots that holds the truth of a component of the state: `true_Vr_mps`."""
    plain = unit.translate(str.maketrans("²³⁴⁵", "2345"))
    return f"{TRUE}{component}_{IN_NAMES.get(plain, plain.replace('/', 'p'))}"


@dataclass(frozen=True, eq=False, repr=False)
class Drawn:
    """The plots of n realisations from number `first` on, as a run draws them, and the truth at the times t_s (K,), s.

    columns (n, K)  what is measured, by name and unit, not-a-number where missing; (n, K, M) where a scan may have
                    several plots: these come first, the rest is not-a-number, and M is as large as needed
    truth (n, K, C) the true state, its components by name and unit; beside: further columns, true_…, of either shape

    Arrays may be views that cannot be written.
    """

    t_s: "np.ndarray"
    columns: "Mapping[str, np.ndarray]"
    components: tuple[tuple[str, str], ...]
    truth: "np.ndarray"
    beside: "Mapping[str, np.ndarray]" = field(default_factory=dict)
    first: int = 0

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
        """The truth (n, K, C) of these components, as those of axes, which may be fewer or in another order."""
        names = [true_column(*one) for one in self.components]
        chosen = [names.index(true_column(*one)) for one in components]
        return self.truth if chosen == list(range(len(names))) else self.truth[..., chosen]

    def rows(self, i: int) -> "dict[str, np.ndarray]":
        """One of the realisations, counted from 0, as columns (rows,) of a file: `t_s`, what is measured, the truth.

        A row a scan; where a scan may have several plots a row a plot, and one without values where it has none; of the
        truth these have what stands beside it alone.
        """
        import numpy as np

        made = {"t_s": self.t_s} | {name: values[i] for name, values in (*self.columns.items(), *self.beside.items())}
        if not self.several:
            return made | dict(zip((true_column(*one) for one in self.components), self.truth[i].T, strict=True))
        wide = next(values for values in made.values() if values.ndim == 2)
        there = np.any([np.isfinite(made[name]) for name in self.columns], axis=0) | (np.arange(wide.shape[1]) == 0)
        full = (values if values.ndim == 2 else values[:, None] for values in made.values())
        return {name: np.broadcast_to(v, wide.shape)[there] for name, v in zip(made, full, strict=True)}


Draw = Callable[[int, int], Drawn]
KEPT = 4  # cases whose plots were drawn last, which are prepared once

OUTLIERS, BIAS, CORRELATION = EXPLANATIONS = ("outliers", "bias", "correlation")


class Likelihood(Protocol):
    """How likely recorded plots are under a filter, by the keys of the config that it was designed with.

    filter: its name; tracks and rows: how many there are; keys: dotted names; stated (n,): their values in the config;
    least (n,): what counts as zero of them; explains: by what else it can explain plots, of EXPLANATIONS.
    """

    filter: str
    tracks: int
    rows: int
    keys: tuple[str, ...]
    stated: "np.ndarray"
    least: "np.ndarray"
    explains: tuple[str, ...]

    def __call__(
        self, values: "np.ndarray", outliers: float = 0.0, bias: float = 0.0, correlation: float = 0.0
    ) -> float:
        """The logarithm of the likelihood of values (n,) of the keys. It is asked with what it explains plots by alone.

        outliers: the share of plots with ten times their σ; bias: a constant error of what can show one, in its σ;
        correlation: of the errors of neighbouring plots, at the recording's usual interval.
        """

    def by_number(self, values: "np.ndarray") -> Mapping[str, float]:
        """The same with the keys alone, summed for each number that a plot holds, by its column; not-a-number where it
        cannot be told."""


class Turning(NamedTuple):
    """The largest standard error of a component in a turn, as a config states it and with other values."""

    component: str
    unit: str
    acceleration_g: float
    stated: float
    changed: float


class RecordedPlots(ABC):
    """What a study does with recorded plots: `radarsim track` and `radarsim simulate`.

    A study has `drawing`, or the slower `simulated`, of which the other follows.

    rows_asked: of how many rows `radarsim track` asks the likelihood for its advice, so that it takes some seconds.
    from_any_origin: whether ranges count from any point, so that they may be negative. of_any_keys: whether all that it
    does it asks of the study, so that there are no keys that it could pass over.
    """

    rows_asked: int = 3000
    from_any_origin: bool = False
    of_any_keys: bool = False

    @abstractmethod
    def columns(self, spec: Any) -> Sequence[Sequence[str]]:
        """The columns that are read, `t_s` first; the first of these choices that a file has is taken."""

    def columns_of(self, spec: Any, one: Any) -> Sequence[str]:
        """The columns without which a filter takes no plot. Default: none, each takes what is read."""
        return ()

    @abstractmethod
    def sigmas(self, spec: Any) -> Mapping[str, Sequence[str]]:
        """The keys of the standard deviations that stand behind each number that is measured."""

    @abstractmethod
    def scan_period_s(self, spec: Any) -> float:
        """The config's time between two plots."""

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        for own, other in (("simulated", "drawing"), ("drawing", "simulated")):
            if own in vars(cls) and other not in vars(cls):  # what a base class has of the other one is of its plots
                setattr(cls, other, vars(RecordedPlots)[other])
        if cls.drawing is RecordedPlots.drawing and cls.simulated is RecordedPlots.simulated:
            raise TypeError(f"{cls.__name__} must have `drawing` or `simulated`")

    def drawing(self, case: "Case") -> Draw:
        """The case prepared once: plots of realisations first … first + count - 1, by these two numbers.

        Default: one after the other by `simulated`.
        """
        return lambda first, count: _one_by_one(self, case, first, count)

    def simulated(self, case: "Case", realisation: int) -> Mapping[str, "np.ndarray"]:
        """The plots of one realisation, as a run draws them, and the truth in columns true_…; columns (n,).

        Default: by `drawing`.
        """
        return self.drawn(case, realisation, 1).rows(0)

    def drawn(self, case: "Case", first: int, count: int) -> Drawn:
        """The plots of realisations first … first + count - 1 of a case that is prepared once."""
        with _LOCK:
            draw = next((draw for kind, one, draw in _LAST if one is case and kind is type(self)), None)
            if draw is None:
                draw = self.drawing(case)
                _LAST[:] = [*_LAST[1 - KEPT :], (type(self), case, draw)]
        return draw(first, count)

    @abstractmethod
    def tracker(self, case: "Case") -> Tracker:
        """The filters of a case, before their first plot."""

    def likelihood(
        self, case: "Case", filter_name: str | None, tracks: "Sequence[Mapping[str, np.ndarray]]"
    ) -> "Likelihood | None":
        """How likely tracks, columns (n,) each, are under a filter; of the one that takes most of a plot where None.

        Default: not known; `radarsim fit` refuses its configs.
        """
        return None

    def span_mps(self, spec: Any) -> float | None:
        """What velocities of a config's radar are ambiguous by, m/s; None, the default, where it does not say."""
        return None

    def unfolding(self, span_mps: float) -> tuple[str, str] | None:
        """A shipped config whose filters take velocities that are folded by so much (m/s), and the `KEY=VALUE` that
        says so; None, the default, where velocities are taken as they are measured."""
        return None

    def in_a_turn(self, case: "Case", filter_name: str, values: Mapping[str, float]) -> "Turning | None":
        """The largest error of a filter in a turn, as stated and with other values of its keys. Default: not known."""
        return None


_LOCK, _LAST = RLock(), list[tuple[type[RecordedPlots], "Case", Draw]]()


def _one_by_one(plots: RecordedPlots, case: "Case", first: int, count: int) -> Drawn:
    """Of a study that has `simulated` alone."""
    import numpy as np

    every = [plots.simulated(case, i) for i in range(first, first + count)]
    t_s = every[0]["t_s"]
    if not all(np.array_equal(one["t_s"], t_s) for one in every) or not (np.diff(t_s) > 0).all():
        raise ConfigError(f"study {case.study}: has plots of several realisations only if its `drawing` gives them")
    columns = {name: np.stack([one[name] for one in every]) for name in every[0] if name != "t_s"}
    true = {name: column for name, column in columns.items() if name.startswith(TRUE)}
    units = {short: unit for unit, short in IN_NAMES.items()}
    named = [name.removeprefix(TRUE).rpartition("_") for name in true]
    components = tuple((name, units.get(unit, unit)) for name, _, unit in named)
    measured = {name: column for name, column in columns.items() if name not in true}
    return Drawn(t_s, measured, components, np.stack([*true.values()], axis=-1), first=first)


class Paper(NamedTuple):
    """The paper whose claims a study judges; its fields are those of `radarsim.report.claims.PaperClaims`."""

    paper: str
    page: str = ""
    may_grow: tuple[str, ...] = ()
    may_shorten: tuple[str, ...] = ()
    held_too: Mapping[str, tuple[str, ...]] = MappingProxyType({})


def paper_in(claims: str) -> str:
    """The key `paper` of a text as claims.yaml, where it stands on a line of its own; else nothing."""
    found = re.search(r"^paper: *([\w-]+) *$", claims, re.MULTILINE)
    return found[1] if found else ""


Beside = Literal["readings", "recorded", "shipped", "chart", "shortened", "own_filters"]
Costs = Literal["cost", "seconds_per_update", "seconds_at_most"]
OptionalPart = Literal["curves", "gains", "inputs", Costs, "warnings", "exact_but_for", "costly", Beside]


class Study(ABC):
    """A study. `name` is the value of `study:` in YAML, `about` one line for `radarsim list`."""

    name: str
    about: str
    filters: Mapping[str, str]  # what `radarsim list` says of its filters: keys, and what they make
    model: int = 1  # raised by an edit that moves numbers, so that no block from before is used, however rare they are
    exact_errors: bool = True  # False: exact_sigma is a bound, which a filter may reach or not
    draws_sweeps: bool = False  # True: `figures` draws sweeps too, in place of the common figures

    # ---- what is asked -------------------------------------------------------------------------------------------
    @abstractmethod
    def keys(self) -> "type[Keys]":
        """The YAML keys: a subclass of `radarsim.config.fields.Study`."""

    def own_filters(self) -> "type[Model] | None":
        """What keys of filters from other packages are derived from, see `radarsim.studies.registry.filters`.

        Default: nothing, the study takes no such filters.
        """
        return None

    # ---- numbers -------------------------------------------------------------------------------------------------
    @abstractmethod
    def prepare(self, case: "Case") -> Plan:
        """The plan of a case: truth, matrices, gains, exact values. Raises ConfigError where there is none."""

    @abstractmethod
    def simulate(self, plan: Any, first: int, count: int) -> "np.ndarray":
        """The sums of realisations first … first + count − 1, in the order of the plan's layout.

        Realisation i has the same noise in any block, whatever N, threads or machine.
        """

    def shortened(self, case: "Case", at_s: float | None, at_k: int | None) -> "Case":
        """A case with the same exact errors at a time (s) or scan, cheaper to prepare. Default: the case itself.

        Raises ConfigError where the whole case cannot be.
        """
        return case

    def exact_but_for(self, case: "Case") -> str:
        """What the values called exact of a case are, in words, where they are exact but for less than one prints.

        Default: nothing, they are exact.
        """
        return ""

    def costly(self, case: "Case") -> bool:
        """Whether the exact errors of a case take long, and with `Case.roughly` much less. Default: no."""
        return False

    def quantities(self, spec: Any = None) -> "tuple[Quantity, ...]":
        """What a case measures, without spec any case. Default: σ and gain, of the common tables."""
        from radarsim.report.quantities import COMMON

        return COMMON

    def relabelled(self, axes: "Axes", case: "Case") -> "Axes":
        """The axes of a plan with the display names of a case that has the same identity. Default: names of filters."""
        return replace(axes, filters=tuple(member.name for member in case.spec.members))

    def seconds_per_update(self, plan: Any) -> Mapping[str, float]:
        """CPU seconds of one update of one realisation, by filter. Default: not measured."""
        return {}

    def seconds_at_most(self, plan: Any) -> float | None:
        """CPU seconds that no processor exceeds for one realisation, from what is counted: nothing is simulated.

        `radarsim check` times a few realisations, unless all of them are surely short by this. Default: not known.
        """
        return None

    # ---- what is shown -------------------------------------------------------------------------------------------
    @abstractmethod
    def tables(self, results: "Sequence[CaseResult]") -> "dict[str, pd.DataFrame]":
        """The study's own tables by the stem of their file; `curves` or `gains` among them replace the common ones."""

    def curves(self, results: "Sequence[CaseResult]") -> "pd.DataFrame":
        """The table `curves` alone. Default: the common one."""
        from radarsim.report import tables

        return tables.curves(results)

    def gains(self, results: "Sequence[CaseResult]") -> "pd.DataFrame":
        """The table `gains` alone. Default: the common one."""
        from radarsim.report import tables

        return tables.gains(results)

    def table(self, name: str, results: "Sequence[CaseResult]", column: str = "") -> "pd.DataFrame | None":
        """The table of a name, with this column; None where it makes none. `curves` and `gains` alone where they do."""
        common = {"curves": self.curves, "gains": self.gains}.get(name)
        made = None if common is None else common(results)
        return self.tables(results).get(name) if made is None or (column and column not in made) else made

    @abstractmethod
    def figures(
        self, results: "Sequence[CaseResult]", made: "Mapping[str, pd.DataFrame]", experiment: "Experiment"
    ) -> "dict[str, Figure]":
        """The figures, described, by the stem of their file, from results and from all tables made of them."""

    def drawn_from(self) -> Mapping[str, Sequence[str]]:
        """The tables that figures are drawn from, by how the figure's name begins. Default: none named.

        Not needed of a figure with the name of its table, nor where the name begins with sigma, gain or sweep.
        """
        return {}

    @abstractmethod
    def question(self, experiment: "Experiment") -> str:
        """What an experiment asks, in one sentence."""

    @abstractmethod
    def answer(self, results: "Sequence[CaseResult]", made: "Mapping[str, pd.DataFrame]") -> Sequence[str]:
        """The answer: sentences with numbers and 95 % intervals."""

    def warnings(self, experiment: "Experiment") -> Sequence[str]:
        """What a config allows but hardly means, a line each; the run goes on. Default: nothing."""
        return ()

    def inputs(self, results: "Sequence[CaseResult]") -> "pd.DataFrame | None":
        """A table of what was put in, for the report. Default: none."""
        return None

    def cost(self, made: "Mapping[str, pd.DataFrame]", run: Mapping[str, Any]) -> "pd.DataFrame | None":
        """A table of what the filters cost, for the report; run is as in run.json. Default: none."""
        return None

    def claim_faults(self, shipped: "Shipped") -> Sequence[str]:
        """What its claims and readings name and no shipped config has, a line each. `shipped` as of `claims.judged`."""
        return ()

    def paper_key(self) -> str:
        """What the names of its claims begin with (P1), before they are read. Default: not known, so they are read."""
        return ""

    def claims(self) -> "PaperClaims | None":
        """The paper's claims. Default: none."""
        return None

    def readings(self) -> "PaperReadings | None":
        """What the paper leaves open, and its claims under each reading. Default: nothing."""
        return None

    # ---- beside --------------------------------------------------------------------------------------------------
    def recorded(self) -> RecordedPlots | None:
        """What it does with recorded plots. Default: nothing; `track` and `simulate` refuse its configs."""
        return None

    def chart(self, cases: "Sequence[Case]", references: "Sequence[Case]") -> "Chart | None":
        """One chart for every device, with these cases on it, and others to compare with. Default: none."""
        return None

    def shipped(self) -> Path | None:
        """The folder that holds `configs/` and `scenarios/` of its own. Default: none."""
        return None

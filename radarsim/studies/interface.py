"""The interface of a study: one paper's experiment, as a class whose methods import what they need.

A study is an object of a class derived from `Study`. Its abstract methods are required; the others are optional, with
the defaults in their docstrings. Methods import what they need when they are called, so that `radarsim list` loads no
kernels. The shipped studies are examples.

The numbers are computed by two of them: `prepare` makes a plan of a case, once; `simulate` makes the sums of one block
of realisations. Everything else is derived from these sums."""

from abc import ABC, abstractmethod
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

if TYPE_CHECKING:
    import numpy as np
    import pandas as pd

    from radarsim.config.experiment import Case, Experiment
    from radarsim.config.model import Model
    from radarsim.config.study_keys import StudyKeys as Keys
    from radarsim.engine.results import Axes, CaseResult
    from radarsim.engine.sums import Layout
    from radarsim.report.drawing.model import Chart, Figure
    from radarsim.report.quantities import Component, Quantity
    from radarsim.report.sentences import Sentence
    from radarsim.studies.counted_scans import CountedScans
    from radarsim.studies.floors.bound import Floor
    from radarsim.studies.recording_interface import RecordingInterface


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
    exact_errors: bool = True  # False: `Axes.exact_sigma` is a bound, which a filter need not reach
    draws_sweeps: bool = False  # True: `figures` draws sweeps as well, in place of the common figures

    @abstractmethod
    def keys(self) -> "type[Keys]":
        """The YAML keys: a subclass of `radarsim.config.study_keys.StudyKeys`."""

    def own_filters(self) -> "type[Model] | None":
        """The base class for keys of filters from other packages, see `radarsim.studies.registry.package_filters`.

        Default: none, the study takes no such filters."""
        return None

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

    def manoeuvre_start_s(self, spec: Any) -> float | None:
        """The time, s, at which a case's target begins to manoeuvre. Default: the key `start_s` of its target, unless
        its acceleration is zero."""
        from radarsim.studies.counted_scans import target_start_s

        return target_start_s(getattr(spec, "target", None))

    def counted_scans(
        self, case: "Case", component: str | None = None, axes: "Axes | None" = None
    ) -> "CountedScans | None":
        """The scans from which on a worst or a mean error counts: from the manoeuvre on, else once all filters have
        settled. axes: of the case's plan, if known. Default: settled by exact σ, else by that of a few realisations."""
        from radarsim.studies.counted_scans import study_scans

        return study_scans(self, case, component, axes)

    def without_manoeuvre(self, spec: Any) -> Mapping[str, Any]:
        """Changes of a config's keys with which its target does not manoeuvre, however long the run. Default: its key
        `start_s` is postponed."""
        from radarsim.studies.long_run import without_manoeuvre

        return without_manoeuvre(spec)

    def in_the_long_run(self, case: "Case", filter_names: "Collection[str] | None" = None) -> "Case":
        """A case whose last scan is that of the same filters once settled, without a manoeuvre. Raises ConfigError
        where those named, by default all, do not settle. Default: so many scans that σ stays, exact or sampled."""
        from radarsim.studies.long_run import extended_case

        return extended_case(self, case, filter_names)

    def steady_sigma(self, case: "Case") -> "np.ndarray | None":
        """The exact σ (F, C) of a case's filters in the long run, without a manoeuvre. Default: None."""
        return None

    def exact_but_for(self, case: "Case") -> str:
        """A qualification of a case's exact values, as text, where they are approximate in the digits printed.

        Default: an empty string, they are exact."""
        return ""

    def floor(self, spec: Any, axes: "Axes") -> "Floor | None":
        """The lower bound on σ of any estimator of a case, by its keys and the axes of its plan; see `studies.floors`.

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
        from radarsim.studies.floors import floor_columns

        return floor_columns.floors(self, results)

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

    def user_filter_components(self) -> "Sequence[Component]":
        """The components with letters and words, for figures of user filters. Default: range and its rates."""
        return ()

    def drawn_from(self) -> Mapping[str, Sequence[str]]:
        """The tables behind figures, or a column, 'folds.right', by the prefix of the figure's name. Default: none.

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

    def answer_points(self, result: "CaseResult") -> Sequence[tuple[str, float]]:
        """The components, and times in s, by which a user filter is judged: those that the answer is about. Default:
        the first component at the last scan."""
        return [(result.axes.components[0][0], float(result.axes.t_s[-1]))]

    def warnings(self, experiment: "Experiment") -> Sequence[str]:
        """Settings that are allowed but hardly intended, a line each; the run continues. Default: none."""
        return ()

    def inputs(self, results: "Sequence[CaseResult]") -> "pd.DataFrame | None":
        """A table of the inputs, for the report. Default: none."""
        return None

    def cost(self, tables: "Mapping[str, pd.DataFrame]", run: Mapping[str, Any]) -> "pd.DataFrame | None":
        """A table of the filters' cost, for the report; run is as in run.json. Default: none."""
        return None

    def recording_interface(self) -> "RecordingInterface | None":
        """Its simulated and recorded plots. Default: none; `track` and `simulate` refuse its configs."""
        return None

    def chart(self, cases: "Sequence[Case]", references: "Sequence[Case]") -> "Chart | None":
        """A chart for all radars, with these cases on it and others for comparison. Default: none."""
        return None

    def shipped(self) -> Path | None:
        """The folder with the study's own `configs/` and `scenarios/`. Default: none."""
        return None

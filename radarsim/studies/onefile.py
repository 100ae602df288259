"""A study in one file: a class declares keys, filters and claims; the rest of a study follows from it.

    class Walk(LinearStudy):  # or another base that computes
        name, about = "walk", "Random walk (textbook)."  # as of every study
        filters = {"gain": "a fixed gain; without it a Kalman filter"}
        asks = "How well is a random walk followed?"
        components = (Component("x", "m", "$x$", "position"),)
        parts = {"sensor": Sensor, "target": Target}
        Filter = Filter
        scan_period = "sensor.scan_period_s"
        measured = (Measured("x_m", "m", ("sensor.sigma_x_m",)),)
        paper = Paper("Kalman 1960", may_grow=("filters",))
        claims_yaml = "…"

    STUDY = Walk()

| given | is |
|---|---|
| `asks` | the question, one sentence |
| `components` | the errors that are shown, the leading one first |
| `parts`, `Filter` | the keys: by name the model of each part, and of a filter, a subclass of `Member` |
| `scan_period` | the key of the time between two plots |
| `measured` | the numbers of a recorded plot, where there is such |
| `paper`, `claims_yaml` | whose claims are judged: a text as claims.yaml, and under `choices` as readings.yaml |

`filters`, `baseline` and `scans` are added to the keys, with their marks. Made are the tables curves, gains and `last`,
the figures, the question and the answer, claims and readings, and what is done with recorded plots; `shipped/` beside
the file holds configs. Claims find a case by its keys, `of: [{radar.scan_period_s: 2}]`, and are measured by functions
of the file whose first argument is `seen`, or by those of `radarsim.studies.judged`. The alternatives of a choice set
keys, `sets: {radar.scan_period_s: 2}`.

A base for a kind of model derives from `OneFile` and gives `prepare`, with `axes` and `sums` from here, `simulate`, and
if it can `limits`, `drawing`, `tracker` and `likelihood`. `radarsim.studies.linear` is one.

Whatever a class lacks, or has of the wrong kind, is one line of a ConfigError when its keys are first asked for."""

import inspect
import math
import re
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cached_property
from itertools import chain, combinations
from operator import attrgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from radarsim.config.fields import Member, Model, keys_of
from radarsim.config.fields import Study as Keys
from radarsim.errors import ConfigError
from radarsim.failures import call
from radarsim.language import Term, few, listed, term, tr
from radarsim.report.quantities import COMMON, Component, Quantity
from radarsim.studies.interface import Draw, Likelihood, Paper, RecordedPlots, Study, Tracker, paper_in

if TYPE_CHECKING:
    import numpy as np
    import pandas as pd

    from radarsim.config.experiment import Case, Experiment
    from radarsim.engine.results import Axes, CaseResult, Layout
    from radarsim.report.claims import PaperClaims
    from radarsim.report.claims.declared import Claim, Shipped
    from radarsim.report.claims.over import Choice, PaperReadings
    from radarsim.report.drawing import Figure


class Measured(NamedTuple):
    """A number of a plot: its column, its unit, and the keys of its standard deviation."""

    column: str
    unit: str
    sigma_keys: tuple[str, ...] = ()


RESERVED = "filters", "baseline", "scans"
MOST_SETS = 6  # sets of columns of which a file may have any; if more, all or one
NEEDED: Mapping[str, tuple[type, str]] = {
    "name": (str, "the value of `study:` in YAML"),
    "about": (str, "one line for `radarsim list`"),
    "filters": (Mapping, "what `radarsim list` says of its filters: keys, and what they make"),
    "asks": (str, "the question, one sentence"),
    "components": (tuple, "the components of the errors, each Component(name, unit, symbol, words)"),
    "parts": (Mapping, "the models of the keys' parts, by name"),
    "Filter": (type, "the keys of a filter, a subclass of radarsim.config.fields.Member"),
    "scan_period": (str, "the dotted key of the time between two plots, s"),
}


class OneFile(Study):
    """A study declared by one class of one file; the module's docstring lists what a subclass gives.

    drawing(case): as `RecordedPlots.drawing`.
    tracker(case): the filters of a case before their first plot. Without either, or without `measured`, the numbers of
    a recorded plot, the study does nothing with recorded plots. most_scans: bound of `scans`. extra_figures: names of
    figures that a subclass draws beside those of each component, with * for the varying part.
    """

    asks: str
    components: tuple[Component, ...]
    parts: Mapping[str, type[Model]]
    Filter: type[Member]
    scan_period: str
    measured: tuple[Measured, ...] = ()
    paper: Paper | None = None
    claims_yaml: str = ""
    drawing: "Callable[[Case], Draw] | None" = None
    tracker: "Callable[[Case], Tracker] | None" = None
    most_scans: int = 10_000
    extra_figures: tuple[str, ...] = ()

    # ---- what is asked -------------------------------------------------------------------------------------------
    key_class: "type[Keys]"

    def __init_subclass__(cls) -> None:
        """Makes the class of the keys, if nothing is missing. Other processes find it by its name in the module."""
        super().__init_subclass__()
        if not any(True for _ in cls.missing()):
            name = f"{cls.__name__}Keys"
            cls.key_class = keys_of(name, cls.__module__, cls.parts, cls.Filter, cls.most_scans)
            shown = (f"{kind}_{one.name}" for one in cls.components for kind in ("sigma", "gain", "dynamic"))
            cls.key_class.figure_names = (*shown, *cls.extra_figures)
            setattr(sys.modules[cls.__module__], name, cls.key_class)

    def keys(self) -> "type[Keys]":
        if faults := [f"{self.place}: {fault}" for fault in self.missing()]:
            raise ConfigError(*faults)
        if self.claims_yaml:
            _ = self._written  # unknown names in a claim are reported before anything runs
        return self.key_class

    @property
    def place(self) -> str:
        """The file, and line, of the class, for messages."""
        try:
            return f"{inspect.getsourcefile(type(self))}:{inspect.getsourcelines(type(self))[1]}"
        except (OSError, TypeError):  # class made by a call
            return str(sys.modules[type(self).__module__].__file__)

    @classmethod
    def missing(cls) -> Iterator[str]:
        """Attributes that the class lacks, or has of the wrong kind: a line each."""
        given = {name: getattr(cls, name, None) for name in NEEDED}
        if wrong := {name: one for name, one in given.items() if not isinstance(one, NEEDED[name][0]) or not one}:
            for name, one in wrong.items():
                got = "nothing" if one is None else repr(one)[:40]
                yield f"{cls.__name__}.{name} must be given: {NEEDED[name][1]}; got {got}"
            return
        if bare := [one for one in (cls.components, cls.measured) if isinstance(one, Component | Measured)]:
            yield from (f"{one!r} must stand in a tuple, ({type(one).__name__}(…),)" for one in bare)
            return
        for one in cls.components:
            if not isinstance(one, Component) or not (one.name and one.unit):
                yield f"components: {one!r} must be Component(name, unit, symbol, words), with a unit"
        for name, part in (*cls.parts.items(), ("Filter", cls.Filter)):
            base = Member if name == "Filter" else Model
            if not (isinstance(part, type) and issubclass(part, base)):
                yield f"{name} must be a subclass of radarsim.config.fields.{base.__name__}, got {part!r}"
                return
        others = [one for one in cls.measured if not isinstance(one, Measured)]
        yield from (f"measured: {one!r} must be Measured(column, unit, keys of its σ)" for one in others)
        texts = [one for one in cls.measured if isinstance(one, Measured) and isinstance(one.sigma_keys, str)]
        for one in texts:
            yield f"{one.column}: sigma_keys must be a tuple, ({one.sigma_keys!r},); got {one.sigma_keys!r}"
        if others or texts:
            return
        names = [one.name for one in cls.components if isinstance(one, Component)]
        for name in dict.fromkeys(names):
            if not re.fullmatch(r"[A-Za-z0-9_]+", name):
                yield f"components: {name!r} must be of letters, digits and _"
            if names.count(name) > 1:
                yield f"components: {name} is there twice"
        if cls.paper is not None and not isinstance(cls.paper, Paper):
            yield f"paper: must be Paper(…), got {cls.paper!r}"[:120]
        elif cls.paper is not None and isinstance(cls.paper.may_grow, str):
            yield f"paper: may_grow: must be a tuple, ({cls.paper.may_grow!r},); got {cls.paper.may_grow!r}"
        yield from (f"parts: {name} is added to the keys of every study" for name in RESERVED if name in cls.parts)
        yield from ("measured: t_s is the time of a plot" for one in cls.measured if one.column == "t_s")
        keys = {"scan_period": (cls.scan_period,)} | {one.column: one.sigma_keys for one in cls.measured}
        for name, every in keys.items():
            yield from (f"{name}: there is no key {key}" for key in every if key and not cls._has(key))
        if cls._has(cls.scan_period) and not cls._of_a_part(cls.scan_period):
            yield f"scan_period: {cls.scan_period} must be a key of a part, PART.KEY"

    @classmethod
    def _of_a_part(cls, key: str) -> bool:
        """Whether a dotted name is of a part, so that a case has one value of it."""
        part, _, own = key.partition(".")
        return bool(own) and part in cls.parts

    @classmethod
    def _has(cls, key: str) -> bool:
        """Whether a dotted name is a key, or a property, of the parts; a bare one is of the filters."""
        part, _, own = key.partition(".")
        if part in ("filters", "scans", "baseline"):
            return True
        model, first = cls.parts.get(part, Model) if own else cls.Filter, (own or part).partition(".")[0]
        return first in model.model_fields or isinstance(getattr(model, first, None), property)

    # ---- numbers -------------------------------------------------------------------------------------------------
    def call(self, function: Callable[..., Any], *arguments: Any) -> Any:
        """The value of one of the study's functions; ConfigError with its place and the study's name if it fails."""
        return call(function, *arguments, owner=f"study {self.name}: ")

    def scan_period_s(self, spec: Any) -> float:
        """The time between two plots of a config."""
        period = self.call(attrgetter(self.scan_period), spec)
        if not isinstance(period, int | float) or not 0 < period < math.inf:
            raise ConfigError(f"{self.place}: scan_period: {self.scan_period} must be a time > 0, s; got {period!r}")
        return float(period)

    def axes(self, spec: Any, sigma: "np.ndarray | None" = None, bias: "np.ndarray | None" = None) -> "Axes":
        """The axes of a case, with the exact σ and bias (F, K, C) where they are known."""
        import numpy as np

        from radarsim.engine.results import Axes

        names, k = tuple(one.name for one in spec.filters), np.arange(spec.scans)
        shape = len(names), k.size, len(self.components)
        return Axes(
            filters=names,
            components=tuple((one.name, one.unit) for one in self.components),
            k=k + 1,
            t_s=k * self.scan_period_s(spec),
            available=np.ones(shape, dtype=bool),
            baseline=names.index(spec.baseline) if spec.baseline else 0,
            exact_sigma=np.full(shape, np.nan) if sigma is None else sigma,
            exact_bias=np.full(shape, np.nan) if bias is None else bias,
        )

    def sums(self, spec: Any) -> "Layout":
        """The sums of a case: `error` (F, K, C, 4) of e, e², e³, e⁴, and `paired` (F, K, C) of e² times the
        baseline's e²."""
        from radarsim.engine.results import Layout

        shape = len(spec.filters), spec.scans, len(self.components)
        return Layout(error=(*shape, 4), paired=shape)

    def limits(self, spec: Any) -> "np.ndarray | None":
        """The limit of σ (F, C) of a config's errors, NaN where there is none; None: not known."""
        return None

    def quantities(self, spec: Any = None) -> tuple[Quantity, ...]:
        limit = Quantity("limit", term("limit of σ"), "last", "steady_sigma", per="component")
        return COMMON if type(self).limits is OneFile.limits else (*COMMON, limit)

    # ---- what is shown -------------------------------------------------------------------------------------------
    def tables(self, results: "Sequence[CaseResult]") -> "dict[str, pd.DataFrame]":
        from radarsim.report import tables

        return {"last": tables.joined(map(self._last, results))}

    def _last(self, result: "CaseResult") -> Mapping[str, Any]:
        """σ at the last scan, exact where known, and its limit."""
        import numpy as np

        from radarsim.report import statistics, tables

        f, c = np.nonzero(result.axes.available[:, -1])
        sigma = statistics.errors(result.sums["error"][f, -1, c], tables.realisations(result)[f, -1, c]).sigma
        limits = self.limits(result.spec)
        return {
            **tables.leading(result, f, **tables.components(result, c)),
            "last_sigma|last": sigma,
            "exact_last_sigma": result.axes.exact_sigma[f, -1, c],
        } | ({} if limits is None else {"steady_sigma": limits[f, c]})

    def figures(
        self, results: "Sequence[CaseResult]", made: "Mapping[str, pd.DataFrame]", experiment: "Experiment"
    ) -> "dict[str, Figure]":
        from radarsim.report import panels

        return panels.per_component(results, made, self.shown(), experiment)

    def shown(self) -> "list[Component]":
        from radarsim.report import panels

        return [
            one._replace(symbol=one.symbol or panels.letter(one.name), words=self._term(one.words or one.name))
            for one in self.components
        ]

    def question(self, experiment: "Experiment") -> str:
        names = dict.fromkeys(one.name for case in experiment.cases for one in case.spec.filters)
        return f"{tr(self._term(self.asks))} {tr('Filters: {names}.', names=few(list(names)))}"

    def _term(self, words: str) -> Term:
        """A text of the study, translated by the catalogue of its package."""
        return term(words, type(self).__module__.partition(".")[0])

    def answer(self, results: "Sequence[CaseResult]", made: "Mapping[str, pd.DataFrame]") -> Sequence[str]:
        from radarsim.report import panels

        shown, others = panels.reported(results)
        several = len(panels.families(results)) > 1  # configs of an `include`
        each = ((f"{panels.stem(one)}: " if several else "", one) for one in shown)
        return [*(f"{name}{sentence}" for name, one in each for sentence in self._sentences(one, made)), *others]

    def _sentences(self, result: "CaseResult", made: "Mapping[str, pd.DataFrame]") -> Iterator[str]:
        """σ of the leading component at the last scan, and the gain of each filter."""
        from radarsim.report import panels, tables, wording

        leading = self.components[0]
        last = tables.where(made["last"], case=result.name, component=leading.name).to_dict("records")
        keys: tuple[str, ...] = ("last_sigma", "last_lo", "last_hi")
        each = [f"{row['filter']} {wording.estimate((row[key] for key in keys), tr(row['unit']))}" for row in last]
        fields = {"quantity": self._term(leading.words or leading.name), "t": float(result.axes.t_s[-1])}
        words = tr("σ of the {quantity} after {t:g} s: {filters}.", **fields, filters=listed(each))
        yield panels.at_its_place(result, words)
        gains = tables.where(made["gains"], case=result.name, component=leading.name)
        gains = gains[gains["k"] == gains["k"].max()]
        if len(gains):
            keys = ("gain_percent", "gain_lo", "gain_hi")
            each = [f"{row['filter']} {wording.estimate((row[key] for key in keys), '%', '.3g')}"
                    for row in gains.to_dict("records")]  # fmt: skip
            base = result.axes.filters[result.axes.baseline]
            words = tr("Gain against {base} there: {filters}.", base=base, filters=listed(each))
            yield panels.at_its_place(result, words)

    # ---- the paper -----------------------------------------------------------------------------------------------
    @cached_property
    def _written(self) -> "tuple[tuple[Claim, ...], tuple[Choice, ...]]":
        """The content of `claims_yaml`."""
        from radarsim.report.claims.over import written_in
        from radarsim.studies import judged

        own = sys.modules[type(self).__module__]
        source = Path(own.__file__ or "").read_text(encoding="utf-8")
        above = source[: max(source.find(self.claims_yaml), 0)].count("\n")
        claims, choices = written_in("\n" * above + self.claims_yaml, str(own.__file__), judged, own)
        keys = [key for choice in choices for one in choice.alternatives for key in one.sets if not self._has(key)]
        if keys:
            raise ConfigError(*(f"{self.place}: claims_yaml: choices: sets: there is no key {key}" for key in keys))
        return claims, choices

    def paper_key(self) -> str:
        return paper_in(self.claims_yaml)

    def claims(self) -> "PaperClaims | None":
        if self.paper is None or not self.claims_yaml:
            return None
        from radarsim.report.claims import PaperClaims
        from radarsim.studies import judged

        evidence = getattr(sys.modules[type(self).__module__], "Evidence", judged.Evidence)
        return PaperClaims(self._written[0], evidence, *self.paper)

    def claim_faults(self, shipped: "Shipped") -> Sequence[str]:
        if self.paper is None or not self.claims_yaml:
            return ()
        from radarsim.studies import judged

        folder = self.shipped()
        configs = sorted(file.stem for file in folder.glob("configs/*.yaml")) if folder else []
        components = [one.name for one in self.components]
        return tuple(judged.faults(*self._written, components, shipped, configs))

    def readings(self) -> "PaperReadings | None":
        if self.paper is None or not self.claims_yaml or not self._written[1]:
            return None
        from radarsim.studies.judged import Readings

        return Readings(self._written[0][0].paper, self._written[1])

    # ---- beside --------------------------------------------------------------------------------------------------
    def columns(self, spec: Any, one: Any) -> tuple[str, ...]:
        """The columns of recorded plots that a filter takes, in the order of `measured`. Default: theirs."""
        return tuple(number.column for number in self.measured)

    def likelihood(
        self, case: "Case", filter_name: str | None, tracks: "Sequence[Mapping[str, np.ndarray]]"
    ) -> Likelihood | None:
        """As `RecordedPlots.likelihood`. Default: not known."""
        return None

    def recorded(self) -> RecordedPlots | None:
        drawing, tracker = self.drawing, self.tracker
        return Recorded(self, drawing, tracker) if self.measured and drawing and tracker else None

    def shipped(self) -> Path | None:
        folder = Path(str(sys.modules[type(self).__module__].__file__)).parent / "shipped"
        return folder if folder.is_dir() else None


class Recorded(RecordedPlots):
    """The part of a study of one file for recorded plots: a file may have all columns, or those of some filters."""

    from_any_origin = True
    of_any_keys = True

    def __init__(self, study: OneFile, drawing: "Callable[[Case], Draw]", tracker: "Callable[[Case], Tracker]"):
        self.study, self._drawing, self._tracker = study, drawing, tracker

    def columns(self, spec: Any) -> Sequence[Sequence[str]]:
        each = list(dict.fromkeys(self.study.columns(spec, one) for one in spec.filters))
        counts = range(len(each), 0, -1) if len(each) <= MOST_SETS else (len(each), 1)
        some = [tuple(dict.fromkeys(chain(*part))) for n in counts for part in combinations(each, n)]
        return [("t_s", *names) for names in dict.fromkeys(some)]

    def columns_of(self, spec: Any, one: Any) -> Sequence[str]:
        return self.study.columns(spec, one)

    def sigmas(self, spec: Any) -> Mapping[str, Sequence[str]]:
        pairs = [zip(self.study.columns(spec, one), self.study.measured, strict=False) for one in spec.filters]
        return {column: number.sigma_keys for each in pairs for column, number in each}

    def scan_period_s(self, spec: Any) -> float:
        return self.study.scan_period_s(spec)

    def drawing(self, case: "Case") -> Draw:
        return self._drawing(case)

    def tracker(self, case: "Case") -> Tracker:
        return self._tracker(case)

    def likelihood(
        self, case: "Case", filter_name: str | None, tracks: "Sequence[Mapping[str, np.ndarray]]"
    ) -> Likelihood | None:
        return self.study.likelihood(case, filter_name, tracks)

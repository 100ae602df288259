r"""A study in one file: a class declares keys, filters and claims; the rest of a study follows from it.

    class Walk(LinearStudy):  # or another base that computes
        name, about = "walk", "Random walk (textbook)."  # as of every study
        filters = {"gain": "a fixed gain; without it a Kalman filter"}
        asks = "How well is a random walk followed?"
        components = (Component("x", "m", "$x$", "position"),)
        parts = {"sensor": Sensor, "target": Target}
        Filter = Filter
        scan_period = "sensor.scan_period_s"
        measured = (MeasuredColumn("x_m", "m", ("sensor.sigma_x_m",)),)
        paper = Paper("Kalman 1960", may_grow=("filters",))
        claims_yaml = "…"

| given | is |
|---|---|
| `asks` | the question, one sentence |
| `components` | the errors that are shown, the leading one first |
| `parts`, `Filter` | the keys: by name the model of each part, `A \| B` by its key `kind`; of a filter, a `Member` |
| `scan_period` | the key of the time between two plots |
| `measured` | the numbers of a recorded plot, where there is such |
| `paper`, `claims_yaml` | whose claims are judged: a text as claims.yaml, and under `choices` as interpretations.yaml |

`filters`, `baseline` and `scans` are added to the keys, with their marks. The tables curves, gains and `last`, figures,
question and answer, claims and interpretations, and the use of recorded plots follow; `shipped/` beside the file holds
configs. Claims find a case by its keys, `of: [{radar.scan_period_s: 2}]`, and are measured by functions of the file
whose first argument is `seen`, or by those of `radarsim.papers.one_file_measures`. The alternatives of a choice set
keys, `sets: {radar.scan_period_s: 2}`.

A base for a kind of model derives from `OneFile` and gives `prepare`, with `axes` and `sums` from this module,
`simulate`, and if it can `limits`, `drawing`, `tracker` and `likelihood`. `radarsim.studies.linear` is such a base.

Each attribute that a class lacks, or has of the wrong kind, is a line of a ConfigError when its keys are first read."""

import inspect
import math
import re
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from operator import attrgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from radarsim.config.model import Model
from radarsim.config.study_keys import Member, make_study_keys, part_models
from radarsim.errors import ConfigError
from radarsim.language.translate import Term, join_names, list_filters, quote_name, term, tr
from radarsim.report.quantities import COMMON, Component, Quantity
from radarsim.studies.interface import Paper, Study
from radarsim.studies.onefile_recordings import OneFileRecordings
from radarsim.studies.recording_interface import Likelihood, RecordingInterface
from radarsim.user_code.errors import call_user_function

if TYPE_CHECKING:
    import numpy as np
    import pandas as pd

    from radarsim.config.experiment import Case, Experiment
    from radarsim.config.study_keys import StudyKeys as Keys
    from radarsim.engine.results import Axes, CaseResult
    from radarsim.engine.sums import Layout
    from radarsim.report.drawing.model import Figure
    from radarsim.report.sentences import Sentence
    from radarsim.studies.plot_arrays import DrawPlots
    from radarsim.studies.process_noise_remedy import Settings
    from radarsim.studies.recording_interface import Tracker


class MeasuredColumn(NamedTuple):
    """A number of a plot: its column, its unit, and the keys of its standard deviation."""

    column: str
    unit: str
    sigma_keys: tuple[str, ...] = ()


RESERVED_KEYS = "filters", "baseline", "scans"
REQUIRED_ATTRIBUTES: Mapping[str, tuple[type, str]] = {
    "name": (str, "the value of `study:` in YAML"),
    "about": (str, "one line for `radarsim list`"),
    "filters": (Mapping, "what `radarsim list` says of its filters: keys, and what they make"),
    "asks": (str, "the question, one sentence"),
    "components": (tuple, "the components of the errors, each Component(name, unit, symbol, words)"),
    "parts": (Mapping, "the models of the keys' parts, by name"),
    "Filter": (type, "the keys of a filter, a subclass of radarsim.config.study_keys.Member"),
    "scan_period": (str, "the dotted key of the time between two plots, s"),
}


class OneFile(Study):
    """A study declared by one class of one file; the module's docstring lists what a subclass gives.

    drawing(case): as `RecordingInterface.drawing`.
    tracker(case): the filters of a case before their first plot. Without either, or without `measured`, the numbers of
    a recorded plot, the study does nothing with recorded plots. most_scans: bound of `scans`. extra_figures: names of
    figures that a subclass draws beside those of each component, with * for the varying part.
    """

    asks: str
    components: tuple[Component, ...]
    parts: Mapping[str, Any]
    Filter: type[Member]
    scan_period: str
    measured: tuple[MeasuredColumn, ...] = ()
    paper: Paper | None = None
    claims_yaml: str = ""
    drawing: "Callable[[Case], DrawPlots] | None" = None
    tracker: "Callable[[Case], Tracker] | None" = None
    most_scans: int = 10_000
    extra_figures: tuple[str, ...] = ()

    key_class: "type[Keys]"

    def __init_subclass__(cls) -> None:
        """Make the class of the keys, if nothing is missing. Other processes find it by its name in the module."""
        super().__init_subclass__()
        if not any(True for _ in cls.missing()):
            name = f"{cls.__name__}Keys"
            cls.key_class = make_study_keys(name, cls.__module__, cls.parts, cls.Filter, cls.most_scans)
            names = (
                f"{kind}_{component.name}" for component in cls.components for kind in ("sigma", "gain", "dynamic")
            )
            cls.key_class.figure_names = (*names, *cls.extra_figures)
            setattr(sys.modules[cls.__module__], name, cls.key_class)

    def keys(self) -> "type[Keys]":
        if faults := [f"{self.place}: {fault}" for fault in self.missing()]:
            raise ConfigError(*faults)
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
        """Attributes that the class lacks, or has of the wrong kind: a line each. Each check relies on those before."""
        for check in (cls._attribute_errors, cls._tuple_errors, cls._type_errors, cls._content_errors):
            errors = list(check())
            yield from errors
            if errors:
                return

    @classmethod
    def _attribute_errors(cls) -> Iterator[str]:
        for name, (kind, description) in REQUIRED_ATTRIBUTES.items():
            value = getattr(cls, name, None)
            if not isinstance(value, kind) or not value:
                got = "nothing" if value is None else repr(value)[:40]
                yield f"{cls.__name__}.{name} must be given: {description}; got {got}"

    @classmethod
    def _tuple_errors(cls) -> Iterator[str]:
        for value in (cls.components, cls.measured):
            if isinstance(value, Component | MeasuredColumn):
                yield f"{value!r} must stand in a tuple, ({type(value).__name__}(…),)"

    @classmethod
    def _type_errors(cls) -> Iterator[str]:
        for component in cls.components:
            if not isinstance(component, Component) or not (component.name and component.unit):
                yield f"components: {component!r} must be Component(name, unit, symbol, words), with a unit"
        for name, part in (*cls.parts.items(), ("Filter", cls.Filter)):
            base = Member if name == "Filter" else Model
            models = (part,) if name == "Filter" else part_models(part)
            if not all(isinstance(model, type) and issubclass(model, base) for model in models):
                yield f"{name} must be a subclass of {base.__module__}.{base.__name__}, got {part!r}"
        for number in cls.measured:
            if not isinstance(number, MeasuredColumn):
                yield f"measured: {number!r} must be MeasuredColumn(column, unit, keys of its σ)"
            elif isinstance(keys := number.sigma_keys, str):
                yield f"{number.column}: sigma_keys must be a tuple, ({keys!r},); got {keys!r}"

    @classmethod
    def _content_errors(cls) -> Iterator[str]:
        names = [component.name for component in cls.components]
        for name in dict.fromkeys(names):
            if not re.fullmatch(r"[A-Za-z0-9_]+", name):
                yield f"components: {name!r} must be of letters, digits and _"
            if names.count(name) > 1:
                yield f"components: {name} is there twice"
        if cls.paper is not None and not isinstance(cls.paper, Paper):
            yield f"paper: must be Paper(…), got {cls.paper!r}"[:120]
        elif cls.paper is not None and isinstance(cls.paper.may_grow, str):
            yield f"paper: may_grow: must be a tuple, ({cls.paper.may_grow!r},); got {cls.paper.may_grow!r}"
        yield from (f"parts: {name} is added to the keys of every study" for name in RESERVED_KEYS if name in cls.parts)
        yield from ("measured: t_s is the time of a plot" for number in cls.measured if number.column == "t_s")
        keys_by_user: dict[str, tuple[str, ...]] = {"scan_period": (cls.scan_period,)}
        keys_by_user |= {number.column: number.sigma_keys for number in cls.measured}
        for user, keys in keys_by_user.items():
            yield from (f"{user}: there is no key {key}" for key in keys if key and not cls.has_key(key))
        if cls.has_key(cls.scan_period) and not cls._of_a_part(cls.scan_period):
            yield f"scan_period: {cls.scan_period} must be a key of a part, PART.KEY"

    @classmethod
    def _of_a_part(cls, key: str) -> bool:
        """Whether a dotted name is of a part, so that a case has one value of it."""
        part, _, subkey = key.partition(".")
        return bool(subkey) and part in cls.parts

    @classmethod
    def has_key(cls, key: str) -> bool:
        """Whether a dotted name is a key, or a property, of the parts; a bare one is of the filters."""
        part, _, subkey = key.partition(".")
        if part in ("filters", "scans", "baseline"):
            return True
        models, first = (
            part_models(cls.parts.get(part, Model) if subkey else cls.Filter),
            (subkey or part).split(".")[0],
        )
        return any(first in model.model_fields or isinstance(getattr(model, first, None), property) for model in models)

    def call(self, function: Callable[..., Any], *arguments: Any) -> Any:
        """The value of one of the study's functions; ConfigError with its place and the study's name if it fails."""
        return call_user_function(function, *arguments, owner=f"study {self.name}: ")

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

        names, k = tuple(filter_keys.name for filter_keys in spec.filters), np.arange(spec.scans)
        shape = len(names), k.size, len(self.components)
        return Axes(
            filters=names,
            components=tuple((component.name, component.unit) for component in self.components),
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
        from radarsim.engine.sums import Layout

        shape = len(spec.filters), spec.scans, len(self.components)
        return Layout(error=(*shape, 4), paired=shape)

    def limits(self, spec: Any) -> "np.ndarray | None":
        """The limit of σ (F, C) of a config's errors, NaN where there is none; None: not known."""
        return None

    def steady_sigma(self, case: "Case") -> "np.ndarray | None":
        import numpy as np

        limits = self.limits(case.spec)
        return None if limits is None or np.isnan(limits).any() else limits

    def quantities(self, spec: Any = None) -> tuple[Quantity, ...]:
        limit = Quantity("limit", term("limit of σ"), "last", "steady_sigma", per="component")
        return COMMON if type(self).limits is OneFile.limits else (*COMMON, limit)

    def tables(self, results: "Sequence[CaseResult]") -> "dict[str, pd.DataFrame]":
        from radarsim.report import tables

        return {"last": tables.join_columns(map(self.last_columns, results))}

    def last_columns(self, result: "CaseResult") -> Mapping[str, Any]:
        """σ at the last scan, of a study in one file.

        last_sigma ±: σ at the last scan
        exact_last_sigma: its exact value, where it is known"""
        import numpy as np

        from radarsim.report import statistics, tables

        f, c = np.nonzero(result.axes.available[:, -1])
        sigma = statistics.errors(result.sums["error"][f, -1, c], tables.realisation_counts(result)[f, -1, c]).sigma
        limits = self.limits(result.spec)
        return {
            **tables.label_columns(result, f, **tables.component_columns(result, c)),
            "last_sigma": sigma,
            "exact_last_sigma": result.axes.exact_sigma[f, -1, c],
        } | ({} if limits is None else {"steady_sigma": limits[f, c]})

    def figures(
        self, results: "Sequence[CaseResult]", tables: "Mapping[str, pd.DataFrame]", experiment: "Experiment"
    ) -> "dict[str, Figure]":
        from radarsim.report import time_figures

        return time_figures.component_figures(results, tables, self.user_filter_components(), experiment)

    def user_filter_components(self) -> "list[Component]":
        from radarsim.report import key_labels

        return [
            component._replace(
                symbol=component.symbol or key_labels.component_symbol(component.name),
                words=self._term(component.words or component.name),
            )
            for component in self.components
        ]

    def question(self, experiment: "Experiment") -> str:
        names = dict.fromkeys(filter_keys.name for case in experiment.cases for filter_keys in case.spec.filters)
        return f"{tr(self._term(self.asks))} {tr('Filters: {names}.', names=list_filters(names))}"

    def _term(self, words: str) -> Term:
        """A text of the study, which the catalogue of its package translates."""
        return term(words, type(self).__module__.partition(".")[0])

    def answer(
        self, results: "Sequence[CaseResult]", tables: "Mapping[str, pd.DataFrame]"
    ) -> "Sequence[str | Sentence]":
        from radarsim.report import case_selection, key_labels, sentences
        from radarsim.studies.process_noise_answer import best_noise
        from radarsim.studies.process_noise_remedy import remedy_sentence

        reported, remark = case_selection.select_reported(results)
        has_several_configs = len(case_selection.group_by_config(results)) > 1  # of an `include`
        answer = best_noise(self, results, tables).sentences
        for result in reported:
            prefix = f"{key_labels.config_stem(result)}: " if has_several_configs else ""
            answer += [sentence.with_text(prefix + sentence.text) for sentence in self._sentences(result, tables)]
        return [*answer, *remedy_sentence(self, reported, tables, self.alternatives), *map(sentences.Sentence, remark)]

    def alternatives(self, spec: Any, index: int) -> "Sequence[Settings] | None":
        """What is tried for a filter, by index, that measures more than the baseline and is worse, where a larger
        process noise alone does not help. None, the default: no filter measures more."""
        return None

    def _sentences(self, result: "CaseResult", tables_by_name: "Mapping[str, pd.DataFrame]") -> "Iterator[Sentence]":
        """σ of the leading component at the last scan, and the gain of each filter."""
        from radarsim.report import case_selection, compared_value, gain_sentences, key_labels, sentences, tables

        leading = self.components[0]
        curves = tables.select_rows(tables_by_name["curves"], case=result.name, component=leading.name)
        last = [row for _, row in curves[curves["k"] == curves["k"].max()].iterrows()]
        sigmas = [compared_value.sigma_value(row, tables_by_name) for row in last]
        texts = [
            f"{quote_name(row['filter'])} {sigma.text(key_labels.unit_label(row['unit']))}"
            for row, sigma in zip(last, sigmas, strict=True)
        ]
        text = tr(
            "RMS error of the {quantity} after {t:g} s: {filters}.",
            quantity=self._term(leading.words or leading.name),
            t=float(result.axes.t_s[-1]),
            filters=join_names(texts),
        )
        intervals = tuple(interval for sigma in sigmas for interval in sigma.intervals)
        yield sentences.Sentence(case_selection.after_swept_values(result, text), intervals)
        gains = tables.select_rows(tables_by_name["gains"], case=result.name, component=leading.name)
        gains = gains[gains["k"] == gains["k"].max()]
        if len(gains):
            values = (
                (row["filter"], compared_value.row_value(row, compared_value.GAIN)) for _, row in gains.iterrows()
            )
            texts = [f"{quote_name(name)} {gain_sentences.percent_text(gain, result.count)}" for name, gain in values]
            base = result.axes.filters[result.axes.baseline]
            text = self._gains_text(result, quote_name(base), join_names(texts))
            yield sentences.Sentence(
                case_selection.after_swept_values(result, text), sentences.intervals("gains", "gain", gains)
            )

    def _gains_text(self, result: "CaseResult", base: str, gains: str) -> str:
        """The sentence on gains over the baseline at the last scan."""
        return tr("Gain over {base} at {t:g} s: {filters}.", base=base, filters=gains, t=float(result.axes.t_s[-1]))

    def span_mps(self, spec: Any) -> float | None:
        """The unambiguous interval into which measured velocities are folded, which the filters allow for. Default:
        None."""
        return None

    def unfolding(self, spec: Any, span_mps: float) -> Sequence[str]:
        """As `RecordingInterface.unfolding`. Default: there is no such key."""
        return ()

    def columns(self, spec: Any, filter_keys: Any) -> tuple[str, ...]:
        """The columns of recorded plots that a filter takes, in the order of `measured`. Default: theirs."""
        return tuple(number.column for number in self.measured)

    def likelihood(
        self, case: "Case", filter_name: str | None, tracks: "Sequence[Mapping[str, np.ndarray]]"
    ) -> Likelihood | None:
        """As `RecordingInterface.likelihood`. Default: not known."""
        return None

    def recording_interface(self) -> RecordingInterface | None:
        drawing, tracker = self.drawing, self.tracker
        return OneFileRecordings(self, drawing, tracker) if self.measured and drawing and tracker else None

    def shipped(self) -> Path | None:
        folder = Path(str(sys.modules[type(self).__module__].__file__)).parent / "shipped"
        return folder if folder.is_dir() else None

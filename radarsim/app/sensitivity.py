"""`radarsim sensitivity`: changes of σ and gains for +10 % of each key, or −10 % where more is refused.

Exact where the case's σ are. Else both cases are simulated with the same noise, in batches, and the interval of a
change comes from the changes without one batch each."""

import contextlib
import math
import os
from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from radarsim.app import configs, quantities
from radarsim.app.case_work import CaseWork
from radarsim.app.quantities import UNPAIRED, Asked
from radarsim.app.run import case_result, merged
from radarsim.app.shown import Shown
from radarsim.app.solve import Cases, Config, place, without_one
from radarsim.config import fields
from radarsim.config.check import Label, label
from radarsim.config.experiment import Case
from radarsim.config.fields import Study
from radarsim.engine.results import Axes, CaseResult
from radarsim.engine.run import collect
from radarsim.errors import ConfigError
from radarsim.language import few, listed, term, tr
from radarsim.report import files, panels, statistics
from radarsim.report import tables as common
from radarsim.report.drawing import PAGE_MM, Axis, Figure, Line, Mark, Panel, Reference, Style
from radarsim.report.quantities import Quantity
from radarsim.report.wording import significant_digits
from radarsim.studies import registry

if TYPE_CHECKING:
    import pandas as pd

MORE = 0.1
MOST_BARS, LEAST_BAR = 16, 0.01  # of a tornado; and of its longest bar, what is seen
NOTHING = 1e-9  # per cent: changes below it may be rounding
ROUNDED = NOTHING / 100  # the same of a ratio; of gains, in points, still less
FOLDER = "sensitivity"
LESS = ", −10 %"  # after a key that is lowered
LABELS = ("case", "filter", "component", "unit", "key", "value", "changed_value")


def columns(of: Sequence[Quantity]) -> tuple[str, ...]:
    """The columns of sensitivity.csv, for some quantities."""
    return *LABELS, *(name for one in of for name in (_value(one), *one.changes)), "exact"


def _value(of: Quantity) -> str:
    return f"{of.name}_percent" if of.shown_unit() == "%" else of.name


@dataclass(frozen=True, repr=False)
class Sensitivity(Shown):
    """The result: one row for each key, filter and component, by falling effect of the key on the leading component.

    of: the quantities, the first of which sets the order; leading: empty where that has no components. at: the time in
    words, empty without scans; without_effect: keys that change nothing; left_out: keys that can be neither raised nor
    lowered, with the reason. without_estimate: filters without rows, as they have no estimate there. not_paired:
    sampled keys that change the scan times. labels: the name of each key, with its symbol and unit. files: those
    written, if any."""

    stem: str
    of: tuple[Quantity, ...]
    leading: str
    at: str
    rows: tuple[dict[Hashable, Any], ...]
    without_effect: tuple[str, ...]
    without_estimate: tuple[str, ...]
    not_paired: tuple[str, ...]
    left_out: dict[str, str]
    labels: dict[str, Label]
    files: tuple[str, ...] = ()

    @property
    def table(self) -> "pd.DataFrame":
        """sensitivity.csv: every key, filter and component, by falling effect on the component that leads."""
        return common.frame({name: [row[name] for row in self.rows] for name in columns(self.of)})

    @property
    def lowered(self) -> tuple[str, ...]:
        """The keys whose value is a tenth less, as the config refuses more."""
        return tuple(dict.fromkeys(row["key"] for row in self.rows if abs(row["changed_value"]) < abs(row["value"])))

    @property
    def _described(self) -> dict[str, Figure]:
        return {"tornado": tornado(self)} if self.rows else {}

    @property
    def title(self) -> str:
        """The quantity and the time."""
        what = self.of[0].place(self.leading, tr) or tr(self.of[0].words)
        what = " ".join(filter(None, (what, self.at)))
        return tr("{stem}: change of {component} for +10 %", stem=self.stem, component=what)

    def _said(self) -> list[str]:
        first, change, lines = self.of[0], self.of[0].changes[0], [self.title]
        for key in dict.fromkeys(row["key"] for row in self.rows):
            own = [row for row in self.rows if row["key"] == key and row["component"] == self.leading]
            each = (
                f"{significant_digits(row[change], '+.3g')} {tr(first.changed_unit)} ({row['filter']})" for row in own
            )
            lines.append(f"{key}{LESS * (key in self.lowered)}: {', '.join(each)}")
        return lines


def sensitivity(
    config: Config,
    *,
    at_s: float | None = None,
    at_k: int | None = None,
    of: str | None = None,
    component: str | None = None,
    case: str | None = None,
    overrides: configs.Overrides = (),
    realisations: float | None = None,
    seed: int | None = None,
    out: str | os.PathLike[str] | None = None,
    figures: bool | str | Sequence[str] = True,
    width_mm: float | None = None,
    progress: Callable[[int, int, int], None] | None = None,
) -> Sensitivity:
    """Show what +10 % of each key changes in σ and gain, or in another quantity `of`; largest effect first.

    Taken at time at_s, s, or at scan at_k, counted from 1; default: the last scan. Rows are sorted by `component`, by
    default the first. `table` has a row for each key, filter and component: the value, in the component's unit or per
    cent, and its change, in per cent or points, with a 95 % interval if simulated. out: directory for table and figure.
    Raises ConfigError.

    >>> found = sensitivity("rls2", at_s=60)
    >>> first = found.table.iloc[0]
    >>> print(first["key"], first["filter"], first["component"], f"{first['sigma_change_percent']:.2f}")
    radar.detection_probability r r 34.40
    """
    checked = configs.check(overrides, out=out, figures=figures, width_mm=width_mm, **place(at_s, at_k))
    cases, count = Cases(config, merged(checked, None, seed), case), configs.whole(realisations)
    study = registry.study(cases.base.study)
    every = registry.quantities(cases.base.study, cases.base.spec)
    kinds = tuple(one for one in every if quantities.planned(one)) or every[:1]
    kinds = kinds if of is None else (registry.quantity(of, cases.base),)
    first = quantities.labels(Asked(kinds[0], at_k=1), cases.base)
    scans, parts = True, tuple(first.components)
    if not quantities.planned(kinds[0]):
        scans, parts = _parts(kinds[0], cases.base)
    leading = parts[0][0] if component is None else component
    quantities.named(leading, [name for name, _ in parts], kinds[0].per or "component")
    axes = study.prepare(cases.base).axes
    timed = study.exact_errors and at_s is None and at_k is None and quantities.planned(kinds[0])
    asked = Asked(kinds[0], at_s=float(axes.t_s[-1]) if timed else at_s, at_k=at_k)
    look = Look(asked, kinds, axes, parts, count or cases.base.realisations)
    base = look.of(cases.base)
    if not np.isfinite(base.whole[0]).any():
        raise ConfigError("there is no estimate there")
    keys = [key for key in fields.keys(cases.base.spec) if key.value and not ("." not in key.path and key.whole)]
    rows, left_out, apart = [], {}, list[str]()
    for n, key in enumerate(keys):
        try:
            value, changed = other(cases, key)
            before, after = look.pair(cases.base, base, changed)
            rows += look.rows(cases.base, key, value, before, after)
            apart += [key.path] if before is not base else []
        except ConfigError as error:
            left_out[key.path] = error.lines[0].removeprefix(f"{key.path}: ")
        if progress is not None:
            progress(n + 1, len(keys), 0)
    effect = {key.path: size(rows, key.path, leading, kinds[0].changes[0]) for key in keys}
    idle = [path for path, (own, every) in effect.items() if every < NOTHING and path not in left_out]
    shown = [row for row in rows if row["key"] not in idle]
    shown.sort(key=lambda row: effect[row["key"]], reverse=True)
    labels = {str(row["key"]): named(cases.base.spec, str(row["key"])) for row in shown}
    silent = [name for name, own in zip(axes.filters, base.whole[0], strict=True) if not np.isfinite(own).any()]
    which = cases.stem, kinds, leading, when(asked) if scans else ""
    found = Sensitivity(*which, tuple(shown), tuple(idle), tuple(silent), tuple(apart), left_out, labels)
    return found if out is None else write(found, out, configs.formats(figures), width_mm)


def _parts(of: Quantity, case: Case) -> tuple[bool, tuple[tuple[str, str], ...]]:
    """Whether a quantity's table has scans; the components, or the other column that tells values of a filter apart,
    with their units."""
    work = CaseWork(case)
    table = quantities.table_of(of, case_result(case, work, collect(work, 1)))
    if not of.per:
        return "k" in table, (("", of.shown_unit()),)
    units = table["unit"] if "unit" in table else [of.shown_unit()] * len(table)
    return "k" in table, tuple(dict(zip(table[of.per].astype(str), units, strict=True)).items())


TARGET = "target"  # the key whose own keys have names that others have too: a duration, a range


def named(spec: Study, path: str) -> Label:
    """The name of a key: a filter's with the filter, the target's as its own, a list item's with its number."""
    found = label(spec, path)
    text, steps = tr(found.text), path.split(".")
    if steps[-1].isdecimal():
        text = f"{text} {int(steps[-1]) + 1}"
    if steps[0] == spec.bare_keys:
        text = f"{spec.members[int(steps[1])].name}: {text}"
    elif steps[0] == TARGET:
        text = f"{tr(label(spec, TARGET).text)}: {text}"
    return found._replace(text=text)


def other(cases: Cases, key: fields.NumericKey) -> tuple[float, Case]:
    """A tenth more of a key's value, in size, or less where the config refuses more; and the case with it. Whole
    numbers change by at least one. Raises ConfigError with the reason where there is no more."""
    assert key.value is not None
    step = max(1, round(MORE * key.value)) if key.whole else MORE * key.value
    try:
        return key.value + step, cases.at(key.path, key.value + step)
    except ConfigError:
        with contextlib.suppress(ConfigError):
            return key.value - step, cases.at(key.path, key.value - step)
        raise


def when(asked: Asked) -> str:
    """The time or scan, in words."""
    if asked.at_k is not None:
        return tr("at k = {k}", k=str(asked.at_k))
    return tr("at the last scan") if asked.at_s is None else tr("at {t_s:g} s", t_s=asked.at_s)


def size(rows: Sequence[dict[Hashable, Any]], path: str, leading: str, change: str) -> tuple[float, float]:
    """The greatest change, in this column, that a key makes: of the leading component, and of any."""
    own = [row for row in rows if row["key"] == path]
    parts = [[row for row in own if row["component"] == leading], own]
    first, every = (max((abs(row[change]) for row in part), default=0.0) for part in parts)
    return first, every


class Seen(NamedTuple):
    """Q quantities of F filters and C components at one time: of the whole case (Q, F, C), and of all its realisations
    but one of n batches (Q, n, F, C), n = 1 where exact. NaN where there is no estimate. t_s (K,): times of the scans,
    s."""

    whole: np.ndarray
    but_one: np.ndarray
    t_s: np.ndarray

    @property
    def exact(self) -> bool:
        return self.but_one.shape[1] == 1


@dataclass(frozen=True)
class Look:
    """Values of a case for every filter and component at one time, exact or in batches of realisations."""

    asked: Asked
    kinds: tuple[Quantity, ...]
    axes: Axes
    parts: tuple[tuple[str, str], ...]
    realisations: int

    @property
    def cells(self) -> list[tuple[int, int]]:
        """Filters and components, by index."""
        return [(f, c) for f in range(len(self.axes.filters)) for c in range(len(self.parts))]

    def pair(self, case: Case, base: Seen, changed: Case) -> tuple[Seen, Seen]:
        """Values of a case, `base` with the usual realisations, and of a changed one. Raises ConfigError. More
        realisations where both are sampled at a time and the scan times differ: the noise at that time is then of
        different scans, so that the interval of the change is that of two independent runs."""
        seen = self.of(changed)
        if base.exact or self.asked.at_s is None or np.array_equal(base.t_s, seen.t_s):
            return base, seen
        longer = replace(self, realisations=UNPAIRED * self.realisations)
        return longer.of(case), longer.of(changed)

    def of(self, case: Case) -> Seen:
        """Values of a case. Raises ConfigError."""
        axes = quantities.labels(self.asked, case)
        known, without_ends = self._each(lambda asked: quantities.exact(asked, case, axes)), False
        if not quantities.planned(self.asked.of):
            work = CaseWork(case)
            result = case_result(case, work, collect(work, 1))
            known = self._of_result(result, exactly=True)
            without_ends = self.asked.of.ends[0] not in quantities.table_of(self.asked.of, result)
        # With only some filters' values, the others would seem to change nothing.
        exact = without_ends or np.isfinite(known[0]).any(axis=1).all()
        return Seen(known, known[:, None], np.asarray(axes.t_s)) if exact else self._sampled(case)

    def _each(self, of: Callable[[Asked], float]) -> np.ndarray:
        """(Q, F, C) of a function of the request."""
        names = [(self.axes.filters[f], self.parts[c][0] or None) for f, c in self.cells]
        values = [
            of(replace(self.asked, of=kind, filter=filter_name, component=part))
            for kind in self.kinds
            for filter_name, part in names
        ]
        return np.array(values).reshape(len(self.kinds), len(self.axes.filters), len(self.parts))

    def _sampled(self, case: Case) -> Seen:
        whole, but_one, axes = without_one(case, self._of_result, self.realisations)
        return Seen(whole, np.stack(but_one, axis=1), np.asarray(axes.t_s))

    def _of_result(self, result: CaseResult, exactly: bool = False) -> np.ndarray:
        """(Q, F, C) from the tables of a case: measured, or exact values."""
        known = {kind: quantities.courses(kind, quantities.table_of(kind, result), exactly) for kind in self.kinds}

        def value(asked: Asked) -> float:
            course = known[asked.of].get((str(asked.filter), asked.component or ""))
            return math.nan if course is None else float(quantities.at(asked, course).value)

        return self._each(value)

    def rows(
        self, case: Case, key: fields.NumericKey, value: float, base: Seen, changed: Seen
    ) -> list[dict[Hashable, Any]]:
        """A row for each filter and component that has an estimate, with the changes from base to that of a value."""
        changes = [
            (_change(of, base.whole[q], changed.whole[q]), _change(of, base.but_one[q], changed.but_one[q]))
            for q, of in enumerate(self.kinds)
        ]
        made: list[dict[Hashable, Any]] = []
        for f, c in self.cells:
            if not np.isfinite(changes[0][0][f, c]):
                continue
            name, unit = self.parts[c]
            values = [case.name, self.axes.filters[f], name, unit, key.path, key.value, value]
            for q, (of, (change, but_one)) in enumerate(zip(self.kinds, changes, strict=True)):
                ends = interval(but_one[:, f, c], change[f, c])
                values += [base.whole[q, f, c], *(100 * math.expm1(end) if of.kind == "size" else end for end in ends)]
            made.append(dict(zip(columns(self.kinds), [*values, base.exact], strict=True)))
        return made


def _change(of: Quantity, before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """The change of a quantity's values; for a size, the change of its logarithm."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.log(after / before) if of.kind == "size" else after - before


def interval(but_one: np.ndarray, value: float) -> tuple[float, float, float]:
    """A value with its 95 % interval from the n values without one batch each (n,); n = 1: it is exact. The jackknife
    over groups (Shao & Tu, The Jackknife and Bootstrap, 1995, sec. 2.3): a batch alone may have no estimate, as where
    few realisations lock."""
    n = len(but_one)
    if np.all(np.abs(but_one) < ROUNDED) and abs(value) < ROUNDED:
        return 0.0, 0.0, 0.0
    error = 0.0 if n == 1 else (n - 1) / math.sqrt(n) * float(np.std(but_one, ddof=1))
    half = 0.0 if n == 1 else float(statistics.student(n - 1)) * error
    return value, value - half, value + half


def tornado(found: "Sensitivity") -> Figure:
    """Bars of the changes of the leading component by key: each quantity of each filter."""
    rows = [row for row in found.rows if row["component"] == found.leading]
    filters = list(dict.fromkeys(row["filter"] for row in rows))
    kinds = [of for of in found.of if any(math.isfinite(row[of.changes[0]]) for row in rows)]
    every = list(dict.fromkeys(row["key"] for row in rows))
    seen = [key for key in every if _is_seen(key, rows, kinds)]
    keys = seen[:MOST_BARS][::-1]
    made = []
    for n, of in enumerate(kinds):
        change, *bounds = of.changes
        marks: list[Mark] = [Reference(0.0, "x")]
        for i, one in enumerate(filters):
            own = {row["key"]: row for row in rows if row["filter"] == one}
            for j, key in enumerate(keys):
                value = own[key][change] if key in own else math.nan
                at = j - 0.7 * ((i + 0.5) / len(filters) - 0.5)
                if math.isfinite(value):
                    x, y = np.array([0.0, value]), np.array([at, at])
                    marks.append(
                        Line(x, y, "", Style(i, 0, width_pt=9.0 / len(filters), flat=True), name=f"{one}, {key}")
                    )
                if math.isfinite(value) and not own[key]["exact"]:
                    ends = np.array([own[key][bound] for bound in bounds])
                    marks.append(Line(ends, y, "", Style(i, 0, width_pt=1.0, flat=True), name=f"{one}, {key}, 95 %"))
        texts = [tick(found.labels[key]) + LESS * (key in found.lowered) if n == 0 else "" for key in keys]
        ticks = tuple((float(j), text) for j, text in enumerate(texts))
        y_axis = Axis("", limits=(-0.6, len(keys) - 0.4), ticks=ticks)
        names = [(panels.literal(one), Style(i, 0, width_pt=4.0, flat=True)) for i, one in enumerate(filters)]
        styles = tuple(names) if n == len(kinds) - 1 else ()
        words = tr("change of {quantity}, {unit}", quantity=term(of.words), unit=tr(of.changed_unit))
        made.append(Panel(Axis(words), y_axis, tuple(marks), keys=styles, direct=False, legend="right"))
    what = listed([tr(of.words) for of in kinds])
    if found.leading:
        what = tr("{quantity} of {symbol}", quantity=what, symbol=found.of[0].place(found.leading, tr))
    caption = tr(
        "Change of {quantity} when each key grows by 10 %, largest first.",
        quantity=" ".join(filter(None, (what, found.at))),
    )
    if set(keys) & set(found.lowered):
        caption += " " + tr("Keys with −10 % cannot grow and fall instead.")
    if not all(row["exact"] for row in rows):
        caption += " " + tr("Thin lines: 95 % intervals.")
    if little := [panels.plain(found.labels[key].text) for key in every if key not in seen]:
        caption += " " + tr("Too small to be drawn: {keys}.", keys=few(little))
    title = tr("Effect of +10 % of each key, {stem}", stem=found.stem)
    height = 24 + 6.5 * max(3, len(keys))
    return Figure("tornado", title, caption, tuple(made), len(made), PAGE_MM, height)


def _is_seen(key: str, rows: Sequence[Mapping[Hashable, Any]], kinds: Sequence[Quantity]) -> bool:
    """Whether the bar of a key is long enough to be seen beside the longest, of any quantity."""
    for change in (of.changes[0] for of in kinds):
        sizes = [(abs(row[change]), row["key"]) for row in rows if math.isfinite(row[change])]
        most = max((size for size, _ in sizes), default=0.0)
        if any(size >= LEAST_BAR * most and of == key for size, of in sizes):
            return True
    return False


def tick(name: Label) -> str:
    """Label of a key beside its bars: name, symbol and unit."""
    words = panels.literal(name.text)
    return panels.with_unit(" ".join(filter(None, (words, panels.mathematical(name.symbol)))), name.unit)


def write(
    found: Sensitivity, out: str | os.PathLike[str], formats: Sequence[str], width_mm: float | None = None
) -> Sensitivity:
    """Add the files: sensitivity.csv and the tornado figure, in `out`/sensitivity/CONFIG.

    width_mm overrides the figure's width."""
    configs.directory(out)
    contents = {"sensitivity.csv": common.to_csv(found.table)}
    if formats and found.rows:
        from radarsim.report import figures  # Matplotlib

        saved = figures.save(tornado(found), formats, width_mm)
        contents |= {f"tornado.{kind}": data for kind, data in saved.items()}
    folder = Path(out) / FOLDER / found.stem
    files.replace_all(folder, contents)
    return replace(found, files=tuple(str(folder / name) for name in contents))

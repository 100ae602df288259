"""`radarsim sensitivity`: changes of σ and gains when each key is changed by ten per cent.

Where a key cannot be larger, it is made smaller by ten per cent. A change is exact where the σ of both cases are exact.
Otherwise both cases are simulated with the same noise, in batches, and the interval of a change is computed from the
changes without one batch each (jackknife)."""

import contextlib
import itertools
import math
import os
from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from radarsim.api import arguments, configs
from radarsim.api.case_results import case_result
from radarsim.api.case_work import CaseWork
from radarsim.api.configs import Config
from radarsim.api.design import quantities
from radarsim.api.design.jackknife import ROUNDING_PERCENT, jackknife_interval
from radarsim.api.design.objective import UNPAIRED_FACTOR, Objective, Scan, have_common_noise
from radarsim.api.design.quantities import MeasuredQuantity
from radarsim.api.design.question import Cases, scan_options
from radarsim.api.design.tornado import LOWERED, key_effect, tornado
from radarsim.api.display import Displayable
from radarsim.api.load_experiments import combine_overrides
from radarsim.config import numeric_keys
from radarsim.config.experiment import Case
from radarsim.config.labels import Label, label
from radarsim.config.quantity_phrase import Over
from radarsim.config.study_keys import StudyKeys
from radarsim.engine.collect import collect
from radarsim.errors import ConfigError, argument
from radarsim.language.translate import term, tr
from radarsim.report import atomic_files, csv_text
from radarsim.report import tables as common
from radarsim.report.drawing.model import Figure
from radarsim.report.quantities import Quantity
from radarsim.report.wording import significant_digits
from radarsim.studies import registry

if TYPE_CHECKING:
    import pandas as pd


CHANGE = 0.1
FOLDER = "sensitivity"
SPAN_TEXTS = {"worst": term("at its worst from {t_s:g} s on"), "mean": term("on average from {t_s:g} s on")}
LABELS = ("case", "filter", "component", "unit", "key", "value", "changed_value")


def columns(definitions: Sequence[Quantity]) -> tuple[str, ...]:
    """The columns of sensitivity.csv for these quantities."""
    return (
        *LABELS,
        *(name for definition in definitions for name in (_value_column(definition), *definition.changes)),
        "exact",
    )


def _value_column(definition: Quantity) -> str:
    return f"{definition.name}_percent" if definition.shown_unit() == "%" else definition.name


@dataclass(frozen=True, repr=False)
class Sensitivity(Displayable):
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
        """sensitivity.csv: every key, filter and component, by falling effect on the leading component."""
        return common.frame({name: [row[name] for row in self.rows] for name in columns(self.of)})

    @property
    def lowered(self) -> tuple[str, ...]:
        """The keys whose value is ten per cent lower, because the config refuses a higher one."""
        return tuple(dict.fromkeys(row["key"] for row in self.rows if abs(row["changed_value"]) < abs(row["value"])))

    @property
    def _figures_by_name(self) -> dict[str, Figure]:
        return {"tornado": tornado(self)} if self.rows else {}

    @property
    def title(self) -> str:
        """The quantity and the time."""
        subject = self.of[0].place(self.leading, tr) or tr(self.of[0].words)
        subject = " ".join(filter(None, (subject, self.at)))
        return tr("{stem}: change of {component} for +10 %", stem=self.stem, component=subject)

    def _answer_lines(self) -> list[str]:
        first, change, lines = self.of[0], self.of[0].changes[0], [self.title]
        for key in dict.fromkeys(row["key"] for row in self.rows):
            rows = [row for row in self.rows if row["key"] == key and row["component"] == self.leading]
            changes = (
                f"{significant_digits(row[change], '+.3g')} {tr(first.changed_unit)} ({row['filter']})" for row in rows
            )
            lines.append(f"{key}{LOWERED * (key in self.lowered)}: {', '.join(changes)}")
        return lines


def sensitivity(
    config: Config,
    *,
    wanted: str | None = None,
    at_s: float | None = None,
    at_k: int | None = None,
    of: str | None = None,
    component: str | None = None,
    case: str | None = None,
    overrides: configs.Overrides = (),
    realisations: float | None = None,
    seed: int | None = None,
    sampled: bool = False,
    out: str | os.PathLike[str] | None = None,
    figures: bool | str | Sequence[str] = True,
    width_mm: float | None = None,
    progress: Callable[[int, int, int], None] | None = None,
) -> Sensitivity:
    """Show what +10 % of each key changes in σ and gain, or in another quantity `of`; largest effect first.

    wanted says quantity, component and scans in one, as in `tune`: `"worst sigma r from 60 s"`. Otherwise taken at time
    at_s, s, or at scan at_k, counted from 1; default: the last scan. Rows are sorted by `component`, by default the
    first. `table` has a row for each key, filter and component: the value, in the component's unit or per cent, and its
    change, in per cent or points, with a 95 % interval if simulated, as all are if they are to be `sampled`. out:
    directory for table and figure. Raises ConfigError.

    >>> found = sensitivity("rls2", at_s=60)
    >>> first = found.table.iloc[0]
    >>> print(first["key"], first["filter"], first["component"], f"{first['sigma_change_percent']:.2f}")
    radar.detection_probability r r 34.40
    """
    checked = arguments.check_arguments(
        overrides, out=out, figures=figures, width_mm=width_mm, **scan_options(at_s, at_k)
    )
    cases, count = Cases(config, combine_overrides(checked, None, seed), case), arguments.whole_number(realisations)
    over: Over = "at"
    from_s = None
    if wanted is not None:
        if of is not None or component is not None:
            option = argument("of", "--of") if of is not None else argument("component", "--component")
            raise ConfigError(f"{option}: stands in {argument('wanted', '--for')} already: {wanted!r}")
        of, _, component, at_s, at_k, over, from_s, _ = quantities.parse_request(wanted, None, at_s, at_k)
        from_s = registry.counted_from_s(cases.base, component, over, from_s)
    definitions = _definitions(of, cases.base)
    study = registry.study(cases.base.study)
    axes = study.prepare(cases.base).axes
    is_planned, is_known, has_scans = quantities.is_planned(definitions[0]), False, True
    components = tuple(axes.components)
    if not is_planned:
        is_known, has_scans, components = _components(definitions[0], cases.base)
    leading = components[0][0] if component is None else component
    quantities.check_name(leading, [name for name, _ in components], definitions[0].per or "component")
    if study.exact_errors and is_planned and over == "at" and at_s is None and at_k is None:
        at_s = float(axes.t_s[-1])
    quantity = MeasuredQuantity(
        definitions[0], at_s=at_s, at_k=at_k, over=over, from_s=from_s, in_phrase=wanted is not None
    )
    sample = SensitivitySample(
        *(quantity, definitions, axes.filters, components, count or cases.base.realisations, is_known, sampled)
    )
    base = sample.case_values(cases.base)
    if not np.isfinite(base.all_realisations[0]).any():
        raise ConfigError("there is no estimate there")
    keys = [
        key
        for key in numeric_keys.numeric_keys(cases.base.spec)
        if key.value and not ("." not in key.path and key.is_whole)
    ]
    rows, left_out, unpaired_keys = _change_keys(sample, cases, base, keys, progress)
    effect = {key.path: key_effect(rows, key.path, leading, definitions[0].changes[0]) for key in keys}
    keys_without_effect = [
        path
        for path, (_, largest_effect) in effect.items()
        if largest_effect < ROUNDING_PERCENT and path not in left_out
    ]
    visible_rows = [row for row in rows if row["key"] not in keys_without_effect]
    visible_rows.sort(key=lambda row: effect[row["key"]], reverse=True)
    result = Sensitivity(
        stem=cases.stem,
        of=definitions,
        leading=leading,
        at=scan_text(quantity) if has_scans else "",
        rows=tuple(visible_rows),
        without_effect=tuple(keys_without_effect),
        without_estimate=tuple(
            name
            for f, (name, values) in enumerate(zip(axes.filters, base.all_realisations[0], strict=True))
            if not (np.isfinite(values).any() or (definitions[0].paired and f == axes.baseline))
        ),
        not_paired=tuple(unpaired_keys),
        left_out=left_out,
        labels={str(row["key"]): key_name(cases.base.spec, str(row["key"])) for row in visible_rows},
    )
    return result if out is None else write(result, out, arguments.figure_formats(figures), width_mm)


def _definitions(name: str | None, case: Case) -> tuple[Quantity, ...]:
    """The quantity of this name; by default those with exact values in the plan, or else the first of the study."""
    if name is not None:
        return (registry.quantity(name, case),)
    declared = registry.quantities(case.study, case.spec)
    return tuple(definition for definition in declared if quantities.is_planned(definition)) or declared[:1]


def _change_keys(
    sample: "SensitivitySample",
    cases: Cases,
    base: "QuantityArrays",
    keys: Sequence[numeric_keys.NumericKey],
    progress: Callable[[int, int, int], None] | None,
) -> tuple[list[dict[Hashable, Any]], dict[str, str], list[str]]:
    """The rows of all keys; the keys that cannot be changed, with the reason; and those that change the scan times."""
    rows, left_out, unpaired_keys = list[dict[Hashable, Any]](), dict[str, str](), list[str]()
    for n, key in enumerate(keys):
        try:
            value, case = changed_case(cases, key)
            base_values, changed_values = sample.paired_values(cases.base, base, case)
            rows += sample.rows(cases.base, key, value, base_values, changed_values)
            unpaired_keys += [key.path] if base_values is not base else []
        except ConfigError as error:
            left_out[key.path] = error.lines[0].removeprefix(f"{key.path}: ")
        if progress is not None:
            progress(n + 1, len(keys), 0)
    return rows, left_out, unpaired_keys


def _components(definition: Quantity, case: Case) -> tuple[bool, bool, tuple[tuple[str, str], ...]]:
    """Whether a quantity's table gives values without intervals, and whether it has scans; and the components with
    their units, or the values of the other column that distinguishes the rows of a filter."""
    work = CaseWork(case)
    table = quantities.quantity_table(definition, case_result(case, work, collect(work, 1)))
    facts = definition.ends[0] not in table, "k" in table
    if not definition.per:
        return *facts, (("", definition.shown_unit()),)
    units = table["unit"] if "unit" in table else [definition.shown_unit()] * len(table)
    return *facts, tuple(dict(zip(table[definition.per].astype(str), units, strict=True)).items())


TARGET = "target"  # its keys have names that other keys have too, such as a duration or a range


def key_name(spec: StudyKeys, path: str) -> Label:
    """The name of a key: with the filter for a key of a filter, with "target" for a key of the target, with the
    number for an item of a list."""
    key_label = label(spec, path)
    text, steps = tr(key_label.text), path.split(".")
    if steps[-1].isdecimal():
        text = f"{text} {int(steps[-1]) + 1}"
    if steps[0] == spec.bare_keys:
        text = f"{spec.members[int(steps[1])].name}: {text}"
    elif steps[0] == TARGET:
        text = f"{tr(label(spec, TARGET).text)}: {text}"
    return key_label._replace(text=text)


def changed_case(cases: Cases, key: numeric_keys.NumericKey) -> tuple[float, Case]:
    """A key's value changed by ten per cent, and the case with it: larger, or smaller if the config refuses that.
    Whole numbers change by at least one. Raises ConfigError, with the reason against the larger value, if both fail."""
    assert key.value is not None
    step = max(1, round(CHANGE * key.value)) if key.is_whole else CHANGE * key.value
    try:
        return key.value + step, cases.case_with_value(key.path, key.value + step)
    except ConfigError:
        with contextlib.suppress(ConfigError):
            return key.value - step, cases.case_with_value(key.path, key.value - step)
        raise


def scan_text(quantity: MeasuredQuantity) -> str:
    """The time or scan, in words."""
    if quantity.over == "long run":
        return tr("in the long run")
    if quantity.is_over_scans:
        return tr(SPAN_TEXTS[quantity.over], t_s=quantity.from_s or 0.0)
    if quantity.at_k is not None:
        return tr("at k = {k}", k=str(quantity.at_k))
    return tr("at the last scan") if quantity.at_s is None else tr("at {t_s:g} s", t_s=quantity.at_s)


class QuantityArrays(NamedTuple):
    """Q quantities of F filters and C components at one time.

    all_realisations (Q, F, C); without_batch (Q, n, F, C): without each of n batches, n = 1 where exact. NaN where
    there is no estimate. scan: the place at which they are read, as `Objective.scan_read` gives it."""

    all_realisations: np.ndarray
    without_batch: np.ndarray
    scan: Scan

    @property
    def exact(self) -> bool:
        return self.without_batch.shape[1] == 1


@dataclass(frozen=True)
class SensitivitySample:
    """Values of a case for every filter and component, exact or in batches of realisations; is_known: whether the
    tables give values without intervals; sampled: simulate, whatever is known."""

    quantity: MeasuredQuantity
    definitions: tuple[Quantity, ...]
    filters: tuple[str, ...]
    components: tuple[tuple[str, str], ...]
    realisations: int
    is_known: bool
    sampled: bool

    @property
    def shape(self) -> tuple[int, int, int]:
        """Q, F and C."""
        return len(self.definitions), len(self.filters), len(self.components)

    @cached_property
    def objective(self) -> Objective:
        """Every quantity of every filter and component, one after the other."""
        names = itertools.product(self.definitions, self.filters, (name or None for name, _ in self.components))
        return Objective(
            [replace(self.quantity, definition=d, filter=f, component=component) for d, f, component in names]
        )

    def paired_values(self, case: Case, base: QuantityArrays, changed: Case) -> tuple[QuantityArrays, QuantityArrays]:
        """Values of a case, `base` with the usual realisations, and of a changed one. Raises ConfigError.

        If both are sampled and read at different scans, both are computed with more realisations: the noise is not
        common then, so the interval of the change is that of two independent runs."""
        changed_values = self.case_values(changed)
        if base.exact or have_common_noise((base.scan, changed_values.scan)):
            return base, changed_values
        longer = replace(self, realisations=UNPAIRED_FACTOR * self.realisations)
        return longer.case_values(case), longer.case_values(changed)

    def case_values(self, case: Case) -> QuantityArrays:
        """Values of a case. Raises ConfigError."""
        axes = self.objective.labels(case)
        values = self.objective.exact_values(case, axes).reshape(self.shape)
        # With only some filters' values, the others would seem to change nothing. A baseline has no gain.
        has_value = np.isfinite(values[0]).any(axis=1)
        has_value[[axes.baseline] if self.definitions[0].paired else []] = True
        is_exact = self.is_known or has_value.all()
        if self.sampled or not is_exact:
            batches = self.objective.batch_values(case, self.realisations).reshape(-1, *self.shape)
            values, without_batch = batches[0], np.moveaxis(batches[1:], 0, 1)
        else:
            without_batch = values[:, None]
        return QuantityArrays(values, without_batch, self.objective.scan_read(axes))

    def rows(
        self, case: Case, key: numeric_keys.NumericKey, value: float, base: QuantityArrays, changed: QuantityArrays
    ) -> list[dict[Hashable, Any]]:
        """A row for each filter and component that has an estimate, with the changes from base to that of a value."""
        changes = [
            (
                _change(definition, base.all_realisations[q], changed.all_realisations[q]),
                _change(definition, base.without_batch[q], changed.without_batch[q]),
            )
            for q, definition in enumerate(self.definitions)
        ]
        rows: list[dict[Hashable, Any]] = []
        for f, c in np.ndindex(self.shape[1:]):
            if not np.isfinite(changes[0][0][f, c]):
                continue
            component, unit = self.components[c]
            values = [case.name, self.filters[f], component, unit, key.path, key.value, value]
            for q, (definition, (change, batch_changes)) in enumerate(zip(self.definitions, changes, strict=True)):
                ends = jackknife_interval(batch_changes[:, f, c], float(change[f, c]))
                values += [
                    base.all_realisations[q, f, c],
                    *(100 * math.expm1(end) if definition.kind == "size" else end for end in ends),
                ]
            rows.append(dict(zip(columns(self.definitions), [*values, base.exact and changed.exact], strict=True)))
        return rows


def _change(definition: Quantity, before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """The change of a quantity's values; for a size, the change of its logarithm."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.log(after / before) if definition.kind == "size" else after - before


def write(
    result: Sensitivity, out: str | os.PathLike[str], formats: Sequence[str], width_mm: float | None = None
) -> Sensitivity:
    """Add the files: sensitivity.csv and the tornado figure, in `out`/sensitivity/CONFIG.

    width_mm overrides the figure's width."""
    arguments.check_directory(out)
    contents = {"sensitivity.csv": csv_text.to_csv(result.table)}
    if formats and result.rows:
        from radarsim.report.drawing import canvas  # Matplotlib

        saved = canvas.save(tornado(result), formats, width_mm)
        contents |= {f"tornado.{kind}": data for kind, data in saved.items()}
    folder = Path(out) / FOLDER / result.stem
    atomic_files.replace_all(folder, contents)
    return replace(result, files=tuple(str(folder / name) for name in contents))

"""A quantity of a case at one scan, over several, or in the long run: its name, its words, and its value in a table.

Tables are read by column names that all studies share: any study with a table `locks` has the quantity lock."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from radarsim.config.experiment import Case
from radarsim.config.find_files import did_you_mean
from radarsim.config.quantity_phrase import OVER_SCANS, Over, PhraseError, is_counted, parse_phrase
from radarsim.engine.results import Axes, CaseResult
from radarsim.errors import ConfigError, argument
from radarsim.language.translate import term, tr
from radarsim.report.quantities import Quantity
from radarsim.report.statistics import Estimate
from radarsim.studies import registry

if TYPE_CHECKING:
    import pandas as pd


UNKNOWN_ESTIMATE = Estimate(np.nan, np.nan, np.nan)
OVER_TEXTS = {  # by what is taken, and whether a time is given
    ("worst", True): term("worst {what} from {t_s:g} s on"),
    ("worst", False): term("worst {what}"),
    ("mean", True): term("mean {what} from {t_s:g} s on"),
    ("mean", False): term("mean {what}"),
}
SETTLED_AT = term("{what} (settled; with the keys as stated at {t_s:g} s)")


class QuantityName(NamedTuple):
    """A quantity as a user names it: the names of the quantity, of the filter and of the component.

    A quantity over scans is taken at time at_s, linear between two scans, or at scan at_k; by default at the last. over
    and from_s: as in `QuantityPhrase`; in_phrase: whether a phrase says it all, and no option."""

    name: str
    filter: str | None = None
    component: str | None = None
    at_s: float | None = None
    at_k: int | None = None
    over: Over = "at"
    from_s: float | None = None
    in_phrase: bool = False


def parse_quantity(text: str, filter_name: str | None) -> QuantityName:
    """The quantity named by a phrase such as `sigma r at 60 s`. Raises ConfigError."""
    try:
        phrase = parse_phrase(text)
    except PhraseError as error:
        raise ConfigError(f"{argument('wanted', '--for')}: {error}") from None
    return QuantityName(filter=filter_name, in_phrase=True, **phrase._asdict())


@dataclass(frozen=True)
class MeasuredQuantity:
    """A quantity that a case measures; settled_s: the time, s, of a long run at which its filters have settled, where
    it is no limit; the other fields are those of `QuantityName`."""

    definition: Quantity
    filter: str | None = None
    component: str | None = None
    at_s: float | None = None
    at_k: int | None = None
    over: Over = "at"
    from_s: float | None = None
    in_phrase: bool = False
    settled_s: float | None = None

    @property
    def is_over_scans(self) -> bool:
        """Whether it is the worst or the mean of several scans."""
        return self.over in OVER_SCANS

    @property
    def time_option(self) -> str:
        """The argument that says its scan."""
        if self.in_phrase:
            return argument("wanted", "--for")
        return argument("at_s", "--at") if self.at_k is None else argument("at_k", "--at-k")

    @property
    def words(self) -> str:
        """`gain of r+Vr in r at 60 s`."""
        component_words = f" in {self.definition.place(self.component)}" if self.component else ""
        time_words = f" at {self.at_s:g} s" if self.at_s is not None else ""
        time_words = f" at k = {self.at_k}" if self.at_k is not None else time_words
        time_words = f" from {self.from_s:g} s on" if self.from_s else time_words
        time_words = " in the long run" if self.over == "long run" else time_words
        over_words = f"{self.over} " if self.is_over_scans else ""
        return f"{over_words}{self.definition.words} of {self.filter}{component_words}{time_words}"

    @property
    def translated_words(self) -> str:
        """The quantity, filter and time as `words` gives them, in the current language."""
        fields = {"kind": term(self.definition.words), "filter": self.filter}
        fields["component"] = self.definition.place(self.component or "", tr)
        subject = (
            tr("{kind} of {filter} in {component}", **fields) if self.component else tr("{kind} of {filter}", **fields)
        )
        if self.is_over_scans:
            return tr(OVER_TEXTS[self.over, bool(self.from_s)], what=subject, t_s=self.from_s or 0.0)
        if self.over == "long run":
            text = tr("{what} in the long run", what=subject)
            return text if self.settled_s is None else tr(SETTLED_AT, what=text, t_s=self.settled_s)
        if self.at_k is not None:
            return tr("{what} at k = {k}", what=subject, k=str(self.at_k))
        return subject if self.at_s is None else tr("{what} at {t_s:g} s", what=subject, t_s=self.at_s)


class Series(NamedTuple):
    """A quantity over scans k (n,) at times t_s (n,): value and interval (n,). Without scans n = 1 and k is zero."""

    k: np.ndarray
    t_s: np.ndarray
    values: Estimate


def parse_request(text: str, filter_name: str | None, at_s: float | None, at_k: int | None) -> QuantityName:
    """The quantity named by a phrase beside options for the time, of which one may say it. Raises ConfigError."""
    request = parse_quantity(text, filter_name)
    if (at_s, at_k) == (None, None):
        return request
    if (request.over, request.at_s, request.at_k) != ("at", None, None):
        option = argument("at_s", "--at") if at_k is None else argument("at_k", "--at-k")
        raise ConfigError(f"{option}: the time stands in {argument('wanted', '--for')} already: {text!r}")
    return request._replace(at_s=at_s, at_k=at_k, in_phrase=False)


def check_quantity(request: QuantityName, case: Case, user_filters: Sequence[str] = ()) -> MeasuredQuantity:
    """Check a request before anything is prepared. Raises ConfigError for an unknown quantity or filter.

    user_filters: names of the config's filters that are written in Python; the case does not hold them."""
    name, filter_name, component, at_s, at_k, over, from_s, in_phrase = request
    definition = registry.quantity(name, case)
    if not definition.per:
        if filter_name is not None and component is not None:
            raise ConfigError(
                f"{argument(definition.name, definition.option)} names the filter itself: "
                f"leave {argument('filter')} out"
            )
        filter_name, component = component if filter_name is None else filter_name, None
    if filter_name is not None:
        filter_names = [member.name for member in case.spec.members]
        if filter_name in user_filters:
            raise ConfigError(
                f"filter {filter_name!r} is written in Python: radarsim does not know its keys, "
                f"only those of {', '.join(filter_names)}"
            )
        check_name(filter_name, filter_names)
    from_s = registry.counted_from_s(case, component, over, from_s)
    return MeasuredQuantity(definition, filter_name, component, at_s, at_k, over, from_s, in_phrase)


def check_name(name: str, names: Sequence[str], item: str = "filter") -> None:
    """Raise ConfigError unless a filter, or another kind of item, has this name."""
    if name not in names:
        suggestion = did_you_mean(name, names) or f"; there are: {', '.join(names)}"
        raise ConfigError(f"no {item} {name!r}{suggestion}")


def resolve_scan(quantity: MeasuredQuantity, axes: Axes) -> MeasuredQuantity:
    """Fill in the filter of a quantity if there is only one. Raises ConfigError for unknown names."""
    filter_names, filter_name = list(axes.filters), quantity.filter
    is_planned_gain = quantity.definition.paired and is_planned(quantity.definition)
    if filter_name is None:
        candidates = [name for i, name in enumerate(filter_names) if not is_planned_gain or i != axes.baseline]
        if len(candidates) != 1:
            raise ConfigError(f"{argument('filter')}: name one of {', '.join(filter_names)}")
        filter_name = candidates[0]
    check_name(filter_name, filter_names)
    if is_planned_gain and filter_name == filter_names[axes.baseline]:
        words = quantity.definition.words
        raise ConfigError(
            f"filter {filter_name!r} is the baseline, against which {words}s are: its {words} is 0 % at any value"
        )
    if not is_planned(quantity.definition):
        return replace(quantity, filter=filter_name)
    return with_component(replace(quantity, filter=filter_name), [name for name, _ in axes.components])


def with_component(quantity: MeasuredQuantity, components: Sequence[str]) -> MeasuredQuantity:
    """The quantity with its component, which may be left out where there is one. Raises ConfigError for another."""
    definition = quantity.definition
    if not definition.per or quantity.component is not None:
        check_name(quantity.component or "", components, definition.per)
        return quantity
    if len(components) > 1:
        raise ConfigError(
            f"{argument('wanted', '--for')}: {definition.words} is of a {definition.per}: name one, such as "
            f"{definition.name} {components[0]}; there are: {', '.join(components)}"
        )
    return replace(quantity, component=components[0])


def unit(quantity: MeasuredQuantity, axes: Axes) -> str:
    """The unit of a quantity."""
    from radarsim.report import wording

    return wording.unit(quantity.definition.shown_unit(dict(axes.components).get(str(quantity.component), "")))


PLANNED = {("curves", "sigma"): "exact_sigma", ("gains", "gain_percent"): "exact_gains"}  # by table and column


def is_planned(definition: Quantity) -> bool:
    """Whether a plan holds exact values of a quantity: σ and gain of the common tables."""
    return (definition.table, definition.value) in PLANNED


def quantity_table(definition: Quantity, result: CaseResult) -> "pd.DataFrame":
    """The table of a case that holds a quantity. Raises ConfigError where the study has none."""
    table = registry.study(result.study).table(definition.table, [result], definition.value)
    if table is None:
        raise ConfigError(f"{result.name}: no {definition.words}: study {result.study} makes no {definition.table}.csv")
    return table


def series_by_filter(
    definition: Quantity, table: "pd.DataFrame", exact_only: bool = False
) -> dict[tuple[str, str], Series]:
    """A quantity, or its exact values, over the scans of its table, by filter and component (empty if it has none)."""
    values, exact_values = definition.read(table)
    estimate = Estimate(exact_values, exact_values, exact_values) if exact_only else values
    row_count = len(table)
    k = table["k"].to_numpy() if "k" in table else np.zeros(row_count, dtype=int)
    t_s = table["t_s"].to_numpy(dtype=float) if "t_s" in table else np.zeros(row_count)
    components = table[definition.per] if definition.per else np.full(row_count, "", dtype=object)
    groups: Any = table.groupby([table["filter"], components], sort=False).indices.items()
    return {
        (name, str(component)): Series(
            k[rows], t_s[rows], Estimate(*(definition.scale * column[rows] for column in estimate))
        )
        for (name, component), rows in groups
    }


def interval_note(quantity: MeasuredQuantity, result: CaseResult) -> str:
    """The note that tables put on an interval without an exact value: why it is too narrow, or empty."""
    from radarsim.report import interval_notes

    study, table_name = registry.study(result.study), quantity.definition.table
    tables = {"curves": study.curves([result]), table_name: quantity_table(quantity.definition, result)}
    declared_quantities = [
        declared
        for declared in registry.quantities(result.study, result.spec)
        if declared.table not in tables or declared.value in tables[declared.table]
    ]
    table = interval_notes.add_notes(tables, [result], exact=False, quantities=declared_quantities)[table_name]
    if "note" not in table:
        return ""
    rows = table[table["filter"] == quantity.filter]
    if quantity.component is not None:
        rows = rows[rows[quantity.definition.per].astype(str) == quantity.component]
    if quantity.is_over_scans and "t_s" in rows:
        rows = rows[is_counted(rows["t_s"], quantity.from_s)]
        return next(filter(None, rows["note"]), "")
    if quantity.at_k is not None:
        rows = rows[rows["k"] == quantity.at_k]
    elif quantity.at_s is not None and "t_s" in rows:
        t_s = rows["t_s"].to_numpy(dtype=float)
        rows = rows[(t_s <= quantity.at_s) | (np.arange(len(t_s)) <= np.searchsorted(t_s, quantity.at_s))]
    return str(rows["note"].iloc[-1]) if len(rows) else ""


def estimate_at(quantity: MeasuredQuantity, series: Series) -> Estimate:
    """The series at the requested time or scan: NaN where there is no estimate. Raises ConfigError for a time or scan
    beyond the run."""
    k, t_s, values = series
    if not len(k):
        return UNKNOWN_ESTIMATE
    if not k.any() and quantity.over != "at":
        raise ConfigError(
            f"{argument('wanted', '--for')}: the {quantity.definition.words} has one value, not one a scan: "
            f"leave {quantity.over!r} out"
        )
    if not k.any() and (quantity.at_s, quantity.at_k) != (None, None):
        raise ConfigError(
            f"{quantity.time_option}: the {quantity.definition.words} has one value, not one a scan: leave the time out"
        )
    if quantity.is_over_scans:
        return _over_scans(quantity, series)
    if quantity.at_k is not None:
        if quantity.at_k > k[-1] or quantity.at_k < 1:
            raise ConfigError(f"{quantity.time_option}: must be from 1 to {k[-1]}, the last scan, got {quantity.at_k}")
        matches = np.flatnonzero(k == quantity.at_k)
        return Estimate(*(float(column[matches[0]]) for column in values)) if len(matches) else UNKNOWN_ESTIMATE
    if quantity.at_s is None:
        return Estimate(*(float(column[-1]) for column in values))
    if not 0 <= quantity.at_s <= t_s[-1] * (1 + 1e-12):
        raise ConfigError(
            f"{quantity.time_option}: must be from 0 to {t_s[-1]:g} s, the last scan's time, got {quantity.at_s:g}"
        )
    if quantity.at_s < t_s[0] - 1e-9 * t_s[-1]:
        return UNKNOWN_ESTIMATE
    matches_of_time = np.flatnonzero(np.isclose(t_s, quantity.at_s, rtol=1e-12, atol=0))
    if len(matches_of_time):
        return Estimate(*(float(column[matches_of_time[0]]) for column in values))
    return Estimate(*(float(np.interp(quantity.at_s, t_s, column)) for column in values))


def _over_scans(quantity: MeasuredQuantity, series: Series) -> Estimate:
    """The worst or the mean of a series over the scans that count; of a mean the ends are means too, as if all erred
    together. Raises ConfigError for a time beyond the run."""
    from_s = quantity.from_s or 0.0
    if not 0 <= from_s <= series.t_s[-1] * (1 + 1e-12):
        raise ConfigError(
            f"{argument('wanted', '--for')}: from must be from 0 to {series.t_s[-1]:g} s, the last scan's time, "
            f"got {from_s:g}"
        )
    counted = np.flatnonzero(is_counted(series.t_s, from_s) & ~np.isnan(series.values.value))
    if not len(counted):
        return UNKNOWN_ESTIMATE
    columns = [np.asarray(column, dtype=float)[counted] for column in series.values]
    if quantity.over == "mean":
        return Estimate(*(float(column.mean()) for column in columns))
    worst = int(columns[0].argmin() if quantity.definition.more_is_better else columns[0].argmax())
    return Estimate(*(float(column[worst]) for column in columns))

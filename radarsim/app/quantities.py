"""One number that a case is asked for: a gain, a σ, a rate of locks; exact where that is known, else sampled.

Exact numbers come from the plan of a case, without a realisation. Sampled ones are read from the tables by the names
that these have in every study: whatever study makes a table `locks` can be asked for its locks.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from radarsim.config.experiment import Case
from radarsim.config.lookup import did_you_mean
from radarsim.engine.results import Axes, CaseResult
from radarsim.errors import ConfigError
from radarsim.language import term, tr
from radarsim.report.statistics import Estimate
from radarsim.studies import registry

if TYPE_CHECKING:
    import pandas as pd

UNKNOWN = Estimate(np.nan, np.nan, np.nan)
UNPAIRED = 4  # times the realisations where a change moves the scans, so that the noise compared is of other scans


class Kind(NamedTuple):
    """A kind of quantity: where it is read, in which unit, and which way is better.

    columns: the value's in its table, both ends' of its interval, and, if the table has one, its exact value's. scale
    turns the table's numbers into `unit` (empty: that of the component).
    """

    words: str
    table: str
    columns: tuple[str, str, str, str]
    unit: str
    scale: float
    more_is_better: bool


GAIN_COLUMNS = ("gain_percent", "gain_lo", "gain_hi", "exact_percent")
SIGMA_COLUMNS = ("sigma", "sigma_lo", "sigma_hi", "exact_sigma")
KINDS = {
    "gain": Kind("gain", "gains", GAIN_COLUMNS, "%", 1.0, True),
    "sigma": Kind("σ", "curves", SIGMA_COLUMNS, "", 1.0, False),
    "lock": Kind("lock rate", "locks", ("lock_rate", "lock_lo", "lock_hi", "exact_lock_rate"), "%", 100.0, True),
    "right": Kind("right folds", "folds", ("right", "right_lo", "right_hi", "exact_right"), "%", 100.0, True),
    "loss": Kind("ends of a track an hour", "tracking", ("ends_per_hour", "ends_lo", "ends_hi", ""), "/h", 1.0, False),
    "false_tracks": Kind(
        *("false tracks an hour", "tracking", ("false_tracks_per_hour", "false_lo", "false_hi", "")),
        *("/h", 1.0, False),
    ),
}


SAID = (  # the kinds, their units, and which units keys have
    *(term("gain"), term("lock rate"), term("right folds"), term("ends of a track an hour"), term("/h")),
    *(term("false tracks an hour"), term("σ")),
)


@dataclass(frozen=True)
class Quantity:
    """What is asked for: a kind of `KINDS`, of a filter, for gain and sigma of a component.

    Where it has a course over scans: at a time at_s, linear between two scans, or at scan at_k; neither: at the last.
    """

    kind: str
    filter: str | None = None
    component: str | None = None
    at_s: float | None = None
    at_k: int | None = None

    @property
    def of(self) -> Kind:
        return KINDS[self.kind]

    @property
    def words(self) -> str:
        """`gain of r+Vr in r at 60 s`."""
        component = f" in {self.component}" if self.component else ""
        at = f" at {self.at_s:g} s" if self.at_s is not None else ""
        at = f" at k = {self.at_k}" if self.at_k is not None else at
        return f"{self.of.words} of {self.filter}{component}{at}"

    @property
    def said(self) -> str:
        """The same in the language spoken."""
        told = {"kind": term(self.of.words), "filter": self.filter, "component": self.component or ""}
        what = tr("{kind} of {filter} in {component}", **told) if self.component else tr("{kind} of {filter}", **told)
        if self.at_k is not None:
            return tr("{what} at k = {k}", what=what, k=str(self.at_k))
        return what if self.at_s is None else tr("{what} at {t_s:g} s", what=what, t_s=self.at_s)


class Series(NamedTuple):
    """A quantity over scans k (n,) at times t_s (n,): value and interval (n,). Without scans n = 1 and k is zero."""

    k: np.ndarray
    t_s: np.ndarray
    values: Estimate


def checked(quantity: Quantity, case: Case) -> None:
    """ConfigError for a filter or a rate that a case has not, before anything is prepared."""
    known = registry.study(case.study).rates(case.spec)
    if quantity.kind not in ("gain", "sigma") and known is not None and quantity.of.table not in known:
        raise none_made(quantity, case.name, case.study)
    if quantity.filter is not None:
        named(quantity.filter, [member.name for member in case.spec.members])


def named(name: str, names: Sequence[str]) -> None:
    """ConfigError unless one of the filters has this name."""
    if name not in names:
        near = did_you_mean(name, names) or f"; there are: {', '.join(names)}"
        raise ConfigError(f"no filter {name!r}{near}")


def none_made(quantity: Quantity, name: str, study: str) -> ConfigError:
    """That the study of a case makes no table of the quantity's kind."""
    what, table = quantity.of.words, quantity.of.table
    return ConfigError(f"{name}: study {study} knows no {what}: it makes no {table}.csv")


def resolved(quantity: Quantity, axes: Axes) -> Quantity:
    """The quantity with its filter, found where there is but one. ConfigError for names that the case has not."""
    names, chosen = list(axes.filters), quantity.filter
    if chosen is None:
        others = [name for i, name in enumerate(names) if quantity.kind != "gain" or i != axes.baseline]
        if len(others) != 1:
            raise ConfigError(f"--filter: name one of {', '.join(names)}")
        chosen = others[0]
    named(chosen, names)
    if quantity.kind == "gain" and chosen == names[axes.baseline]:
        raise ConfigError(f"filter {chosen!r} is the baseline, against which gains are: its gain is 0 % at any value")
    components = [name for name, _ in axes.components]
    if quantity.component is not None and quantity.component not in components:
        near = did_you_mean(quantity.component, components) or f"; there are: {', '.join(components)}"
        raise ConfigError(f"no component {quantity.component!r}{near}")
    return replace(quantity, filter=chosen)


def unit(quantity: Quantity, axes: Axes) -> str:
    """The unit in which a quantity is given."""
    from radarsim.report import text

    return quantity.of.unit or text.unit(dict(axes.components)[str(quantity.component)])


def shortened(quantity: Quantity, case: Case) -> Case:
    """The case as far as a quantity asks for it. Raises ConfigError where the whole case cannot be."""
    return registry.study(case.study).shortened(case, quantity.at_s, quantity.at_k)


def labels(quantity: Quantity, case: Case) -> Axes:
    """The labels of a case's plan, with the exact errors as far as a quantity asks for them. Raises ConfigError."""
    return registry.study(case.study).prepare(shortened(quantity, case)).axes


def exact(quantity: Quantity, case: Case, axes: Axes) -> float:
    """The exact value from the labels of a case's plan; not-a-number where none is known without sampling."""
    if quantity.kind not in ("gain", "sigma") or not registry.study(case.study).exact_errors:
        return np.nan
    f = axes.filters.index(str(quantity.filter))
    c = [name for name, _ in axes.components].index(str(quantity.component))
    there = axes.available[f, :, c]
    if quantity.kind == "gain":
        there = there & axes.available[axes.baseline, :, c]
    known = np.asarray(axes.exact_gains if quantity.kind == "gain" else axes.exact_sigma, dtype=float)
    value = np.where(there, known[f, :, c], np.nan)
    k, t_s = np.asarray(axes.k), np.asarray(axes.t_s, dtype=float)
    return float(at(quantity, Series(k, t_s, Estimate(value, value, value))).value)


def sampled(quantity: Quantity, result: CaseResult) -> tuple[Estimate, float]:
    """Value and 95 % interval from a case's tables, and its exact value where the table has one, else not-a-number."""
    rows = _rows(quantity, result)
    if not len(rows):
        return UNKNOWN, np.nan
    *columns, known = quantity.of.columns
    scale = quantity.of.scale
    values = [scale * rows[name].to_numpy(dtype=float) for name in columns]
    exactly = scale * rows[known].to_numpy(dtype=float) if known in rows else np.full(len(rows), np.nan)
    k = rows["k"].to_numpy() if "k" in rows else np.zeros(len(rows), dtype=int)
    t_s = rows["t_s"].to_numpy(dtype=float) if "t_s" in rows else np.zeros(len(rows))
    return (
        at(quantity, Series(k, t_s, Estimate(*values))),
        float(at(quantity, Series(k, t_s, Estimate(exactly, exactly, exactly))).value),
    )


def noted(quantity: Quantity, result: CaseResult) -> str:
    """What the tables would note of the interval there, no exact value beside it: why it is too narrow, or nothing."""
    from radarsim.report import notes

    study, name = registry.study(result.study), quantity.of.table
    made = {"curves": study.curves([result]), "gains": study.gains([result])} | study.tables([result])
    table = notes.noted({key: made[key] for key in {"curves", name}}, [result], exact=False)[name]
    if "note" not in table:
        return ""
    rows = table[table["filter"] == quantity.filter]
    if quantity.component is not None:
        rows = rows[rows["component"] == quantity.component]
    if quantity.at_k is not None:
        rows = rows[rows["k"] == quantity.at_k]
    elif quantity.at_s is not None and "t_s" in rows:
        t_s = rows["t_s"].to_numpy(dtype=float)
        rows = rows[(t_s <= quantity.at_s) | (np.arange(len(t_s)) <= np.searchsorted(t_s, quantity.at_s))]
    return str(rows["note"].iloc[-1]) if len(rows) else ""


def scan(quantity: Quantity, axes: Axes) -> int:
    """The scan that a quantity at a time is read at, or the later of two; 0 where it is asked for by its number."""
    k, t_s = np.asarray(axes.k), np.asarray(axes.t_s, dtype=float)
    if quantity.at_k is not None or not len(k):
        return 0
    last = len(k) - 1
    return int(k[last if quantity.at_s is None else min(int(np.searchsorted(t_s, quantity.at_s * (1 - 1e-12))), last)])


def courses(kind: str, table: "pd.DataFrame") -> dict[tuple[str, str], Series]:
    """The values of every filter and component from a table of a kind that is at hand, without their intervals."""
    value, k, t_s = (table[name].to_numpy(dtype=float) for name in (KINDS[kind].columns[0], "k", "t_s"))
    rows: Any = table.groupby(["filter", "component"], sort=False).indices.items()
    return {cell: Series(k[at], t_s[at], Estimate(*[value[at]] * 3)) for cell, at in rows}


def _rows(quantity: Quantity, result: CaseResult) -> "pd.DataFrame":
    """The rows of the quantity's table that are of its filter and component; of a table without scans one row.

    Raises ConfigError where the study makes no such table.
    """
    study, name = registry.study(result.study), quantity.of.table
    table: Any
    if name in ("curves", "gains"):
        table = study.gains([result]) if name == "gains" else study.curves([result])
    else:
        table = study.tables([result]).get(name)
    if table is None:
        raise none_made(quantity, result.name, result.study)
    table = table[table["filter"] == quantity.filter]
    if quantity.component is not None:
        table = table[table["component"] == quantity.component]
    return table


def at(quantity: Quantity, series: Series) -> Estimate:
    """The series at the time or scan that is asked for: not-a-number where there is no estimate.

    Raises ConfigError for a time or scan beyond the run.
    """
    k, t_s, values = series
    if not len(k):
        return UNKNOWN
    if quantity.at_k is not None:
        if quantity.at_k > k[-1] or quantity.at_k < 1:
            raise ConfigError(f"--at-k: must be from 1 to {k[-1]}, the last scan, got {quantity.at_k}")
        found = np.flatnonzero(k == quantity.at_k)
        return Estimate(*(float(part[found[0]]) for part in values)) if len(found) else UNKNOWN
    if quantity.at_s is None or not k.any():
        return Estimate(*(float(part[-1]) for part in values))
    if not 0 <= quantity.at_s <= t_s[-1] * (1 + 1e-12):
        raise ConfigError(f"--at: must be from 0 to {t_s[-1]:g} s, the last scan's time, got {quantity.at_s:g}")
    if quantity.at_s < t_s[0] - 1e-9 * t_s[-1]:
        return UNKNOWN
    exactly = np.flatnonzero(np.isclose(t_s, quantity.at_s, rtol=1e-12, atol=0))
    if len(exactly):
        return Estimate(*(float(part[exactly[0]]) for part in values))
    return Estimate(*(float(np.interp(quantity.at_s, t_s, part)) for part in values))

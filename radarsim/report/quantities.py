"""The quantities of a study: the components of its errors, and each quantity of them, declared once.

The options of `radarsim solve`, the values of `--of` in `run --precision` and in `sensitivity`, the quantities in
`compare`, their words, units and axes all follow from a declaration. `Study.quantities` gives those of a study.
Declared here are those of several studies."""

import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal, NamedTuple

from radarsim.errors import ConfigError
from radarsim.language.translate import term

if TYPE_CHECKING:
    import numpy as np
    import pandas as pd

    from radarsim.report.statistics import Estimate

Kind = Literal["size", "share", "signed"]
COMMON_OPTIONS = "at", "at-k", "between", "case", "equals", "filter", "help", "json", "language", "no-code"
RESERVED_OPTIONS = frozenset(
    f"--{name}" for name in (*COMMON_OPTIONS, "for", "realisations", "seed", "set", "threads")
)  # options of `solve`


class Component(NamedTuple):
    """A component of the errors: its name in tables, its unit, its letter (mathematical text), its name in words."""

    name: str
    unit: str
    symbol: str = ""
    words: str = ""


RADIAL = (
    Component("r", "m", "$r$", term("range")),
    Component("Vr", "m/s", "$V_r$", term("radial velocity")),
    Component("ar", "m/s2", "$a_r$", term("radial acceleration")),
)


@dataclass(frozen=True)
class Quantity:
    """A number that a table of a study holds for each filter, with its 95 % interval or exactly.

    name: that of its option, `false_tracks` is `--false-tracks`. words: its name in sentences, a `term`. table: the
    stem of its file. column: that of its value, `x|y` where the ends of the interval are `y_lo` and `y_hi`, else they
    are `x_lo` and `x_hi`; in a table without these it is known exactly. exact: the column of exact values, by default
    `exact_x`; a table need not have it. per: the column that distinguishes several values of one filter (`component`,
    `model`), empty where each filter has one.

    kind: a `size` is positive, its changes and its precision are in per cent of it; a `share` lies from 0 to 1, is
    shown in per cent and changes by points, its precision is in per cent of it; a `signed` one has changes and
    precision in its own unit. unit: the column's; by default that of the component. axis: its axis label, with
    `{symbol}` for the component's letter; by default its words and that.

    last: its precision is that at the last scan or window of each filter. squares: it is made of squared errors, which
    rare large ones dominate. paired: it is a change of σ in per cent of that of another filter, which has none itself.
    is_complement: it is 1 minus the column."""

    name: str
    words: str
    table: str
    column: str
    exact: str = ""
    per: str = ""
    kind: Kind = "size"
    unit: str = ""
    more_is_better: bool = False
    axis: str = ""
    last: bool = False
    squares: bool = False
    paired: bool = False
    is_complement: bool = False

    def __post_init__(self) -> None:
        """Raises ConfigError for a name that is impossible as an option."""
        if not re.fullmatch("[a-z][a-z0-9_]*", self.name):
            raise ConfigError(f"quantity {self.name!r}: its name must be of small letters, digits and _")
        if self.option in RESERVED_OPTIONS:
            raise ConfigError(f"quantity {self.name!r}: {self.option} is another option of `radarsim solve`; rename it")

    @property
    def value(self) -> str:
        """The column of its value."""
        return self.column.partition("|")[0]

    @property
    def ends(self) -> tuple[str, str]:
        """The columns of the ends of its interval."""
        stem = self.column.rpartition("|")[2]
        return f"{stem}_lo", f"{stem}_hi"

    @property
    def exact_column(self) -> str:
        """The column of its exact value."""
        return self.exact or f"exact_{self.value}"

    @property
    def option(self) -> str:
        """The option that names it."""
        return f"--{self.name.replace('_', '-')}"

    @property
    def scale(self) -> float:
        """The factor of the column's numbers in text for people."""
        return 100.0 if self.kind == "share" else 1.0

    @property
    def half_width_unit(self) -> str:
        """The unit of half the width of its interval in a precision."""
        return "%" if self.kind != "signed" else "points" if self.unit == "%" else self.unit

    @property
    def changed_unit(self) -> str:
        """The unit of its changes."""
        return "%" if self.kind == "size" else "points" if self.shown_unit() == "%" else self.unit

    @property
    def changes(self) -> tuple[str, str, str]:
        """The columns of a change and of its interval's ends."""
        word = {"%": "_percent", "points": "_points"}.get(self.changed_unit, "")
        return f"{self.name}_change{word}", f"{self.name}_change_lo", f"{self.name}_change_hi"

    def shown_unit(self, of_component: str = "") -> str:
        """The unit in text for people, for a component with a unit."""
        return "%" if self.kind == "share" else self.unit or of_component

    def place(self, part: str, translate: Callable[[str], str] = str) -> str:
        """One of several values of a filter in sentences: `r`, `model 2`."""
        return part if self.per == "component" or not part else f"{translate(self.per)} {part}"

    def complement(self, name: str, words: str) -> "Quantity":
        """1 minus a share."""
        return replace(
            self, name=name, words=words, more_is_better=not self.more_is_better, is_complement=not self.is_complement
        )

    def read(self, rows: "pd.DataFrame") -> "tuple[Estimate, np.ndarray]":
        """Values with their intervals, and exact values (rows,) or NaN, from rows of its table. Raises ConfigError
        where that lacks a column."""
        import numpy as np

        from radarsim.report.statistics import Estimate

        if missing := [name for name in (self.value, self.per) if name and name not in rows and len(rows)]:
            raise ConfigError(f"quantity {self.name!r}: {self.table}.csv has no column {missing[0]!r}")
        names = [self.value, *self.ends, self.exact_column]
        value, lo, hi, exact = (
            rows[name].to_numpy(dtype=float) if name in rows else np.full(len(rows), np.nan) for name in names
        )
        if self.ends[0] not in rows:
            lo = hi = exact = value
        if self.is_complement:
            value, lo, hi, exact = 1 - value, 1 - hi, 1 - lo, 1 - exact
        return Estimate(value, lo, hi), exact


SIGMA = Quantity(
    *("sigma", term("σ"), "curves", "sigma"), per="component", axis=term("$\\sigma$ of {symbol}"), squares=True
)
GAIN = Quantity(
    *("gain", term("gain"), "gains", "gain_percent|gain", "exact_percent"),
    per="component",
    kind="signed",
    unit="%",
    more_is_better=True,
    axis=term("gain in $\\sigma$ of {symbol}"),
    squares=True,
    paired=True,
)
COMMON = (SIGMA, GAIN)
SMOOTHED_TERMS = {  # scans waited, and what σ is called then
    1: term("Cramér–Rao bound one scan later"),
    2: term("Cramér–Rao bound two scans later"),
    5: term("Cramér–Rao bound five scans later"),
    10: term("Cramér–Rao bound ten scans later"),
}
FLOOR = Quantity(
    "floor", term("Cramér–Rao bound on σ"), "floor", "floor", per="component"
)  # see `radarsim.studies.floors`
FLOORS = (
    FLOOR,
    *(Quantity(f"lag_{lag}", words, "floor", f"lag_{lag}", per="component") for lag, words in SMOOTHED_TERMS.items()),
    Quantity("smoothed", term("Cramér–Rao bound after the last scan"), "floor", "smoothed", per="component"),
)
LOCK = Quantity("lock", term("lock rate"), "locks", "lock_rate|lock", kind="share", more_is_better=True, last=True)
LOST = LOCK.complement("lost", term("rate of lost locks"))
RIGHT = Quantity("right", term("rate of right folds"), "folds", "right", kind="share", more_is_better=True, last=True)
WRONG = RIGHT.complement("wrong", term("rate of wrong folds"))

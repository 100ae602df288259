"""How wide the intervals of a quantity are, and how many realisations make them narrow enough.

`--precision` looks at declared numbers of realisations only, 2000·2^m below N and N itself. With a look after every
block, it would stop where chance made the intervals narrow, and the place would depend on the machine.

An interval of σ is also narrow where rare large errors have not occurred yet. A sample cannot show what it lacks: a
narrower target, or one more doubling, helps little. So where errors are not known to be Gaussian, no run ends below a
minimum of realisations, which is higher after large errors."""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from radarsim.engine.results import CaseResult
from radarsim.errors import count_text
from radarsim.report.quantities import SIGMA, Quantity

if TYPE_CHECKING:
    import pandas

Table = Callable[[Sequence[CaseResult]], "pandas.DataFrame"]  # of a study: the table of the quantity
FIRST_LOOK = 2000
MIN_REALISATIONS_WITHOUT_TAILS = 64_000  # with errors of probability 10⁻⁴, all but two samples in 1000 have one
MIN_REALISATIONS_WITH_TAILS = 512_000  # of these 51 are expected: the interval then covers 92 %
TAIL_RATIO = 3  # realisations for each effective one, from which on errors are large: κ = 4; Gaussian ones have two
EQUAL = 1e-9  # relative difference of widths that is rounding
MAX_REALISATIONS = 10**12  # realisations, as in a config


@dataclass(frozen=True)
class WidestInterval:
    """The 95 % half-width of a quantity, in its `half_width_unit` (infinite where unknown), and the quantity's place.

    component is empty and k zero where the quantity has none. below bounds a rate of events that never occurred.
    against is the filter that a gain refers to, where the case has several baselines."""

    percent: float
    case: str
    filter: str
    component: str
    k: int
    count: int
    of: Quantity = SIGMA
    below: float | None = None
    against: str = ""

    def __str__(self) -> str:
        width = f"± {self.percent:.3g} {self.of.half_width_unit}" if math.isfinite(self.percent) else "not known"
        if self.below is not None:
            width = f"none seen, so below {self.below:.2g},"
        return f"{self.case}: filter {self.place()}: {self.of.words} {width} at {count_text(self.count)} realisations"

    def place(self) -> str:
        """Filter, component and scan, as far as it has them."""
        component = f", component {self.component}" if self.component else ""
        against = f" against {self.against!r}" if self.against else ""
        return f"{self.filter!r}{against}{component}" + (f", k = {self.k}" if self.k else "")

    def last(self) -> str:
        """The same in short."""
        name = f"{self.filter} against {self.against}" if self.against else self.filter
        return ", ".join(filter(None, (name, self.component, f"k = {self.k}" if self.k else "")))


def look_counts(max_realisations: int, first: int = FIRST_LOOK) -> Iterator[int]:
    """The numbers of realisations, from `first` on, at which a precision is checked: 2000, 4000, …, and
    `max_realisations` last.

    >>> list(look_counts(10_000))
    [2000, 4000, 8000, 10000]
    """
    n = FIRST_LOOK
    while n < max_realisations:
        if n >= first:
            yield n
        n *= 2
    if max_realisations >= FIRST_LOOK:
        yield max_realisations


def minimum_realisations(result: CaseResult, curves: Table | None) -> int:
    """Realisations below which a precision ends no run, unless its N is less; curves None: there are no tails to
    expect.

    Large errors have occurred where the effective realisations of any σ are under a third of all."""
    if curves is None:
        return FIRST_LOOK
    rows = curves([result])
    return (
        MIN_REALISATIONS_WITH_TAILS
        if (TAIL_RATIO * rows["n_eff"] < rows["n"]).any()
        else MIN_REALISATIONS_WITHOUT_TAILS
    )


def widest_cell(result: CaseResult, table: Table, quantity: Quantity = SIGMA) -> WidestInterval | None:
    """The quantity of a case with the widest interval; None where the case has none. Where the case samples rare events
    of one filter, only its rate of them counts: other events stay rare."""
    rows = table([result])
    aimed_at = getattr(getattr(result.spec, "rare", None), "aimed_at", None)
    if quantity.last and aimed_at is not None:
        rows = rows[rows["filter"] == aimed_at]
    if quantity.last and len(rows):
        rows = rows.groupby(["case", "filter", *filter(None, [quantity.per])], sort=False).tail(1)
    if not len(rows):
        return None
    (value, lo, hi), _ = quantity.read(rows)
    with np.errstate(divide="ignore", invalid="ignore"):
        percent = np.where(hi == lo, 0.0, 0.5 * (hi - lo) if quantity.kind == "signed" else 50 * (hi - lo) / value)
    percent = np.where(np.isnan(percent) | np.isnan(value), np.inf, percent)
    # Of equal ones the first: Gaussian errors without bias are all known equally well, up to rounding.
    first = int(np.flatnonzero(percent >= percent.max() * (1 - EQUAL))[0])
    row = rows.iloc[first]
    component, k = str(row.get(quantity.per, "")), int(row.get("k", 0))
    below = float(hi[first]) if value[first] == 0 and math.isinf(percent[first]) else None
    against = str(row.get("baseline", "")) if result.further_baselines else ""
    names = str(row["case"]), str(row["filter"]), component
    return WidestInterval(float(percent.max()), *names, k, result.count, quantity, below, against)


def needed_realisations(
    result: CaseResult,
    percent: float,
    table: Table,
    quantity: Quantity = SIGMA,
    max_realisations: int = MAX_REALISATIONS,
    curves: Table | None = None,
) -> int | None:
    """The number of realisations at which a run of at most `max_realisations` likely ends, or the larger number that it
    would need; None if unattainable.

    From the sums of a pilot, scaled to more realisations. curves: as in `minimum_realisations`."""
    cell = widest_cell(result, table, quantity)
    if cell is None:
        return FIRST_LOOK
    if not math.isfinite(cell.percent):
        return None
    for n in sorted({*look_counts(MAX_REALISATIONS), max_realisations}):
        # Half-widths go with 1/√n: looks far from enough are skipped.
        if cell.percent * math.sqrt(result.count / n) >= 2 * percent:
            continue
        scaled = scale_sums(result, n)
        widest = widest_cell(scaled, table, quantity)
        if (
            widest is not None
            and widest.percent < percent
            and n >= min(minimum_realisations(scaled, curves), max_realisations)
        ):
            return n
    return None


def scale_sums(result: CaseResult, n: int) -> CaseResult:
    """A case with its sums scaled to n realisations."""
    sums = {name: sums * (n / result.count) for name, sums in result.sums.items()}
    outside = None if result.user_filters is None else scale_sums(result.user_filters, n)
    against = tuple(scale_sums(baseline, n) for baseline in result.further_baselines)
    return replace(result, count=n, sums=sums, further_baselines=against, user_filters=outside)


def with_gaussian_sums(result: CaseResult) -> CaseResult:
    """A case with the expected sums of Gaussian errors, of the exact bias and σ, in place of the sampled ones. For
    linear filters under Gaussian noise, where the exact values are σ and bias themselves."""
    bias, square = result.axes.exact_bias, result.axes.exact_sigma**2
    spread = square - bias**2
    third = bias**3 + 3 * bias * spread
    fourth = bias**4 + 6 * bias**2 * spread + 3 * spread**2
    expected = result.count * np.stack([bias, square, third, fourth], axis=-1)
    return replace(result, sums={**result.sums, "error": np.where(np.isnan(expected), result.sums["error"], expected)})

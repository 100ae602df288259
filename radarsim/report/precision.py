"""How wide the intervals of σ are, and how many realisations make them narrow enough.

`--precision` looks at declared numbers of realisations only, 2000·2^m. Were it to look after every block, it would
stop at the first one at which chance made the intervals narrow, and where that is would depend on the machine.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from radarsim.engine.results import CaseResult

if TYPE_CHECKING:
    import pandas

Curves = Callable[[Sequence[CaseResult]], "pandas.DataFrame"]  # a study's table of curves
FIRST = 2000
EQUAL = 1e-9  # relative difference of widths that is rounding
MOST = 10**12  # realisations, as in a config


@dataclass(frozen=True)
class Cell:
    """The 95 % half-width of one σ, in per cent of it (infinite where σ is not known), and which σ that is."""

    percent: float
    case: str
    filter: str
    component: str
    k: int
    count: int

    def __str__(self) -> str:
        width = f"± {self.percent:.3g} %" if math.isfinite(self.percent) else "not known"
        where = f"filter {self.filter!r}, component {self.component}, k = {self.k}"
        return f"{self.case}: {where}: sigma {width} at {self.count:,} realisations"


def looks(most: int) -> Iterator[int]:
    """The numbers of realisations, up to `most`, at which a precision is looked at.

    >>> list(looks(10_000))
    [2000, 4000, 8000]
    """
    n = FIRST
    while n <= most:
        yield n
        n *= 2


def worst(result: CaseResult, table: Curves) -> Cell | None:
    """The σ of a case with the widest interval relative to itself; None where a case has no σ."""
    curves = table([result])
    if not len(curves):
        return None
    sigma, lo, hi = (curves[name].to_numpy(dtype=float) for name in ("sigma", "sigma_lo", "sigma_hi"))
    with np.errstate(divide="ignore", invalid="ignore"):
        percent = np.where(hi == lo, 0.0, 50 * (hi - lo) / sigma)
    percent = np.where(np.isnan(percent) | np.isnan(sigma), np.inf, percent)
    # Of equal ones the first: Gaussian errors without bias are all known equally well, up to rounding.
    row = int(np.flatnonzero(percent >= percent.max() * (1 - EQUAL))[0])
    case, name, component = (str(curves[column].iloc[row]) for column in ("case", "filter", "component"))
    return Cell(float(percent.max()), case, name, component, int(curves["k"].iloc[row]), result.count)


def needed(result: CaseResult, percent: float, table: Curves) -> int | None:
    """At which look the precision is likely met, from the sums of a pilot; None if beyond all bounds.

    The sums are taken as those of more realisations, in proportion.
    """
    cell = worst(result, table)
    if cell is None:
        return FIRST
    if not math.isfinite(cell.percent):
        return None
    for n in looks(MOST):
        # Half-widths go with 1/√n: what is far from enough need not be looked at.
        if cell.percent * math.sqrt(result.count / n) >= 2 * percent:
            continue
        wide = worst(grown(result, n), table)
        if wide is not None and wide.percent < percent:
            return n
    return None


def grown(result: CaseResult, n: int) -> CaseResult:
    """A case with its sums in proportion to n realisations."""
    return replace(result, count=n, sums={name: sums * (n / result.count) for name, sums in result.sums.items()})


def gaussian(result: CaseResult) -> CaseResult:
    """A case with the expected sums of its errors in place of the drawn ones: Gaussian, of the exact bias and σ.

    For linear filters under Gaussian noise, where the exact values are σ and bias themselves.
    """
    bias, square = result.axes.exact_bias, result.axes.exact_sigma**2
    spread = square - bias**2
    third = bias**3 + 3 * bias * spread
    fourth = bias**4 + 6 * bias**2 * spread + 3 * spread**2
    expected = result.count * np.stack([bias, square, third, fourth], axis=-1)
    return replace(result, sums={**result.sums, "error": np.where(np.isnan(expected), result.sums["error"], expected)})

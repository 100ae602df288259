"""Exact values against measured ones, in every table and every run.

A column `exact_NAME` of a table holds the exact value of its column NAME, or gain_NAME; `exact` alone that of the
column whose ends are `lo` and `hi`. The two columns after the measured one are the ends of its 95 %
interval; of a mean the one after it, `…_se`, is its standard error. So a study that names its columns like this is held
against its own exact values without a word more. Each of them is to lie within `statistics.ERROR_OF_PROGRAM` standard
errors, within more where there are so many that chance would take one further.

Whose standard errors: the sample's own, where a filter's errors are Gaussian at every scan, by their κ. Where they are
not, as where plots are missed, something rare may make much of a mean of squares and be missing in a sample, and in its
standard error with it. Such a σ is held against being too large alone, which no sample is for what it lacks; of a bias
so much may be missing as `UNSEEN` of n realisations can make, σ √(UNSEEN/n) (Cauchy and Schwarz); a gain is not held.
"""

from collections.abc import Collection, Iterator, Mapping
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from radarsim.language import tr
from radarsim.report import tables as common
from radarsim.report.statistics import ERROR_OF_PROGRAM, FEW, Z95, Estimate, furthest, standard_errors

if TYPE_CHECKING:
    import pandas as pd

COLUMNS = ("case", "filter", "component", "unit", "scans", "inside_percent", "largest_difference_percent", "at_k")
ALMOST = 2e-4  # of a value that `Study.exact_but_for` says something of
ROUNDING = 1e-9  # of a value
UNSEEN = 18.0  # realisations of n that are all missing in one sample of 6·10⁷
STRAYS = 5.0  # standard errors by which κ of Gaussian errors may lie off theirs
PLACE = ("case", "filter", "component")
SQUARES = ("sigma", "nees", "nis")  # measured columns of means of squares


class Beside(NamedTuple):
    """A measured column, its ends, and its exact value; lo and hi are one column where it is the standard error."""

    value: str
    lo: str
    hi: str
    exact: str


def beside(table: "pd.DataFrame") -> Iterator[Beside]:
    """The measured columns of a table that have an exact one."""
    columns = [str(name) for name in table.columns]
    for exact in (name for name in columns if name == "exact" or name.startswith("exact_")):
        own = exact.removeprefix("exact").removeprefix("_")
        for value, lo, hi in zip(columns, columns[1:], columns[2:], strict=False):
            named = value in (own, f"gain_{own}") if own else (lo, hi) == ("lo", "hi")
            if named and lo == f"{value}_se":
                yield Beside(value, lo, lo, exact)
            elif named and lo.endswith("lo") and hi.endswith("hi"):
                yield Beside(value, lo, hi, exact)


def measured(table: "pd.DataFrame", of: Beside) -> Estimate:
    """The measured values (rows,) of a column with their 95 % intervals."""
    value, lo, hi = (table[name].to_numpy(dtype=float) for name in of[:3])
    return Estimate(value, value - Z95 * lo, value + Z95 * hi) if of.lo == of.hi else Estimate(value, lo, hi)


def distances(made: "Mapping[str, pd.DataFrame]", name: str, of: Beside, nearly: Collection[str] = ()) -> np.ndarray:
    """Standard errors (rows,) by which the measured values of a column lie off the exact ones.

    made: all tables; nearly: the cases of which exact values are right to `ALMOST`. 0 where the sample may lack as
    much, see above. Not-a-number where no exact value is known, or under `FEW` realisations measured it.
    """
    table = made[name]
    (value, lo, hi), exact = measured(table, of), table[of.exact].to_numpy(dtype=float)
    size, lacking, squares = np.abs(exact), np.zeros(len(table)), of.value in SQUARES
    if of.value == "bias":
        size = np.fmax(size, table["sigma"].to_numpy(dtype=float))
        lacking = size * np.sqrt(UNSEEN / np.fmax(table["n"].to_numpy(dtype=float), 1.0))  # n = 0: no row is judged
    elif of.value.endswith("_percent"):  # of a ratio of two σ
        size = np.abs(100 - exact)
        lacking[:] = np.inf
    elif squares:
        lacking[value < exact] = np.inf
    room = size * np.where(table["case"].isin(list(nearly)), ALMOST, ROUNDING)
    room = room + np.where(_gaussian(made, table), 0.0, lacking)
    near = np.abs(exact - value) <= room
    nearest = np.where(near, value, exact - np.sign(exact - value) * np.where(near, 0.0, room))
    n = table["n"] if "n" in table else table["case"].map(made["curves"].groupby("case")["n"].min())
    enough = (n.to_numpy(dtype=float) >= FEW) & ~np.isnan(exact)
    return np.where(enough, standard_errors(Estimate(value, lo, hi), nearest), np.nan)


def _gaussian(made: "Mapping[str, pd.DataFrame]", table: "pd.DataFrame") -> np.ndarray:
    """Whether errors are Gaussian, (rows,), of the filter of each row, and of that which it is compared with."""
    curves = made.get("curves")
    if curves is None or not len(curves):
        return np.zeros(len(table), dtype=bool)
    n, n_eff, square, bias, spread = (
        curves[column].to_numpy(dtype=float) for column in ("n", "n_eff", "sigma", "bias", "spread")
    )
    square, variance = square**2, spread**2
    with np.errstate(divide="ignore", invalid="ignore"):
        kurtosis = 1 + n / n_eff
        theirs = (bias**4 + 6 * bias**2 * variance + 3 * variance**2) / square**2
        error = np.sqrt((96 * bias**2 * variance**3 + 24 * variance**4) / n) / square**2
        strays = np.abs(kurtosis - theirs) > STRAYS * error + ROUNDING
    others = set(zip(curves["case"][strays], curves["filter"][strays], strict=True))
    pairs = [zip(table["case"], table[who], strict=True) for who in {"filter", "baseline"} & set(table)]
    return (
        np.all([[pair not in others for pair in own] for own in pairs], axis=0) if pairs else np.ones(len(table), bool)
    )


def faults(
    made: "Mapping[str, pd.DataFrame]", nearly: Collection[str] = (), bounds: Collection[str] = ("claims",)
) -> list[str]:
    """A line for each column that lies further off its exact values than chance takes any: the furthest row of it.

    made, nearly: as for `distances`; bounds: tables that hold no exact values of what was measured, whatever they say.
    """
    found = {
        (name, of): distances(made, name, of, nearly)
        for name, table in made.items()
        if name not in bounds and "case" in table and len(table)
        for of in beside(table)
    }
    many = sum(int((~np.isnan(apart)).sum()) for apart in found.values())
    bound = max(ERROR_OF_PROGRAM, furthest(many))
    said = []
    for (name, of), apart in found.items():
        if (apart > bound).any():
            at = int(np.nanargmax(apart))
            row = made[name].iloc[at]
            scan = f"k = {row['k']:g}" + (f" ({row['t_s']:g} s)" if "t_s" in row else "") if "k" in row else ""
            place = ", ".join(filter(None, (*(str(row[key]) for key in PLACE if key in row), scan)))
            said.append(
                tr(
                    "{table}.csv: {place}: {column} measured {measured:.6g}, exactly {exact:.6g}: {apart:.3g} standard "
                    "errors apart; {count:,} of {rows:,} rows of this column are over {bound:.3g}, the most that "
                    "chance makes of {many:,}: the simulation or the exact value is computed wrongly",
                    table=name,
                    place=place,
                    column=of.value,
                    measured=float(row[of.value]),
                    exact=float(row[of.exact]),
                    apart=float(apart[at]),
                    bound=bound,
                    many=many,
                    count=int((apart > bound).sum()),
                    rows=int((~np.isnan(apart)).sum()),
                )
            )
    return said


def agreement(curves: "pd.DataFrame") -> "pd.DataFrame | None":
    """A row for each case, filter and component of curves.csv whose exact σ is known; None where none is."""
    known = curves[np.isfinite(curves["exact_sigma"]) & (curves["exact_sigma"] > 0) & np.isfinite(curves["sigma_lo"])]
    if not len(known):
        return None
    exact, sigma = known["exact_sigma"], known["sigma"]
    marked = known.assign(
        inside=(known["sigma_lo"] <= exact) & (exact <= known["sigma_hi"]), off=100 * (sigma / exact - 1)
    )
    rows = []
    for keys, own in marked.groupby(["case", "filter", "component"], sort=False):
        worst = own.loc[own["off"].abs().idxmax()]
        share = 100 * float(own["inside"].mean())
        rows.append((*keys, worst["unit"], len(own), round(share, 1), float(worst["off"]), int(worst["k"])))
    return common.frame({name: [row[i] for row in rows] for i, name in enumerate(COLUMNS)})

"""Exact values against measured ones, in every table and every run.

A column `exact_NAME` of a table holds the exact value of its column NAME, or gain_NAME; `exact` alone that of the
column whose ends are `lo` and `hi`. The two columns after the measured one are the ends of its 95 % interval; of a mean
the one after it, `…_se`, is its standard error. So a study with these column names is checked against its own exact
values without further declarations. Each measured value must lie within `statistics.ERROR_OF_PROGRAM` standard errors,
within more where there are so many that chance would take one further.

Whose standard errors: the sample's own, where a filter's errors are Gaussian at every scan, by their κ. Where they are
not, as where plots are missed, something rare may make much of a mean of squares and be missing in a sample, and in its
standard error with it. Such a σ is only checked for being too large, which no sample becomes by missing events; of a
bias so much may be missing as `UNSEEN` of n realisations can make, σ √(UNSEEN/n) (Cauchy and Schwarz); a gain is not
checked.

A filter's predicted errors against its true ones, with the same columns and words in every study.

`believed_sigma` of `curves.csv` stands beside the true σ of each component.
`consistency.csv` compares whole states and residuals by normalised squares, per degree of freedom: NEES eᵀP⁻¹e of the
error e, NIS νᵀS⁻¹ν of the innovation ν, P and S the covariances that the filter predicts. Both are 1 for a consistent
filter. Over 1 the filter is optimistic, its errors are larger than predicted; under 1 it is pessimistic. (Bar-Shalom,
Li & Kirubarajan, Estimation with Applications to Tracking and Navigation, 2001, 5.4.)

Where a table's interval covers less than its 95 %: a last column `note`, there only where a row has one.

There is one rule. An interval of σ takes the spread of e² from the sample; where few of the realisations make that
spread, it is too narrow, and more so in the sample that happens to lack them. How many make it is n/(κ − 1), the
effective realisations. They are counted at the row's own scan and at the scans near it, as the few that are missing in
one are seen in another. A gain has a rule more, as both filters may err alike but for a few realisations. A study that
knows more about its rare errors (wrong folds, lost bursts) brings notes of its own.

A row with an exact value has none: that value is the better one, whatever the interval. Measured coverage of marked and
unmarked rows is in docs/trust.md."""

import math
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from radarsim.engine.results import CaseResult
from radarsim.language import plural, tr
from radarsim.report import files, rare, seen, statistics, tables
from radarsim.report.quantities import COMMON, Quantity
from radarsim.report.statistics import ERROR_OF_PROGRAM, FEW, Z95, Estimate, Values, furthest, standard_errors

if TYPE_CHECKING:
    import pandas as pd


# ---- agreement -------------------------------------------------------------------------------------------------------
COLUMNS = ("case", "filter", "component", "unit", "scans", "inside_percent", "largest_difference_percent", "at_k")
ALMOST = 2e-4  # of a value for which `Study.exact_but_for` gives a qualification
ROUNDING = 1e-9  # of a value
UNSEEN = 18.0  # realisations of n that are all missing in one sample of 6·10⁷
STRAYS = 5.0  # standard errors by which κ of Gaussian errors may lie off theirs
PLACE = ("case", "filter", "component")
SQUARES = ("sigma", "nees", "nis")  # measured columns of means of squares, in any table


class Beside(NamedTuple):
    """A measured column, its ends, and its exact value; lo and hi are one column where it is the standard error."""

    value: str
    lo: str
    hi: str
    exact: str


def beside(table: "pd.DataFrame") -> Iterator[Beside]:
    """The measured columns of a table that have an exact one.

    exact: the measured value, known without sampling, empty where not; `exact_NAME` of the column NAME or gain_NAME"""
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


def distances(
    made: "Mapping[str, pd.DataFrame]",
    name: str,
    of: Beside,
    nearly: Collection[str] = (),
    declared: Sequence[Quantity] = (),
) -> np.ndarray:
    """Standard errors (rows,) by which the measured values of a column lie off the exact ones.

    made: all tables; nearly: the cases whose exact values are accurate to `ALMOST`. 0 where missing rare events may
    explain the distance, see above. NaN where no exact value is known, or fewer than `FEW` realisations measured it."""
    table = made[name]
    (value, lo, hi), exact = measured(table, of), table[of.exact].to_numpy(dtype=float)
    size, lacking, squares = (
        np.abs(exact),
        np.zeros(len(table)),
        [(one.table, one.value) for one in declared if one.squares],
    )
    if of.value == "bias":
        size = np.fmax(size, table["sigma"].to_numpy(dtype=float))
        lacking = size * np.sqrt(UNSEEN / np.fmax(table["n"].to_numpy(dtype=float), 1.0))  # n = 0: no row is judged
    elif of.value.endswith("_percent"):  # of a ratio of two σ
        size = np.abs(100 - exact)
        lacking[:] = np.inf
    elif of.value in SQUARES or (name, of.value) in squares:
        lacking[value < exact] = np.inf
    room = size * np.where(table["case"].isin(list(nearly)), ALMOST, ROUNDING)
    room = room + np.where(_gaussian(made, table), 0.0, lacking)
    with np.errstate(invalid="ignore"):  # an infinite gain, against a σ of zero, has no distance from another
        near = np.abs(exact - value) <= room
        nearest = np.where(near, value, exact - np.sign(exact - value) * np.where(near, 0.0, room))
    n = table["n"] if "n" in table else table["case"].map(made["curves"].groupby("case")["n"].min())
    enough = (n.to_numpy(dtype=float) >= FEW) & ~np.isnan(exact)
    return np.where(enough, standard_errors(Estimate(value, lo, hi), nearest), np.nan)


def _gaussian(made: "Mapping[str, pd.DataFrame]", table: "pd.DataFrame") -> np.ndarray:
    """Whether errors are Gaussian, (rows,), of the filter of each row, and of the one it is compared with."""
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
    made: "Mapping[str, pd.DataFrame]",
    nearly: Collection[str] = (),
    bounds: Collection[str] = ("claims",),
    declared: Sequence[Quantity] = (),
) -> list[str]:
    """A line for each column that is further off its exact values than chance explains: its furthest row.

    made, nearly: as for `distances`; bounds: tables without exact values of the measured quantities, whatever their
    columns; declared: the quantities of the study."""
    found = {
        (name, of): distances(made, name, of, nearly, declared)
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
                    "{table}.csv: {place}: {column} measured {measured:.6g}, exactly {exact:.6g}: "
                    "{apart:.3g} standard errors apart; {count:,} of {rows:,} rows of this column exceed "
                    "{bound:.3g}, the most that chance explains in {many:,}: the simulation or the exact value is "
                    "wrong",
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
    return tables.frame({name: [row[i] for row in rows] for i, name in enumerate(COLUMNS)})


# ---- consistency -----------------------------------------------------------------------------------------------------
OPTIMISTIC, CONSISTENT, PESSIMISTIC = "optimistic", "consistent", "pessimistic"


def sigma_over_believed(curves: "pd.DataFrame") -> Estimate:
    """True over believed σ (rows,) of rows of curves, with the interval of the true σ alone.

    Over 1 a filter is *optimistic*: its errors are larger than it believes. Under 1 it is *pessimistic*. The rows of a
    radar that misses plots, whose believed σ is a sampled mean, cover 94 … 95 %."""
    true = (curves[name].to_numpy(dtype=float) for name in ("sigma", "sigma_lo", "sigma_hi"))
    return _over(Estimate(*true), curves["believed_sigma"].to_numpy(dtype=float))


def ratio_columns(true: Estimate, claimed: np.ndarray) -> dict[str, np.ndarray]:
    """Columns of estimates (n,) of σ and believed ones (n,).

    believed_sigma [unit]: root of the mean variance that the filter believes
    ratio ±: true over believed"""
    columns = tables.interval_columns("ratio", _over(true, claimed))
    return {"sigma": true.value, "believed_sigma": claimed, **columns}


def _over(true: Estimate, believed: np.ndarray) -> Estimate:
    with np.errstate(invalid="ignore", divide="ignore"):
        return Estimate(*(end / believed for end in true))


def normalised(
    quantity: str, mean: Estimate, bounds: tuple[np.ndarray, np.ndarray], exact: np.ndarray | None = None
) -> tables.Columns:
    """What a filter believes of its whole state (NEES) or of its innovations (NIS), by normalised squares.

    nees ±, nis ±: mean of `eᵀP⁻¹e`, `νᵀS⁻¹ν` per degree of freedom, P and S the covariances that the filter believes
    nees_bound_lo, nees_bound_hi, nis_bound_lo, nis_bound_hi: between them lie all means of a filter that is right about
        itself in 95 % of runs (Bonferroni)
    nees_verdict, nis_verdict: consistent, optimistic or pessimistic, as the exact mean, or where it is not known the
        measured one, lies by these bounds"""
    known = {} if exact is None else {f"exact_{quantity}": exact}
    decides = mean.value if exact is None else np.where(np.isnan(exact), mean.value, exact)
    ends = dict(zip((f"{quantity}_bound_lo", f"{quantity}_bound_hi"), bounds, strict=True))
    return {quantity: mean, **known, **ends, f"{quantity}_verdict": verdict(decides, *bounds)}


def verdict(mean: np.ndarray, lo: np.ndarray, hi: np.ndarray) -> np.ndarray:
    """The meaning of a mean NEES or NIS for a filter's covariance, by the bounds of a consistent filter."""
    return np.select([mean < lo, mean > hi], [PESSIMISTIC, OPTIMISTIC], CONSISTENT).astype(object)


def bounds_from_spread(total: Values, square: Values, n: Values, looks: int) -> tuple[np.ndarray, np.ndarray]:
    """Bounds of a mean NEES or NIS of unknown law, from Σq and Σq² over n realisations. They are the interval of the
    mean, widened so that `looks` of them hold at once in 95 % of runs, moved to 1: 1 leaves that interval where the
    mean leaves these bounds."""
    mean = statistics.mean_square(total, square, n, looks)
    with np.errstate(divide="ignore", invalid="ignore"):
        return mean.value / mean.hi, mean.value / mean.lo


# ---- notes -----------------------------------------------------------------------------------------------------------
# Of 14 configs, rows whose n/(κ − 1) over all samples together is 100 … 200 cover 93.6 % on the mean, over that 94.4 …
# 95.2, 50 … 100 91, under 10 65 %.
EFFECTIVE = 100
HEAVY = f"under {EFFECTIVE} effective realisations, here or at a scan nearby: heavy tails"
# The few large errors that make a tail are in one sample and not in the next: where they are missing, so is the sign of
# them. They last for some scans, and begin at any: a row is marked too where a scan is so near, in scans of the run.
# Of `multimodel_1hz`, 200 × 1000 realisations, rows that their own scan alone marks cover 16 … 100 % where unmarked;
# with a tenth of the run on either side no row can be told from 95 %; with a twentieth five of `sonar_missed` can.
NEARBY = 0.1
# Of Gaussian errors n/2 count: of few realisations a tail is where much fewer do, κ over 5.
TAIL = 4
# A paired gain of two filters that err nearly alike depends on the few realisations in which they do not, of which the
# moments of either tell nothing. Of `multimodel_families_1hz`, 100 × 1000 realisations, unmarked intervals that are
# under a tenth of what independent filters would have cover 81 %, all others 95 %.
ALIKE = "filters nearly alike: rare differences decide"
INDEPENDENT = 0.1
# Filters from outside are paired one by one, so that the moments of the differences of squares are known. Those of a
# filter that differs a little in every realisation are products of Gaussians: n/8 of them count.
TAIL_OF_DIFFERENCES = 16
# Of every row of a table: what its interval is of, not that it rests on too little. What is computed at an estimate has
# a spread of its own: ratios of `sonar_manoeuvre` cover 93 %, one in twenty 31.
VARIES = "interval of sigma alone: the believed one varies from one realisation to the next"
# Tables that bring all their notes, and one whose mean squares are of several components and bounded: unmarked or
# marked by these rules, rows of NEES and NIS cover 95 … 97 %.
OWN = ("rare", "consistency")
SAME = ["case", "filter", "component", "k"]
OF_GAIN = "gain: "  # a note that begins with the name of an interval is of that one alone, here where a row has σ too


def noted(
    made: Mapping[str, "pd.DataFrame"],
    results: Sequence[CaseResult],
    exact: bool = True,
    declared: Sequence[Quantity] = COMMON,
) -> "dict[str, pd.DataFrame]":
    """The tables by name, those with intervals and with a row to be noted having the column.

    A table may bring notes of its own on rows that have no other. exact: whether the columns `exact_…` hold exact
    values, in place of bounds that the measured ones reach or not (`Study.exact_errors`). declared: what the study
    measures.

    note: why a row rests on too few realisations or events for its interval; only in tables that have such a row"""
    paired = {name: [one for one in declared if one.paired and one.table == name] for name in made}
    return {name: _noted(name, table, made, results, exact, paired[name]) for name, table in made.items()}


def _noted(
    name: str,
    table: "pd.DataFrame",
    made: Mapping[str, "pd.DataFrame"],
    results: Sequence[CaseResult],
    exact: bool,
    paired: Sequence[Quantity],
) -> "pd.DataFrame":
    if not len(table) or "case" not in table or not any(str(column).endswith("_lo") for column in table):
        return table
    brought = table["note"].to_numpy(dtype=object) if "note" in table else np.full(len(table), "", dtype=object)
    table = table.drop(columns="note") if "note" in table else table
    notes = brought
    if name not in OWN:
        notes = notes_on(*behind(table, made, results))
        if paired:
            notes = np.where((notes == "") & _alike(table, made["curves"], paired), ALIKE, notes)
        notes = np.where(notes == "", brought, notes)
        notes = np.where(known(table) & exact, "", notes)
    return table.assign(note=notes) if any(notes) else table


def known(table: "pd.DataFrame") -> np.ndarray:
    """The rows (rows,) with exact values."""
    columns = [column for column in table if str(column).startswith("exact_") and column != "exact_bias"]
    return table[columns].notna().all(axis=1).to_numpy() & bool(columns)


def heavy(table: "pd.DataFrame") -> np.ndarray:
    """Which rows of a noted table of σ or gains (rows,) are marked."""
    return table["note"].ne("").to_numpy() if "note" in table else np.full(len(table), False)


Answer = Callable[[Mapping[str, "pd.DataFrame"]], Sequence[str]]  # sentences from the tables


def concerned(made: Mapping[str, "pd.DataFrame"], answers: Sequence[Answer]) -> "dict[str, pd.DataFrame]":
    """By table, the marked rows whose intervals the answer gives, or depends on: with wider ones it reads otherwise.

    answers: the parts of the answer, each examined by itself, as most rows concern one of many."""
    found: dict[str, set[int]] = {}
    for answer in answers:
        said = list(answer(made))
        for name, table in made.items():

            def matter(
                at: np.ndarray,
                name: str = name,
                table: "pd.DataFrame" = table,
                answer: Answer = answer,
                said: list[str] = said,
            ) -> bool:
                return list(answer({**made, name: _wider(table, at)})) != said

            marked = heavy(table) & (table["note"] != VARIES) if "note" in table else heavy(table)
            found.setdefault(name, set()).update(_least(np.flatnonzero(marked), matter))
    return {name: made[name].iloc[sorted(rows)] for name, rows in found.items() if rows}


def _least(rows: np.ndarray, matter: Callable[[np.ndarray], bool]) -> list[int]:
    """Of these rows those that matter, found by bisection; all of them where they matter only together."""
    if not len(rows) or not matter(rows):
        return []
    half = len(rows) // 2
    parts = [rows[:half], rows[half:]] if half else []
    return [row for part in parts for row in _least(part, matter)] or rows.tolist()


def _wider(table: "pd.DataFrame", rows: np.ndarray) -> "pd.DataFrame":
    """The table with intervals twice as wide in these rows, in the columns that their notes concern."""
    wider, said = table.copy(), table["note"].to_numpy(dtype=object)[rows]
    lows = [str(column) for column in table if str(column).endswith(("_lo", "_lo_s"))]
    for note in set(said):
        at = table.index[rows[said == note]]
        for low in (one for one in lows if is_of(note, one, lows)):
            ends = [low, low.replace("_lo", "_hi")]
            half = (table.loc[at, ends[1]] - table.loc[at, ends[0]]) / 2
            wider.loc[at, ends] = np.stack([table.loc[at, ends[0]] - half, table.loc[at, ends[1]] + half], axis=1)
    return wider


def is_of(note: str, column: str, columns: Sequence[str]) -> bool:
    """Whether a note concerns a column among those with intervals: those named at its beginning, else all.

    >>> [is_of("gain: heavy tails", one, ["sigma", "gain_percent"]) for one in ("sigma", "gain_percent")]
    [False, True]
    """
    name = note.partition(": ")[0]
    return column.startswith(name) or not any(one.startswith(name) for one in columns)


def needed(rows: "pd.DataFrame", made: Mapping[str, "pd.DataFrame"], results: Sequence[CaseResult]) -> np.ndarray:
    """How many realisations (rows,) marked intervals take, from the effective ones; NaN where unknown."""
    n, fewest = behind(rows.drop(columns="n_eff", errors="ignore"), made, results)
    with np.errstate(divide="ignore"):
        return np.where(rows["note"].str.endswith(HEAVY) & (fewest < EFFECTIVE), n * EFFECTIVE / fewest, np.nan)


def notes_on(n: np.ndarray, fewest: np.ndarray) -> np.ndarray:
    """The notes (rows,) on intervals of n realisations (rows,).

    fewest: how many of them count where a few large errors decide, at the scan where they are fewest; NaN where errors
    have no tails, or nothing is known of them."""
    return np.where(fewest < np.minimum(EFFECTIVE, n / TAIL), HEAVY, "").astype(object)


def nearby(curves: "pd.DataFrame") -> np.ndarray:
    """The fewest effective realisations (rows,) within NEARBY of the scans on either side, of a filter's component."""
    own = curves["n_eff"].to_numpy(dtype=float)
    fewest = own.copy()
    for rows in curves.groupby(SAME[:3], sort=False).indices.values():
        fewest[rows] = _fewest(own[rows])
    return fewest


def _fewest(own: np.ndarray) -> np.ndarray:
    """The least values (K, …) within NEARBY of the scans (K, …) on either side."""
    fewest = own.copy()
    for by in range(1, min(max(1, round(NEARBY * len(own))) + 1, len(own))):
        fewest[by:] = np.fmin(fewest[by:], own[:-by])
        fewest[:-by] = np.fmin(fewest[:-by], own[by:])
    return fewest


def few_differ(square: np.ndarray, fourth: np.ndarray, n: np.ndarray) -> np.ndarray:
    """Whether few realisations decide the gain between two filters (F, K, C), here or at a scan nearby: Σd² and Σd⁴ of
    the differences d of their squared errors, over n realisations."""
    with np.errstate(divide="ignore", invalid="ignore"):
        effective = square**2 / (fourth - square**2 / n)
    fewest = np.moveaxis(_fewest(np.moveaxis(effective, 1, 0)), 0, 1)
    return ~(fewest >= np.minimum(EFFECTIVE, n / TAIL_OF_DIFFERENCES))


def _alike(gains: "pd.DataFrame", curves: "pd.DataFrame", paired: Sequence[Quantity]) -> np.ndarray:
    """Which rows (rows,) compare filters that err nearly alike, by quantities in per cent of the baseline's σ."""
    ends = ["sigma", "sigma_lo", "sigma_hi"]
    own = gains[SAME].merge(curves[[*SAME, *ends]], on=SAME, how="left")
    sigma, low, high = (own[end].to_numpy(dtype=float) for end in ends)
    with np.errstate(invalid="ignore", divide="ignore"):
        independent = np.sqrt(2) * (high - low) / sigma
    found = np.full(len(gains), False)
    for of in paired:
        (value, low, high), _ = of.read(gains)
        with np.errstate(invalid="ignore", divide="ignore"):  # a gain of 100 % leaves nothing to be alike
            width = (high - low) / (100 - value if of.more_is_better else 100 + value)
        found |= (width < INDEPENDENT * independent) & (width > ROUNDING)
    return found


def behind(
    table: "pd.DataFrame", made: Mapping[str, "pd.DataFrame"], results: Sequence[CaseResult]
) -> tuple[np.ndarray, np.ndarray]:
    """How many realisations are behind each row (rows,), and the fewest effective ones there and nearby. A row's own,
    those of σ in the same row of curves, or the case's; NaN where effective ones are unknown. A gain rests on the fewer
    of both filters."""
    if "n_eff" in table:
        return table["n"].to_numpy(dtype=float), nearby(table)
    if "n" in table:
        whole = table["n"].to_numpy(dtype=float)
    else:
        whole = table["case"].map({result.name: float(result.count) for result in results}).to_numpy(dtype=float)
    if not set(SAME) <= set(table) or not len(made["curves"]):
        return whole, np.full(len(table), np.nan)
    curves = made["curves"][[*SAME, "n"]].assign(fewest=nearby(made["curves"]))
    n, fewest = _of_curves(table[SAME], curves)
    if "baseline" in table:
        _, other = _of_curves(table[["case", "baseline", "component", "k"]].set_axis(SAME, axis=1), curves)
        fewest = np.fmin(fewest, other)
    return whole if "n" in table else np.where(np.isnan(n), whole, n), fewest


def _of_curves(rows: "pd.DataFrame", curves: "pd.DataFrame") -> tuple[np.ndarray, np.ndarray]:
    """n and the fewest effective realisations of these rows in curves."""
    own = rows.merge(curves, on=SAME, how="left")
    return own["n"].to_numpy(dtype=float), own["fewest"].to_numpy(dtype=float)


# ---- of the answer ---------------------------------------------------------------------------------------------------
MOST_NAMES = 3  # named in a line


def of_intervals(
    results: Sequence[CaseResult], made: "Mapping[str, pd.DataFrame]", answers: Sequence[Answer]
) -> list[str]:
    """Warnings on the intervals of the answer, at most a line each; and whether weights are wrong.

    answers: the parts of the answer. The number of marked rows in a table is given where it is shown."""
    return [*(few(results) or rests(results, made, answers)), *rare.warnings(made.get("rare"))]


def few(results: Sequence[CaseResult]) -> list[str]:
    """A line on the cases whose intervals rest on too few realisations, if any."""
    rough = {result.name: result.count for result in results if result.count < FEW}
    if not rough:
        return []
    words = plural(
        "{cases}: intervals from {counts} realisation are rough: run at least {least}",
        "{cases}: intervals from {counts} realisations are rough: run at least {least}",
        max(rough.values()),
        cases=_named(list(rough)),
        counts=files.span(list(rough.values())),
        least=FEW,
    )
    return [words]


def rests(results: Sequence[CaseResult], made: "Mapping[str, pd.DataFrame]", answers: Sequence[Answer]) -> list[str]:
    """A line on the answer's intervals that are too narrow, with the realisations that they need, if any are."""
    found = concerned(made, answers).values()
    if not found:
        return []
    count, names = sum(map(len, found)), _named(list(dict.fromkeys(name for rows in found for name in rows["filter"])))
    enough = np.max(np.concatenate([needed(rows, made, results) for rows in found]))  # not-a-number if one is
    if np.isfinite(enough):
        words = plural(
            "{count} interval of the answer is too narrow because few realisations decide it ({filters}): "
            "run with -n {needed}",
            "{count} intervals of the answer are too narrow because few realisations decide them "
            "({filters}): run with -n {needed}",
            count,
            filters=names,
            needed=roughly(float(enough)),
        )
    else:
        words = plural(
            "{count} interval of the answer may be too narrow because rare realisations decide it and few or "
            "none occurred ({filters}): run with a larger -n",
            "{count} intervals of the answer may be too narrow because rare realisations decide them and few "
            "or none occurred ({filters}): run with a larger -n",
            count,
            filters=names,
        )
    return [words]


def roughly(count: float) -> str:
    """A number of realisations, rounded up to one digit, as `-n` takes it."""
    power = 10 ** math.floor(math.log10(max(count, 1.0)))
    return f"{math.ceil(count / power) * power:.0e}".replace("e+0", "e").replace("e+", "e")


def _named(names: Sequence[str]) -> str:
    """A few names, and how many more; those that hold a comma are quoted."""
    return seen.named(names, MOST_NAMES)

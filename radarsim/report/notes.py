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
from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from radarsim.engine.results import CaseResult
from radarsim.language import few, plural, tr
from radarsim.report import files, rare, statistics, tables
from radarsim.report.quantities import COMMON, Quantity
from radarsim.report.row_notes import RowNote, concerns, note_kinds, notes_where
from radarsim.report.sentences import Sentence
from radarsim.report.statistics import ERROR_OF_PROGRAM, FEW, Z95, Estimate, Values, furthest, standard_errors

if TYPE_CHECKING:
    import pandas as pd


# ---- agreement -------------------------------------------------------------------------------------------------------
COLUMNS = ("case", "filter", "component", "unit", "scans", "inside_percent", "largest_difference_percent", "at_k")
ALMOST = 2e-4  # of a value for which `Study.exact_but_for` gives a qualification
ROUNDING = 1e-9  # of a value
UNSEEN = 18.0  # realisations of n that are all missing in one sample of 6·10⁷
STRAYS = 5.0  # standard errors by which κ of Gaussian errors may lie off theirs
ROW_LABELS = ("case", "filter", "component")
SQUARES = ("sigma", "nees", "nis")  # measured columns of means of squares, in any table


class ExactColumn(NamedTuple):
    """A measured column, its interval, and the column with its exact value.

    low and high are one column where it is the standard error."""

    value: str
    low: str
    high: str
    exact: str


def exact_columns(table: "pd.DataFrame") -> Iterator[ExactColumn]:
    """The measured columns of a table that have an exact one.

    exact: the measured value, known without sampling, empty where not; `exact_NAME` of the column NAME or gain_NAME"""
    columns = [str(name) for name in table.columns]
    for exact in (name for name in columns if name == "exact" or name.startswith("exact_")):
        stem = exact.removeprefix("exact").removeprefix("_")
        for value, low, high in zip(columns, columns[1:], columns[2:], strict=False):
            is_measured = value in (stem, f"gain_{stem}") if stem else (low, high) == ("lo", "hi")
            if is_measured and low == f"{value}_se":
                yield ExactColumn(value, low, low, exact)
            elif is_measured and low.endswith("lo") and high.endswith("hi"):
                yield ExactColumn(value, low, high, exact)


def measured_values(table: "pd.DataFrame", column: ExactColumn) -> Estimate:
    """The measured values (rows,) of a column with their 95 % intervals."""
    value, low, high = (table[name].to_numpy(dtype=float) for name in column[:3])
    if column.low == column.high:
        return Estimate(value, value - Z95 * low, value + Z95 * high)
    return Estimate(value, low, high)


def standardised_errors(
    tables_by_name: "Mapping[str, pd.DataFrame]",
    name: str,
    column: ExactColumn,
    approximate_cases: Collection[str] = (),
    quantities: Sequence[Quantity] = (),
) -> np.ndarray:
    """Standard errors (rows,) by which the measured values of a column differ from the exact ones.

    name: that of the column's table; approximate_cases: those whose exact values are accurate to `ALMOST` only. 0 where
    missing rare events may explain the difference, see above. NaN where no exact value is known, or fewer than `FEW`
    realisations measured it."""
    table = tables_by_name[name]
    (value, low, high), exact = measured_values(table, column), table[column.exact].to_numpy(dtype=float)
    size, unseen = _size_and_unseen(table, name, column.value, value, exact, quantities)
    tolerance = size * np.where(table["case"].isin(list(approximate_cases)), ALMOST, ROUNDING)
    tolerance = tolerance + np.where(_gaussian(tables_by_name, table), 0.0, unseen)
    with np.errstate(invalid="ignore"):  # an infinite gain, against a σ of zero, has no distance from another
        is_close = np.abs(exact - value) <= tolerance
        nearest = np.where(is_close, value, exact - np.sign(exact - value) * np.where(is_close, 0.0, tolerance))
    n = table["n"] if "n" in table else table["case"].map(tables_by_name["curves"].groupby("case")["n"].min())
    enough = (n.to_numpy(dtype=float) >= FEW) & ~np.isnan(exact)
    return np.where(enough, standard_errors(Estimate(value, low, high), nearest), np.nan)


def _size_and_unseen(
    table: "pd.DataFrame", name: str, column: str, value: np.ndarray, exact: np.ndarray, quantities: Sequence[Quantity]
) -> tuple[np.ndarray, np.ndarray]:
    """The size (rows,) of which a tolerance is a fraction, and how much rare events that are missing may make."""
    size, unseen = np.abs(exact), np.zeros(len(table))
    of_squares = [(quantity.table, quantity.value) for quantity in quantities if quantity.squares]
    if column == "bias":
        size = np.fmax(size, table["sigma"].to_numpy(dtype=float))
        unseen = size * np.sqrt(UNSEEN / np.fmax(table["n"].to_numpy(dtype=float), 1.0))  # n = 0: no row is judged
    elif column.endswith("_percent"):  # of a ratio of two σ
        size = np.abs(100 - exact)
        unseen[:] = np.inf
    elif column in SQUARES or (name, column) in of_squares:
        unseen[value < exact] = np.inf
    return size, unseen


def _gaussian(tables_by_name: "Mapping[str, pd.DataFrame]", table: "pd.DataFrame") -> np.ndarray:
    """Whether errors are Gaussian, (rows,), of the filter of each row, and of the one it is compared with."""
    curves = tables_by_name.get("curves")
    if curves is None or not len(curves):
        return np.zeros(len(table), dtype=bool)
    n, n_eff, sigma, bias, spread = (
        curves[column].to_numpy(dtype=float) for column in ("n", "n_eff", "sigma", "bias", "spread")
    )
    square, variance = sigma**2, spread**2
    with np.errstate(divide="ignore", invalid="ignore"):
        kurtosis = 1 + n / n_eff
        gaussian_kurtosis = (bias**4 + 6 * bias**2 * variance + 3 * variance**2) / square**2
        error = np.sqrt((96 * bias**2 * variance**3 + 24 * variance**4) / n) / square**2
        strays = np.abs(kurtosis - gaussian_kurtosis) > STRAYS * error + ROUNDING
    not_gaussian = set(zip(curves["case"][strays], curves["filter"][strays], strict=True))
    roles = [role for role in ("filter", "baseline") if role in table]
    is_gaussian = np.ones(len(table), bool)
    for role in roles:
        is_gaussian &= [pair not in not_gaussian for pair in zip(table["case"], table[role], strict=True)]
    return is_gaussian


def disagreements(
    tables_by_name: "Mapping[str, pd.DataFrame]",
    approximate_cases: Collection[str] = (),
    unchecked: Collection[str] = ("claims",),
    quantities: Sequence[Quantity] = (),
) -> list[str]:
    """A line for each column that is further off its exact values than chance explains: its furthest row.

    tables_by_name, approximate_cases, quantities: as for `standardised_errors`; unchecked: tables without exact values
    of the measured quantities, whatever their columns."""
    errors_by_column = {
        (name, column): standardised_errors(tables_by_name, name, column, approximate_cases, quantities)
        for name, table in tables_by_name.items()
        if name not in unchecked and "case" in table and len(table)
        for column in exact_columns(table)
    }
    count = sum(int((~np.isnan(errors)).sum()) for errors in errors_by_column.values())
    limit = max(ERROR_OF_PROGRAM, furthest(count))
    return [
        _disagreement(tables_by_name[name], name, column, errors, limit, count)
        for (name, column), errors in errors_by_column.items()
        if (errors > limit).any()
    ]


def _disagreement(
    table: "pd.DataFrame", name: str, column: ExactColumn, errors: np.ndarray, limit: float, count: int
) -> str:
    """The line on a column with errors (rows,) over the limit, the most that chance explains among `count`."""
    index = int(np.nanargmax(errors))
    row = table.iloc[index]
    scan = f"k = {row['k']:g}" + (f" ({row['t_s']:g} s)" if "t_s" in row else "") if "k" in row else ""
    return tr(
        "{table}.csv: {place}: {column} measured {measured:.6g}, exactly {exact:.6g}: "
        "{apart:.3g} standard errors apart; {count:,} of {rows:,} rows of this column exceed "
        "{bound:.3g}, the most that chance explains in {many:,}: the simulation or the exact value is "
        "wrong",
        table=name,
        place=", ".join(filter(None, (*(str(row[key]) for key in ROW_LABELS if key in row), scan))),
        column=column.value,
        measured=float(row[column.value]),
        exact=float(row[column.exact]),
        apart=float(errors[index]),
        bound=limit,
        many=count,
        count=int((errors > limit).sum()),
        rows=int((~np.isnan(errors)).sum()),
    )


def agreement(curves: "pd.DataFrame") -> "pd.DataFrame | None":
    """A row for each case, filter and component of curves.csv whose exact σ is known; None where none is."""
    known = curves[np.isfinite(curves["exact_sigma"]) & (curves["exact_sigma"] > 0) & np.isfinite(curves["sigma_lo"])]
    if not len(known):
        return None
    exact, sigma = known["exact_sigma"], known["sigma"]
    known = known.assign(
        inside=(known["sigma_lo"] <= exact) & (exact <= known["sigma_hi"]), difference=100 * (sigma / exact - 1)
    )
    rows = []
    for keys, scans in known.groupby(["case", "filter", "component"], sort=False):
        worst = scans.loc[scans["difference"].abs().idxmax()]
        share = 100 * float(scans["inside"].mean())
        rows.append((*keys, worst["unit"], len(scans), round(share, 1), float(worst["difference"]), int(worst["k"])))
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
HEAVY = RowNote("heavy_tails", f"under {EFFECTIVE} effective realisations, here or at a scan nearby: heavy tails")
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
ALIKE = RowNote("alike", "filters nearly alike: rare differences decide")
INDEPENDENT = 0.1
# User filters are paired one by one, so that the moments of the differences of squares are known. Those of a filter
# that differs a little in every realisation are products of Gaussians: n/8 of them count.
TAIL_OF_DIFFERENCES = 16
# Of every row of a table: what its interval is of, not that it rests on too little. What is computed at an estimate has
# a spread of its own: ratios of `sonar_manoeuvre` cover 93 %, one in twenty 31.
VARIES = RowNote("varies", "interval of sigma alone: the believed one varies from one realisation to the next")
# Tables that bring all their notes, and one whose mean squares are of several components and bounded: unmarked or
# marked by these rules, rows of NEES and NIS cover 95 … 97 %.
WITHOUT_RULES = ("rare", "consistency")
CURVE_KEY = ["case", "filter", "component", "k"]


def add_notes(
    tables_by_name: Mapping[str, "pd.DataFrame"],
    results: Sequence[CaseResult],
    exact: bool = True,
    quantities: Sequence[Quantity] = COMMON,
) -> "dict[str, pd.DataFrame]":
    """The tables by name; those with intervals and with a row that needs a note have the column.

    A table may bring notes of its own on rows that have no other. exact: whether the columns `exact_…` hold exact
    values, in place of bounds that the measured ones reach or not (`Study.exact_errors`). quantities: what the study
    measures.

    note: why a row rests on too few realisations or events for its interval; only in tables that have such a row"""
    return {
        name: _with_notes(
            name, table, tables_by_name, results, exact, [q for q in quantities if q.paired and q.table == name]
        )
        for name, table in tables_by_name.items()
    }


def _with_notes(
    name: str,
    table: "pd.DataFrame",
    tables_by_name: Mapping[str, "pd.DataFrame"],
    results: Sequence[CaseResult],
    exact: bool,
    paired: Sequence[Quantity],
) -> "pd.DataFrame":
    if not len(table) or "case" not in table or not any(str(column).endswith("_lo") for column in table):
        return table
    notes = table["note"].to_numpy(dtype=object) if "note" in table else np.full(len(table), "", dtype=object)
    table = table.drop(columns="note") if "note" in table else table
    if name not in WITHOUT_RULES:
        by_rules = heavy_tail_notes(*supporting_counts(table, tables_by_name, results))
        if paired:
            by_rules = notes_where((by_rules == "") & _alike(table, tables_by_name["curves"], paired), ALIKE, by_rules)
        notes = np.where(by_rules == "", notes, by_rules)
        notes = np.where(is_exact(table) & exact, "", notes)
    return table.assign(note=notes) if any(notes) else table


def is_exact(table: "pd.DataFrame") -> np.ndarray:
    """The rows (rows,) with exact values."""
    columns = [column for column in table if str(column).startswith("exact_") and column != "exact_bias"]
    return table[columns].notna().all(axis=1).to_numpy() & bool(columns)


def heavy_tail_notes(n: np.ndarray, effective: np.ndarray) -> np.ndarray:
    """The notes (rows,) on intervals of n realisations (rows,).

    effective: how many of them count where a few large errors decide, at the scan where they are fewest; NaN where
    errors have no tails, or nothing is known of them."""
    return notes_where(effective < np.minimum(EFFECTIVE, n / TAIL), HEAVY)


def nearby(curves: "pd.DataFrame") -> np.ndarray:
    """The fewest effective realisations (rows,) within NEARBY of the scans on either side, of a filter's component."""
    effective = curves["n_eff"].to_numpy(dtype=float)
    fewest = effective.copy()
    for rows in curves.groupby(CURVE_KEY[:3], sort=False).indices.values():
        fewest[rows] = _fewest_nearby(effective[rows])
    return fewest


def _fewest_nearby(values: np.ndarray) -> np.ndarray:
    """The least values (K, …) within NEARBY of the scans (K, …) on either side."""
    fewest = values.copy()
    for shift in range(1, min(max(1, round(NEARBY * len(values))) + 1, len(values))):
        fewest[shift:] = np.fmin(fewest[shift:], values[:-shift])
        fewest[:-shift] = np.fmin(fewest[:-shift], values[shift:])
    return fewest


def few_differ(square: np.ndarray, fourth: np.ndarray, n: np.ndarray) -> np.ndarray:
    """Whether few realisations decide the gain between two filters (F, K, C), at a scan or at one nearby.

    square, fourth: Σd² and Σd⁴ of the differences d of their squared errors, over n realisations."""
    with np.errstate(divide="ignore", invalid="ignore"):
        effective = square**2 / (fourth - square**2 / n)
    fewest = np.moveaxis(_fewest_nearby(np.moveaxis(effective, 1, 0)), 0, 1)
    return ~(fewest >= np.minimum(EFFECTIVE, n / TAIL_OF_DIFFERENCES))


def _alike(gains: "pd.DataFrame", curves: "pd.DataFrame", paired: Sequence[Quantity]) -> np.ndarray:
    """Which rows (rows,) compare filters that err nearly alike, by quantities in per cent of the baseline's σ."""
    bounds = ["sigma", "sigma_lo", "sigma_hi"]
    matching = gains[CURVE_KEY].merge(curves[[*CURVE_KEY, *bounds]], on=CURVE_KEY, how="left")
    sigma, low, high = (matching[bound].to_numpy(dtype=float) for bound in bounds)
    with np.errstate(invalid="ignore", divide="ignore"):
        independent = np.sqrt(2) * (high - low) / sigma
    are_alike = np.full(len(gains), False)
    for quantity in paired:
        (value, low, high), _ = quantity.read(gains)
        with np.errstate(invalid="ignore", divide="ignore"):  # a gain of 100 % leaves nothing to be alike
            width = (high - low) / (100 - value if quantity.more_is_better else 100 + value)
        are_alike |= (width < INDEPENDENT * independent) & (width > ROUNDING)
    return are_alike


def supporting_counts(
    table: "pd.DataFrame", tables_by_name: Mapping[str, "pd.DataFrame"], results: Sequence[CaseResult]
) -> tuple[np.ndarray, np.ndarray]:
    """For each row, the number of realisations that it is computed from, and the smallest effective number nearby.

    Taken from the row itself, else from the matching row of `curves`, else from the case. NaN where the effective
    number is unknown. For a gain, the smaller of the two filters' numbers counts."""
    if "n_eff" in table:
        return table["n"].to_numpy(dtype=float), nearby(table)

    if "n" in table:
        counts = table["n"].to_numpy(dtype=float)
    else:
        case_counts = {result.name: float(result.count) for result in results}
        counts = table["case"].map(case_counts).to_numpy(dtype=float)
    curves = tables_by_name["curves"]
    if not set(CURVE_KEY) <= set(table) or not len(curves):
        return counts, np.full(len(table), np.nan)

    curves = curves[[*CURVE_KEY, "n"]].assign(fewest=nearby(curves))
    curve_counts, effective = _counts_of_curves(table[CURVE_KEY], curves)
    if "baseline" in table:
        baseline_key = table[["case", "baseline", "component", "k"]].set_axis(CURVE_KEY, axis=1)
        _, baseline_effective = _counts_of_curves(baseline_key, curves)
        effective = np.fmin(effective, baseline_effective)
    if "n" not in table:
        counts = np.where(np.isnan(curve_counts), counts, curve_counts)
    return counts, effective


def _counts_of_curves(rows: "pd.DataFrame", curves: "pd.DataFrame") -> tuple[np.ndarray, np.ndarray]:
    """n and the fewest effective realisations of these rows in curves."""
    matching = rows.merge(curves, on=CURVE_KEY, how="left")
    return matching["n"].to_numpy(dtype=float), matching["fewest"].to_numpy(dtype=float)


# ---- of the answer ---------------------------------------------------------------------------------------------------
MAX_NAMES = 3  # named in a warning


def answer_warnings(
    results: Sequence[CaseResult], tables_by_name: "Mapping[str, pd.DataFrame]", answer: Sequence[Sentence]
) -> list[str]:
    """Warnings on the intervals that the answer rests on, at most a line each; and on weights with a wrong mean.

    The number of rows with a note is given where a table is shown."""
    warnings = few_realisations_warning(results) or narrow_interval_warning(results, tables_by_name, answer)
    return [*warnings, *rare.warnings(tables_by_name.get("rare"))]


def few_realisations_warning(results: Sequence[CaseResult]) -> list[str]:
    """A line on the cases whose intervals rest on too few realisations, if any."""
    counts = {result.name: result.count for result in results if result.count < FEW}
    if not counts:
        return []
    line = plural(
        "{cases}: intervals from {counts} realisation are rough: run at least {least}",
        "{cases}: intervals from {counts} realisations are rough: run at least {least}",
        max(counts.values()),
        cases=few(list(dict.fromkeys(counts)), MAX_NAMES),
        counts=files.span(list(counts.values())),
        least=FEW,
    )
    return [line]


def narrow_interval_warning(
    results: Sequence[CaseResult], tables_by_name: "Mapping[str, pd.DataFrame]", answer: Sequence[Sentence]
) -> list[str]:
    """A line on the answer's intervals that are too narrow, with the realisations that they need, if any are."""
    rows_by_table = affected_rows(tables_by_name, answer).values()
    if not rows_by_table:
        return []
    count = sum(map(len, rows_by_table))
    filters = few(list(dict.fromkeys(name for rows in rows_by_table for name in rows["filter"])), MAX_NAMES)
    enough = np.max(np.concatenate([needed_realisations(rows, tables_by_name, results) for rows in rows_by_table]))
    if np.isfinite(enough):  # it is NaN if the number is unknown for one of the rows
        line = plural(
            "{count} interval of the answer is too narrow because few realisations decide it ({filters}): "
            "run with -n {needed}",
            "{count} intervals of the answer are too narrow because few realisations decide them "
            "({filters}): run with -n {needed}",
            count,
            filters=filters,
            needed=roughly(float(enough)),
        )
    else:
        line = plural(
            "{count} interval of the answer may be too narrow because rare realisations decide it and few or "
            "none occurred ({filters}): run with a larger -n",
            "{count} intervals of the answer may be too narrow because rare realisations decide them and few "
            "or none occurred ({filters}): run with a larger -n",
            count,
            filters=filters,
        )
    return [line]


def affected_rows(
    tables_by_name: Mapping[str, "pd.DataFrame"], answer: Sequence[Sentence]
) -> "dict[str, pd.DataFrame]":
    """By table, the rows with a note on an interval that the answer rests on.

    A note on what an interval leaves out is no reason for a warning."""
    cited = {interval for sentence in answer for interval in sentence.intervals}
    rows_by_table = {}
    for name, table in tables_by_name.items():
        if "note" not in table:
            continue
        notes = table["note"].mask(note_kinds(table) == VARIES.kind, "")
        labels = {i.row for i in cited if i.table == name and concerns(notes.loc[i.row], i.name)}
        if labels:
            rows_by_table[name] = table.loc[sorted(labels)]
    return rows_by_table


def needed_realisations(
    rows: "pd.DataFrame", tables_by_name: Mapping[str, "pd.DataFrame"], results: Sequence[CaseResult]
) -> np.ndarray:
    """How many realisations (rows,) intervals with a note take, from the effective ones; NaN where unknown."""
    n, fewest = supporting_counts(rows.drop(columns="n_eff", errors="ignore"), tables_by_name, results)
    has_tails = (note_kinds(rows) == HEAVY.kind) & (fewest < EFFECTIVE)
    with np.errstate(divide="ignore"):
        return np.where(has_tails, n * EFFECTIVE / fewest, np.nan)


def roughly(count: float) -> str:
    """A number of realisations, rounded up to one digit, as `-n` takes it."""
    power = 10 ** math.floor(math.log10(max(count, 1.0)))
    return f"{math.ceil(count / power) * power:.0e}".replace("e+0", "e").replace("e+", "e")

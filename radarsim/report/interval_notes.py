"""The rules by which rows get a note, where an interval covers less than its 95 %.

An interval of σ takes the spread of e² from the sample. Where few of the realisations contribute most of that spread,
the interval is too narrow, and more so in the sample that happens to lack them. How many contribute is n/(κ − 1), the
effective realisations. They are counted at the row's own scan and at the scans near it, because the few that are
missing at one scan show at another. Gains have a further rule, because both filters may have nearly the same errors
except in a few realisations. A study that knows more about its rare errors (wrong folds, lost bursts) brings its own
notes.

A row with an exact value has no note by these rules: that value is better, whatever the interval. Measured coverage of
rows with and without notes is in docs/trust.md."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from radarsim.engine.results import CaseResult
from radarsim.report.exact_check import ROUNDING
from radarsim.report.quantities import COMMON, Quantity
from radarsim.report.row_notes import RowNote, concerns, has_note, notes_where

if TYPE_CHECKING:
    import pandas as pd


# Of 14 configs, rows whose n/(κ − 1) over all samples together is 100 … 200 cover 93.6 % on the mean, over that 94.4 …
# 95.2, 50 … 100 91, under 10 65 %.
MIN_EFFECTIVE = 100
HEAVY_TAILS = RowNote(
    "heavy_tails", f"under {MIN_EFFECTIVE} effective realisations, here or at a scan nearby: heavy tails"
)
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
ALIKE_FILTERS = RowNote("alike", "filters nearly alike: rare differences decide")
INDEPENDENT = 0.1
# User filters are paired one by one, so that the moments of the differences of squares are known. Those of a filter
# that differs a little in every realisation are products of Gaussians: n/8 of them count.
TAIL_OF_DIFFERENCES = 16
# Of every row of a table: what its interval is of, not that it rests on too little. What is computed at an estimate has
# a spread of its own: ratios of `sonar_manoeuvre` cover 93 %, one in twenty 31.
BELIEVED_VARIES = RowNote("varies", "interval of sigma alone: the believed one varies from one realisation to the next")
# Tables that bring all their notes; one whose mean squares are of several components and bounded: unmarked or marked by
# these rules, rows of NEES and NIS cover 95 … 97 %; and one of probabilities, of which the tail of σ tells nothing.
WITHOUT_RULES = ("rare", "consistency", "modes")
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
        by_rules = heavy_tail_notes(*estimate_counts(table, tables_by_name, results))
        if paired:
            by_rules = notes_where(
                (by_rules == "") & _alike(table, tables_by_name["curves"], paired), ALIKE_FILTERS, by_rules
            )
        by_rules = np.where(is_exact(table) & exact, "", by_rules)
        notes = np.where(by_rules == "", notes, by_rules)
    return table.assign(note=notes) if any(notes) else table


def without_noted_intervals(tables_by_name: Mapping[str, "pd.DataFrame"]) -> "dict[str, pd.DataFrame]":
    """The tables for figures: no ends of the intervals that a note marks as resting on too little."""
    return {name: _without_noted_intervals(table) for name, table in tables_by_name.items()}


def _without_noted_intervals(table: "pd.DataFrame") -> "pd.DataFrame":
    if not has_note(table).any():
        return table
    notes = ["" if str(note) == str(BELIEVED_VARIES) else note for note in table["note"]]
    ends = [column for column in map(str, table) if column.endswith(("_lo", "_hi"))]
    return table.assign(
        **{end: table[end].mask(np.array([concerns(note, end) for note in notes], dtype=bool)) for end in ends}
    )


def is_exact(table: "pd.DataFrame") -> np.ndarray:
    """The rows (rows,) with exact values."""
    columns = [column for column in table if str(column).startswith("exact_") and column != "exact_bias"]
    return table[columns].notna().all(axis=1).to_numpy() & bool(columns)


def heavy_tail_notes(n: np.ndarray, effective: np.ndarray) -> np.ndarray:
    """The notes (rows,) on intervals of n realisations (rows,).

    effective: how many of them count where a few large errors decide, at the scan where they are fewest; NaN where
    errors have no tails, or nothing is known of them."""
    return notes_where(effective < np.minimum(MIN_EFFECTIVE, n / TAIL), HEAVY_TAILS)


def fewest_effective_nearby(curves: "pd.DataFrame") -> np.ndarray:
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


def rests_on_few_differences(square: np.ndarray, fourth: np.ndarray, n: np.ndarray) -> np.ndarray:
    """Whether few realisations decide the gain between two filters (F, K, C), at a scan or at one nearby.

    square, fourth: Σd² and Σd⁴ of the differences d of their squared errors, over n realisations."""
    with np.errstate(divide="ignore", invalid="ignore"):
        effective = square**2 / (fourth - square**2 / n)
    fewest = np.moveaxis(_fewest_nearby(np.moveaxis(effective, 1, 0)), 0, 1)
    return ~(fewest >= np.minimum(MIN_EFFECTIVE, n / TAIL_OF_DIFFERENCES))


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


def estimate_counts(
    table: "pd.DataFrame", tables_by_name: Mapping[str, "pd.DataFrame"], results: Sequence[CaseResult]
) -> tuple[np.ndarray, np.ndarray]:
    """For each row, the number of realisations that it is computed from, and the smallest effective number nearby.

    Taken from the row itself, else from the matching row of `curves`, else from the case. NaN where the effective
    number is unknown. For a gain, the smaller of the two filters' numbers counts."""
    if "n_eff" in table:
        return table["n"].to_numpy(dtype=float), fewest_effective_nearby(table)

    if "n" in table:
        counts = table["n"].to_numpy(dtype=float)
    else:
        case_counts = {result.name: float(result.count) for result in results}
        counts = table["case"].map(case_counts).to_numpy(dtype=float)
    curves = tables_by_name["curves"]
    if not set(CURVE_KEY) <= set(table) or not len(curves):
        return counts, np.full(len(table), np.nan)

    curves = curves[[*CURVE_KEY, "n"]].assign(fewest=fewest_effective_nearby(curves))
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

"""Warnings on the intervals that an answer rests on, with the realisations that they need."""

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from radarsim.engine.results import CaseResult
from radarsim.language.translate import list_filters, plural, shorten_names
from radarsim.report import case_selection, provenance, rare_events
from radarsim.report.interval_notes import BELIEVED_VARIES, HEAVY_TAILS, MIN_EFFECTIVE, estimate_counts
from radarsim.report.row_notes import concerns, note_kinds
from radarsim.report.sentences import Sentence
from radarsim.report.statistics import MIN_TRUSTED_REALISATIONS

if TYPE_CHECKING:
    import pandas as pd


MAX_NAMES = 3  # named in a warning


def answer_warnings(
    results: Sequence[CaseResult], tables_by_name: "Mapping[str, pd.DataFrame]", answer: Sequence[Sentence]
) -> list[str]:
    """Warnings on the intervals that the answer rests on, at most a line each; and on weights with a wrong mean.

    The number of rows with a note is given where a table is shown."""
    warnings = few_realisations_warning(results) or narrow_interval_warning(results, tables_by_name, answer)
    return [*warnings, *rare_events.mean_weight_warnings(tables_by_name.get("rare"))]


def few_realisations_warning(results: Sequence[CaseResult]) -> list[str]:
    """A line on the cases whose intervals rest on too few realisations, if any."""
    counts = {result.name: result.count for result in results if result.count < MIN_TRUSTED_REALISATIONS}
    if not counts:
        return []
    line = plural(
        "{cases}: intervals from {counts} realisation are rough: run at least {least}",
        "{cases}: intervals from {counts} realisations are rough: run at least {least}",
        max(counts.values()),
        cases=shorten_names(list(dict.fromkeys(counts)), MAX_NAMES),
        counts=provenance.span(list(counts.values())),
        least=MIN_TRUSTED_REALISATIONS,
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
    filters = _filters_and_cases(rows_by_table, results)
    enough = np.max(np.concatenate([needed_realisations(rows, tables_by_name, results) for rows in rows_by_table]))
    if np.isfinite(enough):  # it is NaN if the number is unknown for one of the rows
        line = plural(
            "An interval of the answer is too narrow ({filters}): few realisations decide it. Run with -n {needed}.",
            "{count} intervals of the answer are too narrow ({filters}): few realisations decide them. Run with -n "
            "{needed}.",
            count,
            filters=filters,
            needed=roughly(float(enough)),
        )
    else:
        line = plural(
            "An interval of the answer may be too narrow ({filters}): few of the rare realisations that decide it "
            "occurred. Run with a larger -n.",
            "{count} intervals of the answer may be too narrow ({filters}): few of the rare realisations that decide "
            "them occurred. Run with a larger -n.",
            count,
            filters=filters,
        )
    return [line]


def _filters_and_cases(rows_by_table: "Iterable[pd.DataFrame]", results: Sequence[CaseResult]) -> str:
    """The filters of rows; with their cases, where there are several."""
    rows_by_table = list(rows_by_table)
    filters = list_filters(dict.fromkeys(name for rows in rows_by_table for name in rows["filter"]), MAX_NAMES)
    if len(results) < 2:
        return filters
    names = dict(zip((r.name for r in results), case_selection.distinct_case_names(results), strict=True))
    cases = dict.fromkeys(names[case] for rows in rows_by_table for case in rows["case"])
    return f"{filters}; {shorten_names(list(cases), MAX_NAMES)}"


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
        notes = table["note"].mask(note_kinds(table) == BELIEVED_VARIES.kind, "")
        labels = {i.row for i in cited if i.table == name and concerns(notes.loc[i.row], i.name)}
        if labels:
            rows_by_table[name] = table.loc[sorted(labels)]
    return rows_by_table


def needed_realisations(
    rows: "pd.DataFrame", tables_by_name: Mapping[str, "pd.DataFrame"], results: Sequence[CaseResult]
) -> np.ndarray:
    """How many realisations (rows,) intervals with a note take, from the effective ones; NaN where unknown."""
    n, fewest = estimate_counts(rows.drop(columns="n_eff", errors="ignore"), tables_by_name, results)
    has_tails = (note_kinds(rows) == HEAVY_TAILS.kind) & (fewest < MIN_EFFECTIVE)
    with np.errstate(divide="ignore"):
        return np.where(has_tails, n * MIN_EFFECTIVE / fewest, np.nan)


def roughly(count: float) -> str:
    """A number of realisations, rounded up to one digit, as `-n` takes it."""
    power = 10 ** math.floor(math.log10(max(count, 1.0)))
    return f"{math.ceil(count / power) * power:.0e}".replace("e+0", "e").replace("e+", "e")

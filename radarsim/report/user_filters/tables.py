"""Tables with the rows of user filters beside those of a config: `CaseResult.user_filters`.

The study's own tables stay as they are; rows of user filters stand below. Their gains are relative to every filter of
the config, each over the realisations in which both have an estimate."""

from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from radarsim.engine.results import CaseResult
from radarsim.language.translate import term
from radarsim.report import consistency_tables, interval_notes, statistics
from radarsim.report import tables as common
from radarsim.report.row_notes import note_kinds
from radarsim.report.user_filters.rows import TablesByName, append, user_filter_cases

if TYPE_CHECKING:
    import pandas as pd


ROUNDING = 1e-6  # per cent: half-width of a gain that is nought but for rounding, whose variance is a difference
SINGLE = 1e-3  # per cent: width of the interval of a gain that is nought but for rounding to single precision
IMPROPER = "not_positive_definite"  # covariances, counted after the reasons of failures
REASONS = {  # in the order of the sums
    "not_a_number": term("not a number after an estimate:"),
    "no_estimate": term("no estimate:"),
    "diverged": term("over 100 times the largest error of the config's filters:"),
}


def baseline_names(result: CaseResult) -> tuple[str, ...]:
    """What gains may be against: the config's filters, its baseline first, then user filters."""
    filters, b = result.axes.filters, result.axes.baseline
    user_filters = (name for case in user_filter_cases(result) for name in case.axes.filters)
    return (filters[b], *filters[:b], *filters[b + 1 :], *user_filters)


def gains(result: CaseResult) -> common.Columns:
    """Gains of the user filters of one case against all that come before them; then of the config's own against those
    that it names as baselines."""
    return common.stack_columns([_paired_gains(*pair) for pair in _paired_sums(result)])


def _paired_sums(result: CaseResult) -> Iterator[tuple[np.ndarray, str, CaseResult]]:
    """Of every baseline its sums (F, K, C, 7) with a case's filters, its name, and the case."""
    for user_case in user_filter_cases(result):
        both, filters = np.asarray(user_case.sums["both"]), (*result.axes.filters, *user_case.axes.filters)
        yield from ((both[:, filters.index(baseline)], baseline, user_case) for baseline in baseline_names(result))
        for baseline in user_case.axes.baselines:
            sums = both[user_case.axes.filters.index(baseline), : len(result.axes.filters)]
            yield sums[..., [0, 3, 4, 1, 2, 5, 6]], baseline, result


def _rests_on_few(result: CaseResult) -> np.ndarray:
    """Which gains (rows,) rest on the few realisations in which two filters differ much."""
    by_pair = []
    for both, _, case in _paired_sums(result):
        index = common.row_index(case, both[..., 0] > 0)
        n, _, fourth_1, _, fourth_2, cross, fourth = np.moveaxis(both, -1, 0)
        by_pair.append(interval_notes.rests_on_few_differences(fourth_1 + fourth_2 - 2 * cross, fourth, n)[index])
    return np.concatenate(by_pair)


def _paired_gains(both: np.ndarray, baseline: str, case: CaseResult) -> common.Columns:
    """Gains of a case's filters from sums (F, K, C, 7) with those of a baseline."""
    index = f, k, c = common.row_index(case, both[..., 0] > 0)
    n, square, fourth, base_square, base_fourth, cross, _ = np.moveaxis(both[index], -1, 0)
    gain = statistics.gain(square, fourth, base_square, base_fourth, cross, n)
    return {
        **common.label_columns(
            case, f, k, baseline=np.full(f.size, baseline, dtype=object), **common.component_columns(case, c)
        ),
        "gain_percent|gain": statistics.Estimate(gain.value, gain.lo - ROUNDING, gain.hi + ROUNDING),
        "exact_percent": np.full(f.size, np.nan),
    }


def failure_columns(result: CaseResult) -> common.Columns:
    """How often a user filter fails, by the reason; σ and gains count the others.

    reason: `any`, or `not_a_number` after an estimate, `no_estimate` though a filter of the config has one, `diverged`
        with an error over a hundred times the largest of the config's filters in the realisation; no failure, but no
        part of NEES, is `not_positive_definite`, a covariance
    failed: realisations
    share ±: of all realisations"""
    rows = []
    for case in user_filter_cases(result):
        covariances = (np.asarray(case.sums["nees"])[..., 0] > 0).sum(1)
        for f, (name, counts) in enumerate(zip(case.axes.filters, np.asarray(case.sums["failures"]), strict=True)):
            for reason, count in (("any", counts[:3].sum()), *zip((*REASONS, IMPROPER), counts, strict=True)):
                if reason == IMPROPER and not (count or covariances[f]):
                    continue
                share = statistics.rate(count, case.count)
                row = {"case": case.name, "filter": name, "reason": reason, "n": case.count, "failed": int(count)}
                rows.append(row | {"share": statistics.Estimate(*map(float, share))})
    return common.columns_from_rows(rows)


def nees_columns(result: CaseResult) -> common.Columns:
    """NEES of the components that a user filter estimates, where it gives covariances.

    The bounds are those of the config's filters: of a chi-square law where the study knows the law of its own NEES,
    else from the spread of the realisations."""
    parts: list[common.Columns] = []
    for case in user_filter_cases(result):
        sums = np.asarray(case.sums["nees"])
        f, k = np.nonzero(sums[..., 0] > 1)
        n, total, square = np.moveaxis(sums[f, k], -1, 0)
        if hasattr(result.axes, "exact_nees"):
            looks = int(np.asarray(result.axes.available).any(axis=2).sum(axis=1).max())
            size = np.asarray(case.axes.available).sum(axis=2)[f, k]
            bounds = statistics.normalised_bounds(size * n, np.full(n.shape, looks))
        else:
            looks = int((sums[..., 0] > 1).sum(1).max(initial=1))
            bounds = consistency_tables.bounds_from_spread(total, square, n, looks)
        mean = statistics.mean_square(total, square, n)
        parts.append(
            {
                **common.label_columns(case, f, k),
                "n": n.astype(np.int64),
                **consistency_tables.normalised_square_columns("nees", mean, bounds),
            }
        )
    return common.stack_columns(parts)


def with_user_filters(
    tables_by_name: TablesByName, results: Sequence[CaseResult], measured_rows: TablesByName
) -> "dict[str, pd.DataFrame]":
    """The tables with the rows of user filters below their own; measured_rows: of the function of that name."""
    if not measured_rows:
        return dict(tables_by_name)
    results_with_filters = [result for result in results if result.user_filters is not None]
    user_cases = [case for result in results for case in user_filter_cases(result)]
    count = len(measured_rows["curves"])
    rows = {"curves": append(tables_by_name["curves"], measured_rows["curves"]), "gains": measured_rows["gains"]}
    rows = interval_notes.add_notes(rows, [*results, *user_cases], exact=False)
    rows["gains"] = _without_needless_notes(rows["gains"], results_with_filters)
    rows["curves"] = rows["curves"].tail(count)
    for name, table in rows.items():
        if "note" in table and not table["note"].any():
            rows[name] = table.drop(columns="note")
    rows["failures"] = common.join_columns(map(failure_columns, results_with_filters))
    rows["nees"] = common.join_columns(map(nees_columns, results_with_filters))
    appended = {
        name: append(tables_by_name[name], without_intervals(table, results_with_filters))
        if name in tables_by_name
        else without_intervals(table, results_with_filters)
        for name, table in rows.items()
        if len(table)
    }
    return {**tables_by_name, **appended}


def _without_needless_notes(gains: "pd.DataFrame", results_with_filters: Sequence[CaseResult]) -> "pd.DataFrame":
    """Gains without notes where both filters are the same but for rounding, or differ a little in every realisation."""
    if "note" not in gains:
        return gains
    is_equal = gains["gain_hi"] - gains["gain_lo"] < SINGLE
    rests_on_few = np.concatenate([_rests_on_few(result) for result in results_with_filters])
    differs_everywhere = (note_kinds(gains) == interval_notes.ALIKE_FILTERS.kind) & ~rests_on_few
    return gains.assign(note=gains["note"].mask(is_equal | differs_everywhere, ""))


def measured_rows(results: Sequence[CaseResult]) -> TablesByName:
    """The curves and gains of user filters; nothing where there are none."""
    results_with_filters = [result for result in results if result.user_filters is not None]
    if not results_with_filters:
        return {}
    user_cases = [case for result in results_with_filters for case in user_filter_cases(result)]
    return {
        "curves": without_intervals(common.curves(user_cases), results_with_filters),
        "gains": without_intervals(
            common.join_columns(map(gains, results_with_filters), common.GAINS), results_with_filters
        ),
    }


def without_intervals(table: "pd.DataFrame", results: Sequence[CaseResult]) -> "pd.DataFrame":
    """A table without the ends of intervals that do not hold: of filters whose realisations depend on each other."""
    cases = [case for result in results for case in user_filter_cases(result)]
    names = {(case.name, name) for case in cases for name, _ in case.axes.dependent}
    if not names or not len(table):
        return table
    rows = np.full(len(table), False)
    for label in ("filter", "baseline"):
        if label in table:
            rows |= [pair in names for pair in zip(table["case"], table[label], strict=True)]
    ends = [str(column) for column in table if str(column).endswith(("_lo", "_hi"))]
    return table.assign(**{end: table[end].mask(rows) for end in ends})


def table_with_user_filters(name: str, table: "Callable[[Sequence[CaseResult]], pd.DataFrame]") -> Any:
    """A table of the study, made from results, with the rows of user filters: curves or gains."""

    def make_table(results: Sequence[CaseResult]) -> "pd.DataFrame":
        results_with_filters = [result for result in results if result.user_filters is not None]
        study_rows = table(results)
        rows = measured_rows(results_with_filters)
        return append(study_rows, rows[name]) if name in rows else study_rows

    return make_table

"""Rows of user filters in tables: added below those of a study, and taken out again. Most results have none."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from radarsim.engine.results import CaseResult
from radarsim.report import tables as common

if TYPE_CHECKING:
    import pandas as pd


TablesByName = Mapping[str, "pd.DataFrame"]


def user_filter_cases(result: CaseResult) -> list[CaseResult]:
    """The user filters of a result as a case; none where it has none."""
    return [] if result.user_filters is None else [result.user_filters]


def tables_for_claims(tables_by_name: TablesByName, measured_rows: TablesByName) -> TablesByName:
    """The tables with the measured rows below their own."""
    appended = {name: append(tables_by_name[name], table) for name, table in measured_rows.items()}
    return {**tables_by_name, **appended}


def without_user_filters(tables_by_name: TablesByName, results: Sequence[CaseResult]) -> TablesByName:
    """The tables without the rows of user filters, as the study made them."""
    user_filters = {name for result in results for case in user_filter_cases(result) for name in case.axes.filters}
    if not user_filters:
        return tables_by_name
    study_rows = {}
    for name in ("curves", "gains"):
        table = tables_by_name[name]
        labels = table.loc[:, table.columns.isin(("filter", "baseline"))]
        study_rows[name] = table[~labels.isin(user_filters).any(axis=1)]
    return {**study_rows, **{name: table for name, table in tables_by_name.items() if name not in study_rows}}


def append(table: "pd.DataFrame", rows: "pd.DataFrame") -> "pd.DataFrame":
    """Rows below those of a table, whose columns they get, and `note`; empty cells where they lack one."""
    columns = [*table, *(["note"] if "note" in rows and "note" not in table else [])]

    def filled(part: "pd.DataFrame", reference: "pd.DataFrame") -> "pd.DataFrame":
        blank = {n: "" if n == "note" or reference[n].dtype == object else np.nan for n in columns if n not in part}
        return part.assign(**blank)[columns]

    return common.stack_tables([filled(table, rows), filled(rows, table)]) if len(table) else rows

"""The claims that a result judges: claims.csv with its classes, and the claims by class."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from radarsim.api import configs
from radarsim.engine.results import CaseResult
from radarsim.errors import ConfigError
from radarsim.papers.claim_rows import CLASS_ORDER, EXTENSION_ENDING, group_by_claim, is_extension
from radarsim.papers.claims_table import NOT_JUDGED, NOT_RUN_CELLS, NUMBER_COLUMNS, claims_table, first_rows
from radarsim.papers.outdated_verdicts import current_marks, current_rows
from radarsim.papers.stored_verdicts import known_classes
from radarsim.papers.study_claims import choices_of, claims_of
from radarsim.papers.verdict_classes import CLASS_COLUMNS, add_classes, declaration_digest, is_judged_only_as_shipped
from radarsim.report.tables import frame
from radarsim.report.user_filters import rows as user_filters_rows
from radarsim.studies.registry import is_study, study

if TYPE_CHECKING:
    import pandas as pd

    from radarsim.api.result import Result
    from radarsim.extensions import Tables


def claims_of_results(
    results: Sequence[CaseResult], measured: "Tables", user_filters: "Tables", stem: str
) -> "pd.DataFrame":
    """claims.csv of results, with the shipped classes; see `Extension.tables`."""
    tables = user_filters_rows.tables_for_claims(measured, user_filters)
    case_study = study(results[0].study)
    paper_claims, choices = claims_of(case_study), choices_of(case_study)
    verdicts = claims_table(paper_claims, results, tables, configs.shipped, stem)
    claims = paper_claims.claims if paper_claims and len(verdicts) else ()
    marks = {claim.id: declaration_digest(choices, claim) for claim in claims}
    marked = verdicts.assign(declared=[marks[claim] for claim in verdicts["claim"]])
    return with_stored_classes(marked, results[0].study)


def without_outdated_verdicts(claims: "pd.DataFrame", study_name: str) -> "pd.DataFrame":
    """claims.csv as it was stored, with claims that have been edited since as not run: all of them where the study's
    claims cannot be read, none where there is no such study here."""
    if not is_study(study_name):
        return claims
    try:
        case_study = study(study_name)
        papers, marks = [claims_of(case_study)], current_marks(case_study)
    except ConfigError:
        papers, marks = [], {}
    stored: Any = claims.to_dict("records")
    rows = current_rows(stored, [paper for paper in papers if paper], marks)
    if not papers:
        rows = [dict(row) | NOT_RUN_CELLS for row in first_rows(stored)]
    if rows == stored:
        return claims
    columns = {str(name): [row.get(str(name), "") for row in rows] for name in claims}
    numbers = {name: [math.nan if cell == "" else cell for cell in columns[name]] for name in NUMBER_COLUMNS}
    return frame({**columns, **numbers})


def with_stored_classes(claims: "pd.DataFrame", study_name: str, out: Path | None = None) -> "pd.DataFrame":
    """claims.csv of a study with the classes over all interpretations: those stored under `out`, else the shipped."""
    paper_claims, choices = claims_of(study(study_name)), choices_of(study(study_name))
    if choices is None or paper_claims is None or not len(claims):
        return claims
    records: Any = claims.to_dict("records")
    marks = {row["claim"]: row["declared"] for row in records if row["declared"]}
    rows = add_classes(records, known_classes([(choices, paper_claims)], out, marks))
    return claims.assign(**{column: [row[column] for row in rows] for column in CLASS_COLUMNS})


def claims_by_class(result: "Result", column: str = "class") -> dict[str, list[str]]:
    """The claims of a result by their class over all interpretations, or `as_shipped`; extensions apart."""
    by_class: dict[str, list[str]] = {}
    rows = group_by_claim(_records(result))
    for parts in sorted(rows, key=lambda parts: CLASS_ORDER.index(parts[0][column])):
        kind = parts[0][column] + (EXTENSION_ENDING if is_extension(parts) else "")
        by_class.setdefault(kind, []).append(parts[0]["claim"])
    return by_class


def unjudged_claims(result: "Result") -> dict[str, list[str]]:
    """The claims of a result's config that it does not judge, or not in every part, by reason."""
    by_reason: dict[str, list[str]] = {}
    for row in _records(result):
        if row["verdict"] == NOT_JUDGED:
            names = by_reason.setdefault(row["reason"], [])
            if row["claim"] not in names:
                names.append(row["claim"])
    return by_reason


def claims_judged_only_as_shipped(result: "Result") -> list[str]:
    """Claims judged under the shipped interpretation alone, although they depend on an open choice of their paper."""
    return [row["claim"] for row in first_rows(_records(result)) if is_judged_only_as_shipped(row)]


def _records(result: "Result") -> list[dict[str, Any]]:
    records: Any = result.table("claims").to_dict("records")
    return list(records)

"""What `radarsim interpretations` writes: interpretations.csv, classes.csv, curves, pages and JSON documents."""

import csv
import io
from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import Any

from radarsim.api import configs
from radarsim.api.progress import TimedProgress
from radarsim.errors import StoreError
from radarsim.papers.claims_table import NOT_JUDGED
from radarsim.papers.interpretation_verdicts import InterpretationVerdicts
from radarsim.papers.open_papers import open_papers
from radarsim.papers.stored_verdicts import CLASSES, TABLE, stored_claims, stored_classes, stored_interpretations
from radarsim.papers.verdict_classes import CLASS_FILE_COLUMNS
from radarsim.papers.verdicts_by_interpretation import (
    InterpretationVerdict,
    verdict_class,
    verdict_columns,
    verdict_rows,
)
from radarsim.report import atomic_files, provenance
from radarsim.report.stored_tables import find_record


def write_files(verdicts: InterpretationVerdicts, figures: bool, forecast: TimedProgress) -> tuple[str, ...]:
    """Write the table, with the stored rows of other claims, and a curve for each claim."""
    contents = {TABLE.name: _interpretations_csv(verdicts).encode(), CLASSES.name: _classes_csv(verdicts).encode()}
    figures_by_name = verdicts._figures_by_name if figures else {}
    for name, figure in figures_by_name.items():
        from radarsim.report.drawing.canvas import save  # Matplotlib

        with forecast.measure_unit("figure"):
            contents[f"{name}.svg"] = save(figure, ("svg",))["svg"]
    atomic_files.replace_all(verdicts.folder, contents)
    return tuple(sorted(contents))


def _interpretations_csv(verdicts: InterpretationVerdicts) -> str:
    """The rows of these claims and the stored rows of others, with the choices of the papers of both."""
    judged = {claim.claim.id for claim in verdicts.claims}
    stored_rows = [row for row in stored_interpretations(verdicts.folder.parent) if row["claim"] not in judged]
    papers = {claim.partition(".")[0] for claim in (*judged, *(row["claim"] for row in stored_rows))}
    columns = verdict_columns(paper.interpretations for key, paper in open_papers().items() if key in papers)
    rows = [
        row
        for claim in verdicts.claims
        for verdict in claim.verdicts
        for row in verdict_rows(verdict, columns, claim.outcome)
    ]
    return _merged_csv(columns, stored_rows, rows, judged)


def _classes_csv(verdicts: InterpretationVerdicts) -> str:
    """The class of each claim over its interpretations."""
    rows = [verdict.as_row() for claim in verdicts.claims if (verdict := verdict_class(claim)) is not None]
    stored_rows = [stored.as_row() for stored in stored_classes(verdicts.folder.parent)]
    return _merged_csv(CLASS_FILE_COLUMNS, stored_rows, rows, {claim.claim.id for claim in verdicts.claims})


def outdated_configs(verdicts: InterpretationVerdicts) -> tuple[str, ...]:
    """Configs whose stored claims differ in class from their interpretations now. Except configs that have changed
    since their run: their stored results make no report."""
    judged = {claim.claim.id: claim for claim in verdicts.claims if claim.outcome}
    stems = []
    for config in dict.fromkeys(claim.claim.config for claim in judged.values()):
        folder = verdicts.folder.parent / config
        with suppress(StoreError):  # `radarsim claims` reports a damaged one
            record = find_record(folder)
            if record is None or not provenance.is_same_config(record["resolved"], configs.load(config).resolved):
                continue
            for row in stored_claims(folder) or ():
                outcome = judged[row["claim"]].outcome if row["claim"] in judged else None
                if outcome and row["class"] not in (NOT_JUDGED, outcome.kind):
                    stems.append(config)
    return tuple(dict.fromkeys(stems))


def _merged_csv(
    columns: Sequence[str], stored_rows: Sequence[Mapping], new_rows: Sequence[Mapping], claims: set[str]
) -> str:
    """New rows and the stored rows of other claims."""
    text = io.StringIO(newline="")
    table = csv.writer(text, lineterminator="\n")
    table.writerow(columns)
    rows = sorted(
        [*(row for row in stored_rows if row["claim"] not in claims), *new_rows],
        key=lambda row: _claim_order(row["claim"]),
    )
    table.writerows([row.get(name, "") for name in columns] for row in rows)
    return text.getvalue()


def _claim_order(claim: str) -> tuple[str, float, str]:
    """P1.2 before P1.10."""
    paper, _, number = claim.partition(".")
    digits = number.rstrip("abcdefghijklmnopqrstuvwxyz")
    return paper, float(digits) if digits.isdigit() else 0.0, number


def markdown_pages(verdicts: InterpretationVerdicts) -> str:
    """The page of each paper, one after the other."""
    from radarsim.papers import interpretations_page

    return "\n".join(
        interpretations_page.interpretations_page(paper.paper.interpretations, paper.paper.claims.paper, paper.claims)
        for paper in verdicts.papers
    )


def json_documents(verdicts: InterpretationVerdicts) -> list[dict[str, Any]]:
    """The documents of --json: one for each claim, with every interpretation."""
    documents = []
    for claim in verdicts.claims:
        outcome = claim.outcome
        documents.append(
            {
                "claim": claim.claim.id,
                "verdict": outcome.words if outcome else "not judged",
                **{"holds": outcome and outcome.holds_in, "of": outcome and outcome.interpretations},
                "depends_on": list(outcome.depends_on) if outcome else [],
                "interpretations": [_interpretation_document(verdict) for verdict in claim.verdicts],
            }
        )
    return documents


def _interpretation_document(verdict: InterpretationVerdict) -> dict[str, Any]:
    return {
        "interpretation": verdict.name,
        "kind": verdict.kind,
        "choices": dict(verdict.interpretation.alternatives),
        "verdict": verdict.outcome.kind if verdict.outcome else None,
        "miss": verdict.outcome.miss if verdict.outcome else None,
        "reason": verdict.why or None,
    }

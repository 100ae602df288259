"""What `radarsim interpretations` writes: interpretations.csv, classes.csv, curves, pages and JSON documents."""

import csv
import io
from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import Any

from radarsim.app import configs
from radarsim.app.ahead import Ahead
from radarsim.errors import StoreError
from radarsim.papers.claims_table import NOT_JUDGED
from radarsim.papers.interpretation_verdicts import InterpretationVerdicts
from radarsim.papers.open_papers import open_papers
from radarsim.papers.stored_verdicts import CLASSES, TABLE, stored_claims, stored_classes, stored_interpretations
from radarsim.papers.verdict_classes import CLASS_FILE_COLUMNS, verdict_class
from radarsim.papers.verdicts_by_interpretation import InterpretationVerdict, verdict_columns, verdict_rows
from radarsim.report import files


def write_files(done: InterpretationVerdicts, figures: bool, ahead: Ahead) -> tuple[str, ...]:
    """Write the table, with the stored rows of other claims, and a curve for each claim."""
    contents = {TABLE.name: _interpretations_csv(done).encode(), CLASSES.name: _classes_csv(done).encode()}
    described = done._described if figures else {}
    for name, figure in described.items():
        from radarsim.report.figures import save  # Matplotlib

        with ahead.doing("figure"):
            contents[f"{name}.svg"] = save(figure, ("svg",))["svg"]
    files.replace_all(done.folder, contents)
    return tuple(sorted(contents))


def _interpretations_csv(done: InterpretationVerdicts) -> str:
    names = verdict_columns(paper.interpretations for paper in open_papers().values())
    new = [row for over in done.over for one in over.under for row in verdict_rows(one, names, over.outcome)]
    return _merged_csv(names, stored_interpretations(done.folder.parent), new, {over.claim.id for over in done.over})


def _classes_csv(done: InterpretationVerdicts) -> str:
    """The class of each claim over its interpretations."""
    new = [found.as_row() for over in done.over if (found := verdict_class(over)) is not None]
    kept = [one.as_row() for one in stored_classes(done.folder.parent)]
    return _merged_csv(CLASS_FILE_COLUMNS, kept, new, {over.claim.id for over in done.over})


def outdated_configs(done: InterpretationVerdicts) -> tuple[str, ...]:
    """Configs whose stored claims differ in class from their interpretations now. Except configs that have changed
    since their run: their stored results make no report."""
    new = {over.claim.id: over for over in done.over if over.outcome}
    found = []
    for config in dict.fromkeys(over.claim.config for over in new.values()):
        if not files.is_of(done.folder.parent / config, configs.load(config)):
            continue
        with suppress(StoreError):  # `radarsim claims` reports a damaged one
            for row in stored_claims(done.folder.parent / config / "claims.csv") or ():
                outcome = new[row["claim"]].outcome if row["claim"] in new else None
                if outcome and row["class"] not in (NOT_JUDGED, outcome.kind):
                    found.append(config)
    return tuple(dict.fromkeys(found))


def _merged_csv(names: Sequence[str], stored: Sequence[Mapping], new: Sequence[Mapping], own: set[str]) -> str:
    """New rows and the stored rows of other claims."""
    text = io.StringIO(newline="")
    table = csv.writer(text, lineterminator="\n")
    table.writerow(names)
    every = sorted(
        [*(row for row in stored if row["claim"] not in own), *new], key=lambda row: _claim_order(row["claim"])
    )
    table.writerows([row.get(name, "") for name in names] for row in every)
    return text.getvalue()


def _claim_order(claim: str) -> tuple[str, float, str]:
    """P1.2 before P1.10."""
    paper, _, number = claim.partition(".")
    digits = number.rstrip("abcdefghijklmnopqrstuvwxyz")
    return paper, float(digits) if digits.isdigit() else 0.0, number


def markdown_pages(done: InterpretationVerdicts) -> str:
    """The page of each paper, one after the other."""
    from radarsim.papers import interpretations_page

    return "\n".join(
        interpretations_page.interpretations_page(read.paper.interpretations, read.paper.claims.paper, read.over)
        for read in done.read
    )


def json_documents(done: InterpretationVerdicts) -> list[dict[str, Any]]:
    """The documents of --json: one for each claim, with every interpretation."""
    found = []
    for over in done.over:
        outcome = over.outcome
        found.append(
            {
                "claim": over.claim.id,
                "verdict": outcome.words if outcome else "not judged",
                **{"holds": outcome and outcome.holds_in, "of": outcome and outcome.interpretations},
                "depends_on": list(outcome.depends_on) if outcome else [],
                "interpretations": [_interpretation_document(one) for one in over.under],
            }
        )
    return found


def _interpretation_document(one: InterpretationVerdict) -> dict[str, Any]:
    return {
        "interpretation": one.name,
        "kind": one.kind,
        "choices": dict(one.interpretation.taken),
        "verdict": one.outcome.kind if one.outcome else None,
        "miss": one.outcome.miss if one.outcome else None,
        "reason": one.why or None,
    }

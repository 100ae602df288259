"""The claims in a result's page, and in the index of results."""

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from radarsim.errors import ConfigError, StoreError
from radarsim.extensions import IndexEntry, ReportSection
from radarsim.language.translate import term, tr
from radarsim.papers.claim_rows import (
    classes_in_words,
    expected_words,
    group_by_claim,
    is_extension,
    shown_interval,
    verdict_sentence,
)
from radarsim.papers.claims_table import NOT_RUN_CELLS, TABLES_READ
from radarsim.papers.outdated_verdicts import current_marks, current_rows
from radarsim.papers.reasons import translate_reason
from radarsim.papers.stored_verdicts import FILE, recorded_claims
from radarsim.papers.study_claims import choices_of, claims_of
from radarsim.papers.verdict_classes import rows_in_words
from radarsim.report import page_tables, render_page, typeset
from radarsim.report.stored_tables import TableKind, find_record, read_rows
from radarsim.studies.registry import is_study, study

if TYPE_CHECKING:
    import pandas as pd
    from markupsafe import Markup

    from radarsim.extensions import Tables

OF_PAPER, OURS = GROUPS = (term("of the paper"), term("ours"))  # claims of a page
MAX_LINKED_FIGURES = 3  # from one claim
HEADING = term("claims")  # of the index's column
INDEX_TABLE = TableKind("table of claims", ("claim", "paper", "class"))  # of any version
MARKED_CLASSES = ("confirmed", "refuted")

TablesRead = Sequence[tuple[str, str]]  # tables, with the component that was read or nothing


def claims_section(
    tables: "Tables",
    titles: Mapping[str, str],
    sources: Mapping[str, Sequence[str]],
    written: Collection[str],
    study_name: str,
) -> ReportSection | None:
    """The claims of a result with their parts, and links from its figures to them; see `Extension.report_section`."""
    claims = _claims(tables["claims"], sources, written, study_name)
    if not claims:
        return None
    rows: Any = tables["claims"].to_dict("records")
    groups = [(heading, [claim for claim in claims if claim["ours"] == (heading == OURS)]) for heading in GROUPS]
    content = {"groups": [group for group in groups if group[1]], "verdicts": classes_in_words(rows), "titles": titles}
    links = {
        name: _fragment("links.html.j2", claims=[claim["id"] for claim in claims if name in claim["figures"]])
        for name in sources
    }
    return ReportSection(_fragment("claims.html.j2", **content), _fragment("rule.html.j2"), links)


def _fragment(template: str, **content: object) -> "Markup":
    filters: dict[str, Callable[..., str]] = {
        "expected": expected_words,
        "reason": translate_reason,
        "measured": _measured_value,
        "bounds": _interval,
        "css": _css_class,
    }
    return render_page.fragment("radarsim.papers", template, filters, **content)


def _claims(
    table: "pd.DataFrame", sources: Mapping[str, Sequence[str]], written: Collection[str], study_name: str
) -> list[dict[str, Any]]:
    """Claims with their parts, from claims.csv's rows, with the figures and tables behind each."""
    tables_read = table.attrs.get(TABLES_READ, [()] * len(table))
    records: Any = table.to_dict("records")
    rows = [row | {TABLES_READ: part_tables} for row, part_tables in zip(records, tables_read, strict=True)]
    claims = []
    for parts in group_by_claim(rows_in_words(rows, [choices_of(study(study_name))])):
        read = list(dict.fromkeys(table for part in parts for table in part[TABLES_READ]))
        columns = ("statement", "paper", "place", "interpretation", "original", "overall", "class")
        claims.append(
            {
                **{column: parts[0][column] for column in columns},
                "id": parts[0]["claim"],
                "verdict": verdict_sentence(parts).replace("*", ""),
                "parts": parts,
                "ours": is_extension(parts),
                "figures": linked_figures(read, sources),
                "tables": list(dict.fromkeys(name for name, _ in read if name in written)),
            }
        )
    return claims


def linked_figures(tables_read: TablesRead, sources: Mapping[str, Sequence[str]]) -> list[str]:
    """The figures that show the tables read by a claim, and of these its component's own if there is one."""
    figures: list[str] = []
    for table, component in tables_read:
        showing = [name for name, tables in sources.items() if table in tables]
        of_component = [name for name in showing if component and name.endswith(f"_{component}")]
        figures += of_component or showing
    return list(dict.fromkeys(figures))[:MAX_LINKED_FIGURES]


def index_entry(folder: Path) -> IndexEntry | None:
    """From a result's claims: how many are of which class in words and as styled marks, and the paper of the first."""
    try:
        content = recorded_claims(folder)
        if content is None:
            return None
        rows = _with_edited_claims_not_run(folder, read_rows(folder / FILE, content, INDEX_TABLE, dict))
        looks = [_css_class(parts[0]["class"]) for parts in group_by_claim(rows)]
        marks = {look: looks.count(look) for look in (*MARKED_CLASSES, "unclear") if look in looks}
        paper = rows[0]["paper"].partition(",")[0] if rows else ""
        return IndexEntry(tr(HEADING), classes_in_words(rows), marks, paper)
    except (StoreError, LookupError):
        return None


def _with_edited_claims_not_run(folder: Path, rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """The rows of a result's claims; only those of a user's package can have been edited since."""
    record = find_record(folder) or {}
    if not record.get("packages") or not is_study(record["study"]):
        return rows
    try:
        case_study = study(record["study"])
        paper, marks = claims_of(case_study), current_marks(case_study)
    except ConfigError:
        return [row | NOT_RUN_CELLS for row in rows]
    return current_rows(rows, [paper] if paper else [], marks)


def _measured_value(part: Mapping[str, Any]) -> str:
    """The measured value of a part of a claim; an infinite settling time as text."""
    if math.isinf(part["measured"]) and "settling" in part["quantity"]:
        return tr(page_tables.NOT_SETTLED)
    return typeset.cell_text(part["measured"])


def _interval(part: Mapping[str, Any]) -> str:
    """The interval of a part of a claim; a dash without a sampling error."""
    lo, hi = shown_interval(part)
    return "–" if lo == hi else f"{typeset.cell_text(lo)} … {typeset.cell_text(hi)}"


def _css_class(verdict: str) -> str:
    return next((name for name in MARKED_CLASSES if verdict.startswith(name)), "unclear")

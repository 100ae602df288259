"""The page of claims, made while building, and claims.csv beside this module: what each claim came to at full size.

`make claims-page` writes claims.csv from what `make reproduce-figures` left in results/: of each claim the part that is
furthest from its words. Words and places are the claims' own, classes over all interpretations those that radarsim
ships. Where results/ holds a full reproduction the page is made from that, with every part."""

import csv
import io
import sys
from contextlib import suppress
from pathlib import Path

from radarsim.errors import StoreError
from radarsim.papers import list_claims
from radarsim.papers.claim_rows import cell_number, group_by_claim, part_name, worst_part
from radarsim.papers.claims_page import TITLE, claims_page
from radarsim.papers.claims_table import NOT_RUN, NUMBER_COLUMNS, claim_rows, empty_row
from radarsim.papers.open_papers import open_papers
from radarsim.papers.stored_verdicts import known_classes
from radarsim.papers.study_claims import paper_claims
from radarsim.papers.verdict_classes import add_classes, rows_in_words

FILE = Path(__file__).with_name("claims.csv")
RESULTS = Path(__file__).parents[2] / "results"
MEASURED = ("measured", "lo", "hi", "judged_lo", "judged_hi", "exact", "expected_lo", "expected_hi", "margin", "needed")
COLUMNS = (
    "claim",
    "config",
    "case",
    "quantity",
    "unit",
    *MEASURED,
    "expected",
    "variants_of",
    "verdict",
    "as_shipped",
    "why",
)
FIGURE = "claims.svg"
PICTURE = f"""<details>
<summary>How far each claim lies from its words: a figure</summary>
<img src="{FIGURE}" alt="All claims, in margins of what their papers say" width="100%">
</details>"""


def stored_rows() -> list[dict]:
    """Rows of all claims with the columns of claims.csv of a run, from claims.csv beside this module."""
    with FILE.open(encoding="utf-8", newline="") as file:
        rows_of_file = {row["claim"]: row for row in csv.DictReader(file)}
    rows_by_config: dict[str, list[dict]] = {}
    for claims_of_paper in paper_claims():
        for claim in claims_of_paper.claims:
            if row := rows_of_file.get(claim.id):
                numbers = {name: float(row[name]) if row.get(name) else "" for name in NUMBER_COLUMNS}
                claim_row = empty_row(claim, claims_of_paper.paper) | row | numbers
                claim_row |= {"class": row["as_shipped"], "overall": row["as_shipped"]}
                rows_by_config.setdefault(claim.config, []).append(claim_row)
    classes = known_classes([(paper.interpretations, paper.claims) for paper in open_papers().values()], None)
    return add_classes(claim_rows(paper_claims(), rows_by_config), classes)


def rows(results: Path = RESULTS) -> tuple[list[dict], bool]:
    """Rows of all claims, and whether they are those of a full reproduction, with every part of each."""
    with suppress(StoreError):  # of another version, or damaged: no full reproduction
        rows_of_run = list_claims.claims(out=results).rows
        if all(row["class"] != NOT_RUN for row in rows_of_run):
            return rows_of_run, True
    return stored_rows(), False


def markdown(results: Path = RESULTS) -> str:
    """The page without its title."""
    rows_of_claims, is_whole = rows(results)
    rows_of_claims = rows_in_words(rows_of_claims, (paper.interpretations for paper in open_papers().values()))
    pages = {claims_of_paper.paper: claims_of_paper.page for claims_of_paper in paper_claims()}
    text = claims_page(rows_of_claims, pages, is_whole).removeprefix(TITLE).strip()
    return text.replace("\n\n## ", f"\n\n{PICTURE}\n\n## ", 1)


def draw_figure(app, exception) -> None:
    """The figure of claims beside the page, when it is built as HTML."""
    if exception is None and app.builder.format == "html":
        list_claims.Claims(rows()[0]).draw(Path(app.outdir, "docs", FIGURE))


def main(results: str) -> None:
    """Write claims.csv from a full reproduction; ends with 1 where a claim was not run."""
    rows_of_claims, is_whole = rows(Path(results))
    if not is_whole:
        sys.exit(f"{results}: holds no full reproduction of this version; `make reproduce-figures` makes it")
    table_rows = []
    for parts in group_by_claim(rows_of_claims):
        row = dict(worst_part(parts) or parts[0])
        row |= {name: parts[0][name] for name in ("needed", "as_shipped", "reason")} | {
            "quantity": part_name(row, parts)
        }
        numbers = {name: cell_number(row[name]) for name in MEASURED}
        row |= {name: "" if value is None else f"{value:.9g}" for name, value in numbers.items()}
        table_rows.append({name: row[name] for name in COLUMNS})
    text = io.StringIO(newline="")
    table = csv.DictWriter(text, COLUMNS, lineterminator="\n")
    table.writeheader()
    table.writerows(table_rows)
    FILE.write_text(text.getvalue(), encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1])

"""The page of claims, made while building, and claims.csv beside this module: what each claim came to at full size.

`make claims-page` writes claims.csv from what `make reproduce-figures` left in results/: of each claim the part that is
furthest from its words. Words and places are the claims' own, classes over all interpretations those that radarsim
ships. Where results/ holds a full reproduction the page is made from that, with every part."""

import csv
import io
import sys
from contextlib import suppress
from pathlib import Path

from radarsim.app import interpretations, run, stored
from radarsim.errors import StoreError
from radarsim.report.claims import NUMBERS, judge, page

FILE = Path(__file__).with_name("claims.csv")
RESULTS = Path(__file__).parents[2] / "results"
MEASURED = ("measured", "lo", "hi", "judged_lo", "judged_hi", "exact", "expected_lo", "expected_hi", "margin", "needed")
COLUMNS = ("claim", "config", "case", "what", "unit", *MEASURED, "expected", "number", "verdict", "as_shipped", "why")
FIGURE = "claims.svg"
PICTURE = f"""<details>
<summary>How far each claim lies from its words: a figure</summary>
<img src="{FIGURE}" alt="All claims, in margins of what their papers say" width="100%">
</details>"""


def kept() -> list[dict]:
    """Rows of all claims with the columns of claims.csv of a run, from claims.csv beside this module."""
    with FILE.open(encoding="utf-8", newline="") as file:
        read = {row["claim"]: row for row in csv.DictReader(file)}
    found: dict[str, list[dict]] = {}
    for of in run.papers():
        for claim in of.claims:
            if row := read.get(claim.id):
                numbers = {name: float(row[name]) if row.get(name) else "" for name in NUMBERS}
                one = judge.blank(claim, of.paper) | row | numbers
                one |= {"class": row["as_shipped"], "overall": row["as_shipped"]}
                found.setdefault(claim.config, []).append(one)
    classes = stored.classes_of(
        [(paper.interpretations, paper.claims) for paper in interpretations.papers().values()], None
    )
    return page.with_classes(judge.listed(run.papers(), found), classes)


def rows(results: Path = RESULTS) -> tuple[list[dict], bool]:
    """Rows of all claims, and whether they are those of a full reproduction, with every part of each."""
    with suppress(StoreError):  # of another version, or damaged: no full reproduction
        full = run.claims(out=results).rows
        if all(row["class"] != judge.NOT_RUN for row in full):
            return full, True
    return kept(), False


def markdown(results: Path = RESULTS) -> str:
    """The page without its title."""
    found, whole = rows(results)
    found = page.in_words(found, (of.interpretations for of in interpretations.papers().values()))
    text = page.page(found, {of.paper: of.page for of in run.papers()}, whole).removeprefix(page.TITLE).strip()
    return text.replace("\n\n## ", f"\n\n{PICTURE}\n\n## ", 1)


def drawn(app, exception) -> None:
    """The figure of claims beside the page, when it is built as HTML."""
    if exception is None and app.builder.format == "html":
        run.Claims(rows()[0]).draw(Path(app.outdir, "docs", FIGURE))


def main(results: str) -> None:
    """Write claims.csv from a full reproduction; ends with 1 where a claim was not run."""
    found, whole = rows(Path(results))
    if not whole:
        sys.exit(f"{results}: holds no full reproduction of this version; `make reproduce-figures` makes it")
    lines = []
    for parts in page.grouped(found):
        row = dict(page.worst(parts) or parts[0])
        row |= {name: parts[0][name] for name in ("needed", "as_shipped", "why")} | {"what": page.named(row, parts)}
        numbers = {name: page.number(row[name]) for name in MEASURED}
        row |= {name: "" if value is None else f"{value:.9g}" for name, value in numbers.items()}
        lines.append({name: row[name] for name in COLUMNS})
    text = io.StringIO(newline="")
    table = csv.DictWriter(text, COLUMNS, lineterminator="\n")
    table.writeheader()
    table.writerows(lines)
    FILE.write_text(text.getvalue(), encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1])

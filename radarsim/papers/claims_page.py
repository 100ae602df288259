"""The page of claims in Markdown: all of a paper in a table, with every part below, from stored results."""

from collections.abc import Mapping, Sequence

from radarsim.papers.claim_rows import (
    BOLD_CLASSES,
    cell_number,
    claim_ranges,
    class_count,
    classes_in_words,
    count_classes,
    decisive_value_words,
    four_digits,
    group_by_claim,
    is_extension,
    measured_words,
    part_name,
    verdict_sentence,
    worst_part,
)
from radarsim.papers.claims_table import NOT_JUDGED, NOT_RUN
from radarsim.papers.verdict_rule import CONFIRMED, CONTRADICTORY, IMMATERIAL, REFUTED, UNDECIDED, UNJUDGEABLE, VOID

TITLE = "# The papers' claims"
INTRODUCTION = """\
One row for each claim: the paper's statement, the verdict, and the config that shows it (`radarsim run CONFIG`, then
`radarsim claims CONFIG`). All are judged by [one rule](verdicts.md), written before anything was measured. Where the
paper leaves a choice open, the verdict covers all interpretations that it allows (`radarsim interpretations`):
"refuted as shipped; true only with other choices of …" is false with the config's choice, and true with another one.
Open a claim for its original words, their interpretation, and the part furthest from them: its exact value, or the
measured one with its interval, and the expected range. Extensions are ours, or statements that a paper reports from
others, and are not counted."""
CLASS_MEANINGS = {  # of each class, for the headline
    CONFIRMED: "true as stated",
    REFUTED: "false by more than the margin of their words",
    IMMATERIAL: "about differences too small to matter",
    CONTRADICTORY: "its numbers are reproduced only with values that it contradicts",
    UNJUDGEABLE: "without what a test needs",
    UNDECIDED: "intervals still too wide",
}


def claims_page(rows: Sequence[Mapping], pages: Mapping[str, str], parts: bool = True) -> str:
    """The page, from the rows of `list_claims.claims`; pages holds the stem of a paper's page, by the paper.

    parts: whether a folded table of all measured parts follows."""
    text = [TITLE, "", INTRODUCTION, *_class_lines(rows), ""]
    for paper in dict.fromkeys(row["paper"] for row in rows):
        paper_rows = [row for row in rows if row["paper"] == paper]
        key = paper_rows[0]["claim"].partition(".")[0]
        link = f" Equations and decisions: [{key}]({pages[paper]}.md)." if pages.get(paper) else ""
        claims = [
            [row for row in paper_rows if row["claim"] == claim]
            for claim in dict.fromkeys(row["claim"] for row in paper_rows)
        ]
        text += [f"## {key} {paper}", "", f"{classes_in_words(paper_rows)}.{link}", ""]
        text += ["| claim | statement | verdict | config |", "|---|---|---|---|"]
        text += [*map(_claim_line, claims), ""]
        lines = [line for claim_parts in claims for line in _part_lines(claim_parts)] if parts else []
        if lines:
            text += ["<details>", f"<summary>{key} part by part</summary>", ""]
            text += ["| claim | part | measured | exact | expected | miss, margins | verdict | rule of 0.1 |"]
            text += ["|---|---|---|---|---|---|---|---|", *lines, "", "</details>", ""]
    return "\n".join(text)


def _class_lines(rows: Sequence[Mapping]) -> list[str]:
    """The classes with their counts, meanings and claims, a line each."""
    counts, extensions = count_classes(rows)
    first_parts = [parts[0] for parts in group_by_claim(rows) if not is_extension(parts)]
    lines = [f"In all {sum(counts.values())} claims, and {extensions} extensions that are not counted:", ""]
    for kind, count in counts.items():
        names = claim_ranges([row["claim"] for row in first_parts if row["class"] == kind])
        meaning = f", {CLASS_MEANINGS[kind]}" if kind in CLASS_MEANINGS else ""
        lines.append(f"* **{class_count(kind, count)}**{meaning}: {names}")
    return lines


def _claim_line(parts: Sequence[Mapping]) -> str:
    """A claim: its words; folded, the original, its interpretation and the part furthest from it; its class."""
    first, worst = parts[0], worst_part(parts)
    original = f"«{first['original']}»" if first["original"] else ""
    details = [" ".join(filter(None, (original, f"({first['place']})")))]
    if first["interpretation"]:
        details.append(f"Interpretation: {first['interpretation']}.")
    if worst is not None:
        details.append(
            f"Result: {part_name(worst, parts)}: {decisive_value_words(worst)}; expected {_expected_cell(worst)}."
        )
    folded = "<br>".join(map(_markdown_cell, details))
    statement = f"<details><summary>{_markdown_cell(first['statement'])}</summary>{folded}</details>"
    return f"| {first['claim']} | {statement} | {_markdown_cell(verdict_sentence(parts))} | `{first['config']}` |"


def _expected_cell(row: Mapping) -> str:
    return f"{row['expected']} {row['unit']}".rstrip()


def _part_lines(parts: Sequence[Mapping]) -> list[str]:
    """A row for each part of a claim that was run."""
    lines = []
    for row in parts if parts[0]["class"] != NOT_RUN else ():
        verdict = f"**{row['verdict']}**" if row["verdict"] in BOLD_CLASSES else row["verdict"]
        if row["verdict"] == VOID:
            verdict = f"void: an efficient estimator reaches {cell_number(row['ceiling']):.3f}"
        if row["verdict"] == NOT_JUDGED:
            verdict = f"{NOT_JUDGED}: {row['reason']}"
        if str(row["extension"]).lower() == "true":
            verdict += " (extension)"
        exact, miss = cell_number(row["exact"]), cell_number(row["miss"])
        cells = (
            *(
                row["claim"],
                part_name(row, parts),
                measured_words(row) if cell_number(row["measured"]) is not None else "",
            ),
            *("" if exact is None else four_digits(exact), _expected_cell(row)),
            *("" if miss is None else f"{miss:.3g}", verdict, row["old_verdict"]),
        )
        lines.append("| " + " | ".join(map(_markdown_cell, cells)) + " |")
    return lines


def _markdown_cell(text: str) -> str:
    """Text that neither ends a cell nor is read as markup."""
    text = text.replace("|", "\\|")
    return text.replace("<", "&lt;").replace("&lt;br>", "<br>")

"""The pages of interpretations, made while building: what a paper leaves open, and its claims over all that it allows.

The classes are those that radarsim ships, or those of the pages that `make interpretations-pages` left in
results/interpretations."""

from pathlib import Path

from radarsim.papers.interpretations_page import markdown_table, open_choices
from radarsim.papers.open_papers import open_papers
from radarsim.papers.stored_verdicts import known_classes
from radarsim.papers.verdict_classes import class_words

PAPERS = ("P1", "P2", "P3", "P4")
RESULTS = Path(__file__).parents[2] / "results"
HERE = (
    "`radarsim interpretations {paper} --markdown` judges them anew, from stored runs or new ones; every number under "
    "every interpretation is then in `results/interpretations/interpretations.csv`, with a specification curve a claim."
)


def markdown(paper: str, results: Path = RESULTS) -> str:
    """The page of a paper without its title: as results hold it, else what is known without any."""
    made = results / "interpretations" / f"{paper}.md"
    return made.read_text(encoding="utf-8").partition("\n")[2].strip() if made.is_file() else shipped(paper)


def shipped(paper: str) -> str:
    """The claims of a paper with their classes over all interpretations, and what the paper leaves open."""
    of = open_papers()[paper]
    known = known_classes([(of.interpretations, of.claims)], None)
    rows = []
    for claim in of.claims.claims:
        if (found := known.get(claim.id)) is not None:
            said = class_words(
                found.kind, found.kind, of.interpretations.list_choices(filter(None, found.depends_on.split(", ")))
            )
            rows.append((claim.id, claim.statement, said, f"{found.holds_in} of {found.interpretation_count}"))
    parts = [
        f"{of.claims.paper}. {HERE.format(paper=paper)}",
        "## Claims over all interpretations",
        markdown_table(("claim", "statement", "verdict", "holds in"), rows),
        *open_choices(of.interpretations),
    ]
    return "\n\n".join(parts)

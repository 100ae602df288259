"""The pages of interpretations, made while building: what a paper leaves open, and its claims over all that it allows.

The classes are those that radarsim ships, or those of the pages that `make interpretations-pages` left in
results/interpretations."""

from pathlib import Path

from radarsim.app import interpretations, stored
from radarsim.report.claims import interpretations_page, page

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
    of = interpretations.papers()[paper]
    known = stored.classes_of([(of.interpretations, of.claims)], None)
    rows = []
    for claim in of.claims.claims:
        if (found := known.get(claim.id)) is not None:
            said = page.words(
                found.kind, found.kind, of.interpretations.asked(filter(None, found.depends_on.split(", ")))
            )
            rows.append((claim.id, claim.statement, said, f"{found.holds} of {found.of}"))
    parts = [
        f"{of.claims.paper}. {HERE.format(paper=paper)}",
        "## Claims over all interpretations",
        interpretations_page.table(("claim", "statement", "verdict", "holds in"), rows),
        *interpretations_page.left_open(of.interpretations),
    ]
    return "\n\n".join(parts)

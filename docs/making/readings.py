"""The pages of readings, made while building: what a paper leaves open, and its claims over all that it allows.

The classes are those that radarsim ships. Where `make readings-pages` has left its pages in results/readings they are
shown whole: with the printed numbers by reading, and where each of them comes out.
"""

from pathlib import Path

from radarsim.app import readings, stored
from radarsim.report.claims import page, readings_page

PAPERS = ("P1", "P2", "P3", "P4")
RESULTS = Path(__file__).parents[2] / "results"
HERE = (
    "The printed numbers by reading, and where each of them comes out, are what `radarsim readings {paper} --markdown` "
    "adds, from stored runs or new ones; every number under every reading is then in `results/readings/readings.csv`, "
    "and beside it a specification curve a claim."
)


def markdown(paper: str, results: Path = RESULTS) -> str:
    """The page of a paper without its title: as results hold it, else what is known without any."""
    file = results / "readings" / f"{paper}.md"
    return file.read_text(encoding="utf-8").partition("\n")[2].strip() if file.is_file() else shipped(paper)


def shipped(paper: str) -> str:
    """The claims of a paper with their classes over all readings, and what the paper leaves open."""
    paper_readings = readings.papers()[paper]
    classes = stored.classes_of([(paper_readings.readings, paper_readings.claims)], None)
    rows = []
    for claim in paper_readings.claims.claims:
        if (claim_class := classes.get(claim.id)) is not None:
            verdict = page.words(
                claim_class.kind,
                claim_class.kind,
                paper_readings.readings.asked(filter(None, claim_class.depends_on.split(", "))),
            )
            rows.append((claim.id, claim.statement, verdict, f"{claim_class.holds} of {claim_class.of}"))
    parts = [
        f"{paper_readings.claims.paper}. {HERE.format(paper=paper)}",
        "## Claims over all readings",
        readings_page.table(("claim", "statement", "verdict", "holds in"), rows),
        *readings_page.left_open(paper_readings.readings),
    ]
    return "\n\n".join(parts)

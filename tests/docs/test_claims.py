"""docs/claims.md is in step with the claims: the same, in the same order and words, all of them run."""

import re
from pathlib import Path

from radarsim.app.run import papers
from radarsim.app.stored import shipped_classes
from radarsim.report import claims
from radarsim.report.claims import page, rule

TEXT = (Path(__file__).parents[2] / "docs/claims.md").read_text(encoding="utf-8")
LINE = re.compile(r"^\| (P\d\.\w+) \| (.*?) \| .* \| ([^|]*) \| `(\w+)` \|$", re.MULTILINE)


def test_the_page_has_all_claims_in_their_words():
    rows = claims.listed(papers(), {})
    wanted = [(row["claim"], page.page([row], {})) for row in rows]
    stands = {found[1]: found for found in LINE.finditer(TEXT)}
    assert list(stands) == [claim for claim, _ in wanted]
    lines = set(TEXT.splitlines())
    for claim, alone in wanted:
        (made,) = LINE.finditer(alone)
        assert (stands[claim][2], stands[claim][4]) == (made[2], made[4])
        assert [line for line in alone.splitlines() if line.startswith(f"| {claim} ")][1] in lines  # in the original


def test_every_claim_was_run_and_has_the_class_that_is_shipped():
    verdicts = {found[1]: found[3].partition(" (")[0].strip("*") for found in LINE.finditer(TEXT)}
    over = {claim: said.partition("; ")[2] or said for claim, said in verdicts.items()}
    kinds = {claim: next(kind for kind in rule.CLASSES if said.startswith(kind)) for claim, said in over.items()}
    shipped = {one.claim: one.kind for one in shipped_classes()}
    assert {claim: kinds[claim] for claim in shipped} == shipped
    parts = re.findall(r"^\| (P\d\.\w+) \|(?: [^|]* \|){7}$", TEXT, re.MULTILINE)
    assert list(dict.fromkeys(parts)) == list(verdicts)


def test_the_head_is_the_one_that_the_command_writes():
    assert TEXT.startswith(page.HEAD)

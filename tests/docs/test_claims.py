"""docs/claims.md is in step with the claims: the same, in the same order and words, all of them run."""

import re
from pathlib import Path

from radarsim.app.run import papers
from radarsim.report import claims
from radarsim.report.claims import page, rule

TEXT = (Path(__file__).parents[2] / "docs/claims.md").read_text(encoding="utf-8")
LINE = re.compile(r"^\| (P\d\.\w+) \| (.*?) \| [^|]* \| .* \| ([^|]*) \| `(\w+)` \|$", re.MULTILINE)


def test_the_page_has_all_claims_in_their_words():
    rows = claims.listed(papers(), {})
    wanted = [(row["claim"], page.page([row], {})) for row in rows]
    stands = {found[1]: found for found in LINE.finditer(TEXT)}
    assert list(stands) == [claim for claim, _ in wanted]
    for claim, alone in wanted:
        (made,) = LINE.finditer(alone)
        assert (stands[claim][2], stands[claim][4]) == (made[2], made[4])


def test_every_claim_was_run_and_measured():
    verdicts = {found[1]: found[3].partition(" (")[0].strip("*") for found in LINE.finditer(TEXT)}
    classes = {"depends on" if verdict.startswith("depends on") else verdict for verdict in verdicts.values()}
    assert classes <= set(rule.CLASSES)
    parts = re.findall(r"^\| (P\d\.\w+) \|(?: [^|]* \|){7}$", TEXT, re.MULTILINE)
    assert list(dict.fromkeys(parts)) == list(verdicts)


def test_the_head_is_the_one_that_the_command_writes():
    assert TEXT.startswith(page.HEAD)

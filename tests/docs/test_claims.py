"""The built pages of claims and interpretations: every claim, its class as shipped, and what it came to at full
size."""

import csv
import re

import pytest
from making import claims, interpretations

from radarsim.papers.claim_rows import count_classes
from radarsim.papers.claims_table import NOT_RUN
from radarsim.papers.forest_plot import forest_plot
from radarsim.papers.stored_verdicts import shipped_classes
from radarsim.papers.study_claims import paper_claims

LINE = re.compile(r"^\| (P\d\.\w+) \| <details><summary>(.*?)</summary>(.*?)</details> \| (.*) \| `(\w+)` \|$", re.M)
DECLARED = {claim.id: claim for of in paper_claims() for claim in of.claims}


@pytest.fixture(scope="module")
def text(tmp_path_factory):
    """The page as it is built where no results are."""
    return claims.markdown(tmp_path_factory.mktemp("results"))


def test_the_page_has_a_row_a_claim_in_its_words(text):
    rows = {found[1]: found for found in LINE.finditer(text)}
    assert list(rows) == list(DECLARED)
    for claim, found in rows.items():
        words, at = found[2].replace("&lt;", "<").replace("\\|", "|"), found[5]
        assert (words, at) == (DECLARED[claim].statement, DECLARED[claim].config)
        assert DECLARED[claim].place.replace("<", "&lt;").replace("|", "\\|") in found[3]


def test_every_claim_was_run_and_has_the_class_that_is_shipped(tmp_path):
    rows, whole = claims.rows(tmp_path)
    assert not whole
    found = {row["claim"]: row for row in rows}
    assert NOT_RUN not in {row["class"] for row in rows}
    assert {one.claim: one.kind for one in shipped_classes()}.items() <= {
        claim: row["class"] for claim, row in found.items()
    }.items()


def test_what_is_kept_is_a_part_of_its_claim():
    """Where it is none `make claims-page` was not called since the claim was changed."""
    with claims.FILE.open(encoding="utf-8", newline="") as file:
        kept = {row["claim"]: row for row in csv.DictReader(file)}
    assert list(kept) == list(DECLARED)
    for claim, row in kept.items():
        what = row["quantity"].rpartition("`: ")[2]
        parts = [part for part in DECLARED[claim].parts if part.what == what and part.unit == row["unit"]]
        assert parts or not row["measured"], claim
        ends = {part.expected.words for part in parts}
        assert row["expected"] in ends or not parts, (claim, ends, row["expected"])


def test_a_full_reproduction_is_shown_with_every_part(tmp_path, text, monkeypatch):
    rows = claims.stored_rows()
    found = claims.list_claims.Claims([*rows, rows[0] | {"quantity": "another part"}])
    monkeypatch.setattr(claims.list_claims, "claims", lambda out: found)
    full = claims.markdown(tmp_path)
    assert "| P1.1 | another part |" in full
    assert "another part" not in text


def test_readme_and_landing_page_count_the_claims():
    count = sum(count_classes(claims.stored_rows())[0].values())
    for name in ("README.md", "docs/README.md"):
        assert f"{count} claims" in (claims.FILE.parents[2] / name).read_text(encoding="utf-8")


def test_results_that_cannot_be_read_are_no_full_reproduction(tmp_path, text):
    (tmp_path / "range_doppler").mkdir()
    (tmp_path / "range_doppler" / "claims.csv").write_text("claim\nP1.1\n")
    assert claims.markdown(tmp_path) == text


def test_the_figure_is_drawn_beside_the_page():
    assert {
        getattr(mark, "label", "") for panel in forest_plot(claims.stored_rows()).panels for mark in panel.marks
    } >= {"confirmed", "refuted"}


@pytest.mark.parametrize("paper", interpretations.PAPERS)
def test_the_page_of_interpretations_has_every_class_and_choice(paper, tmp_path):
    made = interpretations.markdown(paper, tmp_path)
    for one in shipped_classes():
        if one.claim.startswith(f"{paper}."):
            assert re.search(
                rf"^\| {re.escape(one.claim)} \| .* \| {one.holds_in} of {one.interpretation_count} \|$", made, re.M
            ), one.claim
    choices = interpretations.open_papers()[paper].interpretations.choices
    assert [f"### `{choice.key}`: {choice.asks}" for choice in choices] == re.findall("^### .*$", made, re.M)
    whole = tmp_path / "interpretations" / f"{paper}.md"
    whole.parent.mkdir()
    whole.write_text("# Title\n\nEverything.\n")
    assert interpretations.markdown(paper, tmp_path) == "Everything."

"""One class a claim: `interpretations`, a run, its report, figure and tables, `claims` and the page say the same of
it."""

import csv
import dataclasses
import hashlib
import json
import re
from html import unescape

import pytest

import radarsim
from radarsim.api.maintenance import reproduce
from radarsim.config import find_files
from radarsim.errors import StoreError
from radarsim.papers import list_claims, stored_verdicts, verdict_rule
from radarsim.papers.claim_rows import classes_in_words, count_classes, group_by_claim, is_extension
from radarsim.papers.claims_page import _class_lines
from radarsim.papers.claims_table import CLASS_COLUMNS, COLUMNS, NOT_JUDGED, empty_row
from radarsim.papers.forest_plot import forest_plot
from radarsim.papers.judge_interpretations import judge_requests
from radarsim.papers.open_papers import judging_requests, open_papers
from radarsim.papers.result_claims import claims_by_class
from radarsim.papers.stored_verdicts import CLASSES, known_classes, shipped_classes, stored_classes
from radarsim.papers.study_claims import paper_claims
from radarsim.papers.verdict_classes import add_classes, rows_in_words, verdict_words
from radarsim.papers.verdict_rule import CONFIRMED, CONTRADICTORY, DEPENDS, IMMATERIAL, REFUTED, UNDECIDED
from radarsim.report import index_page
from tests.program import printed

PAPERS = {claim.id: (of, claim) for of in paper_claims() for claim in of.claims}
OPEN = [(paper.interpretations, paper.claims) for paper in open_papers().values()]


def as_runs_would_store(out, own):
    """All claims of all papers, were all of them to come out so as shipped."""
    stored = {}
    for of, claim in PAPERS.values():
        row = empty_row(claim, of.paper) | dict.fromkeys(CLASS_COLUMNS, own)
        row |= {"measured": 3.0, "lo": 2.0, "hi": 4.0, "expected_lo": 5.0, "margin": 1.0, "miss": 2.0, "quantity": "x"}
        row |= {"judged_lo": 2.0, "judged_hi": 4.0}
        stored.setdefault(claim.config, []).append(row)
    known = known_classes(OPEN, None)
    for config, rows in stored.items():
        (out / config).mkdir()
        with (out / config / "claims.csv").open("w", encoding="utf-8", newline="") as file:
            table = csv.DictWriter(file, COLUMNS, extrasaction="ignore")
            table.writeheader()
            for row in add_classes(rows, known):
                table.writerow({key: "" if value != value else value for key, value in row.items()})
        digest = hashlib.sha256((out / config / "claims.csv").read_bytes()).hexdigest()
        record = {"config": config, "study": "", "cases": {}, "identities": {}, "resolved": {}, "resolved_sha256": ""}
        (out / config / "run.json").write_text(json.dumps(record | {"outputs": {"claims.csv": digest}}))


def told(row):
    """What every rendering has to say of a claim: its class, and the phrase that tells how far it stands."""
    return row["class"], verdict_words(row)


def agree(out):
    """Hold every rendering of the stored claims under `out` against the class in claims.csv; gives the classes."""
    every = json.loads(printed("claims", "--json", "--out", out))
    worded = {row["claim"]: row for row in rows_in_words(every, [interpretations for interpretations, _ in OPEN])}
    rows = {parts[0]["claim"]: parts[0] for parts in group_by_claim(every)}
    lines = {line.split()[0]: line for line in printed("claims", "--out", out).splitlines() if line[:1] == "P"}
    made = printed("claims", "--markdown", "--out", out)
    marks = drawn(list_claims.claims(out=out).rows)
    stands = dict(re.findall(r"^\| (P\d\.\w+) \| .* \| ([^|]*) \| `\w+` \|$", made, re.MULTILINE))
    assert rows.keys() == lines.keys() == stands.keys() == PAPERS.keys()
    for claim, row in rows.items():
        kind, phrase = told(worded[claim])
        assert lines[claim].split(maxsplit=1)[1].lstrip("(").startswith(kind.removesuffix(" on")), claim
        assert stands[claim].strip("*").startswith(phrase), claim
        assert marks.get(claim, kind) == kind  # none where every part is void
        config = out / row["config"]
        with (config / "claims.csv").open(encoding="utf-8", newline="") as file:
            stored = {one["claim"]: one for one in csv.DictReader(file)}[claim]
        assert (stored["class"], stored["overall"]) == (kind, row["overall"]), claim
        if (config / "report.html").is_file():
            assert reported(config)[claim].startswith(phrase), claim
    kinds = {claim: row["class"] for claim, row in rows.items()}
    counted, count = classes_in_words(every), sum(count_classes(every)[0].values())
    assert f"claims   {count}: {counted}" in reproduce.summary(
        [reproduce.FinishedConfig("rls2", 1.0, "")], str(out), 1.0
    )
    assert printed("claims", "--out", out).splitlines()[-2].removesuffix(" (in brackets)") == counted
    for line in _class_lines(every)[2:]:
        said, _, names = line.rpartition(": ")
        kind = kinds[re.match(r"P\d\.\w+", names)[0]]
        own = [parts for parts in group_by_claim(every) if parts[0]["class"] == kind and not is_extension(parts)]
        assert int(re.search(r"\d+", said)[0]) == len(own)
    return kinds


def drawn(rows):
    """The class that the figure's mark of each claim stands for."""
    return {
        f"{panel.title.split()[0]}.{dict(panel.y.ticks)[y].split()[-1]}": mark.label
        for panel in forest_plot(rows).panels
        for mark in panel.marks
        if getattr(mark, "label", "") in verdict_rule.CLASSES
        for y in mark.y
    }


def reported(config):
    """What the report says of each claim, by its number; the style of the cell is that of the class."""
    text = (config / "report.html").read_text(encoding="utf-8")
    found = re.findall(
        r'<tr id="claim-(P\d\.\w+)">.*?</details></td><td class="([\w ]*)">(.*?)</td></tr>', text, re.DOTALL
    )
    return {
        claim: " ".join(unescape(re.sub("<[^>]*>", "", said.replace("<sub>", "_"))).split()) for claim, _, said in found
    }


@pytest.mark.parametrize("own", [CONFIRMED, REFUTED, UNDECIDED])
def test_every_claim_has_one_class_wherever_it_is_said(tmp_path, own):
    as_runs_would_store(tmp_path, own)
    kinds = agree(tmp_path)
    shipped = {one.claim: one.kind for one in shipped_classes()}
    assert kinds == {claim: shipped.get(claim, own) for claim in PAPERS}
    assert len(shipped) > 50
    assert len(drawn(list_claims.claims(out=tmp_path).rows)) == len(PAPERS)


def test_a_run_says_the_class_of_the_page_and_how_it_came_out_here(tmp_path):
    text = printed("run", "rls2", "-n", 500, "--no-figures", "--out", tmp_path)
    assert "1 confirmed: P1.23" in text
    assert "2 depend on what the paper leaves open: P1.18, P1.28" in text
    assert "as shipped confirmed: P1.28; refuted: P1.18" in text
    (document,) = json.loads(printed("report", "rls2", "-n", 500, "--no-figures", "--json", "--out", tmp_path))
    assert document["claims"] == {"confirmed": ["P1.23"], "depends on": ["P1.18", "P1.28"]}
    assert document["claims_as_shipped"] == {"confirmed": ["P1.23", "P1.28"], "refuted": ["P1.18"]}
    said = "refuted as shipped; true only with other choices of D_M of figure 1a and how the filter starts"
    phrase = f"{said} (true under 1 of 15 interpretations)"
    assert reported(tmp_path / "rls2")["P1.18"] == phrase
    assert "P1.18  depends    RLS 2" in printed("claims", "rls2", "--out", tmp_path)
    assert f"P1.18  {phrase}: RLS 2" in printed("claims", "rls2", "--parts", "--out", tmp_path)
    index_page.write_index(tmp_path)
    assert "1 confirmed, 2 depend on what the paper leaves open" in (tmp_path / "index.html").read_text()
    rows = list_claims.claims("rls2", out=tmp_path).rows
    assert drawn(rows)["P1.18"] == DEPENDS
    assert "1 confirmed, 2 depend on what the paper leaves open" in forest_plot(rows).caption


def test_a_result_that_is_not_written_has_the_class_and_a_radar_of_ones_own_none():
    assert claims_by_class(radarsim.run("rls2", realisations=60))[DEPENDS] == ["P1.18", "P1.28"]
    result = radarsim.run("rls2", overrides=["radar.sigma_range_m=100"], realisations=60)
    assert set(result.tables["claims"]["class"]) <= {NOT_JUDGED}


def test_claims_as_they_are_declared_have_a_shipped_class():
    """Where one has none `make interpretations-pages` was not called since its parts or choices were changed."""
    assert [claim for claim, found in known_classes(OPEN, None).items() if found is None] == []


def test_what_was_judged_of_other_words_is_no_class():
    of, claims = OPEN[0]
    claim = claims.claims[0]
    part = claim.parts[0]
    wider = dataclasses.replace(part, expected=part.expected._replace(margin=2 * part.expected.margin))
    changed = dataclasses.replace(claim, parts=(wider, *claim.parts[1:]))
    assert known_classes([(of, dataclasses.replace(claims, claims=[claim]))], None)[claim.id].kind == DEPENDS
    known = known_classes([(of, dataclasses.replace(claims, claims=[changed]))], None)
    assert known == {claim.id: None}
    row = {"claim": claim.id, "class": REFUTED, "as_shipped": REFUTED, "depends_on": ""}
    (alone,) = add_classes([row], known)
    assert (alone["class"], alone["overall"]) == (REFUTED, "refuted as shipped; other interpretations not judged")
    assert verdict_words(alone) == alone["overall"]
    (torn,) = add_classes([row | {"as_shipped": CONTRADICTORY}], known)  # no interpretation mends it
    assert torn["overall"] == CONTRADICTORY


def test_a_run_without_any_class_says_that_it_is_judged_as_shipped_alone(monkeypatch, tmp_path):
    monkeypatch.setattr(stored_verdicts, "shipped_classes", lambda: ())
    text = printed("run", "rls2", "-n", 60, "--no-figures", "--out", tmp_path)
    assert "only as shipped: P1.18, P1.23, P1.28; `radarsim interpretations P1` judges" in text
    assert "P1.18  refuted as shipped    RLS" in printed("claims", "rls2", "--out", tmp_path)
    assert "P1.18  refuted as shipped; other interpretations not judged: RLS" in printed(
        "claims", "rls2", "--parts", "--out", tmp_path
    )


def test_classes_that_were_worked_out_beside_the_run_count(tmp_path):
    printed("run", "rls2", "-n", 300, "--no-figures", "--out", tmp_path)
    assert "note" not in printed("interpretations", "P1.23", "--no-figures", "--out", tmp_path)
    (own,) = stored_classes(tmp_path)
    path = tmp_path / CLASSES
    path.write_text(path.read_text().replace(f",{CONFIRMED},", f",{IMMATERIAL},"))
    assert own.kind == CONFIRMED
    assert f"P1.23  confirmed as shipped; {IMMATERIAL} over all" in printed(
        "claims", "rls2", "--parts", "--out", tmp_path
    )
    printed("report", "rls2", "-n", 300, "--no-figures", "--out", tmp_path)
    rows = csv.DictReader((tmp_path / "rls2/claims.csv").read_text(encoding="utf-8").splitlines())
    assert {row["class"] for row in rows if row["claim"] == "P1.23"} == {IMMATERIAL}
    path.write_text("claim,class\nP1.23,certain\n")
    with pytest.raises(StoreError, match="is no table of interpretations"):
        stored_classes(tmp_path)


@pytest.mark.slow
def test_interpretations_tell_of_runs_that_were_written_with_other_classes(tmp_path):
    asked = ("interpretations", "P1.9", "P1.8", "--no-figures", "--out", tmp_path)
    assert "radarsim report" not in printed(*asked)
    classes = tmp_path / CLASSES
    classes.write_text(classes.read_text().replace(f",{CONFIRMED},", f",{REFUTED},"))
    printed("run", "range_doppler", "-n", 300, "--no-figures", "--out", tmp_path)
    assert f"`radarsim report range_doppler --out {tmp_path}`" in printed(*asked)
    printed("run", "range_doppler", "-n", 300, "--no-figures", "--out", tmp_path)
    assert "radarsim report" not in printed(*asked)


@pytest.mark.slow
def test_shipped_classes_are_what_interpretations_give(tmp_path):
    """All of P1, P3 and P4, and what of P2 takes under a minute; what few realisations leave open may be decided."""
    done = judge_requests(judging_requests(["P1", "P3", "P4", "P2.4"]), out=tmp_path, figures=False)
    shipped, own = ({one.claim: one for one in every} for every in (shipped_classes(), stored_classes(tmp_path)))
    for over in (over for read in done.papers for over in read.claims):
        claim = over.claim.id
        if over.undecided:
            assert shipped[claim].interpretation_count == own[claim].interpretation_count
        else:
            assert str(shipped[claim]) == str(own[claim])


@pytest.mark.slow
def test_every_shipped_config_says_one_class_of_a_claim(tmp_path):
    """Few realisations of everything, as `make reproduce-figures` does it."""
    small = ["realisations=200"]
    done = reproduce.reproduce(
        find_files.available_stems("configs"), str(tmp_path), print, overrides=small, figures=False
    )
    assert [one.faults for one in done if one.code not in (0, 4)] == []  # 4: an exact value, on so few
    agree(tmp_path)

"""`radarsim claims` believes a table only as it was written."""

import hashlib
import json
import os

import pytest

from radarsim.api import run, stored_runs
from radarsim.errors import StoreError
from radarsim.papers import list_claims
from radarsim.papers.study_claims import paper_claims
from radarsim.report import stored_tables
from tests.program import command

HASH = "[0-9a-f]{12}…"
ALTERED = rf"claims\.csv: altered since it was written: SHA-256 {HASH}, run\.json has {HASH}; `radarsim report`"


@pytest.fixture
def out(tmp_path, monkeypatch):
    """A directory with a result of rls2 whose table of claims is recorded."""
    monkeypatch.setattr(stored_tables, "PAUSE_S", 0.0)
    run.run("rls2", realisations=2000, out=tmp_path, figures=False)
    return tmp_path


def test_an_altered_verdict_is_refused_and_report_mends_it(out):
    table = out / "rls2" / "claims.csv"
    rows = list_claims.claims("rls2", out=out).rows
    assert rows
    whole = table.read_text()
    for altered in (whole.replace(rows[0]["verdict"], "as we like it"), whole.replace(rows[0]["claim"], "P9.99"), ""):
        assert altered != whole
        table.write_text(altered)
        with pytest.raises(StoreError, match=ALTERED):
            list_claims.claims("rls2", out=out)
    stored_runs.stored_result("rls2", out=out).write(out, figures=False)
    assert list_claims.claims("rls2", out=out).rows == rows


def test_a_table_that_no_record_names_is_refused(out):
    (out / "rls2" / "run.json").unlink()
    with pytest.raises(StoreError, match=r"claims\.csv: no run\.json beside it names it"):
        list_claims.claims("rls2", out=out)


def test_a_table_and_its_record_that_are_just_being_written_are_waited_for(out, monkeypatch):
    table, record = out / "rls2" / "claims.csv", out / "rls2" / "run.json"
    rows, facts = list_claims.claims("rls2", out=out).rows, json.loads(record.read_text())
    table.write_text(table.read_text().replace(rows[0]["verdict"], "refuted"))

    def written(seconds):
        facts["outputs"]["claims.csv"] = hashlib.sha256(table.read_bytes()).hexdigest()
        record.write_text(json.dumps(facts))

    monkeypatch.setattr(stored_tables.time, "sleep", written)
    assert list_claims.claims("rls2", out=out).rows[0]["verdict"] == "refuted"


@pytest.mark.parametrize("text", ["[", "[]", "{}", '{"outputs": 5}'])
def test_a_record_that_is_none_is_told(out, text):
    (out / "rls2" / "run.json").write_text(text)
    with pytest.raises(StoreError, match=r"rls2/run\.json: is no record of a run"):
        list_claims.claims("rls2", out=out)


@pytest.mark.parametrize("name", ["claims.csv", "run.json"])
def test_a_file_that_cannot_be_read_is_told_in_words(out, name):
    file = out / "rls2" / name
    file.unlink()
    os.symlink(name, file)
    with pytest.raises(StoreError) as caught:
        list_claims.claims("rls2", out=out)
    assert caught.value.lines == (f"{file}: cannot be read: Too many levels of symbolic links",)


FOREIGN = """
study: range_doppler
radar: {name: RLS 2, band: decimetre, wavelength_m: 0.15, sigma_range_m: 250, sigma_velocity_mps: 15, scan_period_s: 10}
target: {kind: fly_by, distance_m: 15e3, speed_mps: 280, start_range_m: 40e3}
filters:
  - {name: r, observes: [range], manoeuvre_variance: 1e-3}
  - {name: r+Vr, observes: [range, velocity], manoeuvre_variance: 1e-3}
scans: 15
realisations: 1e3
"""


def test_an_experiment_that_is_not_the_papers_names_the_claims_that_it_cannot_judge(tmp_path):
    config = tmp_path / "foreign.yaml"
    config.write_text(FOREIGN)
    (of,) = [one for one in paper_claims() if one.claims[0].id == "P1.1"]
    for key, said in (("radar.detection_probability", "0.9"), ("radar.bias_range_m", "30")):
        config.write_text(FOREIGN.replace("name: RLS 2", f"name: RLS 2, {key.partition('.')[2]}: {said}"))
        rows = list_claims.claims(str(config), out=tmp_path).rows
        assert [row["claim"] for row in rows] == [claim.id for claim in of.claims]
        assert {(row["class"], row["verdict"], row["config"]) for row in rows} == {
            ("not judged here",) * 2 + ("foreign",)
        }
        reasons = {row["reason"] for row in rows}
        assert all(f"{key} is {said}, the paper's none" in why for why in reasons)
        assert all(
            "target.kind is fly_by, the paper's polynomial" in why and "distance_m" not in why for why in reasons
        )


def test_an_experiment_of_the_papers_that_is_not_run_says_so_and_what_it_does_not_hold(tmp_path):
    rows = list_claims.claims("rls2", out=tmp_path).rows
    assert {row["class"] for row in rows} == {"not run"}
    run.run("rls2", realisations=2000, out=tmp_path, figures=False)
    assert {row["claim"] for row in rows} == {row["claim"] for row in list_claims.claims("rls2", out=tmp_path).rows}


def test_claims_that_cannot_be_judged_stand_in_one_line_a_reason(tmp_path):
    config = tmp_path / "foreign.yaml"
    config.write_text(FOREIGN)
    first, last = command("claims", config, "--out", tmp_path).output.splitlines()
    (of,) = [one for one in paper_claims() if one.claims[0].id == "P1.1"]
    assert first.startswith(
        f"foreign: not judged: P1.1–{of.claims[-1].id}: not the paper's experiment: foreign: target.kind"
    )
    assert last == "this experiment judges no claims"

"""`radarsim claims` believes a table only as it was written."""

import hashlib
import json
import os

import pytest

from radarsim.app import run as experiment
from radarsim.app import stored_claims
from radarsim.errors import StoreError


@pytest.fixture
def out(tmp_path, monkeypatch):
    """A directory with a result of rls2 whose table of claims is recorded."""
    monkeypatch.setattr(stored_claims, "PAUSE_S", 0.0)
    experiment.run("rls2", realisations=2000, out=tmp_path, figures=False)
    return tmp_path


def test_an_altered_verdict_is_refused_and_report_mends_it(out):
    table = out / "rls2" / "claims.csv"
    rows = experiment.claims(["rls2"], out)
    assert rows
    whole = table.read_text()
    for altered in (whole.replace(rows[0]["verdict"], "as we like it"), whole.replace(rows[0]["claim"], "P9.99"), ""):
        assert altered != whole
        table.write_text(altered)
        with pytest.raises(StoreError, match=r"rls2/claims\.csv: altered since it was written; `radarsim report`"):
            experiment.claims(["rls2"], out)
    experiment.report(experiment.load("rls2"), out=out, figures=False)
    assert experiment.claims(["rls2"], out) == rows


def test_without_a_record_the_table_is_taken_as_it_is(out):
    rows = experiment.claims(["rls2"], out)
    (out / "rls2" / "run.json").unlink()
    assert experiment.claims(["rls2"], out) == rows


def test_a_table_and_its_record_that_are_just_being_written_are_waited_for(out, monkeypatch):
    table, record = out / "rls2" / "claims.csv", out / "rls2" / "run.json"
    rows, facts = experiment.claims(["rls2"], out), json.loads(record.read_text())
    table.write_text(table.read_text().replace(rows[0]["verdict"], "refuted"))

    def written(seconds):
        facts["outputs"]["claims.csv"] = hashlib.sha256(table.read_bytes()).hexdigest()
        record.write_text(json.dumps(facts))

    monkeypatch.setattr(stored_claims.time, "sleep", written)
    assert experiment.claims(["rls2"], out)[0]["verdict"] == "refuted"


@pytest.mark.parametrize("text", ["[", "[]", "{}", '{"outputs": 5}'])
def test_a_record_that_is_none_is_told(out, text):
    (out / "rls2" / "run.json").write_text(text)
    with pytest.raises(StoreError, match=r"rls2/run\.json: is no record of a run"):
        experiment.claims(["rls2"], out)


@pytest.mark.parametrize("name", ["claims.csv", "run.json"])
def test_a_file_that_cannot_be_read_is_told_in_words(out, name):
    file = out / "rls2" / name
    file.unlink()
    os.symlink(name, file)
    with pytest.raises(StoreError) as caught:
        experiment.claims(["rls2"], out)
    assert caught.value.lines == (f"{file}: cannot be read: Too many levels of symbolic links",)

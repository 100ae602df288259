"""`radarsim compare`: what it reads, what it writes, how it fails."""

import json
import math
import shutil

import pytest

from radarsim.api import run
from radarsim.api.stored_cases import stored_case
from radarsim.report import csv_text
from tests.program import command


@pytest.fixture(scope="module")
def out(tmp_path_factory):
    """A folder with two radars."""
    made = tmp_path_factory.mktemp("results")
    for name in ("rls2", "rls4"):
        run.run(name, realisations=4000, out=made, figures=False)
    return made


@pytest.mark.slow
def test_two_radars_side_by_side(out):
    said = command("compare", "rls2", "rls4", "--out", out).output
    exact = -76.9  # per cent: the exact σ_r of RLS 4 at 140 s against that of RLS 2
    assert f"]  −{-exact:g} %" in said
    made = csv_text.from_csv((out / "compare" / "comparison.csv").read_bytes())
    last = made[(made["quantity"] == "sigma") & (made["component"] == "r") & (made["t_s"] == 140)]
    assert last["exact_percent"].round(1).tolist()[0] == exact
    assert (last["percent_lo"] < last["exact_percent"]).all()
    assert (last["exact_percent"] < last["percent_hi"]).all()
    curves = csv_text.from_csv((out / "rls4" / "curves.csv").read_bytes())
    assert set(made.loc[made["quantity"] == "sigma", "value"]) == set(curves["sigma"])
    page = (out / "compare" / "compare.html").read_text()
    assert "rls4 against rls2" in page
    assert "radar.sigma_range_m" in page
    drawn = {path.name for path in (out / "compare" / "figures").iterdir()}
    assert {"sigma_r.svg", "gain_r.svg", "captions.md"} <= drawn


def test_two_versions_of_one_differ_by_nothing(out, tmp_path):
    run.run("rls2", realisations=4000, out=tmp_path, figures=False)
    done = command("compare", out / "rls2", tmp_path / "rls2", "--out", tmp_path, "--no-figures", "--json")
    found = json.loads(done.stdout)
    assert {row["difference"] for row in found["rows"]} == {0.0}
    assert {row["pairing"] for row in found["rows"]} == {"same numbers"}


def test_what_is_missing_is_said_with_the_command_for_it(out, tmp_path):
    said = command("compare", "rls2", "rls5", "nosuch", "--out", out, code=2).stderr.splitlines()
    assert said[0].endswith(f"`radarsim run rls5 --out {out}` computes it")
    assert said[1].startswith("nosuch: no such config")
    assert "two results or more" in command("compare", "rls2", "--out", out, code=2).stderr
    (tmp_path / "empty").mkdir()
    assert "no run.json" in command("compare", "rls2", tmp_path / "empty", "--out", out, code=2).stderr


def test_a_table_that_was_altered_is_no_result(out, tmp_path):
    run.run("rls2", realisations=4000, out=tmp_path, figures=False)
    with (tmp_path / "rls2" / "curves.csv").open("a") as file:
        file.write("\n")
    assert "altered" in command("compare", "rls4", tmp_path / "rls2", "--out", out, code=4).stderr


@pytest.mark.parametrize(
    "alter",
    [
        lambda record: record.update(resolved_sha256={"\ud800": "x"}),  # half a character: no file can hold it
        lambda record: record.update(seconds=math.nan),
    ],
)
def test_a_record_that_no_run_writes_is_no_result(out, tmp_path, alter):
    copy = shutil.copytree(out / "rls2", tmp_path / "rls2")
    record = json.loads((copy / "run.json").read_text())
    alter(record)
    (copy / "run.json").write_text(json.dumps(record))
    assert "is no record of a run" in command("compare", "rls4", copy, "--out", out, code=4).stderr


@pytest.mark.parametrize("cases", [None, [[[]]], [{}], [{"case": "rls2", "radar": "\ud800"}]])
def test_a_case_that_no_longer_reads_as_a_config_is_none(cases):
    record = {"study": "range_doppler", "resolved": {"cases": cases}}
    assert stored_case(record, "rls2") is None


def test_a_result_of_an_earlier_config_is_marked(out):
    text = (out / "rls2" / "run.json").read_text()
    assert "earlier state" not in command("compare", "rls2", "rls4", "--out", out, "--no-figures").stderr
    (out / "rls2" / "run.json").write_text(text.replace('"sigma_range_m": 250', '"sigma_range_m": 251'))
    try:
        said = command("compare", "rls2", "rls4", "--out", out, "--no-figures").stderr
    finally:
        (out / "rls2" / "run.json").write_text(text)
    assert "earlier state of rls2; `radarsim run rls2" in said

"""Whatever options a result was computed with, `radarsim run FOLDER` gives its tables again, to the byte.

Elsewhere, without the author's files, and without any option."""

import shutil

import numpy as np
import pytest

import radarsim
from tests.program import command, csv_bytes, record

MINE = """\
study: range_doppler
radar: {name: mine, band: X, wavelength_m: 0.032, sigma_range_m: 15, sigma_velocity_mps: 0.8, scan_period_s: 2.5}
target: {kind: polynomial, coefficients: [8e3, -12]}
filters:
  - {name: r, observes: [range], manoeuvre_variance: 1e-3}
  - {name: r+Vr, observes: [range, velocity], manoeuvre_variance: 1e-3}
scans: 8
realisations: 300
"""
TWO = "include: [mine, other]\nrealisations: 300\n"
RUN_OPTIONS = {
    "none": (),
    "-n": ("-n", 451),
    "--seed": ("--seed", 9),
    "--set number": ("--set", "radar.sigma_range_m=20.25"),
    "--set filter": ("--set", "filters.0.manoeuvre_variance=1e-1"),
    "--set sweep": ("--set", "sweep.scans=[6,8]"),
    "--set target": ("--set", "target=turn"),
    "--set baseline": ("--set", "baseline=r+Vr"),
    "--set baselines": ("--set", "baseline=[r, r+Vr]"),
    "--set study": ("--set", "study=ambiguous_doppler", "--set", "radar.repetition_rate_hz=1000"),
    "--set figures": ("--set", "figures=[sigma_r]"),
    "--set realisations": ("--set", "realisations=350"),
    "--precision": ("-n", 8000, "--precision", 20),
    "--precision --of": ("-n", 8000, "--precision", 20, "--of", "gain"),
    "--runs": ("--runs", "2:6"),
    "--runs all": ("--runs", "all"),
    "--threads": ("--threads", 2),
    "--language": ("--language", "ru"),
}


@pytest.fixture
def author(tmp_path, monkeypatch):
    """The working directory of somebody with configs of their own."""
    folder = tmp_path / "author"
    folder.mkdir()
    (folder / "mine.yaml").write_text(MINE)
    (folder / "other.yaml").write_text(MINE.replace("sigma_range_m: 15", "sigma_range_m: 25"))
    (folder / "two.yaml").write_text(TWO)
    monkeypatch.chdir(folder)
    return folder


def rerun(folder, monkeypatch, *options):
    """The folder of a result that was computed again elsewhere; what its author had is gone."""
    elsewhere = folder.parents[2] / "elsewhere"
    elsewhere.mkdir()
    moved = shutil.move(folder, elsewhere / "received")
    shutil.rmtree(folder.parents[1])
    monkeypatch.chdir(elsewhere)
    command("run", "received", "--no-figures", "-q", "--out", "again", *options)
    (again,) = (elsewhere / "again").glob("*/run.json")
    assert again.parent.name == folder.name
    return moved, again.parent


@pytest.mark.slow_cases_except("--runs-two", "--set baselines-mine", "--set sweep-two", "--precision-two")
@pytest.mark.parametrize("config", ["mine", "two"])
@pytest.mark.parametrize("kind", RUN_OPTIONS)
def test_a_result_of_any_option_is_computed_again(kind, config, author, monkeypatch):
    if config == "two" and kind == "--set study":
        pytest.skip("both configs would need a repetition rate")
    command("run", f"{config}.yaml", *RUN_OPTIONS[kind], "--no-figures", "-q", "--out", "results")
    moved, again = rerun(author / "results" / config, monkeypatch)
    assert csv_bytes(again) == csv_bytes(moved)
    assert ("runs.csv" in csv_bytes(again)) == ("--runs" in kind)
    assert record(again)["identities"] == record(moved)["identities"]
    if "--set figures" in kind:
        assert radarsim.load(again).experiment.figures == {"sigma_r": ("*",)}


@pytest.mark.slow
def test_a_decided_result_is_computed_again(author, monkeypatch):
    command("run", "rls2", "-n", 4000, "--decide", "--no-figures", "-q", "--out", "results", code=...)
    moved, again = rerun(author / "results" / "rls2", monkeypatch)
    assert csv_bytes(again) == csv_bytes(moved)


@pytest.mark.slow_cases("options0", "options2")
@pytest.mark.parametrize("options", [(), ("--against", "tuned"), ("--seed", 4, "--set", "radar.sigma_range_m=20")])
def test_the_configs_filters_of_a_judged_result_are_computed_again(options, author, monkeypatch):
    np.savez("mine.npz", estimates=np.full((300, 8, 1), 8e3))
    command("judge", "mine.yaml", "mine.npz", "--name", "plain", *options, "--no-figures", "-q", "--out", "results")
    moved, again = rerun(author / "results" / "mine_plain", monkeypatch)
    judged, alone = radarsim.load(moved).curves, radarsim.load(again).curves
    judged = judged[judged["filter"] != "plain"].reset_index(drop=True)
    assert set(alone["filter"]) == set(judged["filter"])
    columns = ["case", "filter", "component", "k", "t_s", "n", "sigma", "sigma_lo", "sigma_hi", "bias", "exact_sigma"]
    assert alone[columns].equals(judged[columns])


@pytest.mark.slow
def test_what_solve_and_tune_write_is_computed_again(author, monkeypatch):
    command("tune", "mine.yaml", "--filter", "r+Vr", "--for", "sigma r at 10 s", "--write", "tuned.yaml")
    command("run", "tuned.yaml", "--no-figures", "-q", "--out", "results")
    moved, again = rerun(author / "results" / "tuned", monkeypatch)
    assert csv_bytes(again) == csv_bytes(moved)

"""Precision, time limits, shares, clusters and JSON, from the command's outside."""

import json
import pickle
import re
import shutil
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

import radarsim
from radarsim.api import progress, result_content, writing_time
from radarsim.api.case_results import case_result
from radarsim.api.case_work import CaseWork
from radarsim.api.configs import load
from radarsim.api.run import run_share
from radarsim.engine import stop_conditions
from radarsim.engine.collect import collect
from radarsim.errors import Interruption, TargetUnmet
from tests.program import command, csv_bytes, record
from tests.tolerances import assert_rounded

PLAIN = ("--no-figures", "--quiet")


def few(case):
    """A result of a case from few realisations, its tables, and the experiment of it alone."""
    one = load("range_doppler", ["realisations=2000", "figures=[]"])
    work = CaseWork(case)
    result = case_result(case, work, collect(work, 2))
    return [result], result_content.case_tables([result], stem=one.stem), one


def half_widths(folder):
    """The 95 % half-widths of σ in per cent of it."""
    curves = pd.read_csv(folder / "curves.csv")
    return 50 * (curves["sigma_hi"] - curves["sigma_lo"]) / curves["sigma"]


def test_a_precision_ends_at_the_first_look_that_reaches_it(tmp_path):
    command("run", "rls2", "-n", "1e6", "--precision", 2, *PLAIN, "--out", tmp_path)
    done = record(tmp_path / "rls2")
    assert done["stop"] == "done"
    assert done["realisations_done"] == 8_000
    assert half_widths(tmp_path / "rls2").max() < 2
    widest = done["precision"]["widest"]["rls2"]
    most = half_widths(tmp_path / "rls2").max()
    assert_rounded(widest["percent"], most, condition=100 / most, operations=3)  # a difference of ends
    command("run", "rls2", "-n", 4_000, *PLAIN, "--out", tmp_path / "before")
    assert half_widths(tmp_path / "before" / "rls2").max() >= 2
    command("run", "rls2", "-n", 8_000, *PLAIN, "--out", tmp_path / "plain")
    assert csv_bytes(tmp_path / "plain" / "rls2") == csv_bytes(tmp_path / "rls2")
    command("run", "rls2", "-n", "1e5", *PLAIN, "--out", tmp_path / "more")  # what is stored changes nothing
    further = ("--threads", 3, "--replace")
    command("run", "rls2", "-n", "1e6", "--precision", 2, *further, *PLAIN, "--out", tmp_path / "more")
    assert record(tmp_path / "more" / "rls2")["realisations_done"] == 8_000


@pytest.mark.slow
def test_an_unmet_precision_names_the_worst_cell_and_writes_what_is_done(tmp_path):
    result = command("run", "rls2", "-n", 5_000, "--precision", 0.1, *PLAIN, "--out", tmp_path, code=3)
    widths = half_widths(tmp_path / "rls2")
    row = pd.read_csv(tmp_path / "rls2" / "curves.csv").iloc[int(np.argmax(widths))]
    assert result.stderr == (
        f"rls2: precision of 0.1 % not reached; worst: rls2: filter '{row['filter']}', component {row.component}, "
        f"k = {row.k}: σ ± {widths.max():.3g} % at 5000 realisations\n"
    )
    assert record(tmp_path / "rls2")["stop"].startswith("precision of 0.1 % not reached")
    command("report", "rls2", "--no-figures", "--out", tmp_path)


def test_n_itself_is_the_last_look(tmp_path):
    """64 000 are too few and 128 000 more than may be: 10⁵ do."""
    command("run", "rls2", "-n", "1e5", "--precision", 0.5, *PLAIN, "--out", tmp_path)
    done = record(tmp_path / "rls2")
    assert (done["stop"], done["realisations_done"]) == ("done", 100_000)
    assert half_widths(tmp_path / "rls2").max() < 0.5
    (check,) = json.loads(command("check", "rls2", "-n", "1e5", "--precision", 0.5, "--json").stdout)
    assert check["cases"][0]["need"]["realisations"] == check["cases"][0]["realisations"] == 100_000


def test_a_precision_of_gains_is_in_points(tmp_path):
    command("run", "rls2", "-n", "1e5", "--precision", 2, "--of", "gain", *PLAIN, "--out", tmp_path)
    gains = pd.read_csv(tmp_path / "rls2" / "gains.csv")
    assert 0.5 * (gains["gain_hi"] - gains["gain_lo"]).max() < 2
    done = record(tmp_path / "rls2")
    assert done["precision"]["widest"]["rls2"]["of"] == "gain"
    assert done["realisations_done"] < 100_000
    unmet = command("run", "rls2", "-n", 2_000, "--precision", 0.1, "--of", "gain", *PLAIN, "--out", tmp_path, code=3)
    assert "precision of 0.1 points not reached" in unmet.stderr
    assert ": gain ± " in unmet.stderr


@pytest.mark.slow
def test_a_precision_of_rates_is_relative_and_of_the_last_window(tmp_path):
    fewer = ("--set", "sweep.estimators.0.lock_probability=[0.999]", *PLAIN, "--out", tmp_path)
    command("run", "discriminator_rare", "-n", "1e5", "--precision", 20, "--of", "lost", *fewer)
    rare = pd.read_csv(tmp_path / "discriminator_rare" / "rare.csv").iloc[0]
    assert 50 * (rare["event_rate_hi"] - rare["event_rate_lo"]) / rare["event_rate"] < 20
    assert rare["n"] < 100_000
    (predicted,) = json.loads(
        command("check", "discriminator_rare", "--precision", 20, "--of", "lost", "--json", *fewer[:2]).stdout
    )
    assert 0.5 <= predicted["cases"][0]["need"]["realisations"] / rare["n"] <= 2
    refused = command("run", "rls2", "-n", 4_000, "--precision", 1, "--of", "lock", *PLAIN, "--out", tmp_path, code=2)
    measured = "sigma", "gain", "floor", "lag_1", "lag_2", "lag_5", "lag_10", "smoothed"
    assert refused.stderr == f"rls2: study range_doppler measures no 'lock', but {', '.join(measured)}\n"


@pytest.mark.slow
def test_all_cases_count_for_a_precision(tmp_path):
    """A precision that half of the cases meet: what is unmet, and which is worst, is told of all."""
    four = ("--set", "sweep={radar.scan_period_s: [2, 5, 10, 15]}", *PLAIN, "--out", tmp_path)
    sized = ("run", "rls2", "-n", 2_000, *four, "--precision")

    def widest():
        cases = record(tmp_path / "rls2")["precision"]["widest"]
        assert len(cases) == 4
        return {name: case["percent"] for name, case in cases.items()}

    command(*sized, 0.1, code=3)
    percent = sorted(widest().values())
    result = command(*sized, (percent[1] + percent[2]) / 2, code=3)
    assert percent[1] < percent[2]
    assert sorted(widest().values()) == percent
    assert "in 2 of 4 cases" in result.stderr
    assert f" of 4 cases; worst: {max(widest(), key=widest().get)}:" in result.stderr


def test_a_time_limit_keeps_what_is_done_and_the_same_command_goes_on(tmp_path):
    limited = ("run", "rls2", "-n", "3e9", "--time-limit", 0.5, *PLAIN, "--out", tmp_path)
    assert command(*limited, code=3).stderr == "rls2: time limit of 0.5 s\n"
    first = record(tmp_path / "rls2")["realisations_done"]
    assert 0 < first < 3e9
    assert pd.read_csv(tmp_path / "rls2" / "curves.csv")["n"].unique().tolist() == [first]
    command(*limited, code=3)
    second = record(tmp_path / "rls2")
    assert second["realisations_done"] > first
    assert second["realisations_from_store"] == first
    command("report", "rls2", "--no-figures", "--out", tmp_path)
    assert record(tmp_path / "rls2")["realisations_done"] == second["realisations_done"]


@pytest.mark.slow
def test_a_time_limit_within_an_experiment_of_cases_tells_those_that_are_done(tmp_path):
    many = ("range_doppler", "-n", "1e8", "--no-figures", "--out", tmp_path)
    command("run", *many, "--quiet", "--time-limit", 0.6, code=3)
    done = record(tmp_path / "range_doppler")["cases"]
    assert len(done) == 30
    assert done["rls1"]["done"] > 0
    assert list(done.values())[-1]["done"] == 0
    report = command("report", "range_doppler", "--no-figures", "--out", tmp_path, "--json")
    assert {case["done"] for case in json.loads(report.stdout)[0]["cases"].values()} >= {0}


@pytest.mark.slow
def test_a_limit_too_short_for_a_block_says_that_nothing_was_done(tmp_path):
    result = command("run", "rls1", "--time-limit", 1e-9, *PLAIN, "--out", tmp_path, code=3)
    assert result.stderr == "rls1: time limit of 1e-09 s: nothing was finished by then\n"
    assert not (tmp_path / "rls1").exists()
    share = ("run", "rls2", "-n", "1e9", "--shard", "2/2", "--time-limit", 0.5, "--out", tmp_path)
    stopped = command(*share, code=3).stderr
    assert re.fullmatch(r"rls2: time limit of 0\.5 s; share \d of \d: \d+ of \d+ pieces missing\n", stopped)


def test_a_limit_leaves_time_for_tables_and_figures(monkeypatch):
    """As much as they take, and at most half of what is left."""
    clock = [100.0]
    monkeypatch.setattr(stop_conditions.time, "monotonic", lambda: clock[0])
    limit = stop_conditions.TimeLimit(60.0)
    for reserve, end in ((10.0, 150.0), (45.0, 130.0)):
        clock[0] = 100.0
        kept = limit.with_reserve(reserve)
        clock[0] = end - 0.1
        assert kept() is None
        clock[0] = end + 0.1
        assert kept() == "time limit of 60 s"
    clock[0] = 170.0
    assert limit.remaining_s == 0.0
    assert limit.with_reserve(5.0)() == "time limit of 60 s"


@pytest.mark.parametrize(("figures", "overrides"), [(True, []), (False, []), (True, ["figures=[]"])])
def test_what_writing_takes_is_measured_by_case_and_figure(monkeypatch, figures, overrides):
    ticks = iter(range(100))
    monkeypatch.setattr(writing_time.time, "perf_counter", lambda: float(next(ticks)))
    saved = []
    monkeypatch.setattr("radarsim.report.drawing.canvas.draw", lambda *given: saved.append(given))
    experiment = load("range_doppler", ["realisations=2000", *overrides])
    found = writing_time.writing_seconds(experiment, figures, None)
    assert len(saved) == 2 * figures
    names = len(experiment.figures or result_content.case_figures(*few(experiment.cases[0])))
    assert found == 1.25 * (len(experiment.cases) + (0.5 * names if figures else 0))


def test_a_run_that_ends_in_time_is_done_and_what_was_kept_for_writing_is_told(tmp_path):
    command("run", "rls2", "-n", 3_000, "--time-limit", 600, *PLAIN, "--out", tmp_path)
    assert record(tmp_path / "rls2")["seconds_kept_for_writing"] > 0
    assert record(tmp_path / "rls2")["stop"] == "done"


@pytest.mark.slow_cases("1")
@pytest.mark.parametrize("of", [1, 3])
def test_shares_united_by_copying_are_the_whole_run(tmp_path, of):
    for number in range(1, of + 1):
        share = command("run", "rls2", "-n", 50_001, "--shard", f"{number}/{of}", "--out", tmp_path / str(number))
        assert f"share    {number} of {of} of rls2" in share.stdout
        assert {path.name for path in (tmp_path / str(number)).iterdir()} == {".blocks"}
        shutil.copytree(tmp_path / str(number), tmp_path / "all", dirs_exist_ok=True)
    command("run", "rls2", "-n", 50_001, *PLAIN, "--out", tmp_path / "all")
    assert record(tmp_path / "all" / "rls2")["realisations_computed"] == 0
    command("run", "rls2", "-n", 50_001, *PLAIN, "--out", tmp_path / "whole")
    assert csv_bytes(tmp_path / "all" / "rls2") == csv_bytes(tmp_path / "whole" / "rls2")


@pytest.fixture(scope="module")
def shares(tmp_path_factory):
    """The three shares of 100,000 realisations of rls2, a folder each."""
    root = tmp_path_factory.mktemp("shares")
    for number in (1, 2, 3):
        command("run", "rls2", "-n", "1e5", "--shard", f"{number}/3", "--out", root / str(number))
    return root


def united(shares, to, *numbers):
    for number in numbers:
        shutil.copytree(shares / str(number), to, dirs_exist_ok=True)
    return to


MISSING = "realisations 32,768 to 65,535; perhaps share 2 of 3 was not copied"


@pytest.mark.slow
def test_a_run_says_which_share_its_store_lacks_and_computes_it(shares, tmp_path):
    run = ("run", "rls2", "--no-figures", "--out", united(shares, tmp_path, 1, 3), "-n")
    line = f"note: rls2: 67,232 of 100,000 realisations are stored; missing: {MISSING}\n"
    assert command(*run, "1e5").stderr.startswith(line)
    assert record(tmp_path / "rls2")["realisations_computed"] == 32_768
    assert command(*run, "1e5").stderr == ""  # all is there now
    assert command(*run, "2e5").stderr == ""  # a larger run goes on where the first one ended


def test_a_precision_may_need_less_than_what_lacks(shares, tmp_path):
    wanted = ("-n", "1e5", "--precision", 20, "--no-figures", "--out", united(shares, tmp_path, 1, 3))
    assert f"missing: {MISSING}\n" in command("run", "rls2", *wanted).stderr
    assert record(tmp_path / "rls2")["realisations_done"] == 2_000


@pytest.mark.parametrize("options", [["--shard", "2/3"], PLAIN])
def test_a_share_and_a_quiet_run_say_nothing_of_what_lacks(shares, tmp_path, options):
    assert command("run", "rls2", "-n", "1e5", *options, "--out", united(shares, tmp_path, 1, 3)).stderr == ""


def test_report_says_how_much_is_stored_and_what_is_missing(shares, tmp_path):
    ended = command("report", "rls2", "-n", "1e5", "--out", united(shares, tmp_path, 1, 3), code=2)
    assert f"rls2: 67,232 of 100,000 realisations are stored in {tmp_path}; missing: {MISSING}\n" in ended.stderr
    ended = command("report", "rls2", "-n", "1e5", "--out", united(shares, tmp_path / "one", 1), code=2)
    assert "; perhaps shares 2 and 3 of 3 were not copied\n" in ended.stderr


def test_check_says_what_is_stored_what_is_missing_and_how_long_it_takes(shares, tmp_path):
    united(shares, tmp_path, 1, 3)
    ask = ("check", "rls2", "-n", "1e5", "--out")
    text = command(*ask, tmp_path).stdout
    assert f"67,232 of 100,000 stored; missing: {MISSING}\n" in text
    assert "1 case, 67,232 of 100,000 realisations stored, the rest under a second on " in text
    (document,) = json.loads(command(*ask, tmp_path, "--json").stdout)
    (case,) = document["cases"]
    assert case["stock"] == {
        **{"asked": 100_000, "stored": 67_232, "missing": [[32_768, 65_535]]},
        **{"shares": [[2], 3], "loose": True, "part": [1, 1], "blocks": 25, "missing_blocks": 8},
    }
    whole = json.loads(command("check", "rls2", "-n", "1e5", "--json").stdout)[0]["cases"][0]
    assert whole["stock"] is None
    assert_rounded(case["seconds"], 0.32768 * whole["seconds"], operations=3)
    (share,) = json.loads(command(*ask, tmp_path, "--shard", "3/3", "--json").stdout)
    assert share["share"] == [3, 3]
    assert share["cases"][0]["realisations"] == share["cases"][0]["stock"]["stored"] == 100_000 - 65_536
    assert share["cases"][0]["seconds"] == 0
    assert "0 s\n" in command(*ask, tmp_path, "--shard", "3/3").stdout
    empty = (*ask, tmp_path / "empty", "--shard", "1/3")
    part = json.loads(command(*empty, "--json").stdout)[0]["cases"][0]
    assert part["realisations"] == 32_768
    assert_rounded(part["seconds"], 0.32768 * whole["seconds"], operations=3)
    assert "share    1 of 3\ntotal    1 case, 32,768 realisations, under a second on " in command(*empty).stdout


def test_a_share_that_was_interrupted_is_named_as_it_was_asked_for(shares, tmp_path):
    united(shares, tmp_path, 1, 3)
    for number in (9, 10, 11):  # the first three of the eight blocks of the second share
        command("run", "rls2", "-n", "1e5", "--shard", f"{number}/25", "--out", tmp_path, "-q")
    ask = ("check", "rls2", "-n", "1e5", "--out", tmp_path)
    assert "share" not in command(*ask).stdout
    asked = "12,288 of 32,768 stored; share 2 of 3: 5 of 8 pieces missing, realisations 45,056 to 65,535\n"
    assert asked in command(*ask, "--shard", "2/3").stdout


def test_a_share_that_a_signal_ends_names_the_pieces_that_are_missing(tmp_path):
    """Of all cases, also of those that it did not come to."""
    stop, experiment = stop_conditions.Signals(), load({"include": ["rls1", "rls2"]}, ["realisations=1e5"])
    stop.received_signal = 2
    for missing in (26, 13):  # before the second time the share of rls2 is computed
        with pytest.raises(Interruption) as caught:
            run_share(experiment, (2, 2), out=tmp_path, threads=0, stop=stop)
        assert str(caught.value) == (
            f"stopped by Ctrl-C; share 2 of 2: {missing} of 26 pieces missing; run the same command again to continue"
        )
        assert str(pickle.loads(pickle.dumps(caught.value))) == str(caught.value)
        command("run", "rls2", "-n", "1e5", "--shard", "2/2", "--out", tmp_path, "-q")


@pytest.mark.slow
def test_of_many_cases_the_first_that_lacks_a_share_is_named(tmp_path):
    config = ("rls2_manoeuvre_variance", "-n", 13_000, "--out", tmp_path)
    for number in (1, 3):
        command("run", *config, "--shard", f"{number}/3", "--quiet")
    cases = len(load("rls2_manoeuvre_variance").cases)
    note = command("run", *config, "--no-figures").stderr.splitlines()[0]
    assert (
        f"{cases * 8_904:,} of {cases * 13_000:,} realisations are stored; missing: realisations 4096 to 8191" in note
    )
    assert f", the first of {cases} such cases)" in note


def test_check_with_a_precision_counts_what_is_stored(tmp_path):
    command("run", "rls2", "-n", 20_000, *PLAIN, "--out", tmp_path)
    (document,) = json.loads(command("check", "rls2", "--precision", 1, "--out", tmp_path, "--json").stdout)
    (case,) = document["cases"]
    assert case["realisations"] == 32_000
    assert case["stock"]["stored"] == 16_384  # the whole blocks


def test_doctor_names_what_is_not_stored_before_what_is(shares, tmp_path):
    command("run", "rls2", "-n", 3000, *PLAIN, "--out", united(shares, tmp_path, 1, 3))
    text = command("doctor", tmp_path / "rls2").stdout
    assert "realisations 32,768 to 65,535 are not stored, but later ones are" in text
    assert "all intact" in text
    before = command("doctor", united(shares, tmp_path / "new", 1, 3) / "rls2", code=2)
    assert f"`radarsim check CONFIG --out {tmp_path / 'new'}` says what is stored there" in before.stderr
    command("run", "rls2", "-n", "1e5", *PLAIN, "--out", tmp_path)
    assert "not stored" not in command("doctor", tmp_path / "rls2").stdout


def test_json_is_one_document_on_stdout(tmp_path):
    out = ("--out", tmp_path, "--json")
    (run,) = json.loads(command("run", "rls2", "-n", 3_000, "--no-figures", *out).stdout)
    assert run["cases"] == {"rls2": {"asked": 3_000, "done": 3_000, "seed": 2017}}
    assert run["last_scan"][0]["sigma_lo"] < run["last_scan"][0]["sigma"]
    assert run["last_scan"][0]["gain_percent"] is None
    (report,) = json.loads(command("report", "rls2", "--no-figures", *out).stdout)
    assert report["last_scan"] == run["last_scan"]
    assert {row["config"] for row in json.loads(command("claims", "rls2", *out).stdout)} == {"rls2"}
    assert len(json.loads(command("claims", *out).stdout)) > 25
    (check,) = json.loads(command("check", "rls2", "--precision", 1, "--json").stdout)
    assert check["cases"][0]["need"]["realisations"] == 32_000
    listed = json.loads(command("list", "--json").stdout)
    assert {"name": "range_doppler"}.items() <= listed["studies"][0].items()
    unmet = command("run", "rls2", "-n", 2_000, "--precision", 0.1, "--no-figures", *out, code=3)
    assert json.loads(unmet.stdout)[0]["unmet"][0] in unmet.stderr
    (share,) = json.loads(command("run", "rls2", "-n", 3_000, "--shard", "1/2", *out).stdout)
    assert (share["number"], share["of"]) == (1, 2)


@pytest.mark.slow
def test_a_pilot_and_exact_values_say_about_the_same(tmp_path):
    """The last look that both predict is within a doubling of where the run ends."""
    for config, percent in (("rls2", 1), ("sonar_correlated", 2)):
        (check,) = json.loads(command("check", config, "-n", "1e6", "--precision", percent, "--json").stdout)
        command("run", config, "-n", "1e6", "--precision", percent, *PLAIN, "--out", tmp_path)
        done = record(tmp_path / config)["cases"]
        for case in check["cases"]:
            assert case["need"]["known_by"] == "exact"
            assert 0.5 <= case["need"]["realisations"] / done[case["name"]]["done"] <= 2


@pytest.mark.slow
def test_a_pilot_that_saw_large_errors_foretells_where_a_run_ends(tmp_path):
    """Tracks whose first plots were missed err by a hundred times σ²: no run ends before such are seen often enough."""
    words = ("rls2", "-n", "1e6", "--precision", 20, "--set", "radar.detection_probability=0.9")
    (check,) = json.loads(command("check", *words, "--json").stdout)
    command("run", *words, *PLAIN, "--out", tmp_path)
    assert check["cases"][0]["need"]["realisations"] == record(tmp_path / "rls2")["realisations_done"] == 512_000


@pytest.mark.parametrize("chunk", [1, 8, 512])
def test_a_pilot_knows_that_kernels_calculate_chunks(monkeypatch, chunk):
    """One realisation costs as much as a chunk of them, and stands for no more than its share."""
    monkeypatch.setattr(progress, "measure_seconds", lambda work, count: 0.02 * -(-count // chunk))
    for pilot_s in (0.3, 0.06):
        seconds = progress.seconds_each(SimpleNamespace(block=4096), 100_000, pilot_s)
        assert_rounded(seconds, 0.02 / chunk, operations=4)


@pytest.mark.slow
def test_python_takes_a_precision_and_a_limit():
    result = radarsim.run("rls2", realisations=1e6, precision=2)
    assert result.unmet == []
    assert result.cases[0].count == 8_000
    assert radarsim.run("rls2", realisations=2e9, time_limit=0.5).unmet == ["time limit of 0.5 s"]
    with pytest.raises(TargetUnmet, match="nothing was finished"):
        radarsim.run("rls2", time_limit=1e-9)

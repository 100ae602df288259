"""One's own data: a realisation written as plots, tracked again, tested; a config of one's own."""

import csv
import math
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from radarsim.api import configs, load_experiments
from radarsim.api.case_work import CaseWork
from radarsim.api.new_configs import write_new_config
from radarsim.cli import command_group
from radarsim.cli.command_group import main
from radarsim.config import find_files
from radarsim.config.identity import identity_keys
from radarsim.errors import ConfigError
from radarsim.recordings import csv_output, read_plots, rows_by_track, simulate_plots, study_part, track
from radarsim.recordings.report import innovation_tests
from radarsim.studies.range_doppler import tracking
from tests.program import command
from tests.recordings import plot_files
from tests.tolerances import Z, assert_rounded, rounding

RUNS = {  # config, overrides
    "rls2": (),
    "rls5": (),
    "multimodel": ("scans=600",),
    "multimodel_1hz": (),
    "sonar_smoothing": (),
    "sonar_missed": ("sweep.sensor.detection_probability=[0.7]",),
    "sonar_correlated": ("sweep.sensor.error_correlation=[0.6]",),
}


def loaded(config, overrides=()):
    return load_experiments.load_all([config], overrides)[0]


def table_of(path):
    with path.open(newline="") as file:
        return list(csv.reader(file))


def truth_of(columns, components):
    units = {"m": "m", "m/s": "mps", "m/s2": "mps2", "rad": "rad", "rad/s": "radps", "rad/s2": "radps2"}
    return np.stack([columns[f"true_{name}_{units[unit]}"] for name, unit in components], axis=1)


def track_rounding(track):
    """How far estimates may differ by rounding, in their σ: places, of which all are differences, ten times a row."""
    places = [unit in ("m", "rad") for _, unit in track.components]
    with np.errstate(invalid="ignore", divide="ignore"):
        share = np.abs(track.estimate) / track.sigma
    return rounding(share[..., places][np.isfinite(share[..., places])].max(), 10 * len(track.t_s))


@pytest.mark.parametrize("config", RUNS)
@pytest.mark.parametrize("realisation", [0, 4099])
def test_track_over_a_simulated_file_makes_the_errors_of_the_study(tmp_path, config, realisation):
    one = loaded(config, RUNS[config])
    columns = simulate_plots.simulate_realisation(one, realisation)
    path = tmp_path / "plots.csv"
    csv_output.write_columns(columns, path)
    case, track = plot_files.track(one, path)
    work = CaseWork(case)
    sums = work.plan.layout.unpack(work.simulate(realisation, 1))
    at = np.asarray(work.plan.axes.k) - 1
    error = (track.estimate - truth_of(columns, track.components))[:, at]
    sigma = np.where(track.sigma[:, at] > 0, track.sigma[:, at], 1.0)
    there = np.asarray(sums["estimates"]) > 0 if "estimates" in sums else work.plan.axes.available
    assert np.array_equal(np.isfinite(error), there)
    assert np.max(np.abs(np.where(there, (error - sums["error"][..., 0]) / sigma, 0.0))) < track_rounding(track)


@pytest.mark.slow_cases("multimodel")
@pytest.mark.parametrize("config", ["rls2", "multimodel"])
def test_a_file_in_pieces_gives_the_same_track(tmp_path, config):
    one = loaded(config, ("scans=300",))
    columns = simulate_plots.simulate_realisation(one)
    rng = np.random.default_rng(5)
    measured = [name for name in columns if not name.startswith("true_")][1:]
    for name in measured:
        columns[name] = np.where(rng.random(300) < 0.2, np.nan, columns[name])
    study = study_part.recording_interface(one.cases[0])
    wanted = {name: columns[name] for name in ("t_s", *measured)}
    whole = study.tracker(one.cases[0]).feed(wanted)
    for size in (1, 7, 299):
        tracker = study.tracker(one.cases[0])
        pieces = [
            tracker.feed({name: column[i : i + size] for name, column in wanted.items()}) for i in range(0, 300, size)
        ]
        parts = rows_by_track.join_tracks(pieces)
        scale = np.where(whole.sigma > 0, whole.sigma, 1.0)
        assert np.array_equal(np.isfinite(parts.estimate), np.isfinite(whole.estimate))
        assert np.nanmax(np.abs(parts.estimate - whole.estimate) / scale) < track_rounding(whole)


def test_uneven_times_and_missing_values_are_least_squares_without_a_manoeuvre():
    """A filter that allows for no manoeuvre ends at the weighted least squares of all that it was given."""
    rng = np.random.default_rng(1)
    one = loaded("rls2", ("manoeuvre_variance=1e-18",))
    t = np.cumsum(rng.uniform(1, 20, 60))
    z = np.stack([1e5 - 250 * t + 250 * rng.normal(size=60), -250 + 15 * rng.normal(size=60)], axis=1)
    z[rng.random(z.shape) < 0.3] = np.nan
    z[0] = 1e5, -250
    columns = {"t_s": t, "range_m": z[:, 0], "velocity_mps": z[:, 1]}
    track = study_part.recording_interface(one.cases[0]).tracker(one.cases[0]).feed(columns)
    s = t - t[-1]
    rows = [np.stack([np.ones(60), s, s**2 / 2], axis=1) / 250, np.stack([np.zeros(60), np.ones(60), s], axis=1) / 15]
    for f, observed in enumerate((1, 2)):
        A = np.concatenate([row[np.isfinite(z[:, j])] for j, row in enumerate(rows[:observed])])
        b = np.concatenate([(z[:, j] / (250, 15)[j])[np.isfinite(z[:, j])] for j in range(observed)])
        expected = np.linalg.lstsq(A, b, rcond=None)[0]
        spread = np.sqrt(np.diagonal(np.linalg.inv(A.T @ A)))
        # D_M t⁶/36 of variance moves estimates by so much of their σ, at most as far as errors are.
        moved = 1e-18 * t[-1] ** 6 / 36 / spread[0] ** 2
        assert (np.abs(track.estimate[f, -1] - expected) < (Z * moved + track_rounding(track)) * spread).all()
        np.testing.assert_allclose(track.sigma[f, -1], spread, rtol=moved)


def test_a_row_without_a_value_is_extrapolated():
    one = loaded("rls2")
    columns = {"t_s": np.array([0.0, 10, 20, 30, 47]), "range_m": np.array([1e5, 9.7e4, 9.4e4, 9.1e4, np.nan])}
    columns["velocity_mps"] = np.array([-300.0, -300, -300, -300, np.nan])
    track = study_part.recording_interface(one.cases[0]).tracker(one.cases[0]).feed(columns)
    for f in range(2):
        r, v, a = track.estimate[f, 3]
        expected = [r + 17 * v + 17**2 / 2 * a, v + 17 * a, a]
        assert_rounded(track.estimate[f, 4], expected, [r, 300, abs(a)], operations=4)
        assert (track.sigma[f, 4] > track.sigma[f, 3]).all()
        assert np.isnan(track.nis[f, 4]).all()


def test_velocities_alone_never_start_a_track_of_ranges(monkeypatch):
    one = loaded("rls2")
    monkeypatch.setattr(tracking, "MAX_START_PLOTS", 40)
    t = np.arange(150.0)  # more than a start looks back
    columns = {"t_s": t, "range_m": np.full(150, np.nan), "velocity_mps": np.full(150, 7.0)}
    track = study_part.recording_interface(one.cases[0]).tracker(one.cases[0]).feed(columns)
    assert np.isnan(track.estimate[0]).all()
    assert np.array_equal(np.isfinite(track.estimate[1]), np.tile([False, True, False], (150, 1)))


def followed(tmp_path, config, overrides, stated=()):
    one = loaded(config, overrides)
    path = tmp_path / "plots.csv"
    csv_output.write_columns(simulate_plots.simulate_realisation(one), path)
    return track.track_plots(loaded(config, (*overrides, *stated)), path)


@pytest.mark.slow_cases("*sonar_smoothing*")
@pytest.mark.parametrize(
    ("config", "overrides", "key", "true"),
    [
        ("rls2", ("scans=2000", "manoeuvre_variance=1e-7"), "radar.sigma_range_m", 250),
        ("rls2", ("scans=2000", "manoeuvre_variance=1e-7"), "radar.sigma_velocity_mps", 15),
        ("sonar_smoothing", ("scans=150",), "sensor.sigma_bearing_rad", math.radians(1)),
    ],
)
@pytest.mark.parametrize("factor", [0.5, 2])
def test_a_wrong_accuracy_is_seen(tmp_path, config, overrides, key, true, factor):
    found = followed(tmp_path, config, overrides, (f"{key}={true * factor!r}",))
    name = {"sigma_range_m": "range_m", "sigma_velocity_mps": "velocity_mps"}.get(key.split(".")[1], "bearing_rad")
    judged = [one for one in innovation_tests.innovation_tests(found) if one.name == name and one.tests]
    assert judged
    for one in judged:
        assert one.verdict == (innovation_tests.TOO_SMALL if factor < 1 else innovation_tests.TOO_LARGE)


def test_a_right_accuracy_is_called_so(tmp_path):
    found = followed(tmp_path, "multimodel", ("scans=3000",))
    verdicts = {one.filter: one for one in innovation_tests.innovation_tests(found)}
    assert verdicts["Kalman-1 5"].verdict == innovation_tests.TOO_SMALL  # its model lags behind a target that falls
    assert 0.9 < verdicts["MMA2-122"].nis < 1.1
    for scans in (8, 4):
        few = [
            one
            for one in innovation_tests.innovation_tests(followed(tmp_path, "rls2", (f"scans={scans}",)))
            if one.tests
        ]
        assert {one.verdict for one in few} == {innovation_tests.TOO_FEW_PLOTS}
        assert all(0 <= one.lo < 1 < one.hi for one in few)


@pytest.mark.slow
def test_the_command_tells_gaps_missing_values_and_draws(tmp_path):
    source, track, report = tmp_path / "plots.csv", tmp_path / "track.csv", tmp_path / "report"
    assert "60 rows" in command("simulate", "rls2", "-o", source, "--set", "scans=60").stdout
    rows = table_of(source)
    rows[10][2] = ""
    del rows[20:30]
    with source.open("w", newline="") as file:
        csv.writer(file).writerows(rows)
    result = command("track", "rls2", source, "-o", track, "--report", report)
    assert "plots    50 rows over 590 s, from 0 s" in result.stdout
    assert "missing  1 of velocity_mps" in result.stdout
    assert (
        "gaps     1 longer than three times the usual interval of 10 s; the longest 110 s, after 180 s" in result.stdout
    )
    assert "NIS" in result.stdout
    names = {path.name for path in (report / "figures").iterdir()}
    assert names == {"plan.svg", "track.svg", "residuals.svg", "nis.svg"}
    written = table_of(track)
    assert written[0] == ["t_s", "filter", "component", "unit", "estimate", "sigma"]
    assert len(written) - 1 == 2 * 3 * 50 - 2 - 2 - 1  # before its start a filter gives what it observes alone


def test_the_track_alone_goes_to_the_terminal_and_words_beside_it(tmp_path):
    source = tmp_path / "plots.csv"
    command("simulate", "rls2", "-o", source)
    result = command("track", "rls2", source)
    assert result.stdout.startswith("t_s,filter,component,unit,estimate,sigma\n0.0,r,r,m,")
    assert "rows" in result.stderr
    assert "NIS" not in result.stdout
    assert command("track", "rls2", source, "--quiet").stderr == ""


@pytest.mark.slow
def test_plots_may_come_through_a_pipe(tmp_path):
    """`… | radarsim track CONFIG /dev/stdin > TRACK.csv`: the same as from a file and to a file."""
    source, track = tmp_path / "plots.csv", tmp_path / "track.csv"
    command("simulate", "rls2", "-o", source)
    command("track", "rls2", source, "-o", track)
    piped = [sys.executable, "-m", "radarsim", "track", "rls2", "/dev/stdin", "--quiet"]
    plots_text = source.read_text()
    done = subprocess.run(piped, input=plots_text, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr, done.stdout) == (0, "", track.read_text())
    wrong = plots_text.replace("\n10.0,", "\nten,", 1)
    refused = subprocess.run(piped, input=wrong, capture_output=True, text=True, check=False)
    assert (refused.returncode, refused.stdout) == (2, "")
    assert refused.stderr == "/dev/stdin:3:1: t_s: must be a finite number, got 'ten'\n"


def test_a_gap_in_a_pipe_is_named_by_its_row():
    """A pipe is read once, so the line cannot be looked up again."""
    text = "t_s,range_m,velocity_mps\n0,1e5,-250\n10,9.75e4,-250\n20,9.5e4,-250\n30,9.25e4,-250\n1e15,1e5,-250\n"
    ready, given = os.pipe()
    with open(given, "w") as file:
        file.write(text)
    try:
        fault = command("track", "rls2", f"/dev/fd/{ready}", code=2).stderr
    finally:
        os.close(ready)
    assert fault.startswith(f"/dev/fd/{ready}: row 5 after the header: t_s: after a gap of 1e+15 s"), fault


@pytest.mark.parametrize("realisation", [2**62, 2**64 - 1, 2**64, 10**30])
def test_a_realisation_that_no_run_has(tmp_path, realisation):
    fault = command("simulate", "rls2", "-i", realisation, "-o", tmp_path / "plots.csv", code=2).stderr
    assert re.search("must be (from 0 to|<=) ", fault), fault
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("t_s,range_m,velocity_mps\n0,x,1\n", "plots.csv:2:2: range_m: must be a finite number, got 'x'"),
        ("t_s,range_m\n0,1\n", "plots.csv:1: must have the columns t_s, range_m, velocity_mps; got t_s, range_m"),
    ],
)
def test_a_wrong_file_is_told_by_line_and_column_and_no_track_is_left(tmp_path, text, expected):
    (tmp_path / "plots.csv").write_text(text)
    result = command("track", "rls2", tmp_path / "plots.csv", "-o", tmp_path / "track.csv", code=2)
    (line,) = result.stderr.splitlines()
    assert line.startswith(f"{tmp_path}/{expected}")
    assert [path.name for path in tmp_path.iterdir()] == ["plots.csv"]


def test_times_are_judged_across_pieces_of_a_file(tmp_path, monkeypatch):
    path = tmp_path / "plots.csv"
    path.write_text("t_s,range_m,velocity_mps\n" + "".join(f"{t},1e5,1\n" for t in (0, 1, 2, 2, 3)))
    with pytest.raises(ConfigError, match=r":5:1: t_s: must be later than the row before, got 2 after 2"):
        list(read_plots.pieces(path, [("t_s", "range_m", "velocity_mps")], 3))


def advised(fault):
    """The command that a fault ends with."""
    return shlex.split(fault.strip().rpartition(": radarsim ")[2])


def test_one_of_several_cases_is_named_and_the_command_given_works(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    fault = command("simulate", "rls2_manoeuvre_variance", "-o", "x.csv", code=2).stderr
    assert "got 5; choose of manoeuvre_variance = 1e-5, 0.0001, 0.001, 0.01, 0.1: " in fault
    command(*advised(fault))
    fault = command("track", "range_doppler", "PLOTS.csv", code=2).stderr
    assert "must be one case to track with, got 30; choose one of rls1, rls2, rls3, rls4, rls5: " in fault
    assert advised(fault) == ["track", "rls1", "PLOTS.csv"]
    command(*advised(fault))


def test_the_choice_of_swept_mappings_and_of_configs_elsewhere(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    command("simulate", "rls2", "-o", "a {b}.csv")
    away = tmp_path / "away"
    away.mkdir()
    turn = "{kind: polynomial, coefficients: [1e5, -100]}"
    (away / "targets.yaml").write_text(f"include: [rls2]\nsweep:\n  target: [{turn}, turn]\n  scans: [12, 15]\n")
    command(*advised(command("track", "away/targets.yaml", "a {b}.csv", code=2).stderr))
    write_new_config("mine", "rls2")
    (tmp_path / "mine.yaml").rename(away / "mine.yaml")
    (away / "both.yaml").write_text("include: [mine, rls2]\n")
    fault = command("track", "away/both.yaml", "a {b}.csv", code=2).stderr
    assert advised(fault) == ["track", "away/mine.yaml", "a {b}.csv"]
    command(*advised(fault))


LONG = """
import sys
for i in range(int(sys.argv[1])):
    print(f"{i},{1e5 + i},1" if i else "t_s,range_m,velocity_mps\\n0,1e5,1")
"""
PEAK = """
import resource, sys
from radarsim.cli.command_group import main
try:
    main(["track", "rls2", "/dev/stdin", "-o", "/dev/null"])
finally:
    print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)
"""


@pytest.mark.slow
def test_memory_does_not_grow_with_the_file():
    """Peak memory of the command over 10⁵ and over 10⁷ rows: the same to a few megabytes."""

    def peak_mb(rows):
        with subprocess.Popen([sys.executable, "-c", LONG, str(rows)], stdout=subprocess.PIPE) as long:
            done = subprocess.run([sys.executable, "-c", PEAK], stdin=long.stdout, capture_output=True, text=True)
        assert f"plots    {rows} rows" in done.stdout, done.stderr
        return float(done.stdout.splitlines()[-1])

    few, many = peak_mb(10**5), peak_mb(10**7)
    assert many - few < 10, (few, many)


# Configs, and of how many terms a number is the sum: of ten or so, or of a flight's 87 steps of 12 stages each.
EXAMPLES = {
    "range_doppler.csv": ("rls2", 20),
    "multimodel.csv": ("multimodel_1hz", 12 * 87),
    "sonar.csv": ("sonar_smoothing", 20),
}


@pytest.mark.parametrize("name", EXAMPLES)
def test_the_example_files_are_what_simulate_writes(tmp_path, name):
    config, operations = EXAMPLES[name]
    command("simulate", config, "-o", tmp_path / name)
    made, kept = (table_of(path) for path in (tmp_path / name, Path("docs/examples") / name))
    assert made[0] == kept[0]
    to_numbers = [np.array([[float(cell or "nan") for cell in row] for row in rows[1:]]) for rows in (made, kept)]
    assert_rounded(*to_numbers, np.nanmax(np.abs(to_numbers[1]), axis=0), operations=operations)


@pytest.mark.slow
def test_the_page_names_a_config_for_every_example_file(tmp_path):
    page = Path("docs/howto/own_plots.md").read_text(encoding="utf-8")
    named = dict(re.findall(r"^\| `(\w+\.csv)` \| `([^`]+)` \|$", page, re.MULTILINE))
    assert set(named) == {path.name for path in Path("docs/examples").iterdir()}
    for name, config in named.items():
        first, *options = shlex.split(config)
        command("track", first, Path("docs/examples") / name, *options, "-o", tmp_path / "track.csv")


@pytest.mark.parametrize("like", find_files.available_stems("configs"))
def test_a_config_of_ones_own_is_the_same_experiment(tmp_path, like):
    path = write_new_config("mine", like, tmp_path)
    mine, theirs = configs.load(str(path)), configs.load(like)
    assert [identity_keys(case.spec) for case in mine.cases] == [identity_keys(case.spec) for case in theirs.cases]
    assert [(case.realisations, case.seed) for case in mine.cases] == [(c.realisations, c.seed) for c in theirs.cases]


def test_new_comments_every_key_and_never_overwrites(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    result = command("new", "mine", "--like", "rls2")
    assert "radarsim run mine.yaml" in result.stdout
    lines = Path("mine.yaml").read_text().splitlines()
    for line in lines[2:]:
        assert "#" in line or line.lstrip().startswith("- {"), line
    assert any("sigma_range_m: 250" in line and "standard deviation of a measured range, m" in line for line in lines)
    assert "  name: mine " in "\n".join(lines)
    Path("mine.yaml").write_text("precious")
    assert "never overwritten" in command("new", "mine", "--like", "rls1", code=2).stderr
    assert Path("mine.yaml").read_text() == "precious"


def test_help_is_grouped_with_one_whole_line_for_each_command():
    text = command("--help").stdout
    order = [text.index(f"\n{title}:\n") for title in command_group.command_sections()]
    assert order == sorted(order)
    listed = [name for names in command_group.command_sections().values() for name in names]
    assert set(main.commands) == {*listed, *command_group.UNLISTED}
    *lines, unlisted = [line for line in text[order[0] :].split("\n") if line]
    assert len(lines) == len(command_group.command_sections()) + len(listed)
    assert ", ".join(command_group.UNLISTED) in unlisted
    assert all("Usage: " in command(name, "--help").stdout for name in command_group.UNLISTED)
    assert not any("..." in line or len(line) > 80 for line in lines)


@pytest.mark.slow
def test_no_colour_when_asked(tmp_path):
    shell = ["script", "-qec", f"{sys.executable} -m radarsim claims rls2 --out {tmp_path}", "/dev/null"]
    environment = {**os.environ, "TERM": "xterm-256color", "COLUMNS": "120", "NO_COLOR": "1"}
    shown = subprocess.run(shell, capture_output=True, env=environment, check=True).stdout
    assert b"not run" in shown or b"no claims" in shown
    assert b"\x1b[3" not in shown


@pytest.mark.parametrize("name", ["=1+1", "+cmd", "-x", "@sum"])
def test_a_name_that_a_spreadsheet_would_run_is_refused(name):
    result = command("check", "rls2", "--set", f"filters.0.name={name!r}", code=2)
    assert "must not begin with = + - or @" in result.stderr

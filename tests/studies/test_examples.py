"""The studies in `examples/` are packages of their own: installed, run by every command, tested by their own tests.

What their code may do wrong is one line, and never the numbers that are computed already.
"""

import hashlib
import json
import shutil
from pathlib import Path

import pytest

from radarsim.api.design.solve import TARGET_TOLERANCE
from radarsim.user_code import errors as user_code_errors
from tests.program import csv_bytes
from tests.studies import example_packages

EXAMPLES = example_packages.ROOT / "examples"
N = 5000  # a whole block and a partial one


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """A folder with all examples installed in its folder `site`."""
    folder = tmp_path_factory.mktemp("examples")
    for example in sorted(EXAMPLES.iterdir()):
        if (example / "pyproject.toml").is_file():
            example_packages.installed(example, folder / "site")
    return folder


@pytest.fixture(scope="module")
def radarsim(place, warm):
    """The real command, beside the installed packages."""
    return example_packages.beside(warm, place / "site", place)


LINES = {
    "chirp": 113,
    "bearings": 191,
    "learned": 247,
    "kalata": 116,
    "upf": 230,
}  # at most, of its file, without imports


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", ["chirp", *(pytest.param(name, marks=pytest.mark.slow) for name in LINES if name != "chirp")]
)
def test_its_own_tests_pass(radarsim, name):
    done = radarsim("-q", "-p", "no:cacheprovider", cwd=EXAMPLES / name, module="pytest")
    assert " passed" in done.stdout


@pytest.mark.slow
def test_the_long_tests_of_what_is_learned_pass(radarsim):
    done = radarsim("-q", "-p", "no:cacheprovider", "-m", "slow", cwd=EXAMPLES / "learned", module="pytest")
    assert " passed" in done.stdout


@pytest.mark.parametrize("name", LINES)
def test_its_file_is_short(name):
    text = (EXAMPLES / name / "src" / name / "__init__.py").read_text(encoding="utf-8")
    assert example_packages.lines_without_imports(text) <= LINES[name]


@pytest.mark.slow
def test_a_filter_whose_column_a_file_lacks_is_named(radarsim, tmp_path):
    radarsim("simulate", "chirp", "-o", "plots.csv", cwd=tmp_path)
    head, *rows = [line.split(",") for line in (tmp_path / "plots.csv").read_text().splitlines()]
    at = head.index("z_up_m")
    lines = [",".join(one[n] for n in (0, at)) for one in (head, *rows)]
    (tmp_path / "up.csv").write_text("\n".join(lines) + "\n")
    said = radarsim("track", "chirp", "up.csv", "-o", "track.csv", cwd=tmp_path)
    words = said.stdout + said.stderr
    assert "“down” used no plot, because it needs z_down_m: predictions only" in words
    assert "up took no plot" not in words
    whole = radarsim("track", "chirp", "plots.csv", "-o", "track.csv", cwd=tmp_path)
    assert "took no plot" not in whole.stdout + whole.stderr


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "n", "further", "figures"),
    [
        ("chirp", N, (), {"sigma_r.svg", "gain_v.svg"}),
        ("bearings", 1500, ("consistency.csv",), {"consistency.svg"}),
        ("learned", 700, ("consistency.csv", "failures.csv"), {"sigma_x.svg"}),
        ("kalata", N, (), {"sigma_x.svg", "gain_v.svg"}),
        ("upf", 600, ("consistency.csv", "failures.csv"), {"sigma_x.svg"}),
    ],
)
def test_an_examples_run_is_the_same_by_any_means(radarsim, tmp_path, name, n, further, figures):
    run, plain = ("run", name, "-n", n), "--no-figures"
    radarsim(*run, "--threads", 1, "--out", tmp_path / "one")
    wanted = csv_bytes(tmp_path / "one" / name)
    assert wanted.keys() == {"curves.csv", "gains.csv", "last.csv", "claims.csv", *further}
    assert figures <= {file.name for file in (tmp_path / "one" / name / "figures").iterdir()}
    radarsim(*run, "--workers", 2, plain, "--out", tmp_path / "workers")
    assert csv_bytes(tmp_path / "workers" / name) == wanted
    for share in ("2/2", "1/2"):
        radarsim(*run, "--threads", 2, "--shard", share, "--out", tmp_path / "shares")
    radarsim("report", name, "-n", n, plain, "--out", tmp_path / "shares")
    assert csv_bytes(tmp_path / "shares" / name) == wanted


@pytest.mark.slow
def test_the_chirps_missed_plots_interpretations_and_precision(radarsim, tmp_path):
    run = ("run", "chirp_missed", "-n", 2000, "--no-figures", "--out", tmp_path)
    radarsim(*run)
    (row,) = [one for one in (tmp_path / "chirp_missed/last.csv").read_text().splitlines() if ",up,r," in one]
    assert row.endswith(",,")  # neither an exact value nor a limit
    said = radarsim("interpretations", "chirp", "-n", 2000, "--out", tmp_path).stdout
    assert "chirp.4 confirmed                    holds in 4 of 4 interpretations" in said
    assert "chirp.5 confirmed                    holds in 2 of 2 interpretations" in said
    done = json.loads(radarsim("run", "chirp", "--precision", 3, "--no-figures", "--out", tmp_path, "--json").stdout)
    assert 2000 <= done[0]["cases"]["chirp"]["done"] <= 100_000


@pytest.mark.slow
def test_the_chirps_questions_and_recorded_plots(radarsim, tmp_path):
    ask = ("solve", "chirp", "radar.slope_hz_per_s", "--sigma", "r", "--filter", "up", "--equals", 27, "--json")
    solved = json.loads(radarsim(*ask).stdout)
    curve = ("run", "chirp", "-n", 100, "--no-figures", "--out", tmp_path, "--set")
    radarsim(*curve, f"radar.slope_hz_per_s={solved['value']!r}")
    up = [line for line in (tmp_path / "chirp/last.csv").read_text().splitlines() if line.startswith("chirp,up,r,")]
    last, limit = map(float, up[0].split(",")[-2:])
    assert last == pytest.approx(27, rel=TARGET_TOLERANCE)
    ask = ("solve", "chirp", "radar.slope_hz_per_s", "--limit", "r", "--filter", "up", "--equals", 27, "--json")
    # Long settled: as near as that, times twenty where sigma changes by over a twentieth of what the slope does.
    settled = pytest.approx(solved["value"], rel=20 * abs(limit / last - 1))
    assert json.loads(radarsim(*ask).stdout)["value"] == settled
    assert "radar.slope_hz_per_s" in radarsim("sensitivity", "chirp", "--out", tmp_path).stdout
    for arguments in (
        ("new", "own", "--like", "chirp"),
        ("check", "own.yaml"),
        ("simulate", "own.yaml", "-o", "plots.csv"),
        ("track", "own.yaml", "plots.csv", "-o", "track.csv"),
    ):
        radarsim(*arguments, cwd=tmp_path)
    assert (tmp_path / "plots.csv").read_text().startswith("t_s,z_down_m,z_up_m,z_alternating_m,z_none_m,true_r_m,")
    said = radarsim("fit", "own.yaml", "plots.csv", "--filter", "up", cwd=tmp_path).stdout
    assert "radar.sigma_range_m: " in said
    assert "chirp" in json.loads(radarsim("schema").stdout)["$defs"]
    russian = radarsim("run", "chirp", "-n", 100, "--no-figures", "--out", tmp_path, "--language", "ru").stdout
    assert "СКО ошибки дальности через" in russian


@pytest.mark.slow
def test_the_bearings_questions_and_recorded_plots(radarsim, tmp_path):
    radarsim("simulate", "bearings", "-o", "plots.csv", cwd=tmp_path)
    radarsim("track", "bearings", "plots.csv", "-o", "track.csv", cwd=tmp_path)
    header = (tmp_path / "plots.csv").read_text().splitlines()[0]
    assert header == "t_s,bearing_rad,own_x_m,own_y_m,own_vx_mps,own_vy_mps,true_r_m,true_vx_mps,true_vy_mps"
    assert len((tmp_path / "track.csv").read_text().splitlines()) == 1 + 3 * 3 * 26
    asked = ("--filter", "modified polar", "--sigma", "r", "--json", "-n", 4096)
    found = json.loads(radarsim("solve", "bearings", "observer.sigma_bearing_rad", "--equals", 400, *asked).stdout)
    assert 0.005 < found["value"] < 0.012
    precise = ("--precision", 4, "--of", "sigma", "--out", tmp_path, "--no-figures")
    radarsim("run", "bearings", "-n", 6000, *precise, code=3)
    assert "speed_mps" in radarsim("sensitivity", "bearings", "-n", 512, "--out", tmp_path).stdout


@pytest.fixture
def copied(tmp_path, warm):
    """The command beside a copy of an example, and the file to edit."""
    shutil.copytree(EXAMPLES / "chirp", tmp_path / "chirp")
    example_packages.installed(tmp_path / "chirp", tmp_path / "site")
    return example_packages.beside(warm, tmp_path / "site", tmp_path), tmp_path / "chirp/src/chirp/__init__.py"


FAULTS = {  # what is put into the file: what is said, and whether the tables are written
    "words": (
        "    def question(self, experiment):\n        return self.aks\n",
        "AttributeError: 'Chirp' object has",
        True,
    ),
    "numbers": ("    def own_gains(self, spec, one):\n        return {}[one.gain]\n", "KeyError: 'kalman'", False),
    "end": ("    def own_gains(self, spec, one):\n        raise SystemExit\n", "SystemExit", False),
}


@pytest.mark.parametrize("what", FAULTS)
def test_what_its_code_does_wrong_is_one_line_with_its_place(copied, tmp_path, what):
    command, file = copied
    text, said, written = FAULTS[what]
    before, after = file.read_text(encoding="utf-8").split("\n\nSTUDY = ")
    file.write_text(f"{before}\n{text}\n\nSTUDY = {after}", encoding="utf-8")
    run = ("run", "chirp", "-n", 100, "--no-figures", "--out", "results")
    code = 1 if written else 2  # without numbers there is nothing to show
    (line,) = command(*run, code=code).stderr.splitlines()
    place = f"/chirp/__init__.py:{before.count(chr(10)) + 3}"
    if written:
        assert line.startswith(f"the code of an installed package fails: {said}")
        assert line.endswith(f"{place})")
    else:
        assert line.startswith(f"{tmp_path}/site{place}: study chirp: Chirp.own_gains: {said}")
    assert (tmp_path / "results/chirp/curves.csv").exists() == written


def test_a_claims_fault_is_found_before_the_run_and_its_measures_after_the_tables_are_written(copied, tmp_path):
    command, file = copied
    whole = file.read_text(encoding="utf-8")
    run = ("run", "chirp", "-n", 100, "--no-figures", "--out", "results")
    file.write_text(whole.replace("{gain: {filter: up,", "{gain: {filter: upp,", 1), encoding="utf-8")
    for asked in (run, ("check", "chirp")):
        (line,) = command(*asked, code=2).stderr.splitlines()
        assert "/chirp/__init__.py:" in line
        assert ": no filter 'upp'; there are " in line
    assert not (tmp_path / "results").exists()
    measure = "def own(evidence, case):\n    return None\n\n\n"
    other = whole.replace("{gain: {filter: up, component: r}}", "own", 1).replace("\n\nSTUDY", f"\n\n{measure}STUDY")
    file.write_text(other, encoding="utf-8")
    line = command(*run, code=1).stderr.splitlines()[-1]
    assert line.endswith(": own: must give an Estimate or a number, got nothing")
    assert "confirmed" in (tmp_path / "results/chirp/claims.csv").read_text(encoding="utf-8")


def test_what_the_compiler_refuses_is_its_reason_and_the_line_that_it_names():
    from numba import njit

    @njit
    def unnamed(x):
        return x + yy  # noqa: F821

    @njit
    def untyped(x):
        return x.nothing

    said = []
    for wrong in (unnamed, untyped):
        with pytest.raises(Exception, match="nothing" if wrong is untyped else "yy") as caught:
            wrong(1.0)
        said.append(user_code_errors.error_summary(caught.value))
    assert said[0].startswith("TypingError: NameError: name 'yy' is not defined (")
    assert said[1].startswith("TypingError: Unknown attribute 'nothing' of type float64")
    line = int(said[1].rpartition(":")[2].rstrip(")"))
    assert "x.nothing" in Path(__file__).read_text(encoding="utf-8").splitlines()[line - 1]


@pytest.mark.slow
def test_what_a_package_is_told_is_of_its_own_configs_and_of_options_that_were_given(radarsim, tmp_path):
    said = radarsim("claims", "chirp", "bearings.1", "--out", tmp_path).stdout
    assert f"`radarsim run chirp --out {tmp_path}` judges chirp.1" in said
    assert f"`radarsim run bearings --out {tmp_path}` judges bearings.1" in said
    assert "is no claim of bearings; its claims: bearings.1," in radarsim("claims", "bearings.9", code=2).stderr
    for name in ("bearings", "bearings.1"):
        words = (
            f"interpretations: {name}: its study declares no choices that bearings leaves open: "
            "there are no other interpretations\n"
        )
        assert radarsim("interpretations", name, code=2).stderr == words
    ask = ("solve", "chirp", "radar.detection_probability", "--sigma", "r", "--filter", "up", "--equals", 27)
    said = radarsim(*ask, "--between", 2, 4, code=2).stderr
    assert said == "radar.detection_probability: must be <= 1, got 2\n"
    said = radarsim("sensitivity", "chirp", "--of", "limit", "--out", tmp_path).stdout
    assert "no effect  radar.detection_probability" in said  # the limit is of plots that all come; 1.1 is not asked


@pytest.mark.slow
def test_claims_and_reports_are_told_to_be_of_before_only_where_they_are_of_the_config_as_it_is(radarsim, tmp_path):
    radarsim("run", "chirp", "-n", 100, "--no-figures", "--out", tmp_path)
    table = tmp_path / "chirp/claims.csv"
    table.write_text(table.read_text().replace("confirmed", "refuted"))
    record = tmp_path / "chirp/run.json"
    facts = json.loads(record.read_text())
    facts["outputs"]["claims.csv"] = hashlib.sha256(table.read_bytes()).hexdigest()
    record.write_text(json.dumps(facts))
    interpretations = ("interpretations", "chirp.1", "-n", 100, "--no-figures", "--out", tmp_path)
    words = f"claims.csv and report.html of chirp hold older verdicts: `radarsim report chirp --out {tmp_path}`"
    assert words in " ".join(radarsim(*interpretations).stdout.split())
    facts["resolved"]["cases"][0]["radar"]["sigma_range_m"] = 51.0  # run before the config was changed
    record.write_text(json.dumps(facts))
    assert "verdicts of before" not in " ".join(radarsim(*interpretations).stdout.split())


@pytest.mark.slow
def test_a_run_says_the_verdicts_on_filters_of_python_that_a_packages_config_has(radarsim):
    lines = radarsim("run", "upf", "-n", "100", "--no-figures").stdout.splitlines()
    assert any(line.startswith("claims ") and "upf.1" in line for line in lines)

"""A study from an installed package is a full study: every command, any means of computing, an identity of its own.

The package is the one that `radarsim new-study` writes, so this proves the template too.
"""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from radarsim.kernels.cache import ROOT
from tests.program import csv_bytes
from tests.studies import example_packages

N = 10_000  # two whole blocks and a partial one


WRONG_BIAS = """\
    def axes(self, spec, sigma=None, bias=None):
        return super().axes(spec, sigma, bias + 0.02)

"""
WRONG_SUMS = """\
    def simulate(self, plan, first, count):
        sums = plan.layout.unpack(super().simulate(plan, first, count))
        sums["error"] *= 1.05 ** np.arange(1, 5)
        return plan.layout.pack(**sums)

"""
STEP_CONFIG = """
include: [fifth]
sweep:
  target.sigma_step_m: [0.1, 0.5, 2]
realisations: 2e4
"""


def new_study(warm, folder, name, *options):
    """The command beside a new package in a folder, installed in its folder `site`."""
    (folder / "site").mkdir()
    command = example_packages.beside(warm, folder / "site", folder)
    command("new-study", name, *options)
    example_packages.installed(folder / name, folder / "site")
    return command


@pytest.fixture(scope="module")
def place(tmp_path_factory, warm):
    """A folder with the package `fifth`, installed in its folder `site`."""
    folder = tmp_path_factory.mktemp("outside")
    new_study(warm, folder, "fifth")
    (folder / "fifth/src/fifth/shipped/configs/fifth_step.yaml").write_text(STEP_CONFIG)
    page = (example_packages.ROOT / "docs/howto/translate.md").read_text(encoding="utf-8")
    (folder / "fifth/src/fifth/language").mkdir()
    catalogue = page.partition("```po\n")[2].partition("```")[0]
    (folder / "fifth/src/fifth/language/ru.po").write_text(catalogue, encoding="utf-8")
    return folder


@pytest.fixture(scope="module")
def radarsim(place, warm):
    """The real command, beside the installed package."""
    return example_packages.beside(warm, place / "site", place)


@pytest.fixture(scope="module")
def ran(place):
    """The folder of results of a finished run, in an interpreter with hashes of its own."""
    words = ("run", "fifth", "-n", str(N), "--threads", "1", "--out", "results")
    path = os.pathsep.join([str(place / "site"), str(example_packages.ROOT)])
    subprocess.run(
        [sys.executable, "-m", "radarsim", *words], cwd=place, env=os.environ | {"PYTHONPATH": path}, check=True
    )
    return place / "results/fifth"


def test_it_is_listed_with_its_configs_and_filters(radarsim):
    listed = json.loads(radarsim("list", "--json").stdout)
    assert {"fifth", "fifth_step"} <= {one["name"] for one in listed["configs"]}
    assert "fifth" in {one["name"] for one in listed["studies"]}
    assert "gain" in {one["keys"] for one in listed["filters"] if one["study"] == "fifth"}


@pytest.mark.slow
def test_its_keys_are_in_schema_and_check(place, radarsim):
    schema = json.loads(radarsim("schema").stdout)
    assert {"$ref": "#/$defs/fifth"} in schema["oneOf"]
    assert {"sensor", "target", "filters"} <= schema["$defs"]["fifth"]["properties"].keys()
    assert "valid" in radarsim("check", "fifth", "fifth_step").stdout
    shutil.copy(place / "fifth/src/fifth/shipped/configs/fifth.yaml", place / "mine.yaml")
    assert "mine.yaml: valid" in radarsim("check", "mine.yaml", "--precision", 1).stdout
    fault = radarsim("check", "mine.yaml", "--set", "sensor.sigma_m=1", code=2).stderr
    assert "sensor.sigma_m: unknown key; did you mean sigma_x_m?" in fault
    fault = radarsim("check", "mine.yaml", "--set", "figures.sigma_y=[mine]", code=2).stderr
    assert "sigma_y" in fault
    assert "sigma_x" in fault


def test_a_run_leaves_tables_figures_claims_and_report(ran):
    assert {"curves.csv", "gains.csv", "last.csv", "claims.csv"} <= csv_bytes(ran).keys()
    assert {"sigma_x.svg", "gain_x.svg"} <= {file.name for file in (ran / "figures").iterdir()}
    assert "How well do filters follow a random walk?" in (ran / "report.html").read_text(encoding="utf-8")
    claim = (ran / "claims.csv").read_text(encoding="utf-8").splitlines()[1]
    assert claim.startswith("fifth.1,Kalman 1960,")
    assert "confirmed" in claim


@pytest.mark.slow_cases("--workers")
@pytest.mark.parametrize("means", [("--threads", 3), ("--workers", 2)], ids=lambda means: means[0])
def test_the_same_bytes_by_any_means(ran, radarsim, tmp_path, means):
    radarsim("run", "fifth", "-n", N, *means, "--no-figures", "--out", tmp_path)
    assert csv_bytes(tmp_path / "fifth") == csv_bytes(ran)


@pytest.mark.slow
def test_the_same_bytes_in_shares_and_continued(ran, radarsim, tmp_path):
    radarsim("run", "fifth", "-n", 5000, "--no-figures", "--out", tmp_path)
    for share in ("1/2", "2/2"):
        radarsim("run", "fifth", "-n", N, "--shard", share, "--out", tmp_path)
    radarsim("report", "fifth", "-n", N, "--no-figures", "--out", tmp_path)
    assert csv_bytes(tmp_path / "fifth") == csv_bytes(ran)


@pytest.mark.slow
def test_a_precision_ends_it(radarsim, tmp_path):
    arguments = ("--precision", 2, "--no-figures", "--out", tmp_path, "--json")
    (done,) = json.loads(radarsim("run", "fifth", *arguments).stdout)
    assert done["cases"]["fifth"]["done"] == 8000
    radarsim("run", "fifth", "-n", 4000, *arguments, code=3)


def test_its_claims_are_listed_among_all(ran, radarsim, tmp_path):
    rows = json.loads(radarsim("claims", "--json").stdout)
    (own,) = [row for row in rows if row["claim"] == "fifth.1"]
    assert (own["paper"], own["overall"], own["config"]) == (
        *("Kalman 1960", "confirmed as shipped; other interpretations not judged", "fifth"),
    )
    assert {row["claim"].partition(".")[0] for row in rows} == {"P1", "P2", "P3", "P4", "fifth"}
    assert "fifth.1" in radarsim("claims", "fifth").stdout
    assert "## fifth Kalman 1960" in radarsim("claims", "--markdown").stdout


@pytest.mark.slow
def test_it_speaks_the_language_of_its_catalogue(ran, radarsim, tmp_path):
    radarsim("run", "fifth_step", "-n", 500, "--language", "ru", "--out", tmp_path)
    page = (tmp_path / "fifth_step/report.html").read_text(encoding="utf-8")
    assert "Как фильтры следят за случайным блужданием?" in page
    assert "СКО координаты" in page  # radarsim's title, the word in the form that it asks for
    assert "Ошибка фильтра Калмана более чем на 10 % меньше" in radarsim("claims", "fifth", "--language", "ru").stdout
    assert "How well do filters follow" in (ran / "report.html").read_text(encoding="utf-8")


@pytest.mark.slow
def test_recorded_plots_and_a_config_of_ones_own(radarsim, tmp_path):
    for arguments in (
        ("new", "own", "--like", "fifth"),
        ("simulate", "own.yaml", "-o", "plots.csv"),
        ("track", "own.yaml", "plots.csv", "-o", "track.csv", "--report", "drawn"),
    ):
        radarsim(*arguments, cwd=tmp_path)
    assert "standard deviation of a measured position, m" in (tmp_path / "own.yaml").read_text(encoding="utf-8")
    assert (tmp_path / "plots.csv").read_text().startswith("t_s,x_m,true_x_m\n")
    assert len((tmp_path / "track.csv").read_text().splitlines()) == 1 + 2 * 30
    assert "sensor.sigma_x_m: " in radarsim("fit", "own.yaml", "plots.csv", cwd=tmp_path).stdout


def test_the_tab_key_completes_its_configs(radarsim, tmp_path):
    program = "from radarsim.cli.options import complete_config\n"
    program += "print(*(item.value for item in complete_config(0, 0, 'fifth_')))\n"
    (tmp_path / "tab.py").write_text(program)
    assert radarsim(module="tab", cwd=tmp_path).stdout == "fifth_step\n"


@pytest.mark.slow
def test_doctor_and_clean(radarsim, tmp_path):
    radarsim("run", "fifth", "-n", N, "--no-figures", "--out", tmp_path)
    assert "all intact" in radarsim("doctor", tmp_path / "fifth", "--recompute", 2).stdout
    assert "dropped" in radarsim("clean", "fifth", "--out", tmp_path).stdout
    assert not list((tmp_path / ".blocks").rglob("*.sums"))


@pytest.mark.slow
def test_doctor_names_the_package(radarsim):
    (own,) = [one for one in json.loads(radarsim("doctor", "--json").stdout)["self-test"] if one["study"] == "fifth"]
    assert own["words"] == "fifth 0.1.0: loads"


@pytest.mark.slow
def test_an_edit_of_a_package_begins_anew_and_an_edit_undone_finds_its_blocks(tmp_path, warm):
    command = new_study(warm, tmp_path, "edited")
    source = tmp_path / "edited/src/edited/__init__.py"
    text = source.read_text()

    def computed():
        command("run", "edited", "-n", 9000, "--no-figures", "--out", "results")
        return json.loads((tmp_path / "results/edited/run.json").read_text())["realisations_computed"]

    assert [computed(), computed()] == [9000, 0]
    source.write_text(f"# A comment.\n{text}")
    assert computed() == 9000
    source.write_text(text)
    assert computed() == 0


def test_its_own_tests_pass(place, radarsim):
    done = radarsim("-q", "-p", "no:cacheprovider", cwd=place / "fifth", module="pytest")
    assert "2 passed" in done.stdout


@pytest.fixture(scope="module")
def step_command(tmp_path_factory, warm):
    """The command in a folder with the package `step`, whose filters are steps in Python."""
    return new_study(warm, tmp_path_factory.mktemp("step"), "step", "--step")


@pytest.mark.slow
def test_the_tests_of_a_study_of_steps_pass(step_command):
    assert "2 passed" in step_command("-q", "-p", "no:cacheprovider", "step", module="pytest").stdout


@pytest.mark.slow
def test_a_study_without_a_likelihood_refuses_fit(step_command, tmp_path):
    step_command("simulate", "step", "-o", tmp_path / "plots.csv")
    for options, filters in (((), "these filters"), (("--filter", "kalman"), "kalman")):
        message = step_command("fit", "step", tmp_path / "plots.csv", *options, code=2).stderr
        reason = f"study step does not say how likely recorded plots are under {filters}, which fit needs"
        assert message == f"step: {reason}; track takes them\n"


@pytest.mark.slow
def test_kernels_of_a_package_are_compiled_once(step_command, tmp_path):
    def compilation_times() -> dict[Path, int]:
        """When each was compiled; the command runs in this process's environment, so its cache is this one's."""
        return {file: file.stat().st_mtime_ns for file in ROOT.rglob("step.*")}

    step_command("run", "step", "-n", 100, "--no-figures", "--out", tmp_path)
    compiled = compilation_times()
    assert compiled
    step_command("run", "step", "-n", 200, "--no-figures", "--out", tmp_path)
    assert compilation_times() == compiled


@pytest.mark.slow
def test_a_wrong_number_in_kernel_or_exact_value_ends_the_run_in_exit_code_4(tmp_path, warm):
    """A bias that there is not; then errors 5 % larger than computed, both in a config without claims."""
    command = new_study(warm, tmp_path, "wrong")
    run = ("run", "wrong", "-n", 100_000, "--set", "sensor.sigma_x_m=1.1", "--no-figures", "--out")

    source = tmp_path / "wrong/src/wrong/__init__.py"
    text = source.read_text(encoding="utf-8")

    def add_to_class(lines):
        above, marker, below = text.partition("    # Yours, where filters differ")
        assert marker
        source.write_text(f"{above}{lines}{marker}{below}", encoding="utf-8")

    command(*run, "right")
    add_to_class(WRONG_BIAS)
    said = command(*run, "biased", code=4).stderr
    assert said.startswith("wrong: curves.csv: wrong, ")
    assert "bias measured " in said
    assert "exactly 0.02: " in said
    assert "sigma measured" not in said
    add_to_class(WRONG_SUMS)
    said = command(*run, "longer", code=4).stderr
    assert "curves.csv: wrong, fixed, x, k = " in said
    assert "sigma measured " in said
    assert "claims" not in said
    assert (tmp_path / "longer/wrong/curves.csv").exists()
    record = json.loads((tmp_path / "longer/wrong/run.json").read_text(encoding="utf-8"))
    assert "sigma measured " in record["warnings"][0]
    assert "sigma measured " in (tmp_path / "longer/wrong/report.html").read_text(encoding="utf-8")
    told = command("report", "wrong", *run[4:], "longer", code=4).stderr
    assert told == said

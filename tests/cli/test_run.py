"""The command as a user meets it: what it prints, what it writes, how it fails."""

import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from radarsim.cli.command_group import main
from tests.program import command, csv_bytes, newcomer, record

CURVES = (
    "case,filter,component,unit,k,t_s,n,sigma,sigma_lo,sigma_hi,bias,bias_se,spread,exact_sigma,exact_bias,n_eff,"
    "believed_sigma,floor,floor_kind"
)
GAINS = "case,filter,baseline,component,k,t_s,gain_percent,gain_lo,gain_hi,exact_percent"


@pytest.fixture(scope="module")
def done(tmp_path_factory):
    """A finished run of rls2 with figures: its --out directory."""
    out = tmp_path_factory.mktemp("results")
    command("run", "rls2", "-n", "1e4", "--out", out)
    return out


def test_run_writes_what_the_contract_lists(done):
    folder = done / "rls2"
    names = {str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file()}
    drawn = {f"{kind}_{c}.svg" for kind in ("sigma", "gain") for c in ("r", "Vr", "ar")}
    assert {"run.json", "curves.csv", "gains.csv", "report.html"} | {f"figures/{name}" for name in drawn} <= names
    assert (folder / "curves.csv").read_text().split("\n", 1)[0] == CURVES
    assert (folder / "gains.csv").read_text().split("\n", 1)[0] == GAINS
    assert {path.name for path in done.iterdir()} == {"rls2", ".blocks", "index.html"}


def test_same_bytes_with_more_threads_when_extended_and_of_fewer_realisations_after_more(tmp_path):
    """Of every study and number of threads: tests/trust/test_bytes.py."""

    def ran(out, n, *more):
        command("run", "rls1", "-n", n, *more, "--no-figures", "--quiet", "--out", tmp_path / out)
        return csv_bytes(tmp_path / out / "rls1")

    few, many = ran("grown", 50_001, "--threads", 1), ran("grown", "1e5", "--threads", 2)
    assert record(tmp_path / "grown" / "rls1")["realisations_from_store"] >= 49_152
    assert ran("at once", "1e5", "--threads", 3) == many
    assert ran("at once", 50_001) == many
    assert ran("at once", 50_001, "--replace") == few
    ran("at once", 5000, "--replace")
    command("run", "range_doppler", "-n", 5000, "--no-figures", "--quiet", "--out", tmp_path / "at once")
    assert record(tmp_path / "at once" / "range_doppler")["realisations_from_store"] >= 5000


@pytest.mark.slow
def test_the_command_that_a_run_names_shows_the_claims_of_that_run(tmp_path):
    """Of any directory of results and a config of one's own, as of the shipped ones."""
    from radarsim.config import find_files

    mine, out = tmp_path / "mine.yaml", tmp_path / "my results"
    mine.write_text((find_files.SHIPPED / "configs/rls2.yaml").read_text())
    for config in ("rls2", mine):
        said = command("run", config, "-n", 300, "--out", out, "--no-figures").output
        for _ in range(2):  # the command that it names, and that which this one names
            *_, named = re.findall(r"`radarsim ([^`]+)`", "".join(said))
            said = command(*shlex.split(named)).output
            assert "confirmed" in said
            assert "not run" not in said
    assert shlex.quote(str(out)) in command("claims", "P1.1", "--out", out).output


@pytest.mark.slow
def test_the_command_that_report_names_makes_what_it_lacks(tmp_path):
    """As many realisations as the last run had, whose blocks are gone."""
    command("run", "rls2", "-n", 300, "--out", tmp_path, "--no-figures")
    shutil.rmtree(tmp_path / ".blocks")
    said = command("report", "rls2", "--out", tmp_path, code=2).stderr
    *_, named = re.findall(r"`radarsim ([^`]+)` computes", said)
    assert "-n 300" in named
    command(*shlex.split(named), "--no-figures")
    held = command("check", *shlex.split(named)[1:]).output
    assert "300 of 300 realisations stored, nothing left to compute" in held
    command("report", "rls2", "--out", tmp_path, "--no-figures")


def test_report_remakes_the_same_tables_and_computes_nothing(done):
    folder = done / "rls2"
    before = csv_bytes(folder)
    (folder / "curves.csv").unlink()
    command("report", "rls2", "-n", "1e4", "--no-figures", "--out", done)
    assert csv_bytes(folder) == before
    (folder / "gains.csv").unlink()
    command("report", "rls2", "--no-figures", "--out", done)
    assert csv_bytes(folder) == before
    result = command("report", "rls2", "-n", "1e6", "--out", done, code=2)
    assert "rls2: 8192 of 1,000,000 realisations are stored in " in result.stderr
    assert "radarsim run" in result.stderr


def test_faults_of_all_configs_come_at_once_and_nothing_runs(tmp_path):
    (tmp_path / "bad.yaml").write_text("study: range_doppler\nscans: true\nbogus: 1\n")
    (tmp_path / "worse.yaml").write_text("study: range_dopler\n")
    out = tmp_path / "out"
    result = command("run", "rls2", tmp_path / "bad.yaml", tmp_path / "worse.yaml", "--out", out, code=2)
    lines = result.stderr.splitlines()
    assert any(line.startswith(f"{tmp_path}/bad.yaml:2:8: scans: ") for line in lines)
    assert any("bogus" in line for line in lines)
    assert any("did you mean range_doppler" in line for line in lines)
    assert not out.exists()


def test_overrides_change_the_case(tmp_path):
    import pandas as pd

    out = tmp_path / "out"
    command("run", "rls2", "-n", 5000, "--seed", 5, "--set", "radar.sigma_range_m=300", "--no-figures", "--out", out)
    curves = pd.read_csv(out / "rls2" / "curves.csv")
    assert curves["exact_sigma"].iloc[0] == 300
    assert record(out / "rls2")["seed"] == 5


def test_an_unwritable_place_exits_with_4(tmp_path):
    (tmp_path / "out").write_text("a file where a folder should be")
    result = command("run", "rls2", "-n", 100, "--out", tmp_path / "out", code=4)
    assert str(tmp_path / "out") in result.stderr


@pytest.mark.parametrize("name", sorted(main.list_commands(None)))
def test_help_teaches_with_an_example(name):
    assert re.search(rf"Examples?\n( +radarsim .*\n)*? +radarsim {name}\b", command(name, "--help").stdout)


@pytest.mark.slow
def test_runs_from_anywhere_as_a_module_and_to_streams_that_know_no_greek(tmp_path):
    words = ("run", "rls2", "-n", "1000", "--no-figures")
    finished = process(*words, cwd=tmp_path, env=os.environ | {"PYTHONIOENCODING": "latin-1"})
    assert (finished.returncode, finished.stderr) == (0, b"")
    assert (tmp_path / "results" / "rls2" / "curves.csv").exists()
    assert b"\x1b" not in finished.stdout


def test_help_needs_no_heavy_import():
    heavy = ("numpy", "numba", "pandas", "pydantic", "rich")
    code = f"import sys, radarsim.cli; print([m for m in {heavy} if m in sys.modules])"
    finished = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert finished.stdout.strip() == "[]"


@pytest.mark.parametrize(("given", "threads"), [({}, "[1]"), ({"OPENBLAS_NUM_THREADS": "2"}, "2")])
def test_linear_algebra_takes_one_thread_unless_told_otherwise(given, threads):
    """A second one is slower for matrices of a few rows; other BLAS libraries than NumPy's own are left alone."""
    surroundings = {name: value for name, value in os.environ.items() if not name.endswith("_NUM_THREADS")} | given
    pools = "sorted({one['num_threads'] for one in threadpool_info() if one['internal_api'] == 'openblas'})"
    asked = "os.environ['OPENBLAS_NUM_THREADS']" if given else pools
    code = f"import os, radarsim.cli, numpy, scipy.linalg; from threadpoolctl import threadpool_info; print({asked})"
    done = subprocess.run([sys.executable, "-c", code], env=surroundings, capture_output=True, text=True, check=True)
    assert done.stdout.strip() in (threads, "[]")


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("P4.99", "claims: P4.99 is no claim of P4; its claims: {all}"),
        ("P99", "claims: P99 is no claim and no paper; papers: P1, P2, P3, P4"),
        ("p4.5", "claims: p4.5 is no claim and no paper; did you mean P4.5?"),
        ("P4.5,P4.6", "claims: P4.5,P4.6 is no claim of P4; its claims: {all}"),
    ],
)
def test_what_is_written_like_a_claim_and_is_none_is_told_which_there_are(name, said):
    from radarsim.errors import ConfigError
    from radarsim.papers.list_claims import claims

    with pytest.raises(ConfigError) as caught:
        claims(name, out="nowhere")
    every = [row["claim"] for row in claims(name.partition(".")[0], out="nowhere").rows] if "{all}" in said else []
    assert list(caught.value.lines) == [said.format(all=", ".join(every))]


@pytest.mark.slow
def test_claims_are_shown_by_name_by_paper_and_beside_those_of_a_config(tmp_path):
    from radarsim.papers.list_claims import claims

    def named(*names):
        return [row["claim"] for row in claims(*names, out=tmp_path).rows]

    everything = named()
    assert named("P1.3") == ["P1.3"]
    assert named("P4.2", "P1.3", "P1.3") == ["P1.3", "P4.2"]
    assert named("P4") == [claim for claim in everything if claim.startswith("P4.")]
    assert named("P1.3", "range_doppler") == named("range_doppler")
    assert named("rls2", "P4.2") == [*named("rls2"), "P4.2"]
    command("run", "discriminator_paper", "-n", 64, "--no-figures", "--out", tmp_path)
    own = claims("P4.2", out=tmp_path).rows
    assert own
    assert list(own) == [row for row in claims("discriminator_paper", out=tmp_path).rows if row["claim"] == "P4.2"]
    assert "P4.2" in command("claims", "P4.2", "--out", tmp_path).stdout


def test_the_command_that_computes_what_is_missing_is_whole(tmp_path):
    arguments = ("rls3", "-n", 500, "--seed", 4, "--set", "radar.sigma_range_m=300", "--out", tmp_path)
    result = command("report", *arguments, code=2)
    assert f"radarsim run rls3 --set radar.sigma_range_m=300 -n 500 --seed 4 --out {tmp_path}`" in result.stderr


def test_a_spoiled_table_of_claims_is_told(tmp_path):
    (tmp_path / "rls2").mkdir()
    (tmp_path / "rls2" / "claims.csv").write_text("garbage\n")
    assert "no run.json beside it names it" in command("claims", "rls2", "--out", tmp_path, code=4).stderr


def process(*arguments, **options):
    """The console script in a process of its own."""
    return subprocess.run([sys.executable, "-m", "radarsim", *arguments], capture_output=True, check=False, **options)


def test_output_that_cannot_be_written_and_output_that_nobody_reads(tmp_path):
    """More states of the streams: tests/cli/test_environments.py."""
    shell, options = f"{sys.executable} -m radarsim list", {"capture_output": True, "env": newcomer(tmp_path)}
    full = subprocess.run(f"{shell} > /dev/full", shell=True, check=False, **options)
    assert (full.returncode, full.stderr) == (4, b"output: cannot be written: No space left on device\n")
    closed = subprocess.run(f"{shell} >&-", shell=True, check=False, **options)
    assert (closed.returncode, closed.stderr) == (0, b"")
    piped = subprocess.run(["bash", "-c", f"{shell} | head -1; exit ${{PIPESTATUS[0]}}"], check=False, **options)
    assert (piped.returncode, piped.stderr) == (0, b"")


@pytest.mark.parametrize("variables", [{}, {"PYTHONUNBUFFERED": "1"}], ids=["buffered", "unbuffered"])
def test_errors_that_cannot_be_written_leave_the_exit_code(tmp_path, variables):
    shell = f"{sys.executable} -m radarsim check nope 2> /dev/full"
    assert subprocess.run(shell, shell=True, check=False, env=newcomer(tmp_path, **variables)).returncode == 2


@pytest.mark.slow
def test_a_path_that_is_no_text(tmp_path):
    folder = os.fsencode(tmp_path) + b"/d\xe9"
    os.mkdir(folder)
    with open(folder + b"/rls2.yaml", "wb") as file:
        file.write(Path("configs/rls2.yaml").read_bytes())
    finished = process("run", folder + b"/rls2.yaml", "-n", "100", "--no-figures", "--quiet", "--out", str(tmp_path))
    assert (finished.returncode, finished.stderr) == (0, b"")

"""The recipes of docs/scale.md, run as they stand: processes of this machine stand in for hosts."""

import json
import os
import socket
import subprocess
import sys
from pathlib import Path

import pytest

from tests.program import csv_bytes

ROOT = Path(__file__).parents[2]
RECIPES = ROOT / "docs" / "recipes"
N = 50_001
HOST = '#!/bin/sh\nshift\nexec sh -c "$*"\n'  # ssh's stand-in: leaves out the name of the host


@pytest.fixture(scope="module")
def expected(tmp_path_factory):
    """The tables of a plain run."""
    out = tmp_path_factory.mktemp("plain")
    run(["radarsim", "run", "rls2", "-n", str(N), "--no-figures", "--quiet", "--out", str(out)], out)
    return csv_bytes(out / "rls2")


def environment(place, **more):
    """Surroundings in which `radarsim`, `dask` and the stand-in for ssh are found."""
    (place / "host").write_text(HOST)
    (place / "host").chmod(0o755)
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    return os.environ | {"PATH": path, "RSH": str(place / "host"), "CONFIG": "rls2", "N": str(N), "OUT": "out"} | more


def run(program, place, code=0, **more):
    """Run a program in a folder of its own; what it said."""
    done = subprocess.run(
        program, cwd=place, env=environment(place, **more), capture_output=True, text=True, check=False, timeout=300
    )
    assert done.returncode == code, done.stderr
    return done.stdout


def computed(place):
    """How many realisations the last run in a folder computed itself."""
    return json.loads((place / "out" / "rls2" / "run.json").read_text())["realisations_computed"]


@pytest.mark.slow
def test_three_machines_by_ssh(tmp_path, expected):
    run(["sh", RECIPES / "ssh.sh"], tmp_path, HOSTS="a b c")
    assert csv_bytes(tmp_path / "out" / "rls2") == expected
    assert computed(tmp_path) == 0
    assert len(list(tmp_path.glob("radarsim-share-*"))) == 3


@pytest.mark.slow
def test_one_machine_until_a_precision(tmp_path):
    run(["sh", RECIPES / "one_machine.sh"], tmp_path, N="1e6", PRECISION="1", LIMIT="120")
    record = json.loads((tmp_path / "out" / "rls2" / "run.json").read_text())
    assert (record["realisations_done"], record["stop"]) == (32_000, "done")
    run(["sh", RECIPES / "one_machine.sh"], tmp_path, code=3, N="4000", PRECISION="0.1")


@pytest.mark.slow
def test_a_slurm_array_on_a_shared_file_system(tmp_path, expected):
    tasks = [
        subprocess.Popen(
            ["sh", RECIPES / "slurm_array.sh"],
            cwd=tmp_path,
            env=environment(tmp_path, SLURM_ARRAY_TASK_ID=str(task), SLURM_ARRAY_TASK_COUNT="4"),
        )
        for task in range(1, 5)
    ]
    assert [task.wait(timeout=300) for task in tasks] == [0] * 4
    run(["radarsim", "run", "rls2", "-n", str(N), "--no-figures", "--quiet", "--out", "out"], tmp_path)
    assert csv_bytes(tmp_path / "out" / "rls2") == expected
    assert computed(tmp_path) == 0


@pytest.mark.slow
def test_a_slurm_task_whose_time_is_over_is_queued_anew(tmp_path):
    (tmp_path / "scontrol").write_text('#!/bin/sh\necho "$@" > queued\n')
    (tmp_path / "scontrol").chmod(0o755)
    slurm = {"SLURM_ARRAY_TASK_ID": "2", "SLURM_ARRAY_TASK_COUNT": "4", "SLURM_ARRAY_JOB_ID": "7", "N": "1e10"}
    surroundings = environment(tmp_path, **slurm)
    surroundings["PATH"] = f"{tmp_path}{os.pathsep}{surroundings['PATH']}"
    task = subprocess.Popen(["sh", RECIPES / "slurm_array.sh"], cwd=tmp_path, env=surroundings)
    while not list(tmp_path.rglob("L*.sums")):
        assert task.poll() is None
    task.terminate()
    assert task.wait(timeout=10) == 143
    assert (tmp_path / "queued").read_text() == "requeue 7_2\n"


@pytest.mark.slow
def test_a_dask_cluster(tmp_path, expected):
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    places = {"SCHEDULER": f"127.0.0.1:{port}", "HOSTS": "a b", "WORKERS": "1"}
    run(["sh", RECIPES / "dask.sh"], tmp_path, **places)
    assert csv_bytes(tmp_path / "out" / "rls2") == expected


def test_every_recipe_is_run_here_and_told_of():
    tested, told = Path(__file__).read_text(), (ROOT / "docs" / "scale.md").read_text()
    for recipe in RECIPES.iterdir():
        assert f'"{recipe.name}"' in tested, recipe
        assert f"recipes/{recipe.name}" in told, recipe

"""The same CSV bytes for every study however they are come by: threads, workers, shares, order, kills.

Cases are as small as has several blocks of each study. The long proof is `slow`; the ordinary suite takes one of each.
"""

import os
import random
import shutil
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from radarsim import experiment
from radarsim.config.load import load
from radarsim.engine.cluster import Cluster
from radarsim.report.tables import to_csv
from radarsim.selftest import KNOWN
from tests.engine.test_engine_collect import Shuffled
from tests.test_cli import csv_bytes

ROOT = Path(__file__).parents[2]
pytestmark = pytest.mark.filterwarnings("ignore")  # Dask's own
REALISATIONS = {"range_doppler": 70_001, "multimodel": 777, "sonar": 20_001, "discriminator": 333}
LONGER = {"range_doppler": 20_000_001, "multimodel": 30_001, "sonar": 60_001, "discriminator": 6_001}  # some seconds


def options(study):
    """The experiment, some seconds of it, as the command takes them."""
    return [str(KNOWN / f"{study}.yaml"), "-n", str(LONGER[study]), "--no-figures", "--quiet"]


def tables(study, **means):
    """The bytes of all tables of a run in this process, by name."""
    loaded = load(KNOWN / f"{study}.yaml", [f"realisations={REALISATIONS[study]}"])
    return {name: to_csv(table) for name, table in experiment.run(loaded, **means).tables.items()}


def command(study, out):
    """The command in a process of its own; its exit code."""
    program = [sys.executable, "-m", "radarsim", "run", *options(study), "--out", str(out)]
    return subprocess.run(program, cwd=ROOT, capture_output=True, check=False).returncode


@pytest.fixture(scope="module")
def expected():
    """The bytes of each study, from one thread, made when first asked for."""
    made = {}

    def of(study):
        if study not in made:
            made[study] = tables(study, threads=1)
        return made[study]

    return of


@pytest.mark.parametrize("study", REALISATIONS)
def test_threads_and_order(expected, study):
    assert tables(study, threads=3) == expected(study)
    assert tables(study, executor=Shuffled(1)) == expected(study)


@pytest.mark.slow
@pytest.mark.parametrize("study", REALISATIONS)
@pytest.mark.parametrize("threads", [1, 2, 3, 4])
def test_five_repeats_of_any_number_of_threads(expected, study, threads):
    for _ in range(5):
        assert tables(study, threads=threads) == expected(study)


@pytest.mark.slow
@pytest.mark.parametrize("study", REALISATIONS)
def test_twenty_orders_of_the_blocks(expected, study):
    for seed in range(20):
        assert tables(study, executor=Shuffled(seed)) == expected(study)


@pytest.mark.slow
@pytest.mark.parametrize("workers", [1, 2, 4])
def test_workers(expected, workers):
    with Cluster(workers) as pool:
        for study in REALISATIONS:
            assert tables(study, executor=pool) == expected(study)


@pytest.mark.slow
@pytest.mark.parametrize("study", REALISATIONS)
@pytest.mark.parametrize("of", [1, 3, 7])
def test_shares(expected, study, of, tmp_path):
    loaded = load(KNOWN / f"{study}.yaml", [f"realisations={REALISATIONS[study]}"])
    for number in random.Random(of).sample(range(1, of + 1), of):
        experiment.share(loaded, number, of, out=tmp_path / str(number), threads=2)
        shutil.copytree(tmp_path / str(number), tmp_path / "all", dirs_exist_ok=True)
    result = experiment.run(loaded, out=tmp_path / "all", figures=False)
    assert result.facts["realisations_computed"] == 0
    assert {name: to_csv(table) for name, table in result.tables.items()} == expected(study)


def killed(study, out, after_s):
    """Start the command and kill it; its exit status."""
    program = [sys.executable, "-m", "radarsim", "run", *options(study), "--out", str(out)]
    with subprocess.Popen(program, cwd=ROOT, stderr=subprocess.DEVNULL, stdout=subprocess.DEVNULL) as process:
        time.sleep(after_s)
        process.kill()
        return process.wait(timeout=30)


def duration(study, out):
    """Seconds that an undisturbed run of the command takes."""
    since = time.perf_counter()
    assert command(study, out) == 0
    return time.perf_counter() - since


@pytest.mark.slow
@pytest.mark.parametrize("study", REALISATIONS)
def test_twenty_kills_of_the_run(study, tmp_path):
    """At moments spread over all that a run does, its start and the writing of its tables too; every one on the store
    and the results that the last one left."""
    duration(study, tmp_path / "compiled")
    whole = duration(study, tmp_path / "whole")
    draw = random.Random(study)
    interrupted = 0
    for _ in range(20):
        status = killed(study, tmp_path / "killed", draw.uniform(0.3, 1.0) * whole)
        interrupted += status == -signal.SIGKILL
    assert interrupted >= 5
    assert command(study, tmp_path / "killed") == 0
    assert csv_bytes(tmp_path / "killed" / study) == csv_bytes(tmp_path / "whole" / study)


@pytest.mark.slow
@pytest.mark.parametrize("study", REALISATIONS)
def test_six_kills_of_workers(expected, study):
    with Cluster(2) as pool:
        ended, killed_workers = threading.Event(), []

        def kill():
            draw = random.Random(study)
            while len(killed_workers) < 6 and not ended.wait(draw.uniform(0.2, 0.8)):
                process = draw.choice(pool._own._running)
                os.kill(process.pid, signal.SIGKILL)
                killed_workers.append(process.pid)

        killer = threading.Thread(target=kill)
        killer.start()
        rounds = 0
        while len(killed_workers) < 6:
            assert tables(study, executor=pool) == expected(study)
            rounds += 1
        killer.join()
        assert tables(study, executor=pool) == expected(study)
        assert rounds < 100

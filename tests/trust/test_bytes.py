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

from radarsim.api import run
from radarsim.engine.cluster import Cluster
from radarsim.report.csv_text import to_csv
from tests.engine.test_collect import Shuffled
from tests.program import csv_bytes
from tests.trust.cases import CASES, MORE

ROOT = Path(__file__).parents[2]
pytestmark = pytest.mark.filterwarnings("ignore")  # Dask's own
every_study = pytest.mark.parametrize("study", CASES)


def tables(study, realisations=None, **means):
    """The bytes of all tables of a run in this process, by name."""
    result = run.run((CASES | MORE)[study].loaded(realisations), **means)
    return {name: to_csv(table) for name, table in result.tables.items()}


def program(study, out):
    """The command that runs some seconds of a study."""
    return [sys.executable, "-m", "radarsim", "run", *CASES[study].options(), "--out", str(out)]


@pytest.fixture(scope="module")
def expected():
    """The bytes of each study, from one thread, made when first asked for."""
    made = {}

    def of(study):
        if study not in made:
            made[study] = tables(study, threads=1)
        return made[study]

    return of


@pytest.mark.slow_cases("sonar_manoeuvre", "sonar_clutter", "rare_ends", "missed_plots", "rare_losses")
@pytest.mark.parametrize("study", CASES | MORE)
def test_threads_and_order(study):
    """In the order in which threads end, and in one that none would take."""
    assert tables(study, threads=3) == tables(study, executor=Shuffled(1))


@pytest.mark.slow
@every_study
@pytest.mark.parametrize("threads", [1, 2, 3, 4])
def test_five_repeats_of_any_number_of_threads(expected, study, threads):
    for _ in range(5):
        assert tables(study, threads=threads) == expected(study)


@pytest.mark.slow
@every_study
def test_twenty_orders_of_the_blocks(expected, study):
    for seed in range(20):
        assert tables(study, executor=Shuffled(seed)) == expected(study)


@pytest.mark.slow
@pytest.mark.parametrize("workers", [1, 2, 4])
def test_workers(expected, workers):
    with Cluster(workers) as pool:
        for study in CASES:
            assert tables(study, executor=pool) == expected(study)


@pytest.mark.slow
@every_study
@pytest.mark.parametrize("of", [1, 3, 7])
def test_shares(expected, study, of, tmp_path):
    loaded = CASES[study].loaded()
    for number in random.Random(of).sample(range(1, of + 1), of):
        run.run_share(loaded, (number, of), out=tmp_path / str(number), threads=2)
        shutil.copytree(tmp_path / str(number), tmp_path / "all", dirs_exist_ok=True)
    result = run.run(loaded, out=tmp_path / "all", figures=False)
    assert result.facts["realisations_computed"] == 0
    assert {name: to_csv(table) for name, table in result.tables.items()} == expected(study)


def killed(study, out, after_s=None):
    """The command's exit status, when it was killed after so many seconds."""
    with subprocess.Popen(program(study, out), cwd=ROOT, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL) as process:
        try:
            _, said = process.communicate(timeout=after_s)
        except subprocess.TimeoutExpired:
            process.kill()
            _, said = process.communicate()
    assert b"Traceback" not in said
    return process.returncode


@pytest.mark.slow
@every_study
def test_twenty_kills_of_the_run(study, tmp_path):
    """At moments spread over all that a run does, its start and the writing of its tables too; every one on the store
    and the results that the last one left. One that ended before its kill is compared, and the next starts again."""
    assert killed(study, tmp_path / "compiled") == 0
    since = time.perf_counter()
    assert killed(study, tmp_path / "whole") == 0
    whole_s, draw, kills = time.perf_counter() - since, random.Random(study), 0
    expected = csv_bytes(tmp_path / "whole" / study)
    while kills < 20:
        status = killed(study, tmp_path / "killed", draw.uniform(0.3, 1.0) * whole_s)
        assert status in (0, -signal.SIGKILL)
        kills += status != 0
        if status == 0:
            assert csv_bytes(tmp_path / "killed" / study) == expected
            shutil.rmtree(tmp_path / "killed")
    assert killed(study, tmp_path / "killed") == 0
    assert csv_bytes(tmp_path / "killed" / study) == expected


@pytest.mark.slow
@every_study
def test_six_kills_of_workers(study):
    """Of those that live, while they compute."""
    longer = CASES[study].longer
    expected = tables(study, longer, threads=1)
    with Cluster(2) as pool:
        ended, kills = threading.Event(), []

        def kill():
            draw = random.Random(study)
            while len(kills) < 6 and not ended.wait(draw.uniform(0.2, 0.8)):
                living = [process for process in pool._own._running if process.poll() is None]
                if living:
                    kills.append(draw.choice(living))
                    os.kill(kills[-1].pid, signal.SIGKILL)

        killer = threading.Thread(target=kill)
        killer.start()
        try:
            while len(kills) < 6:
                assert tables(study, longer, executor=pool) == expected
        finally:
            ended.set()
            killer.join()
        assert tables(study, longer, executor=pool) == expected
    assert len({process.pid for process in kills}) == 6

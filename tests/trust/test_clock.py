"""A clock that is set back or forward under a run: nothing waits for it, nothing is thrown away by it."""

import json
import shutil
import subprocess
import sys
from datetime import UTC, datetime

import pytest

import radarsim
from radarsim.report.csv_text import to_csv
from tests.forked_programs import Start

# The time of day, as every call of the C library tells it, moved by STEP_S seconds once the file STEP_ONCE is there.
SHIM = r"""
#define _GNU_SOURCE
#include <dlfcn.h>
#include <stdlib.h>
#include <sys/time.h>
#include <time.h>
#include <unistd.h>

static long step(void) {
    static int moved = 0;
    const char *once = getenv("STEP_ONCE");
    moved = moved || (once && access(once, F_OK) == 0);
    return moved ? atol(getenv("STEP_S")) : 0;
}

int clock_gettime(clockid_t clock, struct timespec *to) {
    static int (*real)(clockid_t, struct timespec *);
    if (!real) real = dlsym(RTLD_NEXT, "clock_gettime");
    int code = real(clock, to);
    if (clock == CLOCK_REALTIME || clock == CLOCK_REALTIME_COARSE) to->tv_sec += step();
    return code;
}

time_t time(time_t *to) {
    struct timespec now;
    clock_gettime(CLOCK_REALTIME, &now);
    if (to) *to = now.tv_sec;
    return now.tv_sec;
}

int gettimeofday(struct timeval *to, void *zone) {
    struct timespec now;
    clock_gettime(CLOCK_REALTIME, &now);
    to->tv_sec = now.tv_sec;
    to->tv_usec = now.tv_nsec / 1000;
    return 0;
}
"""
YEAR_S = 366 * 86400
TEN_DAYS_S = 10 * 86400


@pytest.fixture(scope="module")
def shim(tmp_path_factory):
    """The library that moves the clock of a process that loads it first."""
    if not sys.platform.startswith("linux") or not (compiler := shutil.which("cc")):
        pytest.skip("needs Linux and a C compiler")
    place = tmp_path_factory.mktemp("clock")
    (place / "shim.c").write_text(SHIM)
    command = [compiler, "-shared", "-fPIC", "-o", place / "shim.so", place / "shim.c", "-ldl"]
    subprocess.run(command, check=True)
    return place / "shim.so"


@pytest.fixture(scope="module")
def run(shim, tmp_path_factory):
    """Runs of the command whose clock steps, in all their processes, when the folder of their blocks appears."""

    def stepping(out, step_s, *more):
        step = {"STEP_S": str(step_s), "STEP_ONCE": str(out / ".blocks")}
        return start.run("run", "rls2", "--no-figures", "--out", out, *more, **step)

    with Start(tmp_path_factory.mktemp("printed"), LD_PRELOAD=str(shim)) as start:
        yield stepping


@pytest.fixture(scope="module")
def untouched():
    """The table of the same run with the clock left alone."""
    return to_csv(radarsim.run("rls2", realisations=300_000).tables["curves"])


@pytest.mark.slow
@pytest.mark.parametrize("step_s", [-YEAR_S, *(pytest.param(s, marks=pytest.mark.slow) for s in (-3600, YEAR_S))])
def test_a_run_and_its_continuation(run, untouched, tmp_path, step_s):
    """A step while it runs, and files of the future when it goes on: the same bytes, nothing computed twice."""
    first = run(tmp_path, step_s, "-n", 150_000)
    assert (first.returncode, first.stderr) == (0, "")
    second = run(tmp_path, -step_s, "-n", 300_000)
    assert (second.returncode, second.stderr) == (0, "")
    assert (tmp_path / "rls2/curves.csv").read_bytes() == untouched
    facts = json.loads((tmp_path / "rls2/run.json").read_text())
    ended = datetime.fromisoformat(facts["finished"]) - datetime.now(UTC)
    assert ended.total_seconds() == pytest.approx(-step_s, abs=600)  # so the clock did step
    assert facts["realisations_from_store"] >= 131_072  # whole nodes; what is left of a cut one is computed again


@pytest.mark.slow
def test_a_time_limit_is_not_of_the_day(run, tmp_path):
    """A clock set forward by ten days reaches no limit; one set back does not stretch it."""
    done = run(tmp_path / "forward", TEN_DAYS_S, "-n", 20_000, "--time-limit", 250)
    assert (done.returncode, done.stderr) == (0, "")
    done = run(tmp_path / "back", -TEN_DAYS_S, "-n", "1e10", "--time-limit", 1, "--threads", 1)
    assert done.returncode == 3, done.stderr
    assert "time limit of 1 s" in done.stderr


@pytest.mark.slow
def test_workers(run, untouched, tmp_path):
    """Dask would send messages an hour late after a step back: the run ends, and goes on when it is asked again."""
    pytest.importorskip("distributed")
    done = run(tmp_path, -3600, "-n", "1e9", "--workers", 1)
    assert done.returncode == 3, done.stderr
    assert "its clock was set back by 3600 s" in done.stderr
    for out, step_s in ((tmp_path, 0), (tmp_path / "forward", TEN_DAYS_S)):
        done = run(out, step_s, "-n", 300_000, "--workers", 1)
        assert done.returncode == 0, done.stderr
        assert (out / "rls2/curves.csv").read_bytes() == untouched

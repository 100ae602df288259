"""Installed on a disk that is read-only; other versions of packages and of Python: `make versions`."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
pytestmark = pytest.mark.slow

READ_ONLY = (
    'mount --make-rprivate / && mount -t tmpfs none "$0" && mkdir "$0/out" && '
    'mount -o remount,ro,bind / && if [ "$1" = full ]; then mount -o remount,ro "$0"; fi && shift && exec "$@"'
)


def test_a_disk_that_is_read_only_but_for_the_results(tmp_path):
    """As in a container: no cache of kernels, no home, no temporary directory; one line says so, and nothing fails."""
    python, results = sys.executable, tmp_path / "results"
    results.mkdir()

    def within(*arguments, state="free"):
        unshared = ["unshare", "-m", "sh", "-c", READ_ONLY, str(results), state]
        nowhere = {"HOME": "/nowhere", "TMPDIR": "/nowhere", "RADARSIM_CACHE_DIR": "/nowhere", "PYTHONPATH": str(ROOT)}
        command = [*unshared, python, "-m", "radarsim", *map(str, arguments)]
        return subprocess.run(
            command, cwd=tmp_path, env=os.environ | nowhere, capture_output=True, text=True, check=False
        )

    if shutil.which("unshare") is None or within("--help").returncode != 0:
        pytest.skip("no file systems of one's own here")
    options = ("rls2", "-n", 2000, "--no-figures", "--out", results / "out")
    done = within("run", *options)
    assert done.returncode == 0, done.stderr
    (line,) = done.stderr.splitlines()
    assert re.match("warning: kernel cache: .*cannot be written.*each run compiles again", line)
    assert str(results / "out") in done.stdout
    refused = within("run", *options, state="full")
    assert refused.returncode == 4
    assert re.fullmatch(rf"{results}.*: cannot be written: Read-only file system\n", refused.stderr)
    followed = within("track", "rls2", ROOT / "docs/examples/range_doppler.csv", state="full")
    assert followed.returncode == 0
    assert followed.stdout.startswith("t_s,filter,component,unit,estimate,sigma\n")

"""CPU seconds that compiling takes from an empty cache: each study's kernels, over all its shipped configs.

    python benchmarks/compiling.py [STUDY …]

A fresh process and an empty cache for each study; the kernels are listed in the order of their time. Simulation, which
is a block of eight realisations of each case, is left out.
"""

import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

CONFIGS = Path(__file__).resolve().parent.parent / "configs"
LISTED = 5


def compiled(names: list[str]) -> dict[str, float]:
    """CPU seconds by kernel that is called from Python, of all cases of these configs."""
    from numba.core import event

    from radarsim.api.case_work import CaseWork
    from radarsim.api.configs import load

    found: dict[str, float] = {}

    class Clock(event.Listener):
        depth, started = 0, 0.0

        def on_start(self, event):
            if self.depth == 0:
                self.started = time.process_time()
            self.depth += 1

        def on_end(self, event):
            self.depth -= 1
            if self.depth == 0:
                kernel = event.data["dispatcher"].py_func
                name = f"{kernel.__module__.removeprefix('radarsim.')}.{kernel.__name__}"
                found[name] = found.get(name, 0.0) + time.process_time() - self.started

    event.register("numba:compile", Clock())
    for name in names:
        for case in load(name).cases:
            CaseWork(case).simulate(0, 8)
    return found


def studies() -> dict[str, list[str]]:
    """The shipped configs of each study."""
    from radarsim.api.configs import load

    out: dict[str, list[str]] = {}
    for path in sorted(CONFIGS.glob("*.yaml")):
        out.setdefault(load(path.stem).cases[0].study, []).append(path.stem)
    return out


def main() -> None:
    """Measure each study in a process of its own."""
    if sys.argv[1:2] == ["--part"]:
        print(json.dumps(compiled(sys.argv[2:])))
        return
    for study, names in studies().items():
        if sys.argv[1:] and study not in sys.argv[1:]:
            continue
        with tempfile.TemporaryDirectory() as empty:
            command = [sys.executable, __file__, "--part", *names]
            done = subprocess.run(
                command, stdout=subprocess.PIPE, check=True, env=os.environ | {"RADARSIM_CACHE_DIR": empty}
            )
        found = sorted(json.loads(done.stdout).items(), key=lambda item: -item[1])
        listed = ", ".join(f"{name} {seconds:.1f}" for name, seconds in found[:LISTED])
        print(f"{study:18s} {sum(seconds for _, seconds in found):5.1f} s of CPU: {listed}", flush=True)


if __name__ == "__main__":
    main()

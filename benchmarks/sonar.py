"""P3's kernels against P1's in the same run: nanoseconds a filter, coordinate and scan, noise and sums included.

    python benchmarks/sonar.py [-n 4e5] [--processes 5]

P1: RLS 2, two filters of one coordinate. P3: a line (growing memory), a parabola, an augmented filter, two coordinates,
every plot there (gains shared by all realisations), then with plots missed at random (gains of each realisation's own).
Each figure is the median over fresh processes of medians over pairs timed one after the other, CPU time of one thread.
"""

import argparse
import json
import os
import statistics
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor

PAIRS = 7
SONAR = {
    "study": "sonar",
    "sensor": {"sigma_range_m": 30, "sigma_bearing_deg": 1, "scan_period_s": 5, "error_correlation": 0.6},
    "target": "sonar_straight",
    "filters": [
        {"name": "line", "kind": "growing_memory", "degree": 1},
        {"name": "parabola", "kind": "growing_memory", "degree": 2},
        {"name": "augmented", "kind": "kalman_augmented", "degree": 1},
    ],
    "scans": 20,
    "realisations": 1,
}


def work(config, coordinates: int, **sensor):
    """A case as the engine sees it, and its filter-scans a realisation, in each of so many coordinates."""
    from radarsim.api.case_work import CaseWork
    from radarsim.api.configs import load

    if sensor:
        config = config | {"sensor": config["sensor"] | sensor}
    made = CaseWork(load(config).cases[0])
    axes = made.plan.axes
    return made, len(axes.filters) * len(axes.k) * coordinates


def nanoseconds(made, steps: int, n: int) -> float:
    """CPU time a filter-scan of all blocks in the calling thread."""
    started = time.process_time()
    for first in range(0, n, made.block):
        made.simulate(first, min(made.block, n - first))
    return (time.process_time() - started) / n / steps * 1e9


def measure(n: int) -> dict:
    """Medians of one process."""
    p1 = work("rls2", 1)
    others = {"shared": work(SONAR, 2), "own": work(SONAR, 2, detection_probability=0.9)}
    out = {}
    os.sched_setaffinity(0, sorted(os.sched_getaffinity(0))[-1:])
    for name, other in others.items():
        pairs = []
        for made, steps in (p1, other):
            nanoseconds(made, steps, made.block)
        for _ in range(PAIRS):
            pairs.append((nanoseconds(*other, n), nanoseconds(*p1, n)))
        out[f"{name}_ns"] = statistics.median(one for one, _ in pairs)
        out[f"{name}_to_p1"] = statistics.median(one / two for one, two in pairs)
        out["p1_ns"] = statistics.median(two for _, two in pairs)
    return out


def main():
    """Parse, run the processes, print their medians."""
    parser = argparse.ArgumentParser()
    parser.add_argument("-n", type=float, default=4e5)
    parser.add_argument("--processes", type=int, default=5)
    parser.add_argument("--part", action="store_true")
    given = parser.parse_args()
    if given.part:
        with ThreadPoolExecutor(1) as pool:
            print(json.dumps(pool.submit(measure, int(given.n)).result()))
        return
    command = [sys.executable, __file__, "--part", "-n", str(given.n)]
    made = [json.loads(subprocess.run(command, capture_output=True, check=True).stdout) for _ in range(given.processes)]
    print(json.dumps({key: round(statistics.median(one[key] for one in made), 3) for key in made[0]}))


if __name__ == "__main__":
    main()

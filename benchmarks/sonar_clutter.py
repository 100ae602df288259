"""Tracks among false plots: track-scans a second of one core, noise, gates, association and sums included.

    python benchmarks/sonar_clutter.py [-n 2e4] [--processes 3]

A track-scan is one scan of one track: of the target's (every realisation, every scan) and of those that false plots
begin, as many as there were. CPU time of a pool thread, pinned to one core; least of the rounds of each process, median
over fresh processes. Densities are chosen for about two false plots in the gate of PDA.
"""

import argparse
import json
import os
import statistics
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor

ROUNDS = 3
CASES = {"nearest": ("nearest", 7.0), "pda": ("pda", 3.0), "pda, no false plots": ("pda", 0.0)}
SCANS = 40


def config(association: str, density: float) -> dict:
    """The case of sonar_clutter with one tracker."""
    return {
        "study": "sonar",
        "sensor": {
            **{"sigma_range_m": 30, "sigma_bearing_deg": 1, "scan_period_s": 5, "detection_probability": 0.9},
            **{"false_plots_per_km2": density, "sector": {"range_m": [2e3, 15e3], "bearing_deg": [-40, 80]}},
        },
        "target": "sonar_straight",
        "filters": [{"name": "one", "kind": "kalman", "association": association, "manoeuvre_variance": 1e-4}],
        "scans": SCANS,
        "realisations": 1,
    }


def measure(n: int) -> dict:
    """Figures of one process."""
    from radarsim.api.case_work import CaseWork
    from radarsim.api.configs import load
    from radarsim.studies.sonar.clutter.kernels.track_sums import FALSE_CONFIRMED, FALSE_IN_GATE_COUNT, GATE_COUNT

    os.sched_setaffinity(0, sorted(os.sched_getaffinity(0))[-1:])
    out = {}
    for name, of in CASES.items():
        work = CaseWork(load(config(*of)).cases[0])
        work.simulate(0, work.block)
        best, n = float("inf"), n - n % work.block
        for _ in range(ROUNDS):
            started = time.thread_time()
            sums = sum(work.simulate(first, work.block) for first in range(0, n, work.block))
            best = min(best, time.thread_time() - started)
        found = work.plan.layout.unpack(sums)
        false = found["begun"][0, :, : FALSE_CONFIRMED + 1].sum()
        out[name] = {
            "million_track_scans_per_s": (n * SCANS + false) / best / 1e6,
            "of_the_target_alone": n * SCANS / best / 1e6,
            "false_in_gate": found["counts"][0, :, FALSE_IN_GATE_COUNT].sum() / found["counts"][0, :, GATE_COUNT].sum(),
        }
    return out


def main():
    """Parse, run the processes, print their medians."""
    parser = argparse.ArgumentParser()
    parser.add_argument("-n", type=float, default=2e4)
    parser.add_argument("--processes", type=int, default=3)
    parser.add_argument("--part", action="store_true")
    given = parser.parse_args()
    if given.part:
        with ThreadPoolExecutor(1) as pool:
            print(json.dumps(pool.submit(measure, int(given.n)).result()))
        return
    command = [sys.executable, __file__, "--part", "-n", str(given.n)]
    made = [json.loads(subprocess.run(command, capture_output=True, check=True).stdout) for _ in range(given.processes)]
    for name in made[0]:
        print(name, {key: round(statistics.median(one[name][key] for one in made), 3) for key in made[0][name]})


if __name__ == "__main__":
    main()

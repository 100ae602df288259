"""The engine on RLS 2 (both filters): what it adds to the kernels, what a second worker brings, 10⁹ realisations.

    python benchmarks/scale.py overhead [-n 1e6 1e8]      CPU time of the engine over that of the kernels alone
    python benchmarks/scale.py scaling [-n 1e8]           wall time of one and of two threads, and of Dask workers
    python benchmarks/scale.py large [-n 1e6 1e9]         time, rate and peak memory, a fresh process each

Ratios of CPU time are medians over pairs timed one after the other in one process; wall times mean something on a quiet
machine only. See README.md.
"""

import argparse
import json
import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor

from w1 import blocks, cpu, wall, work

PAIRS = {10**6: 15, 10**7: 7, 10**8: 3}


def overhead(n: int) -> dict:
    """Engine over kernels, without and with a store; what the main thread does beside is in it."""
    from radarsim.engine.collect import collect

    made = work()
    with ThreadPoolExecutor(1) as pool, tempfile.TemporaryDirectory() as folder:

        def kernels() -> float:
            return pool.submit(cpu, lambda: blocks(made, n)).result()

        def engine(**options) -> float:
            return cpu(lambda: collect(made, n, threads=1, **options))

        kernels(), engine()
        plain, stored = [], []
        for turn in range(PAIRS.get(n, 3)):
            before, one, between = kernels(), engine(), kernels()
            two = engine(store=os.path.join(folder, str(turn)))
            after = kernels()
            plain.append(2 * one / (before + between))
            stored.append(2 * two / (between + after))
    ratios = {"engine": statistics.median(plain), "with_store": statistics.median(stored)}
    return {"n": n, **ratios, "least": min(plain), "most": max(plain)}


def scaling(n: int) -> dict:
    """Wall time of one over that of two threads, and workers."""
    from radarsim.engine.cluster import Cluster
    from radarsim.engine.collect import collect

    made = work()
    collect(made, 10**6)
    threads = statistics.median(
        wall(lambda: collect(made, n, threads=1)) / wall(lambda: collect(made, n, threads=2)) for _ in range(3)
    )
    times = []
    for count in (1, 2):
        with Cluster(count) as pool:
            collect(made, 10**6, executor=pool)
            times.append(min(wall(lambda pool=pool: collect(made, n, executor=pool)) for _ in range(3)))
    return {"n": n, "two_threads": threads, "two_workers": times[0] / times[1]}


def large(n: int) -> dict:
    """One run as the command does it, with a store: seconds, rate, peak memory in MiB, distance from exact σ."""
    import numpy as np

    from radarsim.engine.collect import collect

    made = work()
    made.simulate(0, 1)
    with tempfile.TemporaryDirectory() as folder:
        started, used = time.perf_counter(), time.process_time()
        done = collect(made, n, store=folder)
        seconds, used = time.perf_counter() - started, time.process_time() - used
    axes, error = made.plan.axes, made.plan.layout.unpack(done.values)["error"]
    off = np.abs(np.sqrt(error[..., 1] / n) / axes.exact_sigma - 1) * np.sqrt(2 * n)
    return {
        "n": n,
        "seconds": seconds,
        "cpu_seconds": used,
        "realisations_per_s": n / seconds,
        "peak_mib": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
        "worst_standard_errors": float(off[axes.available].max()),
    }


DEFAULT = {"overhead": ["1e6", "1e8"], "scaling": ["1e8"], "large": ["1e6", "1e9"]}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("what", choices=sorted(DEFAULT))
    parser.add_argument("-n", nargs="+", help="realisations")
    parser.add_argument("--here", action="store_true", help=argparse.SUPPRESS)
    asked = parser.parse_args()
    if asked.here:
        print(json.dumps(globals()[asked.what](int(float(asked.n[0])))))
        return
    print("load average at the start:", *(f"{load:.1f}" for load in os.getloadavg()))
    for n in asked.n or DEFAULT[asked.what]:
        command = [sys.executable, __file__, asked.what, "-n", n, "--here"]
        print(subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True).stdout.strip(), flush=True)


if __name__ == "__main__":
    main()

"""Workload W1 (P1, RLS 2, 15 scans, both filters) against the machine's limit: hand-written AVX-512 C.

    python benchmarks/w1.py [-n 1e6] [--processes 5] [--limit DIR]

Each figure is the median over fresh processes; inside a process a ratio is the median over pairs timed one after the
other, so what else the machine does hits both. DIR holds limit.c and w1_c.py (default: $RADARSIM_LIMIT, else
../shared/bench beside the checkout); without it, gcc or AVX-512 the ratios are left out. See README.md.
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
from pathlib import Path

HERE = Path(__file__).resolve().parent
CONFIG = HERE.parent / "configs" / "rls2.yaml"
PAIRS = 9


def limit_folder(given: str | None) -> Path:
    """Where the C limit's sources are looked for."""
    return Path(given or os.environ.get("RADARSIM_LIMIT") or HERE.parent.parent / "shared" / "bench")


def c_limit(folder: Path):
    """The function n -> σ of both filters (15, 3) in C, or the reason why there is none."""
    if not (folder / "w1_c.py").exists():
        return None, f"no w1_c.py in {folder}"
    cores = os.sched_getaffinity(0)
    sys.path.insert(0, str(folder))
    try:
        import w1_c
    except Exception as error:
        return None, f"the C limit does not build: {error}"
    finally:
        os.sched_setaffinity(0, cores)  # its common.py pins the process to a core of its own choice
    return w1_c.run, None


def work():
    """RLS 2 as the engine sees it."""
    from radarsim.api.case_work import CaseWork
    from radarsim.api.configs import load

    (case,) = load(CONFIG).cases
    made = CaseWork(case)
    made.plan  # noqa: B018  (prepared outside the timing)
    return made


def blocks(made, n: int) -> None:
    """All blocks in the calling thread, sums thrown away: the kernels alone."""
    for first in range(0, n, made.block):
        made.simulate(first, min(made.block, n - first))


def cpu(function) -> float:
    """CPU seconds of the process for one call."""
    started = time.process_time()
    function()
    return time.process_time() - started


def wall(function) -> float:
    """Wall seconds of one call."""
    started = time.perf_counter()
    function()
    return time.perf_counter() - started


def paired(function, reference) -> tuple[float, float]:
    """Median CPU time of the function, and median ratio to the reference timed before and after it."""
    times, ratios = [], []
    for _ in range(PAIRS):
        before, own, after = cpu(reference), cpu(function), cpu(reference)
        times.append(own)
        ratios.append(2 * own / (before + after))
    return statistics.median(times), statistics.median(ratios)


def worst_deviation(made, n: int) -> float:
    """Largest distance of σ from its exact value in standard errors, over filters, scans and components."""
    import numpy as np

    from radarsim.engine.collect import collect

    axes = made.plan.axes
    error = made.plan.layout.unpack(collect(made, n, threads=1).values)["error"]
    sigma = np.sqrt(error[..., 1] / n)
    off = np.abs(sigma / axes.exact_sigma - 1) * np.sqrt(2 * n)
    return float(off[axes.available].max())


def measure_speed(n: int, folder: Path) -> dict:
    """One core: kernels and engine against C; two threads against one."""
    from radarsim.engine.collect import collect

    cores = sorted(os.sched_getaffinity(0))
    made, (reference, reason) = work(), c_limit(folder)
    os.sched_setaffinity(0, cores[-1:])
    out = {"worst_se": worst_deviation(made, n)}
    with ThreadPoolExecutor(1) as pool:  # kernels always run in pool threads: the main thread's stack is bimodal
        if reference is None:
            out["skipped"] = reason
            out["kernels_ns"] = pool.submit(cpu, lambda: blocks(made, n)).result() / n * 1e9
        else:
            pool.submit(paired, lambda: reference(n), lambda: blocks(made, n)).result()
            t, out["kernels_to_c"] = pool.submit(paired, lambda: blocks(made, n), lambda: reference(n)).result()
            out["kernels_ns"] = t / n * 1e9
            out["c_ns"] = out["kernels_ns"] / out["kernels_to_c"]
            t, out["engine_to_c"] = paired(lambda: collect(made, n, threads=1), lambda: reference(n))
            out["engine_ns"] = t / n * 1e9
    if len(cores) > 1:
        os.sched_setaffinity(0, cores[-2:])
        pairs = [[wall(lambda t=t: collect(made, n, threads=t)) for t in (1, 2)] for _ in range(PAIRS)]
        out["two_threads"] = statistics.median(one / two for one, two in pairs)
    return out


def measure_start() -> dict:
    """First block of a process: compiling where the cache is empty, loading where it is not."""
    made = work()
    started = time.process_time(), time.perf_counter()
    made.simulate(0, made.block)
    return {"cpu_s": time.process_time() - started[0], "wall_s": time.perf_counter() - started[1]}


def measure_growth() -> dict:
    """Nanoseconds a realisation and peak memory (MiB) from 10⁴ to 10⁷ realisations, one thread."""
    from radarsim.engine.collect import collect

    made, out = work(), {}
    collect(made, 10_000, threads=1)
    for n in (10**4, 10**5, 10**6, 10**7):
        t = min(cpu(lambda n=n: collect(made, n, threads=1)) for _ in range(3))
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        out[f"{n:.0e}"] = {"ns": t / n * 1e9, "peak_mib": peak}
    return out


def fresh(part: str, arguments: argparse.Namespace, **environment: str) -> dict:
    """One measurement in a process of its own."""
    command = [sys.executable, __file__, "--part", part, "-n", str(arguments.n)]
    command += ["--limit", str(limit_folder(arguments.limit))]
    done = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True, env=os.environ | environment)
    return json.loads(done.stdout)


def median(rows: list[dict]) -> dict:
    """Element by element; what is not a number is taken from the first."""
    return {
        key: round(statistics.median(row[key] for row in rows), 3) if isinstance(value, float) else value
        for key, value in rows[0].items()
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("-n", type=float, default=1e6, help="realisations (1e6)")
    parser.add_argument("--processes", type=int, default=5)
    parser.add_argument("--limit", help="folder of the C limit")
    parser.add_argument("--part", choices=("speed", "start", "growth"), help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.part:
        parts = {
            "speed": lambda: measure_speed(int(arguments.n), limit_folder(arguments.limit)),
            "start": measure_start,
            "growth": measure_growth,
        }
        print(json.dumps(parts[arguments.part]()))
        return
    print("load average at the start:", *(f"{load:.1f}" for load in os.getloadavg()))
    with tempfile.TemporaryDirectory() as empty:
        print("compile", json.dumps(median([fresh("start", arguments, RADARSIM_CACHE_DIR=empty)])))
        loads = [fresh("start", arguments, RADARSIM_CACHE_DIR=empty) for _ in range(arguments.processes)]
        print("load   ", json.dumps(median(loads)))
    rows = [fresh("speed", arguments) for _ in range(arguments.processes)]
    print("speed  ", json.dumps(median(rows)))
    for name in ("kernels_to_c", "engine_to_c", "two_threads"):
        if name in rows[0]:
            print(f"  {name}:", *(f"{row[name]:.2f}" for row in rows))
    print("growth ", json.dumps(fresh("growth", arguments)))


if __name__ == "__main__":
    main()

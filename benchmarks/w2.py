"""Workload W2 (P2, three-model IMM, 3721 scans at 20 Hz) against the machine's limit: hand-written AVX-512 C.

    python benchmarks/w2.py [--processes 3] [--limit DIR]

Each figure is the median over fresh processes; inside a process a ratio is the median over pairs timed one after the
other. DIR holds limit.c, w2_c.py and common.py with the workload, see w1.py; where the limit does not build here the
ratios to it are left out. The C limit draws its own noise; `given` is our filter on given plots.
"""

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import w1

GROUP = 8  # realisations that our kernel takes at a time
SCANS = 3721
REALISATIONS = 64
UPPER = np.triu_indices(3)
T3 = np.array([[0.996, 0, 0.002], [0, 0.996, 0.002], [0.004, 0.004, 0.996]])
MODELS = np.array([[1, 0, 0.05], [1, 1, 0.05], [1, 1, 30.0], [1, 1, 1.0], [1, 0, 5.0]])


class Given:
    """The kernel on given plots of eight realisations, with any bank, family and rule; the C workload's start."""

    def __init__(self, common):
        from radarsim.kernels.lanes import rows
        from radarsim.studies.multimodel.kernels import layout

        self.layout = layout
        self.z, self.start, self.P0 = common.w2_meas(GROUP), common.w2_truth()[0] + common.W2_X0_OFF, common.W2_P0
        self.plots, self.out = rows(SCANS * layout.PLOT), rows(SCANS * layout.OUTPUT)
        cells = self.plots.reshape(SCANS, layout.PLOT, GROUP)
        cells[:, :3], cells[:, 9] = self.z, 1
        cells[:, 3:9] = common.w2_R()[:, UPPER[0], UPPER[1], None]

    def run(self, models=MODELS[:3], T=T3, family="imm", rule="moment", output="moment"):
        """All scans; estimates (SCANS, 9, GROUP)."""
        from radarsim.studies.multimodel.kernels import filter_strip
        from radarsim.studies.multimodel.kernels.hypothesis import work_arrays

        layout, size = self.layout, len(models)
        work, numbers = work_arrays()
        cells = work.reshape(-1, GROUP)
        for i, (_, bends, _) in enumerate(models):
            own = cells[i * layout.HYPOTHESIS :]
            live = np.tile([1, 1, bends], 3)
            P = self.P0 * np.outer(live, live)
            own[:9] = (self.start * live)[:, None]
            for axis in range(3):
                block = P[3 * axis : 3 * axis + 3, 3 * axis : 3 * axis + 3]
                own[layout.OWN + 6 * axis : layout.OWN + 6 * axis + 6] = block[UPPER][:, None]
            own[layout.PROBABILITY] = 1 / size
        names = ("kalman", "gpb1", "imm", "gpb2"), ("moment", "best", "combined", "modified_combined")
        rules = np.array([names[0].index(family), names[1].index(rule), names[1].index(output), 0])
        intervals, times, everything = np.zeros(SCANS, np.int64), np.array([0.05]), np.zeros(SCANS, np.int64)
        frame = np.zeros(18)
        arrays = (models.ravel(), np.ascontiguousarray(T).ravel(), intervals, times, rules, frame, everything, self.out)
        filter_strip.filter_strip(work, numbers, self.plots, 0, SCANS, *arrays)
        return self.out.reshape(SCANS, layout.OUTPUT, GROUP)[:, :9]


def full_matrix(size: int) -> np.ndarray:
    """A transition matrix without zeros, columns summing to one."""
    return np.full((size, size), 0.004 / max(size - 1, 1)) + np.eye(size) * (0.996 - 0.004 / max(size - 1, 1))


def work(every: int, name: str = "multimodel", filters: int = 1):
    """The whole chain of a shipped config, its first filters."""
    from radarsim.api.case_work import CaseWork
    from radarsim.api.configs import load

    (case,) = load(name, (f"report_every={every}", f"scans={SCANS}")).cases
    spec = case.spec.model_copy(update={"filters": case.spec.filters[:filters]})
    made = CaseWork(type(case)(**{**vars(case), "spec": spec}))
    made.plan  # noqa: B018  (prepared outside the timing)
    return made


def per_step(seconds: float, realisations: int = GROUP) -> float:
    """Million realisation-steps a second."""
    return realisations * SCANS / seconds / 1e6


def c_limit(folder):
    """The C limit's module and its workload's (common), None where they are not there, and the reason."""
    if not (folder / "w2_c.py").exists():
        return None, None, f"no w2_c.py in {folder}"
    cores = os.sched_getaffinity(0)
    sys.path.insert(0, str(folder))
    try:
        import common
        import w2_c
    except Exception as error:
        return None, sys.modules.get("common"), f"the C limit does not build: {error}"
    finally:
        os.sched_setaffinity(0, cores)  # common.py pins the process to a core of its own choice
    return w2_c, common, None


def measure_speed(folder) -> dict:
    """One core: filter on given plots, rules, families, whole chain, each against C or against IMM `moment`."""
    cores = sorted(os.sched_getaffinity(0))
    limit, common, reason = c_limit(folder)
    os.sched_setaffinity(0, cores[-1:])
    out = {} if reason is None else {"skipped": reason}
    with ThreadPoolExecutor(1) as pool:
        if common is not None:
            out |= measure_given(pool, limit, Given(common))
        for every in (1, 10):
            out |= measure_chain(pool, limit, every)
    if len(cores) > 1:
        from radarsim.engine.collect import collect

        os.sched_setaffinity(0, cores[-2:])
        made = work(10)
        pairs = [[w1.wall(lambda t=t: collect(made, 1024, threads=t)) for t in (1, 2)] for _ in range(3)]
        out["two_threads"] = max(one / two for one, two in pairs)
    return out


def measure_given(pool, limit, given: Given) -> dict:
    """The filter on given plots: against C where there is one, rules and families against each other."""

    def kernel(count=REALISATIONS // GROUP, **options):
        return lambda: [given.run(**options) for _ in range(count)]

    if limit is None:
        pool.submit(w1.cpu, kernel()).result()
        out = {"given_msteps": per_step(pool.submit(w1.cpu, kernel()).result(), REALISATIONS)}
    else:
        out = {"difference": float(np.abs(given.run() - limit.run(GROUP, SCANS, z=given.z)).max())}
        reference = lambda: limit.run(REALISATIONS)  # noqa: E731
        pool.submit(w1.paired, reference, kernel()).result()
        t, ratio = pool.submit(w1.paired, kernel(), reference).result()
        out |= {"given_msteps": per_step(t, REALISATIONS), "given_of_c": 1 / ratio}
        out["c_msteps"] = out["given_msteps"] / out["given_of_c"]
    for rule in ("best", "combined", "modified_combined"):
        same = {"rule": rule, "output": "best"}
        out[f"{rule}_to_moment"] = pool.submit(w1.paired, kernel(**same), kernel(output="best")).result()[1]
    for size in (2, 3, 5):
        bank = {"models": MODELS[:size], "T": full_matrix(size)}
        function = kernel(family="gpb2", **bank)
        out[f"gpb2_to_imm_{size}"] = pool.submit(w1.paired, function, kernel(**bank)).result()[1]
    return out


def measure_chain(pool, limit, every: int) -> dict:
    """Noise, plots, conversion, the first filter of the shipped config and sums at every such scan."""
    made = work(every)
    made.simulate(0, GROUP)
    chain = lambda: made.simulate(0, REALISATIONS)  # noqa: E731
    if limit is None:
        return {f"chain_msteps_every_{every}": per_step(pool.submit(w1.cpu, chain).result(), REALISATIONS)}
    reference = lambda: limit.run(REALISATIONS)  # noqa: E731
    return {f"chain_to_c_every_{every}": pool.submit(w1.paired, chain, reference).result()[1]}


def measure_start() -> dict:
    """First block of a process and first pass over given plots: compiling where the cache is empty, loading else."""
    from radarsim.studies.multimodel.cost import seconds_per_update

    made = work(10, filters=6)
    started = time.process_time(), time.perf_counter()
    made.simulate(0, GROUP)
    first = time.process_time() - started[0]
    seconds_per_update(made.plan)
    return {"first_block_cpu_s": first} | {
        "cpu_s": time.process_time() - started[0],
        "wall_s": time.perf_counter() - started[1],
    }


def measure_experiment() -> dict:
    """The paper's experiment warm: six algorithms, 1000 realisations, with tables; and its rate a realisation."""
    import radarsim

    with tempfile.TemporaryDirectory() as folder:
        radarsim.run("multimodel", realisations=64)
        started = time.perf_counter()
        radarsim.run("multimodel", out=folder, figures=False)
        seconds = time.perf_counter() - started
    return {"seconds": seconds}


def fresh(part: str, arguments: argparse.Namespace, **environment: str) -> dict:
    """One measurement in a process of its own."""
    command = [sys.executable, __file__, "--part", part, "--limit", str(w1.limit_folder(arguments.limit))]
    done = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True, env=os.environ | environment)
    return json.loads(done.stdout)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--processes", type=int, default=3)
    parser.add_argument("--limit", help="folder of the C limit")
    parser.add_argument("--part", choices=("speed", "start", "experiment"), help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.part:
        folder = w1.limit_folder(arguments.limit)
        parts = {"speed": lambda: measure_speed(folder), "start": measure_start, "experiment": measure_experiment}
        # common.py of the limit reads the command line
        sys.argv = sys.argv[:1]
        print(json.dumps(parts[arguments.part]()))
        return
    print("load average at the start:", *(f"{load:.1f}" for load in os.getloadavg()))
    with tempfile.TemporaryDirectory() as empty:
        print("compile   ", json.dumps(w1.median([fresh("start", arguments, RADARSIM_CACHE_DIR=empty)])))
        loads = [fresh("start", arguments, RADARSIM_CACHE_DIR=empty) for _ in range(arguments.processes)]
        print("load      ", json.dumps(w1.median(loads)))
    rows = [fresh("speed", arguments) for _ in range(arguments.processes)]
    if "skipped" in rows[0]:
        print("skipped   ", rows[0]["skipped"])
    for name in [name for name in rows[0] if name != "skipped"]:
        values = [row[name] for row in rows]
        print(f"{name:28s} {statistics.median(values):8.3g}   of", *(f"{value:.3g}" for value in values))
    print("experiment", json.dumps(w1.median([fresh("experiment", arguments) for _ in range(arguments.processes)])))


if __name__ == "__main__":
    main()

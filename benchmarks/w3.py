"""Workload W3 (P4, scoring on 30 000 samples) against the machine's limit, and bursts a second of the three engines.

    python benchmarks/w3.py [--processes 3] [--limit DIR]

Scoring has the windows, steps and noise of the C limit's own script (w3.py in DIR; default $RADARSIM_LIMIT, else
../shared/bench beside the checkout): twelve windows, four steps in each, σ = 3. Times are CPU times of one thread; each
figure is the median over fresh processes, in each the median over pairs timed one after the other. See README.md.
"""

import argparse
import json
import os
import statistics
import subprocess
import sys
import time
from functools import partial
from pathlib import Path

HERE = Path(__file__).resolve().parent
PAIRS = 5
WINDOWS = (176, 288, 464, 736, 1168, 1872, 2976, 4720, 7504, 11904, 18896, 30000)  # where the limit is missing
CURED = {"name": "cured", "coherence_step": True, "search_points": 2, "tolerance": 0.3}
DENSE = {**CURED, "name": "dense", "density": 2, "search_points": 0}


def limit_folder(given: str | None) -> Path:
    """Where the C limit's sources are looked for."""
    return Path(given or os.environ.get("RADARSIM_LIMIT") or HERE.parent.parent / "shared" / "bench")


def c_limit(folder: Path):
    """The limit's module, or the reason why there is none."""
    if not (folder / "w3.py").exists():
        return None, f"no w3.py in {folder}"
    cores = os.sched_getaffinity(0)
    sys.path.insert(0, str(folder))
    sys.modules.pop("w3", None)
    try:
        import w3
    except Exception as error:
        return None, f"the C limit does not build: {error}"
    finally:
        sys.path.remove(str(folder))
        os.sched_setaffinity(0, cores)  # its common.py pins the process to a core of its own choice
    return w3, None


def plan(engine: str, estimator: dict, variance: float = 2.25, prior: dict | None = None, truth: dict | None = None):
    """A prepared plan of one estimator on the paper's burst."""
    from radarsim.api.configs import load
    from radarsim.studies.discriminator import study

    config = {
        "study": "discriminator",
        "burst": {
            **{"carrier_hz": 1e10, "pulse_period_s": 1e-5, "pulse_length_s": 1e-6, "sampling_period_s": 1e-6},
            **{"pulses": 30000, "amplitude": 1.0, "noise_variance": variance},
        },
        "truth": truth or {"phase_rad": 0.7, "doppler_derivatives": [1e4, 18e4, -75e4, 1e6]},
        "prior": prior or {"spread_over_potential": [100.0, 150.0, 500.0, 1000.0, 2000.0]},
        "estimators": [estimator],
        "engine": engine,
        "realisations": 1,
    }
    return study.prepare(load(config).cases[0])


def timed(function) -> float:
    """CPU seconds of a call."""
    started = time.process_time()
    function()
    return time.process_time() - started


def scoring(w3) -> dict:
    """Seconds a burst of the limit's workload, in Numba and in C."""
    from radarsim.studies.discriminator import study

    windows = [float(w) * 1e-5 for w in (w3.WIN if w3 else WINDOWS)]
    estimator = {"name": "w3", "schedule": windows, "steps": 4, "tolerance": 1e-12}
    sigma = [0.31, 5.0, 50.0, 400.0, 3000.0]
    ours = plan(
        "samples", estimator, 9.0, {"sigma": sigma}, {"phase_rad": 0.6, "doppler_derivatives": [2e3, 3e3, 0.0, 0.0]}
    )
    n, m = 60, 60
    study.estimate(ours, 0, 2)
    if w3:
        w3.run_c(2)
    pairs = []
    for _ in range(PAIRS):
        mine = timed(lambda: study.estimate(ours, 0, n)) / n
        limit = timed(lambda: w3.run_c(m)) / m if w3 else float("nan")
        pairs.append((mine, limit))
    evaluations = 4 * sum(round(w * 1e5) for w in windows)
    mine, limit = (statistics.median(pair[i] for pair in pairs) for i in (0, 1))
    return {
        "scoring_evaluations_per_s": evaluations / mine,
        "scoring_limit_evaluations_per_s": evaluations / limit,
        "scoring_of_limit": statistics.median(limit / mine for mine, limit in pairs),
    }


def engines(w3) -> dict:
    """Bursts a second of the engines, and that over bursts a second of the C limit in the same run."""
    from radarsim.studies.discriminator import study

    found = {}
    cases = [
        ("samples", CURED, 40),
        ("demodulated", CURED, 200),
        ("block_sums", CURED, 4000),
        ("block_sums", DENSE, 4000),
    ]
    for engine, estimator, n in cases:
        made = plan(engine, estimator)
        study.estimate(made, 0, 2)
        name = f"{engine}_{estimator['name']}"
        pairs = []
        for i in range(PAIRS):
            mine = timed(partial(study.estimate, made, i * n, n)) / n
            pairs.append((mine, timed(partial(w3.run_c, 60)) / 60 if w3 else float("nan")))
        found[f"{name}_bursts_per_s"] = 1 / statistics.median(mine for mine, _ in pairs)
        found[f"{name}_over_limit_bursts"] = statistics.median(limit / mine for mine, limit in pairs)
        errors, passes = study.estimate(made, 0, n)
        last = errors[:, 0, made.options["windows"][0] - 1] / made.potential[0, made.options["windows"][0] - 1]
        found[f"{name}_locked"] = float((abs(last) < 5).all(axis=1).mean())
        found[f"{name}_passes"] = float(passes.mean())
    return found


def once(folder: Path) -> dict:
    """All figures of one process."""
    w3, reason = c_limit(folder)
    if reason:
        print(reason, file=sys.stderr)
    return scoring(w3) | engines(w3)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--processes", type=int, default=3)
    parser.add_argument("--limit")
    parser.add_argument("--once", action="store_true", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.once:
        sys.argv = sys.argv[:1]  # the limit's common.py reads the command line
        print(json.dumps(once(limit_folder(given.limit))))
        return
    command = [sys.executable, __file__, "--once", *(["--limit", given.limit] if given.limit else [])]
    runs = [
        json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout.splitlines()[-1])
        for _ in range(given.processes)
    ]
    for name in runs[0]:
        values = [run[name] for run in runs]
        print(f"{name:40} {statistics.median(values):14.4g}   {min(values):.4g} … {max(values):.4g}")


if __name__ == "__main__":
    main()

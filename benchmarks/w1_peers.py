"""Workload W1 (P1, RLS 2, 15 scans, both filters) paired with other libraries, each as its own manual would do it.

    python benchmarks/w1_peers.py --python /tmp/peers/bin/python [--repeats 3] [dynamax simdkalman filterpy stonesoup]

--python is the interpreter of an environment that holds the libraries (never ours, see README.md). Timed on one core,
in CPU time: noise, least-squares start, both filters, σ. The engine is timed just before and just after each library
and adds up all its moments; a library that loops in Python gets fewer realisations, and times are per realisation.
"""

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

REALISATIONS = {"dynamax": 100_000, "simdkalman": 100_000, "filterpy": 500, "stonesoup": 100}
ENGINE_REALISATIONS = 1_000_000


# ---- the libraries: x (n, 3) and P (3, 3) before the first plot of z (n, T, m) -> estimates (n, T, 3)


def dynamax(x, P, z, F, Q, H, R):
    import jax
    from dynamax.linear_gaussian_ssm.inference import lgssm_filter, make_lgssm_params

    def one(mean, plots):
        return lgssm_filter(make_lgssm_params(mean, P, F, Q, H, R), plots).filtered_means

    key = len(H)
    if key not in COMPILED:
        COMPILED[key] = jax.jit(jax.vmap(one))
    return np.asarray(COMPILED[key](x, z))


COMPILED: dict = {}


def simdkalman(x, P, z, F, Q, H, R):
    from simdkalman import KalmanFilter

    found = KalmanFilter(F, Q, H, R).compute(
        z, 0, initial_value=x[:, :, None], initial_covariance=P, smoothed=False, filtered=True, observations=False
    )
    return found.filtered.states.mean


def filterpy(x, P, z, F, Q, H, R):
    from filterpy.kalman import KalmanFilter

    out = np.empty((*z.shape[:2], 3))
    made = KalmanFilter(dim_x=3, dim_z=len(H))
    made.F, made.Q, made.H, made.R = F, Q, H, R
    for i in range(len(z)):
        made.x, made.P = x[i].copy(), P.copy()
        for k in range(z.shape[1]):
            if k:
                made.predict()
            made.update(z[i, k])
            out[i, k] = made.x
    return out


def stonesoup(x, P, z, F, Q, H, R):
    from datetime import datetime, timedelta

    from stonesoup.models.measurement.linear import LinearGaussian
    from stonesoup.models.transition.linear import LinearGaussianTimeInvariantTransitionModel
    from stonesoup.predictor.kalman import KalmanPredictor
    from stonesoup.types.detection import Detection
    from stonesoup.types.hypothesis import SingleHypothesis
    from stonesoup.types.prediction import GaussianStatePrediction
    from stonesoup.updater.kalman import KalmanUpdater

    motion = LinearGaussianTimeInvariantTransitionModel(transition_matrix=F, covariance_matrix=Q)
    sensor = LinearGaussian(ndim_state=3, mapping=tuple(range(len(H))), noise_covar=R)
    predictor, updater = KalmanPredictor(motion), KalmanUpdater(sensor)
    times = [datetime(2020, 1, 1) + timedelta(seconds=k) for k in range(z.shape[1])]
    out = np.empty((*z.shape[:2], 3))
    for i in range(len(z)):
        state = GaussianStatePrediction(x[i][:, None], P, timestamp=times[0])
        for k, t in enumerate(times):
            if k:
                state = predictor.predict(state, timestamp=t)
            plot = Detection(z[i, k][:, None], timestamp=t, measurement_model=sensor)
            state = updater.update(SingleHypothesis(state, plot))
            out[i, k] = state.state_vector[:, 0]
    return out


# ---- in the libraries' environment: NumPy and the library alone


def job(library, problem, n: int, seed: int) -> np.ndarray:
    """σ (2, K, 3) of both filters over n realisations, NaN before the start."""
    truth, sigma, F, Q = (problem[name] for name in ("truth", "sigma", "F", "Q"))
    plots = truth[:, :2] + sigma * np.random.default_rng(seed).standard_normal((n, len(truth), 2))
    out = np.full((2, len(truth), 3), np.nan)
    for f, (m, start) in enumerate(zip(problem["observes"], problem["start"], strict=True)):
        x = np.einsum("cjk,nkj->nc", problem["weights"][f, :, :, :start], plots[:, :start])
        out[f, start - 1] = np.sqrt(((x - truth[start - 1]) ** 2).mean(axis=0))
        P, H, R = F @ problem["believed"][f] @ F.T + Q, np.eye(3)[:m], np.diag(sigma[:m] ** 2)
        x = library(x @ F.T, P, plots[:, start:, :m], F, Q, H, R)
        out[f, start:] = np.sqrt(((x - truth[start:]) ** 2).mean(axis=0))
    return out


def serve(name: str, path: str, repeats: int) -> None:
    """Time one library in this process and print what came out."""
    problem, n = dict(np.load(path)), REALISATIONS[name]
    if name == "dynamax":
        import jax

        jax.config.update("jax_enable_x64", True)
    library = globals()[name]
    job(library, problem, n, 0)  # imports and compiles
    seconds = []
    for seed in range(1, repeats + 1):
        started = time.process_time()
        sigma = job(library, problem, n, seed)
        seconds.append(time.process_time() - started)
    off = np.abs(sigma / problem["exact"] - 1) * np.sqrt(2 * n)
    print(json.dumps({"ns": statistics.median(seconds) / n * 1e9, "worst_se": float(np.nanmax(off)), "n": n}))


# ---- in ours


def problem_of(made) -> dict[str, np.ndarray]:
    """The case as plain arrays."""
    from radarsim.physics.motion import manoeuvre_covariance, transition

    problem, axes = made.plan.problem, made.plan.axes
    dt, before = axes.scan_period_s, ~axes.available.all(axis=2)
    variance = axes.manoeuvre_variance[0]
    return {
        "truth": problem.truth,
        "sigma": axes.sigma,
        "F": transition(dt),
        "Q": manoeuvre_covariance(variance, dt),
        "observes": problem.observes,
        "start": problem.start,
        "weights": problem.weights,
        "believed": axes.believed[np.arange(2), problem.start - 1],
        "exact": np.where(before[:, :, None], np.nan, axes.exact_sigma),
    }


def engine_ns(made) -> float:
    """CPU nanoseconds a realisation of the engine in one thread, all moments summed."""
    from radarsim.engine.collect import collect

    started = time.process_time()
    collect(made, ENGINE_REALISATIONS, threads=1)
    return (time.process_time() - started) / ENGINE_REALISATIONS * 1e9


def compare(names: list[str], python: str, repeats: int) -> None:
    """Run each library between two runs of the engine and print a table."""
    from w1 import work

    core = {max(os.sched_getaffinity(0))}
    os.sched_setaffinity(0, core)
    made = work()
    engine_ns(made)
    print(f"{'library':12}{'realisations':>13}{'ns each':>14}{'engine, ns':>12}{'ratio':>10}{'worst s.e.':>12}")
    with tempfile.TemporaryDirectory() as folder:
        path = str(Path(folder) / "problem.npz")
        np.savez(path, **problem_of(made))
        for name in names:
            before = engine_ns(made)
            command = [python, __file__, "--serve", name, "--problem", path, "--repeats", str(repeats)]
            single = {f"{k}_NUM_THREADS": "1" for k in ("OMP", "OPENBLAS", "MKL")} | {"JAX_PLATFORMS": "cpu"}
            done = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True, env=os.environ | single)
            got, own = json.loads(done.stdout.splitlines()[-1]), (before + engine_ns(made)) / 2
            ratio = got["ns"] / own
            print(f"{name:12}{got['n']:13}{got['ns']:14.0f}{own:12.0f}{ratio:10.3g}{got['worst_se']:12.2f}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", default=list(REALISATIONS), help="libraries (all)")
    parser.add_argument("--python", default=sys.executable, help="interpreter that has the libraries")
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--serve", help=argparse.SUPPRESS)
    parser.add_argument("--problem", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.serve:
        serve(arguments.serve, arguments.problem, arguments.repeats)
    else:
        compare(arguments.names, arguments.python, arguments.repeats)


if __name__ == "__main__":
    main()

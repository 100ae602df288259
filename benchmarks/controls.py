"""Controls of P2: what they cost, what they spare, and what mirrored and quasi-random noise would; one core, CPU time.

    python benchmarks/controls.py [--pairs 8] [-n 4000]

The cost is the CPU time of a block with controls over that of one without, in pairs in one run. What controls spare is
read from `controlled_stages.csv`. Mirrored noise (antithetic pairs) and scrambled Sobol numbers are tried at 1 Hz, on
the same kernels, with plots made here of given normals: by how much the variance of a mean over a stage changes at the
same number of realisations.
"""

import argparse
import statistics
import time

import numpy as np
from scipy.stats import norm, qmc

import radarsim
from radarsim.app.configs import load
from radarsim.app.work import CaseWork
from radarsim.kernels.lanes import WIDTH, rows
from radarsim.studies.multimodel import world
from radarsim.studies.multimodel.kernels import hypothesis, records, strip

BESIDE = "control_variate=true"
SHOWN = (3, 4)  # y, vy


def cost(name: str, pairs: int) -> float:
    """CPU time of a block with controls over that without: median of pairs."""
    works = [CaseWork(load(name, overrides).cases[0]) for overrides in ([], [BESIDE])]
    seconds = [[], []]
    for work in works:
        work.simulate(0, WIDTH)
    for _ in range(pairs):
        for work, spent in zip(works, seconds, strict=True):
            started = time.thread_time()
            work.simulate(0, work.block)
            spent.append(time.thread_time() - started)
    return statistics.median(b / a for a, b in zip(*seconds, strict=True))


def spared(name: str, n: int) -> None:
    """Print by how much the variance of each stage's σ² falls."""
    made = radarsim.run(name, realisations=n, overrides=[BESIDE, "report_every=100"]).tables["controlled_stages"]
    made = made[made["component"].isin(["y", "vy"])]
    print(made.pivot_table("variance_factor", ["filter", "component"], "stage", sort=False).round(1).to_string())


def mean_squares(plan, sensor, normals: np.ndarray) -> np.ndarray:
    """Means of squared errors over the stages (n, F, S, 2) of realisations with these normals (n, K, 3)."""
    t = plan.world.plot_truth
    true = np.column_stack([t[:, records.RANGE], np.arcsin(t[:, [records.ELEVATION, records.AZIMUTH]])])
    count, stage = len(true), plan.world.stage
    found = np.zeros((len(normals), len(plan.banks.numbers), len(plan.world.lengths), len(SHOWN)))
    for first in range(0, len(normals), WIDTH):
        plots = np.ones((count, records.PLOT, WIDTH))
        for lane, noise in enumerate(normals[first : first + WIDTH]):
            z, R, _ = world.local_plots(sensor, true + noise * np.asarray(sensor.sigma))
            plots[:, : records.COVARIANCE, lane], plots[:, records.COVARIANCE : records.DETECTED, lane] = z, R
        flat = rows(plots.size // WIDTH)
        flat[:] = plots.ravel()
        for f, numbers in enumerate(plan.banks.numbers):
            size, out = numbers[records.SIZE], rows(count * records.OUTPUT)
            work, own = hypothesis.work_arrays()
            strip.start_strip(work, own, flat, plan.world.weights, plan.banks.probabilities[f, :size].copy())
            strip.filter_strip(
                *(work, own, flat, records.START, count, plan.banks.models[f, : 3 * size].copy()),
                *(plan.banks.transitions[f], plan.world.intervals, plan.world.times, numbers, plan.world.frame),
                *(np.zeros(count, dtype=np.int64), out),
            )
            error = out.reshape(count, -1, WIDTH)[:, SHOWN] - plan.world.truth[:, SHOWN, None]
            for s in range(found.shape[2]):
                inside = (stage == s) & (np.arange(count) >= records.START)
                found[first : first + WIDTH, f, s] = (error[inside] ** 2).mean(axis=0).T
    return found


def other_noise(n: int) -> None:
    """Print what mirrored and quasi-random noise do to the variance of a mean over a stage, plain noise being 1."""
    case = load("multimodel_1hz").cases[0]
    plan, sensor = CaseWork(case).plan, case.spec.sensor
    shape, rng = (len(plan.world.truth), 3), np.random.default_rng(1)
    normals = rng.normal(size=(n, *shape))
    plain, mirrored = (mean_squares(plan, sensor, sign * normals) for sign in (1, -1))
    pairs = 2 * ((plain + mirrored) / 2).var(axis=0) / plain.var(axis=0)
    each, quasi = 64, []
    for seed in range(max(n // each, 8)):
        points = qmc.Sobol(int(np.prod(shape)), scramble=True, seed=seed).random(each)
        quasi.append(mean_squares(plan, sensor, norm.ppf(points).reshape(each, *shape)).mean(axis=0))
    sobol = np.var(quasi, axis=0, ddof=1) * each / plain.var(axis=0)
    for what, found in (("mirrored pairs", pairs), ("scrambled Sobol", sobol)):
        print(f"{what}: variance at the same number of realisations, y and vy by stage")
        for name, own in zip(plan.axes.filters, found, strict=True):
            print(f"  {name:12s}", "  ".join(f"{y:5.2f} {vy:5.2f}" for y, vy in own))


def main() -> None:
    """Print costs, factors and the two other kinds of noise."""
    asked = argparse.ArgumentParser(description=__doc__)
    asked.add_argument("--pairs", type=int, default=8)
    asked.add_argument("-n", type=int, default=4000)
    options = asked.parse_args()
    for name in ("multimodel", "multimodel_1hz"):
        print(f"{name}: CPU time with controls {cost(name, options.pairs):.3f} of that without")
    other_noise(options.n)
    for name in ("multimodel_1hz", "multimodel"):
        print(f"{name}: variance of σ² falls by")
        spared(name, options.n)


if __name__ == "__main__":
    main()

"""Hypotheses on folds against hand-written C (benchmarks/ambiguous_limit.c), one core, CPU time, as a ratio in one run.

    python benchmarks/ambiguous_limit.py [-n 20000] [--pairs 5]

RLS 2 to 5 of P1 at 1 kHz, targets from the prior, 15 and 29 scans, one filter with up to 300 hypotheses. The kernel
also draws counter-based noise, keeps track of the right hypothesis and of the best, and adds all sums; the C limit
draws cheaper noise and adds the squared error of the velocity alone. What both find is printed, so that a fast wrong
answer is seen.
"""

import argparse
import ctypes
import math
import tempfile
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path

import limits
import numpy as np

from radarsim.api.configs import load
from radarsim.studies.ambiguous_doppler import exact_errors, filter_design, study

SOURCE = Path(__file__).with_suffix(".c")
DOUBLES = ctypes.POINTER(ctypes.c_double)


def limit(folder: str):
    """The C function, compiled for this processor."""
    function = limits.library(SOURCE, folder).run
    function.restype = ctypes.c_double
    whole, real = ctypes.c_int, ctypes.c_double
    function.argtypes = [whole, whole, *[real] * 6, whole, real, DOUBLES, DOUBLES, ctypes.c_uint64]
    return function


def plan_of(radar: str):
    """The plan of a radar with the filter that remembers alone, and the numbers that the C limit takes."""
    case = load(radar).cases[0]
    memory = next(one for one in case.spec.filters if one.name == "memory")
    spec = case.spec.model_copy(update={"filters": (memory,), "baseline": None})
    plan = study.prepare(type(case)(case.name, case.stem, case.study, spec, (), 1, 1))
    of = exact_errors.kalman_gains(
        filter_design.members(memory)[0], spec.prior, plan.world.sigma, spec.radar.scan_period_s, spec.scans
    )
    gains = np.zeros((spec.scans, 8))
    gains[:, 1:4], gains[:, 4], gains[:, 5:] = of.range, of.variance, of.velocity
    for k in range(1, spec.scans):
        P = (
            of.F @ of.covariance[k - 1] @ of.F.T
            + filter_design.model(2, memory.manoeuvre_variance, spec.radar.scan_period_s)[1]
        )
        gains[k, 0] = 0.5 / (P[0, 0] + plan.world.sigma[0] ** 2)
    return plan, spec, memory, np.ascontiguousarray(gains)


def ours(plan, n: int) -> np.ndarray:
    """σ of the velocity (K,) from n realisations."""
    values = np.zeros(plan.layout.size)
    for first in range(0, n, plan.block):
        values += study.simulate(plan, first, min(plan.block, n - first))
    return np.sqrt(plan.layout.unpack(values)["error"][0, :, 1, 1] / n)


def theirs(function, spec, memory, gains: np.ndarray, n: int) -> tuple[np.ndarray, float]:
    """The same of the C limit, and the mean number of hypotheses."""
    radar, sums = spec.radar, np.zeros(spec.scans)
    kept = function(
        *(n, spec.scans, radar.scan_period_s, radar.sigma_range_m, radar.sigma_velocity_mps, radar.spans_mps[0]),
        *(spec.prior.sigma_velocity_mps, spec.prior.sigma_acceleration_mps2, memory.hypotheses),
        *(-math.log(memory.prune_below), gains.ctypes.data_as(DOUBLES), sums.ctypes.data_as(DOUBLES), 7),
    )
    return np.sqrt(sums / n), kept


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("-n", type=int, default=20_000)
    parser.add_argument("--pairs", type=int, default=5)
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder, ThreadPoolExecutor(1) as pool:
        function = limit(folder)
        for radar in ("ambiguous_rls2", "ambiguous_rls3", "ambiguous_rls4", "ambiguous_rls5"):
            plan, spec, memory, gains = plan_of(radar)
            pool.submit(ours, plan, 64).result()
            given = (function, spec, memory, gains, asked.n)
            paired = pool.submit(limits.paired, partial(ours, plan, asked.n), partial(theirs, *given), asked.pairs)
            seconds, _, ratio = paired.result()
            (sigma, kept), own = theirs(*given), ours(plan, asked.n)
            apart = np.abs(own / sigma - 1).max()
            cost = f"{ratio:.2f} of C, {seconds / asked.n / spec.scans * 1e9:.0f} ns a scan"
            found = f"{kept:.0f} hypotheses on average; largest difference of σ_V {100 * apart:.1f} %"
            print(f"{radar}: {cost}, {found}")


if __name__ == "__main__":
    main()

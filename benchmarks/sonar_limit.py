"""P3's kernels against hand-written C (sonar_limit.c), one core, CPU time, as a ratio in one run.

    python benchmarks/sonar_limit.py [-n 40960] [--pairs 9]

Each realisation's own misses: the case of sonar.py, plots missed at random. Detectors: five of `sonar_manoeuvre` over
45 scans, plots missed at random, with one filter; a test is one detector, one coordinate or both, and one threshold.
Tracker: the cases of sonar_clutter.py; a track-scan is one scan of one track, the target's or one that false plots
began.
The C limits draw the same noise and add the same sums; how far both are apart is printed, so that a fast wrong answer
is seen.
"""

import argparse
import ctypes
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import limits
import numpy as np
import sonar
import sonar_clutter

from radarsim.studies.sonar.clutter.kernels.gate import PDA
from radarsim.studies.sonar.clutter.kernels.track_sums import COUNTS, FALSE_CONFIRMED, FALSE_COUNTS, RATIOS

SUMS = 29  # of a filter, scan and coordinate: as in sonar_limit.c
PLACES = {"error": slice(0, 12), "paired": slice(12, 15), "estimates": slice(15, 18), "joint": slice(21, 25)}
TRACKED = {name: PLACES[name] for name in ("error", "estimates", "joint")} | {"ahead": slice(25, 29)}
DETECTORS = sonar.SONAR | {
    "target": "sonar_accelerating",
    "scans": 45,
    "filters": [{"name": "line", "kind": "growing_memory", "degree": 1}],
    "detectors": [
        {"name": f"{plots} plots", "plots": plots, "false_alarm_probability": [0.317, 0.1, 0.03, 0.01, 0.003, 0.001]}
        for plots in (4, 5, 6, 8, 10)
    ],
}


def world_of(plan) -> dict:
    """The members of the C structure World: weights are one, and the state of a filter with covariance is a line."""
    bank, world = plan.bank, plan.world
    assert (plan.conversion.weight == 1).all()
    assert (world.walk == 0).all()
    arrays = {
        "plots": world.plots,
        "misses": plan.detections.key,
        "certain": plan.detections.certain.astype(np.int64),
        "size": bank.size.astype(np.int64),
        "covariance": (bank.kind == 1).astype(np.int64),
        **{name: getattr(world, name) for name in ("dt", "truth", "steps", "fresh")},
        **{"carry": bank.carry, "manoeuvre": bank.manoeuvre, "sigma": bank.sigma},
    }
    numbers = {"scans": len(world.dt), "filters": len(bank.size)}
    numbers |= {"limit": float(plan.detections.probability), "period": float(bank.period)}
    return numbers | {name: np.ascontiguousarray(array) for name, array in arrays.items()}


def own_misses(library, pool, n: int, pairs: int) -> str:
    """A line on the filters whose plots are missed at random."""
    made, steps = sonar.work(sonar.SONAR, 2, detection_probability=0.9)
    given = world_of(made.plan)
    world, n = limits.structure(given), n - n % made.block
    theirs = np.zeros((given["filters"], given["scans"], 2, SUMS))

    def limit():
        theirs[:] = 0.0
        library.own_misses(ctypes.byref(world), ctypes.c_uint64(0), n, ctypes.c_void_p(theirs.ctypes.data))

    found, own, least, ratio = timed(made, pool, limit, n, pairs)
    each, apart = 1e9 / n / steps, filters_apart(found, theirs)
    return f"own misses: {own * each:.1f} ns a scan, C {least * each:.1f} ns, {ratio:.2f} of C; sums apart by {apart}"


def detectors(library, pool, n: int, pairs: int) -> str:
    """A line on manoeuvre detectors."""
    made = sonar.work(DETECTORS, 2, detection_probability=0.9)[0]
    given, of = world_of(made.plan), made.plan.detectors
    world, n, (D, G, most), K = limits.structure(given), n - n % made.block, of.threshold.shape, given["scans"]
    several = limits.structure(
        {"count": D, "longest": int(of.plots.max()), "most": most}
        | {"plots": of.plots, "every": of.every, "levels": of.thresholds, "phase": of.phase, "threshold": of.threshold}
    )
    theirs, alarms = np.zeros((given["filters"], K, 2, SUMS)), np.zeros((D, G, K, 1 + 2 * most))

    def limit():
        theirs[:], alarms[:] = 0.0, 0.0
        to = [ctypes.c_void_p(array.ctypes.data) for array in (theirs, alarms)]
        library.detected(ctypes.byref(world), ctypes.byref(several), ctypes.c_uint64(0), n, *to)

    found, own, least, ratio = timed(made, pool, limit, n, pairs)
    same = np.array_equal(found["tested"], alarms[..., 0])
    for name, place in (("alarms", alarms[..., 1::2]), ("first", alarms[..., 2::2])):
        same = same and np.array_equal(found[name], np.moveaxis(place, -1, -2))
    each = 1e9 / n / K / G / int(of.thresholds.sum())
    counts = f"counts {'equal' if same else 'DIFFER'}"
    return (
        f"detectors: {own * each:.2f} ns a test, C {least * each:.2f} ns, {ratio:.2f} of C; {counts}, "
        f"sums apart by {filters_apart(found, theirs)}"
    )


def world_of_tracks(plan) -> dict:
    """The same of a plan of trackers, which have no bank of filters."""
    axes, trackers = plan.axes, plan.trackers
    none = np.zeros(0, dtype=np.int64)
    arrays = {
        "plots": axes.world.plots,
        "misses": axes.detections.key,
        "certain": axes.detections.certain.astype(np.int64),
        **dict.fromkeys(("size", "covariance"), none),
        **{name: getattr(axes.world, name) for name in ("dt", "truth", "steps", "fresh")},
        **dict.fromkeys(("carry", "manoeuvre"), none),
        "sigma": trackers.sigma,
    }
    numbers = {"scans": len(axes.k), "filters": 0, "limit": float(axes.detections.probability)}
    numbers |= {"period": float(trackers.period)}
    return numbers | {name: np.ascontiguousarray(array) for name, array in arrays.items()}


def tracker_of(plan) -> dict:
    """The members of the C structure Tracker: one tracker, and a sector that is not a full circle."""
    of, field = plan.trackers, plan.axes.field
    cells = field.cells
    assert len(of.chi_square) == 1
    assert not cells.ring
    numbers = {"joint": int(of.association[0] == PDA), "nq": cells.nq, "nb": cells.nb}
    numbers |= {"levels": len(of.score_thresholds), "shares": len(field.share)}
    assert numbers["shares"] <= 40  # MAX_MEAN_IN_CELL
    for name in ("m", "n", "misses", "speed", "lost"):
        numbers[name] = float(getattr(of, name)[0])
    numbers["gate"] = float(of.chi_square[0])
    numbers |= {"detection": float(of.detection), "inside": float(of.gate_probability[0]), "assumed": float(of.density)}
    numbers |= {name: float(getattr(cells, name)) for name in ("q0", "dq", "b0", "db", "density")}
    keys = {"field": field.key, "about": plan.false_track_field.key, "seeds": plan.false_track_key}
    return (
        numbers | keys | {"share": field.share, "threshold": of.score_thresholds, "manoeuvre": of.manoeuvre[0].copy()}
    )


def tracker(library, pool, n: int, pairs: int) -> str:
    """A line on each tracker among false plots."""
    return "\n".join(one_tracker(library, pool, n // 5, pairs, name) for name in sonar_clutter.CASES)


def one_tracker(library, pool, n: int, pairs: int, name: str) -> str:
    """A line on one tracker."""
    made, scans = sonar.work(sonar_clutter.config(*sonar_clutter.CASES[name]), 1)
    given, alone, n = world_of_tracks(made.plan), tracker_of(made.plan), n - n % made.block
    world, own = limits.structure(given), limits.structure(alone)
    theirs = {
        **{"sums": np.zeros((1, scans, 2, SUMS)), "counts": np.zeros((1, scans, COUNTS))},
        **{"begun": np.zeros((1, scans, FALSE_COUNTS)), "ratios": np.zeros((1, RATIOS, 5))},
        "scores": np.zeros((2, 1, alone["levels"] + 1)),
    }

    def limit():
        for array in theirs.values():
            array[:] = 0.0
        to = [ctypes.c_void_p(array.ctypes.data) for array in theirs.values()]
        library.tracked(ctypes.byref(world), ctypes.byref(own), ctypes.c_uint64(0), n, *to)

    found, mine, least, ratio = timed(made, pool, limit, n, pairs)
    tracks = n * scans + found["begun"][0, :, : FALSE_CONFIRMED + 1].sum()
    # Whole numbers, but for the expected number of false plots and for weights, which ratios sum.
    same = all(np.allclose(found[of], theirs[of], rtol=1e-10, atol=0) for of in ("counts", "begun", "ratios", "scores"))
    apart = filters_apart(found, theirs["sums"], TRACKED)
    mine, least = mine / tracks * 1e9, least / tracks * 1e9
    return (
        f"tracker, {name}: {mine:.0f} ns a track-scan, C {least:.0f} ns, {ratio:.2f} of C; "
        f"counts {'equal' if same else 'DIFFER'}, sums apart by {apart}"
    )


def timed(made, pool, limit, n: int, pairs: int) -> tuple[dict, float, float, float]:
    """The kernel's sums by name, its CPU seconds, the limit's, and their ratio."""
    ours = [None]

    def kernel():
        ours[0] = sum(made.simulate(first, made.block) for first in range(0, n, made.block))

    pool.submit(kernel).result()
    times = pool.submit(limits.paired, kernel, limit, pairs).result()
    return made.plan.layout.unpack(ours[0]), *times


def filters_apart(found: dict, theirs: np.ndarray, places: dict[str, slice] = PLACES) -> str:
    """How far the sums of filters are apart, the largest over scans of each kind being one."""
    apart = 0.0
    for name, place in places.items():
        here = found[name].reshape((*theirs.shape[:3], -1))
        there = theirs[..., place][..., : here.shape[-1]]
        scale = np.abs(here).max(axis=(0, 1), keepdims=True)
        apart = max(apart, float((np.abs(here - there) / np.where(scale > 0, scale, 1)).max()))
    return f"{apart:.0e}"


def main() -> None:
    """Time all and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-n", type=int, default=40960)
    parser.add_argument("--pairs", type=int, default=9)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder, ThreadPoolExecutor(1) as pool:
        library = limits.library(Path(__file__).with_suffix(".c"), folder)
        for measure in (own_misses, detectors, tracker):
            print(measure(library, pool, given.n, given.pairs))


if __name__ == "__main__":
    main()

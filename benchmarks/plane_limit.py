"""The plane's kernels against hand-written C (plane_limit.c), one core, CPU time, as a ratio in one run.

    python benchmarks/plane_limit.py [-n 512] [--pairs 9]

An extended filter with Doppler, and PDA with three false plots in its gate, over given plots: estimates, covariances,
NEES and all sums. How far the sums of both are apart is printed, and how long plots take to draw, which C does not.
"""

import argparse
import ctypes
import math
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import limits
import numpy as np

from radarsim.api.configs import load
from radarsim.kernels.compiler import aligned_zeros
from radarsim.kernels.lanes import WIDTH
from radarsim.studies.plane import design, expected_plot
from radarsim.studies.registry import study
from radarsim.studies.step_plots import draw_plots

RADAR = {
    "wavelength_m": 0.1,
    "sigma_range_m": 50,
    "sigma_bearing_deg": 0.3,
    "sigma_velocity_mps": 2,
    "scan_period_s": 5,
}
CLUTTER = {"repetition_rate_hz": 2e3, "false_plots_from_s": 50}
CASES = {"extended, Doppler": 0.0, "PDA, Doppler, 0.3 false plots in the gate": 0.3, "PDA, Doppler, 3 in the gate": 3.0}
SCANS = 40


def case_of(density: float):
    """The case with one filter, among so many false plots per km² if any."""
    one = {"name": "one", "kind": "extended", "doppler": True, "sigma_acceleration_mps2": 2}
    radar = RADAR | (CLUTTER | {"false_plots_per_km2": density} if density else {})
    target = {"kind": "straight", "range_m": 60e3, "speed_mps": 250, "aspect_deg": 150}
    filters = [one | ({"association": "pda"} if density else {})]
    keys = {"study": "plane", "radar": radar, "target": target, "filters": filters, "scans": SCANS, "seed": 1}
    return load(keys | {"realisations": 1}).cases[0]


def density_of(in_gate: float) -> float:
    """The density, per km², with which the gate of accurate tracks holds so many false plots at the last scan."""
    plane, spec = study("plane"), case_of(1e-3).spec
    *_, (before, c), _ = plane.typical_states(spec, spec.filters[0])
    steps = plane.kinds["extended"]
    mean, S, _ = expected_plot(steps.predict(before, RADAR["scan_period_s"], (), c)[0], c)
    matrix = np.zeros((3, 3))
    matrix[np.triu_indices(3)] = S
    matrix = np.triu(matrix) + np.triu(matrix, 1).T
    volume = 4 / 3 * math.pi * math.sqrt(c.gate**3 * np.linalg.det(matrix))
    return 1e6 * in_gate * c.span / (mean[0] * volume)


def world_of(plan, plots, groups: int, n: int) -> dict:
    """The members of the C structure World."""
    spec, (keys,) = plan.case.spec, plan.case.spec.filters
    c, radar = design(spec, keys), spec.radar
    numbers = {"groups": groups, "count": n, "scans": SCANS, "rows": plan.scene.plot_rows, "places": plan.scene.false}
    numbers |= {"dt": radar.scan_period_s, "noise": c.noise[0], "start": c.start[0], "span": c.span}
    numbers |= {"density": c.density, "gate": c.gate, "missed": c.missed, "clear": c.clear}
    sigma = dict(zip(("sigma_r", "sigma_b", "sigma_v"), map(float, c.sigma), strict=True))
    window = np.ascontiguousarray(plan.known_quantities.reshape(SCANS, -1)[:, 1])
    return numbers | sigma | {"plots": plots, "window": window}


def measure(library, pool, name: str, in_gate: float, n: int, pairs: int) -> str:
    """A line on one case."""
    plane, case = study("plane"), case_of(density_of(in_gate) if in_gate else 0.0)
    plan = plane.prepare(case)
    groups, (member,) = n // WIDTH, plan.filters
    plots = draw_plots(plan, 0, groups)
    errors, work = aligned_zeros(groups * SCANS * 5 * WIDTH), aligned_zeros(member.rows * WIDTH)
    shapes = {
        "error": (SCANS, 4, 4),
        "paired": (SCANS, 4),
        "believed": (SCANS, 4),
        "nees": (SCANS, 2),
        "counts": (SCANS, 3),
    }
    ours, theirs = ({of: np.zeros(shape) for of, shape in shapes.items()} for _ in range(2))
    ours["both"] = np.zeros((SCANS, 4, 5))  # over the tracks that two filters keep, which a lone filter of C has not
    given = world_of(plan, plots, groups, n)
    world, to = limits.structure(given), limits.structure(theirs)

    def kernel():
        for sums in ours.values():
            sums[:] = 0.0
        filter_arguments = groups, n, plan.known_quantities, plan.width, member.numbers, plots, work, errors, errors
        member.kernel(*filter_arguments, *ours.values())

    def limit():
        for sums in theirs.values():
            sums[:] = 0.0
        library.follow(ctypes.byref(world), ctypes.byref(to))

    pool.submit(kernel).result()
    own, least, ratio = pool.submit(limits.paired, kernel, limit, pairs).result()
    started, each = time.process_time(), 1e9 / n / SCANS
    for first in range(0, n, WIDTH):
        draw_plots(plan, first, 1)
    drawing = time.process_time() - started
    apart = max(float(np.abs(ours[of] - theirs[of]).max() / np.abs(ours[of]).max()) for of in shapes if ours[of].any())
    return (
        f"{name} ({plan.scene.false} places): {own * each:.0f} ns a scan, C {least * each:.0f} ns, {ratio:.2f} of C; "
        f"drawing {drawing * each:.0f} ns; sums apart by {apart:.0e}"
    )


def main() -> None:
    """Time all and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-n", type=int, default=512)
    parser.add_argument("--pairs", type=int, default=9)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder, ThreadPoolExecutor(1) as pool:
        library = limits.library(Path(__file__).with_suffix(".c"), folder)
        for name, in_gate in CASES.items():
            print(measure(library, pool, name, in_gate, given.n, given.pairs), flush=True)


if __name__ == "__main__":
    main()

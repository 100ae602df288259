"""The plots of many realisations as arrays, against the drawing of a run alone: one core, CPU time.

    python benchmarks/plots.py [--pairs 9]

Drawing alone: the functions by which a run draws truth and plots, over its work arrays, nothing kept. The plots are
those of `radarsim.plots` in chunks, of a case that is prepared. A ratio, how much of drawing's speed is left, is the
median over pairs timed one after the other. Of sonar_clutter a run draws only what is near its gates, so that nothing
stands beside the plots of the whole sector. Last, `radarsim.plots("rls2", 100_000)` as called, and how far the plots'
σ is from the stated one, in standard errors.
"""

import argparse
import statistics
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import numpy as np

import radarsim
from radarsim.api.configs import load
from radarsim.kernels import random, second_order
from radarsim.kernels.compiler import aligned_zeros, kernel
from radarsim.kernels.lanes import WIDTH, rows
from radarsim.studies import registry
from radarsim.studies.ambiguous_doppler.kernels import layout
from radarsim.studies.ambiguous_doppler.kernels.plots import fill_normals, put_plots
from radarsim.studies.multimodel.kernels import layout as kernels_layout
from radarsim.studies.multimodel.kernels import plots as kernels_plots
from radarsim.studies.range_doppler.kernels import missed_block, missed_draws, missed_steps
from radarsim.studies.sonar import kernel_inputs
from radarsim.studies.sonar.kernels.plots import detect
from radarsim.studies.sonar.kernels.shared_gains import CHUNK
from radarsim.studies.sonar.kernels.world import move_and_measure
from radarsim.studies.sonar.scene import build_scene

CASES = {  # config, overrides, realisations, realisations in a chunk
    "rls2": ((), 200_000, 10_000),
    "rls2, 0.9 of the plots": (("radar.detection_probability=0.9",), 200_000, 10_000),
    "ambiguous_rls2": ((), 200_000, 10_000),
    "multimodel": ((), 640, 64),
    "sonar_missed": (("sweep.sensor.detection_probability=[0.7]",), 100_000, 10_000),
    "sonar_clutter": (("sweep.sensor.false_plots_per_km2=[1]",), 2_000, 1_000),
}


@kernel
def draw_plain(x, count, key, truth, sigma):
    next_word = np.empty(second_order.CHUNK, np.uint64)
    for first in range(0, count, second_order.CHUNK):
        for k in range(truth.shape[0]):
            second_order.fill_plots(key, first, k, truth[k], sigma[k], next_word, x[0], x[1])


@kernel
def draw_missed(made, count, problem):
    keys, truth, sigma, detection = problem.keys, problem.truth, problem.sigma, problem.detection
    at, next_word = missed_steps.addresses(made), np.empty(missed_steps.CHUNK, np.uint64)
    for first in range(0, count, missed_steps.CHUNK):
        missed_block.begin_chunk(keys, first, made, problem.bias, problem.sigma_bias, problem.sigma_flight)
        for k in range(truth.shape[0]):
            second_order.fill_plots(keys[0], first, k, truth[k], sigma, next_word, made.plots[0], made.plots[1])
            if k % 2 == 0:
                random.fill_uniform_pairs(keys[1], first, k // 2, made.detected, made.other)
            missed_draws.count_plots(at, k, detection, missed_steps.CHUNK)


@kernel
def draw_folded(normals, plots, count, world):
    for first in range(0, count, WIDTH):
        fill_normals(world, first, normals)
        put_plots(world, first, normals, plots)


@kernel
def draw_sonar(room, detected, count, world, detections):
    for first in range(0, count, detected.size):
        for k in range(world.truth.shape[0]):
            move_and_measure(world, first, k, room)
            detect(detections, first, k, detected)


def drawing_alone(name: str, case: object, count: int) -> Callable[[], object] | None:
    """What a run draws of so many realisations."""
    plan = registry.study(case.study).prepare(case)
    if name.startswith("sonar"):
        scene = build_scene(case)
        world, detections = kernel_inputs.kernel_world(case, scene), kernel_inputs.kernel_detections(case, scene)
        room, detected = np.zeros((world.fresh.shape[1], 4, CHUNK)), np.empty(CHUNK)
        return None if "clutter" in name else lambda: draw_sonar(room, detected, count, world, detections)
    if name == "multimodel":
        world, random = plan.world, rows(kernels_plots.RANDOM)
        of = world.keys, world.frame, world.plot_truth, kernels_layout.START
        plots = rows(len(world.truth) * kernels_layout.PLOT)
        return lambda: [kernels_plots.fill_plots(*of, first, random, plots) for first in range(0, count, WIDTH)]
    if name == "ambiguous_rls2":
        scans = len(plan.world.t)
        normals, plots = rows(2 + 2 * scans), rows(scans * layout.PLOT)
        return lambda: draw_folded(normals, plots, count, plan.world)
    problem = plan.problem.plain()
    if isinstance(problem, missed_block.Problem):
        made = missed_steps.make_workspace(1)
        return lambda: draw_missed(made, count, problem)
    x = aligned_zeros(2, second_order.CHUNK)
    return lambda: draw_plain(x, count, problem.key, problem.truth, problem.sigma)


def seconds(act: Callable[[], object]) -> float:
    """CPU seconds of a call in this thread."""
    started = time.thread_time()
    act()
    return time.thread_time() - started


def measure(pairs: int) -> None:
    """Time all and print."""
    for name, (overrides, count, chunk) in CASES.items():
        case = load(name.split(",")[0], overrides).cases[0]
        plots = registry.study(case.study).recording_interface()

        def ours(plots=plots, case=case, count=count, chunk=chunk) -> None:
            for first in range(0, count, chunk):
                plots.draw_plots(case, first, chunk)

        alone = drawing_alone(name, case, count)
        acts = [ours] if alone is None else [alone, ours]
        times = [[seconds(act) for act in acts] for _ in range(pairs + 1)][1:]
        own = statistics.median(one[-1] for one in times) / count
        left = "" if alone is None else f", {statistics.median(a / b for a, b in times):.2f} of drawing's speed"
        print(f"{name:24s} {own * 1e9:10,.0f} ns a realisation{left}")
    called = statistics.median(seconds(lambda: radarsim.plots("rls2", 100_000)) for _ in range(pairs))
    made = radarsim.plots("rls2", 100_000)
    error = made.columns["range_m"] - made.truth[..., 0]
    off = (error.std() / 250 - 1) * np.sqrt(2 * error.size)
    print(
        f'plots("rls2", 100_000)   {called * 1e3:10.1f} ms of CPU; σ of the ranges is off by {off:+.2f} standard errors'
    )


def main() -> None:
    """In a pool thread, as kernels run."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--pairs", type=int, default=9)
    with ThreadPoolExecutor(1) as pool:
        pool.submit(measure, parser.parse_args().pairs).result()


if __name__ == "__main__":
    main()

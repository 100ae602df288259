"""The kernels' inputs of a case, the plots that they draw, and the designs of its filters."""

from collections.abc import Sequence

import numpy as np

from radarsim.config.experiment import Case
from radarsim.studies.noise import noise_key
from radarsim.studies.sonar import filter_design
from radarsim.studies.sonar.kernels import plots as kernels_plots
from radarsim.studies.sonar.kernels import world
from radarsim.studies.sonar.plot_errors import step_correlations
from radarsim.studies.sonar.scene import Scene

FRAMES = ("polar", "cartesian", "cartesian_unbiased")


def kernel_world(case: Case, scene: Scene) -> world.World:
    """The kernels' world; its coordinates are padded to an even number."""
    K, C = scene.sigma.shape
    wide = C + C % 2
    fresh, truth, walk, steps = np.zeros((K, wide)), np.zeros((K, wide, 3)), np.zeros(wide), np.zeros((K, wide))
    for c in range(C):
        steps[:, c] = step_correlations(scene.rho[c], scene.t, scene.period)
    sigma = np.where(np.isfinite(scene.sigma), scene.sigma, 0.0)
    fresh[:, :C], truth[:, :C], walk[:C] = sigma * np.sqrt(1 - steps[:, :C] ** 2), scene.truth, scene.walk
    dt = np.diff(scene.t, prepend=scene.t[0])
    return world.World(noise_key(case, "plots"), noise_key(case, "motion"), dt, truth, steps, fresh, walk)


def kernel_detections(case: Case, scene: Scene) -> kernels_plots.Detections:
    """Which scans give a plot."""
    return kernels_plots.Detections(noise_key(case, "misses"), scene.certain, scene.probability)


def kernel_conversion(case: Case, scene: Scene) -> kernels_plots.Conversion:
    """How plots are converted to the frame of the filters."""
    return kernels_plots.Conversion(
        weight=(scene.nominal / scene.sigma) ** 2,
        frame=FRAMES.index(case.spec.frame),
        measured=np.ascontiguousarray(scene.polar[:, :2, 0]),
        spread=scene.sigma[0, :2].copy(),
    )


def designs(
    specs: Sequence[filter_design.FilterSpec], scene: Scene, detected: np.ndarray
) -> list[list[filter_design.FilterDesign]]:
    """The designs of each filter in each coordinate, for patterns detected (M, K') of plots.

    A filter that responds to manoeuvres has no design, because its gains depend on the plots."""
    return [
        [filter_design.design_filter(spec, c, scene.plots(c, detected)) for c in range(len(scene.nominal))]
        if spec.response is None
        else []
        for spec in specs
    ]


def draw_plots(
    world: world.World, detections: kernels_plots.Detections, first: int, count: int, source_row: int = 0
) -> tuple[np.ndarray, np.ndarray]:
    """Draw the plots (C, count, K) of realisations first … first + count - 1, or their errors (source_row 1).

    NaN where a scan gives no plot. Also returns the deviation of the target's value and rate (C, 2, count, K), or
    (C, 2, 1, 1) if no target moves at random. C is the world's padded number of coordinates."""
    K, C = world.fresh.shape
    plots, deviation = np.empty((C, K, count)), np.zeros((C, 2, K, count) if world.walk.any() else (C, 2, 1, 1))
    kernels_plots.fill_plots(world, detections, first, source_row, plots, deviation)
    return plots.swapaxes(1, 2), deviation.swapaxes(2, 3)


def true_states(scene: Scene, deviation: np.ndarray, count: int, size: int) -> np.ndarray:
    """True states (count, K, C size), with size components of each coordinate, by a deviation from `draw_plots`.

    A read-only view if all realisations have the same states."""
    K, C, _ = scene.truth.shape
    true = scene.truth[..., :size].reshape(K, -1)
    if deviation.shape[-1] == 1:
        return np.broadcast_to(true, (count, K, C * size))
    states = np.empty((C * size, K, count))
    states[:] = true.T[..., None]
    states.reshape(C, size, K, count)[:, :2] += deviation[:C].swapaxes(2, 3)
    return states.transpose(2, 1, 0)

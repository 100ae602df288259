"""The plots of one realisation in the sector: the target's and the false ones."""

import numpy as np

from radarsim.studies.sonar import kernel_inputs
from radarsim.studies.sonar.clutter.kernels import false_plots as kernels_false_plots
from radarsim.studies.sonar.kernels import plots, world


def target_plots(world: world.World, detections: plots.Detections, realisation: int) -> tuple[np.ndarray, np.ndarray]:
    """Plots (K, 2) of the target in one realisation, NaN where missed, and its true positions (K, 2)."""
    plots, deviation = kernel_inputs.draw_plots(world, detections, realisation, 1)
    return plots[:, 0].T, world.truth[..., 0] + deviation[:, 0, 0].T


def sector_plots(
    field: kernels_false_plots.Field, first: int, target_positions: np.ndarray, scan: int = 0
) -> np.ndarray:
    """All plots (3, n, K, M) in the sector, of realisations from `first` on and scans from `scan` on.

    In the order of `false_plots.fill_scans`; target_positions (2, n, K) are the target's plots, NaN for none."""
    cells, has_target = field.cells, np.isfinite(target_positions[0])
    expected = cells.density * cells.dq * cells.nq * cells.db * cells.nb
    capacity, needed = 0, int(expected + 6 * np.sqrt(expected) + 5)
    while needed > capacity:
        capacity, plots = needed, np.empty((*has_target.shape, 3, needed))
        needed = kernels_false_plots.fill_scans(field, first, scan, target_positions, has_target, plots)
    return plots[..., : max(needed, 1)].transpose(2, 0, 1, 3)


def false_plots(field: kernels_false_plots.Field, realisation: int, scan: int) -> np.ndarray:
    """All false plots (2, n) of a scan, range and bearing."""
    plots = sector_plots(field, realisation, np.full((2, 1, 1), np.nan), scan)[:2, 0, 0]
    return plots[:, np.isfinite(plots[0])]

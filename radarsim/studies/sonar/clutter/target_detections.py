"""Which scans give a plot of the target among false plots: only those in which it is within the surveyed sector."""

import numpy as np

from radarsim.config.experiment import Case
from radarsim.studies.noise import noise_key
from radarsim.studies.sonar.kernels.plots import Detections
from radarsim.studies.sonar.scene import Scene
from radarsim.studies.sonar.sensor_keys import Sector


def detected_plots(case: Case, scene: Scene) -> Detections:
    """Which scans give a plot of the target."""
    open_scans = np.where(scene.certain == 0, 0, 1 if scene.probability == 1 else -1)  # the first one too
    certain = np.where(is_within_sector(case.spec.sensor.sector, scene), open_scans, 0)
    return Detections(noise_key(case, "misses"), certain, scene.probability)


def is_within_sector(sector: Sector, scene: Scene) -> np.ndarray:
    """Whether the target is within the sector at each scan (K,)."""
    (near, far), (first, last) = sector.range_m, sector.bearing_rad
    r, b = scene.polar[:, 0, 0], scene.polar[:, 1, 0]
    return (near <= r) & (r <= far) & (first + np.mod(b - first, 2 * np.pi) <= last)

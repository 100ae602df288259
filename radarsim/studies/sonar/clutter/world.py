"""What trackers among false plots observe of the target: which scans give its plot, within the surveyed sector."""

import numpy as np

from radarsim.config.experiment import Case
from radarsim.studies.noise import noise_key
from radarsim.studies.sonar.kernels.patterns import Observation
from radarsim.studies.sonar.scene import Scene


def certain_detections(spec, seen: Scene) -> np.ndarray:
    """Which scans give a plot of the target (K,): 0 never (missed, or outside the sector), 1 always, else -1."""
    sensor = spec.sensor
    certain = np.where(seen.certain == 0, 0, 1 if sensor.detection_probability == 1 else -1)
    (near, far), (first, last) = sensor.sector.range_m, sensor.sector.bearing_rad
    r, b = seen.polar[:, 0, 0], seen.polar[:, 1, 0]
    turned = first + np.mod(b - first, 2 * np.pi)
    return np.where((near <= r) & (r <= far) & (turned <= last), certain, 0)


def observation_of(case: Case, seen: Scene) -> Observation:
    """When the target's plots come."""
    return Observation(
        misses=noise_key(case, "misses"),
        certain=certain_detections(case.spec, seen),
        probability=seen.probability,
        weight=np.ones((len(seen.t), 2)),
        period=seen.period,
        sigma=seen.nominal,
        frame=0,
        measured=np.ascontiguousarray(seen.polar[:, :2, 0]),
        spread=seen.sigma[0, :2].copy(),
    )

"""Labels and exact laws of the sums of trackers among false plots."""

from dataclasses import dataclass

import numpy as np

from radarsim.studies.sonar.axes import SonarAxes
from radarsim.studies.sonar.clutter.kernels.field import Field
from radarsim.studies.sonar.kernels.patterns import Detections
from radarsim.studies.sonar.kernels.shared_gains import World


@dataclass(frozen=True, kw_only=True)
class ClutterAxes(SonarAxes):
    """Labels and exact laws of F trackers, and the arrays that both the kernels and a map of one realisation read.

    Attributes:
        associations: how each filter chooses its plots: nearest, pda or known.
        thresholds: (T,) thresholds of a track's score, in natural logarithms.
        exact_confirmed: (F, K) probability that a track of the target was confirmed by each scan; NaN where no law is
            known.
        exact_begun: (F, K) probability that a track begun by a false plot is confirmed at each scan; NaN likewise.
        area_m2: area of the surveyed sector, m².
        world: the target and its plots.
        detections: which scans give a plot of the target.
        field: the false plots among which the target is tracked.
    """

    associations: tuple[str, ...]
    thresholds: np.ndarray
    exact_confirmed: np.ndarray
    exact_begun: np.ndarray
    area_m2: float
    world: World
    detections: Detections
    field: Field

"""Labels and exact laws of the sums of trackers among false plots."""

from dataclasses import dataclass

import numpy as np

from radarsim.studies.sonar.axes import SonarAxes
from radarsim.studies.sonar.clutter.kernels.false_plots import Field
from radarsim.studies.sonar.kernels.plots import Detections
from radarsim.studies.sonar.kernels.world import World


@dataclass(frozen=True, kw_only=True)
class ClutterAxes(SonarAxes):
    """Labels and exact laws of F trackers, and the arrays that both the kernels and a map of one realisation read."""

    associations: tuple[str, ...]  #: how each filter chooses its plots: nearest, pda or known.
    thresholds: np.ndarray  #: (T,) thresholds of a track's score, in natural logarithms.
    #: (F, K) probability that a track of the target was confirmed by each scan; NaN where no law is known.
    exact_confirmed: np.ndarray
    #: (F, K) probability that a track begun by a false plot is confirmed at each scan; NaN likewise.
    exact_begun: np.ndarray
    area_m2: float  #: area of the surveyed sector, m².
    world: World  #: the target and its plots.
    detections: Detections  #: which scans give a plot of the target.
    field: Field  #: the false plots among which the target is tracked.

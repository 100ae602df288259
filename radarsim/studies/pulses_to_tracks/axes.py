"""Labels of the study's sums, with the exact values."""

from dataclasses import dataclass

import numpy as np

from radarsim.engine.results import Axes


@dataclass(frozen=True, kw_only=True)
class PulsesAxes(Axes):
    """Labels of the sums, F filters over K scans, components r, Vr, ar."""

    #: (F, K, 2) Cramér–Rao bounds of the burst's velocity (m/s) and acceleration (m/s²); not-a-number where not taken
    bound: np.ndarray
    takes: np.ndarray  #: (F,) the number of these that a filter takes
    energy_db: np.ndarray  #: (K,) energy of the burst over the noise's density, dB
    ideal: np.ndarray  #: (F,) number of each filter's idealisation; −1: the case has none
    lost_squares: np.ndarray  #: (F, K, 3) mean squares that lost bursts add to the errors if all are lost
    max_loss_probability: np.ndarray  #: (F,) an upper bound of the probability that a burst is lost

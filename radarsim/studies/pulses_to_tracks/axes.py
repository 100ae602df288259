"""Labels of the study's sums, and the exact values that go with them."""

from dataclasses import dataclass

import numpy as np

from radarsim.engine.results import Axes


@dataclass(frozen=True, kw_only=True)
class PulsesAxes(Axes):
    """Labels of the sums, F filters over K scans, components r, Vr, ar.

    bound (F, K, 2) are the Fisher bounds of the burst's velocity (m/s) and acceleration (m/s²), takes (F,) how many of
    these a filter takes, not-a-number where it takes none. energy_db (K,) is the energy of the burst over the noise's
    density, dB. ideal (F,) is the number of each filter's idealisation, −1 where the case has none. losses (F, K, 3) is
    what lost bursts add to the mean squares of the errors if all are lost, most_lost (F,) a bound on how many are.
    """

    bound: np.ndarray
    takes: np.ndarray
    energy_db: np.ndarray
    ideal: np.ndarray
    losses: np.ndarray
    most_lost: np.ndarray

"""Labels and exact laws of the sums of a case about manoeuvres: detectors, responding filters, uses of a track."""

from dataclasses import dataclass

import numpy as np

from radarsim.studies.sonar.axes import GivenPlotsAxes


@dataclass(frozen=True, kw_only=True)
class UsesAxes:
    """True values of the quantities derived from a track, at A times.

    Attributes:
        at: (A,) scans, counted from 0.
        true: (A, 6) true values of `uses.QUANTITIES`.
        closing_mps: (A,) speed of the target relative to the own ship, m/s.
    """

    at: np.ndarray
    true: np.ndarray
    closing_mps: np.ndarray


@dataclass(frozen=True, kw_only=True)
class ManoeuvreAxes(GivenPlotsAxes):
    """Labels and exact laws of D measured detectors, on G groups: each coordinate, then all of them jointly.

    Attributes:
        exact_alarms: (D, G, T, K) probability of an alarm at a test; NaN where no law is known.
        shifts: (D, G, K) mean of the estimated acceleration in units of its σ; NaN likewise.
        thresholds: (G, T) thresholds of each detector.
        independent: whether each detector's tests are independent of one another.
        phase: (K,) 0 before the manoeuvre, 1 during it, 2 after it.
        manoeuvre_s: start and end of the manoeuvre, s from the first plot; None without one.
        uses: the quantities derived from a track; None where the config does not ask for them.
    """

    exact_alarms: np.ndarray
    shifts: np.ndarray
    thresholds: tuple[np.ndarray, ...]
    independent: tuple[bool, ...]
    phase: np.ndarray
    manoeuvre_s: tuple[float, float] | None
    uses: UsesAxes | None

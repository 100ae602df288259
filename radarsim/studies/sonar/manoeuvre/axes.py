"""Labels and exact laws of the sums of a case about manoeuvres."""

from dataclasses import dataclass

import numpy as np

from radarsim.studies.sonar.axes import GivenPlotsAxes


@dataclass(frozen=True, kw_only=True)
class UsesAxes:
    """True values of the quantities derived from a track, at A times."""

    scans: np.ndarray  #: (A,) scans, counted from 0.
    true: np.ndarray  #: (A, 6) true values of `QUANTITIES`.
    closing_mps: np.ndarray  #: (A,) speed of the target relative to the own ship, m/s.


@dataclass(frozen=True, kw_only=True)
class ManoeuvreAxes(GivenPlotsAxes):
    """Labels and exact laws of D measured detectors, on G groups: each coordinate, then all of them jointly."""

    exact_alarms: np.ndarray  #: (D, G, T, K) probability of an alarm at a test; NaN where no law is known.
    shifts: np.ndarray  #: (D, G, K) mean of the estimated acceleration in units of its σ; NaN likewise.
    thresholds: tuple[np.ndarray, ...]  #: (G, T) thresholds of each detector.
    independent: tuple[bool, ...]  #: whether each detector's tests are independent of one another.
    phase: np.ndarray  #: (K,) 0 before the manoeuvre, 1 during it, 2 after it.
    manoeuvre_s: tuple[float, float] | None  #: start and end of the manoeuvre, s from the first plot; None without one.
    uses: UsesAxes | None  #: the quantities derived from a track; None where the config does not ask for them.

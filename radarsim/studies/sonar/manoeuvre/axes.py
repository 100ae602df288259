"""What the sums of a case with detectors of manoeuvres, filters that respond to them, or uses of a track are of."""

from dataclasses import dataclass

import numpy as np

from radarsim.studies.sonar.axes import GivenPlotsAxes


@dataclass(frozen=True, kw_only=True)
class UsesAxes:
    """Of what a track is used for, at A moments.

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
        exact_alarms: (D, G, T, K) probability of an alarm at a test; not-a-number where no law is known.
        shifts: (D, G, K) mean of the estimated acceleration in units of its σ, likewise.
        thresholds: (G, T) thresholds of each detector.
        independent: whether each detector's tests are independent of one another.
        phase: (K,) 0 before the manoeuvre, 1 while it lasts, 2 after it.
        manoeuvre_s: when the manoeuvre begins and ends, s from the first plot; None without one.
        uses: of what the track is used for; None where that is not asked.
    """

    exact_alarms: np.ndarray
    shifts: np.ndarray
    thresholds: tuple[np.ndarray, ...]
    independent: tuple[bool, ...]
    phase: np.ndarray
    manoeuvre_s: tuple[float, float] | None
    uses: UsesAxes | None

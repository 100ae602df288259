"""The paper's filter with its gains frozen from a scan on: what a tracker does that has no time for covariances."""

from typing import Literal

import numpy as np

from radarsim.studies.authoring import Positive, key, process_noise, whole_number
from radarsim.studies.range_doppler.package_filters import GivenGains, Scans


class Frozen(GivenGains):
    """A second-order Kalman filter whose gains stay as they are at a scan."""

    kind: Literal["frozen"] = key("kind", "a Kalman filter whose gains are frozen from a scan on")
    manoeuvre_variance: Positive = key(
        "manoeuvre variance", "variance of the random jerk it allows for, (m/s³)²", symbol="D_M", unit="(m/s³)²"
    )
    freeze_after: whole_number(1, 100_000) = key(
        "last scan with a gain of its own", "scan whose gain all later ones have"
    )

    def noise(self, dt_s: float) -> np.ndarray:
        return process_noise("random_jerk", self.manoeuvre_variance, dt_s)

    def gains(self, scans: Scans) -> np.ndarray:
        gains = scans.kalman(self.noise)
        last = max(self.freeze_after, scans.start + 1)  # the first scan after the start has a gain
        gains[last:] = gains[last - 1 : last]
        return gains

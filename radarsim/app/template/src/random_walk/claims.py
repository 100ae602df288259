"""What the paper claims, as data. Yours: a claim for each statement that a run can judge.

A claim says where the paper says what, how it was read, and in parts what is measured and which values its words leave.
Write the ranges down from the words alone, before anything is measured.
"""

import math

from radarsim.report import claims
from radarsim.report.claims import Claim, Part, above
from radarsim.report.statistics import Estimate

SIGMA, STEP, GAIN = 1.0, 0.5, 0.2  # the paper's sensor, walk and fixed gain


class Evidence(claims.Evidence):
    """Finds the paper's case by what it is, so that a config with other numbers judges nothing."""

    def case(self, key):
        """key: "walk", the only case of the paper. Raises Missing where the experiment does not hold it."""
        for result in self.results:
            spec = result.spec
            kinds = [(one.kind, one.gain) for one in spec.filters]
            same = math.isclose(spec.sensor.sigma_x_m, SIGMA) and math.isclose(spec.target.sigma_step_m, STEP)
            if same and kinds == [("fixed_gain", GAIN), ("kalman", None)] and result.axes.baseline == 0:
                return result
        raise claims.Missing(key)


def last_gain(seen: Evidence) -> Estimate:
    """The Kalman filter's gain in σ at the last scan, %."""
    series = seen.gain("walk", seen.case("walk").axes.filters[1], "x")
    return series.point(len(series.k) - 1)


CLAIMS = (
    Claim(
        id="random_walk.1",  # the part before the point is the paper's key
        place="section 1",
        statement="The Kalman filter's error is more than 10 % below that of the fixed gain",
        parts=(Part(("walk",), "gain in σ at the last scan", "%", last_gain, above(10)),),
        reading="of the root-mean-square error at the last scan",
        config="random_walk",  # the shipped config that judges it
    ),
)

"""What the paper claims, as data. Yours: a claim for each statement that a run can judge.

A claim says where the paper says what, how it was read, and in parts what is measured and which values its words leave.
Write the ranges down from the words alone, before anything is measured.
"""

from radarsim.engine.results import CaseResult
from radarsim.report import claims
from radarsim.report.claims import Claim, Part, above
from radarsim.report.statistics import Estimate


class Evidence(claims.Evidence):
    """What the paper's experiment measured: only cases whose keys are those of the claim's config are seen here."""

    def case(self, key: object) -> CaseResult:
        """Yours: the case that a key means, as `Part.cases` has them. Here the paper has but one."""
        for result in self.results:
            return result
        raise claims.Missing(key)


def last_gain(seen: Evidence) -> Estimate:
    """The Kalman filter's gain in σ at the last scan, %."""
    kalman = next(one.name for one in seen.case("walk").spec.filters if one.kind == "kalman")
    series = seen.gain("walk", kalman, "x")
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

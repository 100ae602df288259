"""What is measured for the claims. Yours: a function for each `measure` of claims.yaml."""

from radarsim.engine.results import CaseResult
from radarsim.report import claims
from radarsim.report.statistics import Estimate


class Evidence(claims.Evidence):
    """What the paper's experiment measured: only cases whose keys are those of the claim's config are seen here."""

    def case(self, key: object) -> CaseResult:
        """Yours: the case that a key means, as `of` has them. Here the paper has but one."""
        for result in self.results:
            return result
        raise claims.Missing(key)


def last_gain(seen: Evidence, case: str) -> Estimate:
    """The Kalman filter's gain in σ at the last scan, %."""
    kalman = next(one.name for one in seen.case(case).spec.filters if one.kind == "kalman")
    series = seen.gain(case, kalman, "x")
    return series.point(len(series.k) - 1)

"""The quantities measured for the claims. Yours: a function for each `measure` of claims.yaml."""

from radarsim.engine.results import CaseResult
from radarsim.papers import evidence
from radarsim.papers.evidence import MissingEvidence
from radarsim.report.statistics import Estimate


class Evidence(evidence.Evidence):
    """Results of the paper's experiment: only cases with the keys of the claims' config are visible here."""

    def case(self, key: object) -> CaseResult:
        """Yours: the case that a key under `of` means. Here the paper has only one."""
        for result in self.results:
            return result
        raise MissingEvidence(key)


def last_gain(seen: Evidence, case: str) -> Estimate:
    """The Kalman filter's gain in σ at the last scan, %."""
    kalman = next(one.name for one in seen.case(case).spec.filters if one.kind == "kalman")
    series = seen.gain(case, kalman, "x")
    return series.point(len(series.k) - 1)

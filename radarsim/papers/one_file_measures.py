"""Measures of claims of a study in one file, whose evidence finds a case by its keys.

A claim says `of: [{radar.scan_period_s: 2}]`: the case with these keys, or properties, by their dotted names; `of:
[{}]` is the first one. The functions here whose first argument is `evidence` may be its `measure`; `at` is a scan, by
default the last one."""

import math
from collections.abc import Mapping, Sequence
from operator import attrgetter
from typing import Any, Literal

import numpy as np

from radarsim.engine.results import CaseResult
from radarsim.errors import ConfigError
from radarsim.papers.evidence import Curve, MissingEvidence, shipped_spec
from radarsim.papers.evidence import Evidence as GeneralEvidence
from radarsim.report.run_statistics import STATISTICS, mean_of_runs
from radarsim.report.statistics import Estimate, difference, mean
from radarsim.report.tables import realisation_counts

NO_SUCH_KEY = object()
RELATIVE_TOLERANCE = 1e-9  # relative difference of one number written in two ways


class Evidence(GeneralEvidence):
    """Results of the paper's experiment; a case is identified by a mapping of its keys, or by its name."""

    def case(self, key: Any) -> CaseResult:
        if not isinstance(key, Mapping):
            return super().case(key)
        if unknown := unknown_key(key, [shipped_spec(result) for result in self.results]):
            raise ConfigError(f"of: {unknown}: there is no such key")
        for result in self.results:
            if has_values(shipped_spec(result), key):
                return result
        raise MissingEvidence(key)


def _value(spec: Any, path: str) -> Any:
    """A key of a case, by its dotted name; NOWHERE where it has none of that name."""
    try:
        return attrgetter(path)(spec)
    except AttributeError:
        return NO_SUCH_KEY


def unknown_key(key: Mapping[str, Any], specs: Sequence[Any]) -> str:
    """The first dotted name that no case has."""
    return next((path for path in key if all(_value(spec, path) is NO_SUCH_KEY for spec in specs)), "")


def has_values(spec: Any, key: Mapping[str, Any]) -> bool:
    """Whether it is the case with these keys."""
    return all(_equal(_value(spec, path), value) for path, value in key.items())


def _equal(value: Any, wanted_value: Any) -> bool:
    if isinstance(value, float | int) and isinstance(wanted_value, float | int):
        return math.isclose(value, wanted_value, rel_tol=RELATIVE_TOLERANCE)
    return bool(value == wanted_value)


def sigma(evidence: Evidence, case: Any, filter: str, component: str, at: int | None = None) -> Estimate:
    """σ of a filter."""
    return _point(evidence.curve(case, filter, component), at)


def gain(evidence: Evidence, case: Any, filter: str, component: str, at: int | None = None) -> Estimate:
    """The gain of a filter against the case's baseline, %."""
    return _point(evidence.gain(case, filter, component), at)


def gain_change(
    evidence: Evidence, first: Any, second: Any, filter: str, component: str, at: int | None = None
) -> Estimate:
    """By how many points the gain in the second case exceeds that in the first."""
    return difference(*(gain(evidence, case, filter, component, at) for case in (second, first)))


def ratio(evidence: Evidence, case: Any, filter: str, over: str, component: str, at: int | None = None) -> Estimate:
    """σ of a filter over that of another one: paired where one of the two is a baseline."""
    return _point(evidence.ratio(case, filter, over, component), at)


def bias(evidence: Evidence, case: Any, filter: str, component: str, at: int | None = None) -> Estimate:
    """The mean error of a filter about the truth."""
    result = evidence.case(case)
    index = _error_index(result, filter, component, at)
    total, square = np.asarray(result.sums["error"])[index][:2]
    return mean(total, square, realisation_counts(result)[index])


def over_believed(evidence: Evidence, case: Any, filter: str, component: str, at: int | None = None) -> Estimate:
    """σ of a filter over the σ that it predicts; of a filter with a covariance."""
    result = evidence.case(case)
    k = int(result.axes.k[_error_index(result, filter, component, at)[1]])
    row = evidence.row("curves", case=result.name, filter=filter, component=component, k=k)
    if np.isnan(row["believed_sigma"]):
        raise ConfigError(f"filter {filter!r} predicts no σ: it gives no covariance")
    return Estimate(*(row[end] / row["believed_sigma"] for end in ("sigma", "sigma_lo", "sigma_hi")))


def run_rms(
    evidence: Evidence,
    case: Any,
    filter: str,
    component: str,
    first: int | None = None,
    last: int | None = None,
    statistic: Literal["mean", "median", "variance"] = "mean",
) -> Estimate:
    """A statistic over the runs of each run's root-mean-square error over the scans first to last, by default all."""
    return STATISTICS[statistic](evidence.run_rms(case, filter, component, first, last))


def run_rms_ratio(
    evidence: Evidence,
    case: Any,
    filter: str,
    over: str,
    component: str,
    first: int | None = None,
    last: int | None = None,
) -> Estimate:
    """The mean over the runs of each run's root-mean-square error, over that of another filter on the same runs."""
    rms, base = (evidence.run_rms(case, name, component, first, last) for name in (filter, over))
    value = float(np.nanmean(rms) / np.nanmean(base))
    deviation = mean_of_runs((rms - value * base) / np.nanmean(base))  # of the ratio, to first order
    return Estimate(value, value + deviation.lo - deviation.value, value + deviation.hi - deviation.value)


def _error_index(result: CaseResult, filter: str, component: str, scan: int | None) -> tuple[int, int, int]:
    """The index of an error of a filter, at a scan, in a component, in the sums."""
    axes = result.axes
    k = list(axes.k).index(scan) if scan is not None else -1
    return axes.filters.index(filter), k, [name for name, _ in axes.components].index(component)


def limit(evidence: Evidence, case: Any, filter: str, component: str) -> float:
    """The limit of a filter's σ, by the study's own limits."""
    return float(
        evidence.row("last", case=evidence.case(case).name, filter=filter, component=component)["steady_sigma"]
    )


def _point(series: Curve, scan: int | None) -> Estimate:
    return series.last() if scan is None else series.at_scan(scan)

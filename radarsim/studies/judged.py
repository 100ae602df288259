"""What claims of a study in one file are measured by, and its readings: a case is found by its keys.

A claim says `of: [{radar.scan_period_s: 2}]`: the case of these keys, or properties, by their dotted names; `of: [{}]`
is the first one. The functions here, whose first argument is `seen`, may be its `measure`; `at` is a scan, by default
the last one.
"""

import math
from collections.abc import Mapping
from dataclasses import replace
from operator import attrgetter
from typing import Any

import numpy as np

from radarsim.config.check import check
from radarsim.config.document import Document, Faults, Origin
from radarsim.config.experiment import Case
from radarsim.config.fields import from_python
from radarsim.engine.results import CaseResult
from radarsim.errors import ConfigError
from radarsim.report import claims
from radarsim.report.claims.declared import Claim, Series
from radarsim.report.claims.over import Choice, PaperReadings, Reading, Unreadable
from radarsim.report.statistics import Estimate, difference, mean
from radarsim.report.tables import realisations

CLOSE = 1e-9  # relative: one number written in two ways


class Evidence(claims.Evidence):
    """What the paper's experiment measured; a case is known by a mapping of its keys, or by its name."""

    def case(self, key: Any) -> CaseResult:
        if not isinstance(key, Mapping):
            return super().case(key)
        for result in self.results:
            if all(_equal(_value(result.spec, path), value) for path, value in key.items()):
                return result
        raise claims.Missing(key)


def _value(spec: Any, path: str) -> Any:
    try:
        return attrgetter(path)(spec)
    except AttributeError:
        raise ConfigError(f"claims: of: {path}: there is no such key") from None


def _equal(one: Any, other: Any) -> bool:
    if isinstance(one, float | int) and isinstance(other, float | int):
        return math.isclose(one, other, rel_tol=CLOSE)
    return bool(one == other)


# ---- measures --------------------------------------------------------------------------------------------------------
def sigma(seen: Evidence, case: Any, filter: str, component: str, at: int | None = None) -> Estimate:
    """σ of a filter."""
    return _at(seen.curve(case, filter, component), at)


def gain(seen: Evidence, case: Any, filter: str, component: str, at: int | None = None) -> Estimate:
    """The gain of a filter against the case's baseline, %."""
    return _at(seen.gain(case, filter, component), at)


def gain_change(
    seen: Evidence, first: Any, second: Any, filter: str, component: str, at: int | None = None
) -> Estimate:
    """By how many points the gain in the second case exceeds that in the first."""
    return difference(*(gain(seen, case, filter, component, at) for case in (second, first)))


def ratio(seen: Evidence, case: Any, filter: str, over: str, component: str, at: int | None = None) -> Estimate:
    """σ of a filter over that of another one: paired where one of the two is a baseline."""
    return _at(seen.ratio(case, filter, over, component), at)


def bias(seen: Evidence, case: Any, filter: str, component: str, at: int | None = None) -> Estimate:
    """The mean error of a filter about the truth."""
    found = seen.case(case)
    place = _place(found, filter, component, at)
    total, square = np.asarray(found.sums["error"])[place][:2]
    return mean(total, square, realisations(found)[place])


def over_believed(seen: Evidence, case: Any, filter: str, component: str, at: int | None = None) -> Estimate:
    """σ of a filter over the one that it believes; where the study has the table `believed`."""
    found = seen.case(case)
    k = int(found.axes.k[_place(found, filter, component, at)[1]])
    row = seen.row("believed", case=found.name, filter=filter, component=component, k=k)
    return Estimate(row["ratio"], row["ratio_lo"], row["ratio_hi"])


def _place(found: CaseResult, filter: str, component: str, at: int | None) -> tuple[int, int, int]:
    """Where the sums of an error stand."""
    axes = found.axes
    k = list(axes.k).index(at) if at is not None else -1
    return axes.filters.index(filter), k, [name for name, _ in axes.components].index(component)


def limit(seen: Evidence, case: Any, filter: str, component: str) -> float:
    """The σ that a filter tends to, by the study's own limits."""
    return float(seen.row("last", case=seen.case(case).name, filter=filter, component=component)["steady_sigma"])


def _at(series: Series, at: int | None) -> Estimate:
    return series.last() if at is None else series.at(at)


# ---- readings --------------------------------------------------------------------------------------------------------
class Readings(PaperReadings):
    """Readings whose alternatives set keys of a case, dotted names; a bare one is of every filter."""

    def __init__(self, paper: str, choices: tuple[Choice, ...]):
        self.paper, self.choices = paper, choices

    def changed(self, claim: Claim, case: Case, reading: Reading) -> Case | None:
        return replace(case, spec=_with(case.spec, self.sets(reading)))


def _with(spec: Any, values: Mapping[str, Any]) -> Any:
    """A config's keys with other values of some; raises Unreadable where they do not go together."""
    origin, faults = Origin("reading"), Faults()
    data: Any = from_python(spec.model_dump(exclude_none=True), (), origin, faults)
    for path, value in values.items():
        *above, last = path.split(".")
        places = [data] if path.partition(".")[0] in type(spec).model_fields else data[type(spec).bare_keys]
        for step in above:
            places = [place[int(step)] if isinstance(place, list) else place.setdefault(step, {}) for place in places]
        for place in places:
            place[last] = value
    changed = check(type(spec), Document(data, "reading", None, {(): origin}), faults)
    try:
        faults.raise_if_any()
    except ConfigError as error:
        raise Unreadable(error.lines[0]) from None
    return changed

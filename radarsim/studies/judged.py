"""Measures of claims, and readings, of a study in one file: a case is found by its keys.

A claim says `of: [{radar.scan_period_s: 2}]`: the case with these keys, or properties, by their dotted names; `of:
[{}]` is the first one. The functions here whose first argument is `seen` may be its `measure`; `at` is a scan, by
default the last one."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from operator import attrgetter
from typing import Any

import numpy as np

from radarsim.config.check import check
from radarsim.config.document import Document, Faults, Origin
from radarsim.config.experiment import Case
from radarsim.config.fields import Model, from_python
from radarsim.engine.results import CaseResult
from radarsim.errors import ConfigError
from radarsim.report import claims
from radarsim.report.claims.declared import Claim, Series, Shipped
from radarsim.report.claims.over import Call, Choice, PaperReadings, Reading, Unreadable
from radarsim.report.statistics import Estimate, difference, mean
from radarsim.report.tables import realisations

NOWHERE = object()
CLOSE = 1e-9  # relative difference of one number written in two ways


class Evidence(claims.Evidence):
    """Results of the paper's experiment; a case is identified by a mapping of its keys, or by its name."""

    def case(self, key: Any) -> CaseResult:
        if not isinstance(key, Mapping):
            return super().case(key)
        if unknown := _unknown(key, [result.spec for result in self.results]):
            raise ConfigError(f"of: {unknown}: there is no such key")
        for result in self.results:
            if _is(result.spec, key):
                return result
        raise claims.Missing(key)


def _value(spec: Any, path: str) -> Any:
    """A key of a case, by its dotted name; NOWHERE where it has none of that name."""
    try:
        return attrgetter(path)(spec)
    except AttributeError:
        return NOWHERE


def _unknown(key: Mapping[str, Any], specs: Sequence[Any]) -> str:
    """The first dotted name that no case has."""
    return next((path for path in key if all(_value(spec, path) is NOWHERE for spec in specs)), "")


def _is(spec: Any, key: Mapping[str, Any]) -> bool:
    """Whether it is the case with these keys."""
    return all(_equal(_value(spec, path), value) for path, value in key.items())


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
    """σ of a filter over the σ that it predicts; of a filter with a covariance."""
    found = seen.case(case)
    k = int(found.axes.k[_place(found, filter, component, at)[1]])
    row = seen.row("curves", case=found.name, filter=filter, component=component, k=k)
    if np.isnan(row["believed_sigma"]):
        raise ConfigError(f"filter {filter!r} predicts no σ: it gives no covariance")
    return Estimate(*(row[end] / row["believed_sigma"] for end in ("sigma", "sigma_lo", "sigma_hi")))


def _place(found: CaseResult, filter: str, component: str, at: int | None) -> tuple[int, int, int]:
    """The index of an error in the sums."""
    axes = found.axes
    k = list(axes.k).index(at) if at is not None else -1
    return axes.filters.index(filter), k, [name for name, _ in axes.components].index(component)


def limit(seen: Evidence, case: Any, filter: str, component: str) -> float:
    """The limit of a filter's σ, by the study's own limits."""
    return float(seen.row("last", case=seen.case(case).name, filter=filter, component=component)["steady_sigma"])


def _at(series: Series, at: int | None) -> Estimate:
    return series.last() if at is None else series.at(at)


# ---- readings --------------------------------------------------------------------------------------------------------
class Readings(PaperReadings):
    """Readings whose alternatives set keys of a case, by dotted names; a bare name applies to every filter."""

    def __init__(self, paper: str, choices: tuple[Choice, ...]):
        self.paper, self.choices = paper, choices

    def changed(self, claim: Claim, case: Case, reading: Reading) -> Case | None:
        return replace(case, spec=_with(case.spec, self.sets(reading)))


# ---- faults ----------------------------------------------------------------------------------------------------------
def faults(
    every: Sequence[Claim],
    choices: Sequence[Choice],
    components: Sequence[str],
    shipped: Shipped,
    configs: Sequence[str],
) -> Iterator[str]:
    """Names in claims and choices that do not exist, a line each with its place: known without a run.

    components: of the study; configs: the stems that its package ships."""
    for claim in every:
        if (cases := shipped(claim.config)) is None:
            there = ", ".join(configs) or "none"
            yield f"{claim.source}: config: no such config {claim.config!r} is shipped; there are {there}"
            continue
        for part in claim.parts:
            if isinstance(part.measure, Call):
                yield from (f"{part.measure.source}: {fault}" for fault in _names(part.measure, cases, components))
    for choice in choices:
        configs_of = dict.fromkeys(claim.config for claim in every if choice.bears_on(claim.id))
        specs = [case.spec for config in configs_of for case in shipped(config) or ()]
        for one in choice.alternatives:
            if why := next(filter(None, (_kept_from(spec, one.sets) for spec in specs)), ""):
                yield f"{one.source}: choices: {choice.key}: {one.name!r} cannot be set: {why}"


def _names(measure: Call, cases: Sequence[Any], components: Sequence[str]) -> Iterator[str]:
    """The unknown case, filter, component, gain or scan of a measure: in arguments of the functions here only."""
    of: list[Any] = []
    for key in (key for key in measure.cases if isinstance(key, Mapping)):
        if unknown := _unknown(key, [case.spec for case in cases]):
            yield f"of: {unknown}: there is no such key"
        elif not (found := [case for case in cases if _is(case.spec, key)]):
            yield f"of: no case has {', '.join(f'{path} {value}' for path, value in key.items())}"
        else:
            of.append(found[0])
    if measure.function is None or measure.function.__module__ != __name__:
        return
    for argument in ("filter", "over", "component"):
        kind = "component" if argument == "component" else "filter"
        for case in of if argument in measure.arguments else ():
            filters = [one.name for one in (*case.spec.filters, *case.outside)]
            known = components if kind == "component" else filters
            if (name := measure.arguments[argument]) not in known:
                yield f"no {kind} {name!r}; there are {', '.join(known)}"
    yield from (fault for case in of for fault in _no_number(measure, case.spec))


def _no_number(measure: Call, spec: Any) -> Iterator[str]:
    """Why a case has no number for a measure of the functions here: no gain of its baseline, no scan after its last."""
    name, at = measure.arguments.get("filter"), measure.arguments.get("at")
    if measure.function in (gain, gain_change) and name == (spec.baseline or spec.filters[0].name):
        yield f"filter {name!r} is the baseline: it has no gain"
    if at is not None and not 1 <= at <= spec.scans:
        yield f"no scan {at}; there are 1 to {spec.scans}"


def _kept_from(spec: Model, values: Mapping[str, Any]) -> str:
    """Why a case cannot have these values; nothing where it can."""
    try:
        _with(spec, values)
    except Unreadable as error:
        return str(error)
    return ""


def _with(spec: Any, values: Mapping[str, Any]) -> Any:
    """A config's keys with some values changed; raises Unreadable where they are incompatible."""
    origin, faults = Origin("reading"), Faults()
    data: Any = from_python(spec.model_dump(exclude_none=True), (), origin, faults)
    for path, value in values.items():
        *above, last = path.split(".")
        places = [data] if path.partition(".")[0] in type(spec).model_fields else data[type(spec).bare_keys]
        try:
            for step in above:
                places = [
                    place[int(step)] if isinstance(place, list) else place.setdefault(step, {}) for place in places
                ]
            for place in places:
                place[last] = value
        except (LookupError, TypeError, ValueError, AttributeError):
            raise Unreadable(f"{path}: there is no such key") from None
    changed = check(type(spec), Document(data, "reading", None, {(): origin}), faults)
    try:
        faults.raise_if_any()
    except ConfigError as error:
        raise Unreadable(error.lines[0]) from None
    return changed

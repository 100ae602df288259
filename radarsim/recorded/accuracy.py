"""Whether the accuracies that a config states fit recorded plots, judged by the filters' own innovations.

A filter that is right about its errors has innovations whose squares, over the variance that it believes, are 1 on
average per degree of freedom (NIS). More: the plots are worse than stated, or the target manoeuvres harder than the
filter takes it to; less: they are better.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from radarsim.config.experiment import Case
from radarsim.config.fields import Model
from radarsim.recorded.follow import Followed, Tally, recorded_of
from radarsim.report.statistics import normalised_bounds

LEAST_TESTS = 10  # below which there is no verdict
CLOSE = 0.005  # of one, to which the mean is brought
ROUNDS = 60
FITS, SMALL, LARGE, UNKNOWN = "fits", "too small", "too large", "too few plots"


@dataclass(frozen=True)
class Judged:
    """One test: filter, what was measured, mean NIS with the bounds of a right filter, verdict, and the σ that would.

    better holds, by key of the config, the standard deviations with which the mean is one; empty where the stated ones
    fit, or where there are none such.
    """

    filter: str
    name: str
    tests: int
    nis: float
    lo: float
    hi: float
    verdict: str
    better: Mapping[str, float]


def judged(followed: Followed) -> list[Judged]:
    """Every filter's tests, with the better standard deviations where the stated ones do not fit."""
    found = [_judge(tally) for tally in followed.tallies.values()]
    improved = {}
    for name in {one.filter for one in found if one.verdict in (SMALL, LARGE)}:
        improved[name] = better(followed.case, name, followed.head)
    return [replace(one, better=_own(followed.case, one, improved.get(one.filter, {}))) for one in found]


def _judge(tally: Tally) -> Judged:
    """The verdict at 95 %."""
    lo, hi = map(float, normalised_bounds(max(tally.count * tally.freedom, 1)))
    verdict = SMALL if tally.mean > hi else LARGE if tally.mean < lo else FITS
    if tally.count < LEAST_TESTS:
        verdict = UNKNOWN
    return Judged(tally.filter, tally.name, tally.count, tally.mean, lo, hi, verdict, {})


def _own(case: Case, one: Judged, improved: Mapping[str, float]) -> dict[str, float]:
    """Of the better values those of this test's keys."""
    if one.verdict not in (SMALL, LARGE):
        return {}
    keys = recorded_of(case).sigmas(case.spec)[one.name]
    return {key: improved[key] for key in keys if key in improved}


def better(case: Case, filter_name: str, columns: Mapping[str, np.ndarray]) -> dict[str, float]:
    """The standard deviations, by their keys, with which one filter's mean NIS is 1 in each thing it tests.

    By running the filter again and again over the first rows, each σ multiplied by the root of its NIS; empty where
    that does not come to an end (a filter whose manoeuvre variance alone explains more than the plots' scatter).
    """
    of = recorded_of(case)
    (options,) = (f for f in case.spec.filters if f.name == filter_name)
    spec = case.spec.model_copy(update={"filters": (options,), "baseline": None})
    keys = of.sigmas(spec)
    stated = {key: _get(spec, key) for own in keys.values() for key in own}
    factors = dict.fromkeys(stated, 1.0)
    for _ in range(ROUNDS):
        trial = spec
        for key, factor in factors.items():
            trial = _set(trial, key, stated[key] * factor)
        track = of.tracker(replace(case, spec=trial)).feed(dict(columns))
        off: list[float] = []
        change: dict[str, list[float]] = {key: [] for key in factors}
        for q, (name, freedom) in enumerate(track.tested):
            assert track.nis is not None  # what is tested has its NIS
            values = track.nis[0, :, q]
            values = values[np.isfinite(values)]
            if values.size >= LEAST_TESTS:
                mean = float(values.mean()) / freedom
                off.append(abs(mean - 1))
                for key in keys[name]:
                    change[key].append(mean)
        if not off or not np.isfinite(off).all():
            return {}
        if max(off) < CLOSE:
            return {key: stated[key] * factor for key, factor in factors.items() if change[key]}
        for key, means in change.items():
            if means:
                factors[key] *= float(np.clip(np.sqrt(np.mean(means)), 0.25, 4.0))
        if not all(1e-6 < factor < 1e6 for factor in factors.values()):
            return {}
    return {}


def _get(spec: Model, key: str) -> float:
    part, name = key.split(".")
    return float(getattr(getattr(spec, part), name))


def _set(spec: Model, key: str, value: float) -> Model:
    part, name = key.split(".")
    inner = getattr(spec, part)
    return spec.model_copy(update={part: inner.model_copy(update={name: value})})

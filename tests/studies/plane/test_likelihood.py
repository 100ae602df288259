"""The likelihood of recorded plots of the plane: against its steps in plain Python."""

import math

import numpy as np
import pytest

from radarsim.studies.missed_scans import missed_scan_times
from radarsim.studies.registry import study
from radarsim.studies.step_checks import record
from radarsim.studies.step_likelihood import StepLikelihood
from tests.studies.plane.cases import STRAIGHT, case_of, member

NAMES = ("range_m", "bearing_rad", "velocity_mps")
FILTERS = (
    member("extended"),
    member("imm", "turn"),
    member("imm", doppler=False),
    member("extended", "acceleration", doppler=False),
    member("unscented"),
    member("converted"),
)


def recording(case, realisation):
    """The plots of a realisation, without the truth."""
    columns = study("plane").recording_interface().simulated(case, realisation)
    return {name: columns[name] for name in ("t_s", *NAMES)}


def tracks_of(case):
    """A track whose first rows have no complete plot, with a gap, and a second one."""
    first, second = recording(case, 0), recording(case, 1)
    first["velocity_mps"][0] = first["bearing_rad"][1] = math.nan
    return [{name: np.delete(column, [5, 6, 7]) for name, column in first.items()}, second]


def numbers_of(case, keys, factors):
    """The numbers of a filter, of keys that differ from the stated ones by factors."""
    spec, names = case.spec, study("plane").fitted(keys)
    for name, factor in zip(names, factors, strict=True):
        if name.startswith("radar."):
            radar_name = name.removeprefix("radar.")
            radar = spec.radar.model_copy(update={radar_name: factor * getattr(spec.radar, radar_name)})
            spec = spec.model_copy(update={"radar": radar})
        else:
            keys = keys.model_copy(update={name: factor * getattr(keys, name)})
    return record(study("plane").kinds[keys.kind].design, spec, keys)


def plain_densities(case, keys, track, c):
    """The log-densities of all plots but the first of a track, by the steps in plain Python: of the first number, of
    the first two, and so on."""
    steps, s, last, total = study("plane").kinds[keys.kind], None, math.nan, 0.0
    used = len(study("plane").columns(case.spec, keys))
    for t, *z in zip(*(track[name].tolist() for name in ("t_s", *NAMES)), strict=True):
        if s is not None:
            for time in (*missed_scan_times(last, t, case.spec.radar.scan_period_s), t):
                s, last = steps.predict(s, time - last, (), c), time
        if np.isfinite(z[:used]).all():
            if s is not None:
                total += np.array(steps.log_densities(s, z, (), c), dtype=float)
                s = steps.update(s, z, (), c)
            else:
                s, last = steps.start(z, (), c), t
    return total


@pytest.mark.slow_cases_except("*extended velocity Vr", "None-imm velocity r")
@pytest.mark.parametrize("filter_keys", FILTERS, ids=lambda keys: keys["name"])
@pytest.mark.parametrize("rate_hz", [None, 4000.0])
def test_the_compiled_likelihood_is_that_of_the_steps(filter_keys, rate_hz):
    case = case_of([filter_keys], STRAIGHT, 20, **({"repetition_rate_hz": rate_hz} if rate_hz else {}))
    (keys,), tracks = case.spec.filters, tracks_of(case)
    likelihood = StepLikelihood(study("plane"), case.spec, keys, tracks)
    rng = np.random.default_rng(3)
    for factors in np.exp(rng.normal(0.0, 0.7, (3, len(likelihood.keys)))):
        c = numbers_of(case, keys, factors)
        densities = sum(plain_densities(case, keys, track, c) for track in tracks)
        values = factors * likelihood.stated
        assert likelihood(values) == pytest.approx(densities[-1], rel=1e-9)
        by_number = list(likelihood.by_number(values).values())
        np.testing.assert_allclose(np.cumsum(by_number), densities, rtol=1e-9)

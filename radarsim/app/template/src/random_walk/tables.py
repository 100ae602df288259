"""The study's own tables, beside `curves`, `gains` and `claims`, which radarsim makes of the sums."""

from collections.abc import Sequence

import numpy as np
from radarsim.engine.results import CaseResult
from radarsim.report import statistics
from radarsim.report import tables as common

from random_walk import exact, filters

# Yours: begin with `case, filter` as the common tables do; interval ends are called …_lo and …_hi.
STEADY = ("case", "filter", "component", "unit", "last_gain", "last_sigma", "last_lo", "last_hi", "steady_sigma")


def tables(results: Sequence[CaseResult]) -> dict:
    """The tables by the stem of their file."""
    rows = [row for result in results for row in _steady(result)]
    return {"steady": common.frame({name: [row[i] for row in rows] for i, name in enumerate(STEADY)})}


def _steady(result: CaseResult) -> list[tuple]:
    """σ at the last scan, measured, and the exact one that it tends to if the gain stays as it is."""
    spec, rows = result.spec, []
    sigma = statistics.errors(result.sums["error"], common.realisations(result)).sigma
    for f, one in enumerate(spec.filters):
        noise, step = spec.sensor.sigma_x_m, spec.target.sigma_step_m
        gain = float(filters.design(one, noise, step, spec.scans)[-1])
        last = (float(part[f, -1, 0]) for part in sigma)
        rows.append((result.name, one.name, "x", "m", gain, *last, np.sqrt(exact.steady_variance(gain, noise, step))))
    return rows

"""The study's own tables, beside `curves`, `gains` and `claims`, which radarsim makes from the sums."""

import numpy as np
from radarsim.engine.results import CaseResult
from radarsim.report import statistics
from radarsim.report import tables as common

from random_walk import filters

table = common.Tables()


@table("steady")  # Yours: a function per table, for one case; its docstring explains each column
def _steady(result: CaseResult) -> common.Columns:
    """σ at the last scan, and its exact limit if the gain stays constant.

    last_gain: gain of the filter at the last scan
    last_sigma ± last [unit]: as measured
    steady_sigma [unit]: exact
    """
    spec, f = result.spec, np.arange(len(result.spec.filters))
    noise, step = spec.sensor.sigma_x_m, spec.target.sigma_step_m
    last = f, -1, 0
    gains = np.array([filters.design(one, noise, step, spec.scans)[-1] for one in spec.filters], dtype=float)
    return {
        **common.leading(result, f, **common.components(result, np.zeros_like(f))),
        "last_gain": gains,
        "last_sigma|last": statistics.errors(result.sums["error"][last], common.realisations(result)[last]).sigma,
        "steady_sigma": np.sqrt([filters.steady_variance(gain, noise, step) for gain in gains]),
    }


tables = table.made

"""The windows of every estimator: designed by (14)–(16), or as configured."""

from functools import lru_cache, partial

import numpy as np

from radarsim.bursts import burst as model
from radarsim.bursts import fisher, schedule_design
from radarsim.studies.discriminator.config import Keys


def window_designer(
    burst: model.Burst, sigma: np.ndarray, condition: schedule_design.Condition
) -> schedule_design.Designer:
    """The designer of a burst's windows under a forecast sigma (size,)."""
    return schedule_design.Designer(burst, sigma, partial(fisher.fisher, burst, len(sigma)), condition)


@lru_cache(maxsize=64)
def designed_windows(
    burst: model.Burst, sigma: tuple[float, ...], condition: schedule_design.Condition
) -> tuple[int, ...]:
    """Windows in pulses of one condition, designed once: of many cases that differ elsewhere they are the same."""
    return tuple(window_designer(burst, np.array(sigma), condition).windows())


def schedule_windows(spec: Keys, burst: model.Burst, sigma: np.ndarray) -> list[list[int]]:
    """Window lengths of every estimator in pulses, for the forecast's standard deviations sigma (size,)."""
    windows_by_estimator = []
    for e in spec.estimators:
        if e.method == "ridge":
            windows_by_estimator.append([burst.pulses])
            continue
        if e.schedule == "designed":
            condition = schedule_design.Condition(e.lock_probability, e.main_lobe_threshold, e.tail)
            windows = list(designed_windows(burst, tuple(sigma.tolist()), condition))
        else:
            windows = sorted({burst.pulses_in(duration) for duration in e.schedule})
        windows_by_estimator.append(schedule_design.densify(windows, e.density)[: e.first_windows])
    return windows_by_estimator

"""One burst through the windows of an estimator, as the paper's figure 2 shows one."""

import numpy as np

from radarsim.bursts import burst
from radarsim.config.experiment import Case
from radarsim.studies.discriminator.study import estimate, prepare

BURST = 0  # the realisation that is shown


def one_burst(case: Case, number: int) -> np.ndarray:
    """Absolute errors (K, C) of an estimator at each of its K windows, in the units of the components (rad, Hz, …). The
    burst is the first realisation of the run itself, whether it locks or not."""
    plan = prepare(case)
    errors, _ = estimate(plan, BURST, 1)
    windows, size = len(plan.axes.pulses[number]), len(plan.axes.components)
    return np.abs(errors[0, number, :windows, :size]) / burst.turns_per_parameter(size, plan.axes.burst_s)

"""The log likelihood of recorded plots under a filter: the density that its bank gives each plot.

The filter is that of the simulation, run scan by scan, with the same plots in all lanes."""

import numpy as np

from radarsim.kernels.compiler import inline, kernel
from radarsim.kernels.lanes import WIDTH, address
from radarsim.studies.multimodel.kernels import layout
from radarsim.studies.multimodel.kernels.filter_strip import Scans, make_rules, run_strip


@kernel
def log_likelihood(work, numbers, plots, models, transitions, intervals, times, rules, frame, score):
    """Fill score (n,) with the logarithm of each plot's density given the earlier plots; zero where there is no plot.

    work, numbers: the filter's memory, started; plots (n · PLOT rows); models, transitions, intervals (n,), times,
    rules, frame as in `filter_strip`."""
    n, filter_rules = score.size, make_rules(rules, models.size // layout.MODEL_NUMBERS)
    out, reported = np.empty(n * layout.OUTPUT * WIDTH), np.zeros(n, dtype=np.int64)
    memory = address(work), address(numbers), address(np.zeros(layout.MAX_MODELS, dtype=np.int64))
    design = filter_rules, address(models), address(transitions)
    for k in range(n):
        scans = Scans(k, k + 1, address(intervals), address(times), address(reported))
        run_strip(*memory, *design, scans, address(plots), address(frame), address(out))
        score[k] = 0.0
        if plots[(k * layout.PLOT + layout.DETECTED) * WIDTH] > 0.5:
            new = numbers[layout.CURRENT] * layout.BANK
            score[k] = density(work, layout.BANK - new, new, filter_rules)


@inline
def density(work, old, new, rules):
    """The logarithm of the density of a lane's plot under the old bank: Σ c N(innovation; 0, S) over the models.

    c is the predicted probability of a model. For pairs of models (GPB2) the memory still has those that end in the
    last model: their sum, divided by the sum over all pairs, is that model's new probability."""
    size, total, min_distance = rules.size, 0.0, 1e300
    last, first_row = size - 1, layout.RESULT if rules.family == layout.GPB2 else layout.RESULT_GROUP
    for i in range(size):
        if predicted_probability(work, old, rules, i) > 0.0:
            min_distance = min(min_distance, work[(first_row + 2 * i) * WIDTH])
    for i in range(size):
        c = predicted_probability(work, old, rules, i)
        if c > 0.0:
            q, determinant = work[(first_row + 2 * i) * WIDTH], work[(first_row + 2 * i + 1) * WIDTH]
            total += c * np.exp(0.5 * (min_distance - q)) / np.sqrt(determinant)
    last_model_weight = (
        work[(new + last * layout.HYPOTHESIS + layout.PROBABILITY) * WIDTH] if rules.family == layout.GPB2 else 1.0
    )
    if not (total > 0.0 and last_model_weight > 0.0):
        return np.nan
    return np.log(total) - np.log(last_model_weight) - 0.5 * min_distance - 1.5 * np.log(2.0 * np.pi)


@inline
def predicted_probability(work, old, rules, i):
    """The predicted probability of model i; for GPB2, that of the pair from model i to the last model."""
    if rules.family == layout.GPB2:
        last = rules.size - 1
        return work[(layout.TRANSITION + last * layout.MAX_MODELS + i) * WIDTH] * probability(work, old, i)
    c = 0.0
    for j in range(rules.size):
        c += work[(layout.TRANSITION + i * layout.MAX_MODELS + j) * WIDTH] * probability(work, old, j)
    return c


@inline
def probability(work, bank, i):
    """The probability of model i of a bank."""
    return work[(bank + i * layout.HYPOTHESIS + layout.PROBABILITY) * WIDTH]

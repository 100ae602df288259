"""The log likelihood of recorded plots under a filter: the density that its bank gives each plot.

The filter is that of the simulation, run scan by scan. There its eight lanes are eight realisations; here lane 0 takes
the plots with the configured σ, lane 1 as outliers, with OUTLIER_FACTOR times the σ. If there may be outliers, the two
lanes of each model are merged by moments after every plot."""

import numpy as np

from radarsim.kernels.compiler import inline, kernel
from radarsim.kernels.lanes import WIDTH, address
from radarsim.kernels.likelihood import OUTLIER_FACTOR
from radarsim.studies.multimodel.kernels import layout
from radarsim.studies.multimodel.kernels.filter_strip import Scans, make_rules, run_strip


@kernel
def log_likelihood(work, numbers, plots, models, transitions, intervals, times, rules, frame, share, score):
    """Fill score (n,) with the logarithm of each plot's density given the earlier plots; zero where there is no plot.

    work, numbers: a filter's memory, started; plots (n · PLOT rows), of which lane 1 gets FACTOR times the σ; models,
    transitions, intervals (n,), times, rules, frame as in `filter_strip`; share: of outliers."""
    n, filter_rules = score.size, make_rules(rules, models.size // layout.MODEL_NUMBERS)
    out, reported = np.empty(n * layout.OUTPUT * WIDTH), np.zeros(n, dtype=np.int64)
    for k in range(n):
        for i in range(6):
            plots[(k * layout.PLOT + layout.COVARIANCE + i) * WIDTH + 1] *= OUTLIER_FACTOR * OUTLIER_FACTOR
    listed = np.zeros(layout.MAX_MODELS, dtype=np.int64)
    memory = address(work), address(numbers), address(listed)
    design = filter_rules, address(models), address(transitions)
    for k in range(n):
        scans = Scans(k, k + 1, address(intervals), address(times), address(reported))
        run_strip(*memory, *design, scans, address(plots), address(frame), address(out))
        score[k] = 0.0
        if plots[(k * layout.PLOT + layout.DETECTED) * WIDTH] > 0.5:
            new = numbers[layout.CURRENT] * layout.BANK
            regular = density(work, layout.BANK - new, new, filter_rules, 0)
            outlier = density(work, layout.BANK - new, new, filter_rules, 1)
            score[k] = regular
            if share > 0.0:
                regular, outlier = regular + np.log(1.0 - share), outlier + np.log(share)
                greatest = max(regular, outlier)
                score[k] = greatest + np.log(np.exp(regular - greatest) + np.exp(outlier - greatest))
                merge_lanes(work, new, filter_rules, np.exp(regular - score[k]), np.exp(outlier - score[k]))


@inline
def density(work, old, new, rules, lane):
    """The logarithm of the density of a lane's plot under the old bank: Σ c N(innovation; 0, S) over the models.

    c is the predicted probability of a model. For pairs of models (GPB2) the memory still has those that end in the
    last model: their sum, divided by the sum over all pairs, is that model's new probability."""
    size, total, min_distance = rules.size, 0.0, 1e300
    last, first_row = size - 1, layout.RESULT if rules.family == layout.GPB2 else layout.RESULT_GROUP
    for i in range(size):
        if predicted_probability(work, old, rules, lane, i) > 0.0:
            min_distance = min(min_distance, work[(first_row + 2 * i) * WIDTH + lane])
    for i in range(size):
        c = predicted_probability(work, old, rules, lane, i)
        if c > 0.0:
            q, determinant = work[(first_row + 2 * i) * WIDTH + lane], work[(first_row + 2 * i + 1) * WIDTH + lane]
            total += c * np.exp(0.5 * (min_distance - q)) / np.sqrt(determinant)
    last_model_weight = (
        work[(new + last * layout.HYPOTHESIS + layout.PROBABILITY) * WIDTH + lane]
        if rules.family == layout.GPB2
        else 1.0
    )
    if not (total > 0.0 and last_model_weight > 0.0):
        return np.nan
    return np.log(total) - np.log(last_model_weight) - 0.5 * min_distance - 1.5 * np.log(2.0 * np.pi)


@inline
def predicted_probability(work, old, rules, lane, i):
    """The predicted probability of model i; for GPB2, that of the pair from model i to the last model."""
    if rules.family == layout.GPB2:
        last = rules.size - 1
        return work[(layout.TRANSITION + last * layout.MAX_MODELS + i) * WIDTH + lane] * probability(work, old, lane, i)
    c = 0.0
    for j in range(rules.size):
        c += work[(layout.TRANSITION + i * layout.MAX_MODELS + j) * WIDTH + lane] * probability(work, old, lane, j)
    return c


@inline
def probability(work, bank, lane, i):
    """The probability of model i of a bank."""
    return work[(bank + i * layout.HYPOTHESIS + layout.PROBABILITY) * WIDTH + lane]


@kernel
def merge_lanes(work, bank, rules, regular, outlier):
    """Merge each model's hypotheses of lanes 0 and 1, with probabilities regular and outlier, into both lanes."""
    for i in range(rules.size):
        first = (bank + i * layout.HYPOTHESIS) * WIDTH
        p, q = regular * probability(work, bank, 0, i), outlier * probability(work, bank, 1, i)
        # GPB1 has one hypothesis, the first, whatever the models' probabilities are.
        a, b = (regular, outlier) if rules.family == layout.GPB1 else (p, q)
        weight_sum = a + b
        if weight_sum > 0.0:
            merge_states(work, first, a / weight_sum, b / weight_sum)
        work[first + layout.PROBABILITY * WIDTH] = work[first + layout.PROBABILITY * WIDTH + 1] = p + q


@kernel
def merge_states(work, first, a, b):
    """Merge mean and covariance of lanes 0 and 1 of a hypothesis, with weights a and b, into both lanes."""
    d = np.empty(layout.STATES)
    for s in range(layout.STATES):
        element = first + s * WIDTH
        d[s] = work[element + 1] - work[element]
        work[element] = work[element + 1] = work[element] + b * d[s]
    for axis in range(3):
        element = layout.OWN + 6 * axis
        for i in range(3):
            for j in range(i, 3):
                put_merged_element(work, first + element * WIDTH, a, b, d[3 * axis + i] * d[3 * axis + j])
                element += 1
    for pair in range(3):
        row_axis, column_axis = (0, 1 + pair) if pair < 2 else (1, 2)
        for i in range(3):
            for j in range(3):
                element = layout.CROSS + 9 * pair + 3 * i + j
                put_merged_element(work, first + element * WIDTH, a, b, d[3 * row_axis + i] * d[3 * column_axis + j])


@inline
def put_merged_element(work, element, a, b, spread):
    """Write an element of the merged covariance into lanes 0 and 1."""
    work[element] = work[element + 1] = a * work[element] + b * work[element + 1] + a * b * spread

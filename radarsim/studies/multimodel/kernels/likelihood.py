"""The log likelihood of recorded plots under a filter: the density that its bank gives each plot.

The filter is that of the simulation, run scan by scan. There its eight lanes are eight realisations; here each takes
the plots with another law of the errors, those of `radarsim.kernels.likelihood`: lane 0 with the configured σ, lane 1
as near outliers, the others as far ones of one width each. If there may be outliers, the lanes of each model are merged
by moments after every plot."""

import numpy as np

from radarsim.kernels.compiler import inline, kernel
from radarsim.kernels.lanes import WIDTH, address
from radarsim.kernels.likelihood import FAR, FAR_COUNT, NEAR
from radarsim.studies.multimodel.kernels import layout
from radarsim.studies.multimodel.kernels.filter_strip import Scans, make_rules, run_strip


@kernel
def log_likelihood(
    work, numbers, plots, covariances, models, transitions, intervals, times, rules, frame, outliers, score, soundness
):
    """Fill score (n,) with the logarithm of each plot's density given the earlier plots, and soundness (n,) with its
    probability to be no outlier; zero and one where there is no plot.

    work, numbers: a filter's memory, started; plots (n · PLOT rows), the same in all lanes, of which lane l gets
    the packed covariance covariances[k, :, l] (n, 6, WIDTH); models, transitions, intervals (n,), times, rules, frame
    as in `filter_strip`; outliers (4,): their law, of which the shares count here."""
    n, filter_rules = score.size, make_rules(rules, models.size // layout.MODEL_NUMBERS)
    out, reported = np.empty(n * layout.OUTPUT * WIDTH), np.zeros(n, dtype=np.int64)
    for k in range(n):
        for i in range(6):
            for lane in range(WIDTH):
                plots[(k * layout.PLOT + layout.COVARIANCE + i) * WIDTH + lane] = covariances[k, i, lane]
    listed = np.zeros(layout.MAX_MODELS, dtype=np.int64)
    memory = address(work), address(numbers), address(listed)
    design = filter_rules, address(models), address(transitions)
    near, far, chances, densities = outliers[NEAR], outliers[FAR], np.empty(WIDTH), np.empty(WIDTH)
    may_be_outlier = near + far > 0.0
    chances[0], chances[1], chances[2:] = 1.0 - near - far, near, far / FAR_COUNT
    for k in range(n):
        scans = Scans(k, k + 1, address(intervals), address(times), address(reported))
        run_strip(*memory, *design, scans, address(plots), address(frame), address(out))
        score[k], soundness[k] = 0.0, 1.0
        if plots[(k * layout.PLOT + layout.DETECTED) * WIDTH] > 0.5:
            new = numbers[layout.CURRENT] * layout.BANK
            score[k] = density(work, layout.BANK - new, new, filter_rules, 0)
            if may_be_outlier:
                for lane in range(WIDTH):
                    densities[lane] = -np.inf
                    if chances[lane] > 0.0:
                        d = density(work, layout.BANK - new, new, filter_rules, lane)
                        densities[lane] = np.log(chances[lane]) + d
                greatest, total = densities.max(), 0.0
                for lane in range(WIDTH):
                    total += np.exp(densities[lane] - greatest)
                score[k] = greatest + np.log(total)
                for lane in range(WIDTH):
                    densities[lane] = np.exp(densities[lane] - score[k])
                soundness[k] = densities[0]
                merge_lanes(work, new, filter_rules, densities)


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
def merge_lanes(work, bank, rules, chances):
    """Merge each model's hypotheses of all lanes, of these probabilities (WIDTH,), into every lane."""
    weights = np.empty(WIDTH)
    for i in range(rules.size):
        first, total = (bank + i * layout.HYPOTHESIS) * WIDTH, 0.0
        for lane in range(WIDTH):
            # GPB1 has one hypothesis, the first, whatever the models' probabilities are.
            p = chances[lane] * probability(work, bank, lane, i) if chances[lane] > 0.0 else 0.0
            weights[lane] = chances[lane] if rules.family == layout.GPB1 else p
            total += p
        weight_sum = weights.sum()
        if weight_sum > 0.0:
            for lane in range(WIDTH):
                weights[lane] /= weight_sum
            merge_states(work, first, weights)
        for lane in range(WIDTH):
            work[first + layout.PROBABILITY * WIDTH + lane] = total


@kernel
def merge_states(work, first, weights):
    """Merge mean and covariance of all lanes of a hypothesis, with weights (WIDTH,), into every lane."""
    d = np.empty((layout.STATES, WIDTH))
    for s in range(layout.STATES):
        element, mean = first + s * WIDTH, 0.0
        for lane in range(WIDTH):
            if weights[lane] > 0.0:
                mean += weights[lane] * work[element + lane]
        for lane in range(WIDTH):
            d[s, lane] = work[element + lane] - mean
            work[element + lane] = mean
    for axis in range(3):
        element = layout.OWN + 6 * axis
        for i in range(3):
            for j in range(i, 3):
                put_merged_element(work, first + element * WIDTH, weights, d[3 * axis + i], d[3 * axis + j])
                element += 1
    for pair in range(3):
        row_axis, column_axis = (0, 1 + pair) if pair < 2 else (1, 2)
        for i in range(3):
            for j in range(3):
                element = layout.CROSS + 9 * pair + 3 * i + j
                put_merged_element(work, first + element * WIDTH, weights, d[3 * row_axis + i], d[3 * column_axis + j])


@kernel
def put_merged_element(work, element, weights, row_offsets, column_offsets):
    """Write an element of the merged covariance into every lane; offsets (WIDTH,) of the lanes' means from theirs."""
    merged = 0.0
    for lane in range(WIDTH):
        if weights[lane] > 0.0:
            merged += weights[lane] * (work[element + lane] + row_offsets[lane] * column_offsets[lane])
    for lane in range(WIDTH):
        work[element + lane] = merged

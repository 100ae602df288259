"""The log likelihood of recorded plots under a filter: the density that its bank gives each plot.

The filter is that of the simulation, run scan by scan. There its eight lanes are eight realisations; here each takes
the plots with another law of the errors, those of `radarsim.kernels.likelihood`, in four strips of lanes. An outlier is
the whole plot, in the first strip, or one of its numbers alone, all equally likely, and never two of these at once. In
the first strip lane 0 has the configured σ and lane 1 near outliers, in the others these two near outliers to either
side; the rest of all are far ones of one width each. If there may be outliers, the lanes of each model are merged by
moments after every plot."""

import numpy as np

from radarsim.kernels.compiler import inline, kernel
from radarsim.kernels.lanes import WIDTH, address
from radarsim.kernels.likelihood import FAR, FAR_COUNT, NEAR
from radarsim.studies.multimodel.kernels import layout
from radarsim.studies.multimodel.kernels.filter_strip import Scans, make_rules, run_strip

STRIPS = 4  # of laws: those of outliers that are the whole plot, and those of each of its three numbers


@kernel
def log_likelihood(
    works, numbers, plots, models, transitions, intervals, times, rules, frame, outliers, score, soundness
):
    """Fill score (n,) with the logarithm of each plot's density given the earlier plots, and soundness (n, 3) with the
    probability of each of its numbers to be no outlier; zero and one where there is no plot.

    works (S, …), numbers (S, …): a filter's memory, started, for each strip of laws, one if no plot is an outlier;
    plots (S, n · PLOT rows), with the means and covariances that each law has; models, transitions, intervals (n,),
    times, rules, frame as in `filter_strip`; outliers (4,): their law, of which the shares count here."""
    strips, n, filter_rules = len(works), score.size, make_rules(rules, models.size // layout.MODEL_NUMBERS)
    out, reported = np.empty(n * layout.OUTPUT * WIDTH), np.zeros(n, dtype=np.int64)
    listed = np.zeros(layout.MAX_MODELS, dtype=np.int64)
    design = filter_rules, address(models), address(transitions)
    chances, densities = law_chances(strips, outliers), np.empty((strips, WIDTH))
    for k in range(n):
        scans = Scans(k, k + 1, address(intervals), address(times), address(reported))
        for s in range(strips):
            memory = address(works[s]), address(numbers[s]), address(listed)
            run_strip(*memory, *design, scans, address(plots[s]), address(frame), address(out))
        score[k], soundness[k] = 0.0, 1.0
        if plots[0, (k * layout.PLOT + layout.DETECTED) * WIDTH] > 0.5:
            new = numbers[0, layout.CURRENT] * layout.BANK
            old = layout.BANK - new
            if strips == 1:
                score[k] = density(works[0], old, new, filter_rules, 0)
            else:
                for s in range(strips):
                    for lane in range(WIDTH):
                        densities[s, lane] = -np.inf
                        if chances[s, lane] > 0.0:
                            d = density(works[s], old, new, filter_rules, lane)
                            densities[s, lane] = np.log(chances[s, lane]) + d
                greatest = densities.max()
                probabilities = np.exp(densities - greatest)
                score[k] = greatest + np.log(probabilities.sum())
                probabilities /= probabilities.sum()
                for j in range(3):
                    soundness[k, j] = 1.0 - probabilities[0, 1:].sum() - probabilities[1 + j].sum()
                merge_laws(works, new, filter_rules, probabilities)


@kernel
def law_chances(strips, outliers):
    """The probability of each law (S, WIDTH) before its plot: the shares are odds of each kind of outlier alone."""
    chances = np.zeros((strips, WIDTH))
    chances[0, 0], chances[0, 1] = 1.0 - outliers[NEAR] - outliers[FAR], outliers[NEAR]
    chances[1:, :2], chances[:, 2 : 2 + FAR_COUNT] = outliers[NEAR] / 2.0, outliers[FAR] / FAR_COUNT
    chances /= chances.sum()
    return chances


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
def merge_laws(works, bank, rules, chances):
    """Merge each model's hypotheses of all laws, of these probabilities (S, WIDTH), into the lanes of all."""
    weights = np.empty(chances.shape)
    for i in range(rules.size):
        first, total = (bank + i * layout.HYPOTHESIS) * WIDTH, 0.0
        for s in range(len(works)):
            for lane in range(WIDTH):
                # GPB1 has one hypothesis, the first, whatever the models' probabilities are.
                p = chances[s, lane] * probability(works[s], bank, lane, i) if chances[s, lane] > 0.0 else 0.0
                weights[s, lane] = chances[s, lane] if rules.family == layout.GPB1 else p
                total += p
        weight_sum = weights.sum()
        if weight_sum > 0.0:
            merge_states(works, first, weights / weight_sum)
        put(works, first + layout.PROBABILITY * WIDTH, total)


@inline
def put(works, element, value):
    """Write an element of a hypothesis into the lanes of all laws."""
    for s in range(len(works)):
        for lane in range(WIDTH):
            works[s, element + lane] = value


@kernel
def merge_states(works, first, weights):
    """Merge mean and covariance of a hypothesis over all laws, with weights (S, WIDTH), into the lanes of all."""
    d = np.empty((layout.STATES, len(works), WIDTH))
    for i in range(layout.STATES):
        element, mean = first + i * WIDTH, 0.0
        for s in range(len(works)):
            for lane in range(WIDTH):
                if weights[s, lane] > 0.0:
                    mean += weights[s, lane] * works[s, element + lane]
        for s in range(len(works)):
            for lane in range(WIDTH):
                d[i, s, lane] = works[s, element + lane] - mean
        put(works, element, mean)
    for axis in range(3):
        element = layout.OWN + 6 * axis
        for i in range(3):
            for j in range(i, 3):
                put_merged_element(works, first + element * WIDTH, weights, d[3 * axis + i], d[3 * axis + j])
                element += 1
    for pair in range(3):
        row_axis, column_axis = (0, 1 + pair) if pair < 2 else (1, 2)
        for i in range(3):
            for j in range(3):
                element = layout.CROSS + 9 * pair + 3 * i + j
                put_merged_element(works, first + element * WIDTH, weights, d[3 * row_axis + i], d[3 * column_axis + j])


@kernel
def put_merged_element(works, element, weights, row_offsets, column_offsets):
    """Write an element of the merged covariance into the lanes of all laws; offsets (S, WIDTH) of the means in the
    lanes from the merged ones."""
    merged = 0.0
    for s in range(len(works)):
        for lane in range(WIDTH):
            if weights[s, lane] > 0.0:
                merged += weights[s, lane] * (works[s, element + lane] + row_offsets[s, lane] * column_offsets[s, lane])
    put(works, element, merged)

"""The logarithm of the likelihood of recorded plots under a filter: the density that its bank gives each plot.

The filter is that of the simulation, run scan by scan. Its eight lanes are eight realisations there; here lane 0 takes
the plots as they are stated, lane 1 as outliers, with FACTOR times their σ. Where outliers are allowed for, what the
two leave of each model is merged by moments after every plot.
"""

import numpy as np

from radarsim.kernels.compile import inline, kernel
from radarsim.kernels.innovations import FACTOR
from radarsim.kernels.lanes import WIDTH, address
from radarsim.studies.multimodel.kernels import records as rec
from radarsim.studies.multimodel.kernels.strip import Filter, Memory, Scans, rules_of, run_strip


@kernel
def log_likelihood(work, numbers, plots, models, transitions, intervals, times, rules, frame, share, score):
    """Add up the densities of the plots of n scans.

    work, numbers: a filter's memory, started; plots (n · PLOT rows), of which lane 1 gets FACTOR times the σ; models,
    transitions, intervals (n,), times, rules, frame as in `strip.filter_strip`; share of outliers. Out: score (n,), the
    logarithm of each plot's density given those before it, zero where there is none.
    """
    n, own = score.size, rules_of(rules, models.size // rec.MODEL_NUMBERS)
    out, reported = np.empty(n * rec.OUTPUT * WIDTH), np.zeros(n, dtype=np.int64)
    for k in range(n):
        for row in range(6):
            plots[(k * rec.PLOT + rec.COVARIANCE + row) * WIDTH + 1] *= FACTOR * FACTOR
    listed = np.zeros(rec.MOST, dtype=np.int64)
    memory = Memory(address(work), address(numbers), address(listed))
    design = Filter(own, address(models), address(transitions))
    for k in range(n):
        scans = Scans(k, k + 1, address(intervals), address(times), address(reported))
        run_strip(memory, design, scans, address(plots), address(frame), address(out))
        score[k] = 0.0
        if plots[(k * rec.PLOT + rec.DETECTED) * WIDTH] > 0.5:
            new = numbers[rec.CURRENT] * rec.BANK
            plain, wild = density(work, rec.BANK - new, new, own, 0), density(work, rec.BANK - new, new, own, 1)
            score[k] = plain
            if share > 0.0:
                plain, wild = plain + np.log(1.0 - share), wild + np.log(share)
                most = max(plain, wild)
                score[k] = most + np.log(np.exp(plain - most) + np.exp(wild - most))
                merge_lanes(work, new, own, np.exp(plain - score[k]), np.exp(wild - score[k]))


@inline
def density(work, old, new, rules, lane):
    """The logarithm of the density that the old bank gave the plot of a lane: Σ c N(innovation; 0, S) over the models.

    c is the predicted probability of a model. Of pairs of models (GPB2) the memory still has those that end in the last
    one: their sum is its part of the whole, of which its new probability is the share.
    """
    size, total, least = rules.size, 0.0, 1e300
    last, at = size - 1, rec.RESULT if rules.family == rec.GPB2 else rec.RESULT_GROUP
    for i in range(size):
        if predicted_probability(work, old, rules, lane, i) > 0.0:
            least = min(least, work[(at + 2 * i) * WIDTH + lane])
    for i in range(size):
        c = predicted_probability(work, old, rules, lane, i)
        if c > 0.0:
            q, determinant = work[(at + 2 * i) * WIDTH + lane], work[(at + 2 * i + 1) * WIDTH + lane]
            total += c * np.exp(0.5 * (least - q)) / np.sqrt(determinant)
    part = work[(new + last * rec.HYPOTHESIS + rec.PROBABILITY) * WIDTH + lane] if rules.family == rec.GPB2 else 1.0
    if not (total > 0.0 and part > 0.0):
        return np.nan
    return np.log(total) - np.log(part) - 0.5 * least - 1.5 * np.log(2.0 * np.pi)


@inline
def predicted_probability(work, old, rules, lane, i):
    """The predicted probability of model i; of GPB2, that of the pair that leads from model i to the last one."""
    if rules.family == rec.GPB2:
        last = rules.size - 1
        return work[(rec.TRANSITION + last * rec.MOST + i) * WIDTH + lane] * probability(work, old, lane, i)
    c = 0.0
    for j in range(rules.size):
        c += work[(rec.TRANSITION + i * rec.MOST + j) * WIDTH + lane] * probability(work, old, lane, j)
    return c


@inline
def probability(work, bank, lane, i):
    """The probability of model i of a bank."""
    return work[(bank + i * rec.HYPOTHESIS + rec.PROBABILITY) * WIDTH + lane]


@kernel
def merge_lanes(work, bank, rules, plain, wild):
    """Merge each model's hypotheses of lanes 0 and 1, of chances plain and wild, into both."""
    for i in range(rules.size):
        first = (bank + i * rec.HYPOTHESIS) * WIDTH
        p, q = plain * probability(work, bank, 0, i), wild * probability(work, bank, 1, i)
        # GPB1 has one hypothesis, the first, whatever the models' probabilities are.
        a, b = (plain, wild) if rules.family == rec.GPB1 else (p, q)
        whole = a + b
        if whole > 0.0:
            merge_states(work, first, a / whole, b / whole)
        work[first + rec.PROBABILITY * WIDTH] = work[first + rec.PROBABILITY * WIDTH + 1] = p + q


@kernel
def merge_states(work, first, a, b):
    """Merge mean and covariance of lanes 0 and 1 of a hypothesis, of weights a and b, into both."""
    d = np.empty(rec.STATES)
    for s in range(rec.STATES):
        at = first + s * WIDTH
        d[s] = work[at + 1] - work[at]
        work[at] = work[at + 1] = work[at] + b * d[s]
    for axis in range(3):
        at = rec.OWN + 6 * axis
        for i in range(3):
            for j in range(i, 3):
                both(work, first + at * WIDTH, a, b, d[3 * axis + i] * d[3 * axis + j])
                at += 1
    for pair in range(3):
        one, other = (0, 1 + pair) if pair < 2 else (1, 2)
        for i in range(3):
            for j in range(3):
                at = rec.CROSS + 9 * pair + 3 * i + j
                both(work, first + at * WIDTH, a, b, d[3 * one + i] * d[3 * other + j])


@inline
def both(work, at, a, b, spread):
    """One element of the merged covariance, into lanes 0 and 1."""
    work[at] = work[at + 1] = a * work[at] + b * work[at + 1] + a * b * spread

"""Hypotheses on a track's folds, and on which of its bursts locked: the Bayes filter if none is dropped.

With its folds and locks given, a hypothesis is a Kalman filter. At each scan all are predicted and weighted by the
range; each branches over the folds that the velocity leaves possible (and, in a mixture, over a burst that did not
lock); those too far below the best, or beyond the number kept, are dropped. The acceleration is taken before the
velocity, so that it weights a hypothesis and not its folds."""

import math

from radarsim.kernels.compiler import inline, kernel_part
from radarsim.kernels.hypotheses import (
    FALL,
    INNOVATION,
    NEAR,
    NO_HYPOTHESIS,
    HypothesisLists,
    branch,
    column,
    keep_greatest,
)
from radarsim.kernels.kalman_algebra import add_scaled, take_rate, take_second_rate, take_value
from radarsim.kernels.lanes import WIDTH, address, row
from radarsim.kernels.random import normals
from radarsim.studies.pulses_to_tracks.kernels.layout import LISTED, MIXTURE, NUMBER, RIGHT, TAKEN, WRONG_FOLD
from radarsim.studies.pulses_to_tracks.kernels.steps import (
    fold,
    predict_state,
    put_state,
    score_burst,
    start_state,
    state_of,
)

WEIGHT_COLUMN = 3  # of the first list of `kernels.hypotheses.HypothesisLists`


@inline
def best_hypothesis(weights, count):
    """The index of the first of the greatest weights."""
    best = 0
    for h in range(1, count):
        best = h if weights[h] > weights[best] else best
    return best


@kernel_part
def take_ranges_in_hypotheses(world, options, k, first, work):
    """Predict all hypotheses to scan k and weigh them by its range; tracks are set to those of the best hypotheses."""
    variance, hypotheses = world.sigma_r**2, work.hypotheses
    for i in range(hypotheses.count.size):
        noise = world.sigma_r * normals(world.keys[0, 0], world.keys[0, 1], first + i, k)[0]
        states, weights = hypotheses.states[i], hypotheses.weights[i]
        if k == 0:
            hypotheses.count[i], hypotheses.right[i, 0], weights[0] = 1, 1.0, 0.0
            x, P = start_state(world, first + i, noise)
            put_state(states, 0, x, P)
        else:
            for h in range(hypotheses.count[i]):
                x, P = state_of(states, h)
                x, P = predict_state(world, options, k, x, P)
                P, gain, S = take_value(P, variance, 1.0)
                e = noise - x[0]
                weights[h] -= 0.5 * (e * e / S + math.log(S))
                put_state(states, h, add_scaled(x, e, gain), P)
        x, P = state_of(states, best_hypothesis(weights, hypotheses.count[i]))
        put_state(work.tracks, i, x, P)


@kernel_part
def branch_hypotheses(options, sigma, measured, span, hypotheses, i, lists):
    """Branch the hypotheses of realisation i over the folds of a measured velocity; returns the number of branches.

    A parent below zero, -1 - h, marks a branch of hypothesis h in which the burst did not lock."""
    v, a, best = measured[0], measured[1], NO_HYPOTHESIS
    w, e = column(lists, 0, WEIGHT_COLUMN), column(lists, 2, INNOVATION)
    near, c = column(lists, 2, NEAR), column(lists, 2, FALL)
    mixture, log_lock, log_lost = options.use == MIXTURE, 0.0, NO_HYPOTHESIS
    if mixture:
        log_lock, log_lost = math.log(options.lock), math.log((1.0 - options.lock) * options.density)
    states = hypotheses.states[i]
    for h in range(hypotheses.count[i]):
        x, P = state_of(states, h)
        weight = hypotheses.weights[i, h] + log_lock
        if options.takes == 2:
            deviation = a - x[2]
            P, gain, S = take_second_rate(P, sigma[1] ** 2, 1.0)
            x = add_scaled(x, deviation, gain)
            weight -= 0.5 * (deviation * deviation / S + math.log(2.0 * math.pi * S))
        S = P[3] + sigma[0] ** 2
        w[h], e[h], c[h] = weight - 0.5 * math.log(2.0 * math.pi * S), fold(v - x[1], span), 0.5 / S
        near[h] = w[h] - c[h] * e[h] * e[h]
        best = max(best, near[h], hypotheses.weights[i, h] + log_lost)
    branch_count = branch(lists, 0, hypotheses.count[i], span, best, options.max_depth, options.max_hypotheses)
    if mixture:
        weights, innovations = lists.children, row(lists.children, lists.most // WIDTH)
        for h in range(hypotheses.count[i]):
            weight = hypotheses.weights[i, h] + log_lost
            if weight >= best - options.max_depth:
                weights[branch_count], innovations[branch_count], lists.parents[branch_count] = weight, 0.0, -1 - h
                branch_count += 1
        if branch_count > options.max_hypotheses:
            keep_greatest(lists, branch_count, options.max_hypotheses)
            branch_count = options.max_hypotheses
    return branch_count


@kernel_part
def put_children(options, sigma, measured, span, hypotheses, i, branch_count, lists):
    """Replace the hypotheses of realisation i by its branches.

    Returns the sums of weights of those that took the velocity, of those that took it in a wrong fold, and of all."""
    weights, innovations = lists.children, row(lists.children, lists.most // WIDTH)
    best = weights[best_hypothesis(weights, branch_count)]
    states, taken_weight, wrong_weight, weight_sum = hypotheses.states[i], 0.0, 0.0, 0.0
    for j in range(branch_count):
        parent, weight = lists.parents[j], math.exp(weights[j] - best)
        h = parent if parent >= 0 else -1 - parent
        x, P = state_of(states, h)
        right = hypotheses.right[i, h]
        if parent >= 0:
            if options.takes == 2:
                P, gain, _ = take_second_rate(P, sigma[1] ** 2, 1.0)
                x = add_scaled(x, measured[1] - x[2], gain)
            is_wrong = abs(innovations[j] + x[1]) > 0.5 * span
            P, gain, _ = take_rate(P, sigma[0] ** 2, 1.0)
            x = add_scaled(x, innovations[j], gain)
            taken_weight += weight
            if is_wrong:
                right, wrong_weight = 0.0, wrong_weight + weight
        weight_sum += weight
        put_state(hypotheses.child_states, j, x, P)
        hypotheses.child_states[j, 9] = right
    for j in range(branch_count):
        hypotheses.weights[i, j], hypotheses.right[i, j] = weights[j] - best, hypotheses.child_states[j, 9]
        for n in range(9):
            hypotheses.states[i, j, n] = hypotheses.child_states[j, n]
    hypotheses.count[i] = branch_count
    return taken_weight, wrong_weight, weight_sum


@inline
def put_estimate(options, hypotheses, i, best, weight_sum, target):
    """Write into target (3) the best hypothesis of realisation i, or the weighted mean of all."""
    for c in range(3):
        target[c] = hypotheses.states[i, best, c]
        if options.averages == 1:
            total = 0.0
            for h in range(hypotheses.count[i]):
                total += math.exp(hypotheses.weights[i, h]) * hypotheses.states[i, h, c]
            target[c] = total / weight_sum


@kernel_part
def take_folds(world, filters, f, k, work, sums):
    """Take the estimates of a scan into the hypotheses; counts and errors are added to the sums."""
    options, hypotheses, span, sigma = filters.filters[f], work.hypotheses, world.span, filters.sigma[f, k]
    locks, folds = sums.locks[f, k], sums.folds[f, k]
    lists = HypothesisLists(
        address(hypotheses.columns),
        address(hypotheses.children),
        address(hypotheses.parents),
        hypotheses.weights.shape[1],
        hypotheses.parents.size,
    )
    for i in range(hypotheses.count.size):
        v, a = fold(work.measured[i, 0], span), work.measured[i, 1]
        score_burst(sigma, options.takes, v, a, i, work.ages, locks, sums.measured[f, k])
        branch_count = branch_hypotheses(options, sigma, (v, a), span, hypotheses, i, lists)
        taken_weight, wrong_weight, weight_sum = put_children(
            options, sigma, (v, a), span, hypotheses, i, branch_count, lists
        )
        best = best_hypothesis(hypotheses.weights[i], branch_count)
        put_estimate(options, hypotheses, i, best, weight_sum, work.tracks[i])
        locks[TAKEN] += taken_weight / weight_sum
        locks[WRONG_FOLD] += wrong_weight / weight_sum
        folds[RIGHT] += hypotheses.right[i, best]
        folds[LISTED] += hypotheses.right[i, :branch_count].max()
        folds[NUMBER] += branch_count

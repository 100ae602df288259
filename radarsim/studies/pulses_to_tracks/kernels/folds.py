"""Hypotheses on a track's folds, and on which of its bursts locked: the Bayes filter where none is dropped.

Given its folds, and which of its bursts locked, a hypothesis is a Kalman filter of its own (`kernels.steps`). A scan
moves all and weighs them by the range, branches each over the folds that the velocity leaves possible (and, as a
mixture, over a burst that did not lock), and drops what is too far below the best or beyond the number that is kept.
The acceleration is taken before the velocity, so that it weighs a hypothesis and not its folds.
"""

import math

from radarsim.kernels.algebra import add_scaled, take_rate, take_second_rate, take_value
from radarsim.kernels.compile import inline, part
from radarsim.kernels.hypotheses import FALL, INNOVATION, NEAR, NOTHING, Lists, branched, column, keep_greatest
from radarsim.kernels.lanes import WIDTH, address, row
from radarsim.kernels.random import normals
from radarsim.studies.pulses_to_tracks.kernels import records as rec
from radarsim.studies.pulses_to_tracks.kernels.steps import a_scan_later, begun, folded, put_state, scored, state_of

WEIGHT_COLUMN = 3  # of the first list of `kernels.hypotheses.Lists`


@inline
def heaviest(weights, count):
    """The first of the greatest weights."""
    best = 0
    for h in range(1, count):
        best = h if weights[h] > weights[best] else best
    return best


@part
def ranges_to_hypotheses(world, own, k, first, work):
    """Predict all hypotheses to scan k and weigh them by its range; the tracks become those of the best."""
    variance, held = world.sigma_r**2, work.held
    for i in range(held.count.size):
        noise = world.sigma_r * normals(world.keys[0, 0], world.keys[0, 1], first + i, k)[0]
        states, weights = held.states[i], held.weights[i]
        if k == 0:
            held.count[i], held.right[i, 0], weights[0] = 1, 1.0, 0.0
            x, P = begun(world, first + i, noise)
            put_state(states, 0, x, P)
        else:
            for h in range(held.count[i]):
                x, P = state_of(states, h)
                x, P = a_scan_later(world, own, k, x, P)
                P, gain, S = take_value(P, variance, 1.0)
                e = noise - x[0]
                weights[h] -= 0.5 * (e * e / S + math.log(S))
                put_state(states, h, add_scaled(x, e, gain), P)
        x, P = state_of(states, heaviest(weights, held.count[i]))
        put_state(work.tracks, i, x, P)


@part
def branches(own, sigma, measured, span, held, i, lists):
    """Branch the hypotheses of realisation i over the folds of a measured velocity and acceleration: how many.

    A parent below zero, -1 - h, is that of a branch in which the burst did not lock.
    """
    v, a, best = measured[0], measured[1], NOTHING
    w, e = column(lists, 0, WEIGHT_COLUMN), column(lists, 2, INNOVATION)
    near, c = column(lists, 2, NEAR), column(lists, 2, FALL)
    mixture, lock, lost = own.use == rec.MIXTURE, 0.0, NOTHING
    if mixture:
        lock, lost = math.log(own.lock), math.log((1.0 - own.lock) * own.density)
    states = held.states[i]
    for h in range(held.count[i]):
        x, P = state_of(states, h)
        weight = held.weights[i, h] + lock
        if own.takes == 2:
            off = a - x[2]
            P, gain, S = take_second_rate(P, sigma[1] ** 2, 1.0)
            x = add_scaled(x, off, gain)
            weight -= 0.5 * (off * off / S + math.log(2.0 * math.pi * S))
        S = P[3] + sigma[0] ** 2
        w[h], e[h], c[h] = weight - 0.5 * math.log(2.0 * math.pi * S), folded(v - x[1], span), 0.5 / S
        near[h] = w[h] - c[h] * e[h] * e[h]
        best = max(best, near[h], held.weights[i, h] + lost)
    made = branched(lists, 0, held.count[i], span, best, own.deepest, own.kept)
    if mixture:
        weights, found = lists.children, row(lists.children, lists.most // WIDTH)
        for h in range(held.count[i]):
            if held.weights[i, h] + lost >= best - own.deepest:
                weights[made], found[made], lists.parents[made] = held.weights[i, h] + lost, 0.0, -1 - h
                made += 1
        if made > own.kept:
            keep_greatest(lists, made, own.kept)
            made = own.kept
    return made


@part
def inherited(own, sigma, measured, span, held, i, made, lists):
    """Put `made` branches in the place of realisation i's hypotheses.

    Gives the weights of those that took the velocity, of those that took it in a wrong fold, and of all.
    """
    weights, found = lists.children, row(lists.children, lists.most // WIDTH)
    best = weights[heaviest(weights, made)]
    states, taken, wrong, whole = held.states[i], 0.0, 0.0, 0.0
    for j in range(made):
        parent, weight = lists.parents[j], math.exp(weights[j] - best)
        h = parent if parent >= 0 else -1 - parent
        x, P = state_of(states, h)
        right = held.right[i, h]
        if parent >= 0:
            if own.takes == 2:
                P, gain, _ = take_second_rate(P, sigma[1] ** 2, 1.0)
                x = add_scaled(x, measured[1] - x[2], gain)
            off = abs(found[j] + x[1]) > 0.5 * span
            P, gain, _ = take_rate(P, sigma[0] ** 2, 1.0)
            x = add_scaled(x, found[j], gain)
            right, taken, wrong = 0.0 if off else right, taken + weight, wrong + (weight if off else 0.0)
        whole += weight
        put_state(held.fresh, j, x, P)
        held.fresh[j, 9] = right
    for j in range(made):
        held.weights[i, j], held.right[i, j] = weights[j] - best, held.fresh[j, 9]
        for n in range(9):
            held.states[i, j, n] = held.fresh[j, n]
    held.count[i] = made
    return taken, wrong, whole


@inline
def put_estimate(own, held, i, best, whole, to):
    """The best hypothesis of realisation i, or the mean of all by their weights, of sum `whole`, into to (3)."""
    for c in range(3):
        to[c] = held.states[i, best, c]
        if own.averages == 1:
            total = 0.0
            for h in range(held.count[i]):
                total += math.exp(held.weights[i, h]) * held.states[i, h, c]
            to[c] = total / whole


@part
def take_folds(world, filters, f, k, work, sums):
    """As `chain.take_estimates`, by hypotheses."""
    own, held, span, sigma = filters.filters[f], work.held, world.span, filters.sigma[f, k]
    locks, folds = sums.locks[f, k], sums.folds[f, k]
    lists = Lists(
        address(held.columns), address(held.children), address(held.parents), held.weights.shape[1], held.parents.size
    )
    for i in range(held.count.size):
        v, a = folded(work.measured[i, 0], span), work.measured[i, 1]
        scored(sigma, own.takes, v, a, i, work.ages, locks, sums.measured[f, k])
        made = branches(own, sigma, (v, a), span, held, i, lists)
        taken, wrong, whole = inherited(own, sigma, (v, a), span, held, i, made, lists)
        best = heaviest(held.weights[i], made)
        put_estimate(own, held, i, best, whole, work.tracks[i])
        locks[rec.TAKEN] += taken / whole
        locks[rec.WRONG_FOLD] += wrong / whole
        folds[rec.RIGHT] += held.right[i, best]
        folds[rec.LISTED] += held.right[i, :made].max()
        folds[rec.NUMBER] += made

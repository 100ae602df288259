"""Textbook twins of the kernels: one realisation, joint updates with full matrices, lists of hypotheses in Python.

A plot is (range, velocity as folded, velocity before it was folded, whether it came); sigma and P0 as in the study.
"""

import itertools

import numpy as np

from radarsim.studies.ambiguous_doppler.filters import model, prior_variances
from tests.tolerances import Z, rounding, scaled_condition

SIZE = np.array([1e5, 1e3, 10.0])  # of the ranges, velocities and accelerations that are added up


def wrapped(x, D):
    """x folded into -D/2 … D/2."""
    return x - D * np.rint(x / D)


class Kalman:
    """A Kalman filter of one set of options: predictions and joint updates of a state and a covariance."""

    def __init__(self, one, prior, sigma, dt):
        (order,), (variance,) = one.orders, one.variances
        self.F, self.Q = model(order, variance, dt)
        self.P0 = np.diag([0.0, *prior_variances(order, prior)])
        self.sigma = np.asarray(sigma, dtype=float)
        self.observes = 1 if one.doppler == "none" else 2

    def predicted(self, x, P):
        return self.F @ x, self.F @ P @ self.F.T + self.Q

    def started(self, z, P):
        """A first plot: its range is taken as it is, whatever else is known."""
        P = P.copy()
        P[0] = P[:, 0] = 0.0
        P[0, 0] = self.sigma[0] ** 2
        return np.array([z, 0.0, 0.0]), P

    def updated(self, x, P, z, rows):
        """The update by several components at once, and the logarithm of its likelihood."""
        H, R = np.eye(3)[rows], np.diag(self.sigma[rows] ** 2)
        S = H @ P @ H.T + R
        K = P @ H.T @ np.linalg.inv(S)
        e = np.asarray(z) - H @ x
        log_likelihood = -0.5 * (e @ np.linalg.solve(S, e) + np.log(np.linalg.det(S)))
        kept = np.eye(3) - K @ H
        return x + K @ e, kept @ P @ kept.T + K @ R @ K.T, log_likelihood


def precision(kalman, came, size=SIZE):
    """Rounding of estimates (3,) and, relative, of weights, of a filter whose plots came at some scans (K,).

    An update does ten operations on the covariance before it. They are amplified by how much less is left of a number
    that is not measured, and by κ of what is left; no later scan amplifies them. Innovations are of up to Z σ.
    """
    P, started, condition, estimates = kalman.P0, False, 0.0, rounding(operations=10 * len(came)) * size
    for k in range(len(came)):
        P = kalman.predicted(np.zeros(3), P)[1] if k else P
        if came[k]:
            rows = np.arange(kalman.observes) if started else np.arange(1, kalman.observes)
            before = P if started else kalman.started(0.0, P)[1]
            P = kalman.updated(np.zeros(3), before, np.zeros(len(rows)), rows)[1] if len(rows) else before
            left, had = np.diag(P).copy(), np.diag(before).copy()
            left[rows], had[rows] = 1.0, 1.0
            condition += (had[left > 0] / left[left > 0]).max() * scaled_condition(P)
            spread = rounding(Z * condition, 10) * np.sqrt(np.diag(before))
            estimates, started = np.maximum(estimates, rounding(operations=10 * len(came)) * size + spread), True
    return estimates, rounding(Z * condition, 10)


def single(kalman, plots, spans, how):
    """States (K, 3) of a filter with one hypothesis, and whether all folds are right (K,).

    how: none, unfolded, nearest.
    """
    x, P, started, right, made = np.zeros(3), kalman.P0, False, True, []
    for k, (r, v, u, came) in enumerate(plots):
        if k > 0:
            x, P = kalman.predicted(x, P)
        if came:
            if started:
                predicted = kalman.updated(x, P, [r], [0])[:2]
            else:
                predicted = kalman.started(r, P)
            taken = u if how == "unfolded" else predicted[0][1] + wrapped(v - predicted[0][1], spans[k])
            right = right and (how != "nearest" or bool(abs(taken - u) < spans[k] / 2))
            if how == "none":
                x, P = predicted
            elif started:
                x, P, _ = kalman.updated(x, P, [r, taken], [0, 1])
            else:
                x, P, _ = kalman.updated(*predicted, [taken], [1])
            started = True
        made.append((*x, right))
    made = np.array(made, dtype=float)
    return made[:, :3], made[:, 3]


def remainder(z, rate, z_before, rate_before, wavelength):
    """The velocity of the joint span that folds to z at one rate, most nearly to z_before at another; whole Hz."""
    D, other = wavelength * rate / 2, wavelength * rate_before / 2
    joint = wavelength * np.lcm(round(rate), round(rate_before)) / 2
    every = z + D * np.arange(-int(joint / D) - 2, int(joint / D) + 3)
    every = every[(every >= -joint / 2) & (every < joint / 2)]
    assert len(every) == round(joint / D)
    return every[np.argmin(np.abs(wrapped(every - z_before, other)))]


def with_velocities(kalman, plots, velocities):
    """States (K, 3) of a filter that takes ranges, and velocities (K,) where they are numbers."""
    x, P, started, made = np.zeros(3), kalman.P0, False, []
    for k, (r, _, _, came) in enumerate(plots):
        if k > 0:
            x, P = kalman.predicted(x, P)
        if came and started:
            taken = [r] if np.isnan(velocities[k]) else [r, velocities[k]]
            x, P, _ = kalman.updated(x, P, taken, [0, 1][: len(taken)])
        elif came:
            x, P = kalman.started(r, P)
            started = True
        made.append(x)
    return np.array(made)


def merged(kalman, plots, spans, folds=60):
    """States (K, 3) of the filter that merges all folds of a scan into one state and covariance."""
    x, P, started, made = np.zeros(3), kalman.P0, False, []
    for k, (r, v, _, came) in enumerate(plots):
        if k > 0:
            x, P = kalman.predicted(x, P)
        if came:
            x, P = kalman.updated(x, P, [r], [0])[:2] if started else kalman.started(r, P)
            near = x[1] + wrapped(v - x[1], spans[k])
            branches = [kalman.updated(x, P, [near + n * spans[k]], [1]) for n in range(-folds, folds + 1)]
            w = np.exp([b[2] - max(b[2] for b in branches) for b in branches])
            w /= w.sum()
            mean = sum(p * b[0] for p, b in zip(w, branches, strict=True))
            P = sum(p * (b[1] + np.outer(b[0] - mean, b[0] - mean)) for p, b in zip(w, branches, strict=True))
            x, started = mean, True
        made.append(x)
    return np.array(made)


def remembering(kalman, plots, spans, most, prune_below, folds=60):
    """Outputs (K, 10) of the filter that keeps hypotheses: mean (3), best (3), right, listed, count, probability.

    A hypothesis is (state, logarithm of weight, whether all folds are right); the covariance is common to all.
    """
    listed, P, started, made = [(np.zeros(3), 0.0, True)], kalman.P0, False, []
    for k, (r, v, u, came) in enumerate(plots):
        if k > 0:
            moved = [(kalman.predicted(x, P)[0], w, right) for x, w, right in listed]
            listed, P = moved, kalman.predicted(listed[0][0], P)[1]
        if came:
            children, D = [], spans[k]
            for x, w, right in listed:
                x, after, like = kalman.updated(x, P, [r], [0]) if started else (*kalman.started(r, P), 0.0)
                near = x[1] + wrapped(v - x[1], D)
                order = sorted(range(-folds, folds + 1), key=lambda n: (abs(n), -n))
                for n in order:
                    y, final, more = kalman.updated(x, after, [near + n * D], [1])
                    children.append((y, w + like + more, right and bool(abs(near + n * D - u) < D / 2)))
            top = max(w for _, w, _ in children)
            children = [(x, w - top, right) for x, w, right in children]
            if prune_below > 0:
                children = [one for one in children if one[1] >= np.log(prune_below)]
            listed = sorted(children, key=lambda one: -one[1])[:most]
            P, started = final, True
        w = np.exp([w for _, w, _ in listed])
        x = np.array([x for x, _, _ in listed])
        best = int(np.argmax(w))
        known = (listed[best][2], any(one[2] for one in listed), len(listed), w[best] / w.sum())
        made.append((*(w @ x / w.sum()), *x[best], *known))
    return np.array(made, dtype=float)


def enumerated(one, prior, sigma, dt, plots, spans, folds):
    """The Bayes mean and the probability of the best sequence at the last scan, over all sequences of folds.

    No recursion: all plots are linear in (first range, V, a, random derivatives); of each sequence the least squares.
    """
    F, Q = model(2, one.manoeuvre_variance, dt)
    K = len(plots)
    jumps = Q[:, [2]] / np.sqrt(Q[2, 2]) if Q.any() else np.zeros((3, 0))  # order 2: one random number a scan
    size = 3 + jumps.shape[1] * (K - 1)
    states, state = [], np.eye(3, size)
    for k in range(K):
        if k > 0:
            state = F @ state
            at = 3 + jumps.shape[1] * (k - 1)
            state[:, at : at + jumps.shape[1]] += jumps
        states.append(state)
    A = np.concatenate([state[:2] for state in states])
    scale = np.tile(1 / np.asarray(sigma, dtype=float), K)
    information = np.diag(np.concatenate([[0.0], 1 / prior_variances(2, prior), np.ones(size - 3)]))
    B = scale[:, None] * A
    solve = np.linalg.solve(information + B.T @ B, B.T)  # of whitened plots, the estimate
    whole = np.eye(2 * K) - B @ solve
    numbers = np.array(list(itertools.product(range(-folds, folds + 1), repeat=K)))
    y = np.empty((len(numbers), 2 * K))
    y[:, 0::2] = [r for r, *_ in plots]
    y[:, 1::2] = [v for _, v, *_ in plots] + numbers * np.asarray(spans)
    y *= scale
    cost = 0.5 * np.einsum("ni,ij,nj->n", y, whole, y)
    w = np.exp(cost.min() - cost)
    return states[-1] @ solve @ (w @ y / w.sum()), w.max() / w.sum()


def interacting(kalmans, plots, spans, stay, folds=0):
    """Means (K, 3) and probabilities (K, M) of filters that interact (IMM); so many folds to either side are merged.

    Likelihoods are of range and velocity at once; of a track's first plot, of the velocity alone.
    """
    M = len(kalmans)
    p = np.full((M, M), (1 - stay) / (M - 1)) + np.eye(M) * (stay - (1 - stay) / (M - 1))
    states = [(np.zeros(3), one.P0) for one in kalmans]
    mu, started, made = np.full(M, 1 / M), False, []
    for k, (r, v, u, came) in enumerate(plots):
        c = p.T @ mu
        share = p * mu[:, None] / c
        mean = [sum(share[j, i] * states[j][0] for j in range(M)) for i in range(M)]
        spread = [[np.outer(states[j][0] - mean[i], states[j][0] - mean[i]) for j in range(M)] for i in range(M)]
        P = [sum(share[j, i] * (states[j][1] + spread[i][j]) for j in range(M)) for i in range(M)]
        states, logs = list(zip(mean, P, strict=True)), np.zeros(M)
        for i, one in enumerate(kalmans):
            x, P = one.predicted(*states[i]) if k > 0 else states[i]
            if came:
                x, P, logs[i] = one.updated(x, P, [r], [0]) if started else (*one.started(r, P), 0.0)
                if one.observes == 2:
                    near = x[1] + wrapped(v - x[1], spans[k]) if folds else u
                    every = [one.updated(x, P, [near + n * spans[k]], [1]) for n in range(-folds, folds + 1)]
                    most = max(branch[2] for branch in every)
                    w = np.exp([branch[2] - most for branch in every])
                    logs[i] += most + np.log(w.sum())
                    w /= w.sum()
                    x = sum(a * branch[0] for a, branch in zip(w, every, strict=True))
                    P = sum(a * (b[1] + np.outer(b[0] - x, b[0] - x)) for a, b in zip(w, every, strict=True))
            states[i] = x, P
        started = started or came > 0
        mu = c * np.exp(logs - logs.max())
        mu /= mu.sum()
        made.append((*sum(m * x for m, (x, _) in zip(mu, states, strict=True)), *mu))
    made = np.array(made)
    return made[:, :3], made[:, 3:]


def together(kalmans, plots, spans, stay, most, prune_below, folds):
    """Outputs (K, 10 + M) of hypotheses in each of which orders interact: as `remembering`, then the orders' weights.

    A hypothesis is (states and covariances of the orders, their probabilities, logarithm of weight, whether right).
    """
    M = len(kalmans)
    p = np.full((M, M), (1 - stay) / (M - 1)) + np.eye(M) * (stay - (1 - stay) / (M - 1))
    listed = [([(np.zeros(3), one.P0) for one in kalmans], np.full(M, 1 / M), 0.0, True)]
    started, made = False, []
    for k, (r, v, u, came) in enumerate(plots):
        children, D = [], spans[k]
        for states, mu, w, right in listed:
            c = p.T @ mu
            share = p * mu[:, None] / c
            mean = [sum(share[j, i] * states[j][0] for j in range(M)) for i in range(M)]
            apart = [[np.outer(states[j][0] - mean[i], states[j][0] - mean[i]) for j in range(M)] for i in range(M)]
            P = [sum(share[j, i] * (states[j][1] + apart[i][j]) for j in range(M)) for i in range(M)]
            after, logs = [], np.log(c)
            for i, one in enumerate(kalmans):
                x, Q = one.predicted(mean[i], P[i]) if k > 0 else (mean[i], P[i])
                if came:
                    x, Q, like = one.updated(x, Q, [r], [0]) if started else (*one.started(r, Q), 0.0)
                    logs[i] += like
                after.append((x, Q))
            if not came:
                children.append((after, np.exp(logs), w, right))
                continue
            about = v + D * np.rint((np.exp(logs - logs.max()) @ [x[1] for x, _ in after] - v) / D)
            for n in range(-folds, folds + 1):
                taken = [one.updated(*after[i], [about + n * D], [1]) for i, one in enumerate(kalmans)]
                both = logs + [like for _, _, like in taken]
                share = np.exp(both - both.max())
                weight = w + both.max() + np.log(share.sum())
                right_too = right and bool(abs(about + n * D - u) < D / 2)
                children.append(([state[:2] for state in taken], share / share.sum(), weight, right_too))
        top = max(one[2] for one in children)
        children = [(*one[:2], one[2] - top, one[3]) for one in children]
        if prune_below > 0:
            children = [one for one in children if one[2] >= np.log(prune_below)]
        listed = sorted(children, key=lambda one: -one[2])[:most]
        started = started or came > 0
        w = np.exp([one[2] for one in listed])
        x = np.array([sum(m * state[0] for m, state in zip(one[1], one[0], strict=True)) for one in listed])
        best = int(np.argmax(w))
        known = (listed[best][3], any(one[3] for one in listed), len(listed), w[best] / w.sum())
        of_orders = w @ np.array([one[1] for one in listed]) / w.sum()
        made.append((*(w @ x / w.sum()), *x[best], *known, *of_orders))
    return np.array(made, dtype=float)


def intersected(estimates, widths):
    """The smoothest of estimates (I,) whose interval meets those of all rougher; widths (I,) half, 0: not there."""
    order = [i for i in np.argsort(-np.asarray(widths), kind="stable") if widths[i] > 0]
    found = order[0] if order else None
    for n in range(1, len(order) + 1):
        some = order[:n]
        meets = all(
            abs(estimates[i] - estimates[j]) <= widths[i] + widths[j] for a, i in enumerate(some) for j in some[:a]
        )
        if not meets:
            break
        found = some[-1]
    return found

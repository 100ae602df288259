"""Textbook twins of the kernels: one realisation, joint updates with full matrices, lists of hypotheses in Python.

A plot is (range, velocity as folded, velocity before it was folded, whether it came); sigma and P0 as in the study.
"""

import itertools

import numpy as np

from radarsim.studies.ambiguous_doppler.filter_design import model, prior_variances
from tests.tolerances import Z, rounding, scaled_condition

SIZE = np.array([1e5, 1e3, 10.0])  # of the ranges, velocities and accelerations that are added up


def wrap(x, D):
    """x folded into -D/2 … D/2."""
    return x - D * np.rint(x / D)


class Kalman:
    """A Kalman filter of one set of options: predictions and joint updates of a state and a covariance."""

    def __init__(self, options, prior, sigma, dt):
        (order,), (variance,) = options.orders, options.variances
        self.F, self.Q = model(order, variance, dt)
        self.P0 = np.diag([0.0, *prior_variances(order, prior)])
        self.sigma = np.asarray(sigma, dtype=float)
        self.observes = 1 if options.doppler == "none" else 2

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
        factor = np.eye(3) - K @ H
        return x + K @ e, factor @ P @ factor.T + K @ R @ K.T, log_likelihood


def rounding_errors(kalman, detected, size=SIZE):
    """Rounding of estimates (3,) and, relative, of weights, of a filter whose plots came at some scans (K,).

    An update does ten operations on the covariance before it. They are amplified by how much less is left of a number
    that is not measured, and by κ of what is left; no later scan amplifies them. Innovations are of up to Z σ.
    """
    P, started, condition, estimates = kalman.P0, False, 0.0, rounding(operations=10 * len(detected)) * size
    for k in range(len(detected)):
        P = kalman.predicted(np.zeros(3), P)[1] if k else P
        if detected[k]:
            rows = np.arange(kalman.observes) if started else np.arange(1, kalman.observes)
            prior_P = P if started else kalman.started(0.0, P)[1]
            P = kalman.updated(np.zeros(3), prior_P, np.zeros(len(rows)), rows)[1] if len(rows) else prior_P
            remaining, previous = np.diag(P).copy(), np.diag(prior_P).copy()
            remaining[rows], previous[rows] = 1.0, 1.0
            condition += (previous[remaining > 0] / remaining[remaining > 0]).max() * scaled_condition(P)
            spread = rounding(Z * condition, 10) * np.sqrt(np.diag(prior_P))
            estimates, started = np.maximum(estimates, rounding(operations=10 * len(detected)) * size + spread), True
    return estimates, rounding(Z * condition, 10)


def single_hypothesis_states(kalman, plots, spans, folds):
    """States (K, 3) of a filter with one hypothesis, and whether all folds are right (K,).

    how: none, unfolded, nearest.
    """
    x, P, started, right, rows = np.zeros(3), kalman.P0, False, True, []
    for k, (r, v, u, detected) in enumerate(plots):
        if k > 0:
            x, P = kalman.predicted(x, P)
        if detected:
            if started:
                predicted = kalman.updated(x, P, [r], [0])[:2]
            else:
                predicted = kalman.started(r, P)
            velocity = u if folds == "unfolded" else predicted[0][1] + wrap(v - predicted[0][1], spans[k])
            right = right and (folds != "nearest" or bool(abs(velocity - u) < spans[k] / 2))
            if folds == "none":
                x, P = predicted
            elif started:
                x, P, _ = kalman.updated(x, P, [r, velocity], [0, 1])
            else:
                x, P, _ = kalman.updated(*predicted, [velocity], [1])
            started = True
        rows.append((*x, right))
    rows = np.array(rows, dtype=float)
    return rows[:, :3], rows[:, 3]


def chinese_remainder(z, rate, previous_z, previous_rate, wavelength):
    """The velocity of the joint span that folds to z at one rate, most nearly to z_before at another; whole Hz."""
    D, previous_D = wavelength * rate / 2, wavelength * previous_rate / 2
    joint = wavelength * np.lcm(round(rate), round(previous_rate)) / 2
    candidates = z + D * np.arange(-int(joint / D) - 2, int(joint / D) + 3)
    candidates = candidates[(candidates >= -joint / 2) & (candidates < joint / 2)]
    assert len(candidates) == round(joint / D)
    return candidates[np.argmin(np.abs(wrap(candidates - previous_z, previous_D)))]


def with_velocities(kalman, plots, velocities):
    """States (K, 3) of a filter that takes ranges, and velocities (K,) where they are numbers."""
    x, P, started, states = np.zeros(3), kalman.P0, False, []
    for k, (r, _, _, detected) in enumerate(plots):
        if k > 0:
            x, P = kalman.predicted(x, P)
        if detected and started:
            measured = [r] if np.isnan(velocities[k]) else [r, velocities[k]]
            x, P, _ = kalman.updated(x, P, measured, [0, 1][: len(measured)])
        elif detected:
            x, P = kalman.started(r, P)
            started = True
        states.append(x)
    return np.array(states)


def merged_fold_states(kalman, plots, spans, folds=60):
    """States (K, 3) of the filter that merges all folds of a scan into one state and covariance."""
    x, P, started, states = np.zeros(3), kalman.P0, False, []
    for k, (r, v, _, detected) in enumerate(plots):
        if k > 0:
            x, P = kalman.predicted(x, P)
        if detected:
            x, P = kalman.updated(x, P, [r], [0])[:2] if started else kalman.started(r, P)
            nearest = x[1] + wrap(v - x[1], spans[k])
            branches = [kalman.updated(x, P, [nearest + n * spans[k]], [1]) for n in range(-folds, folds + 1)]
            w = np.exp([b[2] - max(b[2] for b in branches) for b in branches])
            w /= w.sum()
            mean = sum(p * b[0] for p, b in zip(w, branches, strict=True))
            P = sum(p * (b[1] + np.outer(b[0] - mean, b[0] - mean)) for p, b in zip(w, branches, strict=True))
            x, started = mean, True
        states.append(x)
    return np.array(states)


def hypothesis_outputs(kalman, plots, spans, max_hypotheses, prune_below, folds=60):
    """Outputs (K, 10) of the filter that keeps hypotheses: mean (3), best (3), right, listed, count, probability.

    A hypothesis is (state, logarithm of weight, whether all folds are right); the covariance is common to all.
    """
    hypotheses, P, started, outputs = [(np.zeros(3), 0.0, True)], kalman.P0, False, []
    for k, (r, v, u, detected) in enumerate(plots):
        if k > 0:
            predicted = [(kalman.predicted(x, P)[0], w, right) for x, w, right in hypotheses]
            hypotheses, P = predicted, kalman.predicted(hypotheses[0][0], P)[1]
        if detected:
            children, D = [], spans[k]
            for x, w, right in hypotheses:
                x, after, log_likelihood = kalman.updated(x, P, [r], [0]) if started else (*kalman.started(r, P), 0.0)
                nearest = x[1] + wrap(v - x[1], D)
                order = sorted(range(-folds, folds + 1), key=lambda n: (abs(n), -n))
                for n in order:
                    y, final, velocity_log_likelihood = kalman.updated(x, after, [nearest + n * D], [1])
                    children.append(
                        (
                            y,
                            w + log_likelihood + velocity_log_likelihood,
                            right and bool(abs(nearest + n * D - u) < D / 2),
                        )
                    )
            best_weight = max(w for _, w, _ in children)
            children = [(x, w - best_weight, right) for x, w, right in children]
            if prune_below > 0:
                children = [h for h in children if h[1] >= np.log(prune_below)]
            hypotheses = sorted(children, key=lambda h: -h[1])[:max_hypotheses]
            P, started = final, True
        w = np.exp([w for _, w, _ in hypotheses])
        x = np.array([x for x, _, _ in hypotheses])
        best = int(np.argmax(w))
        output = (hypotheses[best][2], any(h[2] for h in hypotheses), len(hypotheses), w[best] / w.sum())
        outputs.append((*(w @ x / w.sum()), *x[best], *output))
    return np.array(outputs, dtype=float)


def enumerate_sequences(member, prior, sigma, dt, plots, spans, folds):
    """The Bayes mean and the probability of the best sequence at the last scan, over all sequences of folds.

    No recursion: all plots are linear in (first range, V, a, random derivatives); of each sequence the least squares.
    """
    F, Q = model(2, member.manoeuvre_variance, dt)
    K = len(plots)
    jumps = Q[:, [2]] / np.sqrt(Q[2, 2]) if Q.any() else np.zeros((3, 0))  # order 2: one random number a scan
    size = 3 + jumps.shape[1] * (K - 1)
    states, state = [], np.eye(3, size)
    for k in range(K):
        if k > 0:
            state = F @ state
            column = 3 + jumps.shape[1] * (k - 1)
            state[:, column : column + jumps.shape[1]] += jumps
        states.append(state)
    A = np.concatenate([state[:2] for state in states])
    scale = np.tile(1 / np.asarray(sigma, dtype=float), K)
    information = np.diag(np.concatenate([[0.0], 1 / prior_variances(2, prior), np.ones(size - 3)]))
    B = scale[:, None] * A
    solve = np.linalg.solve(information + B.T @ B, B.T)  # of whitened plots, the estimate
    residual_maker = np.eye(2 * K) - B @ solve
    numbers = np.array(list(itertools.product(range(-folds, folds + 1), repeat=K)))
    y = np.empty((len(numbers), 2 * K))
    y[:, 0::2] = [r for r, *_ in plots]
    y[:, 1::2] = [v for _, v, *_ in plots] + numbers * np.asarray(spans)
    y *= scale
    cost = 0.5 * np.einsum("ni,ij,nj->n", y, residual_maker, y)
    w = np.exp(cost.min() - cost)
    return states[-1] @ solve @ (w @ y / w.sum()), w.max() / w.sum()


def interacting_states(kalmans, plots, spans, stay, folds=0):
    """Means (K, 3) and probabilities (K, M) of filters that interact (IMM); so many folds to either side are merged.

    Likelihoods are of range and velocity at once; of a track's first plot, of the velocity alone.
    """
    M = len(kalmans)
    p = np.full((M, M), (1 - stay) / (M - 1)) + np.eye(M) * (stay - (1 - stay) / (M - 1))
    states = [(np.zeros(3), kalman.P0) for kalman in kalmans]
    mu, started, rows = np.full(M, 1 / M), False, []
    for k, (r, v, u, detected) in enumerate(plots):
        c = p.T @ mu
        share = p * mu[:, None] / c
        mean = [sum(share[j, i] * states[j][0] for j in range(M)) for i in range(M)]
        spread = [[np.outer(states[j][0] - mean[i], states[j][0] - mean[i]) for j in range(M)] for i in range(M)]
        P = [sum(share[j, i] * (states[j][1] + spread[i][j]) for j in range(M)) for i in range(M)]
        states, logs = list(zip(mean, P, strict=True)), np.zeros(M)
        for i, kalman in enumerate(kalmans):
            x, P = kalman.predicted(*states[i]) if k > 0 else states[i]
            if detected:
                x, P, logs[i] = kalman.updated(x, P, [r], [0]) if started else (*kalman.started(r, P), 0.0)
                if kalman.observes == 2:
                    nearest = x[1] + wrap(v - x[1], spans[k]) if folds else u
                    branches = [kalman.updated(x, P, [nearest + n * spans[k]], [1]) for n in range(-folds, folds + 1)]
                    greatest = max(branch[2] for branch in branches)
                    w = np.exp([branch[2] - greatest for branch in branches])
                    logs[i] += greatest + np.log(w.sum())
                    w /= w.sum()
                    x = sum(a * branch[0] for a, branch in zip(w, branches, strict=True))
                    P = sum(a * (b[1] + np.outer(b[0] - x, b[0] - x)) for a, b in zip(w, branches, strict=True))
            states[i] = x, P
        started = started or detected > 0
        mu = c * np.exp(logs - logs.max())
        mu /= mu.sum()
        rows.append((*sum(m * x for m, (x, _) in zip(mu, states, strict=True)), *mu))
    rows = np.array(rows)
    return rows[:, :3], rows[:, 3:]


def interacting_hypothesis_outputs(kalmans, plots, spans, stay, max_hypotheses, prune_below, folds):
    """Outputs (K, 10 + M) of hypotheses in each of which orders interact: as `remembering`, then the orders' weights.

    A hypothesis is (states and covariances of the orders, their probabilities, logarithm of weight, whether right).
    """
    M = len(kalmans)
    p = np.full((M, M), (1 - stay) / (M - 1)) + np.eye(M) * (stay - (1 - stay) / (M - 1))
    hypotheses = [([(np.zeros(3), kalman.P0) for kalman in kalmans], np.full(M, 1 / M), 0.0, True)]
    started, outputs = False, []
    for k, (r, v, u, detected) in enumerate(plots):
        children, D = [], spans[k]
        for states, mu, w, right in hypotheses:
            c = p.T @ mu
            share = p * mu[:, None] / c
            mean = [sum(share[j, i] * states[j][0] for j in range(M)) for i in range(M)]
            spread = [[np.outer(states[j][0] - mean[i], states[j][0] - mean[i]) for j in range(M)] for i in range(M)]
            P = [sum(share[j, i] * (states[j][1] + spread[i][j]) for j in range(M)) for i in range(M)]
            after, logs = [], np.log(c)
            for i, kalman in enumerate(kalmans):
                x, Q = kalman.predicted(mean[i], P[i]) if k > 0 else (mean[i], P[i])
                if detected:
                    x, Q, log_likelihood = kalman.updated(x, Q, [r], [0]) if started else (*kalman.started(r, Q), 0.0)
                    logs[i] += log_likelihood
                after.append((x, Q))
            if not detected:
                children.append((after, np.exp(logs), w, right))
                continue
            centre = v + D * np.rint((np.exp(logs - logs.max()) @ [x[1] for x, _ in after] - v) / D)
            for n in range(-folds, folds + 1):
                updates = [kalman.updated(*after[i], [centre + n * D], [1]) for i, kalman in enumerate(kalmans)]
                log_weights = logs + [log_likelihood for _, _, log_likelihood in updates]
                share = np.exp(log_weights - log_weights.max())
                weight = w + log_weights.max() + np.log(share.sum())
                is_right = right and bool(abs(centre + n * D - u) < D / 2)
                children.append(([state[:2] for state in updates], share / share.sum(), weight, is_right))
        best_weight = max(kalman[2] for kalman in children)
        children = [(*kalman[:2], kalman[2] - best_weight, kalman[3]) for kalman in children]
        if prune_below > 0:
            children = [kalman for kalman in children if kalman[2] >= np.log(prune_below)]
        hypotheses = sorted(children, key=lambda kalman: -kalman[2])[:max_hypotheses]
        started = started or detected > 0
        w = np.exp([kalman[2] for kalman in hypotheses])
        x = np.array(
            [sum(m * state[0] for m, state in zip(kalman[1], kalman[0], strict=True)) for kalman in hypotheses]
        )
        best = int(np.argmax(w))
        output = (hypotheses[best][3], any(kalman[3] for kalman in hypotheses), len(hypotheses), w[best] / w.sum())
        order_weights = w @ np.array([kalman[1] for kalman in hypotheses]) / w.sum()
        outputs.append((*(w @ x / w.sum()), *x[best], *output, *order_weights))
    return np.array(outputs, dtype=float)


def smoothest_meeting(estimates, widths):
    """The smoothest of estimates (I,) whose interval meets those of all rougher; widths (I,) half, 0: not there."""
    order = [i for i in np.argsort(-np.asarray(widths), kind="stable") if widths[i] > 0]
    smoothest = order[0] if order else None
    for n in range(1, len(order) + 1):
        rougher = order[:n]
        meets = all(
            abs(estimates[i] - estimates[j]) <= widths[i] + widths[j]
            for a, i in enumerate(rougher)
            for j in rougher[:a]
        )
        if not meets:
            break
        smoothest = rougher[-1]
    return smoothest

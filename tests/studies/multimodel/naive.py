"""Textbook twin of the multiple-model kernels: full 9 x 9 matrices, one realisation, nothing clever.

State [x, vx, ax, y, vy, ay, z, vz, az]; hypotheses are x (M, 9), P (M, 9, 9), p (M,). Transition matrices are
column-stochastic.
"""

import numpy as np

H = np.kron(np.eye(3), [[1.0, 0.0, 0.0]])


def motion(kind, sigma, dt):
    """F, Q of eq. (11)."""
    moves, bends = kind != "still", kind == "accelerated"
    F = np.array([[1, moves * dt, bends * dt**2 / 2], [0, moves, bends * dt], [0, 0, bends]], dtype=float)
    g = np.array([dt**2 / 2, moves * dt, bends])
    return np.kron(np.eye(3), F), np.kron(np.eye(3), sigma**2 * np.outer(g, g))


def shares(weights, main, rule):
    """Normalised shares (M,) of a group by a merging rule."""
    weights = np.asarray(weights, dtype=float)
    if not weights.any():
        return np.eye(len(weights))[main]
    best, is_kept = np.argmax(weights), np.ones(len(weights), dtype=bool)
    outweighs_others = all(weights[main] > w for j, w in enumerate(weights) if j != main)
    if rule == "best":
        is_kept = np.arange(len(weights)) == best
    elif rule in ("combined", "modified_combined") and outweighs_others:
        is_kept = np.arange(len(weights)) == main
    elif rule == "modified_combined":
        is_kept = np.isin(np.arange(len(weights)), (main, best))
    return weights * is_kept / (weights * is_kept).sum()


def merge(s, x, P):
    """Eq. (4) with shares s."""
    mean = s @ x
    d = x - mean
    return mean, np.einsum("j,jab->ab", s, P + d[:, :, None] * d[:, None, :])


def advance(x, P, F, Q, z, R):
    """Eqs. (6), (9): predicted and updated hypothesis, normalised innovation squared and determinant of S."""
    x, P = F @ x, F @ P @ F.T + Q
    if z is None:
        return x, P, 0.0, 1.0
    S = H @ P @ H.T + R
    K = np.linalg.solve(S, H @ P).T
    v = z - H @ x
    P = P - K @ S @ K.T
    return x + K @ v, (P + P.T) / 2, v @ np.linalg.solve(S, v), np.linalg.det(S)


def posterior(weights, q, det):
    """Weights times likelihoods, normalised."""
    q = np.where(np.asarray(weights) > 0, q, np.inf)
    p = weights * np.exp((q.min() - q) / 2) / np.sqrt(det)
    return p / p.sum()


def imm(x, P, p, models, T, z, R, rule):
    """One step of IMM; `models` a list of (F, Q)."""
    weights = T * p
    merged = [merge(shares(w, i, rule), x, P) for i, w in enumerate(weights)]
    x, P, q, det = zip(*(advance(*m, F, Q, z, R) for m, (F, Q) in zip(merged, models, strict=True)), strict=True)
    return np.array(x), np.array(P), posterior(weights.sum(1), np.array(q), np.array(det))


def imm_by_extrapolations(x, P, p, models, T, z, R, rule):
    """The paper's MMA2: N² extrapolations, merged after it, then N updates."""
    weights, updates = T * p, []
    for i, (F, Q) in enumerate(models):
        xs, Ps = x @ F.T, F @ P @ F.T + Q
        mean, cov = merge(shares(weights[i], i, rule), xs, Ps)
        updates.append(advance(mean, cov, np.eye(9), np.zeros((9, 9)), z, R))
    x, P, q, det = zip(*updates, strict=True)
    return np.array(x), np.array(P), posterior(weights.sum(1), np.array(q), np.array(det))


def gpb2(x, P, p, models, T, z, R, rule):
    """One step of GPB2: all pairs, then merges by target model."""
    size, weights = len(p), T * p
    updates = [[advance(x[j], P[j], *models[i], z, R) for j in range(size)] for i in range(size)]
    q, det = np.array([[f[2] for f in row] for row in updates]), np.array([[f[3] for f in row] for row in updates])
    weights = posterior(weights.ravel(), q.ravel(), det.ravel()).reshape(size, size)
    merged = [
        merge(shares(weights[i], i, rule), np.array([f[0] for f in updates[i]]), np.array([f[1] for f in updates[i]]))
        for i in range(size)
    ]
    return np.array([m[0] for m in merged]), np.array([m[1] for m in merged]), weights.sum(1)


def gpb1(x, P, p, models, T, z, R):
    """One step of GPB1 from its one hypothesis x (9,), P (9, 9)."""
    x, P, q, det = zip(*(advance(x, P, F, Q, z, R) for F, Q in models), strict=True)
    return np.array(x), np.array(P), posterior(T @ p, np.array(q), np.array(det))


def track(family, rule, output, kinds, transition, x, P, p, plots, covariances, times):
    """Estimates (K, 9), covariances (K, 9, 9), probabilities (K, M) of one realisation; plots (K, 3), rows of NaN
    are missed.

    transition(t): matrix over t seconds; times (K,): seconds since the scan before. x (9,), P (9, 9), p (M,): before
    the first.
    """
    size = len(kinds)
    x, P, wait, outputs = np.tile(x, (size, 1)), np.tile(P, (size, 1, 1)), 0.0, []
    for z, R, dt in zip(plots, covariances, times, strict=True):
        wait += dt
        z = None if np.isnan(z).any() else z
        models, T = [motion(*kind, wait) for kind in kinds], transition(wait)
        if family == "gpb1":
            nx, nP, np_ = gpb1(x[0], P[0], p, models, T, z, R)
        else:
            nx, nP, np_ = (gpb2 if family == "gpb2" else imm)(x, P, p, models, T, z, R, rule)
        outputs.append((*merge(shares(np_, 0, output), nx, nP), np_))
        if z is None:
            continue
        if family == "gpb1":
            mean, cov = merge(shares(np_, int(np.argmax(p)), rule), nx, nP)
            nx, nP = np.tile(mean, (size, 1)), np.tile(cov, (size, 1, 1))
        x, P, p, wait = nx, nP, np_, 0.0
    return tuple(np.array(part) for part in zip(*outputs, strict=True))

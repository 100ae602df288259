"""Textbook twin of the trackers among false plots: full 4 × 4 matrices, one realisation, plain NumPy.

The state is (r, vr, b, vb). Nothing here is shared with the package.
"""

import numpy as np

H = np.array([[1.0, 0, 0, 0], [0, 0, 1.0, 0]])


def motion(dt):
    F = np.eye(4)
    F[0, 1] = F[2, 3] = dt
    return F


def noise(dt, variance):
    g = np.array([dt**2 / 2, dt])
    Q = np.zeros((4, 4))
    Q[:2, :2], Q[2:, 2:] = variance[0] * np.outer(g, g), variance[1] * np.outer(g, g)
    return Q


def foretold(x, P, dt, variance, sigma):
    F = motion(dt)
    x, P = F @ x, F @ P @ F.T + noise(dt, variance)
    return x, P, H @ P @ H.T + np.diag(sigma**2)


def nearest(x, P, S, plots, sigma):
    """Kalman update with the nearest of the plots (n, 2), all in the gate."""
    nu = plots - H @ x
    d = np.einsum("ni,ij,nj->n", nu, np.linalg.inv(S), nu)
    K = P @ H.T @ np.linalg.inv(S)
    A = np.eye(4) - K @ H
    return x + K @ nu[np.argmin(d)], A @ P @ A.T + K @ np.diag(sigma**2) @ K.T


def pda(x, P, S, plots, sigma, detection, inside, density):
    """Bar-Shalom's parametric PDAF; density of false plots in (r, b)."""
    inverse = np.linalg.inv(S)
    nu = plots - H @ x
    e = np.exp(-0.5 * np.einsum("ni,ij,nj->n", nu, inverse, nu))
    b = density * np.sqrt(np.linalg.det(2 * np.pi * S)) * (1 - detection * inside) / detection
    beta, none = e / (b + e.sum()), b / (b + e.sum())
    mean = beta @ nu
    K = P @ H.T @ inverse
    spread = K @ (np.einsum("n,ni,nj->ij", beta, nu, nu) - np.outer(mean, mean)) @ K.T
    return x + K @ mean, none * P + (1 - none) * (P - K @ S @ K.T) + spread


def follow(t, target, false, truth, choice, sigma, detection, inside, gate, density, period):
    """The target's track: at each scan (state 0, 1 or 2 after it, x, P or None).

    target (K, 2) plots, not-a-number where missed; false a list of (n, 2); choice with association, m, n, misses,
    speed, lost, variance; density per m².
    """
    out, state = [], 0
    x = P = None
    for k in range(len(t)):
        seen = np.isfinite(target[k, 0])
        if state == 0:
            if seen:
                state, age, hits, misses, number, last = 1, 1, 1, 0, 1, t[k]
                first = target[k].copy()
                x, P = np.array([first[0], 0, first[1], 0]), None
            out.append((state, x if state else None, P))
            continue
        age += 1
        dt = t[k] - t[k - 1]
        if number == 1:
            reach = choice.speed * (t[k] - last)
            S = np.diag(2 * sigma**2) + np.diag([reach**2, (reach / x[0]) ** 2])
            place = x[[0, 2]]
        else:
            x, P, S = foretold(x, P, dt, choice.variance, sigma)
            place = H @ x
        plots = np.concatenate([target[k][None][: int(seen)], false[k]])
        nu = plots - place
        plots = plots[np.einsum("ni,ij,nj->n", nu, np.linalg.inv(S), nu) <= gate]
        if len(plots):
            hits, misses = hits + 1, 0
            if number == 1:
                nu = plots - place
                z = plots[np.argmin(np.einsum("ni,ij,nj->n", nu, np.linalg.inv(S), nu))]
                span = t[k] - last
                A = np.array([[1, -span], [1, 0.0]])
                inverse = np.linalg.inv(A.T @ A)
                lines = np.linalg.solve(A, np.stack([place, z]))
                x = np.array([lines[0, 0], lines[1, 0], lines[0, 1], lines[1, 1]])
                P = np.zeros((4, 4))
                P[:2, :2], P[2:, 2:] = sigma[0] ** 2 * inverse, sigma[1] ** 2 * inverse
                number = 2
            elif choice.association == "pda":
                x, P = pda(x, P, S, plots, sigma, detection, inside, density * place[0])
            else:
                x, P = nearest(x, P, S, plots, sigma)
            last = t[k]
        else:
            misses += 1
        if state == 1 and hits >= choice.m:
            state = 2
            if (np.abs(x[[0, 2]] - truth[k]) > choice.lost * sigma).any():
                state = 0
        elif state == 1 and hits + choice.n - age < choice.m:
            state = 0
        elif state == 2:
            lost = (np.abs(x[[0, 2]] - truth[k]) > choice.lost * sigma).any()
            vague = (np.diag(P)[[0, 2]] > (choice.lost * sigma) ** 2).any()
            if misses >= choice.misses or lost or vague:
                state = 0
        out.append((state, x.copy(), None if P is None else P.copy()))
    return out

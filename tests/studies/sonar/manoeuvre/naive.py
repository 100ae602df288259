"""Textbook twins of the detector, the adaptive filter and the IMM: one realisation, plain NumPy.

Plots z (K,) of one coordinate with not-a-number where missed, at times t (K,); everything in physical units.
"""

import numpy as np

from tests.studies.sonar.naive import F, Q


def fit(t, z, at, now, size, sigma):
    """Least squares of degree size - 1 on the plots `at`, at time now: estimate (3,) and covariance (3, 3).

    Plots are taken relative to the last one, so that no digits are lost to what they have in common.
    """
    x, P = np.zeros(3), np.zeros((3, 3))
    s = t[at] - now
    A = np.stack([s**0, s, s**2 / 2], axis=1)[:, :size]
    P[:size, :size] = sigma**2 * np.linalg.inv(A.T @ A)
    x[:size] = P[:size, :size] @ A.T @ (z[at] - z[at[-1]]) / sigma**2
    x[0] += z[at[-1]]
    return x, P


def statistic(t, z, k, plots, sigma):
    """â²/σ_a² of the last plots at scan k; not-a-number where there is no test."""
    at = np.flatnonzero(~np.isnan(z[: k + 1]))[-plots:]
    if np.isnan(z[k]) or len(at) < plots:
        return np.nan
    x, P = fit(t, z, at, t[k], 3, sigma)
    return x[2] ** 2 / P[2, 2]


def adaptive(t, z, size, sigma, plots, q, threshold, raises, patience=1):
    """Growing memory begun anew with the last plots at every change of mode; q (K,) the statistics that decide.

    Estimates (K, 3), covariances (K, 3, 3), modes (K,), plots in memory (K,).
    """
    K = len(t)
    x, P, modes, memory = np.full((K, 3), np.nan), np.full((K, 3, 3), np.nan), np.zeros(K), np.zeros(K)
    mode, calm, begin = 0, 0, 0
    for k in range(K):
        seen = np.flatnonzero(~np.isnan(z[: k + 1]))
        before = mode
        if not np.isnan(q[k]):
            calm = 0 if q[k] > threshold else calm + 1
            if calm == 0:
                mode = 1
            elif calm >= patience:
                mode = 0
        if mode != before or (mode and not raises):
            begin = seen[-plots]
        at = seen[seen >= begin]
        degree = min(3 if mode and raises else size, len(at))
        modes[k], memory[k] = mode, len(at)
        x[k], P[k] = fit(t, z, at, t[k], degree, sigma)
    return x, P, modes, memory


def imm(t, z, size, sigma, variances, stay):
    """Interacting multiple model of two Kalman filters, begun with the first `size` plots by least squares."""
    K = len(t)
    x, P, p2 = np.full((K, size), np.nan), np.full((K, size, size), np.nan), np.full(K, np.nan)
    T = np.array([[stay[0], 1 - stay[1]], [1 - stay[0], stay[1]]])  # column j: from model j
    p = np.array([1 - stay[1], 1 - stay[0]]) / (2 - stay[0] - stay[1])
    H = np.eye(size)[0]
    started = np.flatnonzero(~np.isnan(z))[size - 1]
    means = covariances = None
    for k in range(started, K):
        if k == started:
            at = np.flatnonzero(~np.isnan(z[: k + 1]))
            first, spread = fit(t, z, at, t[k], size, sigma)
            means, covariances = [first[:size]] * 2, [spread[:size, :size]] * 2
        else:
            c = T @ p
            share = T * p / c[:, None]  # row: into model
            mixed = [sum(share[j, i] * means[i] for i in range(2)) for j in range(2)]
            spread = [
                sum(share[j, i] * (covariances[i] + np.outer(d := means[i] - mixed[j], d)) for i in range(2))
                for j in range(2)
            ]
            means, covariances, weight = [], [], np.zeros(2)
            for j in range(2):
                A = F(t[k] - t[k - 1], size)
                m, S = A @ mixed[j], A @ spread[j] @ A.T + Q(t[k] - t[k - 1], size, variances[j])
                weight[j] = c[j]
                if not np.isnan(z[k]):
                    s = S[0, 0] + sigma**2
                    gain, e = S[:, 0] / s, z[k] - m[0]
                    weight[j] *= np.exp(-0.5 * e**2 / s) / np.sqrt(s)
                    m, S = m + gain * e, S - np.outer(gain, H @ S)
                means.append(m)
                covariances.append(S)
            p = weight / weight.sum()
        x[k] = sum(p[j] * means[j] for j in range(2))
        P[k] = sum(p[j] * (covariances[j] + np.outer(d := means[j] - x[k], d)) for j in range(2))
        p2[k] = p[1]
    return x, P, p2

"""Exact σ and bias of linear filters with any model, and the limits of σ."""

import numpy as np

from radarsim.studies.linear_design import Matrices, period, steady


@np.errstate(all="ignore")  # of a filter that diverges
def exact(truth: tuple[np.ndarray, ...], model: Matrices, probability: float) -> tuple[np.ndarray, np.ndarray]:
    """σ and bias (K, n) of a filter's errors e, from the mean and covariance of (e, truth), whatever its model. A
    missed plot makes a mixture of two; then σ is exact still, though the error is not Gaussian."""
    F, Q, mean, P = truth
    n = mean.size
    eye, none = np.eye(n), np.zeros((n, n))
    m, S = np.concatenate([model.x - mean, mean]), np.block([[P, -P], [-P, P]])
    M, B = np.block([[model.F, model.F - F], [none, F]]), np.vstack([-eye, eye])
    noise, sigma, bias = B @ Q @ B.T, np.empty((len(model.H), n)), np.empty((len(model.H), n))
    for k in range(len(model.H)):
        if k:
            m, S = M @ m, M @ S @ M.T + noise
        m0, S0 = m, S
        for h, g, see, s in zip(model.H[k], model.gains[k], model.see[k], model.sigma[k], strict=True):
            A = np.block([[eye - np.outer(g, h), np.outer(g, see - h)], [none, eye]])
            G = s * np.concatenate([g, np.zeros(n)])
            m, S = A @ m, A @ S @ A.T + np.outer(G, G)
        if probability < 1:
            d, q = m - m0, probability
            m, S = q * m + (1 - q) * m0, q * S + (1 - q) * S0 + q * (1 - q) * np.outer(d, d)
        bias[k] = m[:n]
        sigma[k] = np.sqrt(np.diag(S)[:n] + m[:n] ** 2)
    return sigma, bias


@np.errstate(all="ignore")
def limit(truth: tuple[np.ndarray, ...], model: Matrices, probability: float) -> np.ndarray:
    """The limit of σ (n,) of a filter's errors, at scans of the phase of its last one; NaN where there is none, or
    where it depends on the truth: by a wrong F or H.

    Of a filter's own gains the last ones are kept. The second moments of the errors go over a period as S → T S + W,
    with S as a vector, and stay at (1 - T)⁻¹ W. Those of constant errors keep their value, and those of components
    without error are zero; the others must settle."""
    F, Q, mean, P = truth
    n = mean.size
    p = period(model.H, model.R, model.see, model.sigma)
    if not (np.array_equal(model.F, F) and np.array_equal(model.H, model.see)) or 2 * p > len(model.H):
        return np.full(n, np.nan)
    scans = np.arange(len(model.H) - p, len(model.H))  # a period that ends with the last one
    gains = model.gains[scans] if model.has_own_gains else steady(model)[0][scans % p]
    T, W = _second_moments_over(scans, gains, F, Q, model, probability)
    if not np.isfinite(T).all():
        return np.full(n, np.nan)
    start = P + np.outer(model.x - mean, model.x - mean)
    gain_columns = np.hstack([model.gains.reshape(-1, n).T, gains.reshape(-1, n).T])
    reached, constant = _components_with_errors(F, np.hstack([Q, gain_columns]), start)
    both_constant = np.outer(constant, constant).ravel()
    settling = np.flatnonzero(np.outer(reached, reached).ravel() & ~both_constant)
    T_settling = T[np.ix_(settling, settling)]
    if settling.size and np.abs(np.linalg.eigvals(T_settling)).max() >= 1:
        return np.full(n, np.nan)
    S = np.where(both_constant, start.ravel(), 0.0)
    constant_inflow = T[np.ix_(settling, both_constant)] @ S[both_constant]
    S[settling] = np.linalg.solve(np.eye(settling.size) - T_settling, W[settling] + constant_inflow)
    return np.sqrt(S.reshape(n, n).diagonal())


def _components_with_errors(F: np.ndarray, noise: np.ndarray, start: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Which components (n,) ever have an error, and which of them one that never changes.

    noise (n, m): the columns that noise and plots move the errors by; start (n, n): the errors' second moments at
    first."""
    moved = (noise != 0).any(axis=1)
    reached = moved | (start.diagonal() > 0)
    for _ in range(len(F)):
        reached = reached | (F[:, reached] != 0).any(axis=1)
    return reached, reached & ~moved & (np.eye(len(F)) == F).all(axis=1)


def _second_moments_over(
    scans: np.ndarray, gains: np.ndarray, F: np.ndarray, Q: np.ndarray, model: Matrices, probability: float
) -> tuple[np.ndarray, np.ndarray]:
    """T (n², n²) and W (n²,): over these scans the second moments of the errors, as a vector, go as S → T S + W."""
    n = len(F)
    T, W = np.eye(n * n), np.zeros(n * n)
    for g, k in zip(gains, scans, strict=True):
        moved, added = np.kron(F, F), Q.ravel()
        retained, noise = np.eye(n), np.zeros((n, n))
        for h, gain, s in zip(model.H[k], g, model.sigma[k], strict=True):
            A = np.eye(n) - np.outer(gain, h)
            retained, noise = A @ retained, A @ noise @ A.T + s**2 * np.outer(gain, gain)
        take = probability * np.kron(retained, retained) + (1 - probability) * np.eye(n * n)
        T, W = take @ moved @ T, take @ (moved @ W + added) + probability * noise.ravel()
    return T, W

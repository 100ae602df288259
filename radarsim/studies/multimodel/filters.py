"""Design of multiple-model filters: banks of motion models, transition probabilities over any interval, the track
start."""

from collections.abc import Sequence

import numpy as np
from scipy.linalg import expm, logm

MOTIONS = {"still": (0.0, 0.0), "uniform": (1.0, 0.0), "accelerated": (1.0, 1.0)}  # with velocity, with acceleration
COLUMN_TOLERANCE = 1e-9  # of a column's sum from one
MOST_STEPS = 2.0**52  # of a power: whatever is not forgotten by then never is, and more would not fit a whole number

# Additions, subtractions, multiplications, divisions, roots and exponentials of one step, all three axes, counted on
# the formulas of `kernels.blocks` and `kernels.hypothesis` (a test counts them again); PREDICT, UPDATE by whether the
# model accelerates: the zeros of one that does not are left out.
PREDICT, UPDATE = {True: 282, False: 99}, {True: 456, False: 267}
LIKELIHOOD, MERGE, MERGE_ONCE = 8, 208, -9


def bank(motions: Sequence[str], sigmas: Sequence[float]) -> np.ndarray:
    """The models (M, 3) as a kernel takes them: moves, accelerates (0 or 1), sigma of the acceleration per step
    (m/s²)."""
    return np.array([(*MOTIONS[motion], sigma) for motion, sigma in zip(motions, sigmas, strict=True)])


def stationary(transition: np.ndarray) -> np.ndarray:
    """Probabilities (M,) that a column-stochastic matrix (M, M) leaves as they are.

    Where there are several such (a matrix that falls apart), the one that equal probabilities tend to.
    """
    size = len(transition)
    mixing = (transition + np.eye(size)) / 2  # the same stationary ones, without periodic chains
    for _ in range(40):
        mixing = mixing @ mixing
        mixing /= mixing.sum(axis=0)  # rounding would grow with each square
    p = mixing @ np.full(size, 1.0 / size)
    p = np.maximum(p, 0.0)
    return p / p.sum()


def generator(transition: np.ndarray) -> np.ndarray:
    """Rates Q (M, M) of the Markov process nearest to log P: off-diagonal ones not negative, columns summing to zero.

    The paper's three-model matrix has no exact one: its zeros make P**0.9 slightly negative (-4e-7).
    """
    Q = np.real(logm(transition))
    Q = np.where(np.eye(len(Q), dtype=bool), 0.0, np.maximum(Q, 0.0))
    return Q - np.diag(Q.sum(axis=0))


def transition_powers(transition: np.ndarray, exponents: np.ndarray) -> np.ndarray:
    """P(m Δt) = P(Δt)**m, eq. (8), for exponents m (n,): (n, M, M), column-stochastic.

    Whole m: the power; the part under one: expm(m Q) with the generator above, so that no probability is negative.
    """
    exponents = np.minimum(np.asarray(exponents, dtype=float), MOST_STEPS)
    # The whole part exactly, the rest by the generator: continuous in m and never negative.
    whole = np.floor(exponents + 1e-9).astype(np.int64)
    rest = np.maximum(exponents - whole, 0.0)
    distinct, place = np.unique(whole, return_inverse=True)
    powers = np.stack([np.linalg.matrix_power(transition, m) for m in distinct])[place]
    broken = rest > 1e-9
    if broken.any():
        powers[broken] = powers[broken] @ exponentials(generator(transition), rest[broken])
    powers = np.maximum(powers, 0.0)
    return powers / powers.sum(axis=1, keepdims=True)


def exponentials(Q: np.ndarray, t: np.ndarray) -> np.ndarray:
    """expm(t Q) for times t (n,): (n, M, M); by eigenvectors where they are well conditioned, all times at once."""
    values, V = np.linalg.eig(Q)
    if np.linalg.cond(V) > 1e6:
        return expm(t[:, None, None] * Q)
    return np.real(V @ (np.exp(t[:, None] * values)[:, :, None] * np.linalg.inv(V)))


def start_weights(t: np.ndarray, acceleration_spread: float) -> np.ndarray:
    """Least squares of a straight line through three plots at times t (3,): (9,) numbers, see
    `kernels.multimodel_strip.start`.

    The estimate at the third plot is x = Σ aₖ zₖ, v = Σ bₖ zₖ, acceleration 0. An acceleration w of the target makes
    errors (Σ aₖ τₖ²/2, Σ bₖ τₖ²/2, -1) w, τₖ = tₖ - t₃; with w of the stated spread they enter the covariance.
    """
    tau = np.asarray(t, dtype=float) - t[2]
    a, b = np.linalg.pinv(np.stack([np.ones(3), tau / -tau[0]], axis=1))
    b = b / -tau[0]
    bent = tau**2 / 2
    return np.concatenate([a, b, acceleration_spread * np.array([a @ bent, b @ bent, -1.0])])


def operations(family: str, transition: np.ndarray, accelerates: Sequence[bool]) -> tuple[float, float, float]:
    """Arithmetic operations of one scan: fixed ones, and those of each merged hypothesis and of each merge.

    accelerates (M,): whether each model has an acceleration. Merges of a single hypothesis are copies and cost nothing.
    """
    size = len(transition)
    times = np.count_nonzero(transition, axis=1) if family == "gpb2" else np.ones(size, dtype=int)
    advanced = sum(n * (PREDICT[bool(a)] + UPDATE[bool(a)]) for n, a in zip(times, accelerates, strict=True))
    foretold = size * (2 * size - 1) if size > 1 else 0
    likelihoods = times.sum() * LIKELIHOOD if size > 1 else 0
    return float(advanced + likelihoods + foretold), MERGE, MERGE_ONCE

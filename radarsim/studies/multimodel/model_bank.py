"""Design of multiple-model filters: banks of motion models, transition probabilities, and the start of a track.

Letters:

    M           number of models of a filter
    T (M, M)    transition probabilities over the configured interval Δt, column j: from model j
    Q (M, M)    rates of the Markov process, T(t) = expm(t Q)
    p (M,)      probabilities of the models"""

from collections.abc import Sequence

import numpy as np

MOTIONS = {"still": (0.0, 0.0), "uniform": (1.0, 0.0), "accelerated": (1.0, 1.0)}  # with velocity, with acceleration
MAX_EXPONENT = 2.0**52  # greatest exponent: every power has converged by then, and more would not fit a whole number


def model_labels(models: Sequence) -> tuple[str, ...]:
    """The models of a config's bank in words, for tables: motion and spread of the acceleration in m/s²."""
    return tuple(f"{model.motion} {model.sigma_acceleration_mps2:g}" for model in models)


def transition_matrix(rows: Sequence[Sequence[float]]) -> np.ndarray:
    """The transition matrix T (M, M) of the rows of a config, its columns summing to one exactly."""
    T = np.array(rows)
    return T / T.sum(axis=0)


def model_rows(motions: Sequence[str], sigmas: Sequence[float]) -> np.ndarray:
    """The models (M, 3) as a kernel takes them: moves, accelerates (0 or 1), sigma of the acceleration per step
    (m/s²)."""
    return np.array([(*MOTIONS[motion], sigma) for motion, sigma in zip(motions, sigmas, strict=True)])


def stationary(transition: np.ndarray) -> np.ndarray:
    """The stationary probabilities p = T p (M,) of a column-stochastic matrix (M, M).

    If there are several (a reducible matrix), those to which equal probabilities tend."""
    size = len(transition)
    mixing = (transition + np.eye(size)) / 2  # has the same stationary probabilities, and no periodic chains
    for _ in range(40):
        mixing = mixing @ mixing
        mixing /= mixing.sum(axis=0)  # rounding would grow with each square
    p = mixing @ np.full(size, 1.0 / size)
    p = np.maximum(p, 0.0)
    return p / p.sum()


def generator(transition: np.ndarray) -> np.ndarray:
    """Rates Q (M, M) of the Markov process nearest to log T: off-diagonal ones not negative, columns summing to zero.

    The paper's three-model matrix has no exact generator: its zeros make T**0.9 slightly negative (-4e-7)."""
    from scipy.linalg import logm

    Q = np.real(logm(transition))
    Q = np.where(np.eye(len(Q), dtype=bool), 0.0, np.maximum(Q, 0.0))
    return Q - np.diag(Q.sum(axis=0))


def transition_powers(transition: np.ndarray, exponents: np.ndarray) -> np.ndarray:
    """T(m Δt) = T(Δt)**m, eq. (8), for exponents m (n,): (n, M, M), column-stochastic.

    The whole part of m by powers, the fraction by expm(m Q) with the generator, so that no probability is negative."""
    exponents = np.minimum(np.asarray(exponents, dtype=float), MAX_EXPONENT)
    # The whole part exactly, the fraction by the generator: continuous in m and never negative.
    whole_exponents = np.floor(exponents + 1e-9).astype(np.int64)
    fractions = np.maximum(exponents - whole_exponents, 0.0)
    distinct, power_index = np.unique(whole_exponents, return_inverse=True)
    powers = np.stack([np.linalg.matrix_power(transition, m) for m in distinct])[power_index]
    has_fraction = fractions > 1e-9
    if has_fraction.any():
        powers[has_fraction] = powers[has_fraction] @ matrix_exponentials(
            generator(transition), fractions[has_fraction]
        )
    powers = np.maximum(powers, 0.0)
    return powers / powers.sum(axis=1, keepdims=True)


def matrix_exponentials(Q: np.ndarray, t: np.ndarray) -> np.ndarray:
    """expm(t Q) for times t (n,): (n, M, M); by eigenvectors where they are well conditioned, all times at once."""
    from scipy.linalg import expm

    values, V = np.linalg.eig(Q)
    if np.linalg.cond(V) > 1e6:
        return expm(t[:, None, None] * Q)
    return np.real(V @ (np.exp(t[:, None] * values)[:, :, None] * np.linalg.inv(V)))


def start_weights(t: np.ndarray, acceleration_spread: float) -> np.ndarray:
    """Weights a, b, g (3 each) of a straight line by least squares through three plots at times t (3,).

    See `kernels.filter_strip.start_track`. The estimate at the third plot is x = Σ aₖ zₖ, v = Σ bₖ zₖ, acceleration 0.
    An acceleration w of the target causes the errors (Σ aₖ τₖ²/2, Σ bₖ τₖ²/2, -1) w, τₖ = tₖ - t₃; with w of the given
    spread (m/s²) they enter the covariance: g is this vector."""
    tau = np.asarray(t, dtype=float) - t[2]
    a, b = np.linalg.pinv(np.stack([np.ones(3), tau / -tau[0]], axis=1))
    b = b / -tau[0]
    half_squares = tau**2 / 2
    return np.concatenate([a, b, acceleration_spread * np.array([a @ half_squares, b @ half_squares, -1.0])])

"""Short vectors of a lattice: the sequences of folds near the right one.

A basis is first made short and nearly orthogonal (Lenstra, Lenstra & Lovász, Mathematische Annalen 261, 1982, 515),
then all vectors within a radius are listed, coordinate by coordinate (Fincke & Pohst, Mathematics of Computation 44,
1985, 463)."""

import numpy as np

LOVASZ_CONDITION = 0.75  # Lovász' condition: how much shorter a vector must become by an exchange


class TooManyVectors(ValueError):
    """There are more vectors than the limit."""


def reduce_basis(A: np.ndarray, T: np.ndarray) -> np.ndarray:
    """A basis T (n, n) of whole numbers with short vectors A T, of the lattice of A (m, n).

    T (n, n) is the basis to begin with; A has full column rank."""
    T = T.copy()
    n, k = T.shape[1], 1
    while k < n:
        R = np.linalg.qr(A @ T[:, : k + 1])[1]
        for j in range(k - 1, -1, -1):
            q = int(np.rint(R[j, k] / R[j, j]))
            T[:, k] -= q * T[:, j]
            R[:, k] -= q * R[:, j]
        slant = R[k - 1, k] / R[k - 1, k - 1]
        if R[k, k] ** 2 >= (LOVASZ_CONDITION - slant**2) * R[k - 1, k - 1] ** 2:
            k += 1
        else:
            T[:, [k - 1, k]] = T[:, [k, k - 1]]
            k = max(k - 1, 1)
    return T


def lattice_vectors(A: np.ndarray, T: np.ndarray, radius: float, max_candidates: int) -> np.ndarray:
    """All vectors m (M, n) of whole numbers, except zero, with |A m| up to a radius; T is a reduced basis.

    Raises TooManyVectors if there are more than `max_candidates` at any step."""
    R = np.linalg.qr(A @ T)[1]
    n = R.shape[1]
    x, remaining = np.zeros((1, n)), np.full(1, radius**2)
    for i in range(n - 1, -1, -1):
        centre = -(x[:, i + 1 :] @ R[i, i + 1 :]) / R[i, i]
        reach = np.sqrt(remaining) / abs(R[i, i])
        low, high = np.ceil(centre - reach), np.floor(centre + reach)
        count = np.maximum(high - low + 1, 0).astype(np.int64)
        if count.sum() > max_candidates:
            raise TooManyVectors
        parents = np.repeat(np.arange(len(x)), count)
        coordinate = low[parents] + np.arange(len(parents)) - np.repeat(np.cumsum(count) - count, count)
        x = x[parents]
        x[:, i] = coordinate
        remaining = np.maximum(remaining[parents] - (R[i, i] * (coordinate - centre[parents])) ** 2, 0.0)
    vectors = x @ T.T
    return vectors[np.any(vectors != 0, axis=1)]

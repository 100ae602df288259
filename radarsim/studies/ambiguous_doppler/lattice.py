"""Short vectors of a lattice: which sequences of folds lie near the right one.

A basis is first made short and nearly orthogonal (Lenstra, Lenstra & Lovász, Mathematische Annalen 261, 1982, 515),
then all vectors within a radius are listed, coordinate by coordinate (Fincke & Pohst, Mathematics of Computation 44,
1985, 463).
"""

import numpy as np

ORTHOGONAL = 0.75  # Lovász' condition: how much shorter a vector must become by an exchange


class TooMany(ValueError):
    """There are more vectors than asked for."""


def reduced(A: np.ndarray, T: np.ndarray) -> np.ndarray:
    """A basis (n, n) of whole numbers of the lattice of A (m, n), its vectors A T short; T (n, n) is one to begin with.

    A has full column rank.
    """
    T = T.copy()
    n, k = T.shape[1], 1
    while k < n:
        R = np.linalg.qr(A @ T[:, : k + 1])[1]
        for j in range(k - 1, -1, -1):
            q = int(np.rint(R[j, k] / R[j, j]))
            T[:, k] -= q * T[:, j]
            R[:, k] -= q * R[:, j]
        slant = R[k - 1, k] / R[k - 1, k - 1]
        if R[k, k] ** 2 >= (ORTHOGONAL - slant**2) * R[k - 1, k - 1] ** 2:
            k += 1
        else:
            T[:, [k - 1, k]] = T[:, [k, k - 1]]
            k = max(k - 1, 1)
    return T


def within(A: np.ndarray, T: np.ndarray, radius: float, most: int) -> np.ndarray:
    """All m (M, n) of whole numbers, but zero, with |A m| up to a radius; T is a reduced basis.

    Raises TooMany where more than `most` have to be looked at.
    """
    R = np.linalg.qr(A @ T)[1]
    n = R.shape[1]
    x, left = np.zeros((1, n)), np.full(1, radius**2)
    for i in range(n - 1, -1, -1):
        centre = -(x[:, i + 1 :] @ R[i, i + 1 :]) / R[i, i]
        reach = np.sqrt(left) / abs(R[i, i])
        low, high = np.ceil(centre - reach), np.floor(centre + reach)
        count = np.maximum(high - low + 1, 0).astype(np.int64)
        if count.sum() > most:
            raise TooMany
        of = np.repeat(np.arange(len(x)), count)
        value = low[of] + np.arange(len(of)) - np.repeat(np.cumsum(count) - count, count)
        x = x[of]
        x[:, i] = value
        left = np.maximum(left[of] - (R[i, i] * (value - centre[of])) ** 2, 0.0)
    found = x @ T.T
    return found[np.any(found != 0, axis=1)]

"""The exact error recursion for many filters at once, B of them side by side.

Three things run together: P, the covariance that a filter believes, which gives its gains; S, the covariance of what
the noise of the plots puts into its error; and E (3, C, B), the parts of the error that do not change from plot to
plot. Column 0 is the mean error; each further column is what one drawn bias of unit variance leads to. So the second
moment of the error is S + E Eᵀ. The last columns are of a truth that is drawn, by how its motion leaves that of the
middle. Symmetric matrices are packed, (6, B): 00, 01, 02, 11, 12, 22.
"""

from dataclasses import dataclass
from typing import NamedTuple, Self

import numpy as np


class Plots(NamedTuple):
    """What plots are: standard deviations sigma, mean errors bias, and standard deviations sigma_bias of the errors
    that are drawn once a realisation, each (2,) of range in m and velocity in m/s; the probability of detection; how
    many columns of E are of a drawn truth."""

    sigma: np.ndarray
    bias: np.ndarray
    sigma_bias: np.ndarray
    detection: float
    of_truth: int = 0

    @property
    def inputs(self) -> np.ndarray:
        """What the plots add to the columns of E, (2, C): their mean error, and a column for each bias drawn."""
        drawn = np.diag(self.sigma_bias)[:, self.sigma_bias > 0]
        return np.concatenate([self.bias[:, None], drawn, np.zeros((2, self.of_truth))], axis=1)


ROWS, COLUMNS = np.triu_indices(3)  # of what is packed
PLACE = np.array([[0, 1, 2], [1, 3, 4], [2, 4, 5]])  # of an element in the packed matrix
DIAGONAL = np.array([0, 3, 5])


@dataclass
class Errors:
    """P, S and E at one scan, as above, in one array (12 + 3 C, B)."""

    rows: np.ndarray

    @classmethod
    def of(cls, P: np.ndarray, S: np.ndarray, E: np.ndarray) -> Self:
        """Of P, S (6, B) and E (3, C, B)."""
        return cls(np.concatenate([P, S, E.reshape(3 * E.shape[1], E.shape[2])]))

    @property
    def P(self) -> np.ndarray:
        """The covariances that are believed, (6, B)."""
        return self.rows[:6]

    @property
    def both(self) -> np.ndarray:
        """P and S, the covariances of what the noise makes: (2, 6, B)."""
        return self.rows[:12].reshape(2, 6, self.rows.shape[1])

    @property
    def E(self) -> np.ndarray:
        """The lasting parts of the errors, (3, C, B)."""
        return self.rows[12:].reshape(3, (len(self.rows) - 12) // 3, self.rows.shape[1])

    def predict(self, dt: float, Q: np.ndarray, defect: np.ndarray) -> None:
        """Go to the next scan, dt (s) later, in place: Q (6, B or 1); defect (3, C) is F x − x⁺ of the truth x."""
        p0, p1, p2, p3, p4, p5 = self.both.swapaxes(0, 1)
        h = 0.5 * dt * dt
        over, above = p2 + dt * p4 + h * p5, p1 + dt * p3 + h * p4
        p0 += dt * p1 + h * p2 + dt * above + h * over
        p1[:] = above + dt * over
        p2[:] = over
        p3 += dt * (2 * p4 + dt * p5)
        p4 += dt * p5
        self.rows[:6] += Q
        self.rows[12:] = (moved(self.E, dt) + defect[:, :, None]).reshape(self.rows[12:].shape)

    def updated(self, plots: Plots, observes: int) -> Self:
        """With a plot, one number taken in after the other: the noises are independent, so the order is free.

        (I − K h) M (I − K h)ᵀ + K R Kᵀ, Joseph's form, for P and for S.
        """
        made, inputs = type(self)(self.rows.copy()), plots.inputs
        both, E = made.both, made.E
        for m in range(observes):
            R = plots.sigma[m] ** 2
            own = both[:, PLACE[m]]
            K = own[0] / (own[0, m] + R)
            rest = own - K * (own[:, m, None] + R)
            for n, (i, j) in enumerate(zip(ROWS, COLUMNS, strict=True)):
                both[:, n] -= K[i] * own[:, j] + rest[:, i] * K[j]
            E += K[:, None] * (inputs[m][:, None] - E[m])
        return made

    def second_moments(self) -> np.ndarray:
        """E eeᵀ (6, B)."""
        return self.both[1] + outer(self.E)


def outer(E: np.ndarray) -> np.ndarray:
    """E Eᵀ of E (3, C, B), packed."""
    made = np.zeros((6, E.shape[2]))
    for n, (i, j) in enumerate(zip(ROWS, COLUMNS, strict=True)):
        for c in range(E.shape[1]):
            made[n] += E[i, c] * E[j, c]
    return made


def defects(x: np.ndarray, dt: float, plots: Plots, drawn: np.ndarray | None) -> np.ndarray:
    """F x − x⁺ of the truth x (K, 3) at every scan from the one before, for the columns of E: (K, 3, C).

    drawn (K, 3, 1 + of_truth): beside x, the mean and the columns of a truth that is drawn; None: it is not.
    """
    made = np.zeros((len(x), 3, plots.inputs.shape[1]))
    made[1:, :, 0] = moved(x[:-1].T, dt).T - x[1:]
    if drawn is not None:
        made[:, :, 0] += drawn[:, :, 0]
        made[:, :, made.shape[2] - plots.of_truth :] = drawn[:, :, 1:]
    return made


def moved(M: np.ndarray, dt: float) -> np.ndarray:
    """F M of M (3, …), F the transition over a time dt (s)."""
    out = M.copy()
    out[0] += dt * (M[1] + dt / 2 * M[2])
    out[1] += dt * M[2]
    return out


class Information:
    """Least-squares starts in the making: information L (3, 3, B) and L times the columns of the error, Y (3, C, B).

    Without process noise, so that the start is the weighted least squares over the plots so far, however they lie.
    """

    def __init__(self, columns: int):
        self.L, self.Y = np.zeros((3, 3, 1)), np.zeros((3, columns, 1))

    def predict(self, dt: float, defect: np.ndarray) -> None:
        """Refer to the next scan, in place: L ← F⁻ᵀ L F⁻¹; the error's columns gain the defect (3, C) of the truth."""
        self.L = back(back(self.L, dt).swapaxes(0, 1), dt)
        self.Y = back(self.Y, dt) + np.einsum("ijb,jc->icb", self.L, defect)

    def update(self, plots: Plots, observes: int) -> None:
        """Take in a plot, in place."""
        for m in range(observes):
            weight = plots.sigma[m] ** -2
            self.L[m, m] += weight
            self.Y[m] += weight * plots.inputs[m][:, None]

    def errors(self) -> Errors:
        """The starts that are made of them."""
        scale = np.sqrt(np.einsum("iib->ib", self.L))
        unit = scale[:, None] * scale
        P = np.moveaxis(np.linalg.inv(np.moveaxis(self.L / unit, 2, 0)), 0, 2) / unit
        P = (P + P.swapaxes(0, 1)) / 2
        own = P[ROWS, COLUMNS]
        return Errors.of(own, own, np.einsum("ijb,jcb->icb", P, self.Y))


def back(M: np.ndarray, dt: float) -> np.ndarray:
    """F⁻ᵀ M of M (3, …)."""
    out = M.copy()
    out[1] -= dt * M[0]
    out[2] += dt * (dt / 2 * M[0] - M[1])
    return out

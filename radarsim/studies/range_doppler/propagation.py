"""The exact error recursion for many filters or patterns of plots at once: matrices (3, 3, B), B of them side by side.

Three things run together: P, the covariance that a filter believes, which gives its gains; S, the covariance of what
the noise of the plots puts into its error; and E (3, C, B), the parts of the error that do not change from plot to
plot. Column 0 is the mean error; each further column is what one drawn bias of unit variance leads to. So the second
moment of the error is S + E Eᵀ. The last columns are of a truth that is drawn, by how its motion leaves that of the
middle.
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


@dataclass
class Errors:
    """P, S (3, 3, B) and E (3, C, B) at one scan, as above."""

    P: np.ndarray
    S: np.ndarray
    E: np.ndarray

    def predict(self, dt: float, Q: np.ndarray, defect: np.ndarray) -> None:
        """Go to the next scan, dt (s) later, in place: Q (3, 3, B or 1); defect (3, C) is F x − x⁺ of the truth x."""
        self.P = congruent(self.P, dt) + Q
        self.S = congruent(self.S, dt)
        self.E = moved(self.E, dt) + defect[:, :, None]

    def update(self, plots: Plots, observes: int) -> None:
        """Take in a plot, in place, one number after the other: the noises are independent, so the order is free.

        (I − K h) P (I − K h)ᵀ + K R Kᵀ, Joseph's form, for P and for S.
        """
        inputs = plots.inputs
        for m in range(observes):
            R = plots.sigma[m] ** 2
            K = self.P[:, m] / (self.P[m, m] + R)
            self.P, self.S = taken(self.P, K, m, R), taken(self.S, K, m, R)
            self.E = self.E + K[:, None] * (inputs[m][:, None] - self.E[m])

    def second_moments(self) -> np.ndarray:
        """E eeᵀ (3, 3, B)."""
        return self.S + np.einsum("icb,jcb->ijb", self.E, self.E)


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


def congruent(M: np.ndarray, dt: float) -> np.ndarray:
    """F M Fᵀ of symmetric M (3, 3, …)."""
    return moved(moved(M, dt).swapaxes(0, 1), dt)


def taken(M: np.ndarray, K: np.ndarray, m: int, R: float) -> np.ndarray:
    """(I − K h) M (I − K h)ᵀ + K R Kᵀ of symmetric M (3, 3, B), h the m-th unit vector, K (3, B)."""
    A = M - K[:, None] * M[m]
    return A - A[:, m, None] * K + R * K[:, None] * K


class Information:
    """Least-squares starts in the making: information L (3, 3, B) and L times the columns of the error, Y (3, C, B).

    Without process noise, so that the start is the weighted least squares over the plots so far, however they lie.
    """

    def __init__(self, columns: int, count: int = 1):
        self.L, self.Y = np.zeros((3, 3, count)), np.zeros((3, columns, count))

    @classmethod
    def of(cls, L: np.ndarray, Y: np.ndarray) -> Self:
        """Of given arrays."""
        made = cls(0, 0)
        made.L, made.Y = L, Y
        return made

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
        return Errors(P, P.copy(), np.einsum("ijb,jcb->icb", P, self.Y))


def back(M: np.ndarray, dt: float) -> np.ndarray:
    """F⁻ᵀ M of M (3, …)."""
    out = M.copy()
    out[1] -= dt * M[0]
    out[2] += dt * (dt / 2 * M[0] - M[1])
    return out

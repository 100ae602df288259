"""The exact error recursion, of one filter or of B of them side by side.

Three things run together: P, the covariance that a filter believes, which gives its gains; S, the covariance of what
the noise of the plots puts into its error; and E, the C parts of the error that do not change from plot to plot. Column
0 is the mean error; each further column is what one drawn bias of unit variance leads to. So the second moment of the
error is S + E Eᵀ. The last columns are of a truth that is drawn, by how its motion leaves that of the middle.
"""

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from radarsim.kernels.algebra import (
    CORRECT,
    NO_NOISE,
    TAKE,
    add_scaled,
    constant_acceleration,
    pack,
    predicted,
    predicted_covariance,
)


class Plots(NamedTuple):
    """What plots are: standard deviations sigma, mean errors bias, and standard deviations sigma_bias of the errors
    that are drawn once a realisation, each (2,) of range in m and velocity in m/s; the probability of detection; how
    many columns of E are of a drawn truth."""

    sigma: np.ndarray
    bias: np.ndarray = np.zeros(2)
    sigma_bias: np.ndarray = np.zeros(2)
    detection: float = 1.0
    of_truth: int = 0

    @property
    def inputs(self) -> np.ndarray:
        """What the plots add to the columns of E, (2, C): their mean error, and a column for each bias drawn."""
        drawn = np.diag(self.sigma_bias)[:, self.sigma_bias > 0]
        return np.concatenate([self.bias[:, None], drawn, np.zeros((2, self.of_truth))], axis=1)


class Errors(NamedTuple):
    """Errors at one scan: P and S packed, six numbers or arrays (B,) each; E three arrays (C, 1 or B), or numbers."""

    P: Any
    S: Any
    E: Any

    def second_moments(self) -> np.ndarray:
        """E e² of the components, (3,) or (3, B)."""
        return np.array([self.S[n] + (e**2).sum(axis=0) for n, e in zip((0, 3, 5), self.E, strict=True)])


def defects(x: np.ndarray, dt: float, plots: Plots, drawn: np.ndarray | None = None) -> np.ndarray:
    """F x − x⁺ of the truth x (K, 3) at every scan from the one before, for the columns of E: (K, 3, C).

    drawn (K, 3, 1 + of_truth): beside x, the mean and the columns of a truth that is drawn; None: it is not.
    """
    made = np.zeros((len(x), 3, plots.inputs.shape[1]))
    made[1:, :, 0] = np.array(predicted(x[:-1].T, constant_acceleration(dt))).T - x[1:]
    if drawn is not None:
        made[:, :, 0] += drawn[:, :, 0]
        made[:, :, made.shape[2] - plots.of_truth :] = drawn[:, :, 1:]
    return made


def started(weights: np.ndarray, believed: np.ndarray, plots: Plots, defect: np.ndarray, dt: float) -> Errors:
    """Errors of a start that weighs plots, (3, 2, n), at the last of the n scans; defect as `defects` has it.

    believed (3, 3) is the covariance that the filter takes them to have.
    """
    S = np.einsum("ijk,j,ljk->il", weights, plots.sigma**2, weights)
    truth = np.zeros((weights.shape[2], 3, defect.shape[2]))
    for k in range(1, len(truth)):  # from zero, as the start forgets what a filter of the model can follow
        truth[k] = np.array(predicted(truth[k - 1], constant_acceleration(dt))) - defect[k]
    E = np.einsum("ijk,kjc->ic", weights, truth[:, :2]) - truth[-1] + weights.sum(axis=2) @ plots.inputs
    P, S = ([float(part) for part in pack(matrix)] for matrix in (believed, S))
    return Errors(P, S, E[:, :, None])


def scans(errors: Errors, observes: int, plots: Plots, Q: Any, defect: np.ndarray, dt: float) -> Iterator[Errors]:
    """The errors after each further scan, with its plot: numbers are taken one after the other, as their noises are
    independent. Q packed, of numbers or arrays (B,); defect (K, 3, C) of these scans."""
    (P, S, E), F = errors, constant_acceleration(dt)
    inputs: Any = plots.inputs[:, :, None]
    of_scans: Any = defect[:, :, :, None]
    if alone := isinstance(Q[0], float) and E.size == 3:  # of plain numbers alone Python is faster
        E, inputs, of_scans = E.ravel().tolist(), inputs.ravel().tolist(), defect.reshape(-1, 3).tolist()
    R, settled = [float(sigma) ** 2 for sigma in plots.sigma[:observes]], False
    gains: list[Any] = []
    for of_scan in of_scans:
        E = add_scaled(predicted(E, F), 1.0, of_scan)
        if not settled:
            before, gains = (P, S), []
            P, S = predicted_covariance(P, F, Q), predicted_covariance(S, F, NO_NOISE)
            for m in range(observes):
                P, gain, _ = TAKE[m](P, R[m], 1.0)
                S = CORRECT[m](S, R[m], gain)
                gains.append(gain)
            settled = alone and before == (P, S)  # to the last bit, and so they stay
        for m, gain in enumerate(gains):
            E = add_scaled(E, inputs[m] - E[m], gain)
        yield Errors(P, S, E)

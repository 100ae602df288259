"""The first two moments of a linear filter's errors, scan by scan, for one filter or many side by side.

When truth and model agree there is no manoeuvre, so the error covariance runs through the filter's own gains without
process noise; where the truth leaves the model, the mean error (dynamic error, bias) runs beside it.

Three things run together: P, the covariance that a filter believes, which gives its gains; S, the covariance of what
the noise of the plots puts into its error; and E, the C parts of the error that do not change from plot to plot. Column
0 is the mean error; each further column is the error that one drawn bias of unit variance causes. So the second moment
of the error is S + E Eᵀ. The last columns belong to a random truth, by how its motion leaves that of the middle."""

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from radarsim.kernels import kalman_algebra
from radarsim.studies.range_doppler.filter_design import LinearFilter


class Plots(NamedTuple):
    """What plots are: standard deviations sigma, mean errors bias, and standard deviations sigma_bias of the errors
    that are drawn once a realisation, each (2,) of range in m and velocity in m/s; the probability of detection; the
    number of columns of E for a random truth."""

    sigma: np.ndarray
    bias: np.ndarray = np.zeros(2)
    sigma_bias: np.ndarray = np.zeros(2)
    detection: float = 1.0
    of_truth: int = 0

    @property
    def inputs(self) -> np.ndarray:
        """What the plots add to the columns of E, (2, C): their mean error, and a column for each bias drawn."""
        random_biases = np.diag(self.sigma_bias)[:, self.sigma_bias > 0]
        return np.concatenate([self.bias[:, None], random_biases, np.zeros((2, self.of_truth))], axis=1)


class Errors(NamedTuple):
    """Errors at one scan: P and S packed, six numbers or arrays (B,) each; E three arrays (C, 1 or B), or numbers."""

    P: Any
    S: Any
    E: Any

    def second_moments(self) -> np.ndarray:
        """E e² of the components, (3,) or (3, B)."""
        return np.array([self.S[n] + (e**2).sum(axis=0) for n, e in zip((0, 3, 5), self.E, strict=True)])


def defects(x: np.ndarray, dt: float, plots: Plots, random_truth: np.ndarray | None = None) -> np.ndarray:
    """F x − x⁺ of the truth x (K, 3) at every scan from the one before, for the columns of E: (K, 3, C).

    random_truth (K, 3, 1 + of_truth): beside x, the mean and the columns of a truth that is drawn; None: it is not."""
    defect = np.zeros((len(x), 3, plots.inputs.shape[1]))
    defect[1:, :, 0] = (
        np.array(kalman_algebra.predict_state(x[:-1].T, kalman_algebra.constant_acceleration(dt))).T - x[1:]
    )
    if random_truth is not None:
        defect[:, :, 0] += random_truth[:, :, 0]
        defect[:, :, defect.shape[2] - plots.of_truth :] = random_truth[:, :, 1:]
    return defect


def start_errors(weights: np.ndarray, believed: np.ndarray, plots: Plots, defect: np.ndarray, dt: float) -> Errors:
    """Errors of a start that weighs plots, (3, 2, n), at the last of the n scans; defect as `defects` has it.

    believed (3, 3) is the covariance that the filter takes them to have."""
    S = np.einsum("ijk,j,ljk->il", weights, plots.sigma**2, weights)
    truth = np.zeros((weights.shape[2], 3, defect.shape[2]))
    for k in range(1, len(truth)):  # from zero, as the start forgets what a filter of the model can follow
        truth[k] = (
            np.array(kalman_algebra.predict_state(truth[k - 1], kalman_algebra.constant_acceleration(dt))) - defect[k]
        )
    E = np.einsum("ijk,kjc->ic", weights, truth[:, :2]) - truth[-1] + weights.sum(axis=2) @ plots.inputs
    P, S = ([float(part) for part in kalman_algebra.pack(matrix)] for matrix in (believed, S))
    return Errors(P, S, E[:, :, None])


def scans(errors: Errors, observes: int, plots: Plots, Q: Any, defect: np.ndarray, dt: float) -> Iterator[Errors]:
    """The errors after each further scan, with its plot: numbers are taken one after the other, as their noises are
    independent. Q packed, of numbers or arrays (B,); defect (K, 3, C) of these scans."""
    (P, S, E), F = errors, kalman_algebra.constant_acceleration(dt)
    inputs: Any = plots.inputs[:, :, None]
    defects_of_scans: Any = defect[:, :, :, None]
    if has_plain_numbers := isinstance(Q[0], float) and E.size == 3:  # of plain numbers alone Python is faster
        E, inputs, defects_of_scans = E.ravel().tolist(), inputs.ravel().tolist(), defect.reshape(-1, 3).tolist()
    R, is_steady = [float(sigma) ** 2 for sigma in plots.sigma[:observes]], False
    gains: list[Any] = []
    add, forward = (
        kalman_algebra.add_scaled.function,
        kalman_algebra.predict_state.function,
    )  # a call less in each of many scans
    for scan_defect in defects_of_scans:
        E = add(forward(E, F), 1.0, scan_defect)
        if not is_steady:
            previous, gains = (P, S), []
            P, S = (
                kalman_algebra.predict_covariance(P, F, Q),
                kalman_algebra.predict_covariance(S, F, kalman_algebra.NO_NOISE),
            )
            for m in range(observes):
                P, gain, _ = kalman_algebra.TAKE[m](P, R[m], 1.0)
                S = kalman_algebra.CORRECT[m](S, R[m], gain)
                gains.append(gain)
            is_steady = has_plain_numbers and previous == (P, S)  # to the last bit, and so they stay
        for m, gain in enumerate(gains):
            E = add(E, inputs[m] - E[m], gain)
        yield Errors(P, S, E)


def error_recursion(
    filter_: LinearFilter, plots: Plots, truth: np.ndarray, dt: float, random_truth: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Lasting errors E (K, 3, C) and covariance S (K, 3, 3) due to noise, at every scan of a truth (K, 3).

    random_truth: see `defects`. Before the start the estimates are the plots."""
    defect, observes, start_index = defects(truth, dt, plots, random_truth), filter_.observes, filter_.start - 1
    E, S = np.zeros_like(defect), np.zeros((len(truth), 6))
    E[:start_index, :observes], S[:start_index, 0] = plots.inputs[:observes], plots.sigma[0] ** 2
    S[:start_index, 3] = plots.sigma[1] ** 2 if observes > 1 else 0.0
    start = start_errors(filter_.weights, filter_.believed[start_index], plots, defect, dt)
    E[start_index], S[start_index] = start.E[:, :, 0], start.S
    later_errors = list(scans(start, observes, plots, filter_.noise, defect[filter_.start :], dt))
    if later_errors:
        E[filter_.start :] = np.array([errors.E for errors in later_errors]).reshape(len(later_errors), 3, -1)
        S[filter_.start :] = [errors.S for errors in later_errors]
    return E, kalman_algebra.unpack(S.T)

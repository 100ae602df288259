"""The result of a registration: biases, errors of plots, residuals of each aircraft."""

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np


@dataclass(frozen=True)
class Bias:
    """A bias with its 95 % interval; NaN if it is unknown, for the reason in `why`."""

    key: str
    value: float
    lo: float
    hi: float
    why: str = ""

    @property
    def identifiable(self) -> bool:
        """Whether the plots determine it."""
        return not self.why


@dataclass(frozen=True)
class AircraftResiduals:
    """Residuals of an aircraft's plots: medians of range and bearing, its lag beyond time_s and the σ of that lag."""

    name: str
    plots: int
    range_m: float
    bearing_rad: float
    time_s: float
    sigma_time_s: float


@dataclass(frozen=True)
class Finding:
    """What the four biases do not hold: the coordinate in which plots err, what the error goes with, its cause and the
    keys of its coefficients, none if it is unknown, and the causes that these flights do not distinguish from it."""

    coordinate: str
    companion: str
    cause: str
    keys: tuple[str, ...]
    rivals: tuple[str, ...]


@dataclass(frozen=True)
class Adjustment:
    """Biases in the order of BIASES; σ of range and bearing of a plot; residuals (n, 2); plots without weight; the
    number of independent clusters; lag of each aircraft beyond time_s and its σ, by number; the coefficients of errors
    beyond the biases; which errors these are; σ that the biases alone leave, and σ by differences of successive
    plots."""

    biases: tuple[Bias, ...]
    sigma: tuple[float, float]
    residuals: np.ndarray
    outliers: int
    clusters: int
    lags: dict[int, tuple[float, float]]
    coefficients: tuple[Bias, ...]
    findings: tuple[Finding, ...]
    sigma_of_biases_alone: tuple[float, float]
    sigma_of_steps: tuple[float, float]


@dataclass(frozen=True)
class Registration:
    """The result of `register`.

    The biases and errors of plots; the number of plots, and of matched ones by kind of identity; their median offsets
    in range and bearing before the fit; the plots left out; the distance of 95 % of interpolated positions from
    straight lines."""

    adjustment: Adjustment
    aircraft: tuple[AircraftResiduals, ...]
    plots: int
    matched: int
    counts_by_kind: dict[str, int]
    median_offsets: tuple[float, float]  # m and degrees
    left_out: tuple[str, ...]
    bent_m: float


def registration_document(registration: Registration) -> dict[str, Any]:
    """The result as one document of plain data."""
    r, b = registration.adjustment.sigma
    return {
        "biases": [{**asdict(bias), "identifiable": bias.identifiable} for bias in registration.adjustment.biases],
        "sigma_range_m": r,
        "sigma_bearing_rad": b,
        "plots": registration.plots,
        "matched": registration.matched,
        "by": registration.counts_by_kind,
        "outliers": registration.adjustment.outliers,
        "clusters": registration.adjustment.clusters,
        "interpolation_m": registration.bent_m,
        "left_out": registration.left_out,
        "aircraft": [asdict(aircraft) for aircraft in registration.aircraft],
        "coefficients": [asdict(coefficient) for coefficient in registration.adjustment.coefficients],
        "findings": [asdict(finding) for finding in registration.adjustment.findings],
        "sigma_of_biases_alone": registration.adjustment.sigma_of_biases_alone,
        "sigma_of_steps": registration.adjustment.sigma_of_steps,
    }

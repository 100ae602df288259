"""The axes of the sums of a sonar case: their labels, with the exact values."""

from dataclasses import dataclass

import numpy as np

from radarsim.engine.results import Axes


@dataclass(frozen=True, kw_only=True)
class SonarAxes(Axes):
    """Labels of F filters over K scans in C coordinates."""

    coordinates: tuple[tuple[str, str], ...]  #: name and unit of each coordinate that the filters work in.
    sizes: np.ndarray  #: (F,) components of each filter's state in one coordinate, 2 or 3.
    #: (F, K, C) exact σ of the value extrapolated by one scan, in the row of the scan that it was extrapolated from,
    #: in the coordinate's unit; NaN where it is not known.
    exact_ahead: np.ndarray
    exact_nees: np.ndarray  #: (F, K, C) expected eᵀP⁻¹e of the complete state in a coordinate; NaN likewise.
    scan_period_s: float  #: period of the first sonar, s.
    sigma: np.ndarray  #: (C,) nominal standard deviation of a plot in each coordinate, in its unit.


@dataclass(frozen=True, kw_only=True)
class GivenPlotsAxes(SonarAxes):
    """Labels of cases whose filters have known association: smoothing, and manoeuvres."""

    rho: np.ndarray  #: (C,) correlation of the errors of neighbouring plots.
    sigma_of_plots: np.ndarray  #: (K, C) standard deviation of each plot, infinite where there never is a plot.
    #: mean error along the line of sight of the first plot converted to x and y, m; zero where it is not converted, or
    #: converted without bias.
    conversion_bias: float
    polar: np.ndarray  #: (K, C, 3) the target's range, bearing (and depth or elevation) with first and second rates.

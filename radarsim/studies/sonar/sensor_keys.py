"""Keys of the sonar, of further sonars, and of the surveyed sector."""

import math
from collections.abc import Iterator
from typing import Annotated

from pydantic import Field

from radarsim.config import key_types, marks
from radarsim.config.cross_checks import CheckError, check_error, cross_check
from radarsim.config.key_types import Name, NonNegative, Number, Positive, WholeNumber, key
from radarsim.config.marks import DesignMark
from radarsim.config.model import Model

MAX_SCANS = 100_000
AngleSigma = Annotated[Positive, Field(le=0.5)]  # rad: beyond about 30 degrees the error of an angle is not Gaussian


class Correlations(Model):
    """A correlation for each coordinate; zero where none is given."""

    range: key_types.Correlation = key("correlation of errors in range", "correlation of the errors in range", 0.0)
    bearing: key_types.Correlation = key(
        "correlation of errors in bearing", "correlation of the errors in bearing", 0.0
    )
    third: key_types.Correlation = key(
        "correlation of errors in depth or elevation", "correlation of the errors in depth or elevation", 0.0
    )

    def coordinate(self, index: int) -> float:
        """The correlation of one coordinate, by its number."""
        return (self.range, self.bearing, self.third)[index]


def coordinate_correlation(value: "float | Correlations", index: int) -> float:
    """The correlation of one coordinate; a single number applies to all of them."""
    return value.coordinate(index) if isinstance(value, Correlations) else value


class FurtherSensor(Model):
    """A further sonar that observes the same target at its own times and may measure the bearing only."""

    sigma_range_m: Positive | None = key(
        "σ of the measured range", "standard deviation of a measured range, m; none: not measured", None, symbol="σ_r"
    )
    sigma_bearing_rad: AngleSigma | None = key(
        "σ of the measured bearing", "standard deviation of a measured bearing, rad", None, symbol="σ_β"
    )
    scan_period_s: Positive = key("scan period", "time between two of its plots, s", symbol="Δt")
    first_s: NonNegative = key(
        "time of the first plot", "time of its first plot, s after the first plot of the first sonar"
    )


class Sector(Model):
    """The surveyed sector, which contains all false plots; a target outside it is not detected."""

    range_m: tuple[NonNegative, Positive] = key("limits of range", "smallest and largest range, m")
    bearing_rad: tuple[Number, Number] = key("limits of bearing", "first and last bearing, from north to east, rad")

    @cross_check
    def _order(self) -> Iterator[CheckError]:
        if self.range_m[1] <= self.range_m[0]:
            yield check_error("range_m", "must be a smaller and a larger range")
        if not 0 < self.bearing_rad[1] - self.bearing_rad[0] <= 2 * math.pi + 1e-9:
            yield check_error("bearing_rad", "must be a smaller and a larger bearing, at most a full circle apart")

    def area_m2(self) -> float:
        """The area of the sector, m²."""
        return (self.bearing_rad[1] - self.bearing_rad[0]) * (self.range_m[1] ** 2 - self.range_m[0] ** 2) / 2


class Sensor(Model):
    """A sonar: accuracy of its plots, scan period, how plots are missed, and false ones."""

    name: Annotated[Name | None, marks.DisplayMark()] = key("name", "display name", None)
    sigma_range_m: Positive = key("σ of the measured range", "standard deviation of a measured range, m", symbol="σ_r")
    sigma_bearing_rad: AngleSigma = key(
        "σ of the measured bearing", "standard deviation of a measured bearing, rad", symbol="σ_β"
    )
    sigma_depth_m: Positive | None = key(
        "σ of the measured depth", "standard deviation of a measured depth, m; none: not measured", None, symbol="σ_h"
    )
    sigma_elevation_rad: AngleSigma | None = key(
        "σ of the measured elevation",
        "standard deviation of a measured elevation, rad; replaces the depth",
        None,
        symbol="σ_ε",
    )
    scan_period_s: Positive = key("scan period", "time between two plots, s: T0 of the paper", symbol="Δt")
    error_correlation: key_types.Correlation | Correlations = key(
        "correlation of neighbouring errors",
        "correlation ρ of the errors of neighbouring plots, eq. (15); one number, or by coordinate",
        0.0,
        symbol="ρ",
    )
    detection_probability: Annotated[key_types.Probability, Field(gt=0)] = key(
        "detection probability",
        "probability that a scan gives a plot; the first scan always does, except for filters with an association",
        1.0,
        symbol="P_D",
    )
    missed_scans: tuple[Annotated[int, WholeNumber(2, MAX_SCANS)], ...] = key(
        "missed scans", "scans, counted from 1, that never give a plot", ()
    )
    further: tuple[FurtherSensor, ...] = key("further sonars", "further sonars on the same target", (), max_length=4)
    false_plots_per_km2: Annotated[NonNegative, Field(le=1e4), DesignMark()] = key(
        "clutter density", "mean number of false plots per scan and km² of the surveyed sector", 0.0, unit="km⁻²"
    )
    sector: Annotated[Sector | None, DesignMark()] = key(
        "surveyed sector", "the surveyed sector of filters with an association; there are no plots outside it", None
    )

    @cross_check
    def _consistent(self) -> Iterator[CheckError]:
        if self.sigma_depth_m is not None and self.sigma_elevation_rad is not None:
            yield check_error("sigma_elevation_rad", "give either the depth or the elevation")

    @cross_check
    def _further_fit(self) -> Iterator[CheckError]:
        if self.further and self.error_correlation != 0.0:
            yield check_error(
                "error_correlation", "must be 0 where there are further sonars: their errors are independent"
            )

    @cross_check
    def _further_see(self) -> Iterator[CheckError]:
        if self.further and self.detection_probability < 1:
            yield check_error("detection_probability", "must be 1 where there are further sonars; give missed_scans")

"""Keys that studies of a target in the plane share: a radar with range, bearing and radial velocity, and flights."""

import math
from typing import Any, Literal

from radarsim.config import radial_keys
from radarsim.config.cross_checks import check_error, cross_check
from radarsim.config.key_types import Correlation, NonNegative, Number, Positive, Probability, key
from radarsim.config.model import Model
from radarsim.constants import STANDARD_GRAVITY_MPS2

UNFOLDED_MPS = 2 * radial_keys.MAX_SPEED_MPS  # the interval where none is stated


class Radar(radial_keys.Radar):
    """A surveillance radar that measures range, bearing and radial velocity."""

    sigma_bearing_rad: Positive = key(
        "σ of the measured bearing", "standard deviation of a measured bearing, rad", symbol="σ_β", le=0.5
    )
    range_velocity_correlation: Correlation = key(
        "correlation of range and velocity", "correlation of the errors of one plot, as a chirp couples them", 0.0
    )
    repetition_rate_hz: Positive | None = key(
        "pulse repetition rate",
        "folds velocities into λ F_r / 2, Hz; default: they are unambiguous",
        None,
        symbol="F_r",
    )
    detection_probability: Probability = key(
        "detection probability", "probability of a plot of the target after the first", 1.0, symbol="P_D", gt=0
    )
    false_plots_per_km2: NonNegative = key(
        "clutter density", "mean number of false plots per scan and km², of any velocity", 0.0, unit="km⁻²"
    )
    false_plots_from_s: NonNegative = key(
        "start of false plots", "time after the first plot from which there are false plots, s", 0.0
    )

    @property
    def span_mps(self) -> float:
        """The unambiguous velocity interval."""
        return UNFOLDED_MPS if self.repetition_rate_hz is None else self.wavelength_m * self.repetition_rate_hz / 2

    @property
    def sigma(self) -> tuple[float, float, float]:
        """The standard deviations of a plot's range, bearing and radial velocity."""
        return self.sigma_range_m, self.sigma_bearing_rad, self.sigma_velocity_mps

    @cross_check
    def _check_false_plots(self) -> Any:
        if self.false_plots_per_km2 and self.repetition_rate_hz is None:
            yield check_error("false_plots_per_km2", "needs repetition_rate_hz, whose interval holds their velocities")


class Flight(Model):
    """Where a flight begins, and how its course varies."""

    bearing_rad: Number = key("bearing", "bearing at the first plot, from north to the east, rad", 0.0)
    course_spread_rad: NonNegative = key(
        "spread of the course",
        "courses are even, by realisation, up to this angle to either side, rad",
        0.0,
        le=math.pi,
    )

    @property
    def turn(self) -> tuple[float, float, float]:
        """The rate of a turn, rad/s to the east, its start and its duration, s; zero where there is none."""
        return 0.0, 0.0, 0.0


class Straight(Flight):
    """A straight flight."""

    kind: Literal["straight"] = key("kind", "straight flight")
    range_m: Positive = key("range", "range at the first plot, m")
    speed_mps: NonNegative = key("speed", "speed, constant, m/s", le=radial_keys.MAX_SPEED_MPS)
    aspect_rad: Number = key("aspect angle", "direction of flight from the line of sight outwards, rad")


class Turn(Flight, radial_keys.Turn):
    """Straight flight, a turn of constant load, straight flight again."""

    acceleration_g: Number = key(
        "acceleration", "lateral, standard gravities; positive: to the right", unit="g", symbol="a"
    )

    @property
    def turn(self) -> tuple[float, float, float]:
        """As of every flight."""
        return self.acceleration_g * STANDARD_GRAVITY_MPS2 / self.speed_mps, self.start_s, self.duration_s


class FlyBy(Flight, radial_keys.FlyBy):
    """Straight flight past the radar."""

    @property
    def range_m(self) -> float:
        """The range at the first plot."""
        return self.start_range_m

    @property
    def aspect_rad(self) -> float:
        """The direction of flight from the line of sight outwards."""
        return math.pi - math.asin(self.distance_m / self.start_range_m)

"""Keys of the target: polynomials, and vessels that accelerate or turn."""

from collections.abc import Iterator
from typing import Annotated, ClassVar, Literal

from pydantic import Field

from radarsim.config.cross_checks import CheckError, check_error, cross_check
from radarsim.config.key_types import NonNegative, Number, Positive, key
from radarsim.config.model import Model

Derivatives = Annotated[tuple[Number, ...], Field(min_length=1, max_length=12)]


class Polynomial(Model):
    """A target whose polar or cartesian coordinates are polynomials of time (eq. 1)."""

    kind: Literal["polynomial"] = key("kind", "each coordinate is a polynomial of time")
    frame: Literal["polar", "cartesian"] = key("frame of coordinates", "which coordinates are polynomials")
    range_m: Derivatives | None = key(
        "range and its derivatives",
        "range and its derivatives at the first plot: m, m/s, m/s², …",
        only={"frame": "polar"},
    )
    bearing_rad: Derivatives | None = key(
        "bearing and its derivatives",
        "bearing and its derivatives, from north to east: rad, …",
        only={"frame": "polar"},
    )
    x_m: Derivatives | None = key(
        "distance north", "distance north and its derivatives: m, m/s, m/s², …", only={"frame": "cartesian"}
    )
    y_m: Derivatives | None = key(
        "distance east", "distance east and its derivatives: m, m/s, m/s², …", only={"frame": "cartesian"}
    )
    depth_m: Derivatives | None = key("depth and its derivatives", "depth and its derivatives: m, m/s, …", None)
    elevation_rad: Derivatives | None = key(
        "elevation and its derivatives", "elevation and its derivatives: rad, rad/s, …", None
    )
    fluctuation_mps2: NonNegative = key(
        "σ of the random acceleration of the target",
        "standard deviation, m/s², of a random acceleration drawn at every scan, so that the velocity is a random walk",
        0.0,
    )

    @cross_check
    def _positive_range(self) -> Iterator[CheckError]:
        if self.frame == "polar" and self.range_m is not None and self.range_m[0] <= 0:
            yield check_error("range_m", "must begin with a positive range")

    @cross_check
    def _fluctuates(self) -> Iterator[CheckError]:
        if self.frame == "cartesian" and self.fluctuation_mps2:
            yield check_error("fluctuation_mps2", "needs the polar frame")

    @property
    def initial_range_m(self) -> float:
        """Range at the first plot, m; converts lateral distances to angles."""
        if self.range_m is not None:
            return self.range_m[0]
        return _from_origin(*(derivatives[0] for derivatives in (self.x_m, self.y_m) if derivatives))


def _from_origin(*coordinates: float) -> float:
    """The distance from the sonar, at least 1 m."""
    return max(sum(value**2 for value in coordinates) ** 0.5, 1.0)


class Vessel(Model):
    """A vessel that starts at a given position, with a given speed and course."""

    kind: Literal["accelerating", "turning"] = key("kind", "how the vessel manoeuvres")
    x_m: Number = key("distance north", "distance north of the sonar at the first plot, m")
    y_m: Number = key("distance east", "distance east of the sonar at the first plot, m")
    speed_mps: NonNegative = key("speed", "initial speed, m/s")
    course_rad: Number = key("course", "initial course, from north to east, rad")
    fluctuation_mps2: ClassVar[float] = 0.0

    @property
    def initial_range_m(self) -> float:
        """Range at the first plot, m; converts lateral distances to angles."""
        return _from_origin(self.x_m, self.y_m)


class Accelerating(Vessel):
    """A vessel on a straight course whose speed changes at a constant rate between two times."""

    kind: Literal["accelerating"] = key("kind", "straight course with a step of acceleration along it")
    acceleration_mps2: Number = key("acceleration", "acceleration along the course, m/s²; 0: no manoeuvre", symbol="a")
    start_s: NonNegative = key("start time", "start of the acceleration, s from the first plot")
    end_s: Positive | None = key("end time", "end of the acceleration, s; none: it never ends", None)

    @cross_check
    def _order(self) -> Iterator[CheckError]:
        if self.end_s is not None and self.end_s <= self.start_s:
            yield check_error("end_s", "must come after start_s")


class TimedTurn(Model):
    """A turn between two times."""

    start_s: NonNegative = key("start time", "start of the turn, s from the first plot")
    end_s: Positive = key("end time", "end of the turn, s")
    rate_radps: Number = key("turn rate", "turn rate, rad/s, positive to starboard")

    @cross_check
    def _order(self) -> Iterator[CheckError]:
        if self.end_s <= self.start_s:
            yield check_error("end_s", "must come after start_s")


class Turning(Vessel):
    """A vessel at constant speed on straight legs and turns."""

    kind: Literal["turning"] = key("kind", "straight legs and turns at constant speed")
    speed_mps: Positive = key("speed", "speed, m/s")
    turns: Annotated[tuple[TimedTurn, ...], Field(min_length=1, max_length=16)] = key(
        "turns", "the turns, in order of time"
    )

    @cross_check
    def _in_order(self) -> Iterator[CheckError]:
        if any(later.start_s < earlier.end_s for earlier, later in zip(self.turns, self.turns[1:], strict=False)):
            yield check_error("turns", "must follow one another without overlap")


Target = Annotated[Polynomial | Turning | Accelerating, Field(discriminator="kind")]

"""Keys that studies of range and radial velocity share: a radar's accuracies, and targets in range."""

import math
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

from pydantic import Field, GetJsonSchemaHandler

from radarsim.config.faults import short
from radarsim.config.fields import (
    At,
    DataFile,
    Display,
    Model,
    Name,
    NonNegative,
    NotRead,
    Number,
    Positive,
    Study,
    at,
    cross_check,
    key,
)
from radarsim.physics.bands import Band, outside_band
from radarsim.physics.constants import STANDARD_GRAVITY_MPS2

MOST_SCANS = 100_000
FARTHEST_M = 1e15  # a range that still resolves a metre in double precision
RESOLVED = 1e-4 * 2.0**52  # range over accuracy at which rounding reaches a ten-thousandth of the accuracy
NEAREST_M = 100.0  # a target that flies over the radar has no radial motion that a filter could follow
FASTEST_MPS = 12_000.0  # escape from the Earth
HARDEST_MPS2 = 1000.0  # about 100 g, more than any missile's

Coefficients = Annotated[tuple[Number, ...], Field(min_length=1, max_length=12)]
COEFFICIENTS = "derivatives of range at the first plot: m, m/s, m/s², … (the sum of c_i t^i / i!)"


class InBand(Model):
    """What lies in a wave band: its wavelength must."""

    if TYPE_CHECKING:
        band: Band | None
        wavelength_m: float

    @cross_check
    def _in_its_band(self) -> Iterator[At]:
        limits = outside_band(self.band, self.wavelength_m)
        if limits is not None:
            yield at("band", f"{self.band} is {' to '.join(map(short, limits))} m, not {short(self.wavelength_m)}")


class Radar(InBand):
    """A surveillance radar: accuracies of one plot, and the period of its scans."""

    name: Annotated[Name | None, Display()] = key("name", "display name", None)
    band: Annotated[Band | None, Display()] = key(
        "wave band", "wave band, for display: by its wavelength, or by its letter (IEEE Std 521)", None
    )
    wavelength_m: Positive = key("wavelength", "wavelength, m: gives the Doppler frequency of a velocity", symbol="λ")
    sigma_range_m: Positive = key("σ of the measured range", "standard deviation of a measured range, m", symbol="σ_r")
    sigma_velocity_mps: Positive = key(
        "σ of the measured radial velocity", "standard deviation of a measured radial velocity, m/s", symbol="σ_V"
    )
    scan_period_s: Positive = key("scan period", "time between two plots, s", symbol="Δt")


class Lasting(Study):
    """A study whose keys give the length of a run as a number of scans, or as a time in its place."""

    in_place_of: ClassVar[Mapping[str, str]] = {"scans": "duration_s", "duration_s": "scans"}
    most_scans: ClassVar[int] = MOST_SCANS

    if TYPE_CHECKING:
        radar: Any
        scans: int | None
        duration_s: float | None

    @classmethod
    def __get_pydantic_json_schema__(cls, core_schema: Any, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        schema = super().__get_pydantic_json_schema__(core_schema, handler)
        length = {"oneOf": [{"required": ["scans"]}, {"required": ["duration_s"]}]}
        return schema | {"allOf": [*schema.get("allOf", []), length]}

    @property
    def plots(self) -> int:
        """How many scans there are: as given, or to the last scan within the duration."""
        if self.duration_s is None:
            if self.scans is None:
                raise NotRead("scans")
            return self.scans
        return int(self.duration_s / self.radar.scan_period_s * (1 + 1e-12)) + 1

    @cross_check
    def _length_given(self) -> Iterator[At]:
        if self.scans is None and self.duration_s is None:
            yield at("scans", "required key is missing, or duration_s in its place")
        elif self.scans is not None and self.duration_s is not None:
            yield at("duration_s", "stands in place of scans: give one of them")
        elif not 2 <= self.plots <= self.most_scans:
            yield at("duration_s", f"must be 2 to {self.most_scans} scans of radar.scan_period_s, makes {self.plots}")


class Polynomial(Model):
    """A range that is a polynomial of time; up to the second degree it fits the filters' model exactly."""

    kind: Literal["polynomial"] = key("kind", "a polynomial of any degree up to 11")
    coefficients: Coefficients = key("derivatives of the range at the first plot", COEFFICIENTS)

    def reach_m(self, t: float) -> float:
        """A bound on the range up to a time t (s)."""
        return polynomial_reach_m(self.coefficients, t)


def polynomial_reach_m(coefficients: tuple[float, ...], t: float) -> float:
    """A bound on the size of a polynomial up to a time t (s)."""
    return sum(abs(c) * t**i / math.factorial(i) for i, c in enumerate(coefficients))


class Starting(Model):
    """What targets that break the model share: a moment at which they do."""

    start_s: NonNegative = key("start time", "time from the first plot at which it begins, s")


class AccelerationStart(Starting):
    """A polynomial that begins to accelerate (or brake) at a moment."""

    kind: Literal["acceleration_start"] = key("kind", "a constant acceleration that sets in at a moment")
    coefficients: Coefficients = key("derivatives of the range at the first plot", COEFFICIENTS)
    acceleration_mps2: Annotated[Number, Field(ge=-HARDEST_MPS2, le=HARDEST_MPS2)] = key(
        "acceleration", "radial acceleration added from then on, m/s²", symbol="a"
    )

    def reach_m(self, t: float) -> float:
        """A bound on the range up to a time t (s)."""
        return polynomial_reach_m(self.coefficients, t) + abs(self.acceleration_mps2) * t**2 / 2


class Turn(Starting):
    """Straight flight in a plane through the radar, a turn of constant load, straight flight again."""

    kind: Literal["turn"] = key("kind", "a turn of given g between two straight legs")
    range_m: Positive = key("range", "range at the first plot, m")
    speed_mps: Annotated[Positive, Field(le=FASTEST_MPS)] = key("speed", "speed, constant, m/s")
    aspect_rad: Number = key(
        "aspect angle", "direction of flight from the line of sight outwards, rad (pi: straight in)"
    )
    acceleration_g: Annotated[Number, Field(ge=-100, le=100)] = key(
        "acceleration",
        "lateral acceleration of the turn, standard gravities; positive: to the left",
        symbol="a",
        unit="g",
    )
    duration_s: Positive = key("duration", "length of the turn, s")

    def reach_m(self, t: float) -> float:
        """A bound on the range up to a time t (s)."""
        return self.range_m + self.speed_mps * t

    def closest_m(self, t: float) -> float:
        """The least distance from the radar up to a time t (s): of two straight legs and of the arc between them."""
        begin, end = min(self.start_s, t), min(self.start_s + self.duration_s, t)
        rate = self.acceleration_g * STANDARD_GRAVITY_MPS2 / self.speed_mps
        x, y, heading = self.range_m, 0.0, self.aspect_rad
        nearest, x, y = straight_leg(x, y, heading, self.speed_mps * begin)
        if rate == 0:
            return min(nearest, straight_leg(x, y, heading, self.speed_mps * (t - begin))[0])
        radius = self.speed_mps / rate
        centre = (x - radius * math.sin(heading), y + radius * math.cos(heading))
        towards = math.atan2(-centre[1] / radius, -centre[0] / radius)  # of the point of the circle nearest the radar
        turned = (math.copysign(1.0, rate) * (towards + math.pi / 2 - heading)) % (2 * math.pi)
        if turned <= abs(rate) * (end - begin):
            nearest = min(nearest, abs(math.hypot(*centre) - abs(radius)))
        heading += rate * (end - begin)
        x, y = centre[0] + radius * math.sin(heading), centre[1] - radius * math.cos(heading)
        return min(nearest, straight_leg(x, y, heading, self.speed_mps * (t - end))[0])


def straight_leg(x: float, y: float, heading: float, length: float) -> tuple[float, float, float]:
    """The least distance from the origin along a straight leg from (x, y), and the point where it ends."""
    along = min(max(-(x * math.cos(heading) + y * math.sin(heading)), 0.0), length)
    nearest = math.hypot(x + along * math.cos(heading), y + along * math.sin(heading))
    return nearest, x + length * math.cos(heading), y + length * math.sin(heading)


class FlyBy(Model):
    """Straight flight at a constant speed past the radar, at a distance."""

    kind: Literal["fly_by"] = key("kind", "straight flight past the radar")
    distance_m: Annotated[Positive, Field(ge=NEAREST_M)] = key(
        "distance of closest approach", "distance of closest approach, m"
    )
    speed_mps: Annotated[Positive, Field(le=FASTEST_MPS)] = key("speed", "speed, constant, m/s")
    start_range_m: Positive = key("range at the first plot", "range at the first plot, before closest approach, m")

    @cross_check
    def _begins_outside(self) -> Iterator[At]:
        if self.start_range_m < self.distance_m:
            yield at("start_range_m", f"must be >= distance_m, {short(self.distance_m)}")

    def reach_m(self, t: float) -> float:
        """A bound on the range up to a time t (s)."""
        return self.start_range_m + self.speed_mps * t


class Recorded(Model):
    """A flight recorded in a file, smoothed by a spline whose derivatives are the true velocity and acceleration."""

    kind: Literal["recorded"] = key(
        "kind", "a flight from a CSV file with columns t_s, x_m, y_m, z_m, the radar at the origin"
    )
    file: Annotated[str, DataFile()] = key("file", "the file, from the folder of this one")

    def reach_m(self, t: float) -> float:
        """A bound on the range up to a time t (s): of what is in the file none is known here."""
        return 0.0


def within_reach(target: Any, radar: Radar, last: float) -> Iterator[At]:
    """The faults of a target that goes so far up to a time `last` (s) that its accuracies drown, or flies over."""
    finest = min(radar.sigma_range_m, radar.sigma_velocity_mps * radar.scan_period_s)
    farthest = min(FARTHEST_M, finest * RESOLVED)
    if target.reach_m(last) > farthest:
        so_far = f"must stay within {short(float(f'{farthest:.2g}'))} m of the radar up to the last plot"
        yield at("target", f"{so_far}, at {short(last)} s: beyond, double precision does not resolve its accuracies")
    elif isinstance(target, Turn) and target.closest_m(last) < NEAREST_M:
        yield at("target", f"must not fly over the radar: it comes within {short(NEAREST_M)} m of it")

"""Keys that studies of range and radial velocity share: the accuracies of a radar, and targets in range."""

import math
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

from pydantic import Field, GetJsonSchemaHandler

from radarsim.config.cross_checks import CheckError, InvalidFieldError, check_error, cross_check
from radarsim.config.key_types import Name, NonNegative, Number, Positive, key
from radarsim.config.marks import DataFile, DisplayMark
from radarsim.config.model import Model
from radarsim.config.study_keys import StudyKeys
from radarsim.config.value_text import short_number
from radarsim.constants import STANDARD_GRAVITY_MPS2, Band, outside_band

MAX_SCANS = 100_000
MAX_RANGE_M = 1e15  # the largest range at which double precision resolves a metre
MAX_RANGE_TO_SIGMA = 1e-4 * 2.0**52  # range over accuracy at which rounding is a ten-thousandth of the accuracy
MIN_RANGE_M = 100.0  # a target that flies over the radar has no radial motion that a filter could follow
MAX_SPEED_MPS = 12_000.0  # the escape velocity from the Earth
MAX_ACCELERATION_MPS2 = 1000.0  # about 100 g, more than any missile reaches

Coefficients = Annotated[tuple[Number, ...], Field(min_length=1, max_length=12)]
COEFFICIENTS = "derivatives of range at the first plot: m, m/s, m/s², … (the sum of c_i t^i / i!)"


class WaveBandKeys(Model):
    """What lies in a wave band: its wavelength must."""

    if TYPE_CHECKING:
        band: Band | None
        wavelength_m: float

    @cross_check
    def _check_band(self) -> Iterator[CheckError]:
        limits = outside_band(self.band, self.wavelength_m)
        if limits is not None:
            yield check_error(
                "band",
                f"{self.band} is {' to '.join(map(short_number, limits))} m, not {short_number(self.wavelength_m)}",
            )


class Radar(WaveBandKeys):
    """A surveillance radar: accuracies of one plot, and the period of its scans."""

    name: Annotated[Name | None, DisplayMark()] = key("name", "display name", None)
    band: Annotated[Band | None, DisplayMark()] = key(
        "wave band", "wave band, for display: by its wavelength, or by its letter (IEEE Std 521)", None
    )
    wavelength_m: Positive = key("wavelength", "wavelength, m: gives the Doppler frequency of a velocity", symbol="λ")
    sigma_range_m: Positive = key("σ of the measured range", "standard deviation of a measured range, m", symbol="σ_r")
    sigma_velocity_mps: Positive = key(
        "σ of the measured radial velocity", "standard deviation of a measured radial velocity, m/s", symbol="σ_V"
    )
    scan_period_s: Positive = key("scan period", "time between two plots, s", symbol="Δt")


class TimedStudyKeys(StudyKeys):
    """A study whose keys give the length of a run as a number of scans, or as a time in its place."""

    in_place_of: ClassVar[Mapping[str, str]] = {"scans": "duration_s", "duration_s": "scans"}
    most_scans: ClassVar[int] = MAX_SCANS

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
        """The number of scans: as given, or up to the last scan within the duration."""
        if self.duration_s is None:
            if self.scans is None:
                raise InvalidFieldError("scans")
            return self.scans
        return int(self.duration_s / self.radar.scan_period_s * (1 + 1e-12)) + 1

    @cross_check
    def _check_length(self) -> Iterator[CheckError]:
        if self.scans is None and self.duration_s is None:
            yield check_error("scans", "required key is missing, or duration_s in its place")
        elif self.scans is not None and self.duration_s is not None:
            yield check_error("duration_s", "stands in place of scans: give one of them")
        elif not 2 <= self.plots <= self.most_scans:
            yield check_error(
                "duration_s", f"must be 2 to {self.most_scans} scans of radar.scan_period_s, makes {self.plots}"
            )


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


class ManoeuvreStart(Model):
    """What targets that break the model share: a moment at which they do."""

    start_s: NonNegative = key("start time", "start time, counted from the first plot, s")


class AccelerationStart(ManoeuvreStart):
    """A polynomial that begins to accelerate (or brake) at a moment."""

    kind: Literal["acceleration_start"] = key("kind", "a constant acceleration that starts at a given time")
    coefficients: Coefficients = key("derivatives of the range at the first plot", COEFFICIENTS)
    acceleration_mps2: Annotated[Number, Field(ge=-MAX_ACCELERATION_MPS2, le=MAX_ACCELERATION_MPS2)] = key(
        "acceleration", "radial acceleration added from the start time on, m/s²", symbol="a"
    )

    def reach_m(self, t: float) -> float:
        """A bound on the range up to a time t (s)."""
        return polynomial_reach_m(self.coefficients, t) + abs(self.acceleration_mps2) * t**2 / 2


class Turn(ManoeuvreStart):
    """Straight flight in a plane through the radar, a turn of constant load, straight flight again."""

    kind: Literal["turn"] = key("kind", "a turn of given g between two straight legs")
    range_m: Positive = key("range", "range at the first plot, m")
    speed_mps: Annotated[Positive, Field(le=MAX_SPEED_MPS)] = key("speed", "speed, constant, m/s")
    aspect_rad: Number = key(
        "aspect angle", "direction of flight from the line of sight outwards, rad (0: straight out)"
    )
    acceleration_g: Annotated[Number, Field(ge=-100, le=100)] = key(
        "acceleration",
        "lateral acceleration of the turn, standard gravities; positive: to the left",
        symbol="a",
        unit="g",
    )
    duration_s: Positive = key("duration", "duration of the turn, s")

    def reach_m(self, t: float) -> float:
        """A bound on the range up to a time t (s)."""
        return self.range_m + self.speed_mps * t

    def closest_m(self, t: float) -> float:
        """The shortest distance to the radar up to a time t (s), over both straight legs and the arc between them."""
        turn_start, turn_end = min(self.start_s, t), min(self.start_s + self.duration_s, t)
        rate = self.acceleration_g * STANDARD_GRAVITY_MPS2 / self.speed_mps
        x, y, heading = self.range_m, 0.0, self.aspect_rad
        nearest, x, y = straight_leg(x, y, heading, self.speed_mps * turn_start)
        if rate == 0:
            return min(nearest, straight_leg(x, y, heading, self.speed_mps * (t - turn_start))[0])
        radius = self.speed_mps / rate
        centre = (x - radius * math.sin(heading), y + radius * math.cos(heading))
        # The direction, from the centre of the circle, of its point nearest to the radar.
        nearest_direction = math.atan2(-centre[1] / radius, -centre[0] / radius)
        turned_angle = (math.copysign(1.0, rate) * (nearest_direction + math.pi / 2 - heading)) % (2 * math.pi)
        if turned_angle <= abs(rate) * (turn_end - turn_start):
            nearest = min(nearest, abs(math.hypot(*centre) - abs(radius)))
        heading += rate * (turn_end - turn_start)
        x, y = centre[0] + radius * math.sin(heading), centre[1] - radius * math.cos(heading)
        return min(nearest, straight_leg(x, y, heading, self.speed_mps * (t - turn_end))[0])


def turn_variance(acceleration_g: float, period_s: float) -> float:
    """D_M, (m/s³)², of a filter that follows a turn: with it the acceleration changes in a scan by half that of the
    turn, the least that Bar-Shalom, Li & Kirubarajan (2001, 6.3.3) advise."""
    return (acceleration_g * STANDARD_GRAVITY_MPS2 / 2 / period_s) ** 2


def straight_leg(x: float, y: float, heading: float, length: float) -> tuple[float, float, float]:
    """The shortest distance to the origin along a straight leg from (x, y), and the end of the leg."""
    along_m = min(max(-(x * math.cos(heading) + y * math.sin(heading)), 0.0), length)
    nearest_m = math.hypot(x + along_m * math.cos(heading), y + along_m * math.sin(heading))
    return nearest_m, x + length * math.cos(heading), y + length * math.sin(heading)


class FlyBy(Model):
    """Straight flight at a constant speed past the radar, at a distance."""

    kind: Literal["fly_by"] = key("kind", "straight flight past the radar")
    distance_m: Annotated[Positive, Field(ge=MIN_RANGE_M)] = key(
        "distance of closest approach", "distance of closest approach, m"
    )
    speed_mps: Annotated[Positive, Field(le=MAX_SPEED_MPS)] = key("speed", "speed, constant, m/s")
    start_range_m: Positive = key("range at the first plot", "range at the first plot, before closest approach, m")

    @cross_check
    def _check_start_range(self) -> Iterator[CheckError]:
        if self.start_range_m < self.distance_m:
            yield check_error("start_range_m", f"must be >= distance_m, {short_number(self.distance_m)}")

    def reach_m(self, t: float) -> float:
        """A bound on the range up to a time t (s)."""
        return self.start_range_m + self.speed_mps * t


class RecordedTarget(Model):
    """A flight recorded in a file, smoothed by a spline whose derivatives are the true velocity and acceleration."""

    kind: Literal["recorded"] = key(
        "kind", "a flight from a CSV file with columns t_s, x_m, y_m, z_m, the radar at the origin"
    )
    file: Annotated[str, DataFile()] = key("file", "path of the file, relative to this one")

    def reach_m(self, t: float) -> float:
        """A bound on the range up to a time t (s): zero, as the content of the file is unknown here."""
        return 0.0


def first_motion(target: Any) -> tuple[float, float]:
    """The speed, m/s, and the largest possible radial acceleration, m/s², at the first plot that a target's keys state;
    zero where they state none."""
    _, speed_mps, acceleration_mps2 = (*(abs(c) for c in getattr(target, "coefficients", ())), 0.0, 0.0, 0.0)[:3]
    if hasattr(target, "speed_mps"):
        speed_mps = target.speed_mps
        acceleration_mps2 = speed_mps**2 / (getattr(target, "range_m", 0.0) or target.start_range_m)
    if getattr(target, "start_s", None) == 0:
        in_g = STANDARD_GRAVITY_MPS2 * getattr(target, "acceleration_g", 0.0)
        acceleration_mps2 += abs(getattr(target, "acceleration_mps2", in_g))
    return speed_mps, acceleration_mps2


def range_errors(target: Any, radar: Radar, last_s: float) -> Iterator[CheckError]:
    """The errors of a target that up to a time (s) flies too far for double precision, or over the radar."""
    smallest_sigma_m = min(radar.sigma_range_m, radar.sigma_velocity_mps * radar.scan_period_s)
    max_range_m = min(MAX_RANGE_M, smallest_sigma_m * MAX_RANGE_TO_SIGMA)
    if target.reach_m(last_s) > max_range_m:
        requirement = f"must stay within {short_number(float(f'{max_range_m:.2g}'))} m of the radar up to the last plot"
        yield check_error(
            "target",
            f"{requirement}, at {short_number(last_s)} s: beyond, double precision does not resolve its accuracies",
        )
    elif isinstance(target, Turn) and target.closest_m(last_s) < MIN_RANGE_M:
        yield check_error("target", f"must not fly over the radar: it comes within {short_number(MIN_RANGE_M)} m of it")

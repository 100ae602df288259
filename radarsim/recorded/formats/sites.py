r"""Batches of records, the site of a radar, and AIS: the common parts of all readers of recordings.

A radar on the earth (WGS 84) measures positions, and its plots have positions (by pymap3d). Local axes: x north, y up,
z east, with the origin at the radar. Bearings are counted from north to east. Elevations are above the plane that is
level at the radar; an aircraft far away and low lies below it.

Ships send AIS: NMEA sentences `!AIVDM…`, read by pyais. A message gives only the second of its minute. The time is that
of the tag block (`\c:1577836800*..\!AIVDM…`), of a line `$PGHP,1,…`, of a number or ISO time before the sentence, or of
a number after it; without these, the seconds are unwrapped from minute to minute."""

import datetime
import functools
import math
import operator
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType, ModuleType
from typing import Any, BinaryIO, NamedTuple, Protocol

import numpy as np

from radarsim import physics
from radarsim.errors import ConfigError
from radarsim.language import term, tr

# ---- records ---------------------------------------------------------------------------------------------------------
BATCH_ROWS = 20_000  # records held at a time
DAY_S = 86400.0
PLOTS, POSITIONS = "plots", "positions"

# What a record can hold besides its track and address. Angles are counted from north to east.
PLOT_COLUMNS = ("t_s", "range_m", "bearing_rad", "velocity_mps", "span_mps", "altitude_m")
BIASES = ("range_m", "range_scale", "bearing_rad", "time_s")  # of plots, to be subtracted
POSITION_COLUMNS = ("t_s", "latitude_deg", "longitude_deg", "altitude_m", "east_mps", "north_mps", "up_mps")
NO_TIME_OR_POSITION = term("records without time or position")  # a reason to skip them


class Batch(NamedTuple):
    """Some records, in the order of the file.

    kind is PLOTS (measured by a radar: PLOT_COLUMNS) or POSITIONS (on the earth: POSITION_COLUMNS). track holds the
    track of each record, '' where it has none; address identifies the aircraft or ship everywhere (24 bits in
    hexadecimal, MMSI), '' where unknown; radar identifies the sensor (SAC/SIC), '' where the format does not; columns,
    arrays (n,), NaN where a record has no value; words: further columns of text, '' where a record has none."""

    kind: str
    track: list[str]
    address: list[str]
    radar: list[str]
    columns: dict[str, np.ndarray]
    texts: Mapping[str, list[str]] = MappingProxyType({})

    @property
    def identity(self) -> dict[str, list[str]]:
        """The identities of each record, by kind."""
        return {"address": self.address, **self.texts}

    def rows(self, keep: list[int]) -> "Batch":
        """The rows with these indices."""
        track, address, radar, *words = (
            [column[i] for i in keep] for column in (self.track, self.address, self.radar, *self.texts.values())
        )
        columns = {name: column[keep] for name, column in self.columns.items()}
        return Batch(self.kind, track, address, radar, columns, dict(zip(self.texts, words, strict=True)))


class Reader(Protocol):
    """A reader of one format. Times count from midnight where `of_day`, else from 1970 (UTC), as in the format.

    path: of the file; records: number read so far; skipped: number of them skipped, by reason."""

    path: str
    of_day: bool
    records: int
    skipped: Counter[str]

    def batches(self) -> Iterator[Batch]:
        """The records in batches; raises ConfigError with file, place, expected and actual content."""

    def notes(self, radars: Iterable[str]) -> list[str]:
        """Notes on assumptions, and on the radars that have plots."""


@dataclass
class BatchBuilder:
    """Records of one kind, collected until there are enough for a batch."""

    kind: str
    names: tuple[str, ...]
    text_names: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        self._clear()

    def _clear(self) -> None:
        self.track: list[str] = []
        self.address: list[str] = []
        self.rows: list[tuple[float, ...]] = []
        self.texts: list[tuple[str, ...]] = []

    def __len__(self) -> int:
        return len(self.rows)

    def add(self, track: str, address: str, row: tuple[float, ...], texts: tuple[str, ...] = ()) -> None:
        """Add a record; row in the order of `names`, texts in that of `words`."""
        self.track.append(track)
        self.address.append(address)
        self.rows.append(row)
        self.texts.append(texts)

    def take_batch(self) -> Batch:
        """The records so far as a batch; the collection is emptied."""
        table = np.array(self.rows, dtype=float).reshape(-1, len(self.names))
        columns = dict(zip(self.names, table.T.copy(), strict=True))
        texts = dict(zip(self.text_names, map(list, zip(*self.texts, strict=True)), strict=True))
        batch = Batch(self.kind, self.track, self.address, [""] * len(self), columns, texts)
        self._clear()
        return batch


class UnrolledClock:
    """Times of a clock with period `period_s`, unwrapped. Records out of order by half of it are taken as they are; so
    are times that fall from, or to, more than near_s from the clock's turn."""

    def __init__(self, period_s: float, near_s: float = math.inf):
        self.period_s, self.near_s, self.turns = period_s, near_s, 0
        self.last: float | None = None

    def __call__(self, t: float) -> float:
        """Unwrapped time of a clock time t (s)."""
        if self.last is not None:
            is_near_turn = max(t, self.last) >= self.period_s - self.near_s and min(t, self.last) <= self.near_s
            if is_near_turn and t < self.last - self.period_s / 2:
                self.turns += 1
            elif is_near_turn and t > self.last + self.period_s / 2 and self.turns:
                return t + (self.turns - 1) * self.period_s
        self.last = t
        return t + self.turns * self.period_s

    def notes(self) -> list[str]:
        """A note if midnight has passed on a clock of a day, and how often."""
        return [tr("the times of day pass midnight: t_s runs on ({turns} × 24 h)", turns=self.turns)] * (self.turns > 0)


def utc_s(text: str) -> float:
    """Seconds from 1970 of a date and time in ISO 8601, in UTC where it names no zone; raises ValueError."""
    moment = datetime.datetime.fromisoformat(text)
    return (moment if moment.tzinfo else moment.replace(tzinfo=datetime.UTC)).timestamp()


def missing_package(module: str, extra: str) -> ConfigError:
    """The fault that a library is missing which one of our extras installs."""
    return ConfigError(f"{module} is not installed, which this needs: pip install 'radarsim[{extra}]'")


def skip_counts(skipped: Mapping[str, int]) -> list[str]:
    """The reasons for skipped records, each with its number of records."""
    return [f"{tr(reason)} ({count})" for reason, count in skipped.items() if count]


# ---- site ------------------------------------------------------------------------------------------------------------
try:
    import pymap3d
except ImportError:
    pymap3d = None

HEIGHT_ACCURACY_M = 0.01  # accuracy of the height when the elevation of a plot is computed
MAX_ROUNDS = 20


class Antenna(NamedTuple):
    """The normal of an antenna: azimuth from north to east, elevation above the level, both in rad."""

    azimuth_rad: float
    elevation_rad: float


class Site:
    """The site of a radar: latitude and longitude in degrees, height above the ellipsoid in m."""

    def __init__(self, latitude_deg: float, longitude_deg: float, height_m: float):
        if pymap3d is None:
            raise missing_package("pymap3d", "recordings")
        self.coordinates = (latitude_deg, longitude_deg, height_m)

    def distance_m(self, other_site: "Site") -> float:
        """The distance to another site, m."""
        return math.dist(pymap3d.geodetic2ecef(*self.coordinates), pymap3d.geodetic2ecef(*other_site.coordinates))

    def _axes(self) -> np.ndarray:
        """North, up and east (3, 3) in the axes of the earth."""
        units = ((0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (1.0, 0.0, 0.0))  # each east, north, up
        return np.array([pymap3d.enu2uvw(*unit, *self.coordinates[:2]) for unit in units])

    def rotate_states(self, other_site: "Site", states: np.ndarray) -> np.ndarray:
        """Positions and speeds (…, 6) in this site's local axes, from those in another site's."""
        rotation = other_site._axes() @ self._axes().T
        shift = (
            np.subtract(pymap3d.geodetic2ecef(*other_site.coordinates), pymap3d.geodetic2ecef(*self.coordinates))
            @ self._axes().T
        )
        return np.concatenate([states[..., :3] @ rotation + shift, states[..., 3:] @ rotation], axis=-1)

    def measure(self, columns: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Range, bearing, elevation, local position and, where speeds are known, radial velocity of positions (n,). An
        unknown height is taken as 0, sea level."""
        lat, lon = columns["latitude_deg"], columns["longitude_deg"]
        height = np.nan_to_num(columns["altitude_m"], nan=0.0)
        east, north, up = pymap3d.geodetic2enu(lat, lon, height, *self.coordinates)
        local = np.stack([north, up, east], axis=-1)
        return position_columns(local) | {"velocity_mps": self._radial(columns, lat, lon, height)}

    def _radial(self, columns: dict[str, np.ndarray], lat: np.ndarray, lon: np.ndarray, h: np.ndarray) -> np.ndarray:
        """Radial velocities (n,) in m/s, positive where the range grows: speeds over ground, seen along the line."""
        up = np.nan_to_num(columns["up_mps"], nan=0.0)
        velocity = np.stack(pymap3d.enu2uvw(columns["east_mps"], columns["north_mps"], up, lat, lon), axis=-1)
        target = np.stack(pymap3d.geodetic2ecef(lat, lon, h), axis=-1)
        line_of_sight = target - np.stack(pymap3d.geodetic2ecef(*self.coordinates))
        return np.einsum("ni,ni->n", velocity, line_of_sight) / np.linalg.norm(line_of_sight, axis=-1)

    def local_positions(self, range_m: np.ndarray, bearing_rad: np.ndarray, altitude_m: np.ndarray) -> np.ndarray:
        """Local positions (n, 3) of plots of slant range and bearing at a height (n,), all in m and rad. NaN where the
        height is unknown, or where no point of that range has it."""
        sine = np.zeros_like(range_m)
        bearing = np.degrees(bearing_rad)
        with np.errstate(invalid="ignore"):
            for _ in range(MAX_ROUNDS):
                height = pymap3d.aer2geodetic(bearing, np.degrees(np.arcsin(sine)), range_m, *self.coordinates)[2]
                height_error = altitude_m - height
                # A step of the sine lifts the point by nearly that part of the range.
                sine = np.clip(sine + height_error / range_m, -1.0, 1.0)
                if not np.any(np.abs(height_error[np.isfinite(height_error)]) > HEIGHT_ACCURACY_M):
                    break
            sine = np.where(np.abs(height_error) <= 10 * HEIGHT_ACCURACY_M, sine, np.nan)
        ground_range = range_m * np.sqrt(1 - sine**2)
        return np.stack(
            [ground_range * np.cos(bearing_rad), range_m * sine, ground_range * np.sin(bearing_rad)], axis=-1
        )


def position_columns(local: np.ndarray) -> dict[str, np.ndarray]:
    """Range, bearing, elevation above the level and the coordinates of local positions (n, 3) in m."""
    x, y, z = local.T
    r = np.linalg.norm(local, axis=-1)
    with np.errstate(invalid="ignore", divide="ignore"):
        elevation = np.arcsin(y / r)
    return {
        "range_m": r,
        "bearing_rad": np.arctan2(z, x) % (2 * math.pi),
        "level_elevation_rad": elevation,
        "x_m": x,
        "y_m": y,
        "z_m": z,
    }


def antenna_angles(local: np.ndarray, antenna: Antenna) -> dict[str, np.ndarray]:
    """Elevation and azimuth of local positions (n, 3) from an antenna's normal, rad; NaN behind the antenna."""
    in_antenna_axes = physics.to_antenna(local, physics.rotation(*antenna), 0.0)
    r = np.linalg.norm(in_antenna_axes, axis=-1)
    with np.errstate(invalid="ignore", divide="ignore"):
        angles = np.arcsin(in_antenna_axes[:, 1:] / r[:, None])
    angles[~(in_antenna_axes[:, 0] > 0)] = np.nan
    return {"elevation_rad": angles[:, 0], "azimuth_rad": angles[:, 1]}


def site_of(text: str) -> Site:
    """The site of `LAT,LON,HEIGHT` (degrees, degrees, m); raises ConfigError."""
    try:
        latitude, longitude, height = (float(part) for part in text.split(","))
    except ValueError:
        raise ConfigError(f"at: must be LATITUDE,LONGITUDE,HEIGHT in degrees, degrees, m; got {text!r}") from None
    limits = (("latitude", -90, 90, "degrees"), ("longitude", -180, 360, "degrees"), ("height", -500, 100_000, "m"))
    limited_values = zip(limits, (latitude, longitude, height), strict=True)
    if faults := [(*limit, value) for limit, value in limited_values if not limit[1] <= value <= limit[2]]:
        raise ConfigError(*("at: the {} must be from {} to {} {}, got {:g}".format(*fault) for fault in faults))
    return Site(latitude, longitude, height)


def sites_of(texts: Sequence[str]) -> tuple[Site | None, dict[str, Site]]:
    """The site of the only radar, `LAT,LON,HEIGHT`, or of each of several radars, `SAC/SIC=LAT,LON,HEIGHT`."""
    sites_by_name = {
        name.strip(): site_of(place) for name, sign, place in (text.partition("=") for text in texts) if sign
    }
    unnamed = [text for text in texts if "=" not in text]
    if len(unnamed) > 1 or (unnamed and sites_by_name) or len(unnamed) + len(sites_by_name) < len(texts):
        must = "must be one LAT,LON,HEIGHT, or SAC/SIC=LAT,LON,HEIGHT of each radar, once"
        raise ConfigError(f"at: {must}; got {' '.join(texts)}")
    if faults := [name for name in sites_by_name if not re.fullmatch(r"\d{1,3}/\d{1,3}", name)]:
        raise ConfigError(*(f"at: SAC/SIC must be two numbers, as 25/12; got {name!r}" for name in faults))
    return (site_of(unnamed[0]) if unnamed else None), sites_by_name


def antenna_of(text: str) -> Antenna:
    """The antenna of `AZIMUTH,ELEVATION` in degrees; raises ConfigError."""
    try:
        azimuth, elevation = (float(part) for part in text.split(","))
    except ValueError:
        raise ConfigError(f"antenna: must be AZIMUTH,ELEVATION in degrees, got {text!r}") from None
    if not (-360 <= azimuth <= 360 and -90 <= elevation <= 90):
        raise ConfigError(
            f"antenna: must be an azimuth from -360 to 360 and an elevation from -90 to 90 degrees, got {text!r}"
        )
    return Antenna(math.radians(azimuth), math.radians(elevation))


# ---- ais -------------------------------------------------------------------------------------------------------------
pyais: ModuleType | None
try:
    import pyais
    from pyais.exceptions import AISBaseException
except ImportError:
    pyais = None

KNOT_MPS = 1852 / 3600
SENTENCE_PATTERN = re.compile(rb"![A-Z]{2}VD[MO],[^\r\n]*")
TAG_TIME = re.compile(rb"[\\,]c:(\d{9,13})")
TRAILING_TIME = re.compile(rb"\*[0-9A-Fa-f]{2}[,; \t]+(\d{9,13}(?:\.\d+)?)\s*$")
GATEHOUSE_TIME = re.compile(rb"\$PGHP,1,(\d{4})" + 5 * rb",(\d\d?)" + rb",(\d{1,3}),")  # the time of the next sentence
PART_NUMBERS = re.compile(rb"![A-Z]{2}VD[MO],(\d),(\d),(\d?),")
MAX_SPEED_KNOTS, UNKNOWN_COURSE_DEG, UNKNOWN_SECOND = 102.2, 360.0, 60
MAX_OPEN_MESSAGES = 100  # incomplete messages kept
MAX_DAMAGED_SHARE = 0.5  # of the sentences; a file with fewer is not AIS


def has_valid_checksum(sentence: bytes) -> bool:
    """Whether a sentence has the checksum stated after its asterisk: the exclusive or of all its characters."""
    body, star, stated = sentence[1:].partition(b"*")
    return bool(star) and stated[:2].upper() == b"%02X" % functools.reduce(operator.xor, body, 0)


class Ais:
    """A file of AIS sentences; position reports of class A and B are read, all others skipped."""

    of_day = False

    def __init__(self, path: str, file: BinaryIO):
        if pyais is None:
            raise missing_package("pyais", "ais")
        self.path, self.file = path, file
        self.records = 0
        self.skipped: Counter[str] = Counter()
        self.open_messages: dict[bytes, list[tuple[bytes, float]]] = {}
        self.minute_clock = UnrolledClock(60.0)
        self.last_time = math.nan  # the last time that a line stated, or that follows from one
        self.announced_time = math.nan  # of a line that states the time of the next sentence
        self.untimed_count = 0  # reports whose minute no line states

    def notes(self, radars: Iterable[str] = ()) -> list[str]:
        """A note on reports without a time, and how they get one."""
        if not self.untimed_count:
            return []
        if math.isnan(self.last_time):
            return [
                tr("reports that state no time: {count}; the seconds of their minute run on", count=self.untimed_count)
            ]
        return [
            tr("reports that state no time: {count}; they get the nearest with their second", count=self.untimed_count)
        ]

    def batches(self) -> Iterator[Batch]:
        """The position reports in batches; raises ConfigError where most sentences are damaged."""
        builder, damaged_count, first_damaged = BatchBuilder(POSITIONS, POSITION_COLUMNS), 0, ""
        for number, line in enumerate(self.file, start=1):
            sentence = SENTENCE_PATTERN.search(line)
            if not sentence and (not line.strip() or line.lstrip().startswith((b"#", b"$", b"\\"))):
                self._read_other_line(line)
                continue
            try:
                if not sentence or not has_valid_checksum(sentence[0]):
                    raise AISBaseException
                stated_s, self.announced_time = self._find_stated_time(line, sentence.start(), number), math.nan
                message, t = self._decode(sentence[0], stated_s)
            except AISBaseException:
                damaged_count, first_damaged = damaged_count + 1, first_damaged or f"{self.path}:{number}"
                continue
            self.last_time = self.last_time if math.isnan(t) else t
            if message is not None:
                self._add_report(message, t, builder)
            if len(builder) >= BATCH_ROWS:
                yield builder.take_batch()
        if damaged_count and damaged_count >= MAX_DAMAGED_SHARE * (self.records + damaged_count):
            raise ConfigError(f"{first_damaged}: must be AIS sentences (!AIVDM,…); {damaged_count} lines are not, or "
                              f"are damaged; {self.records} messages were read")  # fmt: skip
        if damaged_count:
            self.skipped[term("damaged lines")] = damaged_count
        if len(builder):
            yield builder.take_batch()

    def _read_other_line(self, line: bytes) -> None:
        """Read a line without an AIS sentence, which may state the time of the next one."""
        if match := GATEHOUSE_TIME.search(line):
            try:
                year, month, day, hour, minute, second, thousandths = map(int, match.groups())
                moment = datetime.datetime(year, month, day, hour, minute, second, 1000 * thousandths, datetime.UTC)
                self.announced_time = moment.timestamp()
            except ValueError:
                self.skipped[term("damaged lines of time")] += 1
        elif line.lstrip().startswith(b"$"):
            self.skipped[term("sentences other than AIS")] += 1

    def _decode(self, sentence: bytes, stated_s: float) -> tuple[Any, float]:
        """The message that a sentence completes, and the first time that its sentences state, s from 1970.

        None while further sentences of the message are to come."""
        assert pyais is not None  # `__init__` has checked it
        numbers, parts = PART_NUMBERS.match(sentence), [(sentence, stated_s)]
        if numbers and numbers[1] != b"1":
            open_parts = self.open_messages.setdefault(numbers[3], [])
            if numbers[2] == b"1":
                open_parts.clear()
            open_parts += parts
            if len(self.open_messages) > MAX_OPEN_MESSAGES:
                self.open_messages.pop(next(iter(self.open_messages)))
            if numbers[2] != numbers[1]:
                return None, math.nan
            parts = self.open_messages.pop(numbers[3])
        self.records += 1
        times = [t for _, t in parts if not math.isnan(t)]
        return pyais.decode(*(part for part, _ in parts)), times[0] if times else math.nan

    def _find_stated_time(self, line: bytes, start: int, number: int) -> float:
        """The time stated for a sentence, s from 1970; NaN if there is none."""
        if not math.isnan(self.announced_time):
            return self.announced_time
        head = line[:start]
        if match := TAG_TIME.search(head) or TRAILING_TIME.search(line):
            time = float(match[1])
            return time / 1000 if time > 1e11 else time
        text = head.decode("ascii", "replace").strip(" \t,;\\")
        if not text or "*" in text:
            return math.nan
        try:
            return float(text)
        except ValueError:
            pass
        try:
            return utc_s(text)
        except ValueError:
            must = "the sentence must follow a time in s from 1970 or ISO 8601, or a tag block"
            progress = f"{self.records} messages were read"
            raise ConfigError(f"{self.path}:{number}: {must}; got {text[:60]!r}; {progress}") from None

    def _add_report(self, message: Any, stated_s: float, builder: BatchBuilder) -> None:
        latitude, longitude = getattr(message, "lat", None), getattr(message, "lon", None)
        if latitude is None or longitude is None or message.msg_type not in (1, 2, 3, 18, 19):
            self.skipped[term("messages other than ships' positions")] += 1
            return
        if None in (message.second, message.speed, message.course):
            self.skipped[term("messages cut short")] += 1
            return
        second = int(message.second)
        if abs(latitude) > 90 or abs(longitude) > 180 or (math.isnan(stated_s) and second >= UNKNOWN_SECOND):
            self.skipped[NO_TIME_OR_POSITION] += 1
            return
        t = stated_s
        if math.isnan(t):
            self.untimed_count += 1
            nearest = self.last_time + (second - self.last_time + 30) % 60 - 30  # the nearest time with that second
            if math.isnan(nearest):
                t = self.minute_clock(second)
            else:
                t = self.last_time = nearest
        speed, course = float(message.speed), math.radians(float(message.course))
        is_known = speed <= MAX_SPEED_KNOTS and float(message.course) < UNKNOWN_COURSE_DEG
        east, north = (
            speed * KNOT_MPS * component(course) if is_known else math.nan for component in (math.sin, math.cos)
        )
        builder.add(str(message.mmsi), str(message.mmsi), (t, latitude, longitude, 0.0, east, north, 0.0))

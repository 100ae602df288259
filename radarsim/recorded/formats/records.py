"""What every reader of a recording gives: some records at a time, as columns."""

import datetime
import math
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np

from radarsim.errors import ConfigError

BATCH = 20_000  # records that are held at a time
DAY_S = 86400.0
PLOTS, POSITIONS = "plots", "positions"

# What a record can hold beside its track and address. Angles are counted from north to east.
PLOT_COLUMNS = ("t_s", "range_m", "bearing_rad", "velocity_mps", "span_mps", "altitude_m")
POSITION_COLUMNS = ("t_s", "latitude_deg", "longitude_deg", "altitude_m", "east_mps", "north_mps", "up_mps")


class Batch(NamedTuple):
    """Some records, in the order of the file.

    kind is PLOTS (measured by a radar: PLOT_COLUMNS) or POSITIONS (on the earth: POSITION_COLUMNS). track holds the
    track of each record, '' where it has none; address what names the aircraft or ship everywhere (24 bits in
    hexadecimal, MMSI), '' where it is not known; radar what names the sensor (SAC/SIC), '' where the format does not;
    columns, arrays (n,), not-a-number where a record is silent.
    """

    kind: str
    track: list[str]
    address: list[str]
    radar: list[str]
    columns: dict[str, np.ndarray]

    def rows(self, keep: list[int]) -> "Batch":
        """Those of its records."""
        track, address, radar = ([column[i] for i in keep] for column in (self.track, self.address, self.radar))
        return Batch(self.kind, track, address, radar, {name: column[keep] for name, column in self.columns.items()})


class Reader(Protocol):
    """A reader of one format. Times count from midnight where `of_day`, else from 1970 (UTC), as the format has them.

    records: how many were read until now; skipped: how many of them were passed over, by what they were.
    """

    of_day: bool
    records: int
    skipped: Counter[str]

    def batches(self) -> Iterator[Batch]:
        """The records, some at a time; raises ConfigError with file, place, what was expected and read."""


@dataclass
class Gathered:
    """Records of one kind, one after the other, until there are enough for a batch."""

    kind: str
    names: tuple[str, ...]

    def __post_init__(self) -> None:
        self._empty()

    def _empty(self) -> None:
        self.track: list[str] = []
        self.address: list[str] = []
        self.radar: list[str] = []
        self.rows: list[tuple[float, ...]] = []

    def __len__(self) -> int:
        return len(self.rows)

    def add(self, track: str, address: str, row: tuple[float, ...], radar: str = "") -> None:
        """One more record; row in the order of `names`."""
        self.track.append(track)
        self.address.append(address)
        self.radar.append(radar)
        self.rows.append(row)

    def taken(self) -> Batch:
        """The records until now as a batch; it starts again."""
        table = np.array(self.rows, dtype=float).reshape(-1, len(self.names))
        columns = dict(zip(self.names, table.T.copy(), strict=True))
        batch = Batch(self.kind, self.track, self.address, self.radar, columns)
        self._empty()
        return batch


class Unrolled:
    """Times of a clock that starts again after `period_s`, made to run on. Records out of order by half of it are seen
    as they are; so are times that fall from, or to, further than near_s from the clock's turn."""

    def __init__(self, period_s: float, near_s: float = math.inf):
        self.period_s, self.near_s, self.turns = period_s, near_s, 0
        self.last: float | None = None

    def __call__(self, t: float) -> float:
        """t (s) of the clock, with the turns that it has made added."""
        if self.last is not None:
            near = max(t, self.last) >= self.period_s - self.near_s and min(t, self.last) <= self.near_s
            if near and t < self.last - self.period_s / 2:
                self.turns += 1
            elif near and t > self.last + self.period_s / 2 and self.turns:
                return t + (self.turns - 1) * self.period_s
        self.last = t
        return t + self.turns * self.period_s


def utc_s(text: str) -> float:
    """Seconds from 1970 of a date and time in ISO 8601, in UTC where it names no zone; raises ValueError."""
    moment = datetime.datetime.fromisoformat(text)
    return (moment if moment.tzinfo else moment.replace(tzinfo=datetime.UTC)).timestamp()


def needs(module: str, extra: str) -> ConfigError:
    """The fault of a library that an extra of ours brings."""
    return ConfigError(f"{module} is not installed, which this needs: pip install 'radarsim[{extra}]'")


def counted(skipped: Mapping[str, int]) -> list[str]:
    """What was passed over, in words."""
    return [f"{count} {what}" for what, count in skipped.items() if count]

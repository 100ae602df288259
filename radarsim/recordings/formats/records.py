"""Batches of records as columns, common to all readers of recordings."""

import datetime
import math
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import NamedTuple, Protocol

import numpy as np

from radarsim.errors import ConfigError
from radarsim.language.translate import term, tr

NEAR_FIRST_TURN = 1 / 24  # of a clock's period: how near to its turn earlier rows are of the period before
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
        self.period_s, self.near_s, self.turns, self.most_turns = period_s, near_s, 0, 0
        self.last: float | None = None

    def __call__(self, t: float) -> float:
        """Unwrapped time of a clock time t (s)."""
        if self.last is not None:
            near_s = self.near_s
            if t > self.last + self.period_s / 2 and not self.turns:  # before the first turn: rows out of order there
                near_s = min(near_s, self.period_s * NEAR_FIRST_TURN)
            is_near_turn = max(t, self.last) >= self.period_s - near_s and min(t, self.last) <= near_s
            if is_near_turn and abs(t - self.last) > self.period_s / 2:
                self.turns += 1 if t < self.last else -1
                self.most_turns = max(self.most_turns, self.turns)
        self.last = t
        return t + self.turns * self.period_s

    def notes(self) -> list[str]:
        """A note if midnight has passed on a clock of a day, and how often."""
        return [tr("the times of day pass midnight: t_s runs on ({turns} × 24 h)", turns=self.most_turns)] * (
            self.most_turns > 0
        )


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

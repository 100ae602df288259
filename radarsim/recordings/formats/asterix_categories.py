"""Records of an ASTERIX category, collected until their fields are decoded together."""

import math
from array import array
from collections.abc import Callable

import numpy as np

from radarsim.recordings.formats import asterix_layout, records
from radarsim.recordings.formats.asterix_decode import RecordContents, RecordFields, plots_001
from radarsim.recordings.formats.asterix_layout import Profile

WRAP_001_S = 512.0  # of the truncated time of day of category 001
MIDNIGHT_001_S = records.DAY_S % WRAP_001_S  # the truncated time at which the day ends
NEAR_MIDNIGHT_S = 8.0  # from the last plot before midnight to it, and from it to the first one after


class Category:
    """What is read of a category's records: the items of which fields are cut out; the first of times and of offsets
    that a record has counts."""

    time_bytes = 3

    def __init__(
        self,
        number: int,
        read: Callable[[RecordFields], RecordContents],
        kind: str,
        time_names: str,
        position_names: str,
        other_items: str,
        variant: str | None = None,
    ):
        self.number, self.read, self.kind = number, read, kind
        self.items = ("010", *time_names.split(), *position_names.split(), *other_items.split())
        self.profile = Profile(number, self.items, variant)
        self.time_items, self.position_items = (
            [self.items.index(name) for name in names.split()] for names in (time_names, position_names)
        )

    def find_items(self, data: bytes, start: int) -> tuple[list[int], int]:
        """The offsets of the items of a record, -1 of those it has not, and its end."""
        return self.profile.offsets(data, start)

    def time_of_day(self, number: int) -> float:
        """Time of day in s of a number in the time's item."""
        return number / 128


class Category001(Category):
    """Category 001, whose records are plots or tracks, with truncated times."""

    time_bytes = 2

    def __init__(self) -> None:
        super().__init__(1, plots_001, records.PLOTS, "141", "040", "020 070 090 161 120", "track")
        self.plot = Profile(1, self.items, "plot")
        self.full: float | None = None  # time of day of the last sector message of category 002
        self.unrolled_clock = records.UnrolledClock(WRAP_001_S)
        self.midnight_turn = math.inf  # of the clock, at which a day ended early

    def find_items(self, data: bytes, start: int) -> tuple[list[int], int]:
        """The profile depends on the first bit of item 020, the second item of both; item 010 has two bytes."""
        kind_offset = asterix_layout.specification_end(data, start) + 2
        return (self.profile if kind_offset < len(data) and data[kind_offset] & 0x80 else self.plot).offsets(
            data, start
        )

    def time_of_day(self, number: int) -> float:
        """The time of day next to the last sector's; without sectors the truncated one, unwrapped.

        Midnight cuts a turn of the truncated clock short: that is seen where plots come up to it."""
        truncated = number / 128
        if self.full is None:
            clock, last = self.unrolled_clock, self.unrolled_clock.last
            unrolled = clock(truncated)
            comes_to_midnight = last is not None and 0 <= MIDNIGHT_001_S - last < NEAR_MIDNIGHT_S
            if comes_to_midnight and truncated < NEAR_MIDNIGHT_S and math.isinf(self.midnight_turn):
                self.midnight_turn = clock.turns
            return unrolled - (WRAP_001_S - MIDNIGHT_001_S) * (clock.turns >= self.midnight_turn)
        return truncated + WRAP_001_S * round((self.full - truncated) / WRAP_001_S)


class RecordStore:
    """Records of a category, of which the fields are cut out together."""

    def __init__(self, category: Category):
        self.category = category
        self._clear()

    def _clear(self) -> None:
        self.blocks: list[bytes] = []
        self.size = 0
        self.offsets, self.block_starts, self.times = array("q"), array("q"), array("d")

    def __len__(self) -> int:
        return len(self.times)

    def take_fields(self) -> tuple[np.ndarray, RecordFields]:
        """Times (n,) and items; the collection is emptied."""
        data = np.frombuffer(b"".join([*self.blocks, bytes(16)]), np.uint8)
        offsets = np.array(self.offsets).reshape(len(self), -1)
        offsets = np.where(offsets < 0, -1, offsets + np.array(self.block_starts)[:, None])
        t = np.array(self.times)
        self._clear()
        return t, RecordFields(self.category.profile.spec, data, dict(zip(self.category.items, offsets.T, strict=True)))

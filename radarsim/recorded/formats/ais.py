"""Ships by AIS: NMEA sentences `!AIVDM…`, by pyais.

A message gives only the second of its minute. The time is that of the tag block (`\\c:1577836800*..\\!AIVDM…`) or of
a number or ISO time before the sentence, or of a number after it; where there is neither, the seconds are made to run
on from minute to minute.
"""

import math
import re
from collections import Counter
from collections.abc import Iterator
from types import ModuleType
from typing import Any, BinaryIO

from radarsim.errors import ConfigError
from radarsim.recorded.formats import records

pyais: ModuleType | None
try:
    import pyais
    from pyais.exceptions import AISBaseException
except ImportError:
    pyais = None

KNOT_MPS = 1852 / 3600
SENTENCE = re.compile(rb"![A-Z]{2}VD[MO],[^\r\n]*")
TAG_TIME = re.compile(rb"[\\,]c:(\d{9,13})")
AFTER = re.compile(rb"\*[0-9A-Fa-f]{2}[,; \t]+(\d{9,13}(?:\.\d+)?)\s*$")
PARTS = re.compile(rb"![A-Z]{2}VD[MO],(\d),(\d),(\d?),")
NO_SPEED, NO_COURSE, NO_SECOND = 102.2, 360.0, 60
MOST_OPEN = 100  # messages of several sentences that wait for their end
LEAST_GOOD = 0.5  # of the sentences; a file with fewer is no AIS


def sound(sentence: bytes) -> bool:
    """Whether a sentence has the sum that it states after its asterisk: the exclusive or of all its characters."""
    body, star, stated = sentence[1:].partition(b"*")
    total = 0
    for byte in body:
        total ^= byte
    return bool(star) and stated[:2].upper() == b"%02X" % total


class Ais:
    """A file of AIS sentences; class A and B reports of position are read, all others passed over."""

    of_day = False

    def __init__(self, path: str, file: BinaryIO):
        if pyais is None:
            raise records.needs("pyais", "ais")
        self.path, self.file = path, file
        self.records = 0
        self.skipped: Counter[str] = Counter()
        self.open: dict[bytes, list[bytes]] = {}
        self.minute = records.Unrolled(60.0)

    def batches(self) -> Iterator[records.Batch]:
        """The reports of position, some at a time; raises ConfigError where most sentences are damaged."""
        gathered, damaged, first = records.Gathered(records.POSITIONS, records.POSITION_COLUMNS), 0, ""
        for number, line in enumerate(self.file, start=1):
            sentence = SENTENCE.search(line)
            if not sentence and (not line.strip() or line.lstrip().startswith((b"#", b"$"))):
                continue
            try:
                if not sentence or not sound(sentence[0]):
                    raise AISBaseException
                message = self._decoded(sentence[0])
            except AISBaseException:
                damaged, first = damaged + 1, first or f"{self.path}:{number}"
                continue
            if message is not None:
                self._take(message, self._stated(line, sentence.start(), number), gathered)
            if len(gathered) >= records.BATCH:
                yield gathered.taken()
        if damaged and damaged >= LEAST_GOOD * (self.records + damaged):
            raise ConfigError(f"{first}: must be AIS sentences (!AIVDM,…); {damaged} lines are none or damaged, "
                              f"{self.records} messages were read")  # fmt: skip
        if damaged:
            self.skipped["damaged lines"] = damaged
        if len(gathered):
            yield gathered.taken()

    def _decoded(self, sentence: bytes) -> Any:
        """The message that a sentence ends; none while further sentences of it are to come."""
        assert pyais is not None  # `__init__` has made sure
        parts = PARTS.match(sentence)
        if parts and parts[1] != b"1":
            held = self.open.setdefault(parts[3], [])
            if parts[2] == b"1":
                held.clear()
            held.append(sentence)
            if len(self.open) > MOST_OPEN:
                self.open.pop(next(iter(self.open)))
            if parts[2] != parts[1]:
                return None
            whole = self.open.pop(parts[3])
            self.records += 1
            return pyais.decode(*whole)
        self.records += 1
        return pyais.decode(sentence)

    def _stated(self, line: bytes, before: int, number: int) -> float:
        """The time before a sentence, s from 1970; not-a-number where none is stated."""
        head = line[:before]
        if found := TAG_TIME.search(head) or AFTER.search(line):
            stamp = float(found[1])
            return stamp / 1000 if stamp > 1e11 else stamp
        text = head.decode("ascii", "replace").strip(" \t,;\\")
        if not text or "*" in text:
            return math.nan
        try:
            return float(text)
        except ValueError:
            pass
        try:
            return records.utc_s(text)
        except ValueError:
            must = "before the sentence must stand a time in s from 1970 or ISO 8601, or a tag block"
            read = f"{self.records} messages were read"
            raise ConfigError(f"{self.path}:{number}: {must}; got {text[:60]!r}; {read}") from None

    def _take(self, message: Any, stated: float, gathered: records.Gathered) -> None:
        latitude, longitude = getattr(message, "lat", None), getattr(message, "lon", None)
        if latitude is None or longitude is None or message.msg_type not in (1, 2, 3, 18, 19):
            self.skipped["messages that are no ship's position"] += 1
            return
        if None in (message.second, message.speed, message.course):
            self.skipped["messages cut short"] += 1
            return
        second = int(message.second)
        if abs(latitude) > 90 or abs(longitude) > 180 or (math.isnan(stated) and second >= NO_SECOND):
            self.skipped["reports without position or time"] += 1
            return
        t = self.minute(second) if math.isnan(stated) else stated
        speed, course = float(message.speed), math.radians(float(message.course))
        known = speed <= NO_SPEED and float(message.course) < NO_COURSE
        east, north = (speed * KNOT_MPS * part(course) if known else math.nan for part in (math.sin, math.cos))
        gathered.add(str(message.mmsi), str(message.mmsi), (t, latitude, longitude, 0.0, east, north, 0.0))

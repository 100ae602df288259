r"""Positions of ships from AIS sentences.

Ships send AIS: NMEA sentences `!AIVDM…`, read by pyais. A message gives only the second of its minute. The time is that
of the tag block (`\c:1577836800*..\!AIVDM…`), of a line `$PGHP,1,…`, of a number or ISO time before the sentence, or of
a number after it; without these, the seconds are unwrapped from minute to minute."""

import datetime
import functools
import math
import operator
import re
from collections import Counter
from collections.abc import Iterable, Iterator
from types import ModuleType
from typing import Any, BinaryIO

from radarsim.errors import ConfigError
from radarsim.language.translate import term, tr
from radarsim.recordings.formats.records import (
    BATCH_ROWS,
    NO_TIME_OR_POSITION,
    POSITION_COLUMNS,
    POSITIONS,
    Batch,
    BatchBuilder,
    UnrolledClock,
    missing_package,
    utc_s,
)
from radarsim.recordings.formats.units import KNOT_MPS

pyais: ModuleType | None
try:
    import pyais
    from pyais.exceptions import AISBaseException
except ImportError:
    pyais = None
SENTENCE_PATTERN = re.compile(rb"![A-Z]{2}VD[MO],[^\r\n]*")
TARGET_PATTERN = re.compile(rb"\$[A-Z]{2}(?:TTM|TLL),")  # of a radar beside it
TAG_TIME = re.compile(rb"[\\,]c:(\d{9,13}(?:\.\d+)?)")
# The first of several is the time of reception.
TRAILING_TIME = re.compile(rb"\*[0-9A-Fa-f]{2}[,; \t]+(\d{9,13}(?:\.\d+)?)(?:[,; \t]+\d{9,13}(?:\.\d+)?)*\s*$")
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
        self.target_count = 0  # sentences of a radar's targets

    def notes(self, radars: Iterable[str] = ()) -> list[str]:
        """Notes on reports without a time, and how they get one, and on what is not read."""
        notes = []
        if self.target_count:
            message = term("targets of a radar in addition to AIS: {count} ($RATTM or $RATLL; --from nmea reads them)")
            notes.append(tr(message, count=self.target_count))
        if self.untimed_count:
            message = term("reports that state no time: {count}; they get the nearest with their second")
            if math.isnan(self.last_time):
                message = term("reports that state no time: {count}; the seconds of their minute run on")
            notes.append(tr(message, count=self.untimed_count))
        return notes

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
            self.target_count += TARGET_PATTERN.match(line.lstrip()) is not None

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

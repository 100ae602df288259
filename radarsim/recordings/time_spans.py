"""The times that two recordings cover, and the difference of clocks by which they would meet."""

import datetime
from typing import NamedTuple

MIN_DATED_S = 1e8  # since 1970; smaller times count from anywhere
DAY_S = 86400.0
HOUR_S = 3600.0
MAX_ZONE_HOURS = 14
WEEK_S = 7 * DAY_S
ROLLOVER_S = 1024 * WEEK_S  # of the weeks of GPS, which are counted by ten bits

CLOCK_ZEROS = {  # other zeros of clocks, and how much later such times look, s
    "1904, as of LabVIEW": 2_082_844_800.0,
    "1900, as of NTP": 2_208_988_800.0,
    "1980, as of GPS": -315_964_782.0,
    "1904, as days of a spreadsheet": -1462 * DAY_S,
}


class TimeSpan(NamedTuple):
    """The first and last time of a recording, s from 1970 or from midnight; has_clock: whether they count from such."""

    first_s: float
    last_s: float
    has_clock: bool = True

    def text(self) -> str:
        """`2026-11-28 23:13:00 to 23:21:00`, without a date where none is known."""
        if not self.has_clock:
            return f"{self.first_s:g} to {self.last_s:g} s"
        first, last = _moment(self.first_s), _moment(self.last_s)
        if self.first_s < MIN_DATED_S:
            return f"{first:%H:%M:%S} to {last:%H:%M:%S}"
        last_text = f"{last:%H:%M:%S}" if first.date() == last.date() else f"{last:%Y-%m-%d %H:%M:%S}"
        return f"{first:%Y-%m-%d %H:%M:%S} to {last_text}"


def meeting_text(plots: TimeSpan, positions: TimeSpan) -> str:
    """The times of plots and of positions that do not meet, after a semicolon, and what makes them meet; '' where they
    do. In English: for faults."""
    text = f"; the plots are from {plots.text()}, the positions from {positions.text()}"
    if _overlap(plots, positions, 0.0):
        return ""
    for hours in range(1, MAX_ZONE_HOURS + 1):
        for sign in (1, -1):
            if _overlap(plots, positions, sign * hours * HOUR_S):
                way = "later" if sign > 0 else "earlier"
                return f"{text}: they meet if the positions are {hours} h {way} (another time zone)"
    for sign in (1, -1):
        if _overlap(plots, positions, sign * ROLLOVER_S):
            late_file = "positions" if sign > 0 else "plots"
            return f"{text}: they meet if the {late_file} are 1024 weeks later (a receiver that missed a rollover)"
    are_dated = plots.has_clock and positions.has_clock and min(plots.first_s, positions.first_s) >= MIN_DATED_S
    for zero, offset_s in CLOCK_ZEROS.items() if are_dated else ():
        for shift_s, late_file in ((-offset_s, "positions"), (offset_s, "plots")):
            if _overlap(plots, positions, shift_s):
                return f"{text}: they meet if the times of the {late_file} count from {zero}"
    return f"{text}: they do not meet"


def _overlap(plots: TimeSpan, positions: TimeSpan, shift_s: float) -> bool:
    if plots.has_clock and positions.has_clock and min(plots.first_s, positions.first_s) < MIN_DATED_S:
        plots, positions = (_within_day(span) for span in (plots, positions))
        shift_s = shift_s % DAY_S
        return any(_overlap_at(plots, positions, shift_s + turn) for turn in (0.0, DAY_S, -DAY_S))
    return _overlap_at(plots, positions, shift_s)


def _overlap_at(plots: TimeSpan, positions: TimeSpan, shift_s: float) -> bool:
    return positions.first_s + shift_s <= plots.last_s and plots.first_s <= positions.last_s + shift_s


def _within_day(span: TimeSpan) -> TimeSpan:
    """A span whose first time is of a day, as a time of day."""
    first = span.first_s % DAY_S
    return TimeSpan(first, first + span.last_s - span.first_s)


def _moment(seconds: float) -> datetime.datetime:
    return datetime.datetime(1970, 1, 1, tzinfo=datetime.UTC) + datetime.timedelta(seconds=seconds)

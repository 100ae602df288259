"""Put the rows of a recording into the order of time, and recognise clocks that were set back or forward.

A recording is read batch by batch while the times of each track rise. The first row that is earlier than one before, or
that no target reaches, raises `NeedsAllRows`; the recording is then read again as a whole, and sorted here."""

import datetime
import os
from collections import Counter
from collections.abc import Callable, Iterable

import numpy as np

from radarsim.language.translate import plural, term, tr
from radarsim.recordings.formats.clock_steps import MAX_SET_BACKS, SetBack, find_set_back, find_small_step
from radarsim.recordings.formats.forward_steps import find_set_forward, join_names, names_over_gaps
from radarsim.recordings.formats.records import DAY_S, Batch
from radarsim.recordings.grouping import rows_by_name
from radarsim.recordings.time_spans import HOUR_S, MIN_DATED_S, ROLLOVER_S, WEEK_S

MAX_AGE_S = 2 * DAY_S  # of a file, from the last time in it to when it was written
MAX_STEP_INTERVALS, MAX_STEP_S = 3.0, 300.0  # from the row before a clock is set back to that after it
SINGLE_STEP_S = 64.0  # between times from 1970 that are numbers of 32 bits: 128 s today
MIN_LOST_TIMES, MAX_LOST_TIMES = 5, 1000  # of rows with the time of another, that show what their times lack
LEAP_DAYS = ((1, 1), (7, 1))  # months and days before which leap seconds are
ZONE_STEP_HOURS, ZONE_TOLERANCE = 0.5, 0.01  # by which time zones differ; of that
LEAP_SECOND_TOLERANCE_S, MAX_LEAP_SECOND_STEP_S = 0.2, 60.0  # of the second; of rows from midnight
SENT_AGAIN_REASON = term("rows sent again, with the same time and values")
SAME_TIME_REASON = term("rows of the same time as one before of their track")
SORTED_NOTE = term("rows that were earlier than one before of their track: {count} of {all}; they are sorted by time")
FALL_NOTES = {  # by how much a clock is set back, s
    HOUR_S: term(
        "times fall by an hour, as local times do at the end of summer time: the {count} rows from there on are taken "
        "as an hour later"
    ),
    DAY_S / 2: term(
        "times fall by 12 hours, as those of a clock without AM and PM do: the {count} rows from there on are taken as "
        "12 hours later"
    ),
    WEEK_S: term(
        "times fall by a week, as seconds of the week do when it ends: the {count} rows from there on are taken as a "
        "week later"
    ),
    DAY_S: term(
        "times fall by a day, as where the date changes late: the {count} rows from there on are taken as a day later"
    ),
    ROLLOVER_S: term(
        "dates fall by 1024 weeks, as those of a satellite receiver do at a rollover: the {count} rows from there on "
        "are taken as 1024 weeks later"
    ),
}
COUNTER_SPANS_S = (  # of counters of 15, 16, 24 and 32 bits, in units from 1 µs to 0.1 s and in 128ths of a second
    *(32.768, 65.536, 327.68, 655.36, 3276.8, 6553.6),
    *(16.777216, 1677.7216, 16_777.216, 4294.967296, 256.0, 512.0),
)
MIN_COUNTER_FALLS, MAX_COUNTER_SHARE = 2, 0.2  # that show one; of the steps in the file
MAX_COUNTER_STEPS = 5.0  # median steps by which a fall may be less than the span
COUNTER_NOTE = term(
    "times fall by {size:.9g} s again and again, as those of a counter that begins anew do: they run on"
)
SET_BACK_NOTE = term(
    "the clock was set back by {size:.6g} s{when}: the {count} rows before are taken as that much earlier"
)
SET_FORWARD_NOTE = term(
    "the clock was set forward by {size}{when}: the {count} rows before are taken as that much later"
)
SUMMER_TIME_NOTE = term(
    "the clock was set forward by an hour{when}, as local times are at the beginning of summer time: the {count} rows "
    "before are taken as an hour later"
)
ZONE_NOTE = term(
    "the clock was set back by {hours:g} hours{when}, as to another time zone: the {count} rows before are taken as "
    "that much earlier"
)
LEAP_SECOND_NOTE = term(
    "the clock counts a second twice at the end of {when:%Y-%m-%d}, as in a leap second: the {count} rows before are "
    "taken as 1 s earlier"
)
ROLLOVER_NOTE = term(
    "dates step by 1024 weeks, as those of a satellite receiver do that missed a rollover: the {count} rows before are "
    "taken as 1024 weeks later"
)


class NeedsAllRows(Exception):
    """A row that must be judged with all others of the recording: it is out of order, or no target reaches it."""


class LaterRows:
    """Select the rows that are later than the last of their track, and count the others.

    is_sorted: the rows have been sorted; else an earlier one raises NeedsAllRows."""

    def __init__(self, skipped: Counter[str], is_sorted: bool):
        self.skipped, self.is_sorted = skipped, is_sorted
        self.lost = 0  # rows left out, not counting those that say what the one before says
        self.lost_times: list[float] = []  # of the first of these, at most MAX_LOST_TIMES
        self.last_times: dict[str, float] = {}
        self.last_rows: dict[str, int] = {}  # of the batch, by track
        self.previous: tuple[Batch, dict[str, int]] | None = None  # the batch before

    def select(self, batch: Batch) -> Batch:
        """The rows of a batch that are later; those of no track may have any time."""
        rows, last_times = [], self.last_times
        self.last_rows = last_rows = {}
        for i, (track, t) in enumerate(zip(batch.track, batch.columns["t_s"].tolist(), strict=True)):
            if track:
                last = last_times.get(track)
                if last is not None and t <= last:
                    if t < last and not self.is_sorted:
                        raise NeedsAllRows
                    self._count(batch, i, track)
                    continue
                last_times[track] = t
                last_rows[track] = i
            rows.append(i)
        self.previous = (batch, last_rows)
        return batch if len(rows) == len(batch.track) else batch.rows(rows)

    def _count(self, batch: Batch, i: int, track: str) -> None:
        """Count a row that has the time of the last of its track."""
        source, rows = (batch, self.last_rows) if track in self.last_rows else self.previous or (batch, {})
        if track in rows and _row_values(source, rows[track]) == _row_values(batch, i):
            self.skipped[SENT_AGAIN_REASON] += 1
        else:
            self.skipped[SAME_TIME_REASON] += 1
            self.lost += 1
            if len(self.lost_times) < MAX_LOST_TIMES:
                self.lost_times.append(float(batch.columns["t_s"][i]))

    def cause(self) -> str:
        """Why rows have equal times, in English: that their times lack seconds, or parts of them; '' if they do not."""
        times = np.array(self.lost_times)
        if len(times) >= MIN_LOST_TIMES and times.max() > SINGLE_STEP_S and (times % SINGLE_STEP_S == 0).all():
            return "; times are multiples of 64 s, as numbers of single precision are: their digits are lost"
        for unit_s, unit, missing in ((60.0, "minutes", "seconds"), (1.0, "seconds", "decimals")):
            if len(times) >= MIN_LOST_TIMES and (times % unit_s == 0).all():
                return f"; times are whole {unit}: their {missing} may be missing, or two sensors have one name"
        return ""


def _row_values(batch: Batch, i: int) -> tuple[str, ...]:
    """What a row holds, comparable where numbers are missing."""
    return (batch.radar[i], *(texts[i] for texts in batch.identity.values()), *(
        repr(column[i].item()) for column in batch.columns.values()
    ))  # fmt: skip


def join_batches(batches: Iterable[Batch]) -> Batch:
    """One batch of the rows of several of one kind."""
    parts = list(batches)
    first = parts[0]
    track, address, radar = (
        [text for part in parts for text in getattr(part, name)] for name in ("track", "address", "radar")
    )
    columns = {name: np.concatenate([part.columns[name] for part in parts]) for name in first.columns}
    texts = {name: [text for part in parts for text in part.texts[name]] for name in first.texts}
    return Batch(first.kind, track, address, radar, columns, texts)


def sort_rows(batch: Batch, find_positions: Callable[[Batch], np.ndarray]) -> tuple[Batch, list[str], int]:
    """The rows of a whole recording in the order of time, notes on what was out of order, and how many rows were
    earlier than one before of their track: 0 where the newest came first. find_positions: of rows, (n, d), m."""
    notes = _undo_clock_steps(batch, find_positions)
    t, late_count, is_falling = batch.columns["t_s"], 0, True
    for name, rows in rows_by_name(batch.track).items():
        if name:
            times = t[rows]
            late_count += int((times < np.maximum.accumulate(times)).sum())
            is_falling &= bool((np.diff(times) <= 0).all())
    if not late_count:
        return batch, notes, 0
    notes.append(tr(SORTED_NOTE, count=late_count, all=len(t)))
    return batch.rows(np.argsort(t, kind="stable").tolist()), notes, 0 if is_falling else late_count


def _undo_clock_steps(batch: Batch, find_positions: Callable[[Batch], np.ndarray]) -> list[str]:
    """Continue times that are those of a counter, or of a clock that was set; in place, with notes."""
    t = batch.columns["t_s"]
    tracks = [rows for name, rows in rows_by_name(batch.track).items() if name]
    if (span_s := _counter_span(t, tracks)) is not None:
        t += span_s * np.cumsum(np.diff(t, prepend=t[0]) < 0)
        return [tr(COUNTER_NOTE, size=span_s)]
    if not tracks:
        return []
    positions = find_positions(batch)
    does_rise = all((np.diff(t[rows]) > 0).all() for rows in tracks)
    find_step = find_small_step if does_rise else find_set_back
    notes = _undo_usual_steps(t, tracks) or _undo_steps(t, positions, tracks, find_step)
    tracks = [rows for name, rows in rows_by_name(names_over_gaps(batch)).items() if name]
    return notes + _undo_steps(t, positions, tracks, find_set_forward, lambda last_s: join_names(batch, last_s))


def _undo_usual_steps(t: np.ndarray, tracks: list[np.ndarray]) -> list[str]:
    """Continue times (n,) that are set back by one of FALL_NOTES, or step by 1024 weeks, once in a recording."""
    for size_s, note in FALL_NOTES.items():
        if shifted := _rows_after_fall(t, tracks, size_s):
            t[shifted] += size_s
            return [tr(note, count=len(shifted))]
    rollover_rows = [rows[: int(i) + 1] for rows in tracks for i in np.flatnonzero(_is_rollover(t[rows]))]
    if rollover_rows:
        before = np.concatenate(rollover_rows)
        t[before] += ROLLOVER_S
        return [tr(ROLLOVER_NOTE, count=len(before))]
    return []


def _undo_steps(
    t: np.ndarray,
    positions: np.ndarray,
    tracks: list[np.ndarray],
    find_step: Callable[[np.ndarray, np.ndarray, list[np.ndarray]], SetBack | None],
    rename: Callable[[float], object] = lambda last_s: None,
) -> list[str]:
    """Continue times (n,) at the steps of the clock that are found, in place; rename: called with the time before."""
    notes: list[str] = []
    while len(notes) < MAX_SET_BACKS and (set_back := find_step(t, positions, tracks)) is not None:
        notes.append(_set_back_note(set_back))
        rename(set_back.until_s)
        t[set_back.before] -= set_back.size_s
    return notes


def _counter_span(t: np.ndarray, tracks: list[np.ndarray]) -> float | None:
    """The span of a counter that begins anew, if all falls of times (n,) in the order of the file are such, and the
    rows of a track fall too: a file may be sorted by tracks."""
    steps = np.diff(t)
    falls = -steps[steps < 0]
    has_fallen = any((np.diff(t[rows]) < 0).sum() >= MIN_COUNTER_FALLS for rows in tracks)
    if not has_fallen or not MIN_COUNTER_FALLS <= len(falls) <= MAX_COUNTER_SHARE * len(steps):
        return None
    largest = MAX_COUNTER_STEPS * float(np.median(steps[steps > 0]))
    for span in COUNTER_SPANS_S:
        gaps = span - falls
        if np.ptp(t) <= span and (gaps >= 0).all() and (gaps <= largest).all():
            return span
    return None


def _set_back_note(set_back: SetBack) -> str:
    """The note on a clock that was set back: where it is the end of a half-year, by a leap second."""
    count, end_s = len(set_back.before), set_back.until_s
    is_dated = end_s >= MIN_DATED_S
    if is_dated and abs(set_back.size_s - 1) < LEAP_SECOND_TOLERANCE_S:
        midnight = datetime.datetime.fromtimestamp(DAY_S * round(end_s / DAY_S), datetime.UTC)
        if abs(end_s - midnight.timestamp()) < MAX_LEAP_SECOND_STEP_S and (midnight.month, midnight.day) in LEAP_DAYS:
            return tr(LEAP_SECOND_NOTE, count=count, when=midnight - datetime.timedelta(days=1))
    when = tr(" at {time:%H:%M:%S}", time=datetime.datetime.fromtimestamp(end_s, datetime.UTC)) if is_dated else ""
    if set_back.size_s < 0:
        return _set_forward_note(-set_back.size_s, count, when)
    hours = set_back.size_s / HOUR_S
    if hours > ZONE_STEP_HOURS and abs(hours / ZONE_STEP_HOURS - round(hours / ZONE_STEP_HOURS)) < ZONE_TOLERANCE:
        return tr(ZONE_NOTE, hours=ZONE_STEP_HOURS * round(hours / ZONE_STEP_HOURS), count=count, when=when)
    return tr(SET_BACK_NOTE, size=set_back.size_s, count=count, when=when)


def _set_forward_note(size_s: float, count: int, when: str) -> str:
    """The note on a clock that was set forward by a size, s."""
    if size_s == HOUR_S:
        return tr(SUMMER_TIME_NOTE, count=count, when=when)
    days, hours = size_s / DAY_S, size_s / HOUR_S
    size = tr("{size:.6g} s", size=size_s)
    if days == round(days):
        size = plural("{count:g} day", "{count:g} days", round(days))
    elif hours > 1 and hours / ZONE_STEP_HOURS == round(hours / ZONE_STEP_HOURS):
        size = tr("{hours:g} hours", hours=hours)
    return tr(SET_FORWARD_NOTE, size=size, count=count, when=when)


def rollover_notes(path: str, last_s: float) -> list[str]:
    """A note if a satellite receiver's file was written 1024 weeks after the last time in it, s from 1970."""
    if not os.path.isfile(path) or not abs(os.path.getmtime(path) - ROLLOVER_S - last_s) < MAX_AGE_S:
        return []
    date = datetime.datetime.fromtimestamp(last_s, datetime.UTC)
    return [tr("the dates end on {date:%Y-%m-%d}, 1024 weeks before the file was written: the receiver has missed a "
               "rollover of its weeks", date=date)]  # fmt: skip


def _is_rollover(times: np.ndarray) -> np.ndarray:
    """Whether the next time of a track (n,) is 1024 weeks later, but for a day (n - 1,)."""
    return np.abs(np.diff(times) - ROLLOVER_S) < DAY_S


def _rows_after_fall(t: np.ndarray, tracks: list[np.ndarray], size_s: float) -> list[int]:
    """The rows after the only fall of the times, which is as large as that, but for the interval of rows; empty if
    times fall otherwise, or more than once in a track."""
    shifted: list[int] = []
    first_fall = len(t)
    for rows in tracks:
        steps = np.diff(t[rows])
        falls = np.flatnonzero(steps < 0)
        if not falls.size:
            continue
        rises = steps[steps > 0]
        usual = float(np.median(rises)) if rises.size else 0.0
        gap = steps[falls[0]] + size_s
        if falls.size > 1 or not 0 <= gap <= min(MAX_STEP_INTERVALS * usual, MAX_STEP_S):
            return []
        shifted += rows[int(falls[0]) + 1 :].tolist()
        first_fall = min(first_fall, int(rows[int(falls[0]) + 1]))
    later_tracks = [rows for rows in tracks if rows[0] >= first_fall]
    if (np.diff(t[first_fall:]) >= 0).all():  # in file order: tracks that begin after it are by the same clock
        shifted += [row for rows in later_tracks for row in rows.tolist()]
    return sorted(shifted)

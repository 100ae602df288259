"""Times and dates as cells of a table have them."""

import re

from radarsim.recordings.formats.records import DAY_S, utc_s

TIME_FORMATS = "a time of day, ISO 8601 or DD.MM.YYYY and a time"
CLOCK_PATTERN = re.compile(r"(\d{1,2}):(\d\d)(?::(\d\d)(?:[.,:](\d+))?)?")
DATE_PATTERN = re.compile(r"(\d{1,2})([./])(\d{1,2})\2(\d{4})(?:[ T]+(\S+))?")
YEAR_FIRST_PATTERN = re.compile(r"(\d{4})([./])(\d{1,2})\2(\d{1,2})(?:[ T]+(\S+))?")
LEAP_SECOND_PATTERN = re.compile(r"(?<!\d)\d\d:\d\d:60(?!\d)")
FIRST_DATED_S, LAST_DATED_S = 6.3e8, 4.2e9  # since 1970: recordings of 1990 to 2100
DAY_NUMBERS = (  # the first and last number of days of these years, and that of 1970
    ("a spreadsheet", 25569.0, 76000.0, 25569.0),
    ("Matlab", 719529.0, 770000.0, 719529.0),
    ("Julian days", 2440587.5, 2491000.0, 2440587.5),
)
FRACTIONS_OF_DAY = "fractions of a day"
MAX_DAY_STEP = 1.2e-3  # of day numbers from row to row: 100 s; of seconds it would be a kilohertz


def second_of_day(match: re.Match[str]) -> float:
    """A time matched by CLOCK_PATTERN, s after midnight; raises ValueError for an impossible one."""
    hours, minutes, seconds, fraction = match.groups(default="0")
    if int(hours) > 23 or int(minutes) > 59 or int(seconds) > 59:
        raise ValueError(match[0])
    return 3600 * int(hours) + 60 * int(minutes) + float(f"{int(seconds)}.{fraction}")


def date_s(year: str, month: str, day: str, clock: str) -> float:
    """Seconds from 1970 of a date and a time of day; raises ValueError."""
    if not (time := CLOCK_PATTERN.fullmatch(clock)):
        raise ValueError(clock)
    return utc_s(f"{year}-{int(month):02}-{int(day):02}") + second_of_day(time)


def day_numbers_of(days: float) -> str:
    """Whose day numbers a number may be, by its size; '' where it is none."""
    if 0 <= days < 1:
        return FRACTIONS_OF_DAY
    return next((name for name, first, last, _ in DAY_NUMBERS if first <= days < last), "")


def day_number_s(days: float) -> float:
    """Seconds from 1970 of a day number of a spreadsheet, of Matlab or of Julian days; of any other number its days."""
    origin = next((zero for _, first, last, zero in DAY_NUMBERS if first <= days < last), 0.0)
    return (days - origin) * DAY_S


def scaled_time(t: float) -> tuple[float, float] | None:
    """A time in s, and the unit of the number: s, or ms, µs or ns of 1970, by the year that they give; None for a
    number that is too large for seconds, and gives no such year."""
    if abs(t) < LAST_DATED_S:
        return t, 1.0
    unit = next((unit for unit in (1e-3, 1e-6, 1e-9) if FIRST_DATED_S <= t * unit < LAST_DATED_S), None)
    return None if unit is None else (t * unit, unit)

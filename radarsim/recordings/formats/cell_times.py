"""Times and dates as cells of a table have them."""

import datetime
import re

import numpy as np

from radarsim.recordings.formats.records import DAY_S, utc_s

TIME_FORMATS = "a time of day, ISO 8601 or DD.MM.YYYY and a time"  # among others, as 9 Dec 2024
CLOCK_PATTERN = re.compile(r"(\d{1,2}):(\d\d)(?::(\d\d)(?:[.,:](\d+))?)?")
CLOCK_AFTER = r"(?:[\sT,]+(\S.*))?"
MERIDIEM_PATTERN = re.compile(r"(\d.*\d)\s*([ap])\.?m\.?", re.IGNORECASE)  # 12:59:30 PM
DATE_PATTERN = re.compile(r"(\d{1,2})([./-])(\d{1,2})\2(\d{4})" + CLOCK_AFTER)
YEAR_FIRST_PATTERN = re.compile(r"(\d{4})([./])(\d{1,2})\2(\d{1,2})" + CLOCK_AFTER)
DAY_AND_NAME_PATTERN = re.compile(r"(\d{1,2})[\s./-]*([^\W\d_]{3,})[\s.,/-]*(\d{4}|\d\d)(?:\s*г\.?)?" + CLOCK_AFTER)
NAME_AND_DAY_PATTERN = re.compile(r"([^\W\d_]{3,})[\s.-]+(\d{1,2})(?:st|nd|rd|th)?[\s,-]+(\d{4})" + CLOCK_AFTER)
MONTHS = (  # of each month the names that a cell may have, or the beginning of
    ("january", "januar", "jänner", "январь", "января"),
    ("february", "februar", "feber", "февраль", "февраля"),
    ("march", "märz", "maerz", "mrz", "март", "марта"),
    ("april", "апрель", "апреля"),
    ("may", "mai", "май", "мая"),
    ("june", "juni", "июнь", "июня"),
    ("july", "juli", "июль", "июля"),
    ("august", "август", "августа"),
    ("september", "сентябрь", "сентября"),
    ("october", "oktober", "октябрь", "октября"),
    ("november", "ноябрь", "ноября"),
    ("december", "dezember", "декабрь", "декабря"),
)
LEAP_SECOND_PATTERN = re.compile(r"(?<!\d)\d\d:\d\d:60(?!\d)")
FIRST_DATED_S, LAST_DATED_S = 6.3e8, 4.2e9  # since 1970: recordings of 1990 to 2100
SPREADSHEET = "a spreadsheet"
DAY_NUMBERS = (  # the first and last number of days of recordings, and that of 1970; of a spreadsheet to 2041
    (SPREADSHEET, 25569.0, 51544.0, 25569.0),
    ("modified Julian days", 51544.0, 88069.0, 40587.0),
    ("Matlab", 719529.0, 770000.0, 719529.0),
    ("Julian days", 2440587.5, 2491000.0, 2440587.5),
)
FRACTIONS_OF_DAY = "fractions of a day"
DATE_DIGITS_PATTERN = re.compile(
    r"(?:19|20)\d{2}[01]\d[0-3]\d[0-2]\d[0-5]\d[0-5]\d(?:\.\d*|\d{3}|\d{6})?"
)  # 20261128120006.25
MIN_CLOCK_ROWS, MIN_CLOCK_SECONDS = 20, 5  # different times, and seconds in them, that show what clock digits are
MAX_DAY_STEP = 1.2e-3  # of day numbers from row to row: 100 s; of seconds it would be a kilohertz


DAYS_TO_1904 = 1462.0  # by which days of a spreadsheet that count from 1904 are fewer
TENTHS_PATTERN = re.compile(r"[0-5]?\d:[0-5]\d[.,]\d+")  # minutes and seconds, as a spreadsheet shows them
MINUTES_PATTERN = re.compile(r"(\d{1,3}):([0-5]?\d(?:[.,]\d+)?)")
TICKS_S, TICKS_1970 = 1e-7, (621_355_968e9, 116_444_736e9)  # of .NET and of Windows, at 1970
FIRST_TICKS, FIRST_TICKS_S = 1.2e17, 9.4e8  # of 2000: ns of 1970 would be of one year then
ZONE_HOURS = {  # names that mean one zone only
    **dict.fromkeys(("z", "utc", "ut", "gmt", "wet", "zulu"), 0), **dict.fromkeys(("cet", "mez", "west"), 1),
    **dict.fromkeys(("cest", "mesz", "eet"), 2), **dict.fromkeys(("msk", "мск", "eest"), 3),
    **dict.fromkeys(("jst", "kst"), 9), "edt": -4, "pdt": -7, "mdt": -6, "pst": -8,
}  # fmt: skip
AMBIGUOUS_ZONES = ("est", "cst", "cdt", "ist", "bst", "mst", "ast", "sst")
ZONE_PATTERN = re.compile(r"(.*?\d:\d.*?)\s*(?:\(?([^\W\d_]{1,5})\)?)?\s*([+-]\d{1,2}(?::?[0-5]\d)?)?")


def split_zone(text: str) -> tuple[str, float] | None:
    """A time without the zone after it, and what that is ahead of UTC, s; None of a text without a zone. Raises
    ValueError for a name that several zones have."""
    match = ZONE_PATTERN.fullmatch(text)
    if match is None or not (match[2] or match[3]):
        return None
    name = (match[2] or "z").lower()
    if name in AMBIGUOUS_ZONES:
        raise ValueError(text)
    if name not in ZONE_HOURS or (match[3] and ZONE_HOURS[name]):
        return None
    digits = re.sub(r"\D", "", match[3] or "0")
    hours, minutes = (int(digits), 0) if len(digits) < 3 else (int(digits[:-2]), int(digits[-2:]))
    ahead_s = 3600.0 * hours + 60.0 * minutes
    return match[1], ahead_s * (-1 if match[3] and match[3][0] == "-" else 1) + 3600.0 * ZONE_HOURS[name]


def minute_clock_s(text: str) -> float | None:
    """Seconds after the full hour of minutes and seconds, as 12:30.5; None of another text."""
    match = MINUTES_PATTERN.fullmatch(text)
    return None if match is None else 60.0 * int(match[1]) + float(match[2].replace(",", "."))


def second_of_day(match: re.Match[str]) -> float:
    """A time matched by CLOCK_PATTERN, s after midnight; raises ValueError for an impossible one."""
    hours, minutes, seconds, fraction = match.groups(default="0")
    if int(hours) == 24 and not any(map(int, (minutes, seconds, fraction))):  # midnight at the end of a day (ISO 8601)
        return DAY_S
    if int(hours) > 23 or int(minutes) > 59 or int(seconds) > 59:
        raise ValueError(match[0])
    return 3600 * int(hours) + 60 * int(minutes) + float(f"{int(seconds)}.{fraction}")


def clock_s(text: str) -> float | None:
    """Seconds after midnight of a time of day, with AM or PM or without; None of another text. Raises ValueError for an
    impossible time."""
    if time := CLOCK_PATTERN.fullmatch(text):
        return second_of_day(time)
    half = MERIDIEM_PATTERN.fullmatch(text)
    if half is None or not (time := CLOCK_PATTERN.fullmatch(half[1])):
        return None
    if not 1 <= int(time[1]) <= 12:
        raise ValueError(text)
    return second_of_day(time) % (DAY_S / 2) + (DAY_S / 2 if half[2].lower() == "p" else 0.0)


def date_s(year: str, month: str, day: str, clock: str) -> float:
    """Seconds from 1970 of a date and a time of day; raises ValueError."""
    time = clock_s(clock)
    if time is None:
        raise ValueError(clock)
    return utc_s(f"{year}-{int(month):02}-{int(day):02}") + time


def named_date_s(text: str) -> float | None:
    """Seconds from 1970 of a date with the name of its month, as 09-Dec-2024, and a time of day; None where a text is
    none. Raises ValueError for an impossible date."""
    day_first, name_first = DAY_AND_NAME_PATTERN.fullmatch(text), NAME_AND_DAY_PATTERN.fullmatch(text)
    if day_first:
        day, name, year, clock = day_first.groups(default="0:00")
    elif name_first:
        name, day, year, clock = name_first.groups(default="0:00")
    else:
        return None
    month = next((i for i, names in enumerate(MONTHS, 1) if any(m.startswith(name.lower()) for m in names)), None)
    if month is None:
        return None
    return date_s(year if len(year) == 4 else f"20{year}", str(month), day, clock)


def digits_date_s(text: str) -> float | None:
    """Seconds from 1970 of a date and time without separators, 20261128120006.25; None of another text."""
    if not DATE_DIGITS_PATTERN.fullmatch(text):
        return None
    return utc_s(f"{text[:8]}T{text[8:14]}") + float(f"0.{text[14:].removeprefix('.')}")


def clock_digits_s(number: float) -> float:
    """Seconds after midnight of a time of day as a number, 120006.25; raises ValueError for an impossible one."""
    hours, minutes, seconds = number // 10_000, number // 100 % 100, number % 100
    if not (0 <= hours <= 23 and minutes <= 59 and seconds < 60):
        raise ValueError(str(number))
    return 3600 * hours + 60 * minutes + seconds


def are_clock_digits(t: np.ndarray) -> bool:
    """Whether numbers (n,) are times of day as 120006.25: of many seconds and some minutes, none is above 59."""
    numbers = np.unique(t)
    hours, minutes, seconds = numbers // 10_000, numbers // 100 % 100, numbers % 100
    is_clock = bool((numbers >= 0).all() and (hours <= 23).all() and (minutes <= 59).all() and (seconds < 60).all())
    return (
        is_clock
        and len(numbers) >= MIN_CLOCK_ROWS
        and len(np.unique(seconds // 1)) >= MIN_CLOCK_SECONDS
        and len(np.unique(numbers // 100)) > 1
    )


def day_numbers_of(days: float) -> str:
    """Whose day numbers a number may be, by its size; '' where it is none."""
    if 0 <= days < 1:
        return FRACTIONS_OF_DAY
    return next((name for name, first, last, _ in DAY_NUMBERS if first <= days < last), "")


def day_number_s(days: float) -> float:
    """Seconds from 1970 of a day number of a spreadsheet, of Matlab or of Julian days; of any other number its days."""
    origin = next((zero for _, first, last, zero in DAY_NUMBERS if first <= days < last), 0.0)
    return (days - origin) * DAY_S


def day_text(seconds: float) -> str:
    """The day of a time from 1970, 2026-11-28."""
    return f"{datetime.datetime.fromtimestamp(seconds, datetime.UTC):%Y-%m-%d}"


def scaled_time(t: float) -> tuple[float, float] | None:
    """A time in s, and the unit of the number: s, or ms, µs or ns of 1970, or tenths of µs of 1 or 1601, by the year
    that they give; None for a number that is too large for seconds, and gives no such year."""
    if abs(t) < LAST_DATED_S:
        return t, 1.0
    if t >= FIRST_TICKS:
        for origin in TICKS_1970:
            if FIRST_TICKS_S <= (ticks_s := (t - origin) * TICKS_S) < LAST_DATED_S:
                return ticks_s, TICKS_S
    unit = next((unit for unit in (1e-3, 1e-6, 1e-9) if FIRST_DATED_S <= t * unit < LAST_DATED_S), None)
    return None if unit is None else (t * unit, unit)

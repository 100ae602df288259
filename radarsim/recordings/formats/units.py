"""Units of the columns of a recording: their names, what they are in ours, and units at the end of a column's name."""

import math
import re
import unicodedata

import numpy as np

KNOT_MPS, FOOT_M, MILE_M = 1852 / 3600, 0.3048, 1609.344
LENGTHS = {
    **{"m": 1.0, "km": 1e3, "ft": FOOT_M, "feet": FOOT_M, "nm": 1852.0, "nmi": 1852.0},
    **{"yd": 3 * FOOT_M, "kyd": 3000 * FOOT_M, "dmi": 6000 * FOOT_M, "mi": MILE_M, "hft": 100 * FOOT_M},  # data miles
}
HEIGHTS, FLIGHT_LEVELS = {**LENGTHS, "fl": 100 * FOOT_M}, ("fl", "flight_level")  # names that are this unit
SPEEDS = {
    **dict.fromkeys(("mps", "m/s", "ms"), 1.0), **dict.fromkeys(("kn", "kt", "kts", "knots"), KNOT_MPS),
    **dict.fromkeys(("kmh", "km/h"), 1 / 3.6), **dict.fromkeys(("fpm", "ft/min"), FOOT_M / 60),
    **dict.fromkeys(("fps", "ft/s"), FOOT_M), "mph": MILE_M / 3600, "kmps": 1e3, "cmps": 0.01,
}  # fmt: skip
TURNS = {  # in a turn, by unit; of an encoder's counts, `acp`
    **{"acp": 4096, "gon": 400, "mil": 6400, "mil6000": 6000, "acp8192": 8192, "acp16384": 16384, "acp65536": 65536},
    "cdeg": 36_000,  # hundredths of a degree
}
DEGREES = {**dict.fromkeys(("deg", "degree", "degrees", "°"), 1.0), "rad": 180 / math.pi}
EARTH_DEGREES = {**DEGREES, "e7": 1e-7, "e6": 1e-6, "ddmm": 1.0}  # of coordinates; ddmm: degrees and minutes
O_SIGNS = {"ost": 1.0, "ouest": -1.0}  # of longitudes in degrees with an O, by the unit that says what that is
EARTH_DEGREES |= dict.fromkeys(O_SIGNS, 1.0)
RADIANS = {unit: math.radians(factor) for unit, factor in DEGREES.items()}
RADIANS |= {unit: 2 * math.pi / turn for unit, turn in TURNS.items()}
RADIANS["mrad"] = 1e-3
DAYS_1904 = "days1904"  # of a spreadsheet whose days count from 1904
MINUTE_CLOCK = "mmss"  # minutes and seconds of a time of day, as 12:30.5
DAYS = "days"  # of a spreadsheet, of Matlab, Julian ones: numbers that `cell_times` tells apart
CLOCK_DIGITS = "hhmmss"  # a time of day as a number, 120006.25
TIME_UNITS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "dmy": 1.0, "mdy": 1.0}  # dmy: day before month
TIME_UNITS |= {DAYS: 1.0, DAYS_1904: 1.0, CLOCK_DIGITS: 1.0, MINUTE_CLOCK: 1.0, "min": 60.0, "h": 3600.0}
SHORT_TIME_UNITS = (
    "min",
    "h",
)  # which are units at the end of a name only after a comma, in brackets, or of t and time
UNIT_SYNONYMS = {  # as people write them, in English, German and Russian; without points at the end
    **dict.fromkeys(("metre", "metres", "meter", "meters", "mtr", "м", "метр", "метры", "метров", "метрах"), "m"),
    **dict.fromkeys(("kilometre", "kilometres", "kilometer", "kilometers", "км", "километры", "километрах"), "km"),
    **dict.fromkeys(("nautical_miles", "nautical_mile", "naut_mi", "seemeilen", "sm", "морские_мили", "м_мили"), "nm"),
    **dict.fromkeys(("морских_милях", "морских_миль", "мор_мили", "м._мили", "мили", "миль", "нм", "n_mi"), "nm"),
    **dict.fromkeys(("statute_miles", "statute_mile"), "mi"), **dict.fromkeys(("data_miles", "data_mile"), "dmi"),
    **dict.fromkeys(("yards", "yard", "yds", "ярды"), "yd"),
    **dict.fromkeys(("kyds", "kyard", "kyards", "kiloyard", "kiloyards"), "kyd"),
    **dict.fromkeys(("foot", "fuß", "fuss", "футы", "фут", "футах", "футов"), "ft"),
    **dict.fromkeys(("м/с", "м/сек", "m/sec", "m_s", "m*s-1", "m·s⁻¹", "m_s-1", "m/sek", "meter/s"), "m/s"),
    **dict.fromkeys(("км/ч", "км/час", "km/std", "kph"), "km/h"),
    **{"km/s": "kmps", "cm/s": "cmps", "mi/h": "mph"},
    **dict.fromkeys(("уз", "узлы", "узлах", "узлов", "knoten", "knot", "nm/h"), "kn"), "feet/s": "ft/s",
    **dict.fromkeys(("град", "градус", "градусы", "градусов", "градусах", "grad", "º", "degs"), "deg"),
    **dict.fromkeys(("рад", "радиан", "радианы", "radian", "radians", "radiant"), "rad"),
    **dict.fromkeys(("mils", "strich"), "mil"),
    **dict.fromkeys(("д_у", "ду", "тыс", "тысячные"), "mil6000"),
    **dict.fromkeys(("gons", "grads", "gradians", "neugrad"), "gon"),
    **dict.fromkeys(("с", "сек", "секунды", "секунд", "секундах", "sek", "sekunden", "sec", "secs", "seconds"), "s"),
    **dict.fromkeys(("мс", "msec", "millisekunden", "milliseconds"), "ms"), **dict.fromkeys(("мкс", "µs", "μs"), "us"),
    **dict.fromkeys(("tage", "tagen", "дни", "сутки"), DAYS), "нс": "ns",
    **dict.fromkeys(("minute", "minutes", "mins", "minuten", "мин", "минуты", "минут", "минутах"), "min"),
    **dict.fromkeys(("hour", "hours", "hrs", "hr", "std", "stunden", "ч", "час", "часы", "часов", "часах"), "h"),
}  # fmt: skip
UNITS = {unit for units in (HEIGHTS, SPEEDS, RADIANS, EARTH_DEGREES, TIME_UNITS) for unit in units}
UNIT_PATTERN = re.compile(r"^(.*?)\s*[\[(]\s*([^\])]*)\s*[\])]$")
PLAIN_UNIT_PATTERN = re.compile(  # `Range, km`, `range in km`, `дальность в м`, `Zeit/s`, `v/(m/s)`, of a unit
    r"^(.+?)\s*,\s*(\S+)$|^(.+?)\s+(?:in|в)\s+(\S.*)$|^([^/]+?)\s*/\s*\(?([^()]+?)\)?$"
)


def degrees_of_minutes(numbers: np.ndarray) -> np.ndarray:
    """Angles (n,) in degrees that are written as degrees and minutes, 5236.5 for 52° 36.5'."""
    size = np.abs(numbers)
    return np.sign(numbers) * (size // 100 + size % 100 / 60)


def turn_of(unit: str) -> float:
    """What a full turn is in a unit of bearings."""
    return 2 * math.pi / RADIANS[unit]


def split_unit(name: str) -> tuple[str, str]:
    """A column's name without its unit, in lower case and without points, and its unit: `Rng. [km]`, `rng_km` and
    `Rng., km` are (rng, km)."""
    name = unicodedata.normalize("NFC", name).strip().lower()
    if match := UNIT_PATTERN.match(name):
        return _stem(match[1]), _unit(match[2])
    match = PLAIN_UNIT_PATTERN.match(name)
    if match:
        stem, last = (text for text in match.groups() if text is not None)
        if (unit := _unit(last)) in UNITS:
            return _stem(stem), unit
    name = _stem(name)
    stem, _, last = name.rpartition("_")
    unit = _unit(last)
    is_unit = unit in UNITS and (unit not in SHORT_TIME_UNITS or stem in ("t", "time", "zeit", "время"))
    return (stem, unit) if stem and is_unit else (name, "fl" if name in FLIGHT_LEVELS else "")


def _stem(text: str) -> str:
    """A name in one word, without points: `Допл. скорость` is допл_скорость."""
    return re.sub(r"\s+", "_", text.replace(".", " ").strip(" /,"))


def is_same_unit(first: str, second: str) -> bool:
    """Whether two names are of the same unit."""
    tables = (HEIGHTS, SPEEDS, RADIANS, TIME_UNITS)
    return any(first in units and second in units and units[first] == units[second] for units in tables)


def cell_unit(text: str) -> str:
    """A unit at the end of a cell by our name for it; any other text in lower case."""
    return _unit(unicodedata.normalize("NFC", text).lower())


def _unit(text: str) -> str:
    """A unit by our name for it; any other text as it is."""
    text = text.strip()
    key = re.sub(r"\s+", "_", text.rstrip("."))
    return UNIT_SYNONYMS.get(key, key if key in UNITS else text)

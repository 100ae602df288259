"""Columns of numbers and texts from ASTERIX records of categories 048, 001, 062 and 021."""

import string
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from radarsim.recordings.formats import asterix_layout

NAUTICAL_MILE_M, FOOT_M = 1852.0, 0.3048
FLIGHT_LEVEL_M = 100 * FOOT_M
REPORTS = ("", "PSR", "SSR", "SSR+PSR", "Mode S", "Mode S", "Mode S+PSR", "Mode S+PSR")  # by the type of item 048/020
NO_AIRCRAFT = ("test target", "simulated", "field monitor", "coasted")
MARKS = (*NO_AIRCRAFT, "garbled code", "garbled height")
MARK_TEXTS = ["; ".join(mark for i, mark in enumerate(MARKS) if bits >> i & 1) for bits in range(1 << len(MARKS))]
CALLSIGN_LETTERS = ["", *string.ascii_uppercase, *5 * [""], " ", *15 * [""], *string.digits, *6 * [""]]  # of six bits
Columns = dict[str, np.ndarray]
Texts = dict[str, list[str]]


@dataclass(frozen=True)
class RecordFields:
    """Items of many records of a category: its specification, all bytes, and the offsets (n,) of each item in them."""

    spec: Any
    data: np.ndarray
    offsets: Columns

    def number(self, item: str, *path: str) -> np.ndarray:
        """A field (n,) as numbers; NaN if a record does not have it."""
        return asterix_layout.locate_field(self.spec, item, *path).values(self.data, self.offsets[item])

    def text(self, name_of: Callable[[int], str], item: str, *path: str) -> list[str]:
        """A field (n,) as texts, named by its number; '' if a record does not have it."""
        return name_values(
            asterix_layout.locate_field(self.spec, item, *path).integers(self.data, self.offsets[item]),
            self.offsets[item] >= 0,
            name_of,
        )

    def flag(self, item: str, name: str) -> np.ndarray:
        """Bits (n,) in an item of several bytes; 0 if a record does not have them."""
        return asterix_layout.locate_flag(self.spec, item, name).values(self.data, self.offsets[item])

    def tests(self, item: str) -> np.ndarray:
        """Marks (n,) of reports that are of no aircraft."""
        flags = (("test target", "TST"), ("simulated", "SIM"), ("field monitor", "RAB"))
        return np.bitwise_or.reduce([mark_bits(mark, self.flag(item, name)) for mark, name in flags])

    def code(self, item: str) -> tuple[list[str], np.ndarray]:
        """Valid Mode 3/A codes that are not garbled, and marks (n,) of garbled ones."""
        garbled = self.number(item, "G") == 1
        is_valid = (self.number(item, "V") == 0) & ~garbled
        codes = asterix_layout.locate_field(self.spec, item, "MODE3A").integers(self.data, self.offsets[item])
        return name_values(codes, is_valid, OCTAL), mark_bits("garbled code", garbled)

    def height(self, geometric: str, level: str) -> np.ndarray:
        """The height (n,) in m, from the flight level where there is no other."""
        height = self.number(geometric) * FOOT_M
        return np.where(np.isnan(height), self.number(level) * FLIGHT_LEVEL_M, height)


OCTAL, HEXADECIMAL = "{:04o}".format, "{:06x}".format


def name_values(values: np.ndarray, is_present: np.ndarray, name_of: Callable[[int], str]) -> list[str]:
    """The names of integers (n,); '' where there is none."""
    names = {value: name_of(value) for value in set(values[is_present].tolist())}
    return [
        names[value] if present else "" for value, present in zip(values.tolist(), is_present.tolist(), strict=True)
    ]


def callsign_text(bits: int) -> str:
    """Eight characters of six bits (ICAO Annex 10)."""
    return "".join(CALLSIGN_LETTERS[bits >> shift & 63] for shift in range(42, -1, -6)).strip()


def sensor_name(number: int) -> str:
    """SAC/SIC."""
    return f"{number >> 8}/{number & 255}"


def mark_bits(mark: str, flags: np.ndarray) -> np.ndarray:
    """Bits (n,) of MARKS."""
    return np.asarray(flags, dtype=np.int64) << MARKS.index(mark)


RecordContents = tuple[Columns, Texts, np.ndarray]  # columns (n,) of numbers and of text, and bits (n,) of MARKS


def radar_plots(fields: RecordFields, level: str, report: str) -> RecordContents:
    """The common contents of plots of categories 048 and 001; level, report: the names of these fields."""
    codes, marks = fields.code("070")
    garbled = fields.number("090", "G") == 1
    height = np.where((fields.number("090", "V") == 0) & ~garbled, fields.number("090", level) * FLIGHT_LEVEL_M, np.nan)
    columns = {
        "range_m": fields.number("040", "RHO") * NAUTICAL_MILE_M,
        "bearing_rad": np.radians(fields.number("040", "THETA")),
        "altitude_m": height,
    }
    reports = name_values(fields.flag("020", report), fields.offsets["020"] >= 0, REPORTS.__getitem__)
    texts = {"mode_3a": codes, "report": reports}
    return columns, texts, marks | fields.tests("020") | mark_bits("garbled height", garbled)


def plots_048(fields: RecordFields) -> RecordContents:
    """Plots and tracks of a radar."""
    columns, texts, marks = radar_plots(fields, "FL", "TYP")
    columns["velocity_mps"], columns["span_mps"] = doppler_048(fields)
    texts |= {
        "track": fields.text(str, "161", "TRN"),
        "address": fields.text(HEXADECIMAL, "220"),
        "callsign": fields.text(callsign_text, "240"),
    }
    # no detection: the radar's own forecast
    is_forecast = (fields.offsets["020"] >= 0) & (fields.flag("020", "TYP") == 0)
    return columns, texts, marks | mark_bits("coasted", is_forecast)


def doppler_048(fields: RecordFields) -> tuple[np.ndarray, np.ndarray]:
    """The first raw Doppler speed and its span, both m/s (n,); else the calculated one, which is not folded."""
    data, offset = fields.data, fields.offsets["120"]
    variation = fields.spec.cv_items_dict["120"].cv_rule.cv_variation
    rules = {part.cv_name: part.cv_rule.cv_variation for part in variation.cv_items_list if part}
    calculated, raw = rules["CAL"], rules["RDS"].cv_variation
    part_bits = np.where(offset < 0, 0, data[offset])
    calculated_offset = np.where(part_bits & 0x80, offset + 1, -1)
    doubtful = asterix_layout.locate_field_in(calculated, "D").values(data, calculated_offset) == 1
    velocity = np.where(
        doubtful, np.nan, asterix_layout.locate_field_in(calculated, "CAL").values(data, calculated_offset)
    )
    count_offset = np.where(part_bits & 0x40, np.where(part_bits & 0x80, offset + 3, offset + 1), -1)
    raw_offset = np.where((count_offset >= 0) & (data[count_offset] > 0), count_offset + 1, -1)
    # The specification names no sign; no target has 32 km/s, so the upper half is taken as negative.
    folded = asterix_layout.locate_field_in(raw, "DOP")._replace(signed=True).values(data, raw_offset)
    span = asterix_layout.locate_field_in(raw, "AMB").values(data, raw_offset)
    return np.where(raw_offset < 0, velocity, folded), span


def plots_001(fields: RecordFields) -> RecordContents:
    """Plots and tracks of a radar in the older category."""
    columns, texts, marks = radar_plots(fields, "HGT", "SSRPSR")
    columns["velocity_mps"] = fields.number("120") * NAUTICAL_MILE_M
    return columns, texts | {"track": fields.text(str, "161")}, marks


def tracks_062(fields: RecordFields) -> RecordContents:
    """Tracks of a surveillance centre."""
    columns = {
        "latitude_deg": fields.number("105", "LAT"),
        "longitude_deg": fields.number("105", "LON"),
        "altitude_m": fields.height("130", "136"),
        "east_mps": fields.number("185", "VX"),
        "north_mps": fields.number("185", "VY"),
    }
    codes, marks = fields.code("060")
    texts = {
        "track": fields.text(str, "040"),
        "address": address_062(fields),
        "mode_3a": codes,
        "callsign": fields.text(callsign_text, "245", "CHR"),
    }
    marks |= mark_bits("simulated", fields.flag("080", "SIM")) | mark_bits("coasted", fields.flag("080", "CST"))
    return columns, texts, marks


def address_062(fields: RecordFields) -> list[str]:
    """The addresses: the first subitem of item 380, after up to four bytes that say which subitems are present."""
    data, offset = fields.data, fields.offsets["380"]
    has_address = (offset >= 0) & (data[offset] & 0x80 > 0)
    for _ in range(3):
        offset = np.where(data[offset] & 1 == 1, offset + 1, offset)
    (address, *_) = fields.spec.cv_items_dict["380"].cv_rule.cv_variation.cv_items_list
    return name_values(
        asterix_layout.locate_field_in(address.cv_rule.cv_variation).integers(data, offset + 1),
        has_address,
        HEXADECIMAL,
    )


def reports_021(fields: RecordFields) -> RecordContents:
    """ADS-B: positions that aircraft report."""
    speed = np.where(fields.number("160", "RE") == 0, fields.number("160", "GS") * NAUTICAL_MILE_M, np.nan)
    course = np.radians(fields.number("160", "TA"))
    climbs = [np.where(fields.number(item, "RE") == 0, fields.number(item, name) * FOOT_M / 60, np.nan)
              for item, name in (("157", "GVR"), ("155", "BVR"))]  # fmt: skip
    is_coarse = fields.offsets["131"] < 0
    columns = {
        "latitude_deg": np.where(is_coarse, fields.number("130", "LAT"), fields.number("131", "LAT")),
        "longitude_deg": np.where(is_coarse, fields.number("130", "LON"), fields.number("131", "LON")),
        "altitude_m": fields.height("140", "145"),
        "east_mps": speed * np.sin(course),
        "north_mps": speed * np.cos(course),
        "up_mps": np.where(np.isnan(climbs[0]), climbs[1], climbs[0]),
    }
    addresses, tracks = fields.text(HEXADECIMAL, "080"), fields.text(str, "161", "TRNUM")
    texts = {
        "track": ["" if address else track for address, track in zip(addresses, tracks, strict=True)],
        "address": addresses,
        "mode_3a": fields.text(OCTAL, "070", "MODE3A"),
        "callsign": fields.text(callsign_text, "170"),
    }
    return columns, texts, fields.tests("040")

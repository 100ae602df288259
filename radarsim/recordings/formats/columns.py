"""Quantities and units of the columns of a recording, found by their names.

A column is found by its name, whatever its case and spaces, in English, German or Russian; a unit may stand at its end
(`range_km`, `Altitude [ft]`, `Latitude_degrees`, `Entfernung, km`). A name without a unit means SI and degrees; but
positions with names from aviation (`gs`, `alt_baro`, …) are in feet, knots and feet a minute, and speeds of ships in
knots, like the exports that use them. Ranges and bearings have no such convention: their units must be stated."""

import math
import re
import shlex
import types
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from radarsim.errors import ConfigError
from radarsim.language.translate import term, tr
from radarsim.recordings.formats import wide_tables
from radarsim.recordings.formats.cell_numbers import hemisphere_sign, split_hemisphere, unit_of_cells
from radarsim.recordings.formats.column_suggestions import cell_number, name_by_cells, suggest_options
from radarsim.recordings.formats.units import (
    DEGREES,
    EARTH_DEGREES,
    FLIGHT_LEVELS,
    HEIGHTS,
    LENGTHS,
    O_SIGNS,
    RADIANS,
    SPEEDS,
    TIME_UNITS,
    UNITS,
    split_unit,
)

MILES = re.compile(r"dm|rm|.*miles?|.*мил[ияь]|.*meilen?|mil+as?|mile|mille?s?")  # that may be of several lengths
MINUTE_NAME = re.compile(r"(?:lat|lon|lng|long)(?:itude)?[_ ]*(?:min|minutes?|sec|seconds?)")
RELATIVE_BEARING = r"rel(?:ative)?_(?:bearing|azimuth|az|brg)|(?:bearing|azimuth|az|brg)_rel(?:ative)?"
MAGNETIC_NAME = re.compile(r".*(?:\bmag|_mag|magnet|магн).*|.*\(m\)")
HEADING_NAMES = ("heading", "hdg", "ship_heading", "own_heading", "platform_heading", "kurs", "курс")
FORMULAS = {  # what no option makes a range or a time, by the names of its columns
    r"(?:.*_)?(?:gate|bin|cell|sample)s?(?:_(?:no|nr|num|number|index|id))?": "a number of range gates times their "
    "length is the range",
    r"(?:ground|horizontal|horiz|surface)_?(?:range|distance|dist)": "the root of the squares of ground range and "
    "height is the slant range",
    r"(?:.*_)?(?:delay|tof|time_of_flight|round_?trip)(?:_.*)?": "half the delay times the speed of light is the range",
    r"x|east|easting|y|north|northing": "the root of x² + y² is the range, the angle from north to east the bearing",
    r"(?:scan|frame|dwell|sweep|rotation)s?(?:_(?:no|nr|num|number|index|id|count))?": "a number of scans times the "
    "scan period is the time",
    RELATIVE_BEARING: "a relative bearing plus the heading is the bearing",
    r".*(?:^|_)[km]?hz": "half the wavelength times a Doppler frequency is the speed",
    r"hour|hours|hh|minute|minutes|second|seconds": "hours, minutes and seconds are a time in one column, HH:MM:SS",
}
FREQUENCY_UNITS = ("hz", "khz", "гц", "кгц")
MAX_NAMED_UNITS = 4  # in a fault, beside the first


class Quantity(NamedTuple):
    """The names of a quantity in files, in lower case without spaces and units, those that count first before others;
    its units, as multiples of ours; the unit of a name that has none, '' where it must be stated."""

    names: tuple[str, ...]
    units: Mapping[str, float] = types.MappingProxyType({})
    default_unit: str = ""


QUANTITIES = {
    "t_s": Quantity(
        (
            *("lastposupdate", "last_position", "time_position"),  # of the position; the following may be of a query
            *("t", "time", "timestamp", "t_s", "datetime", "date_time", "basedatetime", "base_date_time", "utc"),
            *("timemessagegenerated", "date"),
        ),
        TIME_UNITS,
        "s",
    ),
    "date": Quantity(("date", "day", "datemessagegenerated")),  # of a time of day
    "track": Quantity(
        (
            *("icao24", "icao", "hex", "hexident", "mmsi", "track_id", "address"),
            *("callsign", "flight", "id", "track", "name"),
        )
    ),
    "latitude_deg": Quantity(("lat", "latitude"), EARTH_DEGREES, "deg"),
    "longitude_deg": Quantity(("lon", "lng", "long", "longitude"), EARTH_DEGREES, "deg"),
    "altitude_m": Quantity(
        ("geoaltitude", "geo_altitude", "alt_geom", "altitude", "alt", "height", "ele"), HEIGHTS, "m"
    ),
    "barometric_m": Quantity(
        ("baroaltitude", "baro_altitude", "alt_baro", "mode_c", "modec", *FLIGHT_LEVELS), HEIGHTS, "m"
    ),
    "speed_mps": Quantity(("velocity", "groundspeed", "ground_speed", "gs", "speed", "sog"), SPEEDS, "m/s"),
    # Of a ship the heading is where its bow points; aircraft have their course under this name too.
    "course_deg": Quantity(
        ("true_track", "course", "cog", "track_angle", "direction", "heading", "track"), DEGREES, "deg"
    ),
    "up_mps": Quantity(
        ("vertrate", "vertical_rate", "verticalrate", "vert_rate", "geom_rate", "baro_rate", "climb"), SPEEDS, "m/s"
    ),
    "range_m": Quantity(("range", "slant_range", "distance", "rho"), LENGTHS),
    "bearing_rad": Quantity(("bearing", "azimuth", "az", "theta"), RADIANS),
    "velocity_mps": Quantity(("radial_velocity", "doppler", "radial_speed", "range_rate", "velocity"), SPEEDS, "m/s"),
    "span_mps": Quantity(("span", "ambiguity", "doppler_span"), SPEEDS, "m/s"),
}  # fmt: skip
FOREIGN_NAMES = {  # German and Russian; looked for where no English name is found
    "t_s": (
        *("zeit", "uhrzeit", "zeitstempel", "zeitpunkt", "messzeit", "utc-zeit", "zeit_utc", "datum_uhrzeit"),
        *("datum/uhrzeit", "datum_und_uhrzeit", "datum", "время", "метка_времени", "время_измерения"),
        *("время_локации", "дата_время", "дата/время", "дата_и_время", "дата"),
    ),
    "date": ("datum", "дата"),
    "track": (
        *("spur", "spurnummer", "spur-nr", "spur_nr", "spurnr", "ziel", "zielnummer", "ziel-nr", "ziel_nr", "zielnr"),
        *("track_nr", "track-nr", "tracknr", "objekt", "objekt-nr", "kennung"),
        *("трасса", "номер_трассы", "№_трассы", "трасса_№", "цель", "номер_цели", "№_цели", "цель_№", "борт", "№"),
    ),
    "latitude_deg": ("breite", "breitengrad", "широта"),
    "longitude_deg": ("länge", "laenge", "längengrad", "laengengrad", "долгота"),
    "altitude_m": ("höhe", "hoehe", "высота"),
    "speed_mps": ("geschwindigkeit", "fahrt", "скорость", "путевая_скорость"),
    "course_deg": ("kurs", "курс"),
    "range_m": (
        *("entfernung", "entf", "schrägentfernung", "schraegentfernung", "zielentfernung", "schrägdistanz"),
        *("distanz", "abstand", "дальность", "наклонная_дальность", "дальность_наклонная", "дальность_до_цели"),
        "расстояние",
    ),
    "bearing_rad": ("azimut", "peilung", "peilwinkel", "seitenwinkel", "азимут", "аз", "пеленг"),
    "velocity_mps": (
        *("vr", "v_r", "vrad", "v_rad", "vрад", "radialgeschwindigkeit", "radialgeschw", "dopplergeschwindigkeit"),
        *("dopplergeschw", "радиальная_скорость", "скорость_радиальная", "доплеровская_скорость", "допл_скорость"),
        *("допплеровская_скорость", "доплер", "допплер"),
    ),
}
IDENTITIES = {  # what identifies an aircraft or a ship, by the names of columns
    "address": ("icao24", "icao", "hex", "hexident", "mmsi", "address"),
    "callsign": ("callsign", "flight"),
    "mode_3a": ("squawk", "mode_3a", "mode3a", "ssr"),
}
SENSOR_NAMES = (  # of a column that says which sensor has measured a plot
    *("radar", "radar_id", "radar_name", "radar_no", "sensor", "sensor_id", "sensor_name", "sensor_no", "site"),
    *("site_id", "station", "station_id", "source", "source_id", "receiver", "receiver_id", "sac/sic", "sac_sic"),
    *("sic", "quelle", "standort", "рлс", "радар", "станция", "датчик", "сенсор", "источник", "номер_рлс"),
)
UNITLESS = ("t_s", "date", "track")  # what a bracket says of these is no unit: Time (UTC)
EARTH_COLUMNS = ("latitude_deg", "longitude_deg")
PLOT_COLUMNS = ("range_m", "bearing_rad")
OPTIONAL_PLOT_COLUMNS = ("bearing_rad", "velocity_mps", "track")
JOINT_POSITION = "position"  # latitude and longitude in one cell, parted by a comma
AVIATION_NAMES = (  # names without a unit
    *("gs", "groundspeed", "ground_speed", "alt", "alt_baro", "alt_geom", "direction", "mode_c", "modec"),
)
AVIATION_UNITS = {"altitude_m": "ft", "barometric_m": "ft", "speed_mps": "kn", "up_mps": "fpm"}
MARITIME_NAMES = ("sog", "cog", "mmsi")  # names of AIS
HEADING_NAME = "heading"
MARITIME_UNITS = {"speed_mps": "kn"}


class Column(NamedTuple):
    """A column of a file: its index, its name, what its numbers are multiplied by; its unit, and whether that is
    assumed."""

    position: int
    name: str
    factor: float
    unit: str
    is_assumed: bool


def known_names(ours: str) -> tuple[str, ...]:
    """The names that a quantity may have, those that count first before others."""
    return (*QUANTITIES[ours].names, *FOREIGN_NAMES.get(ours, ()))


def _printable(name: str) -> str:
    """A name as a terminal can show it."""
    return "".join(c if c.isprintable() else "�" for c in " ".join(name.split()))


class Header:
    """The columns of a file by our names, those assigned by the user first; raises ConfigError.

    columns: by name of the quantity; o_sign: of longitudes with an O; hemispheres: the indices of those with N or S, E
    or W, by coordinate; identities: the indices of those in IDENTITIES; reads_positions: whether positions are read,
    not plots; aviation, maritime: whether names follow their customs; sample: some rows of the file."""

    def __init__(self, path: str, names: list[str], assigned: Mapping[str, str], sample: Sequence[Sequence[str]] = ()):
        self.path, self.names, self.sample = path, [_printable(name) for name in names], sample
        self.stems = [split_unit(name) for name in self.names]
        self.maritime = any(stem in MARITIME_NAMES for stem, _ in self.stems)
        self.aviation = any((name, "") in self.stems for name in AVIATION_NAMES)
        self.customary_units = AVIATION_UNITS if self.aviation else MARITIME_UNITS if self.maritime else {}
        self.columns: dict[str, Column] = {}
        self.user_units: set[str] = set()  # quantities whose unit the user states
        self.overruled: list[tuple[str, str, str]] = []  # names of columns, the unit that the user states, their own
        self.unknown_units: dict[str, str] = {}  # of columns found, by quantity
        self._assign_columns(assigned)
        if not any(ours in self.columns for ours in wide_tables.PLACES) and (fault := self._wide_table_fault()):
            raise ConfigError(f"{path}:1: {fault}")
        has_positions = all(self._has(ours) or JOINT_POSITION in dict(self.stems) for ours in EARTH_COLUMNS)
        self.reads_positions = has_positions and not any(ours in self.columns for ours in PLOT_COLUMNS)
        self._find_columns(has_positions)
        places = self._column_indices()
        identity_columns = {
            kind: [places[name] for name in names if name in places] for kind, names in IDENTITIES.items()
        }
        self.identities = {kind: indices[0] for kind, indices in identity_columns.items() if indices}
        self.o_sign = self._find_o_sign() if self.reads_positions and "longitude_deg" in self.columns else math.nan
        self.hemispheres = self._find_hemispheres()
        self.sensor_index = next((places[name] for name in SENSOR_NAMES if name in places), None)
        if "track" in self.columns and not self.identities:
            self.identities["address"] = self.columns["track"].position  # one's own name of it
        self._check()

    def _wide_table_fault(self) -> str:
        """That columns are of several targets; '' where they are not."""
        return wide_tables.wide_table_fault(self.names, self.sample, known_names, _name_with_unit, QUANTITIES)

    def _has(self, ours: str) -> bool:
        """Whether a quantity has been assigned, or has a known name."""
        return ours in self.columns or any(stem in known_names(ours) for stem, _ in self.stems)

    def _assign_columns(self, assigned: Mapping[str, str]) -> None:
        """Assign the columns that the user names."""
        stems = {split_unit(ours)[0]: ours for ours in QUANTITIES}
        for name, theirs in assigned.items() if self.names else ():
            stem, unit = split_unit(name)
            ours = name if name in QUANTITIES else stems.get(stem, "")
            theirs = _printable(theirs)
            if not ours or theirs not in self.names:
                allowed = (
                    f"a column of {', '.join(self.names)}" if ours else f"one of {', '.join(QUANTITIES)}, in any unit"
                )
                raise ConfigError(f"{self.path}:1: column {name}={theirs}: must name {allowed}")
            stated_unit, units = split_unit(theirs)[1], QUANTITIES[ours].units
            if name == ours or not unit:
                unit = stated_unit if stated_unit in units else unit
            else:
                self.user_units.add(ours)
            if stated_unit in units and units[stated_unit] != units.get(unit):
                self.overruled.append((theirs, unit, stated_unit))
            self.columns[ours] = self._column(ours, self.names.index(theirs), unit)

    def _column_indices(self) -> dict[str, int]:
        """The index of each name, of the first column that has it."""
        return {stem: i for i, (stem, _) in reversed(list(enumerate(self.stems)))}

    def _find_columns(self, has_positions: bool) -> None:
        """Find the other columns by their known names."""
        indices = self._column_indices()
        left_out = (
            (*PLOT_COLUMNS, "velocity_mps", "span_mps")
            if self.reads_positions
            else ("speed_mps", "course_deg", *EARTH_COLUMNS)
        )
        # beside a position it is the speed over ground
        excluded = {("velocity_mps", "velocity")} if has_positions else set()
        excluded |= {("course_deg", HEADING_NAME)} if self.maritime else set()
        used_indices = {column.position for column in self.columns.values()}
        for ours in QUANTITIES:
            candidates = [
                name
                for name in known_names(ours)
                if (ours, name) not in excluded and indices.get(name) not in used_indices
            ]
            match = next((name for name in candidates if name in indices), None)
            if match and ours not in self.columns and ours not in left_out:
                self.columns[ours] = self._column(ours, indices[match], self.stems[indices[match]][1])
                used_indices.add(indices[match])
        if self.reads_positions and JOINT_POSITION in indices:
            for ours in set(EARTH_COLUMNS) - set(self.columns):
                self.columns[ours] = self._column(ours, indices[JOINT_POSITION], "")

    def _find_o_sign(self) -> float:
        """1 if an O of longitudes is Ost, as the user or a W beside it says, -1 if it is ouest; not-a-number of none.
        Raises ConfigError where it may be either."""
        column = self.columns["longitude_deg"]
        if column.unit in O_SIGNS:
            return O_SIGNS[column.unit]
        free = [i for i in range(len(self.names)) if i not in {other.position for other in self.columns.values()}]
        for i in (column.position, *free):
            cells = [row[i].strip() for row in self.sample if i < len(row)]
            halves = [split_hemisphere(cell, "longitude_deg", math.inf) for cell in cells]
            if i == column.position:
                signs = {half[1] for half in halves if half is not None}
            else:
                signs = {hemisphere_sign(cell, "longitude_deg", math.inf) for cell in cells if cell}
            if math.inf in signs and signs <= {math.inf, 1.0, -1.0}:
                if len(signs) == 2:
                    return -1.0 if 1.0 in signs else 1.0
                name = shlex.quote(column.name)
                raise ConfigError(
                    f"{self.path}:1: {self.names[i]}: must name east or west; got 'O': for Ost --column "
                    f"longitude_ost={name}, for ouest or oeste --column longitude_ouest={name}"
                )
        return math.nan

    def _find_hemispheres(self) -> dict[str, int]:
        """The columns that hold the hemisphere of a coordinate, N or S, E or W, by its quantity."""
        found = {}
        used = {column.position for column in self.columns.values()}
        for ours in EARTH_COLUMNS if self.reads_positions else ():
            free = sorted(set(range(len(self.names))) - used, key=lambda i: abs(i - 1 - self.columns[ours].position))
            for i in free:
                cells = [row[i] for row in self.sample if i < len(row) and row[i].strip()]
                signs = [hemisphere_sign(cell, ours, self.o_sign) for cell in cells]
                if signs and not any(map(math.isnan, signs)):
                    found[ours] = i
                    break
        return found

    def _column(self, ours: str, index: int, unit: str) -> Column:
        """A column in its unit; '' where neither its name nor the user states one."""
        name, quantity = self.names[index], QUANTITIES[ours]
        if self.names.count(name) > 1:
            raise ConfigError(
                f"{self.path}:1: {name}: must be the name of one column; several have it: give each a name of its own"
            )
        if not unit and ours not in UNITLESS:
            unit = unit_of_cells([row[index].strip() for row in self.sample if index < len(row)], quantity.units)
        is_known = unit in quantity.units or ours in UNITLESS
        if unit and not is_known:
            self.unknown_units[ours] = unit
        unit_or_default = unit or self.customary_units.get(ours, quantity.default_unit)
        is_assumed = not unit and ours not in UNITLESS and quantity.units not in (DEGREES, EARTH_DEGREES)
        return Column(index, name, quantity.units.get(unit_or_default, 1.0), unit_or_default, is_assumed)

    def _check(self) -> None:
        """Raise ConfigError for missing columns, and for units that must be stated, all at once."""
        required = ("t_s", *EARTH_COLUMNS) if self.reads_positions else ("t_s", "range_m")
        faults = [self._unknown_unit_fault(ours, unit) for ours, unit in self.unknown_units.items()]
        if self.names and not any(math.isnan(cell_number(name)) for name in self.names):
            must = "must name the columns; the first line has numbers alone, put one above it such as"
            example = "t_s,track,range_m,bearing_deg,velocity_mps"
            faults.append(f"{self.path}:1: {must} {example}; got {', '.join(self.names)[:200]}")
        elif missing := [name for name in required if name not in self.columns]:
            got = ", ".join(self.names)[:200] or "nothing"
            needed = "columns of time, and of latitude and longitude or of range (name them: --column OURS=THEIRS)"
            guesses = self._guesses(missing)
            hints = ", ".join(missing)
            if len(guesses) < len(missing):
                hints = "; ".join(f"{name}: {', '.join(QUANTITIES[name].names)}" for name in missing)
            ready = f"; perhaps {' '.join(guesses)}" if guesses else ""
            formulas = {text for text in map(_formula, (stem for stem, _ in self.stems)) if text}
            ready += "".join(f"; {text}: make such a column" for text in sorted(formulas))
            if self.sample and not any(letter.isdigit() for cell in self.sample[0] for letter in cell):
                below = ", ".join(cell.strip() for cell in self.sample[0])[:200]
                ready += f"; if the line below belongs to the header ({below}), make one line of both"
            faults.append(f"{self.path}:1: must have {needed}; missing ({hints}); got {got}{ready}")
        minutes = [name for name in self.names if MINUTE_NAME.fullmatch(name.lower())]
        if self.reads_positions and minutes:
            must = "must be in the cells of the degrees, as 52°18.5', not in columns of their own"
            faults.append(f"{self.path}:1: {', '.join(minutes)}: {must}")
        if columns_without_unit := {
            ours: column.name for ours, column in self.columns.items() if not column.unit and ours not in UNITLESS
        }:
            cures = []
            for ours, name in columns_without_unit.items():
                first, *alternatives = _names_with_units(ours)
                cures.append(f"--column {first}={shlex.quote(name)} (or {', '.join(alternatives[:MAX_NAMED_UNITS])})")
            names = ", ".join(columns_without_unit.values())
            faults.append(f"{self.path}:1: {names}: must have a unit in the name; where it has none, "
                          f"{', '.join(cures)} states it")  # fmt: skip
        if faults:
            raise ConfigError(*faults)

    def _unknown_unit_fault(self, ours: str, unit: str) -> str:
        name, units = self.columns[ours].name, ", ".join(QUANTITIES[ours].units)
        if ours == "velocity_mps" and unit in FREQUENCY_UNITS:
            cure = "half the wavelength times a Doppler frequency is the speed: make such a column"
            return f"{self.path}:1: {name}: must be a speed, in one of {units}; got {unit!r}; {cure}"
        cure = f"--column {name_by_cells(ours, self._cells(ours))}={shlex.quote(name)}"
        if ours == "range_m" and MILES.fullmatch(unit):
            cure = " or ".join(f"--column {option}={shlex.quote(name)}" for option in ("range_nm", "range_dmi"))
            cure += ", of nautical or data miles"
        return f"{self.path}:1: {name}: the unit must be one of {units}; got {unit!r}; it is stated by {cure}"

    def _cells(self, ours: str) -> list[str]:
        """The cells of a quantity's column in the sample."""
        position = self.columns[ours].position
        return [row[position].strip() for row in self.sample if position < len(row)]

    def _guesses(self, missing: Sequence[str], optional: Sequence[str] = OPTIONAL_PLOT_COLUMNS) -> list[str]:
        """The options that may name the missing columns, and others of a plot that no name is known of."""
        quantities = [*missing, *(ours for ours in optional if ours not in self.columns and not self.reads_positions)]
        used = {column.position for column in self.columns.values()}
        other_names = {name for ours in QUANTITIES if ours not in quantities for name in known_names(ours)}
        stems = [
            ("", "") if i in used or stem in other_names or _formula(stem) else (stem, unit if unit in UNITS else "")
            for i, (stem, unit) in enumerate(self.stems)
        ]
        return suggest_options({ours: known_names(ours) for ours in quantities}, _name_with_unit, stems, self.names,
                             self.sample)  # fmt: skip

    def notes(self) -> list[str]:
        """Notes on assumptions, and on columns that are not used."""
        assumed = [column for column in self.columns.values() if column.is_assumed and column.unit]
        unit_texts = ", ".join(tr("{name} in {unit}", name=column.name, unit=column.unit) for column in assumed)
        lines = [tr("assumed because the name has no unit: {units}", units=unit_texts)] if unit_texts else []
        lines += [
            tr("{name} is read in {unit}, as --column says, not in {stated}", name=name, unit=unit, stated=stated)
            for name, unit, stated in self.overruled
        ]
        if guesses := self._guesses((), ("bearing_rad", "velocity_mps")):
            lines.append(tr("columns that may be read too: {options}", options=" ".join(guesses)))
        time = self.columns["t_s"].name
        names_by_stem = {stem: name for (stem, _), name in zip(self.stems, self.names, strict=True)}
        used = {column.name for column in self.columns.values()}
        unused = [
            names_by_stem[stem]
            for stem in names_by_stem
            if stem in QUANTITIES["t_s"].names and names_by_stem[stem] not in used
        ]
        if unused:
            lines.append(tr("times are {time}; not used: {others}", time=time, others=", ".join(unused)))
        if (
            self.maritime
            and self.reads_positions
            and HEADING_NAME in names_by_stem
            and "course_deg" not in self.columns
        ):
            lines.append(
                tr("no speeds: {heading} is where the bow points, not the course", heading=names_by_stem[HEADING_NAME])
            )
        if not self.reads_positions:
            lines += self._bearing_notes(names_by_stem)
        ranges = [names_by_stem[stem] for stem in names_by_stem if stem in QUANTITIES["range_m"].names]
        if self.reads_positions and ranges:
            column = f"--column range_UNIT={shlex.quote(ranges[0])}"
            lines.append(tr("positions are read, not plots; for these: {column}", column=column))
        return lines

    def _bearing_notes(self, names_by_stem: Mapping[str, str]) -> list[str]:
        """Notes on bearings that may not count from north."""
        bearing = self.columns.get("bearing_rad")
        if bearing is None:
            message = term("{name} counts from the bow: add the heading to it in a column `bearing`")
            return [
                tr(message, name=name) for stem, name in names_by_stem.items() if re.fullmatch(RELATIVE_BEARING, stem)
            ]
        headings = [names_by_stem[name] for name in HEADING_NAMES if name in names_by_stem]
        lines = [
            tr("{bearing} is taken from north, and {heading} is not used: if it counts from the bow, add that to it",
               bearing=bearing.name, heading=name)
            for name in headings[:1]
        ]  # fmt: skip
        if MAGNETIC_NAME.fullmatch(bearing.name.lower()):
            lines.append(tr("{bearing} is magnetic: --bias bearing_deg=-D adds a declination of D° east",
                            bearing=bearing.name))  # fmt: skip
        return lines


def _formula(stem: str) -> str:
    """How a range or a time is made of a column that is none, by its name; '' of another."""
    return next((text for pattern, text in FORMULAS.items() if re.fullmatch(pattern, stem)), "")


def _names_with_units(ours: str) -> list[str]:
    """A quantity's name in each unit that its columns may have, ours first."""
    by_factor: dict[float, str] = {}
    for unit, factor in QUANTITIES[ours].units.items():
        by_factor.setdefault(factor, f"{split_unit(ours)[0]}_{unit}")
    return list(by_factor.values())


def _name_with_unit(ours: str, unit: str) -> str:
    """A quantity's name in a unit; '' where that is no unit of it."""
    if unit not in QUANTITIES[ours].units:
        return ""
    names = _names_with_units(ours)
    factor = QUANTITIES[ours].units[unit]
    return next((name for name in names if QUANTITIES[ours].units[name.rpartition("_")[2]] == factor), names[0])

"""What columns of recordings hold: the quantities, the names that files give them, and their units.

A column is found by its name, whatever the case and the spaces; a unit may stand at the end of it (`range_km`,
`Altitude [ft]`, `Latitude_degrees`). A name without a unit means SI and degrees; but positions with names from aviation
(`gs`, `alt_baro`, …) are in feet, knots and feet a minute, and speeds of ships in knots, like the exports that use
them. Ranges and bearings have no such custom: their units must be stated.
"""

import math
import re
import shlex
import types
from collections.abc import Mapping
from typing import NamedTuple

from radarsim.errors import ConfigError
from radarsim.recorded.formats.sites import KNOT_MPS

LENGTHS = {"m": 1.0, "km": 1e3, "ft": 0.3048, "feet": 0.3048, "nm": 1852.0, "nmi": 1852.0}
SPEEDS = {
    **dict.fromkeys(("mps", "m/s", "ms"), 1.0), **dict.fromkeys(("kn", "kt", "kts", "knots"), KNOT_MPS),
    **dict.fromkeys(("kmh", "km/h"), 1 / 3.6), **dict.fromkeys(("fpm", "ft/min"), 0.3048 / 60),
}  # fmt: skip
DEGREES = {**dict.fromkeys(("deg", "degree", "degrees", "°"), 1.0), "rad": 180 / math.pi}
RADIANS = {unit: math.radians(factor) for unit, factor in DEGREES.items()}
TIMES = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "dmy": 1.0, "mdy": 1.0}  # dmy, mdy: the order in 1/2/2024


class Quantity(NamedTuple):
    """The names of a quantity in files, in lower case without spaces and units, those that count first before others;
    its units, as multiples of ours; the unit of a name that has none, '' where it must be stated."""

    names: tuple[str, ...]
    units: Mapping[str, float] = types.MappingProxyType({})
    plain: str = ""


QUANTITIES = {
    "t_s": Quantity(
        (
            *("lastposupdate", "last_position", "time_position"),  # of the position; the following may be of a query
            *("t", "time", "timestamp", "t_s", "datetime", "date_time", "basedatetime", "base_date_time", "utc"),
            "date",
        ),
        TIMES,
        "s",
    ),
    "date": Quantity(("date", "day")),  # of a time of day
    "track": Quantity(
        ("icao24", "icao", "hex", "mmsi", "track_id", "address", "callsign", "flight", "id", "track", "name")
    ),
    "latitude_deg": Quantity(("lat", "latitude"), DEGREES, "deg"),
    "longitude_deg": Quantity(("lon", "lng", "long", "longitude"), DEGREES, "deg"),
    "altitude_m": Quantity(
        ("geoaltitude", "geo_altitude", "alt_geom", "altitude", "alt", "height", "ele"), LENGTHS, "m"
    ),
    "barometric_m": Quantity(("baroaltitude", "baro_altitude", "alt_baro"), LENGTHS, "m"),
    "speed_mps": Quantity(("velocity", "groundspeed", "ground_speed", "gs", "speed", "sog"), SPEEDS, "m/s"),
    # Of a ship the heading is where its bow points; aircraft have their course under this name too.
    "course_deg": Quantity(
        ("true_track", "course", "cog", "track_angle", "direction", "heading", "track"), DEGREES, "deg"
    ),
    "up_mps": Quantity(
        ("vertrate", "vertical_rate", "vert_rate", "geom_rate", "baro_rate", "climb"), SPEEDS, "m/s"
    ),
    "range_m": Quantity(("range", "slant_range", "distance", "rho"), LENGTHS),
    "bearing_rad": Quantity(("bearing", "azimuth", "az", "theta"), RADIANS),
    "velocity_mps": Quantity(("radial_velocity", "doppler", "radial_speed", "range_rate", "velocity"), SPEEDS, "m/s"),
    "span_mps": Quantity(("span", "ambiguity", "doppler_span"), SPEEDS, "m/s"),
}  # fmt: skip
IDENTITIES = {  # what identifies an aircraft or a ship, by the names of columns
    "address": ("icao24", "icao", "hex", "mmsi", "address"),
    "callsign": ("callsign", "flight"),
    "mode_3a": ("squawk", "mode_3a", "mode3a", "ssr"),
}
UNITS = {unit for quantity in QUANTITIES.values() for unit in quantity.units if unit}
UNNAMED = ("t_s", "date", "track")  # what a bracket says of these is no unit: Time (UTC)
ON_EARTH = ("latitude_deg", "longitude_deg")
MEASURED = ("range_m", "bearing_rad")
POSITION = "position"  # latitude and longitude in one cell, parted by a comma
AVIATION = ("gs", "groundspeed", "ground_speed", "alt", "alt_baro", "alt_geom", "direction")  # names without a unit
AVIATION_UNITS = {"altitude_m": "ft", "barometric_m": "ft", "speed_mps": "kn", "up_mps": "fpm"}
MARITIME = ("sog", "cog", "mmsi")  # names of AIS
BOW = "heading"
MARITIME_UNITS = {"speed_mps": "kn"}
UNIT = re.compile(r"^(.*?)\s*[\[(]\s*([^\])]*)\s*[\])]$")


class Column(NamedTuple):
    """A column of a file: its index, its name, what its numbers are multiplied by; its unit, and whether that is
    assumed."""

    place: int
    name: str
    factor: float
    unit: str
    assumed: bool


def split(name: str) -> tuple[str, str]:
    """A column's name without its unit, in lower case, and its unit: `Range [km]` and `range_km` are (range, km)."""
    name = name.strip().lower()
    if found := UNIT.match(name):
        return re.sub(r"\s+", "_", found[1].strip()), found[2].strip()
    name = re.sub(r"\s+", "_", name)
    stem, _, last = name.rpartition("_")
    return (stem, last) if stem and last in UNITS else (name, "")


def _printable(name: str) -> str:
    """A name as a terminal can show it."""
    return "".join(c if c.isprintable() else "�" for c in " ".join(name.split()))


class Header:
    """The columns of a file by our names, those assigned by the user first; raises ConfigError.

    columns: by name of the quantity; identities: the indices of those in
    IDENTITIES; on_earth: whether positions are read, not plots; aviation, maritime: whether
    names are of their customs.
    """

    def __init__(self, path: str, names: list[str], given: Mapping[str, str]):
        self.path, self.names = path, [_printable(name) for name in names]
        self.stems = [split(name) for name in self.names]
        self.maritime = any(stem in MARITIME for stem, _ in self.stems)
        self.aviation = any((name, "") in self.stems for name in AVIATION)
        self.custom = AVIATION_UNITS if self.aviation else MARITIME_UNITS if self.maritime else {}
        self.columns: dict[str, Column] = {}
        self._given(given)
        earth = all(self._has(ours) or POSITION in dict(self.stems) for ours in ON_EARTH)
        self.on_earth = earth and not any(ours in self.columns for ours in MEASURED)
        self._found(earth)
        places = self._places()
        named = {kind: [places[name] for name in names if name in places] for kind, names in IDENTITIES.items()}
        self.identities = {kind: found[0] for kind, found in named.items() if found}
        if "track" in self.columns and not self.identities:
            self.identities["address"] = self.columns["track"].place  # one's own name of it
        self._judge()

    def _has(self, ours: str) -> bool:
        """Whether a quantity was named, or has a known name."""
        return ours in self.columns or any(stem in QUANTITIES[ours].names for stem, _ in self.stems)

    def _given(self, given: Mapping[str, str]) -> None:
        """The columns that the user names."""
        stems = {split(ours)[0]: ours for ours in QUANTITIES}
        for name, theirs in given.items() if self.names else ():
            stem, unit = split(name)
            ours = name if name in QUANTITIES else stems.get(stem, "")
            theirs = _printable(theirs)
            if not ours or theirs not in self.names:
                allowed = (
                    f"a column of {', '.join(self.names)}" if ours else f"one of {', '.join(QUANTITIES)}, in any unit"
                )
                raise ConfigError(f"{self.path}:1: column {name}={theirs}: must name {allowed}")
            own = split(theirs)[1]
            if unit and own and name != ours and unit != own:
                raise ConfigError(f"{self.path}:1: column {name}={theirs}: must have the unit of its own name, {own}")
            self.columns[ours] = self._column(ours, self.names.index(theirs), own or unit)

    def _places(self) -> dict[str, int]:
        """The index of each name, of the first column that has it."""
        return {stem: i for i, (stem, _) in reversed(list(enumerate(self.stems)))}

    def _found(self, earth: bool) -> None:
        """The other columns, by the names that are known; earth: whether there are positions."""
        places = self._places()
        left_out = (*MEASURED, "velocity_mps", "span_mps") if self.on_earth else ("speed_mps", "course_deg", *ON_EARTH)
        passed = {("velocity_mps", "velocity")} if earth else set()  # beside a position it is the speed over ground
        passed |= {("course_deg", BOW)} if self.maritime else set()
        taken = {column.place for column in self.columns.values()}
        for ours, quantity in QUANTITIES.items():
            known = [name for name in quantity.names if (ours, name) not in passed and places.get(name) not in taken]
            one = next((name for name in known if name in places), None)
            if one and ours not in self.columns and ours not in left_out:
                self.columns[ours] = self._column(ours, places[one], self.stems[places[one]][1])
                taken.add(places[one])
        if self.on_earth and POSITION in places:
            for ours in set(ON_EARTH) - set(self.columns):
                self.columns[ours] = self._column(ours, places[POSITION], "")

    def _column(self, ours: str, place: int, unit: str) -> Column:
        """A column in its unit; '' where neither its name nor the user states one."""
        name, quantity = self.names[place], QUANTITIES[ours]
        if self.names.count(name) > 1:
            raise ConfigError(f"{self.path}:1: {name}: must be the name of one column; several have it")
        stated = unit in quantity.units or ours in UNNAMED
        if unit and not stated:
            raise ConfigError(
                f"{self.path}:1: {name}: the unit must be one of {', '.join(quantity.units)}; got {unit!r}"
            )
        taken = unit or self.custom.get(ours, quantity.plain)
        assumed = not unit and ours not in UNNAMED and quantity.units is not DEGREES
        return Column(place, name, quantity.units.get(taken, 1.0), taken, assumed)

    def _judge(self) -> None:
        """Raise ConfigError for what is missing, and for units that must be stated."""
        wanted = ("t_s", *ON_EARTH) if self.on_earth else ("t_s", "range_m")
        if missing := [name for name in wanted if name not in self.columns]:
            hints = "; ".join(f"{name}: {', '.join(QUANTITIES[name].names)}" for name in missing)
            got = ", ".join(self.names)[:200] or "nothing"
            what = "columns of time, and of latitude and longitude or of range (name them: --column OURS=THEIRS)"
            raise ConfigError(f"{self.path}:1: must have {what}; missing ({hints}); got {got}")
        if open_ := {ours: one.name for ours, one in self.columns.items() if not one.unit and ours not in UNNAMED}:
            cures = []
            for ours, name in open_.items():
                by_factor: dict[float, str] = {}
                for unit, factor in QUANTITIES[ours].units.items():
                    by_factor.setdefault(factor, f"{split(ours)[0]}_{unit}")
                first, *others = by_factor.values()
                cures.append(f"--column {first}={shlex.quote(name)} (or {', '.join(others)})")
            raise ConfigError(f"{self.path}:1: {', '.join(open_.values())}: must have a unit in the name; where it has "
                              f"none, {', '.join(cures)} states it")  # fmt: skip

    def notes(self) -> list[str]:
        """What was assumed, and what was not used."""
        taken = ", ".join(f"{one.name} in {one.unit}" for one in self.columns.values() if one.assumed and one.unit)
        found = [f"assumed because the name has no unit: {taken}"] if taken else []
        time = self.columns["t_s"].name
        known = {stem: name for (stem, _), name in zip(self.stems, self.names, strict=True)}
        used = {one.name for one in self.columns.values()}
        others = [known[stem] for stem in known if stem in QUANTITIES["t_s"].names and known[stem] not in used]
        if others:
            found.append(f"times are {time}; not used: {', '.join(others)}")
        if self.maritime and self.on_earth and BOW in known and "course_deg" not in self.columns:
            found.append(f"no speeds: {known[BOW]} is where the bow points, not the course")
        ranges = [known[stem] for stem in known if stem in QUANTITIES["range_m"].names]
        if self.on_earth and ranges:
            found.append(f"positions are read, not plots; for these: --column range_UNIT={shlex.quote(ranges[0])}")
        return found

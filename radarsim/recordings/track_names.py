"""Names of the tracks that a sensor's records belong to.

A record belongs to a track by its track number, its address or its Mode 3/A code. A sensor assigns its track numbers,
and uses a number again when its aircraft has left. Several aircraft may have the same code at a time. So both name a
track only together with the time, and a code only together with the position as well."""

import math
from dataclasses import dataclass

MAX_SILENCE_S = 60.0  # after such a silence, a number or a code belongs to another aircraft
# between plots of one aircraft: Mach 2, and errors in azimuth far away
MAX_SPEED_MPS = 700.0
POSITION_MARGIN_M = 1500.0
MIN_TURN_S = 1.0  # within which a radar does not see an aircraft twice


@dataclass(slots=True)
class LastReport:
    """The last record of a track: its name, and time, address, position (m) and velocity (m/s) of its aircraft."""

    name: str
    t: float
    address: str
    north: float
    east: float
    north_mps: float = 0.0
    east_mps: float = 0.0


class TrackNames:
    """Names of tracks: the number, the address, or A and the code.

    The name of a sensor other than the first stands before them, with a colon; -2, -3, … stand after the names of the
    second aircraft and further ones."""

    def __init__(self) -> None:
        self.first_sensor: str | None = None
        self.reports_by_number: dict[tuple[str, str], LastReport] = {}
        self.reports_by_code: dict[tuple[str, str], list[LastReport]] = {}
        self.counts: dict[str, int] = {}
        self.reused_numbers = 0  # numbers used again for another aircraft
        self.shared_codes: set[str] = set()  # names of codes of several aircraft

    def name_by_number(self, sensor: str, number: str, address: str, t: float) -> str:
        """The track of a record with a track number; its address is '' if it has none."""
        report = self.reports_by_number.get((sensor, number))
        if report is not None:
            have_addresses = address and report.address
            if address == report.address if have_addresses else t - report.t <= MAX_SILENCE_S:
                report.t, report.address = t, address or report.address
                return report.name
            self.reused_numbers += 1
        report = self.reports_by_number[sensor, number] = LastReport(
            self._unique_name(self.with_sensor(sensor, number)), t, address, 0.0, 0.0
        )
        return report.name

    def name_by_code(self, sensor: str, code: str, t: float, north: float, east: float) -> str:
        """The track of a record with a code, at a position in m: that of the aircraft which flies nearest to it."""
        reports = [report for report in self.reports_by_code.get((sensor, code), ()) if t - report.t <= MAX_SILENCE_S]
        smallest_miss, match = math.inf, None
        for report in reports:
            interval, distance = t - report.t, math.hypot(north - report.north, east - report.east)
            if interval >= MIN_TURN_S and distance <= MAX_SPEED_MPS * interval + POSITION_MARGIN_M:
                miss = math.hypot(
                    north - report.north - report.north_mps * interval, east - report.east - report.east_mps * interval
                )
                if miss < smallest_miss:
                    smallest_miss, match = miss, report
        if match is None:
            base_name = self.with_sensor(sensor, f"A{code}")
            if base_name in self.counts:
                self.shared_codes.add(base_name)
            match = LastReport(self._unique_name(base_name), t, "", north, east)
            reports.append(match)
        else:
            interval = t - match.t
            match.north_mps, match.east_mps = (north - match.north) / interval, (east - match.east) / interval
            match.t, match.north, match.east = t, north, east
        self.reports_by_code[sensor, code] = reports
        return match.name

    def with_sensor(self, sensor: str, name: str) -> str:
        """A name, preceded by its sensor unless that is the first."""
        if self.first_sensor is None:
            self.first_sensor = sensor
        return name if sensor == self.first_sensor else f"{sensor}:{name}"

    def _unique_name(self, name: str) -> str:
        count = self.counts[name] = self.counts.get(name, 0) + 1
        return name if count == 1 else f"{name}-{count}"

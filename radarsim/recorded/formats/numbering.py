"""Which track a record of a sensor belongs to: by its track number, its address or its Mode 3/A code.

A track number is a sensor's own, and is given again when its aircraft has gone. A code is given to several aircraft at
a time. So both name a track only together with time, and a code with place too.
"""

import math
from dataclasses import dataclass

GONE_S = 60.0  # after which a number or a code is that of another aircraft
FASTEST_MPS, MARGIN_M = 700.0, 1500.0  # between plots of one aircraft: Mach 2, and errors in azimuth far away
SAME_TURN_S = 1.0  # within which a radar does not see an aircraft twice


@dataclass(slots=True)
class Seen:
    """A track: its name, and time, address, place (m) and velocity (m/s) of its aircraft's last record."""

    name: str
    t: float
    address: str
    north: float
    east: float
    north_mps: float = 0.0
    east_mps: float = 0.0


class Tracks:
    """Names of tracks: the number, the address, or A and the code; of another sensor than the first with its name and a
    colon before them; -2, -3, … after those of the second aircraft and further ones."""

    def __init__(self) -> None:
        self.first: str | None = None
        self.numbers: dict[tuple[str, str], Seen] = {}
        self.codes: dict[tuple[str, str], list[Seen]] = {}
        self.counts: dict[str, int] = {}
        self.again = 0  # numbers given again
        self.shared: set[str] = set()  # names of codes of several aircraft

    def by_number(self, sensor: str, number: str, address: str, t: float) -> str:
        """The track of a record with a track number; its address is '' where it has none."""
        one = self.numbers.get((sensor, number))
        if one is not None:
            known = address and one.address
            if address == one.address if known else t - one.t <= GONE_S:
                one.t, one.address = t, address or one.address
                return one.name
            self.again += 1
        one = self.numbers[sensor, number] = Seen(self._new(self.of(sensor, number)), t, address, 0.0, 0.0)
        return one.name

    def by_code(self, sensor: str, code: str, t: float, north: float, east: float) -> str:
        """The track of a record with a code, at a place in m: of the aircraft that flies nearest to it."""
        known = [one for one in self.codes.get((sensor, code), ()) if t - one.t <= GONE_S]
        nearest, found = math.inf, None
        for one in known:
            step, way = t - one.t, math.hypot(north - one.north, east - one.east)
            if step >= SAME_TURN_S and way <= FASTEST_MPS * step + MARGIN_M:
                miss = math.hypot(north - one.north - one.north_mps * step, east - one.east - one.east_mps * step)
                if miss < nearest:
                    nearest, found = miss, one
        if found is None:
            whole = self.of(sensor, f"A{code}")
            if whole in self.counts:
                self.shared.add(whole)
            found = Seen(self._new(whole), t, "", north, east)
            known.append(found)
        else:
            step = t - found.t
            found.north_mps, found.east_mps = (north - found.north) / step, (east - found.east) / step
            found.t, found.north, found.east = t, north, east
        self.codes[sensor, code] = known
        return found.name

    def of(self, sensor: str, name: str) -> str:
        """A name that is the sensor's own."""
        if self.first is None:
            self.first = sensor
        return name if sensor == self.first else f"{sensor}:{name}"

    def _new(self, name: str) -> str:
        count = self.counts[name] = self.counts.get(name, 0) + 1
        return name if count == 1 else f"{name}-{count}"

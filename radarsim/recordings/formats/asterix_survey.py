"""Positions and turn times of the radars of an ASTERIX file.

Category 034 states the position of a radar and the time of its turn; category 002 also does, and has the full time of
day, of which category 001 keeps only the last part."""

import os
from collections import Counter
from dataclasses import dataclass, field
from itertools import islice

import numpy as np

from radarsim.errors import ConfigError
from radarsim.recordings.formats import asterix_layout, captures
from radarsim.recordings.formats.asterix_layout import DamagedRecord, Profile

SURVEY_BLOCKS = 50_000  # data blocks at the beginning of a file in which radars say where they stand


@dataclass
class Survey:
    """What the beginning of a file says of its radars, by SAC/SIC: degrees, degrees and m (WGS 84), the time of a turn
    in s; the first full time of day, s; and its categories."""

    positions: dict[str, tuple[float, float, float]] = field(default_factory=dict)
    turns: dict[str, float] = field(default_factory=dict)
    second: float | None = None
    categories: set[int] = field(default_factory=set)


def survey_radars(path: str) -> Survey:
    """The radars of a file, by its first SURVEY_BLOCKS blocks; none of a stream, which is read once."""
    survey, turns_by_radar = Survey(), dict[str, list[float]]()
    if not os.path.isfile(path):
        return survey
    services = {34: Profile(34, ("010", "041", "030", "120")), 2: Profile(2, ("010", "041", "030"))}
    turn_field, time_field = (asterix_layout.locate_field(services[34].spec, item) for item in ("041", "030"))
    position_fields = [asterix_layout.locate_field(services[34].spec, "120", name) for name in ("LAT", "LON", "HGT")]
    try:
        with open(path, "rb") as file:
            for category, _, data in islice(captures.blocks(path, file, Counter()), SURVEY_BLOCKS):
                survey.categories.add(category)
                start = 3
                while category in services and start < len(data):
                    (source, turn_offset, time_offset, *position_offset), start = services[category].offsets(
                        data, start
                    )
                    radar = f"{data[source]}/{data[source + 1]}" if source >= 0 else ""
                    if turn_offset >= 0:
                        turns_by_radar.setdefault(radar, []).append(_field_value(turn_field, data, turn_offset))
                    if time_offset >= 0 and survey.second is None:
                        survey.second = _field_value(time_field, data, time_offset)
                    if position_offset and position_offset[0] >= 0:
                        latitude, longitude, height = (
                            _field_value(field, data, position_offset[0]) for field in position_fields
                        )
                        if latitude or longitude:  # a radar that does not know sends zeros
                            survey.positions[radar] = latitude, longitude, height
    except (ConfigError, DamagedRecord):
        pass  # it is told when the records are read
    survey.turns = {radar: float(np.median(durations)) for radar, durations in turns_by_radar.items()}
    return survey


def _field_value(field: asterix_layout.Field, data: bytes, offset: int) -> float:
    return float(field.values(np.frombuffer(data, np.uint8), np.array([offset]))[0])

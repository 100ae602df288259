"""Track points of a GPX file, as a sheet."""

from collections.abc import Iterator
from typing import BinaryIO
from xml.etree import ElementTree

from radarsim.errors import ConfigError
from radarsim.language.translate import tr
from radarsim.recordings.formats.sheet import Sheet

GPX_COLUMNS = {  # what a point and its track have, by the columns of a sheet
    **{"time": "time", "track": "track_id", "lat": "lat", "lon": "lon"},
    **{"ele": "ele [m]", "speed": "speed [m/s]", "course": "course [deg]"},
}


def read_gpx(path: str, file: BinaryIO) -> Sheet:
    """The points of the tracks of a GPX file, each under its track's name or its number."""

    def rows() -> Iterator[tuple[int, list[str]]]:
        name, tracks, number, segment = "", 0, 0, ElementTree.Element("")
        try:
            for event, element in ElementTree.iterparse(file, ("start", "end")):
                tag = _local_name(element)
                if event == "start":
                    if tag == "trk":
                        tracks, name = tracks + 1, ""
                    segment = element if tag == "trkseg" else segment
                elif tag == "name" and not name and tracks:
                    name = (element.text or "").strip()
                elif tag == "trkpt":
                    number += 1
                    values = {_local_name(child): (child.text or "").strip() for child in element.iter()}
                    values |= {"track": name or str(tracks), **element.attrib}
                    yield number, [values.get(cell, "") for cell in GPX_COLUMNS]
                    segment.clear()  # so that memory does not grow
        except ElementTree.ParseError as error:
            raise ConfigError(f"{path}:{error.position[0]}: must be GPX: {error}; {number} points were read") from error

    note = tr("altitudes are as the file has them, mostly above the sea, not the ellipsoid")
    return Sheet(path, [*GPX_COLUMNS.values()], rows(), notes=[note])


def _local_name(element: ElementTree.Element) -> str:
    """A name without its namespace."""
    return str(element.tag).rpartition("}")[2]

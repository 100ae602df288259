"""Options of `radarsim import`, and their texts parsed."""

import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal, get_args

from radarsim.errors import ConfigError
from radarsim.recordings.formats.records import BIASES, DAY_S, utc_s
from radarsim.recordings.formats.sites import Antenna, Site

Format = Literal["asterix", "opensky", "ais", "csv", "json", "parquet", "gpx", "nmea"]
FORMATS: tuple[Format, ...] = get_args(Format)
MAX_BIAS = dict(zip(BIASES, (1e6, 0.5, math.pi, DAY_S), strict=True))  # in size


@dataclass(frozen=True)
class Options:
    """How to read a recording.

    format: detected from the content where None. site: place of the radar; sites: place of each radar of a recording of
    several, by SAC/SIC, others are left out. antenna: its normal, for the angles that `multimodel` takes. tracks: those
    to write, all where empty. zero: origin of t_s, "first" (record), "midnight" (of the first record's day, UTC) or s
    from 1970. truth: a second recording, of positions. towards: Doppler speeds are positive where the range falls.
    columns: of a CSV, theirs by ours. encoding: of text that is neither UTF-8 nor UTF-16, Windows-1252 where none is
    named. keep_marked: records of no aircraft (asterix.NO_AIRCRAFT) are in tracks and truth too. allow_loss: more than
    a tenth of the rows may be left out. whose: the track,
    address, callsign or code of the plots whose truth is the one path of the second recording, for receivers that know
    nothing of these. biases: of plots, by BIASES, to be subtracted."""

    format: Format | None = None
    site: Site | None = None
    sites: Mapping[str, Site] = field(default_factory=dict)
    antenna: Antenna | None = None
    tracks: tuple[str, ...] = ()
    zero: str | float = "first"
    truth: str | None = None
    owner: str = ""
    towards: bool = False
    columns: Mapping[str, str] = field(default_factory=dict)
    encoding: str = ""
    keep_marked: bool = False
    allow_loss: bool = False
    biases: Mapping[str, float] = field(default_factory=dict)

    @property
    def only_site(self) -> Site | None:
        """The site of the radar, if there is only one."""
        return next(iter(self.sites.values())) if len(self.sites) == 1 else self.site


def parse_zero(text: str) -> str | float:
    """The origin of t_s: "first", "midnight", or a date and time of ISO 8601 (UTC) as s from 1970."""
    if text in ("first", "midnight"):
        return text
    try:
        return utc_s(text)
    except ValueError:
        raise ConfigError(f"time-from: must be first, midnight or a date and time (ISO 8601), got {text!r}") from None


def parse_truth(text: str | None) -> tuple[str | None, str]:
    """The file and the owner of `[ID=]FILE`."""
    owner, sign, path = (text or "").rpartition("=")
    return (text, "") if not sign or os.path.exists(text or "") else (path, owner.strip())


def check_encoding(name: str) -> str:
    """An encoding of text by its name."""
    try:
        "".encode(name or "utf-8")
    except (LookupError, ValueError):
        raise ConfigError(
            f"encoding: must be an encoding such as cp1251, iso8859-2 or mac-roman, got {name!r}"
        ) from None
    return name


def parse_biases(texts: Sequence[str]) -> dict[str, float]:
    """Biases given by the user as `KEY=VALUE`, by BIASES."""
    biases, faults = {}, []
    for text in texts:
        key, _, number = text.partition("=")
        name = key.strip().replace("_deg", "_rad")
        try:
            value = float(number)
        except ValueError:
            value = math.nan
        value = math.radians(value) if key.strip().endswith("_deg") else value
        if name in biases or not abs(value) <= MAX_BIAS.get(name, -1.0):
            limits = "must be range_m=NUMBER, range_scale=…, bearing_deg=… or time_s=…, each once; their size is"
            faults.append(f"bias: {limits} {MAX_BIAS['range_m']:g} m, {MAX_BIAS['range_scale']:g}, 180 deg and "
                          f"{MAX_BIAS['time_s']:g} s at most; got {text!r}")  # fmt: skip
        biases[name] = value
    if faults:
        raise ConfigError(*faults)
    return biases


def parse_columns(texts: Sequence[str]) -> dict[str, str]:
    """Columns assigned by the user as `OURS=THEIRS`."""
    faults = [text for text in texts if "=" not in text]
    if faults:
        raise ConfigError(*(f"column: must be OURS=THEIRS, got {text!r}" for text in faults))
    return {ours.strip(): theirs.strip() for ours, _, theirs in (text.partition("=") for text in texts)}

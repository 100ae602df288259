"""Constants of nature, and the bands of radars and sonars. Nothing is imported that a list would wait for."""

from typing import Literal

STANDARD_GRAVITY_MPS2 = 9.80665  # ISO 80000-3
EARTH_RADIUS_M = 6.371e6  # of a sphere of the earth's volume: distances along it are within 0.6 %
LIGHT_MPS = 299_792_458.0
LETTERS_HZ = {  # IEEE Std 521-2019, radar-frequency letter bands: from, to
    "HF": (3e6, 30e6),
    "VHF": (30e6, 300e6),
    "UHF": (300e6, 1e9),
    "L": (1e9, 2e9),
    "S": (2e9, 4e9),
    "C": (4e9, 8e9),
    "X": (8e9, 12e9),
    "Ku": (12e9, 18e9),
    "K": (18e9, 27e9),
    "Ka": (27e9, 40e9),
    "V": (40e9, 75e9),
    "W": (75e9, 110e9),
    "mm": (110e9, 300e9),
}
EDGE = 0.02  # by how much a rounded wavelength may lie beyond the edge of its band
Band = Literal[
    "metre", "decimetre", "centimetre", "HF", "VHF", "UHF", "L", "S", "C", "X", "Ku", "K", "Ka", "V", "W", "mm"
]


def outside_band(band: str | None, wavelength_m: float) -> tuple[float, float] | None:
    """The shortest and the longest wavelength, m, of a band named by its letter, where another one lies outside."""
    if band is None or band not in LETTERS_HZ:
        return None
    longest, shortest = (LIGHT_MPS / f for f in LETTERS_HZ[band])
    if shortest * (1 - EDGE) <= wavelength_m <= longest * (1 + EDGE):
        return None
    return float(f"{shortest:.3g}"), float(f"{longest:.3g}")

"""A small folder of the user's own: configs/, scenarios/, and a way to see what is said of a wrong file."""

import copy
import textwrap

import pytest

from radarsim.api.configs import load
from radarsim.errors import ConfigError

GOOD = {
    "study": "range_doppler",
    "radar": {"wavelength_m": 0.15, "sigma_range_m": 250, "sigma_velocity_mps": 15, "scan_period_s": 10},
    "target": {"kind": "polynomial", "coefficients": [100e3, -250, 4]},
    "filters": [
        {"name": "r", "observes": ["range"], "manoeuvre_variance": 1e-3},
        {"name": "r+Vr", "observes": ["range", "velocity"], "manoeuvre_variance": 1e-3},
    ],
    "scans": 15,
    "realisations": 1000,
}


@pytest.fixture
def good():
    """A correct configuration, to be spoiled."""
    return copy.deepcopy(GOOD)


@pytest.fixture
def house(tmp_path, monkeypatch):
    """The working directory, empty; called with a path and text it writes a file there."""
    monkeypatch.chdir(tmp_path)

    def write(path: str, text: str | bytes):
        file = tmp_path / path
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(text if isinstance(text, bytes) else textwrap.dedent(text).lstrip("\n").encode())
        return path

    return write


@pytest.fixture
def said():
    """The lines that a wrong config is refused with; none if it is accepted."""

    def lines(source, *overrides):
        try:
            load(source, overrides)
        except ConfigError as error:
            found = list(error.lines)
        else:
            found = []
        assert all(line.isprintable() for line in found)
        return found

    return lines

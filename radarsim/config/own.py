"""`radarsim new`: a config of one's own, after another."""

import copy
import os
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

from radarsim.config import load
from radarsim.config.faults import Faults, one_line
from radarsim.config.lookup import RESERVED, is_reserved, is_stem
from radarsim.config.schema import Studies
from radarsim.config.starter import starter
from radarsim.errors import ConfigError


def new(
    name: str, like: str | os.PathLike[str], studies: Studies, values: Mapping[str, float] = MappingProxyType({})
) -> tuple[str, str]:
    """The name of the file of a new config, NAME with the suffix given or not, and its text, after a known config.

    values by dotted key take the place of those of the known config; a bare key stands for that key in every filter.
    Raises ConfigError for a name that a config cannot have.
    """
    name = name.removesuffix(".yaml")
    if is_reserved(name):
        raise ConfigError(f"{name}: {RESERVED}")
    if not is_stem(name):
        raise ConfigError(
            f"{one_line(name)}: must be a plain name of letters, digits and _ + = - . without folder or suffix, that "
            "begins with a letter, a digit or _"
        )
    experiment = load.load(like, (), studies)
    faults = Faults()
    document = load.read(Path(experiment.path or like), faults)
    faults.raise_if_any()
    assert document is not None  # a file that cannot be read is a fault
    data = copy.deepcopy(dict(document.data))
    for key, value in values.items():
        _put(data, key, value)
    return f"{name}.yaml", starter(data, studies.keys(experiment.study), name, experiment.stem)


def _put(data: dict[str, Any], key: str, value: float) -> None:
    """Put a number in the place of a dotted key, or of a bare one in every filter; of an angle, in rad, also in the
    place of its twin in degrees."""
    *path, last = key.split(".")
    places: list[Any] = data.get("filters", []) if not path else [data]
    for place in places:
        for step in path:
            place = place[int(step)] if isinstance(place, list) else place.setdefault(step, {})
        if last.endswith("_rad"):
            place.pop(f"{last.removesuffix('rad')}deg", None)
        place[last] = value

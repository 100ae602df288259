"""Configs, read with all available studies."""

import os
from collections.abc import Iterable, Mapping
from functools import cache
from pathlib import Path
from types import MappingProxyType
from typing import Any

from radarsim.config import load as reading
from radarsim.config import lookup
from radarsim.config.experiment import Experiment
from radarsim.config.fields import Model
from radarsim.errors import ConfigError
from radarsim.report import files
from radarsim.studies import registry

lookup.further_folders = registry.folders


def load(source: str | os.PathLike[str] | Mapping[str, Any], overrides: Iterable[str] = ()) -> Experiment:
    """The experiment that a config describes, all of it checked.

    source is a path, the stem of a config (here, in ./configs, or shipped), or a mapping as YAML would give it;
    overrides are texts `dotted.key=value`, the value in YAML. Raises ConfigError, one line for each fault of the whole.
    """
    return reading.load(source, overrides, registry)


@cache
def shipped(stem: str) -> tuple[Model, ...] | None:
    """The checked keys of the cases of a shipped config; None where no config of that stem is shipped.

    Never of a file of that name that the user has: claims are judged by what is shipped.
    """
    for folder in (lookup.SHIPPED, *registry.folders()):
        file = folder / "configs" / f"{stem}.yaml"
        if stem and file.is_file():
            return tuple(case.spec for case in load(file).cases)
    return None


def new(
    name: str,
    like: str | os.PathLike[str],
    folder: str | os.PathLike[str] = ".",
    values: Mapping[str, float] = MappingProxyType({}),
) -> Path:
    """Write folder/NAME.yaml, the suffix given or not, after a known config with some values changed; its path.

    Raises ConfigError where it is there already, StoreError where it cannot be written.
    """
    from radarsim.config import own

    name, text = own.new(name, like, registry, values)
    path = Path(folder) / name
    try:
        files.create(path, text.encode())
    except FileExistsError:
        raise ConfigError(f"{path}: is there already and is never overwritten; choose another name") from None
    return path


def schema_json() -> str:
    """JSON Schema of the YAML, of all studies, as text."""
    from radarsim.config import json_schema  # pydantic's part takes a tenth of a second to load

    return json_schema.schema_json(registry)

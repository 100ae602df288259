"""New configs made from known ones, with all studies that are installed."""

import os
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType

from radarsim.api import fitted_target
from radarsim.config import new_config
from radarsim.config.overrides import Overrides
from radarsim.errors import ConfigError
from radarsim.report import atomic_files
from radarsim.studies import registry

EDITORS, SCHEMA = "# yaml-language-server: $schema=", "schema.json"
FILE_EXISTS = "{path}: already exists and is never overwritten; choose another name"


def write_new_config(
    name: str,
    like: str | os.PathLike[str],
    folder: str | os.PathLike[str] = ".",
    values: Mapping[str, float] = MappingProxyType({}),
    overrides: Overrides = (),
    target: str | None = None,
) -> Path:
    """Write folder/NAME.yaml, with or without suffix given, from a known config with some values changed; its path.

    The config is taken with its overrides, which it can have if it has one case. A target by a name of
    `fitted_target.TARGETS` comes with the scans and D_M that fit it and the radar.

    Where the folder holds a schema.json, the first line points editors to it. Raises ConfigError where the config
    exists already, StoreError where it cannot be written."""
    fitted = None if target is None else fitted_target.fitted_parts(like, target)
    name, text = new_config.new_config(name, like, registry, values, overrides, fitted)
    path = Path(folder) / name
    if path.with_name(SCHEMA).is_file():
        text = f"{EDITORS}{SCHEMA}\n{text}"
    try:
        atomic_files.create(path, text.encode())
    except FileExistsError:
        raise ConfigError(FILE_EXISTS.format(path=path)) from None
    return path


def check_writable(path: str, like: str | os.PathLike[str], overrides: Overrides) -> None:
    """Check, before a long search, that a config with these overrides can be written there. Raises ConfigError."""
    new_config.new_config(os.path.basename(path), like, registry, {}, overrides)
    if os.path.lexists(path):
        raise ConfigError(FILE_EXISTS.format(path=path))
    if not os.path.isdir(os.path.dirname(path) or "."):
        raise ConfigError(f"{path}: cannot be written: there is no such folder")

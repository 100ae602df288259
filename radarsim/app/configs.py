"""Configs, read with all studies at hand."""

import os
from collections.abc import Iterable, Mapping
from pathlib import Path

from radarsim.config import json_schema, lookup, own
from radarsim.config import load as reading
from radarsim.config.experiment import Experiment
from radarsim.studies import registry

lookup.further_folders = registry.folders


def load(source: str | os.PathLike | Mapping, overrides: Iterable[str] = ()) -> Experiment:
    """The experiment that a config describes, all of it checked.

    source is a path, the stem of a config (here, in ./configs, or shipped), or a mapping as YAML would give it;
    overrides are texts `dotted.key=value`, the value in YAML. Raises ConfigError, one line for each fault of the whole.
    """
    return reading.load(source, overrides, registry)


def new(name: str, like: str | os.PathLike, folder: str | os.PathLike = ".") -> Path:
    """Write folder/NAME.yaml, the suffix given or not, after a known config; its path.

    Raises ConfigError where it is there already.
    """
    return own.new(name, like, registry, folder)


def schema_json() -> str:
    """JSON Schema of the YAML, of all studies, as text."""
    return json_schema.schema_json(registry)

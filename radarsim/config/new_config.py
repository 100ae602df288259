"""`radarsim new`: a config made from a known one, with values replaced."""

import copy
import os
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

from radarsim.config.common_keys import Studies
from radarsim.config.error_list import ErrorList
from radarsim.config.experiment import Experiment
from radarsim.config.find_files import RESERVED, config_file, is_reserved, is_stem
from radarsim.config.load import load
from radarsim.config.overrides import Overrides
from radarsim.config.starter import starter_text
from radarsim.config.value_text import one_line
from radarsim.config.yaml_io import read_document
from radarsim.errors import ConfigError, argument


class FittedParts(NamedTuple):
    """What of a config fits a target: keys as a whole, numbers as `new_config` takes them, and the reason for each
    value, by key as it is indented in the file."""

    parts: dict[str, Any]
    values: Mapping[str, float]
    reasons: Mapping[str, str]


def new_config(
    name: str,
    like: str | os.PathLike[str],
    studies: Studies,
    values: Mapping[str, float] = MappingProxyType({}),
    overrides: Overrides = (),
    fitted: FittedParts | None = None,
) -> tuple[str, str]:
    """The file name of a new config, from NAME with or without suffix, and its text, made from a known config.

    values by dotted key replace those of the known config with its overrides; a bare key stands for that key in every
    filter; keys that are fitted to a target replace the known ones as a whole. Raises ConfigError for an impossible
    name, and for overrides of a config with several cases."""
    name = name.removesuffix(".yaml")
    if is_reserved(name):
        raise ConfigError(f"{name}: {RESERVED}")
    if not is_stem(name):
        raise ConfigError(
            f"{one_line(name)}: must be a plain name of letters, digits and _ + = - . without folder or suffix, that "
            "begins with a letter, a digit or _"
        )
    experiment = load(like, overrides, studies)
    if overrides and len(experiment.cases) > 1:
        where = argument("overrides", "--set")
        raise ConfigError(
            f"{where}: a config of {len(experiment.cases)} cases is written without: put it into the config"
        )
    values = {**values, **(fitted.values if fitted else {})}
    data = _data_for_new_config(experiment, Path(experiment.path or like), values, has_overrides=bool(overrides))
    if fitted is not None:
        data = {key: value for key, value in data.items() if key != "duration_s"} | fitted.parts
    for key, value in values.items():
        _set_number(data, key, value)
    return f"{name}.yaml", starter_text(
        data, studies.keys(experiment.study), name, experiment.stem, fitted.reasons if fitted else {}
    )


def _data_for_new_config(
    experiment: Experiment, file: Path, values: Mapping[str, float], has_overrides: bool
) -> dict[str, Any]:
    """The data of a config as its file has it, or of its only case as a whole where the file alone does not suffice."""
    faults = ErrorList()
    document = read_document(file, faults)
    faults.raise_if_any()
    assert document is not None  # a file that cannot be read is an error
    data = copy.deepcopy(dict(document.data))
    # Includes that lie beside the known config are not found from here, and values have their places in the whole.
    loses_includes = any(_included_file(stem) != _included_file(stem, file) for stem in data.get("include", ()))
    needs_whole_case = "include" in data and (values or loses_includes)
    if (has_overrides or needs_whole_case) and len(experiment.cases) == 1:
        (case,) = experiment.cases
        return {"study": case.study, **case.keys, "realisations": case.realisations, "seed": case.seed}
    if "include" in data:
        for key in {key.partition(".")[0] if "." in key else "filters" for key in values}:
            first_value, *other_values = (case.keys[key] for case in experiment.cases)
            if any(value != first_value for value in other_values):
                raise ConfigError(f"{experiment.stem}: its cases differ in {key}: begin from a config that it includes")
            data[key] = copy.deepcopy(first_value)
    return data


def _included_file(name: str, including_file: Path | None = None) -> Path | None:
    """The file that a stem under `include` means, in a config or from the working directory."""
    file = config_file(name, including_file)
    return file and file.resolve()


def _set_number(data: dict[str, Any], key: str, value: float) -> None:
    """Set a number at a dotted key, or at a bare key in every filter; an angle in radians removes that in degrees."""
    *path, last_step = key.split(".")
    holders: list[Any] = data.get("filters", []) if not path else [data]
    for holder in holders:
        for step in path:
            holder = holder[int(step)] if isinstance(holder, list) else holder.setdefault(step, {})
        if last_step.endswith("_rad"):
            holder.pop(f"{last_step.removesuffix('rad')}deg", None)
        holder[int(last_step) if isinstance(holder, list) else last_step] = value

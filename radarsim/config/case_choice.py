"""How to choose one case of an experiment that has several: the text for an error message."""

import json
import shlex
from pathlib import Path

from radarsim.config import find_files
from radarsim.config.experiment import Experiment, swept_value_text
from radarsim.errors import argument

MAX_NAMES = 12  # configs or values that a message lists


def case_choice(experiment: Experiment, command: str) -> str:
    """The cases to choose from, and the command for the first: configs put together, or swept values.

    {} in the command stands for the config."""
    stems = list(dict.fromkeys(case.stem for case in experiment.cases))
    if len(stems) > 1 and experiment.changes_included:
        return f"choose one of {list_names(stems)}: {_command(command, experiment.path or '', f'include=[{stems[0]}]')}"
    if len(stems) > 1:
        path = str(Path(experiment.path or "").parent / f"{stems[0]}.yaml")
        return f"choose one of {list_names(stems)}: {_command(command, path)}"
    return _swept_choice(experiment, command)


def _swept_choice(experiment: Experiment, command: str) -> str:
    """The same for the cases of a sweep."""
    values: dict[str, list] = {}
    for case in experiment.cases:
        for key, value in case.swept_values:
            values.setdefault(key, []).append(value)
    distinct = {
        key: list({swept_value_text(value): value for value in swept}.values()) for key, swept in values.items()
    }
    lists = "; ".join(
        f"{key} = {list_names([swept_value_text(value) for value in swept])}" for key, swept in distinct.items()
    )
    settings = [f"sweep.{key}={json.dumps(swept[:1], ensure_ascii=False)}" for key, swept in distinct.items()]
    return f"choose of {lists}: {_command(command, experiment.path or experiment.stem, *settings)}"


def _command(command: str, path: str, *settings: str) -> str:
    """A command on a config with settings, or the Python arguments; the config by its stem where that finds it."""
    file = Path(path)
    shipped_file = find_files.config_file(file.stem)
    name = path if file.is_file() and not (shipped_file and shipped_file.samefile(file)) else file.stem
    options = "".join(f" --set {shlex.quote(setting)}" for setting in settings)
    overrides = f", overrides={list(settings)}" if settings else ""
    return argument(f"{name!r}{overrides}", f"{command.format(shlex.quote(name))}{options}")


def list_names(names: list[str]) -> str:
    """A list of names; if it is very long, its first ones."""
    return ", ".join([*names[:MAX_NAMES], *(["…"] if len(names) > MAX_NAMES else [])])

"""A stored result by its folder alone: run.json, the config that it was computed from, and its tables."""

import os
from functools import cached_property
from pathlib import Path

from radarsim.api.stored_cases import cases_of_result, stored_experiment
from radarsim.config.complete_config import CONFIG_FILE
from radarsim.config.experiment import Case, Experiment
from radarsim.config.find_files import is_stem
from radarsim.errors import ConfigError
from radarsim.report.stored_tables import RECORD, StoredFiles, find_files, is_table, no_result


class ResultFolder:
    """A result as its folder holds it: `files` are its record, tables and config, all of one run."""

    def __init__(self, files: StoredFiles):
        self.files, self.folder, self.record = files, files.folder, files.record

    @cached_property
    def experiment(self) -> Experiment | None:
        """The experiment with the realisations of the result; None where the folder has no config that still reads."""
        return stored_experiment(self.record, self.folder)

    @cached_property
    def cases(self) -> dict[str, Case]:
        """The cases by name, as far as they read as configs."""
        return dict(cases_of_result(self.record, self.folder))

    @property
    def config(self) -> str:
        """The text of config.yaml; empty where there is none that the run wrote."""
        return self.files.contents.get(CONFIG_FILE, b"").decode("utf-8", "replace")


def find_result(path: str | os.PathLike[str]) -> ResultFolder | None:
    """The result in a folder; None where there is no run.json. Raises StoreError where that is damaged."""
    files = find_files(Path(path), lambda name: is_table(name) or name == CONFIG_FILE)
    return None if files is None else ResultFolder(files)


def result_places(source: str | os.PathLike[str], out: str | os.PathLike[str]) -> list[Path]:
    """The folders in which a result may be: of a name that in `out`, then one here; of a path that alone."""
    name = os.fspath(source)
    return [Path(out) / name, Path(name)] if is_stem(name) else [Path(name)]


def result_of(source: str | os.PathLike[str], out: str | os.PathLike[str]) -> ResultFolder:
    """The result in a folder, or that of a config's name in `out`. Raises ConfigError where there is none."""
    for folder in result_places(source, out):
        if (found := find_result(folder)) is not None:
            return found
    places = result_places(source, out)
    if len(places) == 1:
        raise ConfigError(no_result(places[0]))
    raise ConfigError(f"{os.fspath(source)}: no result: there is no {RECORD} in {', nor in '.join(map(str, places))}")

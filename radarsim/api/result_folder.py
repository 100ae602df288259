"""A stored result by its folder alone: run.json, the config that it was computed from, and its tables."""

import os
from collections.abc import Mapping
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from radarsim.api import stored_tables
from radarsim.api.stored_cases import cases_of_result, stored_experiment
from radarsim.config.complete_config import CONFIG_FILE
from radarsim.config.experiment import Case, Experiment
from radarsim.config.find_files import is_stem
from radarsim.errors import ConfigError

if TYPE_CHECKING:
    import pandas as pd


class ResultFolder:
    """The folder of a result and its record, the content of run.json."""

    def __init__(self, folder: Path, record: Mapping[str, Any]):
        self.folder, self.record = folder, record

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
        """The text of config.yaml; empty where there is none."""
        return (stored_tables.read_content(self.folder / CONFIG_FILE) or b"").decode("utf-8", "replace")

    @property
    def counts(self) -> dict[str, int]:
        """The realisations of each case."""
        return {name: int(case["done"]) for name, case in self.record["cases"].items()}

    @property
    def table_names(self) -> tuple[str, ...]:
        """The names of the tables; a data file of the config is none."""
        others = self.record.get("data_files", ())
        names = (name for name in self.record["outputs"] if name.endswith(".csv") and "/" not in name)
        return tuple(name.removesuffix(".csv") for name in names if name not in others)

    def table(self, name: str) -> "pd.DataFrame | None":
        """A table; None where the result has none of this name. Raises StoreError where it was altered."""
        return stored_tables.read_table(self.folder, name, self.record["outputs"], whole_numbers=True)


def find_result(path: str | os.PathLike[str]) -> ResultFolder | None:
    """The result in a folder; None where there is no run.json. Raises StoreError where that is damaged."""
    record = stored_tables.read_record(Path(path))
    return None if record is None else ResultFolder(Path(path), record)


def result_places(source: str | os.PathLike[str], out: str | os.PathLike[str]) -> list[Path]:
    """The folders in which a result may be: of a name that in `out`, then one here; of a path that alone."""
    name = os.fspath(source)
    return [Path(out) / name, Path(name)] if is_stem(name) else [Path(name)]


def result_of(source: str | os.PathLike[str], out: str | os.PathLike[str]) -> ResultFolder:
    """The result in a folder, or that of a config's name in `out`. Raises ConfigError where there is none."""
    for folder in result_places(source, out):
        if (found := find_result(folder)) is not None:
            return found
    places = ", nor in ".join(map(str, result_places(source, out)))
    raise ConfigError(f"{os.fspath(source)}: no result: there is no run.json in {places}")

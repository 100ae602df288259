"""A stored result by its folder alone: run.json, the config that it was computed from, and its tables."""

import os
from functools import cached_property
from pathlib import Path

from radarsim.api import configs
from radarsim.api.stored_cases import cases_of_result, stored_experiment
from radarsim.config.complete_config import CONFIG_FILE
from radarsim.config.experiment import Case, Experiment
from radarsim.config.find_files import is_stem
from radarsim.errors import ConfigError, RadarsimError
from radarsim.language.translate import join_names, tr
from radarsim.report import provenance
from radarsim.report.atomic_files import same_file
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


def choose_result(
    source: str | os.PathLike[str], out: str | os.PathLike[str], names_config: bool = True
) -> tuple[ResultFolder | None, str]:
    """The result that a source means: of a name that in `out`, else one here; of a path that alone. And a note where
    the name could mean something else, too; names_config: also a config of other settings."""
    for place in result_places(source, out):
        if (result := find_result(place)) is not None:
            return result, _choice_note(os.fspath(source), result, names_config)
    return None, ""


def _choice_note(name: str, chosen: ResultFolder, names_config: bool = True) -> str:
    """What else a name could mean: the result in a folder here, or a config of other settings than the chosen result;
    empty if nothing."""
    others = []
    here = Path(name)
    if is_stem(name) and (here / RECORD).exists() and not same_file(here, chosen.folder):
        others.append(f"./{name}")
    config = configs.config_path(name) if names_config and is_stem(name) else None
    if config is not None and not _is_of_config(chosen, config):
        shipped = configs.shipped_file(name)
        is_shipped = shipped is not None and same_file(shipped, config)
        others.append(tr("the shipped config") if is_shipped else str(config))
    if not others:
        return ""
    return tr("{name} is the result in {folder}, not {others}", name=name, folder=str(chosen.folder),
              others=join_names(others))  # fmt: skip


def _is_of_config(result: ResultFolder, config: Path) -> bool:
    """Whether a result has the settings of a config; of one that cannot be read it has others."""
    try:
        return provenance.is_same_config(result.record["resolved"], configs.load(config).resolved)
    except RadarsimError:
        return False


def result_of(source: str | os.PathLike[str], out: str | os.PathLike[str]) -> tuple[ResultFolder, str]:
    """As `choose_result`. Raises ConfigError where there is no result."""
    result, note = choose_result(source, out)
    if result is not None:
        return result, note
    places = result_places(source, out)
    if len(places) == 1:
        raise ConfigError(no_result(places[0]))
    raise ConfigError(f"{os.fspath(source)}: no result: there is no {RECORD} in {', nor in '.join(map(str, places))}")


def config_to_report(name: str, out: str | os.PathLike[str]) -> tuple[str, str]:
    """The config of which `radarsim report NAME` writes the result, and a note as in `choose_result`: that which the
    result of this name in `out` keeps, where it is another than the config of this name."""
    result = find_result(Path(out) / name) if is_stem(name) else None
    if result is None or result.experiment is None or result.record.get("judged"):
        return name, ""
    config = configs.config_path(name)
    if config is not None and _is_of_config(result, config):
        return name, ""
    return str(result.folder), _choice_note(name, result)

"""From a config to its checked experiment."""

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from radarsim.config.common_keys import Studies
from radarsim.config.complete_config import CONFIG_FILE
from radarsim.config.document import Document
from radarsim.config.drafts import changes_included
from radarsim.config.error_list import ErrorList, Origin
from radarsim.config.expand_cases import Expander
from radarsim.config.experiment import Experiment
from radarsim.config.find_files import (
    RESERVED,
    available_stems,
    config_file,
    is_reserved,
    is_stem,
    meant_name,
    nearest_names,
)
from radarsim.config.overrides import Overrides, override_texts, parse_setting
from radarsim.config.scalars import from_python
from radarsim.config.yaml_io import read_document
from radarsim.errors import UnknownConfig


def load(source: str | os.PathLike[str] | Mapping[str, Any], overrides: Overrides, studies: Studies) -> Experiment:
    """The experiment that a config describes, fully checked.

    source is a path, also of a result's folder, the stem of a config (here, in ./configs, or shipped), or a mapping
    like the YAML; for overrides see `override_texts`. Raises ConfigError, one line for each fault."""
    faults = ErrorList()
    settings = [setting for text in override_texts(overrides) if (setting := parse_setting(text, faults))]
    document: Document | None = None
    if isinstance(source, Mapping):
        document = _from_mapping(source, faults)
    elif isinstance(source, str | bytes | os.PathLike):
        document = _find_config(source, studies, faults)
    else:
        faults.add(Origin("config"), (), f"must be a path, a name or a mapping, got {repr(source)[:60]}")
    experiment = None
    if document is not None:
        given_path = Path() if isinstance(source, Mapping) else Path(os.fsdecode(source))
        is_path = not isinstance(source, Mapping) and document.file in (given_path, given_path / CONFIG_FILE)
        path = document.file if is_path else None
        experiment = Expander(read_document, settings, faults, studies, path).experiment(document)
    if document is not None and changes_included(document):
        faults.name_overlaying_file(document.origin(()).source)
    faults.raise_if_any()
    assert experiment is not None  # without one there is a fault
    return experiment


def _without_config(folder: Path) -> str:
    """Why a folder is not run; of a result of an earlier version of the program, what else is done with it."""
    if not (folder / "run.json").is_file():
        return f"is a directory without {CONFIG_FILE}, so no result"
    return (
        f"is a result without {CONFIG_FILE}, as earlier versions wrote: it cannot be run; run the command in its "
        "report.html, or `radarsim doctor` with --recompute"
    )


def _is_result(name: str) -> bool:
    """Whether a name is that of a folder of results."""
    return os.path.isfile(os.path.join(name, CONFIG_FILE))


def _from_mapping(source: Mapping[str, Any], faults: ErrorList) -> Document:
    origin = Origin("config")
    return Document(from_python(source, (), origin, faults), "config", None, {(): origin})


def _find_config(source: str | bytes | os.PathLike[str], studies: Studies, faults: ErrorList) -> Document | None:
    """The config that the user gave by its path or stem; None, with an error added, if there is none."""
    name = os.fsdecode(source)
    # A file without suffix and with a config's name does not hide it.
    config_path = config_file(name) if is_stem(name) else None
    is_path = os.path.isfile(name) and (bool(Path(name).suffix) or config_path is None)
    file = None if is_path else config_path
    if file is None and is_stem(name) and not is_path and not Path(name).suffix and not _is_result(name):
        if reasons := studies.reasons_for_missing_config(name):
            faults.add(Origin(name), (), f"no such config: {'; '.join(reasons)}")
            return None
        known = available_stems("configs")
        raise UnknownConfig(name, meant_name(name, known), nearest_names(name, known), len(known))
    file = file or Path(name)
    if os.path.isdir(file):
        file = file / CONFIG_FILE
        if not file.is_file():
            faults.add(Origin(str(file.parent)), (), _without_config(file.parent))
            return None
    if file.suffix.lower() == ".zip":
        faults.add(Origin(name), (), "is an archive: `radarsim check` verifies it, and `radarsim run` takes it")
        return None
    if file.name == "run.json":
        faults.add(Origin(name), (), f"is the record of a result, and no config; its folder is {file.parent}")
        return None
    document = read_document(file, faults)
    if document and not is_stem(file.stem):  # it names the folder of results
        faults.add(
            Origin(name), (), "a config's name must be of letters, digits and _ + = - . and not begin with a dot"
        )
        return None
    if document and is_reserved(file.stem):
        faults.add(Origin(name), (), RESERVED)
        return None
    return document

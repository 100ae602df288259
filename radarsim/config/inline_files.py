"""Put the content of scenario files, and the paths of data files, in the place of their names."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path as FilePath

from radarsim.config.document import Document
from radarsim.config.error_list import ErrorList
from radarsim.config.find_files import available_stems, is_stem, known_names_hint, scenario_file
from radarsim.config.marks import DataFile, Scenario
from radarsim.config.model import Model
from radarsim.config.study_keys import StudyKeys
from radarsim.config.validate import model_at, models_in
from radarsim.config.value_text import KeyPath, quoted_value

ReadDocument = Callable[[FilePath, ErrorList], Document | None]


@dataclass(frozen=True)
class ConfigFiles:
    """The files of an experiment. read: see `Expander`; scenarios: those that its config itself defines, by stem."""

    read: ReadDocument
    scenarios: Mapping[str, Document] = field(default_factory=dict)


def named_scenarios(document: Document, model: type[StudyKeys]) -> dict[str, str]:
    """The keys at which a document has the stem of a scenario, with the stems."""
    keys = [
        name for name, info in model.model_fields.items() if any(isinstance(mark, Scenario) for mark in info.metadata)
    ]
    return {key: document.data[key] for key in keys if isinstance(document.data.get(key), str)}


def inline_scenarios(
    document: Document, model: type[StudyKeys], files: ConfigFiles, faults: ErrorList, only_key: str | None = None
) -> Document:
    """Replace the stems of scenarios by what the config defines under them, or by the content of their files."""
    for key, stem in named_scenarios(document, model).items():
        origin, path = document.origin((key,)), (key,)
        if only_key not in (None, key) or faults.is_unusable(origin, path):
            continue
        if stem in files.scenarios:
            document = document.graft_document(path, files.scenarios[stem])
            continue
        file = scenario_file(stem, document.file) if is_stem(stem) else None
        if not is_stem(stem):
            faults.mark_unusable(origin, path, "must be the stem of a scenario, without folder or suffix", stem)
        elif file is None:
            known_stems = available_stems("scenarios")
            hint = known_names_hint(stem, known_stems, "scenarios")
            faults.mark_unusable(origin, path, f"no such scenario{hint}", stem)
        elif scenario := files.read(file, faults):
            document = document.graft_document(path, scenario)
        else:
            faults.mark_unusable(origin, path, "the scenario cannot be read", stem)
    return document


def resolve_data_files(document: Document, model: type[StudyKeys], faults: ErrorList) -> Document:
    """Replace the name of each data file, which is relative to the folder of its YAML file, by a readable path."""
    for path, file in data_files(document, model):
        if file.is_file():
            document = document.with_data(path, str(file))
        else:
            faults.mark_unusable(document.origin(path), path, f"no such file: {quoted_value(str(file))}")
    return document


def data_files(document: Document, model: type[StudyKeys]) -> list[tuple[KeyPath, FilePath]]:
    """Where a document names data files, and their paths, whether they exist or not."""
    files = []
    for path, value in _text_values(document.data, ()) if _has_data_files(model) else ():
        holder = model_at(model, document.data, path[:-1])
        info = holder.model_fields.get(str(path[-1])) if holder else None
        if info is not None and any(isinstance(mark, DataFile) for mark in info.metadata):
            origin = document.origin(path)
            files.append((path, (FilePath(origin.source).parent if origin.line else FilePath()) / value))
    return files


@cache
def _has_data_files(model: type[Model]) -> bool:
    """Whether any field of a schema, or of those within it, names a file of data."""
    fields = model.model_fields.values()
    has_own = any(isinstance(mark, DataFile) for info in fields for mark in info.metadata)
    return has_own or any(_has_data_files(inner) for info in fields for inner in models_in(info.annotation))


def _text_values(data: object, path: KeyPath) -> Iterator[tuple[KeyPath, str]]:
    """All values that are text under a key, with their paths."""
    if isinstance(data, dict | list):
        for step, value in data.items() if isinstance(data, dict) else enumerate(data):
            yield from _text_values(value, (*path, step))
    elif isinstance(data, str) and path and isinstance(path[-1], str):
        yield path, data

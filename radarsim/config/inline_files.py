"""Put the content of scenario files, and the paths of data files, in the place of their names."""

from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path as FilePath

from radarsim.config.document import Document
from radarsim.config.error_list import ErrorList
from radarsim.config.error_text import KeyPath, quoted_value
from radarsim.config.find_files import available_stems, did_you_mean, is_stem, scenario_file
from radarsim.config.marks import DataFile, Scenario
from radarsim.config.model import Model
from radarsim.config.study_keys import StudyKeys
from radarsim.config.validate import model_at, models_in

ReadDocument = Callable[[FilePath, ErrorList], Document | None]


def inline_scenarios(
    document: Document, model: type[StudyKeys], read: ReadDocument, faults: ErrorList, only_key: str | None = None
) -> Document:
    """Replace the stems of scenarios by the content of their files."""
    for field, info in model.model_fields.items():
        stem = document.data.get(field)
        is_wanted = only_key in (None, field) and any(isinstance(mark, Scenario) for mark in info.metadata)
        if not is_wanted or not isinstance(stem, str):
            continue
        origin, path = document.origin((field,)), (field,)
        if faults.is_unusable(origin, path):
            continue
        file = scenario_file(stem, document.file) if is_stem(stem) else None
        if not is_stem(stem):
            faults.mark_unusable(origin, path, "must be the stem of a scenario, without folder or suffix", stem)
        elif file is None:
            known_stems = available_stems("scenarios")
            hint = did_you_mean(stem, known_stems) or f"; there are: {', '.join(known_stems)}"
            faults.mark_unusable(origin, path, f"no such scenario{hint}", stem)
        elif scenario := read(file, faults):
            document = document.graft_document(path, scenario)
        else:
            faults.mark_unusable(origin, path, "the scenario cannot be read", stem)
    return document


def resolve_data_files(document: Document, model: type[StudyKeys], faults: ErrorList) -> Document:
    """Replace the name of each data file, which is relative to the folder of its YAML file, by a readable path."""
    for path, value in list(_text_values(document.data, ())) if _has_data_files(model) else ():
        holder = model_at(model, document.data, path[:-1])
        info = holder.model_fields.get(str(path[-1])) if holder else None
        if info is None or not any(isinstance(mark, DataFile) for mark in info.metadata):
            continue
        origin = document.origin(path)
        file = (FilePath(origin.source).parent if origin.line else FilePath()) / value
        if file.is_file():
            document = document.with_data(path, str(file))
        else:
            faults.mark_unusable(origin, path, f"no such file: {quoted_value(str(file))}")
    return document


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

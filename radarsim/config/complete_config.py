"""A config written out in full: scenarios, included configs and overrides in their places, values as written.

A result keeps this text as config.yaml, from which it can be computed again on another machine."""

import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from radarsim.config.commented_yaml import CommentedYaml
from radarsim.config.common_keys import CommonKeys
from radarsim.config.document import Document
from radarsim.config.error_list import Origin
from radarsim.config.experiment import Case, Experiment
from radarsim.config.identity import portable_filter
from radarsim.config.inline_files import data_files
from radarsim.config.model import Model
from radarsim.config.study_keys import StudyKeys
from radarsim.config.user_filter_keys import CODE_KEY, is_code
from radarsim.config.yaml_text import exact_yaml

CONFIG_FILE = "config.yaml"
INPUTS = "inputs"  # folder for data files whose own place in the folder is taken_paths, or lies outside it
DESCRIBED_KEYS = ("realisations", "seed")  # common keys whose description stands beside them
SOURCE_DIGITS = 16  # of the hash of a user filter's code

Content = dict[str, Any]


class DataPath(str):
    """The name of a data file, as written; `path` leads to it."""

    path: str

    def __new__(cls, written: str, path: str | Path) -> "DataPath":
        """The name of the file at a path."""
        name = super().__new__(cls, written)
        name.path = os.path.abspath(path)
        return name


class CompleteConfig(NamedTuple):
    """The text of a config, and the data files that it names, by their paths beside it."""

    text: str
    files: dict[str, bytes]


def with_data_paths(document: Document, model: type[StudyKeys]) -> Document:
    """The document with a `DataPath` in place of the name of each data file."""
    for path, file in data_files(document, model):
        document = document.with_data(path, DataPath(str(document.get(path)), file))
    return document


def sweep_with_data_paths(document: Document, used_files: Mapping[tuple[str, str], Path]) -> Content:
    """The `sweep` of a config with a `DataPath` for each of the used files, given by folder and name as written."""

    def marked(value: Any, origin: Origin) -> Any:
        if isinstance(value, dict):
            return {key: marked(item, origin) for key, item in value.items()}
        if isinstance(value, list):
            return [marked(item, origin) for item in value]
        file = used_files.get((folder_of(origin), value)) if isinstance(value, str) else None
        return DataPath(value, file) if file is not None else value

    sweep: Content = document.data["sweep"]
    return {
        key: [marked(value, document.origin(("sweep", key, n))) for n, value in enumerate(values)]
        for key, values in sweep.items()
    }


def folder_of(origin: Origin) -> str:
    """The folder to which the names of data files from a place are relative."""
    return str(Path(origin.source).parent) if origin.line else ""


def rename_configs(content: Content, stem: str | Callable[[str], str]) -> Content:
    """The content with other names for its innermost configs, of which their cases are called."""
    if "include" in content:
        return {**content, "include": [rename_configs(inner, stem) for inner in content["include"]]}
    return {**content, "name": stem(content["name"]) if callable(stem) else stem}


def complete_config(
    experiment: Experiment, done: Mapping[str, int], like: str, model: type[StudyKeys], taken_paths: Iterable[str] = ()
) -> CompleteConfig | None:
    """The config of an experiment, complete.

    done: the realisations of each case in the result; like: the shipped config of which it is a version, if any; model:
    the keys of the study; taken_paths: those that data files must not have. None where the experiment has no content
    that can be written out. Raises OSError where a data file cannot be read."""
    if experiment.content is None:
        return None
    content = {"name": experiment.stem, **({"like": like} if like else {}), **experiment.content}
    content = _with_realisations(content, experiment, done)
    names = _file_names(content, taken_paths)
    content = _portable(content, names, experiment.cases)
    files = {name: Path(path).read_bytes() for path, name in names.items()}
    filters = (member for case in experiment.cases for member in case.user_filters)
    unnamed_filters = list(dict.fromkeys(_one_line(member.name) for member in filters if not member.written))
    return CompleteConfig(_text(content, model, unnamed_filters), files)


def _with_realisations(content: Content, experiment: Experiment, done: Mapping[str, int]) -> Content:
    """The content with the realisations that were done, each case by its name where they differ."""
    counts = {case.name: done.get(case.name, 0) for case in experiment.cases}
    if all(case.realisations == counts[case.name] for case in experiment.cases):
        return content
    if len({*counts.values()}) == 1:
        return {**content, "realisations": next(iter(counts.values()))}
    return {**content, "realisations": {name: count for name, count in counts.items() if count}}


def _data_paths(value: object) -> Iterator[DataPath]:
    """The data files that plain data name."""
    if isinstance(value, DataPath):
        yield value
    elif isinstance(value, dict | list):
        for item in value.values() if isinstance(value, dict) else value:
            yield from _data_paths(item)


def _file_names(content: Content, taken_paths: Iterable[str]) -> dict[str, str]:
    """For the path of each data file the name that it has beside the config: as written, where that is free.

    The name of a swept file is part of the names of cases, so it changes only where it must."""
    names: dict[str, str] = {}
    used_names = {name.casefold() for name in (*taken_paths, CONFIG_FILE)}
    for data_path in _data_paths(content):
        if data_path.path in names:
            continue
        written_path = Path(data_path)
        inside = not written_path.is_absolute() and ".." not in written_path.parts
        candidates = [written_path.as_posix()] if inside else []
        numbered = (f"{INPUTS}/{n}/{written_path.name}" for n in range(2, len(used_names) + 3))
        candidates += [f"{INPUTS}/{written_path.name}", *numbered]
        name = next(name for name in candidates if name.casefold() not in used_names)
        names[data_path.path] = name
        used_names.add(name.casefold())
    return names


def _portable(value: Any, file_names: Mapping[str, str], cases: Iterable[Case]) -> Any:
    """Content without paths of this machine: data files by their names beside the config, user filters by the hash of
    their code."""
    if isinstance(value, DataPath):
        return file_names[value.path]
    if isinstance(value, list):
        return [_portable(item, file_names, cases) for item in value]
    if not isinstance(value, dict):
        return value
    content = {key: _portable(item, file_names, cases) for key, item in value.items()}
    if not is_code(value):
        return content
    filters = (member for case in cases for member in case.user_filters if member.written)
    source = next(
        (m.sources_digest for m in filters if (m.name, m.keys.python) == (value["name"], value[CODE_KEY])), ""
    )
    content = portable_filter(content)
    return content | ({"source": source[:SOURCE_DIGITS]} if source else {})


def _text(content: Content, model: type[Model], unnamed_filters: Sequence[str]) -> str:
    """The content as YAML, each key of a single config with its description.

    unnamed_filters: those that it cannot describe."""
    yaml = CommentedYaml(exact_yaml)
    common = {key: value for key, value in content.items() if key in CommonKeys.model_fields}
    first = {key: common.pop(key) for key in ("name", "like", "study") if key in common}
    lines = [
        f"# The whole experiment of this result: `radarsim run {CONFIG_FILE}` computes the same tables anywhere.",
        *(
            f"# Without {name}: that filter was given as estimates or as an object of Python."
            for name in unnamed_filters
        ),
        *(line for key, value in first.items() for line in yaml.key_lines(key, value, CommonKeys, "")),
    ]
    if "include" in common:
        lines += ["include:", *(line for inner in common.pop("include") for line in _config_lines(inner, "  "))]
    keys = {key: value for key, value in content.items() if key not in CommonKeys.model_fields}
    lines += yaml.mapping_lines(keys, model, "")
    for key in [key for key in DESCRIBED_KEYS if key in common]:
        lines += yaml.key_lines(key, common.pop(key), CommonKeys, "")
    lines += [line for key, value in common.items() for line in yaml.plain_lines(key, value, "")]
    return "\n".join(lines) + "\n"


def _one_line(text: str) -> str:
    """Text for a comment, on one line."""
    return " ".join("".join(letter if letter.isprintable() else " " for letter in text).split())


def _config_lines(content: Content, indent: str) -> list[str]:
    """The lines of a config as an entry of a list."""
    yaml = CommentedYaml(exact_yaml)
    lines = []
    for key, value in content.items():
        if key == "include":
            lines += [
                f"{indent}  include:",
                *(line for inner in value for line in _config_lines(inner, indent + "    ")),
            ]
        else:
            lines += yaml.plain_lines(key, value, indent + "  ")
    return [f"{indent}- {lines[0].lstrip()}", *lines[1:]]

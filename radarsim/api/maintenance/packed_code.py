"""The code of user filters that goes with a packed result."""

import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from radarsim.api.case_work import CaseWork
from radarsim.api.stored_cases import recomputable_experiment
from radarsim.config.experiment import Case
from radarsim.config.user_filter_keys import CODE_KEY
from radarsim.errors import ConfigError
from radarsim.report import atomic_files


def code_names(record: Mapping[str, Any]) -> list[str]:
    """The places of all code that a record names: `my_filter.py:Mine`."""
    return sorted({*_code_keys(record.get("resolved"))})


def _code_keys(value: object) -> Iterator[str]:
    if isinstance(value, dict):
        if CODE_KEY in value:
            yield str(value[CODE_KEY])
        for inner in value.values():
            yield from _code_keys(inner)
    elif isinstance(value, list):
        for inner in value:
            yield from _code_keys(inner)


def packed_code(folder: Path, record: Mapping[str, Any]) -> dict[str, bytes]:
    """The files that user filters of a result are made of and read, by their paths beside its config.

    Each filter runs on its first realisations. Raises ConfigError where the code is not that of the result, or reads
    files outside its folders."""
    if not code_names(record):
        return {}
    contents: dict[str, bytes] = {}
    for case in recomputable_experiment(record, folder).cases:
        if not any(user_filter.written for user_filter in case.user_filters):
            continue
        if CaseWork(case).identity != record["identities"].get(case.name):
            raise ConfigError(
                f"{folder}: {case.name}: its code, or radarsim's, has changed since it ran: run it again before packing"
            )
        contents |= _code_of_case(folder, case)
    return contents


def _code_of_case(folder: Path, case: Case) -> dict[str, bytes]:
    contents = {}
    for user_filter in case.user_filters:
        if not user_filter.written:
            continue
        homes = (user_filter.folder, *user_filter.folders)
        for path, kind in user_filter.recording.files:
            if kind == "names":  # a list of the files in a folder, which are packed where they are read
                continue
            home = next((home for home in homes if os.path.commonpath([home, path]) == home), None)
            if home is None:
                raise ConfigError(f"{folder}: filter {user_filter.name} reads {path}, outside its folder: not packed")
            contents[Path(os.path.relpath(path, home)).as_posix()] = atomic_files.read(path)
    return contents

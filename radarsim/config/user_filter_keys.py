"""User filters among those of a study: `{name: mine, python: my_filter.py:MyFilter, hidden: 8}`."""

from collections.abc import Callable
from functools import cache
from pathlib import Path as FilePath
from typing import Annotated, Any

from pydantic import Discriminator, Tag, create_model

from radarsim.config.common_keys import UserFilterKeys
from radarsim.config.document import Document
from radarsim.config.error_list import ErrorList, Origin
from radarsim.config.model import Model
from radarsim.config.study_keys import StudyKeys
from radarsim.config.validate import validate
from radarsim.errors import ConfigError
from radarsim.system.private_files import foreign_owner

# User filters among those of a study: `{name: mine, python: my_filter.py:MyFilter, hidden: 8}`. This part reads how a
# config names them; `radarsim.studies.user_filters.from_code` finds their sources and runs them.
CODE_KEY = "python"


def is_code(member: object) -> bool:
    """Whether a member of a list of filters, as read, is a user filter."""
    return isinstance(member, dict) and CODE_KEY in member


def names_code(value: object) -> bool:
    """Whether a value of a config, as read, contains a key that names code."""
    if isinstance(value, dict):
        return any(str(key).rpartition(".")[2] == CODE_KEY or names_code(inner) for key, inner in value.items())
    return isinstance(value, list) and any(map(names_code, value))


MakeCodeFilter = Callable[[UserFilterKeys, str, bool, FilePath], Any]


def separate_code_filters(
    document: Document, model: type[StudyKeys], make_filter: MakeCodeFilter, faults: ErrorList
) -> tuple[Document, tuple[Any, ...]]:
    """The document with only the study's own filters and baselines, and the filters that the user's code makes.

    make_filter makes such a filter from its keys, its place, whether it is a baseline, and the folder of its config."""
    members = document.data.get(model.bare_keys)
    if not isinstance(members, list) or not any(map(is_code, members)):
        return document, ()
    study_filters = [member for member in members if not is_code(member)]
    checked: Any = validate(_filter_list_schema(model.bare_keys), document.with_keys((model.bare_keys,)), faults)
    names = [member.get("name") for member in members if isinstance(member, dict)]
    baselines = _baseline_names(document, names, faults)
    code_filters = []
    for i, member in enumerate(members):
        if not is_code(member):
            continue
        path = (model.bare_keys, i, CODE_KEY)
        if i < len(study_filters) or not study_filters:
            message = "must stand after filters of the study itself, and beside at least one"
            faults.add(document.key_origin(path), path, message)
        elif names.count(member.get("name")) > 1:
            name_path = (*path[:-1], "name")
            faults.add(document.origin(name_path), name_path, "names must differ, and this is there twice")
        elif checked is not None:
            keys, is_baseline = getattr(checked, model.bare_keys)[i], member.get("name") in baselines
            try:
                code_filters.append(_code_filter(keys, document.origin(path), is_baseline, make_filter))
            except ConfigError as error:
                faults.add(document.origin(path), path, str(error))
    document = document.with_data((model.bare_keys,), study_filters)
    return _without_baselines(document, baselines, [code.name for code in code_filters]), tuple(code_filters)


def _baseline_names(document: Document, filter_names: list[Any], faults: ErrorList) -> list[Any]:
    """The baselines of a config as written, one or a list; adds an error for each text that names no filter."""
    baseline = document.get(("baseline",))
    baselines = baseline if isinstance(baseline, list) else [baseline]
    for name in baselines:
        if isinstance(name, str) and name not in filter_names:
            message = f"must be the name of a filter: {', '.join(map(str, filter_names))}"
            faults.mark_unusable(document.origin(("baseline",)), ("baseline",), message, name)
    return baselines


def _code_filter(keys: UserFilterKeys, origin: Origin, is_baseline: bool, make_filter: MakeCodeFilter) -> Any:
    """The filter that the user's code makes. Raises ConfigError, also for a file beside the config that belongs to
    another user than the config."""
    folder = FilePath(origin.source).parent if origin.line else FilePath()
    code = make_filter(keys, str(origin), is_baseline, folder)
    is_beside_config = origin.line and folder.absolute() in FilePath(code.file).parents
    if is_beside_config and (owner := foreign_owner(code.file, origin.source)) is not None:
        raise ConfigError(f"must be code of yours or of the config's owner, {code.file} is of user {owner}")
    return code


def _without_baselines(document: Document, baselines: list[Any], names: list[str]) -> Document:
    """The document without these names among its baselines."""
    remaining = [baseline for baseline in baselines if baseline not in names]
    if remaining == baselines:
        return document
    return document.with_data(("baseline",), remaining) if remaining else document.without_keys(("baseline",))


@cache
def _filter_list_schema(name: str) -> type[Model]:
    """The schema of a list of filters that checks user filters and accepts all others."""
    member = Annotated[
        Annotated[UserFilterKeys, Tag("own")] | Annotated[Any, Tag("other")],
        Discriminator(lambda data: "own" if is_code(data) else "other"),
    ]
    fields: Any = {name: (tuple[member, ...], ...)}
    schema: type[Model] = create_model("Listed", __base__=Model, **fields)
    return schema

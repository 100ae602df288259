"""Put overrides, swept values and the keys beside `include` in their places."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from radarsim.config.document import Document
from radarsim.config.error_list import ABSENT, ErrorList, Origin
from radarsim.config.inline_files import ConfigFiles, inline_scenarios
from radarsim.config.model import in_degrees, in_radians
from radarsim.config.study_keys import StudyKeys
from radarsim.config.user_filter_keys import is_code
from radarsim.config.validate import allowed_keys, model_at, unknown_key_message
from radarsim.config.value_text import KeyPath


@dataclass(frozen=True)
class Setting:
    """A value for a key, from an override or a sweep."""

    key: str
    value: object
    origin: Origin


class NoSuchKey(ValueError):
    """A key that the config has no place for; the text is the message."""


def place_setting(
    document: Document, model: type[StudyKeys], setting: Setting, files: ConfigFiles, faults: ErrorList
) -> Document:
    """Put a setting's value at each place of its key. Raises NoSuchKey."""
    top_key = setting.key.split(".")[0]
    if "." in setting.key and isinstance(document.data.get(top_key), str):
        document = inline_scenarios(document, model, files, faults, only_key=top_key)
        if isinstance(document.data.get(top_key), str):
            return document  # no scenario, as noted, or a key without scenarios, as the check will report
    for path in key_paths(document, model, setting.key):
        document = _without_twin(document, path, model).graft(path, setting.value, setting.origin)
    return document


def key_paths(document: Document, model: type[StudyKeys], key: str, missing_ok: bool = False) -> list[KeyPath]:
    """The places of a key that `sweep` or `--set` names: one, or for a bare filter key one in every filter that has it.
    Raises NoSuchKey if there is none; returns an empty list with missing_ok."""
    try:
        if "." in key or key in allowed_keys(model):
            return [_dotted_path(document, key, model.bare_keys)]
        return _paths_in_members(document, model, key)
    except NoSuchKey:
        if missing_ok:
            return []
        raise


def _dotted_path(document: Document, key: str, bare_keys: str) -> KeyPath:
    """The place of a dotted key; members of a list are given by index or name. bare_keys: the list whose keys may stand
    without it. Raises NoSuchKey."""
    path: KeyPath = ()
    for step in key.split("."):
        holder = document.get(path)
        if isinstance(holder, list):
            named_indices = [
                i for i, member in enumerate(holder) if isinstance(member, dict) and member.get("name") == step
            ]
            if named_indices:
                step = str(named_indices[0])
            if not step.isdecimal() or int(step) >= len(holder):
                is_bare = path == (bare_keys,) and any(isinstance(member, dict) and step in member for member in holder)
                cure = f"; the key alone, {step}, means it in each" if is_bare and key.endswith(f".{step}") else ""
                raise NoSuchKey(f"{'.'.join(map(str, path))} is a list: its items are 0 to {len(holder) - 1}{cure}")
            path = (*path, int(step))
        elif isinstance(holder, dict) or holder is ABSENT:
            path = (*path, step)
        elif isinstance(holder, str) and len(path) == 1:  # a scenario's stem; inlined before anything is put there
            return tuple(key.split("."))
        else:
            raise NoSuchKey(f"{'.'.join(map(str, path))} has no keys of its own")
    return path


def _paths_in_members(document: Document, model: type[StudyKeys], key: str) -> list[KeyPath]:
    """The places of a bare key in the filters that have it. Raises NoSuchKey if none does."""
    members = document.data.get(model.bare_keys)
    known_keys: list[str] = []
    paths: list[KeyPath] = []
    for i in range(len(members) if isinstance(members, list) else 0):
        schema = model_at(model, document.data, (model.bare_keys, i))
        keys = list(members[i]) if is_code(members[i]) else allowed_keys(schema) if schema else []
        known_keys += [known_key for known_key in keys if known_key not in known_keys]
        if key in keys:
            paths.append((model.bare_keys, i, key))
    if not paths:
        raise NoSuchKey(unknown_key_message(key, [*allowed_keys(model), *known_keys]))
    return paths


def _without_twin(document: Document, path: KeyPath, model: type[StudyKeys]) -> Document:
    """The document without the key that the new value replaces: the same quantity in other units or terms."""
    twin_key = _twin_key(path, model)
    if not twin_key or document.get((*path[:-1], twin_key)) is ABSENT:
        return document
    mapping = document.get(path[:-1])
    assert isinstance(mapping, dict)  # it has the twin
    return document.with_data(path[:-1], {key: value for key, value in mapping.items() if key != twin_key})


def _twin_key(path: KeyPath, model: type[StudyKeys]) -> str:
    """The key that gives the same quantity in another unit or other terms; empty if there is none."""
    unit_twin = in_degrees(str(path[-1])) or in_radians(str(path[-1]))
    return unit_twin or model.in_place_of.get(".".join(map(str, path)), "").rpartition(".")[2]


def with_twins(paths: Iterable[KeyPath], model: type[StudyKeys]) -> Iterator[KeyPath]:
    """Each path, and that of its twin key if it has one, since setting one removes the other."""
    for path in paths:
        yield path
        if path and (twin_key := _twin_key(path, model)):
            yield *path[:-1], twin_key


def overlay_keys(
    document: Document, model: type[StudyKeys], overlay: Document, files: ConfigFiles, faults: ErrorList
) -> Document:
    """The document of an included config with the keys beside `include` laid over it.

    Mappings are merged key by key, scenarios by their content. All else is replaced: lists, values, the stem of a
    scenario, and a mapping of another kind."""
    scenario_keys = [key for key, value in overlay.data.items() if isinstance(value, str)]
    overlay = inline_scenarios(overlay, model, files, faults)
    for key, value in overlay.data.items():
        if isinstance(value, dict) and key not in scenario_keys:
            document = inline_scenarios(document, model, files, faults, only_key=key)
            document = _merge_mapping(document, model, overlay, (key,))
        else:
            document = _replace_value(document, model, overlay, (key,))
    return document


def _merge_mapping(document: Document, model: type[StudyKeys], overlay: Document, path: KeyPath) -> Document:
    """Merge the mappings that two documents have at a path."""
    own_value, overlaid_value = document.get(path), overlay.get(path)
    if not isinstance(own_value, dict) or not isinstance(overlaid_value, dict):
        return _replace_value(document, model, overlay, path)
    schema = model_at(model, document.data, path)
    merged = document.with_data(path, own_value | overlaid_value)
    if schema is not None and schema is not model_at(model, merged.data, path):
        return _replace_value(document, model, overlay, path)
    for key in overlaid_value:
        document = _merge_mapping(document, model, overlay, (*path, key))
    return document


def _replace_value(document: Document, model: type[StudyKeys], overlay: Document, path: KeyPath) -> Document:
    """Replace the value at a path by the overlay's, and remove its twin key."""
    twin_key = _twin_key(path, model)
    if overlay.get((*path[:-1], twin_key)) is ABSENT:  # both given side by side are a fault, which the check finds
        document = _without_twin(document, path, model)
    return document.with_value_of(path, overlay)


def leaf_paths(data: object, path: KeyPath = ()) -> Iterator[KeyPath]:
    """The paths of all values except non-empty mappings."""
    if not isinstance(data, dict) or not data:
        yield path
        return
    for key, value in data.items():
        yield from leaf_paths(value, (*path, key))

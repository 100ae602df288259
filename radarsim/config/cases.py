"""From a config to its cases: includes, overrides, sweeps and scenarios are applied, then each case is checked."""

import itertools
import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path as FilePath
from typing import Annotated, Any

from pydantic import Discriminator, Tag, create_model

from radarsim.config.check import allowed_keys, check, model_at, models_in, unknown_key
from radarsim.config.document import (
    ABSENT,
    Document,
    Faults,
    KeyPath,
    Origin,
    composed,
    config_file,
    did_you_mean,
    is_stem,
    one_line,
    scenario_file,
    shown,
    stems,
)
from radarsim.config.experiment import DRAWN_FOR_ALL, Case, Experiment, in_name, matches
from radarsim.config.fields import DataFile, Model, Scenario, Study, in_degrees, in_radians
from radarsim.config.schema import COMMON_KEYS, Common, OwnCode, Studies
from radarsim.errors import ConfigError
from radarsim.extensions import extension_figures
from radarsim.private_files import foreign_owner

# ---- place -----------------------------------------------------------------------------------------------------------
ReadDocument = Callable[[FilePath, Faults], Document | None]


@dataclass(frozen=True)
class Setting:
    """A value for a key, from an override or a sweep."""

    key: str
    value: object
    origin: Origin


class NoSuchKey(ValueError):
    """A key that the config has no place for; the text is the message."""


def place_setting(
    document: Document, model: type[Study], setting: Setting, read: ReadDocument, faults: Faults
) -> Document:
    """Put a setting's value at each place of its key. Raises NoSuchKey."""
    top_key = setting.key.split(".")[0]
    if "." in setting.key and isinstance(document.data.get(top_key), str):
        document = inline_scenarios(document, model, read, faults, only_key=top_key)
        if isinstance(document.data.get(top_key), str):
            return document  # no scenario, as noted, or a key without scenarios, as the check will report
    for path in key_paths(document, model, setting.key):
        document = _without_twin(document, path, model).graft(path, setting.value, setting.origin)
    return document


def key_paths(document: Document, model: type[Study], key: str, missing_ok: bool = False) -> list[KeyPath]:
    """The places of a key that `sweep` or `--set` names: one, or for a bare filter key one in every filter that has it.
    Raises NoSuchKey if there is none; returns an empty list with missing_ok."""
    try:
        if "." in key or key in allowed_keys(model):
            return [_dotted_path(document, key)]
        return _paths_in_members(document, model, key)
    except NoSuchKey:
        if missing_ok:
            return []
        raise


def _dotted_path(document: Document, key: str) -> KeyPath:
    """The place of a dotted key; members of a list are given by index or name. Raises NoSuchKey."""
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
                raise NoSuchKey(f"{'.'.join(map(str, path))} is a list: its items are 0 to {len(holder) - 1}")
            path = (*path, int(step))
        elif isinstance(holder, dict) or holder is ABSENT:
            path = (*path, step)
        elif isinstance(holder, str) and len(path) == 1:  # a scenario's stem; inlined before anything is put there
            return tuple(key.split("."))
        else:
            raise NoSuchKey(f"{'.'.join(map(str, path))} has no keys of its own")
    return path


def _paths_in_members(document: Document, model: type[Study], key: str) -> list[KeyPath]:
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
        raise NoSuchKey(unknown_key(key, [*allowed_keys(model), *known_keys]))
    return paths


def _without_twin(document: Document, path: KeyPath, model: type[Study]) -> Document:
    """The document without the key that the new value replaces: the same quantity in other units or terms."""
    twin_key = _twin_key(path, model)
    if not twin_key or document.get((*path[:-1], twin_key)) is ABSENT:
        return document
    mapping = document.get(path[:-1])
    assert isinstance(mapping, dict)  # it has the twin
    return document.with_data(path[:-1], {key: value for key, value in mapping.items() if key != twin_key})


def _twin_key(path: KeyPath, model: type[Study]) -> str:
    """The key that gives the same quantity in another unit or other terms; empty if there is none."""
    unit_twin = in_degrees(str(path[-1])) or in_radians(str(path[-1]))
    return unit_twin or model.in_place_of.get(".".join(map(str, path)), "").rpartition(".")[2]


def with_twins(paths: Iterable[KeyPath], model: type[Study]) -> Iterator[KeyPath]:
    """Each path, and that of its twin key if it has one, since setting one removes the other."""
    for path in paths:
        yield path
        if path and (twin_key := _twin_key(path, model)):
            yield *path[:-1], twin_key


def overlay_keys(
    document: Document, model: type[Study], overlay: Document, read: ReadDocument, faults: Faults
) -> Document:
    """The document of an included config with the keys beside `include` laid over it.

    Mappings are merged key by key, scenarios by their content. All else is replaced: lists, values, the stem of a
    scenario, and a mapping of another kind."""
    scenario_keys = [key for key, value in overlay.data.items() if isinstance(value, str)]
    overlay = inline_scenarios(overlay, model, read, faults)
    for key, value in overlay.data.items():
        if isinstance(value, dict) and key not in scenario_keys:
            document = inline_scenarios(document, model, read, faults, only_key=key)
            document = _merge_mapping(document, model, overlay, (key,))
        else:
            document = _replace_value(document, model, overlay, (key,))
    return document


def _merge_mapping(document: Document, model: type[Study], overlay: Document, path: KeyPath) -> Document:
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


def _replace_value(document: Document, model: type[Study], overlay: Document, path: KeyPath) -> Document:
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


def inline_scenarios(
    document: Document, model: type[Study], read: ReadDocument, faults: Faults, only_key: str | None = None
) -> Document:
    """Replace the stems of scenarios by the content of their files."""
    for field, info in model.model_fields.items():
        stem = document.data.get(field)
        is_wanted = only_key in (None, field) and any(isinstance(mark, Scenario) for mark in info.metadata)
        if not is_wanted or not isinstance(stem, str):
            continue
        origin, path = document.origin((field,)), (field,)
        if faults.spoiled(origin, path):
            continue
        file = scenario_file(stem, document.file) if is_stem(stem) else None
        if not is_stem(stem):
            faults.spoil(origin, path, "must be the stem of a scenario, without folder or suffix", stem)
        elif file is None:
            known_stems = stems("scenarios")
            hint = did_you_mean(stem, known_stems) or f"; there are: {', '.join(known_stems)}"
            faults.spoil(origin, path, f"no such scenario{hint}", stem)
        elif scenario := read(file, faults):
            document = document.graft_document(path, scenario)
        else:
            faults.spoil(origin, path, "the scenario cannot be read", stem)
    return document


def resolve_data_files(document: Document, model: type[Study], faults: Faults) -> Document:
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
            faults.spoil(origin, path, f"no such file: {shown(str(file))}")
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


# ---- code ------------------------------------------------------------------------------------------------------------
# User filters among those of a study: `{name: mine, python: my_filter.py:MyFilter, hidden: 8}`. This part reads how a
# config names them; `radarsim.studies.code` finds their sources and runs them.
CODE_KEY = "python"


def is_code(member: object) -> bool:
    """Whether a member of a list of filters, as read, is a user filter."""
    return isinstance(member, dict) and CODE_KEY in member


def names_code(value: object) -> bool:
    """Whether a value of a config, as read, contains a key that names code."""
    if isinstance(value, dict):
        return any(str(key).rpartition(".")[2] == CODE_KEY or names_code(inner) for key, inner in value.items())
    return isinstance(value, list) and any(map(names_code, value))


MakeCodeFilter = Callable[[OwnCode, str, bool, FilePath], Any]


def separate_code_filters(
    document: Document, model: type[Study], make_filter: MakeCodeFilter, faults: Faults
) -> tuple[Document, tuple[Any, ...]]:
    """The document with only the study's own filters and baselines, and the filters that the user's code makes.

    make_filter makes such a filter from its keys, its place, whether it is a baseline, and the folder of its config."""
    members = document.data.get(model.bare_keys)
    if not isinstance(members, list) or not any(map(is_code, members)):
        return document, ()
    study_filters = [member for member in members if not is_code(member)]
    checked: Any = check(_filter_list_schema(model.bare_keys), document.with_keys((model.bare_keys,)), faults)
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


def _baseline_names(document: Document, filter_names: list[Any], faults: Faults) -> list[Any]:
    """The baselines of a config as written, one or a list; adds an error for each text that names no filter."""
    baseline = document.get(("baseline",))
    baselines = baseline if isinstance(baseline, list) else [baseline]
    for name in baselines:
        if isinstance(name, str) and name not in filter_names:
            message = f"must be the name of a filter: {', '.join(map(str, filter_names))}"
            faults.spoil(document.origin(("baseline",)), ("baseline",), message, name)
    return baselines


def _code_filter(keys: OwnCode, origin: Origin, is_baseline: bool, make_filter: MakeCodeFilter) -> Any:
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
        Annotated[OwnCode, Tag("own")] | Annotated[Any, Tag("other")],
        Discriminator(lambda data: "own" if is_code(data) else "other"),
    ]
    fields: Any = {name: (tuple[member, ...], ...)}
    schema: type[Model] = create_model("Listed", __base__=Model, **fields)
    return schema


# ---- cases -----------------------------------------------------------------------------------------------------------
MAPPING_KEYS = ("sweep", "figures")  # common keys that are mappings: the text after their dot is a single key
MAX_CASES = 10_000
MAX_INCLUDE_DEPTH = 5


@dataclass(frozen=True)
class Draft:
    """A case under construction: its document with the keys applied so far."""

    document: Document
    stem: str
    study: str
    swept: tuple[tuple[str, object], ...]
    realisations: int | None
    seed: int | None


OverlaidKeys = tuple[Document, ...]  # keys laid over an included config, those of the nearest config first


def changes_included(document: Document) -> bool:
    """Whether a config changes what it includes: keys of a study stand beside `include`."""
    return "include" in document.data and not set(COMMON_KEYS).issuperset(document.data)


def _rename_drafts(drafts: list[Draft], stem: str) -> list[Draft]:
    """Rename the drafts of a config that changes what it includes, and is included itself, after that config."""
    has_several = len({draft.stem for draft in drafts}) > 1
    return [replace(draft, stem=f"{stem}:{draft.stem}" if has_several else stem) for draft in drafts]


def no_such_config(name: str, studies: Studies, list_names: bool = False) -> str:
    """The message that no config has this name: why its package cannot be used, or the nearest name.

    list_names: whether to list all names where none is near."""
    if reasons := studies.lacking(name):
        return f"no such config: {'; '.join(reasons)}"
    available = stems("configs")
    name_list = f"; there are: {', '.join(available)}" if list_names else ""
    return f"no such config{did_you_mean(name, available) or name_list}"


class Expander:
    """Expands configs into cases, reading each config once.

    read: `read(file, faults)` returns the document of a file, or adds an error and returns None.

    path: that of the config, if the user gave one. Code of a config that was found by name, directly or by an include,
    runs only if it belongs to this user, to root, or to the owner of the config at the path."""

    def __init__(
        self,
        read: ReadDocument,
        settings: Iterable[Setting],
        faults: Faults,
        studies: Studies,
        path: FilePath | None = None,
    ):
        cached: ReadDocument = cache(read)
        self.path = path
        self.read, self.faults, self.studies = cached, faults, studies
        settings = list(settings)
        self.common = [s for s in settings if s.key.split(".")[0] in COMMON_KEYS]
        self.settings = [s for s in settings if s.key.split(".")[0] not in COMMON_KEYS]
        self.expanded: dict[tuple[FilePath, ...], list[Draft]] = {}

    def experiment(self, document: Document) -> Experiment | None:
        """The experiment that a config describes; None if errors were added."""
        overlays: OverlaidKeys = ()
        for setting in self.common:
            top_key, *inner_key = setting.key.split(".", 1)
            if inner_key and top_key not in MAPPING_KEYS:
                self.faults.add(setting.origin, (), f"{top_key} has no keys of its own")
            elif top_key == "study" and document.data.get("study", setting.value) != setting.value:
                overlays = (document.with_data((), {}).graft(("study",), setting.value, setting.origin),)
            else:
                document = document.graft((top_key, *inner_key), setting.value, setting.origin)
        common, drafts = self._expand(document, (), overlays)
        cases = [case for draft in drafts if (case := self._checked_case(draft))]
        self._refuse_equal_names(cases, document)
        self._refuse_mixture(drafts, document)
        self._check_figure_names(common, drafts, document)
        self._check_figures(common, cases, document)
        if self.faults:
            return None
        stem = composed(document.file.stem) if document.file else "config"
        return Experiment(
            stem=stem,
            study=cases[0].study,
            path=str(document.file) if document.file else None,
            cases=tuple(cases),
            realisations=common.realisations or max(case.realisations for case in cases),
            seed=cases[0].seed if common.seed is None else common.seed,
            figures=common.cases_of_figures(),
            changes_included=changes_included(document),
        )

    def _expand(
        self, document: Document, chain: tuple[FilePath, ...], overlays: OverlaidKeys
    ) -> tuple[Common, list[Draft]]:
        """The common keys of a config, and its drafts under the overlays, of which the nearest comes first."""
        owner = foreign_owner(document.file, self.path) if document.file and names_code(document.data) else None
        if owner is not None:
            message = f"names code and belongs to another user ({owner}): to run it, give its path in place of a name"
            self.faults.add(Origin(str(document.file)), (), message)
            return Common(), []
        common = self._common_keys(document.with_keys(COMMON_KEYS))
        if "include" in document.data:
            study_drafts = self._included_drafts(document, common, chain, overlays)
        else:
            study_drafts = self._own_draft(document, common, overlays)
        drafts = self._sweep_drafts(document, common, study_drafts, overlays)
        values = {key: getattr(common, key) for key in ("realisations", "seed") if getattr(common, key) is not None}
        return common, [replace(draft, **values) for draft in drafts]

    def _common_keys(self, document: Document) -> Common:
        """The common keys; without those that have errors, so that the rest of the config is checked as well."""
        common = check(Common, document, self.faults)
        if not common:
            good = {key: v for key, v in document.data.items() if check(Common, document.with_keys((key,)), Faults())}
            common = Common.model_validate(good)
        if common.realisations is None and "realisations" in document.data:
            return common.model_copy(update={"realisations": 1})  # its fault is noted; it must not be called missing
        return common

    def _own_draft(self, document: Document, common: Common, overlays: OverlaidKeys) -> list[Draft]:
        """The one draft of a config with a study of its own."""
        if common.study is None or not self.studies.has(common.study):
            if "study" not in document.data:
                message = f"required key is missing: one of {', '.join(self.studies.names())}"
                self.faults.add(document.origin(()), ("study",), message)
            elif common.study is not None:
                self._add_unknown_study(document, common.study)
            return []
        study_keys, study = document.without_keys(COMMON_KEYS), common.study
        for overlay in overlays:
            study_keys, study = self._carry_to_study(study_keys, study, overlay)
            study_keys = overlay_keys(
                study_keys, self.studies.keys(study), overlay.without_keys(COMMON_KEYS), self.read, self.faults
            )
        for setting in self.settings:
            study_keys = self._with_setting(study_keys, study, setting)
        study_keys = inline_scenarios(study_keys, self.studies.keys(study), self.read, self.faults)
        stem = composed(document.file.stem) if document.file else "config"
        return [Draft(study_keys, stem, study, (), common.realisations, common.seed)]

    def _add_unknown_study(self, document: Document, name: str) -> None:
        """Add the error that no study has this name."""
        names = self.studies.names()
        message = f"must be one of {', '.join(names)}{did_you_mean(name, names)}"
        self.faults.add(document.origin(("study",)), ("study",), message, name)

    def _carry_to_study(self, document: Document, study: str, overlay: Document) -> tuple[Document, str]:
        """Convert a config to the study beside `include`, if one is given there. Returns document and study."""
        wanted_study = overlay.data.get("study", study)
        if wanted_study == study or not isinstance(wanted_study, str):  # what is no text is a fault already noted
            return document, study
        if not self.studies.has(wanted_study):
            self._add_unknown_study(overlay, wanted_study)
            return document, study
        data = self.studies.keys(wanted_study).carried(study, document.data)
        if data is None:
            accepting = [
                name for name in self.studies.usable() if self.studies.keys(name).carried(study, {}) is not None
            ]
            alternative = f", or one that takes over its keys: {', '.join(accepting)}" if accepting else ""
            message = f"must be that of the config, {study}{alternative}"
            self.faults.add(overlay.origin(("study",)), ("study",), message, wanted_study)
            return document, study
        sorted_lists = {key: sorted(items, key=is_code) for key, items in data.items() if isinstance(items, list)}
        return document.with_data((), data | sorted_lists), wanted_study

    def _included_drafts(
        self, document: Document, common: Common, chain: tuple[FilePath, ...], overlays: OverlaidKeys
    ) -> list[Draft]:
        """The drafts of all included configs, with the keys beside `include` laid over each."""
        if changes_included(document) or common.study is not None:
            overlays = (document.without_keys(set(COMMON_KEYS) - {"study"}), *overlays)
        chain = (*chain, document.file.resolve()) if document.file else chain
        drafts: list[Draft] = []
        for i, name in enumerate(common.include or ()):
            origin = document.origin(("include", i))
            drafts += self._include_config(name, origin, ("include", i), document.file, chain, overlays)
            if len(drafts) > MAX_CASES:
                self.faults.add(origin, ("include",), f"more than {MAX_CASES} cases")
                return []
        return drafts

    def _include_config(
        self,
        name: str,
        origin: Origin,
        path: KeyPath,
        including_file: FilePath | None,
        chain: tuple[FilePath, ...],
        overlays: OverlaidKeys,
    ) -> list[Draft]:
        """The drafts of one included config."""
        file = config_file(name, including_file) if is_stem(name) else None
        if not is_stem(name):
            self.faults.add(origin, path, "must be the stem of a config, without folder or suffix", name)
        elif file is None:
            self.faults.add(origin, path, no_such_config(name, self.studies), name)
        elif file.resolve() in chain:
            self.faults.add(origin, path, "a config cannot include itself", name)
        elif len(chain) > MAX_INCLUDE_DEPTH:
            self.faults.add(origin, path, f"includes nested more than {MAX_INCLUDE_DEPTH} deep", name)
        elif (cache_key := (file.resolve(), *(FilePath(overlay.source) for overlay in overlays))) in self.expanded:
            return self.expanded[cache_key]
        elif included := self.read(file, self.faults):
            _, drafts = self._expand(included, chain, overlays)
            if changes_included(included):
                drafts = _rename_drafts(drafts, composed(file.stem))
            return self.expanded.setdefault(cache_key, drafts)
        return []

    def _sweep_drafts(
        self, document: Document, common: Common, drafts: list[Draft], overlays: OverlaidKeys
    ) -> list[Draft]:
        """One draft for each combination of swept values; the last key changes fastest."""
        if not common.sweep or not drafts:
            return drafts
        if math.prod(len(values) for values in common.sweep.values()) * len(drafts) > MAX_CASES:
            self.faults.add(document.origin(("sweep",)), ("sweep",), f"more than {MAX_CASES} cases")
            return []
        axes = []
        for n, key in enumerate(common.sweep):
            if not self._can_sweep(document, list(common.sweep)[:n], key, drafts, overlays):
                continue
            values = document.data["sweep"][key]
            axes.append([Setting(key, v, document.origin(("sweep", key, i))) for i, v in enumerate(values)])
        return [self._with_settings(draft, settings) for draft in drafts for settings in itertools.product(*axes)]

    def _can_sweep(
        self, document: Document, earlier_keys: list[str], key: str, drafts: list[Draft], overlays: OverlaidKeys
    ) -> bool:
        """Whether only this sweep sets a key: no other sweep, no override, and no key that is laid over the config.

        earlier_keys: those that the same sweep names before this one."""
        origin = document.key_origin(("sweep", key))
        if key.split(".")[0] in COMMON_KEYS:
            self.faults.add(origin, ("sweep", key), "cannot be swept")
            return False
        try:
            swept_paths = {
                path
                for draft in drafts
                for path in with_twins(self._paths_in(draft, key, missing_ok=False), self.studies.keys(draft.study))
            }
        except NoSuchKey as error:
            self.faults.add(origin, ("sweep", key), str(error))
            return False
        return not (
            self._is_swept_elsewhere(key, origin, swept_paths, earlier_keys, drafts)
            or self._is_overridden(key, swept_paths, drafts)
            or self._is_overlaid(document, swept_paths, overlays)
        )

    def _paths_in(self, draft: Draft, key: str, missing_ok: bool = True) -> list[KeyPath]:
        """The places of a key in a draft."""
        return key_paths(draft.document, self.studies.keys(draft.study), key, missing_ok)

    def _is_swept_elsewhere(
        self, key: str, origin: Origin, swept_paths: set[KeyPath], earlier_keys: list[str], drafts: list[Draft]
    ) -> bool:
        """Whether another sweep sets some of these places; adds an error where one does."""
        for draft in drafts:
            for other_key in (*(swept_key for swept_key, _ in draft.swept), *earlier_keys):
                other_paths = self._paths_in(draft, other_key)
                if any(paths_overlap(path, swept_path) for path in other_paths for swept_path in swept_paths):
                    self.faults.add(origin, ("sweep", key), f"sweeps what {other_key} sweeps as well")
                    return True
        return False

    def _is_overridden(self, key: str, swept_paths: set[KeyPath], drafts: list[Draft]) -> bool:
        """Whether an override sets some of these places; adds an error where one does."""
        for setting in self.settings:
            if any(_is_below(path, swept_paths) for draft in drafts for path in self._paths_in(draft, setting.key)):
                self.faults.add(setting.origin, (), f"the config sweeps it: set sweep.{key}=[...] instead")
                return True
        return False

    def _is_overlaid(self, document: Document, swept_paths: set[KeyPath], overlays: OverlaidKeys) -> bool:
        """Whether a key beside `include` sets some of these places; adds an error where one does."""
        for overlay in overlays:
            for path in leaf_paths(overlay.data):
                if _is_below(path, swept_paths):
                    message = f"{document.source}, which is included, sweeps it; sweep it here instead, and not there"
                    self.faults.add(overlay.key_origin(path), path, message)
                    return True
        return False

    def _with_settings(self, draft: Draft, settings: tuple[Setting, ...]) -> Draft:
        """A draft with the values of one combination of a sweep."""
        document = draft.document
        for setting in settings:
            document = self._with_setting(document, draft.study, setting)
        swept = (*draft.swept, *((setting.key, setting.value) for setting in settings))
        return replace(draft, document=document, swept=swept)

    def _with_setting(self, document: Document, study: str, setting: Setting) -> Document:
        """A document with a setting; adds an error if its key has no place."""
        try:
            return place_setting(document, self.studies.keys(study), setting, self.read, self.faults)
        except NoSuchKey as error:
            self.faults.add(setting.origin, (), str(error))
            return document

    def _checked_case(self, draft: Draft) -> Case | None:
        """The checked case of a draft; None if errors were added."""
        model = self.studies.keys(draft.study)
        document = inline_scenarios(draft.document, model, self.read, self.faults)
        document = resolve_data_files(document, model, self.faults)
        document, outside = separate_code_filters(document, model, self.studies.coded, self.faults)
        document, against = self._split_baselines(document, model)
        spec = check(model, document, self.faults, also=COMMON_KEYS)
        if draft.realisations is None:
            self.faults.add(document.origin(()), ("realisations",), "required key is missing")
        if spec is None or draft.realisations is None:
            return None
        name = " ".join([draft.stem, *(f"{key}={in_name(value)}" for key, value in draft.swept)])
        seed = 1 if draft.seed is None else draft.seed
        return Case(
            name, draft.stem, draft.study, spec, draft.swept, draft.realisations, seed, against=against, outside=outside
        )

    def _split_baselines(self, document: Document, model: type[Study]) -> tuple[Document, tuple[str, ...]]:
        """The document with the first of several baselines, and the others, each checked as the only one."""
        path: KeyPath = ("baseline",)
        names = document.get(path)
        if "baseline" not in model.model_fields or names is ABSENT or isinstance(names, str | None):
            return document, ()
        if not isinstance(names, list) or not all(isinstance(name, str) for name in names) or not names:
            name_list = names if isinstance(names, list) else []
            wrong_path = next(((*path, i) for i, name in enumerate(name_list) if not isinstance(name, str)), path)
            message = "must be the name of a filter or a list of such names"
            self.faults.add(document.origin(wrong_path), wrong_path, message, document.get(wrong_path))
            return document.without_keys(("baseline",)), ()
        documents = [document.graft(path, name, document.origin((*path, i))) for i, name in enumerate(names)]
        for i, name in enumerate(names[1:], 1):
            if name in names[:i]:
                self.faults.add(document.origin((*path, i)), (*path, i), "stands there already", name)
            elif not self.faults:
                check(model, documents[i], self.faults, also=COMMON_KEYS)
        return documents[0], tuple(names[1:])

    def _refuse_equal_names(self, cases: list[Case], document: Document) -> None:
        """Add an error for each case whose name another case has."""
        names: set[str] = set()
        key = ("include",) if "include" in document.data else ("sweep",)
        for case in cases:
            if case.name in names:
                self.faults.add(document.origin(key), key, f"makes the case {one_line(case.name)!r} twice")
            names.add(case.name)

    def _refuse_mixture(self, drafts: list[Draft], document: Document) -> None:
        """Add an error if the cases belong to several studies."""
        studies = {draft.study for draft in drafts}
        if len(studies) > 1:
            message = f"one study per run; these belong to {', '.join(sorted(studies))}"
            self.faults.add(document.origin(("include",)), ("include",), message)

    def _check_figure_names(self, common: Common, drafts: list[Draft], document: Document) -> None:
        """Add an error for each figure that the study cannot draw, if its schema lists its figures."""
        names_by_study = [self.studies.keys(study).figure_names for study in {draft.study for draft in drafts}]
        if len(names_by_study) != 1 or names_by_study[0] is None:
            return
        figure_names = (*names_by_study[0], *extension_figures(), *DRAWN_FOR_ALL)
        for n, figure in enumerate(common.figures):
            if not any(matches(figure, name) or matches(name, figure) for name in figure_names):
                has_mapping = isinstance(common.figures, dict)
                path = ("figures", figure if has_mapping else n)
                hint = did_you_mean(figure, names_by_study[0]) or f"; there are: {', '.join(figure_names)}"
                origin = document.key_origin(path) if has_mapping else document.origin(path)
                self.faults.add(origin, path, f"no such figure{hint}", *([] if has_mapping else [figure]))

    def _check_figures(self, common: Common, cases: list[Case], document: Document) -> None:
        """Add an error for each pattern that matches no case, since its figure would be empty."""
        if self.faults:
            return
        for figure, patterns in common.cases_of_figures().items():
            for i, pattern in enumerate(patterns):
                if not any(matches(case.name, pattern) for case in cases):
                    path = ("figures", figure, i)
                    hint = did_you_mean(pattern, [case.name for case in cases])
                    self.faults.add(document.origin(path), path, f"no case has this name{hint}", pattern)


def _is_below(path: KeyPath, places: Iterable[KeyPath]) -> bool:
    """Whether a path leads to one of these places or to a part of one."""
    return any(path[: len(place)] == place for place in places)


def paths_overlap(path: KeyPath, other_path: KeyPath) -> bool:
    """Whether two paths lead to the same value, or one to a part of the other's."""
    common_length = min(len(path), len(other_path))
    return path[:common_length] == other_path[:common_length]

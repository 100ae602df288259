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
Read = Callable[[FilePath, Faults], Document | None]


@dataclass(frozen=True)
class Setting:
    """A value for a key, from an override or a sweep."""

    key: str
    value: object
    origin: Origin


class NoSuchKey(ValueError):
    """A key without a place in the config; its text is the message."""


def place(document: Document, model: type[Study], setting: Setting, read: Read, faults: Faults) -> Document:
    """The document with a setting's value at each place of its key. Raises NoSuchKey."""
    first = setting.key.split(".")[0]
    if "." in setting.key and isinstance(document.data.get(first), str):
        document = scenarios_inlined(document, model, read, faults, only=first)
        if isinstance(document.data.get(first), str):
            return document  # no scenario, as noted, or a key without scenarios, as the check will report
    for path in key_paths(document, model, setting.key):
        document = _without_twin(document, path, model).graft(path, setting.value, setting.origin)
    return document


def key_paths(document: Document, model: type[Study], key: str, missing_ok: bool = False) -> list[KeyPath]:
    """The places of a key of `sweep` or `--set`: one, or for a bare filter key one in every filter that has it. Raises
    NoSuchKey, or returns none with missing_ok."""
    try:
        if "." in key or key in allowed_keys(model):
            return [_dotted(document, key)]
        return _in_every_member(document, model, key)
    except NoSuchKey:
        if missing_ok:
            return []
        raise


def _dotted(document: Document, key: str) -> KeyPath:
    path: KeyPath = ()
    for text in key.split("."):
        holder = document.get(path)
        if isinstance(holder, list):
            called = [i for i, one in enumerate(holder) if isinstance(one, dict) and one.get("name") == text]
            if called:
                text = str(called[0])
            if not text.isdecimal() or int(text) >= len(holder):
                raise NoSuchKey(f"{'.'.join(map(str, path))} is a list: its items are 0 to {len(holder) - 1}")
            path = (*path, int(text))
        elif isinstance(holder, dict) or holder is ABSENT:
            path = (*path, text)
        elif isinstance(holder, str) and len(path) == 1:  # a scenario's stem; inlined before anything is put there
            return tuple(key.split("."))
        else:
            raise NoSuchKey(f"{'.'.join(map(str, path))} has no keys of its own")
    return path


def _in_every_member(document: Document, model: type[Study], key: str) -> list[KeyPath]:
    members = document.data.get(model.bare_keys)
    known: list[str] = []
    paths: list[KeyPath] = []
    for i in range(len(members) if isinstance(members, list) else 0):
        schema = model_at(model, document.data, (model.bare_keys, i))
        keys = list(members[i]) if is_code(members[i]) else allowed_keys(schema) if schema else []
        known += [k for k in keys if k not in known]
        if key in keys:
            paths.append((model.bare_keys, i, key))
    if not paths:
        raise NoSuchKey(unknown_key(key, [*allowed_keys(model), *known]))
    return paths


def _without_twin(document: Document, path: KeyPath, model: type[Study]) -> Document:
    """The document without the key that the new value replaces: the same quantity in other units or terms."""
    twin = _twin(path, model)
    if not twin or document.get((*path[:-1], twin)) is ABSENT:
        return document
    holder = document.get(path[:-1])
    assert isinstance(holder, dict)  # it has the twin
    return document.with_data(path[:-1], {key: value for key, value in holder.items() if key != twin})


def _twin(path: KeyPath, model: type[Study]) -> str:
    twin = in_degrees(str(path[-1])) or in_radians(str(path[-1]))
    return twin or model.in_place_of.get(".".join(map(str, path)), "").rpartition(".")[2]


def _with_twins(paths: Iterable[KeyPath], model: type[Study]) -> Iterator[KeyPath]:
    """The paths, each with its twin's if it has one: a change of one removes the other."""
    for path in paths:
        yield path
        if path and (twin := _twin(path, model)):
            yield *path[:-1], twin


def overlaid(document: Document, model: type[Study], over: Document, read: Read, faults: Faults) -> Document:
    """The document of an included config with the keys beside `include` laid over it. Mappings are changed key by key,
    scenarios by their content; all else is replaced: lists, values, a scenario's stem, and a mapping of another
    kind."""
    stems = [key for key, value in over.data.items() if isinstance(value, str)]
    over = scenarios_inlined(over, model, read, faults)
    for key, value in over.data.items():
        if isinstance(value, dict) and key not in stems:
            document = scenarios_inlined(document, model, read, faults, only=key)
            document = _merged(document, model, over, (key,))
        else:
            document = _replaced(document, model, over, (key,))
    return document


def _merged(document: Document, model: type[Study], over: Document, path: KeyPath) -> Document:
    """The document merged with another one's keys in the mapping at a path."""
    below, value = document.get(path), over.get(path)
    if not isinstance(below, dict) or not isinstance(value, dict):
        return _replaced(document, model, over, path)
    kind = model_at(model, document.data, path)
    if kind is not None and kind is not model_at(model, document.with_data(path, below | value).data, path):
        return _replaced(document, model, over, path)
    for key in value:
        document = _merged(document, model, over, (*path, key))
    return document


def _replaced(document: Document, model: type[Study], over: Document, path: KeyPath) -> Document:
    twin = _twin(path, model)
    if over.get((*path[:-1], twin)) is ABSENT:  # both given side by side are a fault, which the check finds
        document = _without_twin(document, path, model)
    return document.laid(path, over)


def leaves(data: object, path: KeyPath = ()) -> Iterator[KeyPath]:
    """The paths of all values except non-empty mappings."""
    if not isinstance(data, dict) or not data:
        yield path
        return
    for key, value in data.items():
        yield from leaves(value, (*path, key))


def scenarios_inlined(
    document: Document, model: type[Study], read: Read, faults: Faults, only: str | None = None
) -> Document:
    """The document with the content of scenario files in place of their stems."""
    for field, info in model.model_fields.items():
        stem = document.data.get(field)
        wanted = only in (None, field) and any(isinstance(mark, Scenario) for mark in info.metadata)
        if not wanted or not isinstance(stem, str):
            continue
        origin, path = document.origin((field,)), (field,)
        if faults.spoiled(origin, path):
            continue
        file = scenario_file(stem, document.file) if is_stem(stem) else None
        if not is_stem(stem):
            faults.spoil(origin, path, "must be the stem of a scenario, without folder or suffix", stem)
        elif file is None:
            known = stems("scenarios")
            near = did_you_mean(stem, known) or f"; there are: {', '.join(known)}"
            faults.spoil(origin, path, f"no such scenario{near}", stem)
        elif scenario := read(file, faults):
            document = document.graft_document(path, scenario)
        else:
            faults.spoil(origin, path, "the scenario cannot be read", stem)
    return document


def data_files_found(document: Document, model: type[Study], faults: Faults) -> Document:
    """The document with a readable path for each file of data, relative to the folder of its own YAML file."""
    for path, value in list(_texts(document.data, ())) if _has_data_files(model) else ():
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
    own = any(isinstance(mark, DataFile) for info in fields for mark in info.metadata)
    return own or any(_has_data_files(inner) for info in fields for inner in models_in(info.annotation))


def _texts(data: object, path: KeyPath) -> Iterator[tuple[KeyPath, str]]:
    """All texts under a key of their own, with their paths."""
    if isinstance(data, dict | list):
        for step, value in data.items() if isinstance(data, dict) else enumerate(data):
            yield from _texts(value, (*path, step))
    elif isinstance(data, str) and path and isinstance(path[-1], str):
        yield path, data


# ---- code ------------------------------------------------------------------------------------------------------------
# Filters of the user's own code among those of a study: `{name: mine, python: my_filter.py:MyFilter, hidden: 8}`. Read
# here is how a config names them; `radarsim.studies.code` finds their sources, and runs them.
PYTHON = "python"


def is_code(member: object) -> bool:
    """Whether a member of a list of filters, as read, is the user's own code."""
    return isinstance(member, dict) and PYTHON in member


def names_code(value: object) -> bool:
    """Whether a part of a config, as read, has a key that names code, also one of an included config."""
    if isinstance(value, dict):
        return any(str(key).rpartition(".")[2] == PYTHON or names_code(inner) for key, inner in value.items())
    return isinstance(value, list) and any(map(names_code, value))


Coded = Callable[[OwnCode, str, bool, FilePath], Any]


def parted(document: Document, model: type[Study], coded: Coded, faults: Faults) -> tuple[Document, tuple[Any, ...]]:
    """The document with the study's own filters and baselines alone, and the filters of the user's code.

    coded: what makes such a filter of its keys, its place, whether it is a baseline, and the folder of its config."""
    members = document.data.get(model.bare_keys)
    if not isinstance(members, list) or not any(map(is_code, members)):
        return document, ()
    own = [one for one in members if not is_code(one)]
    read: Any = check(_listed(model.bare_keys), document.only((model.bare_keys,)), faults)
    given = document.get(("baseline",))
    baselines = given if isinstance(given, list) else [given]
    names = [one.get("name") for one in members if isinstance(one, dict)]
    for one in baselines:
        if isinstance(one, str) and one not in names:
            message = f"must be the name of a filter: {', '.join(map(str, names))}"
            faults.spoil(document.origin(("baseline",)), ("baseline",), message, one)
    found = []
    for i, one in enumerate(members):
        at = (model.bare_keys, i)
        if not is_code(one):
            continue
        if i < len(own) or not own:
            message = "must stand after filters of the study itself, and beside at least one"
            faults.add(document.key_origin((*at, PYTHON)), (*at, PYTHON), message)
        elif names.count(one.get("name")) > 1:
            faults.add(document.origin((*at, "name")), (*at, "name"), "names must differ, and this is there twice")
        elif read is not None:
            origin = document.origin((*at, PYTHON))
            folder = FilePath(origin.source).parent if origin.line else FilePath()
            try:
                code = coded(getattr(read, model.bare_keys)[i], str(origin), one.get("name") in baselines, folder)
                beside = origin.line and folder.absolute() in FilePath(code.file).parents
                if beside and (owner := foreign_owner(code.file, origin.source)) is not None:
                    raise ConfigError(f"must be code of yours or of the config's owner, {code.file} is of user {owner}")
                found.append(code)
            except ConfigError as error:
                faults.add(origin, (*at, PYTHON), str(error))
    document = document.with_data((model.bare_keys,), own)
    kept = [one for one in baselines if one not in [code.name for code in found]]
    if kept != baselines:
        document = document.with_data(("baseline",), kept) if kept else document.without(("baseline",))
    return document, tuple(found)


@cache
def _listed(name: str) -> type[Model]:
    """The schema of a list of filters in which those of the user's code are checked."""
    member = Annotated[
        Annotated[OwnCode, Tag("own")] | Annotated[Any, Tag("other")],
        Discriminator(lambda data: "own" if is_code(data) else "other"),
    ]
    fields: Any = {name: (tuple[member, ...], ...)}
    made: type[Model] = create_model("Listed", __base__=Model, **fields)
    return made


# ---- cases -----------------------------------------------------------------------------------------------------------
DOTTED = ("sweep", "figures")  # the common keys that are mappings; what follows the first dot is one key of theirs
MOST_CASES = 10_000
DEEPEST_INCLUDE = 5


@dataclass(frozen=True)
class Draft:
    """An unfinished case: the document as far as it is put together."""

    document: Document
    stem: str
    study: str
    swept: tuple[tuple[str, object], ...]
    realisations: int | None
    seed: int | None


Over = tuple[Document, ...]  # keys laid over an included config, those of the nearest config first


def changes_included(document: Document) -> bool:
    """Whether a config changes what it includes: keys of a study stand beside `include`."""
    return "include" in document.data and not set(COMMON_KEYS).issuperset(document.data)


def _renamed(drafts: list[Draft], stem: str) -> list[Draft]:
    """The drafts of a config that changes what it includes, renamed after it if it is included in turn."""
    several = len({draft.stem for draft in drafts}) > 1
    return [replace(draft, stem=f"{stem}:{draft.stem}" if several else stem) for draft in drafts]


def no_such_config(name: str, studies: Studies, known: bool = False) -> str:
    """The fault that no config has this name: from the package that would have it, or with the nearest name.

    known: the names to list where none is near."""
    if faults := studies.lacking(name):
        return f"no such config: {'; '.join(faults)}"
    there = stems("configs")
    every = f"; there are: {', '.join(there)}" if known else ""
    return f"no such config{did_you_mean(name, there) or every}"


class Expander:
    """Expands configs into drafts, each config once. `read(file, faults)` returns the document in a file, or notes a
    fault and returns None.

    path: of the config, where the user gave it. Of a config that was found by its name, here or by an include, code
    runs only if it belongs to this user, to root, or to whom the config at the path belongs."""

    def __init__(
        self, read: Read, settings: Iterable[Setting], faults: Faults, studies: Studies, path: FilePath | None = None
    ):
        cached: Read = cache(read)
        self.path = path
        self.read, self.faults, self.studies = cached, faults, studies
        settings = list(settings)
        self.common = [s for s in settings if s.key.split(".")[0] in COMMON_KEYS]
        self.settings = [s for s in settings if s.key.split(".")[0] not in COMMON_KEYS]
        self.expanded: dict[tuple[FilePath, ...], list[Draft]] = {}

    def experiment(self, document: Document) -> Experiment | None:
        """The whole experiment of the top config; None if faults were noted."""
        over: Over = ()
        for setting in self.common:
            first, *rest = setting.key.split(".", 1)
            if rest and first not in DOTTED:
                self.faults.add(setting.origin, (), f"{first} has no keys of its own")
            elif first == "study" and document.data.get("study", setting.value) != setting.value:
                over = (document.with_data((), {}).graft(("study",), setting.value, setting.origin),)
            else:
                document = document.graft((first, *rest), setting.value, setting.origin)
        common, drafts = self._expand(document, (), over)
        cases = [case for draft in drafts if (case := self._case(draft))]
        self._refuse_twins(cases, document)
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

    def _expand(self, document: Document, chain: tuple[FilePath, ...], over: Over) -> tuple[Common, list[Draft]]:
        """The common keys of a config, and its drafts; over is laid over them, the nearest first."""
        owner = foreign_owner(document.file, self.path) if document.file and names_code(document.data) else None
        if owner is not None:
            message = f"names code and belongs to another user ({owner}): to run it, give its path in place of a name"
            self.faults.add(Origin(str(document.file)), (), message)
            return Common(), []
        common = self._common(document.only(COMMON_KEYS))
        if "include" in document.data:
            inside = self._included(document, common, chain, over)
        else:
            inside = self._own(document, common, over)
        drafts = self._swept(document, common, inside, over)
        given = {key: getattr(common, key) for key in ("realisations", "seed") if getattr(common, key) is not None}
        return common, [replace(draft, **given) for draft in drafts]

    def _common(self, document: Document) -> Common:
        """The common keys; where some have faults, the others, so that the rest is checked as well."""
        common = check(Common, document, self.faults)
        if not common:
            good = {key: v for key, v in document.data.items() if check(Common, document.only((key,)), Faults())}
            common = Common.model_validate(good)
        if common.realisations is None and "realisations" in document.data:
            return common.model_copy(update={"realisations": 1})  # its fault is noted; it must not be called missing
        return common

    def _own(self, document: Document, common: Common, over: Over) -> list[Draft]:
        """The one draft of a config with a study of its own."""
        if common.study is None or not self.studies.has(common.study):
            if "study" not in document.data:
                self.faults.add(
                    document.origin(()),
                    ("study",),
                    f"required key is missing: one of {', '.join(self.studies.names())}",
                )
            elif common.study is not None:
                self._no_such_study(document, common.study)
            return []
        own, study = document.without(COMMON_KEYS), common.study
        for one in over:
            own, study = self._carried(own, study, one)
            own = overlaid(own, self.studies.keys(study), one.without(COMMON_KEYS), self.read, self.faults)
        for setting in self.settings:
            own = self._placed(own, study, setting)
        own = scenarios_inlined(own, self.studies.keys(study), self.read, self.faults)
        stem = composed(document.file.stem) if document.file else "config"
        return [Draft(own, stem, study, (), common.realisations, common.seed)]

    def _no_such_study(self, document: Document, name: str) -> None:
        known = self.studies.names()
        message = f"must be one of {', '.join(known)}{did_you_mean(name, known)}"
        self.faults.add(document.origin(("study",)), ("study",), message, name)

    def _carried(self, document: Document, study: str, over: Document) -> tuple[Document, str]:
        """A config converted to the study beside `include`, if one is given, and its study."""
        wanted = over.data.get("study", study)
        if wanted == study or not isinstance(wanted, str):  # what is no text is a fault already noted
            return document, study
        if not self.studies.has(wanted):
            self._no_such_study(over, wanted)
            return document, study
        data = self.studies.keys(wanted).carried(study, document.data)
        if data is None:
            takers = [one for one in self.studies.usable() if self.studies.keys(one).carried(study, {}) is not None]
            further = f", or one that takes over its keys: {', '.join(takers)}" if takers else ""
            message = f"must be that of the config, {study}{further}"
            self.faults.add(over.origin(("study",)), ("study",), message, wanted)
            return document, study
        members = {key: sorted(one, key=is_code) for key, one in data.items() if isinstance(one, list)}
        return document.with_data((), data | members), wanted

    def _included(self, document: Document, common: Common, chain: tuple[FilePath, ...], over: Over) -> list[Draft]:
        """The drafts of all included configs, with the keys beside `include` laid over each."""
        if changes_included(document) or common.study is not None:
            over = (document.without(set(COMMON_KEYS) - {"study"}), *over)
        chain = (*chain, document.file.resolve()) if document.file else chain
        drafts: list[Draft] = []
        for i, name in enumerate(common.include or ()):
            origin = document.origin(("include", i))
            drafts += self._include(name, origin, ("include", i), document.file, chain, over)
            if len(drafts) > MOST_CASES:
                self.faults.add(origin, ("include",), f"more than {MOST_CASES} cases")
                return []
        return drafts

    def _include(
        self, name: str, origin: Origin, path: KeyPath, beside: FilePath | None, chain: tuple[FilePath, ...], over: Over
    ) -> list[Draft]:
        """The drafts of one included config."""
        file = config_file(name, beside) if is_stem(name) else None
        if not is_stem(name):
            self.faults.add(origin, path, "must be the stem of a config, without folder or suffix", name)
        elif file is None:
            self.faults.add(origin, path, no_such_config(name, self.studies), name)
        elif file.resolve() in chain:
            self.faults.add(origin, path, "a config cannot include itself", name)
        elif len(chain) > DEEPEST_INCLUDE:
            self.faults.add(origin, path, f"includes nested more than {DEEPEST_INCLUDE} deep", name)
        elif (once := (file.resolve(), *(FilePath(one.source) for one in over))) in self.expanded:
            return self.expanded[once]
        elif included := self.read(file, self.faults):
            _, drafts = self._expand(included, chain, over)
            if changes_included(included):
                drafts = _renamed(drafts, composed(file.stem))
            return self.expanded.setdefault(once, drafts)
        return []

    def _swept(self, document: Document, common: Common, drafts: list[Draft], over: Over) -> list[Draft]:
        """Each draft once for each combination of swept values; the last key changes fastest."""
        if not common.sweep or not drafts:
            return drafts
        if math.prod(len(values) for values in common.sweep.values()) * len(drafts) > MOST_CASES:
            self.faults.add(document.origin(("sweep",)), ("sweep",), f"more than {MOST_CASES} cases")
            return []
        axes = []
        for n, key in enumerate(common.sweep):
            if not self._may_be_swept(document, list(common.sweep)[:n], key, drafts, over):
                continue
            values = document.data["sweep"][key]
            axes.append([Setting(key, v, document.origin(("sweep", key, i))) for i, v in enumerate(values)])
        return [self._with(draft, settings) for draft in drafts for settings in itertools.product(*axes)]

    def _may_be_swept(self, document: Document, before: list[str], key: str, drafts: list[Draft], over: Over) -> bool:
        """Whether a swept key is set by this sweep alone: by no other sweep, override or key laid over it.

        before: the earlier keys of the same sweep."""
        origin = document.key_origin(("sweep", key))
        if key.split(".")[0] in COMMON_KEYS:
            self.faults.add(origin, ("sweep", key), "cannot be swept")
            return False
        models = {draft.study: self.studies.keys(draft.study) for draft in drafts}
        try:
            swept = {
                path
                for draft in drafts
                for path in _with_twins(key_paths(draft.document, models[draft.study], key), models[draft.study])
            }
        except NoSuchKey as error:
            self.faults.add(origin, ("sweep", key), str(error))
            return False
        for draft in drafts:
            for other in (*(swept_key for swept_key, _ in draft.swept), *before):
                others = key_paths(draft.document, models[draft.study], other, missing_ok=True)
                if any(overlap(path, one) for path in others for one in swept):
                    self.faults.add(origin, ("sweep", key), f"sweeps what {other} sweeps as well")
                    return False
        for setting in self.settings:
            for draft in drafts:
                set_here = key_paths(draft.document, models[draft.study], setting.key, missing_ok=True)
                if any(path[: len(s)] == s for path in set_here for s in swept):
                    self.faults.add(setting.origin, (), f"the config sweeps it: set sweep.{key}=[...] instead")
                    return False
        for one in over:
            for path in leaves(one.data):
                if any(path[: len(s)] == s for s in swept):
                    message = f"{document.source}, which is included, sweeps it; sweep it here instead, and not there"
                    self.faults.add(one.key_origin(path), path, message)
                    return False
        return True

    def _with(self, draft: Draft, settings: tuple[Setting, ...]) -> Draft:
        document = draft.document
        for setting in settings:
            document = self._placed(document, draft.study, setting)
        swept = (*draft.swept, *((s.key, s.value) for s in settings))
        return replace(draft, document=document, swept=swept)

    def _placed(self, document: Document, study: str, setting: Setting) -> Document:
        try:
            return place(document, self.studies.keys(study), setting, self.read, self.faults)
        except NoSuchKey as error:
            self.faults.add(setting.origin, (), str(error))
            return document

    def _case(self, draft: Draft) -> Case | None:
        """The checked case of a draft; None if faults were noted."""
        model = self.studies.keys(draft.study)
        document = scenarios_inlined(draft.document, model, self.read, self.faults)
        document = data_files_found(document, model, self.faults)
        document, outside = parted(document, model, self.studies.coded, self.faults)
        document, against = self._baselines(document, model)
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

    def _baselines(self, document: Document, model: type[Study]) -> tuple[Document, tuple[str, ...]]:
        """The document with only the first of several baselines, and the others, each checked as if alone."""
        path: KeyPath = ("baseline",)
        names = document.get(path)
        if "baseline" not in model.model_fields or names is ABSENT or isinstance(names, str | None):
            return document, ()
        if not isinstance(names, list) or not all(isinstance(name, str) for name in names) or not names:
            many = names if isinstance(names, list) else []
            wrong = next(((*path, i) for i, name in enumerate(many) if not isinstance(name, str)), path)
            message = "must be the name of a filter or a list of such names"
            self.faults.add(document.origin(wrong), wrong, message, document.get(wrong))
            return document.without(("baseline",)), ()
        each = [document.graft(path, name, document.origin((*path, i))) for i, name in enumerate(names)]
        for i, name in enumerate(names[1:], 1):
            if name in names[:i]:
                self.faults.add(document.origin((*path, i)), (*path, i), "stands there already", name)
            elif not self.faults:
                check(model, each[i], self.faults, also=COMMON_KEYS)
        return each[0], tuple(names[1:])

    def _refuse_twins(self, cases: list[Case], document: Document) -> None:
        seen: set[str] = set()
        key = ("include",) if "include" in document.data else ("sweep",)
        for case in cases:
            if case.name in seen:
                self.faults.add(document.origin(key), key, f"makes the case {one_line(case.name)!r} twice")
            seen.add(case.name)

    def _refuse_mixture(self, drafts: list[Draft], document: Document) -> None:
        studies = {draft.study for draft in drafts}
        if len(studies) > 1:
            message = f"one study per run; these belong to {', '.join(sorted(studies))}"
            self.faults.add(document.origin(("include",)), ("include",), message)

    def _check_figure_names(self, common: Common, drafts: list[Draft], document: Document) -> None:
        """A figure must be one that the study may draw, if its schema lists these."""
        known = [self.studies.keys(study).figure_names for study in {draft.study for draft in drafts}]
        if len(known) != 1 or known[0] is None:
            return
        every = (*known[0], *extension_figures(), *DRAWN_FOR_ALL)
        for n, figure in enumerate(common.figures):
            if not any(matches(figure, name) or matches(name, figure) for name in every):
                named = isinstance(common.figures, dict)
                path = ("figures", figure if named else n)
                near = did_you_mean(figure, known[0]) or f"; there are: {', '.join(every)}"
                origin = document.key_origin(path) if named else document.origin(path)
                self.faults.add(origin, path, f"no such figure{near}", *([] if named else [figure]))

    def _check_figures(self, common: Common, cases: list[Case], document: Document) -> None:
        """Every pattern must match a case; otherwise a figure would be empty without an explanation."""
        if self.faults:
            return
        for figure, patterns in common.cases_of_figures().items():
            for i, pattern in enumerate(patterns):
                if not any(matches(case.name, pattern) for case in cases):
                    path = ("figures", figure, i)
                    near = did_you_mean(pattern, [case.name for case in cases])
                    self.faults.add(document.origin(path), path, f"no case has this name{near}", pattern)


def overlap(one: KeyPath, other: KeyPath) -> bool:
    """Whether two paths lead to the same value, or one to a part of the other's."""
    shared = min(len(one), len(other))
    return one[:shared] == other[:shared]

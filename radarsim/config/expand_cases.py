"""From a config to its checked cases: includes, overrides and sweeps."""

import itertools
import math
from collections.abc import Iterable, Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path as FilePath

from radarsim.config.common_keys import COMMON_KEYS, CommonKeys, Studies
from radarsim.config.complete_config import Content, folder_of, sweep_with_data_paths, with_data_paths
from radarsim.config.document import Document
from radarsim.config.drafts import Draft, Expansion, OverlaidKeys, changes_included, config_name
from radarsim.config.error_list import ABSENT, ErrorList, Origin
from radarsim.config.experiment import COMMON_FIGURES, Case, Experiment, matches_pattern
from radarsim.config.find_files import RESERVED, available_stems, config_file, did_you_mean, is_reserved, is_stem
from radarsim.config.inline_files import (
    ConfigFiles,
    ReadDocument,
    data_files,
    inline_scenarios,
    named_scenarios,
    resolve_data_files,
)
from radarsim.config.place_settings import (
    NoSuchKey,
    Setting,
    key_paths,
    leaf_paths,
    overlay_keys,
    place_setting,
    with_twins,
)
from radarsim.config.study_keys import StudyKeys
from radarsim.config.user_filter_keys import is_code, names_code, separate_code_filters
from radarsim.config.validate import validate
from radarsim.config.value_text import KeyPath, one_line
from radarsim.extensions import extension_figures
from radarsim.system.private_files import foreign_owner

MAPPING_KEYS = ("sweep", "figures")  # common keys that are mappings: the text after their dot is a single key
MAX_CASES = 10_000
MAX_INCLUDE_DEPTH = 5


def no_such_config(name: str, studies: Studies) -> str:
    """The message that no config has this name: why its package cannot be used, or the nearest name."""
    if reasons := studies.reasons_for_missing_config(name):
        return f"no such config: {'; '.join(reasons)}"
    return f"no such config{did_you_mean(name, available_stems('configs'))}"


class Expander:
    """Expands configs into cases, reading each config once.

    read: `read(file, faults)` returns the document of a file, or adds an error and returns None.

    path: that of the config, if the user gave one. Code of a config that was found by name, directly or by an include,
    runs only if it belongs to this user, to root, or to the owner of the config at the path."""

    def __init__(
        self,
        read: ReadDocument,
        settings: Iterable[Setting],
        faults: ErrorList,
        studies: Studies,
        path: FilePath | None = None,
    ):
        cached: ReadDocument = cache(read)
        self.path = path
        self.files, self.faults, self.studies = ConfigFiles(cached), faults, studies
        settings = list(settings)
        self.common = [s for s in settings if s.key.split(".")[0] in COMMON_KEYS]
        self.settings = [s for s in settings if s.key.split(".")[0] not in COMMON_KEYS]
        self.open_configs: dict[tuple[FilePath, ...], Expansion] = {}
        self.named_scenarios: dict[str, list[Content]] = {}  # by stem, those that cases name after all is in its place

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
        self.files = replace(self.files, scenarios=_defined_scenarios(document))
        expansion = self._expand(document, (), overlays)
        common, drafts = expansion.common, expansion.drafts
        cases = [case for draft in drafts if (case := self._checked_case(draft))]
        stem = config_name(document)
        self._check_name(stem, document)
        self._refuse_equal_names(cases, document)
        self._refuse_unknown_counts(common, drafts, document)
        self._refuse_mixture(drafts, document)
        self._check_figure_names(common, drafts, document)
        self._check_figures(common, cases, document)
        if self.faults:
            return None
        counts = common.realisations
        return Experiment(
            stem=stem,
            study=cases[0].study,
            path=str(document.file) if document.file else None,
            cases=tuple(cases),
            realisations=counts if isinstance(counts, int) else max(case.realisations for case in cases),
            seed=cases[0].seed if common.seed is None else common.seed,
            figures=common.cases_of_figures(),
            changes_included=changes_included(document),
            like=common.like or "",
            runs=common.runs or "",
            content=self._complete_content(expansion.content, document),
        )

    def _check_name(self, stem: str, document: Document) -> None:
        """Add an error for a name that no folder of results can have."""
        if "name" in document.data and (not is_stem(stem) or is_reserved(stem)):
            message = "must be of letters, digits and _ + = - . and not begin with a dot"
            self.faults.add(document.origin(("name",)), ("name",), RESERVED if is_reserved(stem) else message, stem)

    def _complete_content(self, content: Content, document: Document) -> Content | None:
        """The content of the config with the scenarios that its sweeps name; None where a name means several."""
        if any(scenario != scenarios[0] for scenarios in self.named_scenarios.values() for scenario in scenarios):
            return None
        scenarios = {stem: scenarios[0] for stem, scenarios in self.named_scenarios.items()}
        other_keys = {key: document.data.get(key) for key in ("figures", "runs")} | {"scenarios": scenarios}
        return content | {key: value for key, value in other_keys.items() if value}

    def _expand(self, document: Document, chain: tuple[FilePath, ...], overlays: OverlaidKeys) -> Expansion:
        """A config expanded under the overlays, of which the nearest comes first."""
        owner = foreign_owner(document.file, self.path) if document.file and names_code(document.data) else None
        if owner is not None:
            message = f"names code and belongs to another user ({owner}): to run it, give its path in place of a name"
            self.faults.add(Origin(str(document.file)), (), message)
            return Expansion(CommonKeys(), [], {})
        common = self._common_keys(document.with_keys(COMMON_KEYS))
        if "include" in document.data:
            study_drafts, content = self._included_drafts(document, common, chain, overlays)
        else:
            study_drafts, content = self._own_draft(document, common, overlays)
        drafts = self._sweep_drafts(document, common, study_drafts, overlays)
        values = {key: getattr(common, key) for key in ("realisations", "seed") if getattr(common, key) is not None}
        keys = [key for key in ("sweep", "realisations", "seed") if key in document.data]
        content |= {key: document.data[key] for key in keys}
        if common.sweep:
            content["sweep"] = sweep_with_data_paths(document, self._data_files(drafts, document))
        return Expansion(common, [replace(draft, **values) for draft in drafts], content)

    def _data_files(self, drafts: list[Draft], document: Document) -> dict[tuple[str, str], FilePath]:
        """The data files of drafts by folder and name as written, if a sweep may name some."""
        values = [value for swept in document.data["sweep"].values() for value in swept]
        if not any(isinstance(value, str | dict) for value in values):
            return {}
        return {
            (folder_of(draft.document.origin(path)), str(draft.document.get(path))): file
            for draft in drafts
            for path, file in data_files(draft.document, self.studies.keys(draft.study))
        }

    def _common_keys(self, document: Document) -> CommonKeys:
        """The common keys; without those that have errors, so that the rest of the config is checked as well."""
        common = validate(CommonKeys, document, self.faults)
        if not common:
            good = {
                key: v
                for key, v in document.data.items()
                if validate(CommonKeys, document.with_keys((key,)), ErrorList())
            }
            common = CommonKeys.model_validate(good)
        if common.realisations is None and "realisations" in document.data:
            return common.model_copy(update={"realisations": 1})  # its fault is noted; it must not be called missing
        return common

    def _own_draft(self, document: Document, common: CommonKeys, overlays: OverlaidKeys) -> tuple[list[Draft], Content]:
        """The one draft of a config with a study of its own, and its content."""
        if common.study is None or not self.studies.is_study(common.study):
            if "study" not in document.data:
                message = f"required key is missing: one of {', '.join(self.studies.study_names())}"
                self.faults.add(document.origin(()), ("study",), message)
            elif common.study is not None:
                self._add_unknown_study(document, common.study)
            return [], {}
        study_keys, study = document.without_keys(COMMON_KEYS), common.study
        for overlay in overlays:
            study_keys, study = self._carry_to_study(study_keys, study, overlay)
            study_keys = overlay_keys(
                study_keys, self.studies.keys(study), overlay.without_keys(COMMON_KEYS), self.files, self.faults
            )
        for setting in self.settings:
            study_keys = self._with_setting(study_keys, study, setting)
        study_keys = inline_scenarios(study_keys, self.studies.keys(study), self.files, self.faults)
        stem = config_name(document)
        content = {"name": stem, "study": study, **with_data_paths(study_keys, self.studies.keys(study)).data}
        return [Draft(study_keys, stem, study, (), common.realisations, common.seed)], content

    def _add_unknown_study(self, document: Document, name: str) -> None:
        """Add the error that no study has this name."""
        names = self.studies.study_names()
        message = f"must be one of {', '.join(names)}{did_you_mean(name, names)}"
        self.faults.add(document.origin(("study",)), ("study",), message, name)

    def _carry_to_study(self, document: Document, study: str, overlay: Document) -> tuple[Document, str]:
        """Convert a config to the study beside `include`, if one is given there. Returns document and study."""
        wanted_study = overlay.data.get("study", study)
        if wanted_study == study or not isinstance(wanted_study, str):  # what is no text is a fault already noted
            return document, study
        if not self.studies.is_study(wanted_study):
            self._add_unknown_study(overlay, wanted_study)
            return document, study
        data = self.studies.keys(wanted_study).convert_keys(study, document.data)
        if data is None:
            accepting = [
                name
                for name in self.studies.usable_studies()
                if self.studies.keys(name).convert_keys(study, {}) is not None
            ]
            alternative = f", or one that takes over its keys: {', '.join(accepting)}" if accepting else ""
            message = f"must be that of the config, {study}{alternative}"
            self.faults.add(overlay.origin(("study",)), ("study",), message, wanted_study)
            return document, study
        sorted_lists = {key: sorted(items, key=is_code) for key, items in data.items() if isinstance(items, list)}
        return document.with_data((), data | sorted_lists), wanted_study

    def _included_drafts(
        self, document: Document, common: CommonKeys, chain: tuple[FilePath, ...], overlays: OverlaidKeys
    ) -> tuple[list[Draft], Content]:
        """The drafts of all included configs, with the keys beside `include` laid over each, and their content."""
        if changes_included(document) or common.study is not None:
            overlays = (document.without_keys(set(COMMON_KEYS) - {"study"}), *overlays)
        chain = (*chain, document.file.resolve()) if document.file else chain
        drafts: list[Draft] = []
        contents: list[Content] = []
        for i, name in enumerate(common.include or ()):
            origin = document.origin(("include", i))
            if isinstance(name, dict):
                expansion = self._include_mapping(document, i, chain, overlays)
            else:
                expansion = self._include_config(name, origin, ("include", i), document.file, chain, overlays)
            drafts += expansion.drafts if expansion else []
            contents += [expansion.content] if expansion else []
            if len(drafts) > MAX_CASES:
                self.faults.add(origin, ("include",), f"more than {MAX_CASES} cases")
                return [], {}
        return drafts, {"include": contents}

    def _include_mapping(
        self, document: Document, i: int, chain: tuple[FilePath, ...], overlays: OverlaidKeys
    ) -> Expansion | None:
        """A config that stands itself under `include`, expanded; None if an error was added."""
        path: KeyPath = ("include", i)
        included = document.below(path)
        if "include" not in included.data and "name" not in included.data:
            self.faults.add(document.origin(path), path, "needs a name, of which its cases are called")
            return None
        if len(chain) > MAX_INCLUDE_DEPTH:
            self.faults.add(document.origin(path), path, f"includes nested more than {MAX_INCLUDE_DEPTH} deep")
            return None
        return self._expand(included, (*chain, FilePath()), overlays)

    def _include_config(
        self,
        name: str,
        origin: Origin,
        path: KeyPath,
        including_file: FilePath | None,
        chain: tuple[FilePath, ...],
        overlays: OverlaidKeys,
    ) -> Expansion | None:
        """An included config, expanded; None if an error was added."""
        file = config_file(name, including_file) if is_stem(name) else None
        if not is_stem(name):
            self.faults.add(origin, path, "must be the stem of a config, without folder or suffix", name)
        elif file is None:
            self.faults.add(origin, path, no_such_config(name, self.studies), name)
        elif file.resolve() in chain:
            self.faults.add(origin, path, "a config cannot include itself", name)
        elif len(chain) > MAX_INCLUDE_DEPTH:
            self.faults.add(origin, path, f"includes nested more than {MAX_INCLUDE_DEPTH} deep", name)
        elif (cache_key := (file.resolve(), *(FilePath(overlay.source) for overlay in overlays))) in self.open_configs:
            return self.open_configs[cache_key]
        elif included := self.files.read(file, self.faults):
            expansion = self._expand(included, chain, overlays)
            if changes_included(included):
                expansion = expansion.renamed(config_name(included))
            return self.open_configs.setdefault(cache_key, expansion)
        return None

    def _sweep_drafts(
        self, document: Document, common: CommonKeys, drafts: list[Draft], overlays: OverlaidKeys
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
            for other_key in (*(swept_key for swept_key, _ in draft.swept_values), *earlier_keys):
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
        swept = (*draft.swept_values, *((setting.key, setting.value) for setting in settings))
        return replace(draft, document=document, swept_values=swept)

    def _with_setting(self, document: Document, study: str, setting: Setting) -> Document:
        """A document with a setting; adds an error if its key has no place."""
        try:
            return place_setting(document, self.studies.keys(study), setting, self.files, self.faults)
        except NoSuchKey as error:
            self.faults.add(setting.origin, (), str(error))
            return document

    def _checked_case(self, draft: Draft) -> Case | None:
        """The checked case of a draft; None if errors were added."""
        model = self.studies.keys(draft.study)
        document = inline_scenarios(draft.document, model, self.files, self.faults)
        self._note_scenarios(named_scenarios(draft.document, model), document, model)
        document = resolve_data_files(document, model, self.faults)
        document, outside = separate_code_filters(document, model, self.studies.filter_from_code, self.faults)
        document, against = self._split_baselines(document, model)
        spec = validate(model, document, self.faults, also=COMMON_KEYS)
        if draft.realisations is None:
            self.faults.add(document.origin(()), ("realisations",), "required key is missing")
        counts, name = draft.realisations, draft.name
        count = counts.get(name) if isinstance(counts, Mapping) else counts
        if spec is None or count is None:
            return None
        seed = 1 if draft.seed is None else draft.seed
        return Case(
            name,
            draft.stem,
            draft.study,
            spec,
            draft.swept_values,
            count,
            seed,
            further_baselines=against,
            user_filters=outside,
        )

    def _note_scenarios(self, stems: Mapping[str, str], document: Document, model: type[StudyKeys]) -> None:
        """Keep the scenarios that a case still names, by key and stem, as they stand in its inlined document."""
        scenarios = with_data_paths(document, model).data if stems else {}
        for key, stem in stems.items():
            self.named_scenarios.setdefault(stem, []).append(scenarios[key])

    def _split_baselines(self, document: Document, model: type[StudyKeys]) -> tuple[Document, tuple[str, ...]]:
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
                validate(model, documents[i], self.faults, also=COMMON_KEYS)
        return documents[0], tuple(names[1:])

    def _refuse_equal_names(self, cases: list[Case], document: Document) -> None:
        """Add an error for each case whose name another case has."""
        names: set[str] = set()
        key = ("include",) if "include" in document.data else ("sweep",)
        for case in cases:
            if case.name in names:
                self.faults.add(document.origin(key), key, f"makes the case {one_line(case.name)!r} twice")
            names.add(case.name)

    def _refuse_unknown_counts(self, common: CommonKeys, drafts: list[Draft], document: Document) -> None:
        """Add an error for each number of realisations of a case that does not exist."""
        names = [draft.name for draft in drafts]
        for name in common.realisations if isinstance(common.realisations, dict) else ():
            if name not in names:
                path = ("realisations", name)
                message = f"no case has this name{did_you_mean(name, names)}"
                self.faults.add(document.key_origin(path), path, message)

    def _refuse_mixture(self, drafts: list[Draft], document: Document) -> None:
        """Add an error if the cases belong to several studies."""
        studies = {draft.study for draft in drafts}
        if len(studies) > 1:
            message = f"one study per run; these belong to {', '.join(sorted(studies))}"
            self.faults.add(document.origin(("include",)), ("include",), message)

    def _check_figure_names(self, common: CommonKeys, drafts: list[Draft], document: Document) -> None:
        """Add an error for each figure that the study cannot draw, if its schema lists its figures."""
        names_by_study = [self.studies.keys(study).figure_names for study in {draft.study for draft in drafts}]
        if len(names_by_study) != 1 or names_by_study[0] is None:
            return
        figure_names = (*names_by_study[0], *extension_figures(), *COMMON_FIGURES)
        for n, figure in enumerate(common.figures):
            if not any(matches_pattern(figure, name) or matches_pattern(name, figure) for name in figure_names):
                has_mapping = isinstance(common.figures, dict)
                path = ("figures", figure if has_mapping else n)
                hint = did_you_mean(figure, names_by_study[0]) or f"; there are: {', '.join(figure_names)}"
                origin = document.key_origin(path) if has_mapping else document.origin(path)
                self.faults.add(origin, path, f"no such figure{hint}", *([] if has_mapping else [figure]))

    def _check_figures(self, common: CommonKeys, cases: list[Case], document: Document) -> None:
        """Add an error for each pattern that matches no case, since its figure would be empty."""
        if self.faults:
            return
        for figure, patterns in common.cases_of_figures().items():
            for i, pattern in enumerate(patterns):
                if not any(matches_pattern(case.name, pattern) for case in cases):
                    path = ("figures", figure, i)
                    hint = did_you_mean(pattern, [case.name for case in cases])
                    self.faults.add(document.origin(path), path, f"no case has this name{hint}", pattern)


def _defined_scenarios(document: Document) -> dict[str, Document]:
    """The scenarios that a config itself defines, by stem."""
    scenarios = document.data.get("scenarios")
    stems = scenarios if isinstance(scenarios, dict) else {}
    return {stem: document.below(("scenarios", stem)) for stem in stems}


def _is_below(path: KeyPath, places: Iterable[KeyPath]) -> bool:
    """Whether a path leads to one of these places or to a part of one."""
    return any(path[: len(place)] == place for place in places)


def paths_overlap(path: KeyPath, other_path: KeyPath) -> bool:
    """Whether two paths lead to the same value, or one to a part of the other's."""
    common_length = min(len(path), len(other_path))
    return path[:common_length] == other_path[:common_length]

"""Filters of the user's own code in a config: where they are, and what names their stored blocks.

`python: my_filter.py:MyFilter` is a file beside the config; `python: my_package.my_module:MyFilter` a module that is
found there or is installed. `weights: net.npz` is given to the class as a path that can be opened.

The identity of such a filter must be known before stored blocks are looked for, and must contain all that its numbers
depend on. It consists of

* its keys, the texts of its modules, and the files that these and the keys name
  (`radarsim.studies.user_filters.sources`), when the config is read: nothing runs for it;
* what it reads when its module is imported afresh and it runs on the first realisations of its case
  (`radarsim.studies.user_filters.recording`), when the identity is first asked for. This is done anew for each config
  that is read, and nothing of it is kept on disk: only a run shows which files are read now that one has been edited,
  has appeared, or is named by an environment variable;
* the key `identity`, by which the user declares what no file shows.

All batches are recorded. If one reads a file that the identity does not contain, the run ends with an error, so that
its sums are not stored. A worker process records for itself, and refuses to compute if it finds another identity."""

import contextlib
import importlib
import os
import sys
import threading
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, fields, replace
from functools import cached_property, partial
from pathlib import Path
from typing import Any

from radarsim.config.common_keys import UserFilterKeys
from radarsim.config.experiment import Case
from radarsim.config.identity import digest
from radarsim.errors import ConfigError
from radarsim.language.translate import join_names, shorten_names, tr
from radarsim.studies.user_filters.estimates import components_of
from radarsim.studies.user_filters.filters import CalledFilter, Plots, UserFilter, build_filter
from radarsim.studies.user_filters.loaded_code import LoadedCode, forget, imported_names, is_namespace, parent_packages
from radarsim.studies.user_filters.recording import Reads, Recorder
from radarsim.studies.user_filters.sources import (
    Kind,
    by_relative_path,
    digest_of,
    file_of,
    home_folder,
    is_installed,
    signature,
    sources,
    with_paths,
)
from radarsim.user_code import errors as user_code_errors

RECORDED_REALISATIONS = 16  # the first ones, on which it is recorded what a filter reads
MAX_NAMED_FILES = 3  # in a message, or one more

_lock = threading.RLock()  # one thread at a time is in code of the user's, which need not know of threads
_loaded: dict[str, "LoadedCode"] = {}  # by what is read: an object of the code serves all filters that read the same
_latest: dict[tuple[str, str, str], "LoadedCode"] = {}  # by folder, name, and hash of the sources


def filter_from_code(
    keys: UserFilterKeys, place: str, baseline: bool, folder: Path, first_plots: Callable[[Case, int], Plots]
) -> "CodeFilter":
    """The filter that a config in a folder names at a place. ConfigError where there is none, or none may run.

    Code that a result names by its hash is looked for beside its config, then in the working directory."""
    if user_code_errors.is_code_forbidden():
        raise ConfigError(f"is code of yours, and --no-code runs none, got {keys.python!r}")
    where, _, object_name = keys.python.rpartition(":")
    if not where or not object_name.isidentifier():
        raise ConfigError(f"must be FILE.py:NAME or MODULE:NAME, got {keys.python!r}")
    home, module = _place_of_code(folder, where)
    if keys.source is not None and file_of(home, module) is None:
        folder = Path()
        home, module = _place_of_code(folder, where)
    if file_of(home, module) is None:
        raise ConfigError(_missing_code(Path(home, where) if where.endswith(".py") else None, keys))
    arguments, files_of_keys = with_paths(folder, dict(keys.model_extra or {}))
    module_sources = sources(home, module)
    if keys.source is not None and not module_sources.digest.startswith(keys.source):
        current_digest = module_sources.digest[: len(keys.source)]
        raise ConfigError(
            f"{file_of(home, module)} is other code than that of the result: {current_digest}, not {keys.source}"
        )
    return CodeFilter(
        name=keys.name,
        keys=keys,
        place=place,
        folders=(*module_sources.folders, os.path.abspath(folder)),
        folder=home,
        module=module,
        object_name=object_name,
        arguments=arguments,
        named_files=(*module_sources.files, *((file, "content") for file in files_of_keys)),
        sources_digest=module_sources.digest,
        first_plots=first_plots,
        baseline=baseline,
    )


def _place_of_code(folder: Path, where: str) -> tuple[str, str]:
    """The folder from which the code that a config in a folder names is imported, and the module."""
    if where.endswith(".py"):
        file = Path(os.path.abspath(folder / where))
        return str(file.parent), file.stem
    return home_folder(where, os.path.abspath(folder)), where


def _missing_code(file: Path | None, keys: UserFilterKeys) -> str:
    """The message that there is no such file, or no such module."""
    if keys.source is not None:
        return (
            f"neither beside this file nor in the working directory: {keys.python}; a result does not contain the code "
            "of its filters: put it there, as the result's author has it"
        )
    if file is not None:
        return f"no such file: {file}"
    return f"no such module, neither beside the config nor installed: {keys.python.rpartition(':')[0]}"


def _span(plots: Plots) -> str:
    """The realisations of plots, as a slice, and their case."""
    return f"{plots.first}:{plots.first + plots.n} of {plots.world.case}"


@dataclass(frozen=True)
class Recording:
    """What the identity of a filter holds: SHA-256 of files by path and kind, signatures of those that were read, and
    by which name its code is loaded."""

    files: Mapping[tuple[str, Kind], str]
    signatures: Reads
    code: str


@dataclass(frozen=True)
class CodeFilter(UserFilter):
    """A class or function of the user's own, which is imported where it is first needed.

    place: where the config names it; folders: the user's, whose files count; folder, module, object_name: what is
    imported from where; arguments: what it is called with; named_files: those that its text and its keys name;
    sources_digest: SHA-256 of the text when the config was read; first_plots: those of a case; case: the one that it
    belongs to."""

    name: str
    keys: UserFilterKeys
    place: str
    folders: tuple[str, ...]
    folder: str
    module: str
    object_name: str
    arguments: Mapping[str, Any]
    named_files: tuple[tuple[str, Kind], ...]
    sources_digest: str
    first_plots: Callable[[Case, int], Plots]
    baseline: bool = False
    case: Case | None = field(default=None, compare=False, repr=False)

    def __getstate__(self) -> dict[str, Any]:
        """Without what is recorded and loaded, which every process does for itself."""
        return {f.name: getattr(self, f.name) for f in fields(self)}

    def bound_to(self, case: Case) -> "CodeFilter":
        """The filter as one of a case: the same where the case differs in nothing that the filter may see."""
        bound = self.case
        if bound is None or bound.spec is not case.spec or bound.noise_keys is not case.noise_keys:
            return replace(self, case=case)
        same = (bound.study, bound.name, bound.seed) == (case.study, case.name, case.seed)
        return self if same else replace(self, case=case)

    @property
    def identity(self) -> str:  # type: ignore[override]
        """SHA-256 of what its numbers depend on. Runs it on the first realisations of its case, unless it has been."""
        return digest(
            {
                "object": self.object_name,
                "one_by_one": self.keys.one_by_one,
                "keys": dict(self.keys.model_extra or {}),
                "declared": self.keys.identity,
                "files": by_relative_path(self.folder, self.recording.files),
            }
        )

    @property
    def written(self) -> dict[str, Any]:  # type: ignore[override]
        return dict(self.keys.model_dump(exclude_defaults=True, exclude={"source"}))

    @property
    def file(self) -> str:
        """The file of its module."""
        return str(file_of(self.folder, self.module))

    @property
    def components(self) -> tuple[str, ...]:  # type: ignore[override]
        return components_of(self.target)

    @property
    def target(self) -> Any:
        """The class or function. ConfigError where it cannot be imported."""
        return self._target_in(self._loaded_code())

    def _target_in(self, code: LoadedCode) -> Any:
        module = code.modules[self.module]
        if not callable(target := getattr(module, self.object_name, None)):
            objects = {name: value for name, value in vars(module).items() if callable(value)}
            defined = [name for name, value in objects.items() if getattr(value, "__module__", "") == self.module]
            names = ", ".join(defined) or "none"
            raise ConfigError(f"{self.place}: no class or function {self.object_name} in {self.file}; it has {names}")
        return target

    @cached_property
    def recording(self) -> Recording:
        """What it reads on the first realisations of its case; ConfigError where it fails on these."""
        assert self.case is not None  # a case binds its filters
        plots = self.first_plots(self.case, RECORDED_REALISATIONS)
        with _lock:
            code = self._loaded_code()
            reads = self._record_reads(code, plots)
            if reads.keys() != code.reads.keys():  # it may remember what it has read for others
                code = self._import_code()
                reads = self._record_reads(code, plots)
            files = {
                read: digest_of(*read)
                for read in (*self.named_files, *reads)
                if not code.recorder.is_changed_by_code(*read)
            }
            reads = {read: recorded for read, recorded in reads.items() if read in files}
            if changed := [path for (path, _), recorded in reads.items() if signature(path) != recorded]:
                raise ConfigError(f"{self._title}: {changed[0]} changed while it was read; start again")
            key = digest([self.folder, self.module, sorted((*read, content) for read, content in files.items())])
            _loaded[key] = code
        return Recording(files, reads, key)

    def _record_reads(self, code: LoadedCode, plots: Plots) -> Reads:
        """What is read where the code is imported and runs on plots."""
        self._estimates(code, plots)
        return code.reads_of_import | code.take_reads()

    def estimates(self, plots: Plots) -> Any:
        recording = self.recording
        with _lock:
            code = _loaded[recording.code]
            estimates = self._estimates(code, plots)
            reads = code.take_reads()
        late = [path for path, kind in reads if (path, kind) not in recording.files]
        if late and self.keys.identity is None:
            raise ConfigError(
                f"{self._title}, reads {shorten_names(late, MAX_NAMED_FILES)} in realisations {_span(plots)}, but not "
                f"in the first {RECORDED_REALISATIONS}, by whose files its stored blocks are named: name it by a text "
                f"in {self.file} or in a key of the filter, or declare what its numbers depend on by the key `identity`"
            )
        for read, read_signature in reads.items():
            same = read_signature == recording.signatures.get(read) == signature(read[0])
            if not same and digest_of(*read) != recording.files.get(read, digest_of(*read)):
                raise ConfigError(f"{self._title}: {read[0]} has changed since the run began; start it again")
        return estimates

    def warnings(self) -> list[str]:
        """What its numbers may depend on that its identity does not hold, in one line; none if that is declared."""
        if self.keys.identity is not None:
            return []
        recorder = self._loaded_code().recorder
        places = []
        if recorder.elsewhere:
            names = shorten_names(sorted(recorder.elsewhere), MAX_NAMED_FILES)
            places.append(tr("files outside its folders ({files})", files=names))
        if recorder.hidden:
            names = shorten_names(sorted(recorder.hidden), MAX_NAMED_FILES)
            places.append(tr("files that it also writes ({files})", files=names))
        if recorder.hosts:
            places.append(tr("the network ({hosts})", hosts=shorten_names(sorted(recorder.hosts), MAX_NAMED_FILES)))
        if recorder.starts_processes:
            places.append(tr("processes that it starts"))
        if recorder.reads_compiled:
            places.append(tr("machine code kept by Numba, which outlives edits of other files"))
        if not places:
            return []
        return [
            tr(
                "{name}: stored blocks do not notice changes of what the filter takes from {places}; when they change, "
                "change its key `identity`",
                name=self.name,
                places=join_names(places),
            )
        ]

    @property
    def _title(self) -> str:
        return f"{self.place}: filter {self.name}, {self.keys.python}"

    def _loaded_code(self) -> LoadedCode:
        """The code with which it was recorded; before that, the code that was last imported, where it may serve."""
        with _lock:
            if "recording" in vars(self):
                return _loaded[self.recording.code]
            code = _latest.get((self.folder, self.module, self.sources_digest))
            return code if code is not None and code.is_fresh() else self._import_code()

    def _estimates(self, code: LoadedCode, plots: Plots) -> Any:
        """What the filter gives for plots, with its code recorded."""
        target = self._target_in(code)
        with self._running(f"fails in realisations {_span(plots)}"), code.running():
            build = partial(build_filter, self.name, target) if isinstance(target, type) else partial(partial, target)
            user_filter = CalledFilter(self.name, build(**self.arguments), takes_one_realisation=self.keys.one_by_one)
            return user_filter.estimates(plots)

    def _import_code(self) -> LoadedCode:
        """The module, imported afresh with all of the user's modules that it imports."""
        module_sources = sources(self.folder, self.module)
        if module_sources.digest != self.sources_digest:
            raise ConfigError(f"{self.file} is not what it was when the config was read")
        for name in set(module_sources.modules).intersection(sys.modules).difference(imported_names):
            file, loaded = module_sources.modules[name], getattr(sys.modules[name], "__file__", None)
            if not (loaded and os.path.realpath(loaded) == os.path.realpath(file)):
                raise ConfigError(
                    f"{self.place}: {file}: give it another name: {name} is {loaded or 'of Python itself'} here"
                )
        code = LoadedCode(self.folder, Recorder(self.folders))
        with self._running("cannot be imported"):
            imported_names.update(module_sources.modules)
            parents = {parent for name in module_sources.modules for parent in parent_packages(name)}
            forget({*imported_names, *(name for name in parents if is_namespace(name))})
            importlib.invalidate_caches()
            with code.running():
                code.modules[self.module] = importlib.import_module(self.module)
        code.reads_of_import = code.take_reads()
        _latest[self.folder, self.module, self.sources_digest] = code
        return code

    @contextlib.contextmanager
    def _running(self, failure: str) -> Iterator[None]:
        """The user's code runs within, in one thread: its output goes to stderr, its errors are shown as its own."""
        with _lock, contextlib.redirect_stdout(sys.stderr):
            try:
                yield
            except KeyboardInterrupt:
                raise
            except ConfigError as error:
                raise ConfigError(*(f"{self.place}: {line}" for line in error.lines)) from error
            except BaseException as error:
                line = f"{self._title}, {failure}:"
                package = self.module.partition(".")[0] if is_installed(self.folder) else ""
                code_folder = os.path.join(self.folder, package)
                advice = f": of a package, it is {Path(self.folder).name}.{self.module}:{self.object_name}"
                hint = advice if "no known parent package" in user_code_errors.value_text(error) else ""
                raise ConfigError(
                    line, *user_code_errors.user_frames(error, code_folder), user_code_errors.value_text(error) + hint
                ) from error

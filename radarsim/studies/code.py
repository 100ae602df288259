"""Filters of the user's own code in a config: where they are, what names their stored blocks, and the code itself, run.

`python: my_filter.py:MyFilter` is a file beside the config; `python: my_package.my_module:MyFilter` a module that is
found there, or is installed. `weights: net.npz` is given to the class as a path that can be opened.

The identity of such a filter must be known before stored blocks are looked for, and must hold all that its numbers
depend on. It is made of

* its keys, the texts of its modules, and the files that these and the keys name (`radarsim.studies.user_code_sources`),
  when the config is read: nothing runs for it;
* what it reads when its module is imported afresh and it runs on the first realisations of its case
  (`radarsim.studies.user_code_recording`), when the identity is first asked for. This is done anew for each config that
  is read, and nothing of it is kept on disk: only a run shows which files are read now that one has been edited, has
  appeared, or is named by an environment variable;
* the key `identity`, by which the user declares what no file shows.

All batches are recorded. One that reads a file which the identity does not hold ends the run with an error, so that its
sums are not stored. A worker process records for itself, and refuses to compute where it finds another identity."""

import contextlib
import importlib
import os
import sys
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, fields, replace
from functools import cached_property, partial
from pathlib import Path
from types import ModuleType
from typing import Any

from radarsim import failures
from radarsim.config.experiment import Case, digest
from radarsim.config.schema import OwnCode
from radarsim.errors import ConfigError
from radarsim.language import few, listed, tr
from radarsim.module_sources import check_bytecode
from radarsim.studies.interface import Study
from radarsim.studies.outside import Called, Outside, Plots, components_of, made_of
from radarsim.studies.user_code_recording import Reads, Recorder
from radarsim.studies.user_code_sources import (
    Kind,
    by_relative_path,
    digest_of,
    file_of,
    home_of,
    is_installed,
    signature,
    sources,
    with_paths,
)

FORBIDDEN = "RADARSIM_NO_CODE"  # in the environment, so that processes of a run keep to it as well
RECORDED_REALISATIONS = 16  # the first ones, on which it is recorded what a filter reads
MAX_NAMED_FILES = 3  # in a message, or one more

_lock = threading.RLock()  # one thread at a time is in code of the user's, which need not know of threads
_loaded: dict[str, "LoadedCode"] = {}  # by what is read: an object of the code serves all filters that read the same
_latest: dict[tuple[str, str, str], "LoadedCode"] = {}  # by folder, name, and hash of the sources
_imported_names: set[str] = set()  # of modules that were imported here: they may be imported anew, and from elsewhere


def coded(
    keys: OwnCode, place: str, baseline: bool, folder: Path, first_plots: Callable[[Case, int], Plots]
) -> "Coded":
    """The filter that a config in a folder names at a place. ConfigError where there is none, or none may run."""
    if os.environ.get(FORBIDDEN):
        raise ConfigError(f"is code of yours, and --no-code runs none, got {keys.python!r}")
    where, _, object_name = keys.python.rpartition(":")
    if not where or not object_name.isidentifier():
        raise ConfigError(f"must be FILE.py:NAME or MODULE:NAME, got {keys.python!r}")
    if where.endswith(".py"):
        file = Path(os.path.abspath(folder / where))
        home, module, missing = str(file.parent), file.stem, f"no such file: {file}"
    else:
        home, module = home_of(where, os.path.abspath(folder)), where
        missing = f"no such module, neither beside the config nor installed: {where}"
    if file_of(home, module) is None:
        raise ConfigError(missing)
    arguments, files_of_keys = with_paths(folder, dict(keys.model_extra or {}))
    module_sources = sources(home, module)
    return Coded(
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


def _span(plots: Plots) -> str:
    """The realisations of plots, as a slice, and their case."""
    return f"{plots.first}:{plots.first + plots.n} of {plots.world.case}"


class LoadedCode:
    """A module of the user's as imported afresh, the modules that it imports, and the record of what it reads."""

    def __init__(self, folder: str, recorder: Recorder):
        self.folder, self.recorder = folder, recorder
        self.modules: dict[str, ModuleType] = {}
        self.reads: Reads = {}
        self.reads_of_import: Reads = {}
        self._surroundings = self._snapshot_surroundings()

    @contextlib.contextmanager
    def running(self) -> Iterator[None]:
        """Python knows the modules by their names and finds others in their folder, and what is read is recorded."""
        _forget(_imported_names.difference(self.modules))
        sys.modules.update(self.modules)
        sys.path.insert(0, self.folder)
        setting, sys.dont_write_bytecode = sys.dont_write_bytecode, True  # nothing is written beside the user's files
        working = os.getcwd()
        try:
            with self.recorder.recording():
                yield
            if (other := os.getcwd()) != working:
                os.chdir(working)
                raise OSError(
                    f"it changed the working directory to {other}, where results would be written: open files by "
                    "Path(__file__).parent, or change it back"
                )
        finally:
            sys.dont_write_bytecode = setting
            with contextlib.suppress(ValueError):  # the code itself may have removed it
                sys.path.remove(self.folder)
            if self.recorder.imported:
                self._keep_modules()

    def take_reads(self) -> Reads:
        """What was read since the last call; `reads` keeps all of it."""
        reads = self.recorder.take()
        self.reads |= reads
        return reads

    def is_fresh(self) -> bool:
        """Whether an import would find the files, folders and variables that this one found."""
        unchanged = all(signature(path) == recorded for (path, _), recorded in self.reads.items())
        return unchanged and self._surroundings == self._snapshot_surroundings()

    def _snapshot_surroundings(self) -> tuple[Any, ...]:
        """What else decides what an import finds: working directory, environment, folders."""
        return os.getcwd(), dict(os.environ), [signature(folder) for folder in self.recorder.folders]

    def _keep_modules(self) -> None:
        """Note the user's modules that were imported since, with the packages without a file that they lie in."""
        for name, module in list(sys.modules.items()):
            if _file_of_module(module) in self.recorder.imported:
                check_bytecode(module)
                names = [name, *(parent for parent in _parents(name) if _is_namespace(parent))]
                self.modules |= {name: sys.modules[name] for name in names}
        _imported_names.update(self.modules)
        self.recorder.imported.clear()


def _file_of_module(module: object) -> str:
    file = getattr(module, "__dict__", {}).get("__file__")
    return os.path.abspath(file) if isinstance(file, str) else ""


def _forget(names: Iterable[str]) -> None:
    """Python forgets these modules, so that they are imported afresh; except studies, whose keys must remain the same
    class."""
    for name in [name for name in names if name in sys.modules]:
        if not any(isinstance(value, Study) for value in vars(sys.modules[name]).values()):
            del sys.modules[name]


def _parents(name: str) -> Iterator[str]:
    while "." in name:
        yield (name := name.rpartition(".")[0])


def _is_namespace(name: str) -> bool:
    """Whether a name is that of a package without a file, which holds on to the modules within it."""
    return name in sys.modules and not _file_of_module(sys.modules[name])


@dataclass(frozen=True)
class Recording:
    """What the identity of a filter holds: SHA-256 of files by path and kind, signatures of those that were read, and
    by which name its code is loaded."""

    files: Mapping[tuple[str, Kind], str]
    signatures: Reads
    code: str


@dataclass(frozen=True)
class Coded(Outside):
    """A class or function of the user's own, which is imported where it is first needed.

    place: where the config names it; folders: the user's, whose files count; folder, module, object_name: what is
    imported from where; arguments: what it is called with; named_files: those that its text and its keys name;
    sources_digest: SHA-256 of the text when the config was read; first_plots: those of a case; case: the one that it
    belongs to."""

    name: str
    keys: OwnCode
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

    def bound_to(self, case: Case) -> "Coded":
        """The filter as one of a case: the same where the case differs in nothing that the filter may see."""
        bound = self.case
        if bound is None or bound.spec is not case.spec or bound.noise_of is not case.noise_of:
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
        return dict(self.keys.model_dump(exclude_defaults=True))

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
                f"{self._title}, reads {few(late, MAX_NAMED_FILES)} in realisations {_span(plots)}, but not in the "
                f"first {RECORDED_REALISATIONS}, by whose files its stored blocks are named: name it by a text in "
                f"{self.file} or in a key of the filter, or declare what its numbers depend on by the key `identity`"
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
            names = few(sorted(recorder.elsewhere), MAX_NAMED_FILES)
            places.append(tr("files outside its folders ({files})", files=names))
        if recorder.hidden:
            names = few(sorted(recorder.hidden), MAX_NAMED_FILES)
            places.append(tr("files that it also writes ({files})", files=names))
        if recorder.hosts:
            places.append(tr("the network ({hosts})", hosts=few(sorted(recorder.hosts), MAX_NAMED_FILES)))
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
                places=listed(places),
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
            build = partial(made_of, self.name, target) if isinstance(target, type) else partial(partial, target)
            user_filter = Called(self.name, build(**self.arguments), alone=self.keys.one_by_one)
            return user_filter.estimates(plots)

    def _import_code(self) -> LoadedCode:
        """The module, imported afresh with all of the user's modules that it imports."""
        module_sources = sources(self.folder, self.module)
        if module_sources.digest != self.sources_digest:
            raise ConfigError(f"{self.file} is not what it was when the config was read")
        for name in set(module_sources.modules).intersection(sys.modules).difference(_imported_names):
            file, loaded = module_sources.modules[name], getattr(sys.modules[name], "__file__", None)
            if not (loaded and os.path.realpath(loaded) == os.path.realpath(file)):
                raise ConfigError(
                    f"{self.place}: {file}: give it another name: {name} is {loaded or 'of Python itself'} here"
                )
        code = LoadedCode(self.folder, Recorder(self.folders))
        with self._running("cannot be imported"):
            _imported_names.update(module_sources.modules)
            parents = {parent for name in module_sources.modules for parent in _parents(name)}
            _forget({*_imported_names, *(name for name in parents if _is_namespace(name))})
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
                hint = advice if "no known parent package" in failures.words(error) else ""
                raise ConfigError(line, *failures.frames(error, code_folder), failures.words(error) + hint) from error

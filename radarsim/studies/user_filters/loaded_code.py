"""A module of the user's own code, imported afresh, with a record of what it reads."""

import contextlib
import os
import sys
from collections.abc import Iterable, Iterator
from types import ModuleType
from typing import Any

from radarsim.studies.interface import Study
from radarsim.studies.user_filters.recording import Reads, Recorder
from radarsim.studies.user_filters.sources import signature
from radarsim.user_code.module_sources import check_bytecode

imported_names: set[str] = set()  # of modules that were imported here: they may be imported anew, and from elsewhere


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
        forget(imported_names.difference(self.modules))
        sys.modules.update(self.modules)
        sys.path.insert(0, self.folder)
        setting, sys.dont_write_bytecode = sys.dont_write_bytecode, True  # nothing is written beside the user's files
        working = os.getcwd()
        try:
            with self.recorder.recording():
                yield
            if (directory := os.getcwd()) != working:
                os.chdir(working)
                raise OSError(
                    f"it changed the working directory to {directory}, where results would be written: open files by "
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
                names = [name, *(parent for parent in parent_packages(name) if is_namespace(parent))]
                self.modules |= {name: sys.modules[name] for name in names}
        imported_names.update(self.modules)
        self.recorder.imported.clear()


def _file_of_module(module: object) -> str:
    file = getattr(module, "__dict__", {}).get("__file__")
    return os.path.abspath(file) if isinstance(file, str) else ""


def forget(names: Iterable[str]) -> None:
    """Python forgets these modules, so that they are imported afresh; except studies, whose keys must remain the same
    class."""
    for name in [name for name in names if name in sys.modules]:
        if not any(isinstance(value, Study) for value in vars(sys.modules[name]).values()):
            del sys.modules[name]


def parent_packages(name: str) -> Iterator[str]:
    """The packages around a module, the nearest first."""
    while "." in name:
        yield (name := name.rpartition(".")[0])


def is_namespace(name: str) -> bool:
    """Whether a name is that of a package without a file, which holds on to the modules within it."""
    return name in sys.modules and not _file_of_module(sys.modules[name])

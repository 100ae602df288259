"""What a user's code reads while it runs: files, folders that it lists, and what no hash of a file can cover.

An audit hook of Python's sees what is opened, imported, loaded by `ctypes`, listed, connected and started, in the
thread that runs the user's code and in threads that are started there. It is installed with the first recording, cannot
be removed, and returns at once in every other thread. What a library in C opens by itself raises no event, nor do
environment variables and the clock."""

import contextlib
import os
import stat
import sys
import threading
from collections.abc import Callable, Collection, Iterator
from functools import cache, partial
from importlib.util import source_from_cache
from types import FrameType
from typing import Any
from urllib.parse import unquote

from radarsim.studies.user_filters.sources import Kind, Signature, signature
from radarsim.user_code.files import is_program_file, is_within, program_folders
from radarsim.user_code.module_sources import INSTALLED

Reads = dict[tuple[str, Kind], Signature | None]

IMPORTING = {
    "importlib._bootstrap_external",
    "_frozen_importlib_external",
    "runpy",
    "zipimport",
    "linecache",
    "tokenize",
}
LISTING = {"importlib", "_frozen_importlib_external", "pkgutil", "zipimport"}  # look through folders for modules
COMPILED = (".nbi", ".nbc")  # machine code that Numba keeps beside a module


class Recorder:
    """What the code of one module, and what it calls, has read since it was imported.

    folders: the user's; of other files only the names are kept, for a warning. hidden: files of the user's folders
    that the code both reads and writes."""

    def __init__(self, folders: Collection[str]):
        self.reads: Reads = {}
        self.imported: set[str] = set()  # files of the user's modules, until somebody clears them
        self.elsewhere: set[str] = set()
        self.hidden: set[str] = set()
        self.hosts: set[str] = set()
        self.starts_processes = self.reads_compiled = False
        self._read: set[str] = set()
        self._written: set[str] = set()
        self._shared: set[str] = set()
        self.folders = tuple({place for folder in folders for place in (folder, os.path.realpath(folder))})

    @contextlib.contextmanager
    def recording(self) -> Iterator[None]:
        """This thread, and threads that it starts, are recorded within."""
        _install()
        outer, _this_thread.recorder = _this_thread.recorder, self
        try:
            yield
        finally:
            _this_thread.recorder = outer

    def take(self) -> Reads:
        """What was read since the last call in the user's folders, except what the code itself changes."""
        reads, self.reads = self.reads, {}
        for (path, kind), read_signature in list(reads.items()):  # a thread of the code's may still be reading
            if path in self._shared and kind == "content" and signature(path) != read_signature:
                self.hidden.add(path)
        return {read: value for read, value in list(reads.items()) if not self.is_changed_by_code(*read)}

    def is_changed_by_code(self, path: str, kind: Kind) -> bool:
        """Whether the code itself writes a file, or into a folder that it lists."""
        if kind == "names":
            return any(os.path.dirname(file) == path for file in self._written)
        return kind == "content" and (path in self._written or path in self.hidden)

    def is_users(self, path: str) -> bool:
        """Whether a path is in the user's folders, and not in a folder of programs within these."""
        home = max((len(folder) for folder in self.folders if is_within(path, folder)), default=-1)
        programs = max((len(folder) for folder in program_folders() if is_within(path, folder)), default=-1)
        if home < 0 or home < programs:
            return False
        return not (INSTALLED | {"__pycache__"}) & set(path[home:].split(os.sep))

    def note_read(
        self, path: str, kind: Kind, frame: FrameType | None, shared: bool = False, imported: bool = False
    ) -> None:
        """Note that a file or a folder is read; shared: that it may be written too; imported: as a module."""
        if shared:
            self._shared.add(path)
        if path in self._written or (path, kind) in self.reads:
            return  # what the code itself wrote before is nothing that it depends on
        current = signature(path)
        if current is None or not (stat.S_ISDIR if kind == "names" else stat.S_ISREG)(current[0]):
            return
        if self.is_users(path) or (imported and not is_program_file(path)):
            if imported:
                self.imported.add(path)
            self.reads[path, kind] = current
            self._read.add(path)
        elif kind == "content" and not is_program_file(path) and self._is_called_by_user(frame):
            self.elsewhere.add(path)

    def note_written(self, path: str) -> None:
        """Note that a file is opened to be written."""
        if path in self._read:
            self.hidden.add(path)
        self._written.add(path)

    def note_host(self, frame: FrameType | None, host: str) -> None:
        """Note that a host is connected."""
        if self._is_called_by_user(frame):
            self.hosts.add(host)

    def note_process(self, frame: FrameType | None) -> None:
        """Note that a process is started."""
        if self._is_called_by_user(frame):
            self.starts_processes = True

    def _is_called_by_user(self, frame: FrameType | None) -> bool:
        """Whether the user's code runs what happens, and not the import of a library."""
        while frame is not None:
            name = frame.f_code.co_filename
            if name.startswith("<frozen importlib"):
                return False
            if self.is_users(os.path.abspath(name)):
                return True
            frame = frame.f_back
        return True  # a thread of the user's code


class _ThreadState(threading.local):
    """The recorder of a thread."""

    recorder: Recorder | None = None


_this_thread = _ThreadState()


def _absolute_path(path: Any) -> str | None:
    """An absolute path; None for what is none, such as a number of an open file."""
    try:
        return os.path.abspath(os.fsdecode(path))
    except (TypeError, ValueError, OSError):
        return None


def _module_of(frame: FrameType | None) -> str:
    return "" if frame is None else str(frame.f_globals.get("__name__", ""))


def _on_open(recorder: Recorder, frame: FrameType | None, path: Any, mode: Any, flags: Any) -> None:
    file = _absolute_path(path)
    if file is None or not isinstance(flags, int):
        return
    kind: Kind = "code" if file.endswith(".py") and _module_of(frame) in IMPORTING else "content"
    access = flags & (os.O_WRONLY | os.O_RDWR)
    if os.path.basename(os.path.dirname(file)) == "__pycache__":
        recorder.reads_compiled |= file.endswith(COMPILED) and access == os.O_RDONLY
        with contextlib.suppress(ValueError):
            recorder.note_read(source_from_cache(file), "code", frame, imported=True)
        return
    writes, reads = access != os.O_RDONLY, access != os.O_WRONLY and not flags & (os.O_TRUNC | os.O_EXCL)
    if writes and not (reads and os.path.exists(file)):
        recorder.note_written(file)
    else:
        recorder.note_read(file, kind, frame, shared=writes, imported=kind == "code")


def _on_import(recorder: Recorder, frame: FrameType | None, _: Any, file: Any, *__: Any) -> None:
    if file is not None and (path := _absolute_path(file)) is not None:  # an extension, which no `open` tells of
        recorder.note_read(path, "content", frame, imported=True)


def _on_library(recorder: Recorder, frame: FrameType | None, name: Any) -> None:
    if name and os.sep in os.fsdecode(name) and (path := _absolute_path(name)) is not None:
        recorder.note_read(path, "content", frame)


def _on_listing(recorder: Recorder, frame: FrameType | None, folder: Any = None) -> None:
    path = _absolute_path(os.curdir if folder is None else folder)
    if path is not None and _module_of(frame).partition(".")[0] not in LISTING:
        recorder.note_read(path, "names", frame)


def _on_database(recorder: Recorder, frame: FrameType | None, database: Any) -> None:
    text = os.fsdecode(database)
    if text.startswith("file:"):
        text = unquote(text.removeprefix("file:").partition("?")[0])
    if text and text != ":memory:" and (path := _absolute_path(text)) is not None:
        recorder.note_read(path, "content", frame, shared=True)


def _on_connection(recorder: Recorder, frame: FrameType | None, _: Any, address: Any) -> None:
    if isinstance(address, tuple):
        recorder.note_host(frame, f"{address[0]}:{address[1]}")


def _on_process(recorder: Recorder, frame: FrameType | None, *_: Any) -> None:
    recorder.note_process(frame)


def _run_recorded(recorder: Recorder, run: Callable[[], None]) -> None:
    with recorder.recording():
        run()


PROCESSES = ("subprocess.Popen", "os.system", "os.posix_spawn", "os.exec", "os.fork", "os.forkpty")
EVENTS: dict[str, Callable[..., None]] = {
    "open": _on_open,
    "import": _on_import,
    "ctypes.dlopen": _on_library,
    "os.listdir": _on_listing,
    "os.scandir": _on_listing,
    "sqlite3.connect": _on_database,
    "socket.connect": _on_connection,
    "socket.sendto": _on_connection,
    **dict.fromkeys(PROCESSES, _on_process),
}


def _hook(event: str, arguments: tuple[Any, ...], state: _ThreadState = _this_thread, events: Any = EVENTS) -> None:
    """The names are bound here, since the interpreter clears those of the module before its last events."""
    recorder = state.recorder
    if recorder is None or (handle := events.get(event)) is None:
        return
    state.recorder = None  # what follows raises events too
    try:
        handle(recorder, sys._getframe(1), *arguments)
    finally:
        state.recorder = recorder


@cache
def _install() -> None:
    sys.addaudithook(_hook)
    start = threading.Thread.start

    def start_recorded(self: threading.Thread) -> None:
        if _this_thread.recorder is not None:
            self.run = partial(_run_recorded, _this_thread.recorder, self.run)  # type: ignore[method-assign]
        start(self)

    # An event tells of it from Python 3.12 on only.
    threading.Thread.start = start_recorded  # type: ignore[method-assign]

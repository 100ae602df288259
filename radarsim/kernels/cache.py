"""Where machine code is kept: a folder for all that a kernel is made from, so that no edit goes unnoticed.

The folder of a kernel is named after the hash of its sources (`radarsim.kernels.call_graph`). An entry is a file of its
own: SHA-256, then the content, written whole or not at all, so that processes need no lock. What is not exactly that
is a miss. (Numba keeps an index beside its entries and unpickles both as they are: an empty or altered file ends the
run with EOFError, UnpicklingError or a crash in the loaded code, and a full disk with OSError.)

An entry is a pickle and machine code, so whoever writes it decides what runs. Only files and folders are used that
nobody but the user and root can have made or changed; what is written here is for the user alone.

A cache that cannot be read or written is left alone after the first time; `troubles` then has a line for the user."""

import contextlib
import functools
import hashlib
import os
import re
import tempfile
import uuid
from collections.abc import Callable
from pathlib import Path

from radarsim.kernels.call_graph import source_hash
from radarsim.system.private_files import (
    UntrustedFileError,
    distrust_reason,
    make_trusted_folder,
    read_trusted,
    write_private_file,
)

SUFFIX = ".kernel"
DIGEST = 32

troubles: dict[str, str] = {}  # lines for the user, by kind: one each in a process


class KernelEntries:
    """The entries of one kernel: a file for each key; `compiler` names what else they depend on, as versions."""

    def __init__(self, function: Callable, compiler: str):
        self._function, self._compiler = function, compiler
        name = re.sub(r"[^\w.]", "", f"{function.__module__}.{function.__qualname__}")[-80:]
        self.name = f"{name}-{function.__code__.co_firstlineno}"

    @functools.cached_property
    def folder(self) -> Path:
        """Known at the first call: by then all that the kernel calls is imported."""
        text = f"{self._compiler} {source_hash(self._function)}"
        return ROOT / f"kernels-{hashlib.sha256(text.encode()).hexdigest()[:16]}"

    def path(self, key: tuple) -> Path:
        """The file of a key."""
        return self.folder / f"{self.name}-{hashlib.sha256(repr(key).encode()).hexdigest()[:16]}{SUFFIX}"

    def read(self, key: tuple) -> bytes | None:
        """The content of an entry; None where there is none, or none that may be used."""
        path = self.path(key)
        try:
            raw = read_trusted(path)
        except (FileNotFoundError, NotADirectoryError):
            return None
        except UntrustedFileError as error:
            if reason := distrust_reason(self.folder):
                self._report_folder(reason)
            else:
                add_trouble("trust", f"{path} is not used, as it {error.strerror}; the kernel is compiled again")
            return None
        except OSError as error:
            add_trouble("read", f"{path}: cannot be read: {error.strerror}; the kernel is compiled again")
            return None
        content = raw[DIGEST:]
        if hashlib.sha256(content).digest() != raw[:DIGEST]:
            self.report_damage(key, ValueError("not what was written"))
            return None
        return content

    def report_damage(self, key: tuple, error: Exception) -> None:
        """Say that an entry is not what was written."""
        path = self.path(key)
        add_trouble("damaged", f"{path}: damaged ({type(error).__name__}); the kernel is compiled again")

    def write(self, key: tuple, content: bytes) -> None:
        """Keep an entry, where the folder belongs to the user alone."""
        if "write" in troubles:
            return
        try:
            make_trusted_folder(self.folder)
            write_private_file(self.path(key), hashlib.sha256(content).digest() + content)
        except UntrustedFileError as error:
            self._report_folder(error.strerror)
        except OSError as error:
            line = f"{self.folder}: compiled kernels cannot be kept: {error.strerror}; each run compiles again"
            add_trouble("write", line)

    def remove(self) -> None:
        """Remove the entries of this kernel."""
        for path in self.folder.glob(f"{self.name}-*{SUFFIX}"):
            path.unlink(missing_ok=True)

    def _report_folder(self, reason: str) -> None:
        add_trouble("write", f"{self.folder} is not used, as it {reason}; each run compiles again")


def add_trouble(kind: str, line: str) -> None:
    """A line for the user, if it is the first of its kind."""
    troubles.setdefault(kind, f"kernel cache: {line}")


def cache_root() -> Path:
    """The first of $RADARSIM_CACHE_DIR, $XDG_CACHE_HOME/radarsim, ~/.cache/radarsim, temporary folder that can be used.

    Passed over are places that cannot be written, and those where another user could put code. Of these, and of the
    variable's place, `troubles` has a line. Where none is left, the first of them: nothing is kept then, which
    `troubles` says too."""
    home = os.environ.get("XDG_CACHE_HOME") or os.path.join(os.path.expanduser("~"), ".cache")
    chosen = os.environ.get("RADARSIM_CACHE_DIR")
    candidates = [*filter(None, [chosen, os.path.join(home, "radarsim")])]
    refusals: dict[str, str] = {}
    for candidate in candidates:
        try:
            make_trusted_folder(candidate)
            with tempfile.TemporaryFile(dir=candidate):
                root = Path(candidate)
                break
        except UntrustedFileError as error:
            refusals[candidate] = f"{candidate} is not used, as it {error.strerror}"
        except OSError as error:
            if candidate == chosen:
                refusals[candidate] = f"{candidate} cannot be written: {error.strerror}"
    else:
        try:
            root = temporary_root()
        except OSError as error:
            lines = [refusals.get(candidate, f"{candidate} cannot be written") for candidate in candidates]
            add_trouble("write", f"{'; '.join(lines)}; no temporary folder: {error.strerror}; each run compiles again")
            return Path(candidates[0])
    if refusals:
        add_trouble("trust", f"{'; '.join(refusals.values())}; compiled kernels are kept in {root}")
    return root


def temporary_root() -> Path:
    """A folder of the user's in the common temporary one; a new one each time where another's hand may be in it.

    Raises OSError where there is none, or others may replace what lies in it."""
    parent = Path(tempfile.gettempdir())
    if hasattr(os, "getuid"):
        folder = parent / f"radarsim-{os.getuid()}"
        with contextlib.suppress(FileExistsError, UntrustedFileError):  # a file, a link that leads nowhere
            make_trusted_folder(folder)
            return folder
    folder = parent / f"radarsim-{uuid.uuid4().hex}"
    make_trusted_folder(folder)
    return folder


ROOT = cache_root()

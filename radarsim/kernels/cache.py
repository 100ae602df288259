"""Where machine code is kept: a directory for each set of sources, so that no edit goes unnoticed.

Numba's cache on disk looks at the file of the compiled function alone: an edit of a function that it calls, in another
file, goes unnoticed and gives silently wrong results. So the directory of a kernel is named after a hash of the sources
that its module rests on, wherever they lie. An edit in one study's kernels leaves those of the others as they are.
"""

import contextlib
import functools
import hashlib
import os
import stat
import tempfile
from pathlib import Path

import numba

from radarsim.kernels import sources

SOURCES = "sources.json"  # what is known of source files; see `sources.remember`


@functools.cache
def directory(module: str) -> Path:
    """Where the kernels of a module are kept, by all that it compiles: itself and what it imports of kernels."""
    package = module.partition(".")[0]
    files = sources.closure([module], lambda name: name.split(".")[0] in (package, "radarsim"))
    sources.remember(ROOT / SOURCES)
    text = f"{numba.__version__} {sources.digest(files)}"
    return ROOT / f"kernels-{hashlib.sha256(text.encode()).hexdigest()[:16]}"


def cache_root() -> Path:
    """The first writable of $RADARSIM_CACHE_DIR, $XDG_CACHE_HOME/radarsim, ~/.cache/radarsim, temporary directory."""
    home = os.environ.get("XDG_CACHE_HOME") or os.path.join(os.path.expanduser("~"), ".cache")
    candidates = [os.environ.get("RADARSIM_CACHE_DIR"), os.path.join(home, "radarsim")]
    for candidate in filter(None, candidates):
        try:
            Path(candidate).mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryFile(dir=candidate):
                return Path(candidate)
        except OSError:
            continue
    return temporary_root()


def temporary_root() -> Path:
    """A directory of ours alone in the common temporary one; a new one each time where another's hand may be in it."""
    if not hasattr(os, "getuid"):
        return Path(tempfile.mkdtemp(prefix="radarsim-"))
    path = Path(tempfile.gettempdir()) / f"radarsim-{os.getuid()}"
    with contextlib.suppress(FileExistsError):
        path.mkdir(mode=0o700)
    status = path.lstat()
    ours = stat.S_ISDIR(status.st_mode) and status.st_uid == os.getuid() and not status.st_mode & 0o022
    return path if ours else Path(tempfile.mkdtemp(prefix="radarsim-"))


ROOT = cache_root()
sources.remembered(ROOT / SOURCES)

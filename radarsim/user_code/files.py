"""Which modules and files are the user's, and which come with Python, libraries or radarsim."""

import os
import sys
import sysconfig
from functools import cache
from pathlib import Path

from radarsim.user_code.module_sources import INSTALLED, module_spec

PACKAGE = str(Path(__file__).parents[1])
PROGRAM_FOLDERS = ("/proc", "/sys", "/dev", "/etc", "/usr", "/lib", "/lib64", "/bin", "/sbin", "/System", "/Library")


def is_user_module(top: str) -> bool:
    """Whether a top-level module is the user's: neither a library nor a part of Python or of radarsim."""
    spec = module_spec(top)
    if spec is None:
        return False
    paths = [spec.origin] if spec.has_location and spec.origin else list(spec.submodule_search_locations or [])
    return any(not is_program_file(path) for path in paths)


def is_within(path: str, folder: str) -> bool:
    """Whether a path is that of a folder, or lies in it."""
    return path == folder or path.startswith(folder.rstrip(os.sep) + os.sep)


@cache
def program_folders() -> tuple[str, ...]:
    """Folders of Python, of libraries and of radarsim, whose files are no data of the user's."""
    paths = {PACKAGE, sys.prefix, sys.base_prefix, *sysconfig.get_paths().values()}
    return tuple({folder for path in paths for folder in (path, os.path.realpath(path)) if folder != os.sep})


def is_program_file(path: str) -> bool:
    """Whether a file outside the user's folders is one that programs come with or keep for themselves."""
    caches = [value for name, value in os.environ.items() if "CACHE" in name and os.path.isabs(value)]
    if any(is_within(path, folder) for folder in (*program_folders(), *PROGRAM_FOLDERS, *caches)):
        return True
    hidden = os.path.join(os.path.expanduser("~"), ".")
    return path.startswith(hidden) or bool((INSTALLED | {"__pycache__"}) & set(path.split(os.sep)))

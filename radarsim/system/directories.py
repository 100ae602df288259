"""Whether a directory exists."""

import stat
from pathlib import Path


def is_directory(path: Path) -> bool:
    """Whether a directory exists; raises OSError where access is denied. Path.is_dir raises that only up to Python
    3.13: later it returns False without access."""
    try:
        return stat.S_ISDIR(path.stat().st_mode)
    except (FileNotFoundError, NotADirectoryError):
        return False

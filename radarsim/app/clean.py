"""Dropping stored blocks: what `radarsim clean` removes, and nothing beyond DIR/.blocks."""

import os
import re
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from radarsim.config.experiment import Experiment
from radarsim.engine.audit import removable
from radarsim.engine.blocks import QUESTION
from radarsim.engine.store import is_directory
from radarsim.errors import ConfigError, StoreError
from radarsim.studies.identity import identity


@dataclass(frozen=True)
class Cleaned:
    """How much was dropped, or would be: files and bytes of so many identities."""

    path: Path
    identities: int
    files: int
    size: int


def clean(
    out: str | os.PathLike[str], experiments: Iterable[Experiment] | None = None, dry_run: bool = False
) -> Cleaned:
    """Drop the stored blocks of all experiments, or of some, below out/.blocks; with dry_run only say how much.

    Of a case those that other sources made go too.

    Links are not followed and files that no store makes are left, and with them their folder. Raises ConfigError if
    `out` does not exist or its .blocks is a link, StoreError if a file cannot be removed.
    """
    blocks = Path(out) / ".blocks"
    if not is_directory(Path(out)):
        raise ConfigError(f"{out}: no such directory of results")
    if blocks.is_symlink():
        raise ConfigError(f"{blocks}: is a link; clean the directory that it points to")
    wanted = None
    if experiments is not None:
        wanted = {identity(case)[:QUESTION] for experiment in experiments for case in experiment.cases}
    try:
        folders = [path for path in sorted(blocks.iterdir()) if _is_identity(path)] if is_directory(blocks) else []
        folders = [path for path in folders if wanted is None or path.name[:QUESTION] in wanted]
        files = [one for folder in folders for one in removable(folder)]
        if not dry_run:
            for path, _ in files:
                path.unlink(missing_ok=True)
            for folder in [*folders, blocks]:
                with suppress(OSError):  # somebody else's file is in it
                    folder.rmdir()
    except OSError as error:
        raise StoreError(f"{error.filename or blocks}: cannot be removed: {error.strerror}") from error
    return Cleaned(blocks, len(folders), len(files), sum(size for _, size in files))


def _is_identity(path: Path) -> bool:
    return bool(re.fullmatch(r"[0-9a-f]{2,128}", path.name)) and path.is_dir() and not path.is_symlink()

"""`radarsim clean`: stored blocks that nothing needs are removed, and nothing outside DIR/.blocks."""

import os
import re
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from radarsim.api.stored_cases import stored_cases
from radarsim.config.experiment import Experiment
from radarsim.engine.blocks import REQUEST_DIGITS
from radarsim.engine.store.store import removable_files
from radarsim.errors import ConfigError, StoreError
from radarsim.studies.identity import identity, request_digest
from radarsim.system.directories import is_directory


@dataclass(frozen=True)
class RemovedBlocks:
    """The amount dropped, or to be dropped: files and bytes of so many identities.

    not_judged: cases whose blocks remain, since only a run of the user's filter tells which are of other sources."""

    path: Path
    identities: int
    files: int
    size: int
    not_judged: tuple[str, ...] = ()


def clean(
    out: str | os.PathLike[str],
    experiments: Iterable[Experiment] | None = None,
    dry_run: bool = False,
    other_sources: bool = False,
) -> RemovedBlocks:
    """Drop the stored blocks of all experiments, or of some, below out/.blocks; with dry_run only count them.

    This includes a case's blocks from other sources. With other_sources only these are dropped, without experiments
    those of all results below `out`; a user's filter is run for it, but only where experiments are given. Links are not
    followed; files that no store makes remain, and so do their folders. Raises ConfigError if `out` does not exist or
    its .blocks is a link, StoreError if a file cannot be removed."""
    blocks = Path(out) / ".blocks"
    if not is_directory(Path(out)):
        raise ConfigError(f"{out}: no such directory of results")
    if blocks.is_symlink():
        raise ConfigError(f"{blocks}: is a link; clean the directory that it points to")
    cases = None if experiments is None else [case for experiment in experiments for case in experiment.cases]
    not_judged: list[str] = []
    if cases is None and other_sources:
        recorded = stored_cases(Path(out))
        cases = [case for _, case in recorded if not case.user_filters]
        not_judged = [name for name, case in recorded if case.user_filters]
    requests = None if cases is None else {request_digest(case)[:REQUEST_DIGITS] for case in cases}
    keep = {identity(case) for case in cases or ()} if other_sources else set()
    try:
        folders = [path for path in sorted(blocks.iterdir()) if _is_identity(path)] if is_directory(blocks) else []
        folders = [path for path in folders if requests is None or path.name[:REQUEST_DIGITS] in requests]
        folders = [path for path in folders if path.name not in keep]
        files = [file for folder in folders for file in removable_files(folder)]
        if not dry_run:
            for path, _ in files:
                path.unlink(missing_ok=True)
            for folder in [*folders, blocks]:
                with suppress(OSError):  # somebody else's file is in it
                    folder.rmdir()
    except OSError as error:
        raise StoreError(f"{error.filename or blocks}: cannot be removed: {error.strerror}") from error
    return RemovedBlocks(blocks, len(folders), len(files), sum(size for _, size in files), tuple(not_judged))


def _is_identity(path: Path) -> bool:
    return bool(re.fullmatch(r"[0-9a-f]{2,128}", path.name)) and path.is_dir() and not path.is_symlink()

"""`radarsim doctor`: the machine, and all that is stored of a result.

`radarsim compile`: compilation before the first run.
"""

import hashlib
import json
import os
import re
import shutil
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from radarsim.app.configs import CaseWork, load
from radarsim.app.configs import document as lookup
from radarsim.app.result import recorded_case
from radarsim.app.selftest import tolerance
from radarsim.config.experiment import Case
from radarsim.engine.blocks import Node, Partial, simulated
from radarsim.engine.results import Sums
from radarsim.engine.store import (
    Audit,
    audited,
    available_cores,
    described,
    folder_of,
    instruction_set,
    is_directory,
    platform_name,
)
from radarsim.errors import ConfigError, StoreError
from radarsim.report import files

# ---- doctor ----------------------------------------------------------------------------------------------------------
LOOKS, LOOK_S = 4, 0.25
ROUNDINGS = 10  # a power p ≤ 4 of an error, and heavy tails in it


def machine() -> dict[str, str]:
    """The machine, what runs on it, and where compiled kernels are kept, a text each."""
    from radarsim.kernels import compile

    facts, cache = described(), compile.ROOT
    kept = [path.stat().st_size for path in cache.rglob("*") if path.is_file()] if cache.is_dir() else []
    writable = "writable" if os.access(cache, os.W_OK) else "not writable"
    free = shutil.disk_usage(Path.cwd()).free
    return {
        "machine": f"{facts['processor']}, {facts['cores']} cores; {facts['system']}",
        "instructions": instruction_set(),
        "threads": f"{available_cores()} by default",
        "cache": f"{cache}: {len(kept)} files, {sum(kept) / 1e6:.1f} MB, {writable}",
        "disk": f"{free / 1e9:.1f} GB free here",
        "versions": ", ".join(f"{name} {version}" for name, version in files.versions().items()),
        "cluster": cluster(),
    }


def cluster() -> str:
    """Whether Dask is installed."""
    from importlib.metadata import PackageNotFoundError, version

    try:
        return f"Dask distributed {version('distributed')}"
    except PackageNotFoundError:
        return "Dask is not installed; `pip install 'radarsim[cluster]'` adds --workers and --scheduler"


@dataclass
class Inspection:
    """Findings about a result: how much was checked, faults that each name a file, and notes."""

    folder: Path
    outputs: int = 0
    pieces: int = 0
    realisations: int = 0
    recomputed: list[str] = field(default_factory=list)
    faults: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)


def inspected(folder: str | os.PathLike[str], recompute: int = 0) -> Inspection:
    """Check a folder of results against its run.json, and all stored blocks of its cases; recompute some of them.

    recompute is the number of stored pieces to recompute for each case, the smallest first. Raises ConfigError where
    the folder holds no results, and where blocks cannot be recomputed because the sources have changed.
    """
    found = Inspection(Path(folder))
    blocks = _blocks(found.folder)
    record = _settled(found)
    if _digest(record["resolved"]) != record["resolved_sha256"]:
        found.faults.append(f"{found.folder / 'run.json'}: damaged: the config in it is not the one that ran")
    elsewhere = []
    for name, stored_as in record["identities"].items():
        store = blocks / stored_as
        if not is_directory(store):
            found.notes.append(f"{store}: no blocks of {name} are stored, so the tables cannot be checked against them")
            continue
        audit = audited(store, int(record["cases"][name]["done"]))
        found.pieces += len(audit.pieces)
        found.faults += audit.faults
        found.notes += audit.notes
        if recompute and not _recomputed(found, audit, recorded_case(record, name), recompute):
            elsewhere.append(name)
    if elsewhere and not found.faults:
        raise ConfigError(
            f"{found.folder}: {', '.join(elsewhere)}: cannot be computed again, the sources that compute have changed "
            "since; all that is stored is whole"
        )
    return found


def _blocks(folder: Path) -> Path:
    """Where the blocks of a folder of results lie (the folder may be `.` or a link): beside its name, or its target."""
    beside = [Path(os.path.abspath(folder)).parent, folder.resolve().parent]
    return next((one / ".blocks" for one in beside if is_directory(one / ".blocks")), folder.parent / ".blocks")


def _settled(found: Inspection) -> dict[str, Any]:
    """The record with its outputs checked; repeated a few times, since another run may be writing just now."""
    for look in range(LOOKS):
        time.sleep(LOOK_S if look else 0)
        record, found.outputs, found.faults = _record(found.folder), 0, []
        _outputs(found, record["outputs"])
        if not found.faults:
            break
    return record


def _record(folder: Path) -> dict[str, Any]:
    path, blocks = folder / "run.json", _blocks(folder)
    hint = f"; `radarsim check CONFIG --out {blocks.parent}` says what is stored there" if is_directory(blocks) else ""
    try:
        record: dict[str, Any] = json.loads(files.read(path))
        for key, kind in (("outputs", dict), ("identities", dict), ("cases", dict), ("resolved", dict)):
            if not isinstance(record[key], kind):
                raise ValueError(f"{key} is no table")
        record["resolved_sha256"], record["study"]
        for name, recorded in record["identities"].items():
            if not isinstance(record["cases"][name]["done"], int) or not re.fullmatch("[0-9a-f]{2,128}", recorded):
                raise ValueError(f"identity or realisations of {name} are invalid")
    except (FileNotFoundError, NotADirectoryError) as error:
        raise ConfigError(f"{folder}: no run.json in it, so it is no folder of results{hint}") from error
    except OSError as error:
        raise StoreError(f"{path}: cannot be read: {error.strerror}") from error
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise StoreError(f"{path}: damaged, not a record of a run; `radarsim run` writes it again") from error
    return record


def _digest(value: object) -> str | None:
    """SHA-256 of the content of run.json, in hexadecimal; None for content that no run writes, such as NaN."""
    from radarsim.report.files import to_json

    try:
        return hashlib.sha256(to_json(value)).hexdigest()
    except (ValueError, RecursionError):
        return None


def _outputs(found: Inspection, outputs: dict[str, str]) -> None:
    for name, digest in outputs.items():
        path = found.folder / name
        if Path(name).is_absolute() or ".." in Path(name).parts:
            found.faults.append(f"{found.folder / 'run.json'}: damaged: an output outside the folder: {name}")
            continue
        try:
            data = files.read(path)
        except FileNotFoundError:
            found.faults.append(f"{path}: missing")
        except OSError as error:
            found.faults.append(f"{path}: cannot be read: {error.strerror}")
        else:
            found.outputs += 1
            if hashlib.sha256(data).hexdigest() != digest:
                found.faults.append(f"{path}: altered since it was written")


def _recomputed(found: Inspection, audit: Audit, case: Case | None, most: int) -> bool:
    """Recompute some pieces and compare; False if this program's sums are stored elsewhere."""
    if case is None or folder_of(audit.path.parent, CaseWork(case)) != audit.path:
        return False
    work, here = CaseWork(case), platform_name()
    elsewhere: set[str] = set()
    own = (piece for piece in audit.pieces if isinstance(piece, Node | Partial))
    for piece in sorted(own, key=lambda piece: piece.realisations(work.block)[1])[:most]:
        header, values = audit.pieces[piece]
        path = audit.path / f"{piece.name}.sums"
        found.realisations += header["count"]
        found.recomputed.append(str(path))
        if header["block"] != work.block or values.size != work.size:
            found.faults.append(f"{path}: is of other blocks than this program makes")
            continue
        elsewhere |= {*header["platforms"]} - {here}
        if not agree(work, simulated(work, piece), values, {*header["platforms"], here}):
            found.faults.append(f"{path}: computed again, the sums differ")
    if elsewhere:
        allowed = f"{tolerance(case.study).sampled:.0e} of sigma"
        found.notes.append(f"{audit.path}: made on {'; '.join(sorted(elsewhere))}: compared to within {allowed}")
    return True


def agree(work: CaseWork, made: Sums, stored: np.ndarray, platforms: set[str]) -> bool:
    """Whether sums agree with the stored ones: to the last bit on one platform, else as far as conditioning allows.

    An estimate may differ by the study's `Tolerance` in σ, so a sum of n errors to the power p by about n p σᵖ times
    that; other sums by that part of the largest in their array. σ is the largest of a filter and component over scans:
    with few realisations that of a single scan may be tiny by chance.
    """
    if len(platforms) < 2:
        return made.values.tobytes() == stored.tobytes()
    allowed = ROUNDINGS * tolerance(work.case.study).sampled
    for name, one in work.plan.layout.unpack(made.values).items():
        other = work.plan.layout.unpack(stored)[name]
        scale = np.abs(one).max(initial=0.0)
        if name == "error":
            sigma = np.sqrt(one[..., 1].max(axis=1, keepdims=True) / made.count)
            powers = np.stack([sigma, sigma**2, sigma**3, sigma**4], axis=-1) * made.count
            scale = np.maximum(powers, np.abs(one) * [0, 1, 1, 1])  # the sum of e itself may have either sign
        if not (np.abs(one - other) <= allowed * scale).all():
            return False
    return True


# ---- precompile ------------------------------------------------------------------------------------------------------
class Compiled(NamedTuple):
    """Compilation of a config's kernels: CPU seconds, almost none where machine code was cached."""

    config: str
    seconds: float


def compiled(configs: Sequence[str]) -> Iterator[Compiled]:
    """Compile the kernels of configs (default: all shipped ones) and cache their machine code.

    One realisation of each case is simulated and discarded. Raises ConfigError where the machine code cannot be cached.
    """
    from radarsim.kernels import compile

    for name in configs or lookup.stems("configs"):
        started = time.process_time()
        for case in load(name).cases:
            CaseWork(case).simulate(0, 1)
            if "write" in compile.troubles:
                raise ConfigError(compile.troubles["write"])
        yield Compiled(name, time.process_time() - started)

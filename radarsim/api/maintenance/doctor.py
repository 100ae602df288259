"""`radarsim doctor`: the machine, and the stored blocks and files of a result."""

import hashlib
import json
import os
import re
import shutil
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from radarsim.api.case_work import CaseWork
from radarsim.api.maintenance.self_test import tolerance
from radarsim.api.stored_cases import stored_case, stored_experiment
from radarsim.config.experiment import Case
from radarsim.engine.blocks import Node, Partial, simulate_piece
from radarsim.engine.machine import available_cores, instruction_set, machine_facts, platform_name
from radarsim.engine.store.audit import Audit, audit_blocks
from radarsim.engine.store.block_file import block_path, is_directory
from radarsim.engine.store.store import is_other_source, other_sources
from radarsim.engine.sums import Sums
from radarsim.errors import ConfigError, StoreError
from radarsim.private_files import foreign_owner
from radarsim.report import atomic_files, provenance

MAX_ATTEMPTS, ATTEMPT_INTERVAL_S = 4, 0.25
TOLERANCE_FACTOR = 10  # for a power p ≤ 4 of an error, and heavy tails in it


def machine() -> dict[str, str]:
    """The machine, what runs on it, and where compiled kernels are kept, a text each."""
    from radarsim.kernels import cache as kernel_cache

    facts, cache = machine_facts(), kernel_cache.ROOT
    file_sizes = [path.stat().st_size for path in cache.rglob("*") if path.is_file()] if cache.is_dir() else []
    writable = "writable" if os.access(cache, os.W_OK) else "not writable"
    free = shutil.disk_usage(Path.cwd()).free
    return {
        "machine": f"{facts['processor']}, {facts['cores']} cores; {facts['system']}",
        "instructions": instruction_set(),
        "threads": f"{available_cores()} by default",
        "cache": f"{cache}: {len(file_sizes)} files, {sum(file_sizes) / 1e6:.1f} MB, {writable}",
        "disk": f"{free / 1e9:.1f} GB free here",
        "versions": ", ".join(f"{name} {version}" for name, version in provenance.versions().items()),
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


def inspect_result(folder: str | os.PathLike[str], recompute: int = 0) -> Inspection:
    """Check a folder of results against its run.json, and all stored blocks of its cases; recompute some of them.

    recompute is the number of stored pieces to recompute for each case, the smallest first. Blocks that other sources
    made are noted. Raises ConfigError where the folder holds no results, and where blocks cannot be recomputed because
    the sources have changed."""
    inspection = Inspection(Path(folder))
    blocks = _blocks_folder(inspection.folder)
    record = _checked_record(inspection)
    if _digest(record["resolved"]) != record["resolved_sha256"]:
        inspection.faults.append(f"{inspection.folder / 'run.json'}: damaged: the config in it is not the one that ran")
    experiment = stored_experiment(record, inspection.folder)
    not_recomputable = []
    for name, stored_identity in record["identities"].items():
        store = blocks / stored_identity
        case = stored_case(record, name, experiment)
        runs_code = case is not None and any(user_filter.written for user_filter in case.user_filters)
        if recompute and runs_code:
            _refuse_foreign_record(inspection.folder / "run.json")
        inspection.notes += _notes_on_sources(store, name, case if recompute or not runs_code else None)
        if not is_directory(store):
            inspection.notes.append(
                f"{store}: no blocks of {name} are stored, so the tables cannot be checked against them"
            )
            continue
        audit = audit_blocks(store, int(record["cases"][name]["done"]))
        inspection.pieces += len(audit.pieces)
        inspection.faults += audit.faults
        inspection.notes += audit.notes
        if recompute and not _recompute_blocks(inspection, audit, case, recompute):
            not_recomputable.append(name)
    if not_recomputable and not inspection.faults:
        raise ConfigError(
            f"{inspection.folder}: {', '.join(not_recomputable)}: cannot be computed again, the sources that compute "
            "have changed since; all that is stored is intact"
        )
    return inspection


def _notes_on_sources(store: Path, name: str, case: Case | None) -> list[str]:
    """Notes on blocks of a case, or on further blocks of it, that other sources than these made."""
    present = store if case is None else store.with_name(CaseWork(case).identity)
    notes = []
    if is_other_source(present, store):
        notes.append(f"{store}: blocks of {name} were made by sources that have changed since: a run computes anew")
    stale = [path.name for path in other_sources(store) if path != present]
    if stale:
        notes.append(
            f"{store.parent}: further blocks of {name} by other sources, as before an edit: {', '.join(stale)}; "
            "`radarsim clean CONFIG --other-sources` removes them"
        )
    return notes


def _refuse_foreign_record(record: Path) -> None:
    """Raise ConfigError for a record of another user: the code that it names could be anybody's."""
    if (owner := foreign_owner(record)) is not None:
        raise ConfigError(f"{record}: names code and belongs to another user ({owner}), so nothing is computed again")


def _blocks_folder(folder: Path) -> Path:
    """Where the blocks of a result's folder lie: beside the folder, or beside its target where it is `.` or a link."""
    parents = [Path(os.path.abspath(folder)).parent, folder.resolve().parent]
    return next(
        (parent / ".blocks" for parent in parents if is_directory(parent / ".blocks")), folder.parent / ".blocks"
    )


def _checked_record(inspection: Inspection) -> dict[str, Any]:
    """The record, with its outputs checked; tried several times, since another run may be writing."""
    for attempt in range(MAX_ATTEMPTS):
        time.sleep(ATTEMPT_INTERVAL_S if attempt else 0)
        record, inspection.outputs, inspection.faults = _read_record(inspection.folder), 0, []
        _check_outputs(inspection, record["outputs"])
        if not inspection.faults:
            break
    return record


def _read_record(folder: Path) -> dict[str, Any]:
    """The run.json of a folder, checked to be the record of a run."""
    path, blocks = folder / "run.json", _blocks_folder(folder)
    hint = f"; `radarsim check CONFIG --out {blocks.parent}` says what is stored there" if is_directory(blocks) else ""
    try:
        record: dict[str, Any] = json.loads(atomic_files.read(path))
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
    from radarsim.report.provenance import to_json

    try:
        return hashlib.sha256(to_json(value)).hexdigest()
    except (ValueError, RecursionError):
        return None


def _check_outputs(inspection: Inspection, outputs: dict[str, str]) -> None:
    """Compare the output files of a record with their digests, and add the faults to the inspection."""
    for name, digest in outputs.items():
        path = inspection.folder / name
        if Path(name).is_absolute() or ".." in Path(name).parts:
            inspection.faults.append(f"{inspection.folder / 'run.json'}: damaged: an output outside the folder: {name}")
            continue
        try:
            data = atomic_files.read(path)
        except FileNotFoundError:
            inspection.faults.append(f"{path}: missing")
        except OSError as error:
            inspection.faults.append(f"{path}: cannot be read: {error.strerror}")
        else:
            inspection.outputs += 1
            if hashlib.sha256(data).hexdigest() != digest:
                inspection.faults.append(f"{path}: altered since it was written")


def _recompute_blocks(inspection: Inspection, audit: Audit, case: Case | None, max_pieces: int) -> bool:
    """Recompute some pieces and compare them; False if these blocks are not of this program's sources."""
    if case is None or CaseWork(case).identity != audit.path.name:
        return False
    work, this_platform = CaseWork(case), platform_name()
    other_platforms: set[str] = set()
    sum_pieces = (piece for piece in audit.pieces if isinstance(piece, Node | Partial))
    for piece in sorted(sum_pieces, key=lambda piece: piece.realisations(work.block)[1])[:max_pieces]:
        header, values = audit.pieces[piece]
        path = block_path(audit.path, piece)
        inspection.realisations += header["count"]
        inspection.recomputed.append(str(path))
        if header["block"] != work.block or values.size != work.size:
            inspection.faults.append(f"{path}: has other blocks than this program makes")
            continue
        other_platforms |= {*header["platforms"]} - {this_platform}
        if not sums_agree(work, simulate_piece(work, piece), values, {*header["platforms"], this_platform}):
            inspection.faults.append(f"{path}: computed again, the sums differ")
    if other_platforms:
        allowed = f"{tolerance(case.study).sampled:.0e} of sigma"
        inspection.notes.append(
            f"{audit.path}: made on {'; '.join(sorted(other_platforms))}: compared to within {allowed}"
        )
    return True


def sums_agree(work: CaseWork, computed: Sums, stored: np.ndarray, platforms: set[str]) -> bool:
    """Whether sums agree with the stored ones: to the last bit on one platform, else as far as conditioning allows.

    An estimate may differ by the study's `Tolerance` in σ, so a sum of n errors to the power p by about n p σᵖ times
    that; other sums by that part of the largest in their array. σ is the largest of a filter and component over scans:
    with few realisations that of a single scan may be tiny by chance."""
    if len(platforms) < 2:
        return computed.values.tobytes() == stored.tobytes()
    allowed = TOLERANCE_FACTOR * tolerance(work.case.study).sampled
    for name, computed_sums in work.plan.layout.unpack(computed.values).items():
        stored_sums = work.plan.layout.unpack(stored)[name]
        scale = np.abs(computed_sums).max(initial=0.0)
        if name == "error":
            sigma = np.sqrt(computed_sums[..., 1].max(axis=1, keepdims=True) / computed.count)
            powers = np.stack([sigma, sigma**2, sigma**3, sigma**4], axis=-1) * computed.count
            scale = np.maximum(powers, np.abs(computed_sums) * [0, 1, 1, 1])  # the sum of e itself may have either sign
        if not (np.abs(computed_sums - stored_sums) <= allowed * scale).all():
            return False
    return True

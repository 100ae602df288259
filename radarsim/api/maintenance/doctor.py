"""`radarsim doctor`: the machine, and the stored blocks and files of a result."""

import hashlib
import os
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from radarsim.api.case_work import CaseWork
from radarsim.api.maintenance.inspection import Inspection
from radarsim.api.maintenance.recompute import Progress, WorkBudget, recompute_result
from radarsim.api.stored_cases import (
    config_faults,
    missing_packages,
    recomputable_experiment,
    stored_case,
    stored_experiment,
)
from radarsim.config.experiment import Case, Experiment
from radarsim.engine.machine import available_cores, instruction_set, machine_facts
from radarsim.engine.store.audit import Audit, audit_blocks
from radarsim.engine.store.store import is_other_source, other_sources
from radarsim.errors import ConfigError
from radarsim.report import provenance
from radarsim.report.stored_tables import find_files, no_result
from radarsim.system.directories import is_directory
from radarsim.system.private_files import foreign_owner


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


def inspect_result(
    folder: str | os.PathLike[str],
    recompute: int = 0,
    progress: Progress | None = None,
    budget: WorkBudget | None = None,
) -> Inspection:
    """Check a folder of results against its run.json, and all stored blocks of its cases; compute some of it again.

    recompute is the number of stored pieces to compute again for each case, the smallest first; if above 0, cases
    without blocks, or with those of other sources, are computed from the config, and the tables are made from the sums
    and compared; no more than a budget, by default minutes. progress(done, total) counts the realisations. What could
    not be checked is in `not_checked`. Raises ConfigError where the folder holds no results, or code of another user
    would have to run."""
    inspection = Inspection(Path(folder))
    blocks = blocks_folder(inspection.folder)
    record = checked_record(inspection)
    if _digest(record["resolved"]) != record["resolved_sha256"]:
        inspection.faults.append(f"{inspection.folder / 'run.json'}: damaged: the config in it is not the one that ran")
    inspection.total = sum(case["done"] for case in record["cases"].values())
    inspection.faults += config_faults(record, inspection.folder)
    experiment = _experiment(inspection, record) if recompute and not inspection.faults else None
    recorded = experiment or stored_experiment(record, inspection.folder)
    audits = {}
    for name, stored_identity in record["identities"].items():
        case = stored_case(record, name, recorded)
        if experiment is None and case is not None and any(member.written for member in case.user_filters):
            case = None  # of which code would run
        audit = _audit_case(inspection, record, name, blocks / stored_identity, case, experiment is not None)
        if audit is not None:
            audits[name] = audit
    if experiment is not None:
        budget = WorkBudget() if budget is None else budget
        recompute_result(inspection, record, experiment, audits, recompute, blocks.parent, budget, progress)
    elif not (recompute or inspection.faults) and (
        absent := [name for name in record["identities"] if name not in audits]
    ):
        further_cases = f" and {len(absent) - 1} more" if len(absent) > 1 else ""
        cases = "" if len(absent) == len(record["identities"]) else f" of {absent[0]}{further_cases}"
        inspection.not_checked.append(f"nothing{cases} could be recomputed: no blocks are stored")
    return inspection


def _experiment(inspection: Inspection, record: Mapping[str, Any]) -> Experiment | None:
    """The experiment of a result; None where it cannot be read, which is then said. Raises ConfigError for one that
    runs code which another user names."""
    try:
        experiment = recomputable_experiment(record, inspection.folder)
    except ConfigError as error:
        reason = missing_packages(record) or error.lines[0]
        inspection.not_checked.append(f"nothing could be recomputed: {reason}")
        return None
    if any(user_filter.written for case in experiment.cases for user_filter in case.user_filters):
        _refuse_foreign_record(inspection.folder / "run.json")
    return experiment


def _audit_case(
    inspection: Inspection, record: Mapping[str, Any], name: str, store: Path, case: Case | None, recompute: bool
) -> Audit | None:
    """The audit of a case's stored blocks; None where there are none. recompute: whether some follow."""
    inspection.notes += _notes_on_sources(store, name, case, recompute)
    if not is_directory(store):
        return None
    audit = audit_blocks(store, int(record["cases"][name]["done"]))
    inspection.pieces += len(audit.pieces)
    inspection.faults += audit.faults
    inspection.notes += audit.notes
    return audit


def _notes_on_sources(store: Path, name: str, case: Case | None, recompute: bool) -> list[str]:
    """Notes on blocks of a case, or on further blocks of it, that other sources than these made."""
    present = store if case is None else store.with_name(CaseWork(case).identity)
    notes = []
    if not recompute and is_other_source(present, store):  # else what is done about it is said
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


def blocks_folder(folder: Path) -> Path:
    """Where the blocks of a result's folder lie: beside the folder, or beside its target where it is `.` or a link."""
    parents = [Path(os.path.abspath(folder)).parent, folder.resolve().parent]
    return next(
        (parent / ".blocks" for parent in parents if is_directory(parent / ".blocks")), folder.parent / ".blocks"
    )


def checked_record(inspection: Inspection) -> dict[str, Any]:
    """The record of the result in a folder, with its outputs checked."""
    folder = inspection.folder
    files = find_files(folder, lambda name: True)
    if files is None:
        blocks = blocks_folder(folder)
        hint = f"; `radarsim check CONFIG --out {blocks.parent}` says what is stored there"
        raise ConfigError(no_result(folder) + (hint if is_directory(blocks) else ""))
    inspection.outputs, inspection.faults = len(files.contents), [*files.faults.values()]
    return dict(files.record)


def _digest(value: object) -> str | None:
    """SHA-256 of the content of run.json, in hexadecimal; None for content that no run writes, such as NaN."""
    from radarsim.report.provenance import to_json

    try:
        return hashlib.sha256(to_json(value)).hexdigest()
    except (ValueError, RecursionError):
        return None

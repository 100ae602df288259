"""`radarsim check study.zip`: verify results that somebody handed over, without leaving anything behind."""

import os
import re
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, fields
from pathlib import Path

from radarsim.api.archive import BLOCKS_FOLDER, Archive
from radarsim.api.configs import load
from radarsim.api.earlier_outputs import RUNS_FILE, runs_option
from radarsim.api.maintenance.compare_tables import differs
from radarsim.api.maintenance.doctor import inspect_result
from radarsim.api.maintenance.inspection import Inspection
from radarsim.api.maintenance.pack import README, RECORD, RESULTS
from radarsim.api.maintenance.packed_code import code_names
from radarsim.api.maintenance.recompute import WorkBudget
from radarsim.api.stored_cases import missing_packages
from radarsim.config.experiment import Experiment
from radarsim.config.find_files import is_stem
from radarsim.engine.store.block_file import piece_named
from radarsim.errors import ConfigError, RadarsimError, StoreError
from radarsim.extensions import extensions
from radarsim.report.old_columns import with_current_columns
from radarsim.report.stored_tables import HOW_TO_REMAKE, find_record, read_content
from radarsim.user_code.errors import code_allowed

RECOMPUTED_PIECES = 2  # of each case


@dataclass(frozen=True)
class CheckedArchive:
    """An archive whose files are those of its manifest, and the findings about each of its results, by name."""

    path: Path
    sha256: str
    files: int
    results: Mapping[str, Inspection]


def check_archive(
    path: str | os.PathLike[str],
    recompute: int = RECOMPUTED_PIECES,
    trust_code: bool = False,
    progress: Callable[[int, int], None] | None = None,
) -> CheckedArchive:
    """Check an archive of results: its files, its blocks, as many of each case computed again as `recompute` says, and
    the tables made from the sums. What is read from it is gone afterwards.

    Code of user filters in it is run only with trust_code. Raises ConfigError for what is no archive of results,
    StoreError for a damaged one."""
    with unpacked(path, trust_code) as (archive, folder):
        inspections, budget = {}, WorkBudget()
        for name, facts in archive.facts["results"].items():
            place = folder / RESULTS / name
            code_places = code_names(find_record(place) or {})
            refused = bool(code_places) and not trust_code
            inspections[name] = inspect_result(place, 0 if refused else recompute, progress, budget)
            if refused and recompute:
                reason = _untrusted(code_places, facts["code"])
                inspections[name].not_checked = [f"nothing could be recomputed: {reason}"]
            _name_archive(inspections[name], str(folder), str(archive.path))
        return CheckedArchive(archive.path, archive.sha256, len(archive.names), inspections)


def has_its_counts(archive: Archive, experiment: Experiment, folder: Path) -> bool:
    """Whether the tables in a folder are of as many realisations as those of a result in an archive."""
    record = find_record(folder) or {"cases": {}}
    packed = archive.facts["results"][experiment.stem].get("cases", {})
    return {name: case["done"] for name, case in record["cases"].items()} == {
        name: case.get("realisations") for name, case in packed.items()
    }


def differences(archive: Archive, experiment: Experiment, folder: Path) -> tuple[dict[str, bool], list[str]]:
    """The tables of a result in an archive that are those of a folder, and whether to the byte; and a line for each
    that is not."""
    place = f"{RESULTS}/{experiment.stem}/"
    free_columns: dict[str, Sequence[str]] = {}
    for extension in extensions():
        free_columns |= extension.columns_from_elsewhere
    equal, different = {}, []
    for name in archive.names:
        table = name.removeprefix(place)
        if table == name or not table.endswith(".csv") or "/" in table:
            continue
        stem = table.removesuffix(".csv")
        stored = with_current_columns(experiment.study, stem, archive.read(name))
        computed = read_content(folder / table)
        if computed is None and table == RUNS_FILE:
            continue  # see `missing_runs_option`
        difference = (
            "was not written"
            if computed is None
            else differs(experiment.study, stem, stored, computed, free_columns.get(stem, ()))
        )
        if difference:
            different.append(f"{archive.path}/{name}: the table computed here {difference}")
        else:
            equal[table] = stored == computed or stem in free_columns
    return equal, different


def missing_runs_option(archive: Archive, experiment: Experiment, folder: Path) -> str:
    """The option that also makes the table of runs, which a result in an archive has and a folder lacks; else empty."""
    name = f"{RESULTS}/{experiment.stem}/{RUNS_FILE}"
    if name not in archive.names or (folder / RUNS_FILE).exists():
        return ""
    return runs_option(archive.read(name))


@contextmanager
def unpacked(path: str | os.PathLike[str], trust_code: bool) -> Iterator[tuple[Archive, Path]]:
    """An archive of results, and a temporary folder for this user alone that holds its files.

    Meanwhile no code of users runs, unless it is trusted. Nothing is written before the whole archive is checked."""
    with Archive(path) as archive:
        _check_names(archive)
        with tempfile.TemporaryDirectory(prefix="radarsim-") as temporary, code_allowed(trust_code):
            folder = Path(os.path.realpath(temporary))
            try:
                archive.extract(folder, archive.names)
            except OSError as error:
                raise StoreError(
                    f"{folder.parent}: cannot be written: {error.strerror}; TMPDIR names another"
                ) from error
            try:
                _check_outputs(archive, folder)
                yield archive, folder
            except RadarsimError as error:
                if not any(str(folder) in line for line in error.lines):
                    raise
                raise type(error)(*(line.replace(str(folder), str(path)) for line in error.lines)) from error


def runnable_results(archive: Archive, folder: Path, trust_code: bool) -> tuple[dict[str, Path], list[str]]:
    """The folders of the results in an unpacked archive that can be run, by name; and a line for each other result, of
    judged estimates, of code which nobody trusts, or of a config that cannot be read, as without the package of its
    study."""
    runnable: dict[str, Path] = {}
    not_run = []
    for name in archive.facts["results"]:
        place = folder / RESULTS / name
        if reason := _reason_not_to_run(archive, name, place, trust_code):
            not_run.append(f"{archive.path}: {name}: not run: {reason}")
        else:
            runnable[name] = place
    return runnable, not_run


def _reason_not_to_run(archive: Archive, name: str, place: Path, trust_code: bool) -> str:
    """Why a result in an archive cannot be run; empty where it can."""
    record = find_record(place) or {}
    if judged := record.get("judged"):
        return f"holds no estimates of its judged filter {', '.join(judged)}"
    code_places = code_names(record)
    if code_places and not trust_code:
        return _untrusted(code_places, archive.facts["results"][name]["code"])
    try:
        load(place)
    except ConfigError as error:
        return missing_packages(record) or error.lines[0].replace(str(place), f"{archive.path}/{RESULTS}/{name}")
    return ""


def _untrusted(code_places: Sequence[str], packed: Sequence[str]) -> str:
    """Why a result is not computed where code that nobody trusts would have to run, and what to do."""
    names = ", ".join(code_places)
    if not packed:
        return (
            f"its filters are code that is not in the archive: {names}; put it into the working directory, "
            "and give --trust-code"
        )
    return f"that runs code of its author: {names}; read it, then give --trust-code"


def _check_names(archive: Archive) -> None:
    """Raise ConfigError unless the files are those of results, of their blocks, and the text for readers."""
    results = archive.facts.get("results")
    if not isinstance(results, dict) or not results or not all(map(is_stem, results)) or not all(_are_facts(results)):
        raise ConfigError(f"{archive.path}: its manifest names no results; nothing is read")
    for name in archive.names:
        match name.split("/"):
            case [only] if only == README:
                continue
            case [top, result, _, *_] if top == RESULTS and result in results:
                continue
            case [top, blocks, identity, block] if (top, blocks) == (RESULTS, BLOCKS_FOLDER):
                if re.fullmatch("[0-9a-f]{2,128}", identity) and piece_named(block) is not None:
                    continue
        raise ConfigError(f"{archive.path}: {name!r} belongs to no result; nothing is read")


def _are_facts(results: Mapping[str, object]) -> Iterator[bool]:
    """For each result whether the manifest says of it what `pack` says."""
    for facts in results.values():
        code, cases = (facts.get("code"), facts.get("cases")) if isinstance(facts, dict) else (None, None)
        yield (
            isinstance(code, list)
            and all(isinstance(name, str) for name in code)
            and isinstance(cases, dict)
            and all(isinstance(case, dict) for case in cases.values())
        )


def _check_outputs(archive: Archive, folder: Path) -> None:
    """Raise ConfigError where a result holds files that its record does not name."""
    for result in archive.facts["results"]:
        place = f"{RESULTS}/{result}/"
        record = find_record(folder / place)
        if record is None:
            raise ConfigError(f"{archive.path}: {place}{RECORD} is missing")
        code = archive.facts["results"][result].get("code", ())
        recorded_paths = {f"{place}{name}" for name in (RECORD, *record["outputs"], *code)}
        odd = [name for name in archive.names if name.startswith(place) and name not in recorded_paths]
        if odd:
            raise ConfigError(f"{archive.path}: {odd[0]!r} is not named by {place}{RECORD}")


def _name_archive(inspection: Inspection, folder: str, archive: str) -> None:
    """Name the archive in place of the temporary folder in all findings, without remedies for a folder."""
    inspection.folder = Path(str(inspection.folder).replace(folder, archive))
    for field in fields(inspection):
        texts = getattr(inspection, field.name)
        if isinstance(texts, list):
            renamed = [text.replace(folder, archive).removesuffix(f"; {HOW_TO_REMAKE}") for text in texts]
            setattr(inspection, field.name, renamed)

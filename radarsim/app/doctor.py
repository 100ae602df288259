"""`radarsim doctor`: the machine, and all that is stored of a result.

`radarsim compile`: compilation before the first run.

The self-test of `radarsim doctor`: a small case of every study, its tables compared with known ones.

radarsim/app/known holds for each study (the sonar is three) a config and its tables on the platform of platform.json.
Elsewhere (instruction set, compiler, BLAS, mathematical library) the last bits differ: an ulp here and there, which
later arithmetic magnifies by its condition number κ. So a number may differ by what κ allows, see `Tolerance`. `make
known` makes the tables again, after an intended change of numbers. A study of an installed package has its known
answers in its own tests; here it is only loaded."""

import csv
import hashlib
import io
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

from radarsim.app import run
from radarsim.app.case_work import CaseWork
from radarsim.app.configs import document as lookup
from radarsim.app.configs import load
from radarsim.app.recorded_cases import recorded_case
from radarsim.config.experiment import Case
from radarsim.engine.blocks import Node, Partial, simulated
from radarsim.engine.machine import available_cores, instruction_set, machine_facts, platform, platform_name
from radarsim.engine.results import Sums
from radarsim.engine.store.audit import Audit, audit_blocks
from radarsim.engine.store.block_file import block_path, is_directory
from radarsim.engine.store.store import is_other_source, other_sources
from radarsim.errors import ConfigError, StoreError
from radarsim.private_files import foreign_owner
from radarsim.report import files
from radarsim.studies import registry

# ---- doctor ----------------------------------------------------------------------------------------------------------
LOOKS, LOOK_S = 4, 0.25
ROUNDINGS = 10  # a power p ≤ 4 of an error, and heavy tails in it


def machine() -> dict[str, str]:
    """The machine, what runs on it, and where compiled kernels are kept, a text each."""
    from radarsim.kernels import cache as kernel_cache

    facts, cache = machine_facts(), kernel_cache.ROOT
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

    recompute is the number of stored pieces to recompute for each case, the smallest first. Blocks that other sources
    made are noted. Raises ConfigError where the folder holds no results, and where blocks cannot be recomputed because
    the sources have changed."""
    found = Inspection(Path(folder))
    blocks = _blocks(found.folder)
    record = _settled(found)
    if _digest(record["resolved"]) != record["resolved_sha256"]:
        found.faults.append(f"{found.folder / 'run.json'}: damaged: the config in it is not the one that ran")
    elsewhere = []
    for name, stored_as in record["identities"].items():
        store = blocks / stored_as
        case = recorded_case(record, name)
        runs_code = case is not None and any(user_filter.written for user_filter in case.outside)
        if recompute and runs_code:
            _refuse_foreign(found.folder / "run.json")
        found.notes += _notes_on_sources(store, name, case if recompute or not runs_code else None)
        if not is_directory(store):
            found.notes.append(f"{store}: no blocks of {name} are stored, so the tables cannot be checked against them")
            continue
        audit = audit_blocks(store, int(record["cases"][name]["done"]))
        found.pieces += len(audit.pieces)
        found.faults += audit.faults
        found.notes += audit.notes
        if recompute and not _recomputed(found, audit, case, recompute):
            elsewhere.append(name)
    if elsewhere and not found.faults:
        raise ConfigError(
            f"{found.folder}: {', '.join(elsewhere)}: cannot be computed again, the sources that compute have changed "
            "since; all that is stored is intact"
        )
    return found


def _notes_on_sources(store: Path, name: str, case: Case | None) -> list[str]:
    """Whether the blocks of a case, or others beside them, were made by other sources than these."""
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


def _refuse_foreign(record: Path) -> None:
    """ConfigError for a record of another user: the code that it names could be anybody's."""
    if (owner := foreign_owner(record)) is not None:
        raise ConfigError(f"{record}: names code and belongs to another user ({owner}), so nothing is computed again")


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
    if case is None or CaseWork(case).identity != audit.path.name:
        return False
    work, here = CaseWork(case), platform_name()
    elsewhere: set[str] = set()
    own = (piece for piece in audit.pieces if isinstance(piece, Node | Partial))
    for piece in sorted(own, key=lambda piece: piece.realisations(work.block)[1])[:most]:
        header, values = audit.pieces[piece]
        path = block_path(audit.path, piece)
        found.realisations += header["count"]
        found.recomputed.append(str(path))
        if header["block"] != work.block or values.size != work.size:
            found.faults.append(f"{path}: has other blocks than this program makes")
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
    with few realisations that of a single scan may be tiny by chance."""
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
    """Compile the kernels of configs (default: all shipped ones) and cache their machine code. One realisation of each
    case is simulated and discarded. Raises ConfigError where the machine code cannot be cached."""
    from radarsim.kernels.cache import troubles

    for name in configs or lookup.stems("configs"):
        started = time.process_time()
        for case in load(name).cases:
            CaseWork(case).simulate(0, 1)
            if lines := [troubles[kind] for kind in ("write", "compiler") if kind in troubles]:
                raise ConfigError(*lines)
        yield Compiled(name, time.process_time() - started)


# ---- selftest --------------------------------------------------------------------------------------------------------
KNOWN = Path(__file__).parent / "known"
TABLES = ("curves", "gains")


@dataclass(frozen=True)
class Tolerance:
    """By how much a study's numbers may differ between platforms, in σ: sampled and exact ones.

    Spreads, standard errors and half-widths of intervals are compared by their squares, as each is the root of a
    difference of sums: where all realisations err alike, a rounding ε of σ² makes √(2ε) |bias| of the spread. Notes are
    not compared: each turns at a threshold, that on equal filters at a difference of zero."""

    sampled: float = 1e-12
    exact: float = 1e-12


TOLERANCES = {
    # Gains of up to three states from fits with κ < 10³ when balanced: some tens of roundings, 10⁻¹² leaves a factor 5.
    "range_doppler": Tolerance(),
    "sonar": Tolerance(),
    # The same, and thresholds: a test of a detector, or a plot at the edge of a gate, might fall otherwise within
    # rounding of it, once in 10⁹ of them; the cases hold some 10⁴. Likelihoods multiply: κε of a few hundred roundings.
    "sonar_manoeuvre": Tolerance(sampled=1e-10),
    "sonar_clutter": Tolerance(sampled=1e-10),
    # Innovation covariances of bearings have κ of up to 3·10⁶ (kernels.algebra.factored), so κε = 7·10⁻¹⁰.
    "multimodel": Tolerance(sampled=1e-9),
    # Balanced information of five parameters, κ = 2.1·10⁵: its inverse is known to κε/2 = 2.3·10⁻¹¹. Estimates are
    # found by scoring steps that use the inverse, each a fraction of σ long and ended by a threshold.
    "discriminator": Tolerance(sampled=1e-9, exact=1e-10),
    # Covariances of each realisation's own begin with a prior of (300 m/s)² beside plots of (15 m/s)², over scans of
    # 10 s: κ near 10⁴, κε = 2·10⁻¹². Weights of hypotheses are exponentials of up to −40, multiplying that by 40. A
    # hypothesis within rounding of `prune_below` might be dropped or kept: once in 10¹⁰ of some 10⁶ looked at.
    "ambiguous_doppler": Tolerance(sampled=1e-10, exact=1e-11),
    # Balanced information of a burst's three parameters, κ = 230: 10⁻¹³; covariances of the track from (3 m/s)² to
    # (0.04 m/s)², κ near 10⁴, κε = 2·10⁻¹². Estimates are found by scoring steps that end by a threshold, so that one
    # more or less, where two numbers nearly tie, shows by what it leaves: as in the discriminator.
    "pulses_to_tracks": Tolerance(sampled=1e-9, exact=1e-11),
}
UNKNOWN = Tolerance(sampled=1e-9, exact=1e-9)  # of a study from another package


def tolerance(study: str) -> Tolerance:
    """By how much a study's numbers may differ between platforms."""
    return TOLERANCES.get(study, UNKNOWN)


EXACT = ("exact_sigma", "exact_bias", "exact_percent", "posterior_sigma", "floor")
LABELS_DIFFER = (float("inf"), float("inf"))
FIRST_NUMBER = {"curves": "sigma", "gains": "gain_percent"}  # columns before it are labels and counts


@dataclass(frozen=True)
class Verdict:
    """The outcome of a study's case, and whether it is as expected."""

    study: str
    good: bool
    words: str


def tables(study: str) -> dict[str, bytes]:
    """The tables of a study's known case, as computed here: CSV by name."""
    from radarsim.report.tables import to_csv

    result = run.run(KNOWN / f"{study}.yaml", threads=1)
    return {name: to_csv(result.tables[name]) for name in TABLES}


def verdicts() -> list[Verdict]:
    """One for each study. An unusable package is reported, but is not damage."""
    same_platform = platform() == json.loads((KNOWN / "platform.json").read_text())
    broken = registry.unusable()
    return [
        *(verdict(study, tables(study), same_platform) for study in TOLERANCES),
        *(Verdict(name, True, f"{registry.package(name)}: loads") for name in registry.offered() if name not in broken),
        *(Verdict(name, True, f"cannot be used: {words}") for name, words in broken.items()),
    ]


def verdict(study: str, made: dict[str, bytes], same_platform: bool) -> Verdict:
    """Compare tables with the known ones."""
    known = {name: (KNOWN / f"{study}.{name}.csv").read_bytes() for name in TABLES}
    if made == known:
        return Verdict(study, True, "the known bytes")
    allowed, off = TOLERANCES[study], [distances(name, made[name], known[name]) for name in TABLES]
    sampled, exact = (max(pair) for pair in zip(*off, strict=True))
    if sampled > allowed.sampled or exact > allowed.exact:
        words = f"differs from the known answer by {sampled:.1e} of sigma (exact values {exact:.1e}); "
        return Verdict(study, False, words + f"at most {allowed.sampled:.0e} ({allowed.exact:.0e}) is rounding")
    words = f"the known numbers to {max(sampled, exact):.1e} of sigma"
    return Verdict(
        study, True, words + (", not the known bytes, though the platform is the same" if same_platform else "")
    )


def distances(table: str, one: bytes, other: bytes) -> tuple[float, float]:
    """The largest differences of two tables' sampled and exact numbers, in σ or 100 %; infinite where labels differ."""
    first, second = (list(csv.DictReader(io.StringIO(text.decode()))) for text in (one, other))
    if len(first) != len(second):
        return LABELS_DIFFER
    farthest = {False: 0.0, True: 0.0}
    for a, b in zip(first, second, strict=True):
        columns = list(b)
        numbers = [name for name in columns[columns.index(FIRST_NUMBER[table]) :] if name not in ("floor_kind", "note")]
        if any(a.get(name) != b[name] for name in columns if name not in (*numbers, "note")):
            return LABELS_DIFFER
        centre = FIRST_NUMBER[table]
        scale = float(b["sigma"] or 1) if table == "curves" else 100.0  # ends of intervals may lie far above σ
        for name in numbers:
            if (a.get(name) or "") == b[name]:
                continue
            if not (a.get(name) and b[name]):
                return LABELS_DIFFER
            of = max(scale, abs(float(b[name])))
            here, there = (_compared(name, float(row[name]) / of, float(row[centre] or 0) / of) for row in (a, b))
            exact = name in EXACT
            farthest[exact] = max(farthest[exact], abs(here - there))
    return farthest[False], farthest[True]


def _compared(name: str, value: float, centre: float) -> float:
    """The compared number of a column; see `Tolerance`."""
    if name in ("spread", "bias_se"):
        return value**2
    return (value - centre) ** 2 if name.endswith(("_lo", "_hi")) else value


def write() -> None:
    """Make the known tables again, on this platform."""
    made = {study: tables(study) for study in TOLERANCES}
    contents = {f"{study}.{name}.csv": content for study, own in made.items() for name, content in own.items()}
    files.replace_all(KNOWN, contents | {"platform.json": (json.dumps(platform(), indent=2) + "\n").encode()})


if __name__ == "__main__":
    write()

"""`radarsim pack`: results in one archive, with all that somebody else needs to verify them or run them again."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from radarsim.api.archive import BLOCKS_FOLDER, SUFFIX, write_archive
from radarsim.api.maintenance.doctor import blocks_folder, checked_record
from radarsim.api.maintenance.inspection import Inspection
from radarsim.api.maintenance.packed_code import code_names, packed_code
from radarsim.config.find_files import is_stem
from radarsim.engine.blocks import Node, Partial, Piece, Total
from radarsim.engine.store.audit import Audit, audit_blocks
from radarsim.engine.store.block_file import Damage, block_path, decode, read_file
from radarsim.errors import ConfigError, StoreError, count_text
from radarsim.report import atomic_files
from radarsim.report.index_page import INDEX_NAME
from radarsim.system.directories import is_directory

RESULTS = "results"
README = "README.txt"
RECORD = "run.json"
README_TEXT = """\
A study computed with radarsim {version}, as `radarsim pack` wrote it.

{results}

To verify it, or to compute it again:

  pip install radarsim=={version}{packages}
  radarsim check FILE.zip
  radarsim run FILE.zip

Unpacked, results/NAME/report.html is the report of a result, and config.yaml there what was computed.
"""


@dataclass(frozen=True)
class PackedStudy:
    """An archive that was written: its SHA-256, size and number of files; the names of its results; notes."""

    path: Path
    sha256: str
    size: int
    files: int
    results: tuple[str, ...]
    notes: tuple[str, ...]


def pack(results: Sequence[str | os.PathLike[str]], archive: str | os.PathLike[str], code: bool = False) -> PackedStudy:
    """Write folders of results, or all in a directory, with their stored blocks into one archive, whole or not at all.

    The same results give the same bytes. code: with the code of user filters, which is run for it, as only that shows
    which files it reads. Raises ConfigError for folders without results or of one name, and for an
    archive that may not be written; StoreError where a result is damaged."""
    if not os.fspath(archive).lower().endswith(SUFFIX):
        raise ConfigError(f"{archive}: the name of an archive must end with {SUFFIX}")
    contents: dict[str, bytes] = {}
    facts: dict[str, Any] = {}
    notes: list[str] = []
    for folder in _folders_of_results(results):
        record, files = _result_files(folder)
        code_files = packed_code(folder, record) if code else {}
        if clashes := [name for name in files if code_files.get(name, files[name]) != files[name]]:
            raise ConfigError(f"{folder}: {clashes[0]} is both a file of the result and another that a filter reads")
        if not code and (code_places := code_names(record)):
            notes.append(f"{folder}: the code of its filters is not packed: {', '.join(code_places)}; --code adds it")
        if packages := _packages(record):
            notes.append(
                f"{folder}: the package that computes it is not packed: {', '.join(packages)}; name its source"
            )
        files |= code_files
        name = record["config"] if is_stem(str(record["config"])) else folder.name
        if name in facts:
            raise ConfigError(f"{folder}: another result in this archive is called {name}, too: pack them apart")
        contents |= {f"{RESULTS}/{name}/{file}": content for file, content in files.items()}
        blocks = _block_files(folder, record, notes)
        contents |= {f"{RESULTS}/{BLOCKS_FOLDER}/{file}": content for file, content in blocks.items()}
        facts[name] = _facts(record, blocks) | {"code": sorted(code_files)}
    if not facts:
        raise ConfigError(f"{', '.join(map(str, results))}: no folder of results")
    contents[README] = _readme(facts).encode()
    digest = write_archive(archive, contents, {"results": dict(sorted(facts.items()))})
    path = Path(archive)
    return PackedStudy(path, digest, path.stat().st_size, len(contents), tuple(sorted(facts)), tuple(notes))


def _folders_of_results(results: Sequence[str | os.PathLike[str]]) -> list[Path]:
    """The folders of results: those given, and those in a directory of results, whose index `results/*` names too."""
    folders: list[Path] = []
    for path in map(Path, results):
        inner = [] if (path / RECORD).exists() else [record.parent for record in sorted(path.glob(f"*/{RECORD}"))]
        folders += inner or ([path] if path.name != INDEX_NAME else [])
    return folders


def _result_files(folder: Path) -> tuple[dict[str, Any], dict[str, bytes]]:
    """The record of a result, and its files by their paths in the folder. Raises StoreError where they differ."""
    inspection = Inspection(folder)
    record = checked_record(inspection)
    if inspection.faults:
        raise StoreError(*inspection.faults, f"{folder}: is damaged, and is not packed")
    return record, {name: atomic_files.read(folder / name) for name in (*record["outputs"], RECORD)}


def _block_files(folder: Path, record: Mapping[str, Any], notes: list[str]) -> dict[str, bytes]:
    """The stored blocks behind a result, by their paths in the folder of blocks. Raises StoreError for damaged ones."""
    contents: dict[str, bytes] = {}
    missing = []
    for name, identity in record["identities"].items():
        store, done = blocks_folder(folder) / identity, int(record["cases"][name]["done"])
        if not is_directory(store):
            missing.append(name)
            continue
        audit = audit_blocks(store, done)
        if audit.faults:
            raise StoreError(*audit.faults, f"{folder}: its stored blocks are damaged, and it is not packed")
        contents |= {f"{identity}/{piece.name}.sums": _block(store, piece) for piece in _pieces_behind(audit, done)}
    if judged := record.get("judged"):
        notes.append(f"{folder}: the estimates of its judged filter {', '.join(judged)} are not in it: hashes alone")
    elif missing:
        further_cases = f" and {len(missing) - 1} more" if len(missing) > 1 else ""
        notes.append(
            f"{folder}: no blocks of {missing[0]}{further_cases} are stored: it can only be recomputed as a whole"
        )
    return contents


def _pieces_behind(audit: Audit, done: int) -> list[Piece]:
    """The pieces of a total of so many realisations, and the total itself: all nodes, but no totals of other runs."""
    block = next((header["block"] for header, _ in audit.pieces.values()), 1)
    cut = Partial(*divmod(done, block))
    return [piece for piece in sorted(audit.pieces, key=str) if isinstance(piece, Node) or piece in (cut, Total(done))]


def _block(store: Path, piece: Piece) -> bytes:
    try:
        content = read_file(block_path(store, piece))
        decode(content)
    except OSError as error:
        raise StoreError(f"{block_path(store, piece)}: cannot be read: {error.strerror}") from error
    except Damage as damage:
        raise StoreError(f"{block_path(store, piece)}: damaged: {damage}") from damage
    return content


def _facts(record: Mapping[str, Any], blocks: Mapping[str, bytes]) -> dict[str, Any]:
    """What the manifest says of a result."""
    stored = {path.partition("/")[0] for path in blocks}
    cases = {
        name: {
            "realisations": case["done"],
            "seed": case["seed"],
            "identity": record["identities"].get(name),
            "blocks": record["identities"].get(name) in stored,
        }
        for name, case in record["cases"].items()
    }
    packages = {"packages": record["packages"]} if _packages(record) else {}
    return {"study": record["study"], "versions": record.get("versions", {}), **packages, "cases": cases}


def _packages(record: Mapping[str, Any]) -> list[str]:
    """The packages of the user's that a result needs, with their versions."""
    return [f"{name}=={package['version']}" for name, package in record.get("packages", {}).items()]


def _readme(facts: Mapping[str, Any]) -> str:
    """What a reader finds who unpacks an archive without knowing radarsim."""
    lines = []
    for name, result in sorted(facts.items()):
        counts = sorted({case["realisations"] for case in result["cases"].values()})
        seeds = ", ".join(str(seed) for seed in sorted({case["seed"] for case in result["cases"].values()}))
        span = " to ".join(count_text(count) for count in dict.fromkeys((counts[0], counts[-1])))
        lines.append(f"  {name}: {len(result['cases'])} case(s) of {span} realisations, seed {seeds}")
    version = max(str(result["versions"].get("radarsim", "")) for result in facts.values())
    packages = sorted({package for result in facts.values() for package in _packages(result)})
    return README_TEXT.format(version=version, packages="".join(f" {p}" for p in packages), results="\n".join(lines))

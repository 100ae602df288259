"""Finished sums on disk: DIR/.blocks/<identity>/, a file for each piece, so that a killed run loses about a second.

    L05-3.sums      node of level 5, index 3: blocks 96 … 127
    P24-1696.sums   the first 1696 realisations of block 24
    T100000.sums    the total of realisations 0 … 99999, as it was reported

A run keeps the largest nodes it has. When a node is safely on disk, the files inside it are removed. Nothing else is
removed: a run with a smaller N than was done before leaves the large nodes alone, computes the small ones it lacks
beside them (with the same bytes), and stores them too. A total outlives the nodes it was added from, so that a reported
result can be read again after a larger run has merged them.

A folder belongs to one identity: REQUEST_DIGITS of the request, then as many of the sources that compute. Equal names
hold equal sums, so that several runs may share a store; a file merged by another run is found in its parent. Sources
that differ have a folder of their own, and read nothing from those of others."""

import os
import re
import stat
from collections.abc import Collection, Mapping
from contextlib import suppress
from pathlib import Path

from radarsim.engine.blocks import REQUEST_DIGITS, Forest, Node, Piece, Work, maximal_nodes
from radarsim.engine.machine import versions
from radarsim.engine.store.block_file import (
    Damage,
    block_path,
    check_block,
    decode,
    encode,
    piece_header,
    piece_named,
    read_file,
)
from radarsim.engine.sums import Sums
from radarsim.errors import StoreError
from radarsim.system.private_files import (
    UntrustedFileError,
    entry_fault,
    is_stale,
    make_private_folder,
    make_readable_folder,
    write_private_file,
)

ATTEMPTS = 4  # at reading or writing what another program merges or removes at the same time


class Store:
    """The pieces of one work under a results directory. Makes no directory before the first write. `warnings` collects
    damage; `platforms` those of all sums read or computed so far.

    A folder that another user may have made or may write is not trusted: nothing is read from it or written to it, and
    `warnings` says so."""

    def __init__(self, directory: str | os.PathLike, work: Work):
        if not re.fullmatch(r"[0-9a-f]{2,128}", work.identity):
            raise ValueError(f"identity: expected hexadecimal digits, got {work.identity!r}")
        self.path = Path(directory) / ".blocks" / work.identity
        self.warnings: list[str] = []
        self.platforms: set[str] = set()
        self._unusable: set[Piece] = set()  # damaged, or of another user
        self._work = work
        fault = folder_fault(self.path)
        self.trusted = fault is None
        if fault is not None:
            self.warnings.append(fault)

    def pieces(self) -> set[Piece]:
        """The stored pieces, by file names; empty if the directory does not exist, or is not trusted."""
        if not self.trusted:
            return set()
        try:
            names = os.listdir(self.path)
        except FileNotFoundError:
            return set()
        except OSError as error:
            raise StoreError(f"{self.path}: cannot be listed: {error.strerror}") from error
        return {piece for name in names if (piece := piece_named(name)) is not None}

    def superseded(self) -> bool:
        """Whether there is no folder of this identity, but one of the same request and other sources."""
        return self.trusted and not self.path.exists() and bool(other_sources(self.path))

    def read(self, piece: Piece) -> Sums | None:
        """The sums of a piece, checked; None if it is absent, damaged or not trusted. A damaged file is renamed to
        `<name>.damaged` and named in warnings."""
        if not self.trusted:
            return None
        path = block_path(self.path, piece)
        try:
            header, values = decode(read_file(path))
            check_block(header, values, self._header(piece))
            if values.size != self._work.size:
                raise Damage(f"expected {self._work.size} numbers, got {values.size}")
        except FileNotFoundError:
            return None
        except UntrustedFileError as error:
            self.warnings.append(f"{path}: {error.strerror}: not used")
            self._unusable.add(piece)
            return None
        except OSError as error:
            raise StoreError(f"{path}: cannot be read: {error.strerror}") from error
        except Damage as damage:
            self.warnings.append(f"{path}: damaged: {damage}; set aside")
            self._unusable.add(piece)
            with suppress(OSError):
                os.replace(path, path.with_name(path.name + ".damaged"))
            return None
        self.platforms.update(header["platforms"])
        self._unusable.discard(piece)
        return Sums(header["count"], values)

    def _header(self, piece: Piece) -> dict[str, object]:
        return piece_header(self.path, piece, self._work.block) | {"size": self._work.size}

    def make_folder(self, last: bool = True) -> None:
        """Make the folder, for the user alone, if absent; FileNotFoundError is passed on except on the last attempt."""
        try:
            make_readable_folder(self.path.parent.parent)
            make_private_folder(self.path)
        except OSError as error:
            if isinstance(error, FileNotFoundError) and not last:
                raise
            raise StoreError(f"{error.filename or self.path}: cannot be written: {error.strerror}") from error

    def write(self, pieces: Mapping[Piece, Sums]) -> None:
        """Put pieces on disk; on return they survive a power cut. StoreError, with the old files intact, if the disk is
        full or cannot be written."""
        if not pieces:
            return
        for attempt in range(ATTEMPTS):
            last = attempt == ATTEMPTS - 1
            with suppress(FileNotFoundError):  # `radarsim clean` removed the folder, or the one above it, just now
                self.make_folder(last)
                self._write_all(pieces, last)
                return

    def _write_all(self, pieces: Mapping[Piece, Sums], last: bool) -> None:
        try:
            for piece, sums in pieces.items():
                header = self._header(piece) | {"platforms": sorted(self.platforms), "versions": versions()}
                write_private_file(block_path(self.path, piece), encode(header, sums.values), durable=True)
            self._synchronise()
        except OSError as error:
            if isinstance(error, FileNotFoundError) and not last:
                raise
            where = error.filename or self.path
            raise StoreError(f"{where}: cannot be written: {error.strerror}") from error

    def _synchronise(self) -> None:
        """Make the renames durable."""
        descriptor = os.open(self.path, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)

    def sweep(self, durable: Collection[Node]) -> None:
        """Remove files of pieces contained in durable nodes, and temporary files of a killed run."""
        highest = max((node.level for node in durable), default=-1)
        try:
            for name in os.listdir(self.path):
                piece, path = piece_named(name), self.path / name
                with suppress(FileNotFoundError):
                    merged = piece is not None and any(node in durable for node in piece.containing_nodes(highest))
                    if merged or (name.endswith(".tmp") and is_stale(path)):
                        path.unlink()
        except FileNotFoundError:  # removed by `radarsim clean`: nothing is left to tidy
            return
        except OSError as error:
            raise StoreError(f"{self.path}: cannot be tidied: {error.strerror}") from error

    def forest(self, blocks: int) -> Forest:
        """All stored pieces of blocks 0 … blocks-1, merged."""
        for _ in range(ATTEMPTS):
            forest, lost = Forest(self._work.block, self._work.size), False
            candidates = self.pieces() - self._unusable
            for node in maximal_nodes([piece for piece in candidates if isinstance(piece, Node)], blocks):
                sums = self.read(node)
                if sums is None:
                    # Another run merged it, and the parent is there; or it was damaged, and a part of it may be there.
                    lost = True
                else:
                    forest.add(node, sums)
            if not lost:
                break
        return forest


def folder_fault(path: Path) -> str | None:
    """Why the folder of an identity, or the one above it, may be in another user's hand, in a line; None if neither."""
    for folder in (path.parent, path):
        with suppress(OSError):  # absent, or reported by whoever reads or writes there
            if fault := entry_fault(folder, folder.stat()):
                return f"{folder}: {fault}: blocks in it are not used, and none are kept"
    return None


def other_sources(folder: Path) -> list[Path]:
    """The folders beside that of an identity which hold sums of the same request by other sources."""
    try:
        candidates = sorted(folder.parent.glob(f"{folder.name[:REQUEST_DIGITS]}*"))
    except OSError:  # reported by whoever reads or writes there
        return []
    return [path for path in candidates if is_other_source(path, folder)]


def is_other_source(folder: Path, reference: Path) -> bool:
    """Whether a folder is of the same request as another and of different sources."""
    same_request = folder.name[:REQUEST_DIGITS] == reference.name[:REQUEST_DIGITS]
    return same_request and len(folder.name) == len(reference.name) > REQUEST_DIGITS and folder.name != reference.name


def mixture_warning(platforms: Collection[str]) -> str:
    """A note on sums from several platforms; the same line for every case of a run."""
    names = "; ".join(f"({number}) {name}" for number, name in enumerate(sorted(platforms), start=1))
    return (
        f"stored sums were made on {len(platforms)} platforms and are equal to rounding, not to the last bit: {names}"
    )


# Of a run that was killed while writing, and marks of versions up to 0.2 on blocks of other sources.
LEFT_OVER = re.compile(r"\.[\w-]+\.(sums|same|other)\.[0-9a-f]+\.tmp|[0-9a-f]+(-[0-9a-f]+)?\.(same|other)")


def removable_files(folder: Path) -> list[tuple[Path, int]]:
    """The files of one identity that a store makes, and their bytes; never links or foreign files."""
    files = []
    for path in sorted(folder.iterdir()):
        if piece_named(path.name.removesuffix(".damaged")) is not None or LEFT_OVER.fullmatch(path.name):
            status = path.lstat()
            if stat.S_ISREG(status.st_mode):
                files.append((path, status.st_size))
    return files

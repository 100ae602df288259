"""Finished sums on disk: DIR/.blocks/<identity>/, a file for each piece, so that a killed run loses about a second.

    L05-3.sums      node of level 5, index 3: blocks 96 … 127
    P24-1696.sums   the first 1696 realisations of block 24
    T100000.sums    the total of realisations 0 … 99999, as it was reported

What a run keeps are the largest nodes it has. When a node is safely on disk, the files inside it are removed. Nothing
else is: a run with a smaller N than was done before leaves the large nodes alone, computes the small ones it lacks
beside them (the same bytes come out), and stores them too. A total outlives the nodes it was added from, so that what
was once reported can be read again after a larger run has merged them.

A file is one line of magic, one line of JSON, the sums as little-endian float64 and the SHA-256 of all that. It is
written under a temporary name, synchronised and renamed: it is there whole or not at all. Equal names hold equal sums,
so that several runs may share a store; a file that another run merged away is looked for in its parent.
"""

import hashlib
import json
import os
import re
import stat
import time
import uuid
from collections.abc import Collection, Mapping
from contextlib import suppress
from pathlib import Path

import numpy as np

from radarsim.engine.blocks import Forest, Node, Partial, Piece, Total, Work, maximal
from radarsim.engine.machine import versions
from radarsim.engine.moments import Sums
from radarsim.errors import StoreError

MAGIC = b"radarsim sums 1\n"  # another number if the same realisations are ever added in another order
SUFFIX = ".sums"
DIGEST = 32
STALE_S = 600
LOOKS = 4


class Damage(Exception):
    """A file is not what its name says; the text says why."""


def piece_named(name: str) -> Piece | None:
    """The piece a file holds, from its name; None for other files."""
    if match := re.fullmatch(r"L(\d{2})-(\d{1,19})\.sums", name):
        return Node(int(match[1]), int(match[2]))
    if match := re.fullmatch(r"P(\d{1,19})-(\d{1,19})\.sums", name):
        return Partial(int(match[1]), int(match[2]))
    if match := re.fullmatch(r"T(\d{1,19})\.sums", name):
        return Total(int(match[1]))
    return None


class Store:
    """The pieces of one work under a results directory. Makes no directory before the first write.

    `warnings` gathers what was found damaged; `platforms` the platforms of all sums read or computed so far.
    """

    def __init__(self, directory: str | os.PathLike, work: Work):
        if not re.fullmatch(r"[0-9a-f]{2,128}", work.identity):
            raise ValueError(f"identity: expected hexadecimal digits, got {work.identity!r}")
        self.path = Path(directory) / ".blocks" / work.identity
        self.warnings: list[str] = []
        self.platforms: set[str] = set()
        self._damaged: set[Piece] = set()
        self._work = work

    def pieces(self) -> set[Piece]:
        """What is stored, by file names; nothing if the directory does not exist."""
        try:
            names = os.listdir(self.path)
        except FileNotFoundError:
            return set()
        except OSError as error:
            raise StoreError(f"{self.path}: cannot be listed: {error.strerror}") from error
        return {piece for name in names if (piece := piece_named(name)) is not None}

    def read(self, piece: Piece) -> Sums | None:
        """The sums of a piece, checked; None if it is not there (any more) or damaged.

        A damaged file is renamed to `<name>.damaged` and named in warnings.
        """
        path = self.path / (piece.name + SUFFIX)
        try:
            header, values = decoded(content(path))
            self._check(header, values, piece)
        except FileNotFoundError:
            return None
        except OSError as error:
            raise StoreError(f"{path}: cannot be read: {error.strerror}") from error
        except Damage as damage:
            self.warnings.append(f"{path}: damaged: {damage}; set aside")
            self._damaged.add(piece)
            with suppress(OSError):
                os.replace(path, path.with_name(path.name + ".damaged"))
            return None
        self.platforms.update(header["platforms"])
        self._damaged.discard(piece)
        return Sums(header["count"], values)

    def _check(self, header: dict, values: np.ndarray, piece: Piece) -> None:
        first, count = piece.realisations(self._work.block)
        expected = self._described(piece, first, count)
        for key, value in expected.items():
            if header.get(key) != value:
                raise Damage(f"{key}: expected {value}, got {header.get(key)}")
        check_platforms(header)
        if values.size != self._work.size:
            raise Damage(f"expected {self._work.size} numbers, got {values.size}")
        if not np.isfinite(values).all():
            raise Damage("not all numbers are finite")

    def _described(self, piece: Piece, first: int, count: int) -> dict:
        work = self._work
        return {
            "identity": work.identity,
            "piece": piece.name,
            "first": first,
            "count": count,
            "block": work.block,
            "size": work.size,
        }

    def make(self) -> None:
        """Make the directory, where there is none."""
        try:
            self.path.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise StoreError(f"{error.filename or self.path}: cannot be written: {error.strerror}") from error

    def write(self, pieces: Mapping[Piece, Sums]) -> None:
        """Put pieces on disk; on return they outlive a power cut. StoreError, with the old files intact, if the disk is
        full or cannot be written."""
        if not pieces:
            return
        for look in range(LOOKS):
            self.make()
            with suppress(FileNotFoundError):  # `radarsim clean` removed the directory just now
                self._write_all(pieces, last=look == LOOKS - 1)
                return

    def _write_all(self, pieces: Mapping[Piece, Sums], last: bool) -> None:
        try:
            for piece, sums in pieces.items():
                described = self._described(piece, *piece.realisations(self._work.block))
                header = described | {"platforms": sorted(self.platforms), "versions": versions()}
                self._write_file(self.path / (piece.name + SUFFIX), encoded(header, sums.values))
            self._synchronise()
        except OSError as error:
            if isinstance(error, FileNotFoundError) and not last:
                raise
            where = error.filename or self.path
            raise StoreError(f"{where}: cannot be written: {error.strerror}") from error

    def _write_file(self, path: Path, content: bytes) -> None:
        temporary = path.with_name(f".{path.name}.{uuid.uuid4().hex}.tmp")
        try:
            with open(temporary, "xb") as file:
                file.write(content)
                file.flush()
                os.fsync(file.fileno())
            os.replace(temporary, path)
        except BaseException as error:
            with suppress(OSError):
                temporary.unlink()
            if isinstance(error, OSError):
                error.filename, error.filename2 = str(path), None
            raise

    def _synchronise(self) -> None:
        """Make the renames durable."""
        descriptor = os.open(self.path, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)

    def sweep(self, durable: Collection[Node]) -> None:
        """Remove the files of what lies inside nodes that are durable, and temporary files that a killed run left."""
        highest = max((node.level for node in durable), default=-1)
        now = time.time()
        try:
            for name in os.listdir(self.path):
                piece, path = piece_named(name), self.path / name
                with suppress(FileNotFoundError):
                    merged = piece is not None and any(node in durable for node in piece.above(highest))
                    if merged or (name.endswith(".tmp") and now - path.stat().st_mtime > STALE_S):
                        path.unlink()
        except FileNotFoundError:  # removed by `radarsim clean`: nothing is left to tidy
            return
        except OSError as error:
            raise StoreError(f"{self.path}: cannot be tidied: {error.strerror}") from error

    def forest(self, blocks: int) -> Forest:
        """All that is stored of blocks 0 … blocks-1, merged."""
        for _ in range(LOOKS):
            forest, lost = Forest(self._work.block, self._work.size), False
            found = self.pieces() - self._damaged
            for node in maximal([piece for piece in found if isinstance(piece, Node)], blocks):
                sums = self.read(node)
                if sums is None:
                    # Another run merged it, and the parent is there; or it was damaged, and a part of it may be there.
                    lost = True
                else:
                    forest.add(node, sums)
            if not lost:
                break
        return forest


def check_platforms(header: Mapping) -> None:
    """Damage for a header that does not name the platforms of its sums."""
    named = header.get("platforms")
    if not isinstance(named, list) or not all(isinstance(name, str) for name in named):
        raise Damage("does not name the platforms that its sums were made on")


def mixture(platforms: Collection[str]) -> str:
    """What is said of sums that were not all made on one platform; the same line for every case of a run."""
    named = "; ".join(f"({number}) {name}" for number, name in enumerate(sorted(platforms), start=1))
    return (
        f"stored sums were made on {len(platforms)} platforms and are equal to rounding, not to the last bit: {named}"
    )


def encoded(header: Mapping, values: np.ndarray) -> bytes:
    """The content of a file."""
    body = MAGIC + json.dumps(header, sort_keys=True).encode() + b"\n" + values.astype("<f8").tobytes()
    return body + hashlib.sha256(body).digest()


def is_directory(path: Path) -> bool:
    """Whether a directory is there; raises OSError where nobody may look.

    Path.is_dir raises it up to Python 3.13 alone: later it takes what may not be seen for what is not there.
    """
    try:
        return stat.S_ISDIR(path.stat().st_mode)
    except (FileNotFoundError, NotADirectoryError):
        return False


def content(path: Path) -> bytes:
    """What a stored file holds; Damage for a pipe, a device or a directory, which nobody here has put there."""
    descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK)  # or a pipe would wait for a writer
    with open(descriptor, "rb") as file:
        if not stat.S_ISREG(os.fstat(descriptor).st_mode):
            raise Damage("no regular file")
        return file.read()


def decoded(raw: bytes) -> tuple[dict, np.ndarray]:
    """Header and sums of a file's content; Damage if it is not exactly what was written."""
    body, digest = raw[:-DIGEST], raw[-DIGEST:]
    if not body.startswith(MAGIC):
        raise Damage("not a file of sums" if raw else "empty")
    if hashlib.sha256(body).digest() != digest:
        raise Damage("truncated or altered")
    line, _, payload = body[len(MAGIC) :].partition(b"\n")
    try:
        header, values = json.loads(line), np.frombuffer(payload, dtype="<f8").astype(np.float64)
    except (ValueError, RecursionError) as error:
        raise Damage(f"not as this program writes: {error}") from error
    if not isinstance(header, dict):
        raise Damage("not as this program writes: no header")
    platforms = header.get("platforms")
    if not isinstance(platforms, list) or not all(isinstance(name, str) for name in platforms):
        raise Damage("not as this program writes: no platforms")
    return header, values

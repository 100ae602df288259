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

An identity is 32 digits of the question (what is asked) and 32 of the sources that answer it. Where only the sources
differ, tasks whose sums were marked in the headers are computed again: if all have the marked bytes, the folder is
taken over. What was found lies there, so that nobody looks a second time:

    <sources>.same              these sources give the bytes of this folder
    <sources>-<platform>.other  on this platform they do not
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
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from radarsim.engine.blocks import QUESTION, Forest, Node, Partial, Piece, Total, Work, maximal, simulated
from radarsim.engine.machine import platform_name, versions
from radarsim.engine.moments import Sums
from radarsim.errors import StoreError

MAGIC = b"radarsim sums 1\n"  # another number if the same realisations are ever added in another order
SUFFIX = ".sums"
DIGEST = 32
STALE_S = 600
LOOKS = 4
MOST_MARKS = 128  # in a header
PROOF_S = 2.0  # of CPU time, at least one task: what is computed again of a folder of other sources


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

    `warnings` gathers what was found damaged; `platforms` and `marks` those of all sums read or computed so far.
    """

    def __init__(self, directory: str | os.PathLike, work: Work):
        if not re.fullmatch(r"[0-9a-f]{2,128}", work.identity):
            raise ValueError(f"identity: expected hexadecimal digits, got {work.identity!r}")
        self.path = folder_of(Path(directory) / ".blocks", work)
        self.warnings: list[str] = []
        self.platforms: set[str] = set()
        self.marks: dict[Node | Partial, str] = {}
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
        self.marks |= marks_in(header)
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
            "identity": self.path.name,
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
            spans = [(hashed, one, *one.realisations(self._work.block)) for one, hashed in dict(self.marks).items()]
            spans.sort(key=lambda mark: mark[0])  # the least hashes are a draw that merging does not disturb
            for piece, sums in pieces.items():
                described = self._described(piece, *piece.realisations(self._work.block))
                first, count = described["first"], described["count"]
                inside = [one for one in spans if first <= one[2] and one[2] + one[3] <= first + count]
                marks = {one.name: hashed for hashed, one, *_ in inside[:MOST_MARKS]}
                header = described | {"platforms": sorted(self.platforms), "versions": versions(), "marks": marks}
                put(self.path / (piece.name + SUFFIX), encoded(header, sums.values))
            self._synchronise()
        except OSError as error:
            if isinstance(error, FileNotFoundError) and not last:
                raise
            where = error.filename or self.path
            raise StoreError(f"{where}: cannot be written: {error.strerror}") from error

    def mark(self, piece: Node | Partial, sums: Sums) -> None:
        """Remember the sums of a task by their hash; of many tasks those of the least hashes."""
        self.marks[piece] = mark_of(sums)
        if len(self.marks) > 4 * MOST_MARKS:
            self.marks = dict(sorted(self.marks.items(), key=lambda mark: mark[1])[: 2 * MOST_MARKS])

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


@dataclass(frozen=True)
class Settled:
    """What came of blocks that other sources made: whether their bytes are the same, and how many of the stored
    realisations were computed again to tell."""

    identity: str
    same: bool
    again: int
    stored: int


settled: list[Settled] = []  # found by this process and not yet said to the user
_unkept: dict[Path, bool] = {}  # what could not be written, by its file


def folder_of(blocks: Path, work: Work) -> Path:
    """The folder with the sums of a work: its own, or one of other sources that give the same bytes."""
    own, sources = blocks / work.identity, work.identity[QUESTION:]
    try:
        if not sources or own.is_dir():
            return own
        others = [path for path in blocks.glob(f"{work.identity[:QUESTION]}*") if len(path.name) == len(own.name)]
        others.sort(key=lambda path: path.stat().st_mtime, reverse=True)
        known = [path for path in others if (path / f"{sources}.same").exists()]
    except OSError:  # said by whoever reads or writes there
        return own
    return next((path for path in known or others if known or _gives_the_same(path, work)), own)


def _gives_the_same(folder: Path, work: Work) -> bool:
    """Whether a work has the marks of a folder, as far as PROOF_S reaches; kept in the folder."""
    sources, here = work.identity[QUESTION:], hashlib.sha256(platform_name().encode()).hexdigest()[:8]
    files = folder / f"{sources}-{here}.other", folder / f"{sources}.same"
    if files[0].exists() or _unkept.get(files[0]) is not None:
        return _unkept.get(files[0], False)
    marks, stored = _marked(folder, work)
    again, seconds, same = 0, 0.0, bool(marks)
    for piece in sorted(marks, key=marks.__getitem__):
        if again == 0:
            work.simulate(piece.realisations(work.block)[0], 1)  # compiles
        elif seconds > PROOF_S:
            break
        started = time.thread_time()
        sums = simulated(work, piece)
        seconds += time.thread_time() - started
        again += sums.count
        if mark_of(sums) != marks[piece]:
            same = False
            break
    settled.append(Settled(work.identity, same, again, stored))
    try:
        put(files[same], json.dumps({"computed_again": again, "stored": stored}).encode())
    except OSError:  # a store that may only be read
        _unkept[files[0]] = same
    return same


def _marked(folder: Path, work: Work) -> tuple[dict[Node | Partial, str], int]:
    """The marks of a folder, and how many realisations it holds; nothing where its blocks are of another length."""
    marks: dict[Node | Partial, str] = {}
    pieces = [piece for path in folder.iterdir() if (piece := piece_named(path.name)) is not None]
    stored = sum(work.block << one.level for one in maximal([one for one in pieces if isinstance(one, Node)], 1 << 62))
    for piece in pieces:
        with suppress(OSError, Damage):
            header, values = decoded(content(folder / (piece.name + SUFFIX)))
            if (header.get("block"), values.size) == (work.block, work.size):
                marks |= marks_in(header)
                stored = max(stored, piece.realisations(work.block)[1])
    return marks, stored


def mark_of(sums: Sums) -> str:
    """The hash of the sums of a task, 32 hexadecimal digits."""
    return hashlib.sha256(sums.values.tobytes()).hexdigest()[:32]


def marks_in(header: Mapping) -> dict[Node | Partial, str]:
    """The marks of a header, by task; those of earlier versions have none."""
    held = header.get("marks")
    named = {piece_named(name + SUFFIX): hashed for name, hashed in held.items()} if isinstance(held, dict) else {}
    return {piece: str(hashed) for piece, hashed in named.items() if isinstance(piece, Node | Partial)}


def put(path: Path, content: bytes) -> None:
    """Write a file, whole or not at all, and durable but for its name; OSError with the file's name."""
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

"""The platform, which decides the last bits of sums, and versions for the record.

Finished sums on disk: DIR/.blocks/<identity>/, a file for each piece, so that a killed run loses about a second.

    L05-3.sums      node of level 5, index 3: blocks 96 … 127
    P24-1696.sums   the first 1696 realisations of block 24
    T100000.sums    the total of realisations 0 … 99999, as it was reported

A run keeps the largest nodes it has. When a node is safely on disk, the files inside it are removed. Nothing else is
removed: a run with a smaller N than was done before leaves the large nodes alone, computes the small ones it lacks
beside them (with the same bytes), and stores them too. A total outlives the nodes it was added from, so that a reported
result can be read again after a larger run has merged them.

A file is one line of magic, one line of JSON, the sums as little-endian float64 and the SHA-256 of all that. It is
written under a temporary name, synchronised and renamed: it is complete or absent. Equal names hold equal sums, so that
several runs may share a store; a file merged by another run is found in its parent.

An identity is 32 digits of the request and 32 of the sources. Where only the sources differ, tasks whose sums were
marked in the headers are computed again, and totals are added up again from the blocks beside them: if all bytes are
equal, the folder is used. The result is kept there, so that this is done once:

    <sources>.same              these sources give the bytes of this folder
    <sources>-<platform>.other  on this platform they do not

Finished sums are put into the store about once a second, in a thread of its own, so that no worker waits for a disk.

The stored part of a run or a share, by the names of files alone; only results of other sources are recomputed.

An audit of stored blocks, without the work that made them: does each file match its name, do all the blocks of a total
exist, do they add up to it? Nothing is changed."""

import functools
import hashlib
import json
import os
import platform as system
import re
import stat
import sys
import threading
import time
import uuid
from collections.abc import Collection, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from importlib import metadata
from pathlib import Path

import numpy as np

from radarsim.engine.blocks import (
    QUESTION,
    Forest,
    Node,
    Partial,
    Piece,
    Total,
    Work,
    added,
    gaps,
    maximal,
    share_bound,
    share_of,
    simulated,
    widest,
)
from radarsim.engine.results import Sums
from radarsim.errors import StoreError
from radarsim.threads import forbidden

# ---- machine ---------------------------------------------------------------------------------------------------------
# Those that change which fused or vector instructions a compiler chooses, from the widest.
_DECIDING = ("avx512f", "avx2", "fma", "avx", "sse4_2", "asimd")


@functools.cache
def instruction_set() -> str:
    """The instruction set, like `x86_64 avx512f avx2 fma`; with equal ones sums are equal to the last bit. If the
    compiler targets another processor (NUMBA_CPU_NAME), that is named, since it decides instead; so are features
    disabled for NumPy (NPY_DISABLE_CPU_FEATURES)."""
    aimed_at, disabled = os.environ.get("NUMBA_CPU_NAME"), os.environ.get("NPY_DISABLE_CPU_FEATURES")
    found = set(_flags())
    parts = [system.machine(), *(flag for flag in _DECIDING if flag in found)]
    parts += [f"aiming at {aimed_at}"] if aimed_at else []
    return " ".join([*parts, f"NumPy without {disabled}"] if disabled else parts)


def _cpuinfo() -> list[str]:
    """The lines in which Linux describes the first processor; empty elsewhere."""
    try:
        with open("/proc/cpuinfo", encoding="ascii", errors="replace") as file:
            return file.read(8192).splitlines()
    except OSError:
        return []


def _flags() -> list[str]:
    """Features of the first processor, as Linux lists them; empty elsewhere."""
    return next((line.split() for line in _cpuinfo() if line.startswith(("flags", "Features"))), [])


@functools.cache
def processor() -> str:
    """The processor's name; empty where the system does not say."""
    names = [line.partition(":")[2].strip() for line in _cpuinfo() if "model name" in line]
    return names[0] if names else system.processor()


def available_cores() -> int:
    """How many cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@functools.cache
def described() -> dict[str, object]:
    """The machine for a reader: system, processor, cores."""
    return {
        "system": system.platform(),
        "processor": processor(),
        "architecture": system.machine(),
        "cores": available_cores(),
        "byteorder": sys.byteorder,
    }


@functools.cache
def linear_algebra() -> str:
    """The BLAS library that NumPy has loaded, and the processor of its kernels, like `openblas SkylakeX`. The
    processor, or OPENBLAS_CORETYPE, selects the kernels; the order of sums differs between them."""
    from threadpoolctl import threadpool_info

    found = {
        f"{library['internal_api']} {library.get('architecture', '')}".strip()
        for library in threadpool_info()
        if library["user_api"] == "blas"
    }
    return ", ".join(sorted(found))


LIBRARIES = ("numba", "llvmlite", "numpy", "scipy")  # that compile and compute


@functools.cache
def platform() -> dict[str, str]:
    """All that decides the last bits: processor, instruction set, BLAS, and the versions of compiler and libraries."""
    here = {"processor": processor(), "instruction_set": instruction_set(), "linear_algebra": linear_algebra()}
    return here | {name: metadata.version(name) for name in LIBRARIES}


@functools.cache
def platform_name() -> str:
    """The platform in one line, as in the header of stored sums: equal lines, equal bytes."""
    libraries = ", ".join(f"{name} {platform()[name]}" for name in LIBRARIES)
    return f"{processor() or 'unknown processor'}: {instruction_set()}; {linear_algebra()}; {libraries}"


def versions() -> dict[str, str]:
    """Versions of Python and of the loaded libraries that compute."""
    libraries = {name: sys.modules[name].__version__ for name in ("numpy", "numba") if name in sys.modules}
    return {"python": system.python_version()} | libraries


# ---- store -----------------------------------------------------------------------------------------------------------
MAGIC = b"radarsim sums 1\n"  # another number if the same realisations are ever added in another order
SUFFIX = ".sums"
DIGEST = 32
STALE_S = 600
LOOKS = 4
MOST_MARKS = 128  # in a header
PROOF_S = 2.0  # of CPU time, at least one task: recomputed from a folder of other sources


class Damage(Exception):
    """A file does not match its name; the text says why."""


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
    """The pieces of one work under a results directory. Makes no directory before the first write. `warnings` collects
    damage; `platforms` and `marks` those of all sums read or computed so far."""

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
        """The stored pieces, by file names; empty if the directory does not exist."""
        try:
            names = os.listdir(self.path)
        except FileNotFoundError:
            return set()
        except OSError as error:
            raise StoreError(f"{self.path}: cannot be listed: {error.strerror}") from error
        return {piece for name in names if (piece := piece_named(name)) is not None}

    def read(self, piece: Piece) -> Sums | None:
        """The sums of a piece, checked; None if it is absent or damaged. A damaged file is renamed to `<name>.damaged`
        and named in warnings."""
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
        check(header, values, self._described(piece))
        if values.size != self._work.size:
            raise Damage(f"expected {self._work.size} numbers, got {values.size}")

    def _described(self, piece: Piece) -> dict:
        work = self._work
        return described_piece(self.path, piece, work.block) | {"block": work.block, "size": work.size}

    def make(self, last: bool = True) -> None:
        """Make the directory, if absent; FileNotFoundError is passed on except on the last try."""
        try:
            self.path.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            if isinstance(error, FileNotFoundError) and not last:
                raise
            raise StoreError(f"{error.filename or self.path}: cannot be written: {error.strerror}") from error

    def write(self, pieces: Mapping[Piece, Sums]) -> None:
        """Put pieces on disk; on return they survive a power cut. StoreError, with the old files intact, if the disk is
        full or cannot be written."""
        if not pieces:
            return
        for look in range(LOOKS):
            with suppress(FileNotFoundError):  # `radarsim clean` removed the directory, or the one above it, just now
                self.make(last=look == LOOKS - 1)
                self._write_all(pieces, last=look == LOOKS - 1)
                return

    def _write_all(self, pieces: Mapping[Piece, Sums], last: bool) -> None:
        try:
            spans = [(hashed, one, *one.realisations(self._work.block)) for one, hashed in dict(self.marks).items()]
            spans.sort(key=lambda mark: mark[0])  # the least hashes are a sample that merging does not disturb
            for piece, sums in pieces.items():
                described = self._described(piece)
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
        """Remember the sums of a task by their hash; of many tasks those with the least hashes."""
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
        """Remove files of pieces contained in durable nodes, and temporary files of a killed run."""
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
        """All stored pieces of blocks 0 … blocks-1, merged."""
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
    """Result for blocks from other sources: whether their bytes are equal, and how many of the stored realisations were
    recomputed to tell."""

    identity: str
    same: bool
    again: int
    stored: int


settled: list[Settled] = []  # of this process, not yet reported to the user
_unkept: dict[Path, bool] = {}  # files that could not be written


def folder_of(blocks: Path, work: Work) -> Path:
    """The folder with the sums of a work: its own, or one from other sources with the same bytes."""
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
    """Whether a work has the marks of a folder, as far as PROOF_S allows; kept in the folder."""
    sources, here = work.identity[QUESTION:], hashlib.sha256(platform_name().encode()).hexdigest()[:8]
    files = folder / f"{sources}-{here}.other", folder / f"{sources}.same"
    if files[0].exists() or _unkept.get(files[0]) is not None:
        return _unkept.get(files[0], False)
    marks, stored = _marked(folder, work)
    looked: list[tuple[int, int]] = []
    seconds, same = 0.0, bool(marks) and not audited(folder).astray
    for piece in sorted(marks if same else {}, key=marks.__getitem__):
        if not looked:
            work.simulate(piece.realisations(work.block)[0], 1)  # compiles
        elif seconds > PROOF_S:
            break
        started = time.thread_time()
        sums = simulated(work, piece)
        seconds += time.thread_time() - started
        looked.append(piece.realisations(work.block))
        if mark_of(sums) != marks[piece]:
            same = False
            break
    again = _distinct(looked)
    settled.append(Settled(work.identity, same, again, stored))
    try:
        put(files[same], json.dumps({"computed_again": again, "stored": stored}).encode())
    except OSError:  # a store that may only be read
        _unkept[files[0]] = same
    return same


def _distinct(pieces: Collection[tuple[int, int]]) -> int:
    """Number of distinct realisations in some pieces, each with its first and count: the end of a run may lie in a task
    of a longer one."""
    found = reached = 0
    for first, count in sorted(pieces):
        found += max(first + count - max(first, reached), 0)
        reached = max(reached, first + count)
    return found


def _marked(folder: Path, work: Work) -> tuple[dict[Node | Partial, str], int]:
    """The marks of a folder, and its number of realisations; nothing where its blocks have another length."""
    marks: dict[Node | Partial, str] = {}
    held: list[tuple[int, int]] = []
    pieces = [piece for path in folder.iterdir() if (piece := piece_named(path.name)) is not None]
    for piece in pieces:
        with suppress(OSError, Damage):
            header, values = decoded(content(folder / (piece.name + SUFFIX)))
            if (header.get("block"), values.size) == (work.block, work.size):
                marks |= marks_in(header)
                held.append(piece.realisations(work.block))
    return marks, _distinct(held)


def mark_of(sums: Sums) -> str:
    """The hash of the sums of a task, 32 hexadecimal digits."""
    return hashlib.sha256(sums.values.tobytes()).hexdigest()[:32]


def marks_in(header: Mapping) -> dict[Node | Partial, str]:
    """The marks of a header, by task; earlier versions have none."""
    held = header.get("marks")
    named = {piece_named(name + SUFFIX): hashed for name, hashed in held.items()} if isinstance(held, dict) else {}
    return {piece: str(hashed) for piece, hashed in named.items() if isinstance(piece, Node | Partial)}


def put(path: Path, content: bytes) -> None:
    """Write a file, completely or not at all, durable except for its name; OSError with the file's name."""
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


def described_piece(folder: Path, piece: Piece, block: int) -> dict:
    """The header of a piece in a folder, with so many realisations in a block."""
    first, count = piece.realisations(block)
    return {"identity": folder.name, "piece": piece.name, "first": first, "count": count}


def check(header: Mapping, values: np.ndarray, expected: Mapping) -> None:
    """Damage for an unexpected header, and for sums that are not finite."""
    for key, value in expected.items():
        if header.get(key) != value:
            raise Damage(f"{key}: expected {value}, got {header.get(key)}")
    if not np.isfinite(values).all():
        raise Damage("not all numbers are finite")


def mixture(platforms: Collection[str]) -> str:
    """A note on sums from several platforms; the same line for every case of a run."""
    named = "; ".join(f"({number}) {name}" for number, name in enumerate(sorted(platforms), start=1))
    return (
        f"stored sums were made on {len(platforms)} platforms and are equal to rounding, not to the last bit: {named}"
    )


def encoded(header: Mapping, values: np.ndarray) -> bytes:
    """The content of a file."""
    body = MAGIC + json.dumps(header, sort_keys=True).encode() + b"\n" + values.astype("<f8").tobytes()
    return body + hashlib.sha256(body).digest()


def is_directory(path: Path) -> bool:
    """Whether a directory exists; raises OSError where access is denied. Path.is_dir raises that only up to Python
    3.13: later it returns False without access."""
    try:
        return stat.S_ISDIR(path.stat().st_mode)
    except (FileNotFoundError, NotADirectoryError):
        return False


def content(path: Path) -> bytes:
    """The content of a stored file; Damage for a pipe, a device or a directory, which no run writes."""
    descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK)  # or a pipe would wait for a writer
    with open(descriptor, "rb") as file:
        if not stat.S_ISREG(os.fstat(descriptor).st_mode):
            raise Damage("no regular file")
        return file.read()


def decoded(raw: bytes) -> tuple[dict, np.ndarray]:
    """Header and sums of a file's content; Damage unless it is exactly as written."""
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


# ---- keeper ----------------------------------------------------------------------------------------------------------
PERIOD_S = 1.0
SMALLEST = 64


class Keeper:
    """Tracks which nodes are on disk, and writes the others."""

    def __init__(self, store: Store):
        self.store = store
        self._durable: set[Node] = set()
        self._thread: threading.Thread | None = None
        self._error: Exception | None = None
        self._due = time.monotonic() + PERIOD_S

    def found(self, nodes: Mapping[Node, Sums]) -> None:
        """These were read; a merged node is not among the files, and is written like any other."""
        stored = self.store.pieces()
        self._durable.update(node for node in nodes if node in stored)

    def offer(self, nodes: Mapping[Node, Sums]) -> None:
        """Start to write the new nodes, if a second has passed. Raises the error of the writing before.

        A node of less than 1/64 of the largest new one is left out: it will soon be part of another, and would cost as
        much to write. All of them together are a thirtieth of what a kill would lose anyway."""
        if time.monotonic() < self._due or (self._thread is not None and self._thread.is_alive()):
            return
        self._raise()
        self._durable &= nodes.keys()
        fresh: dict[Piece, Sums] = {node: sums for node, sums in nodes.items() if node not in self._durable}
        largest = max((sums.count for sums in fresh.values()), default=0)
        fresh = {node: sums for node, sums in fresh.items() if sums.count * SMALLEST >= largest}
        if forbidden():
            self._put(fresh)
        else:
            self._thread = threading.Thread(target=self._put, args=(fresh,), name="keeper", daemon=True)
            self._thread.start()
        self._due = time.monotonic() + PERIOD_S

    def finish(self, pieces: Mapping[Piece, Sums]) -> None:
        """Write all nodes not yet on disk, and wait for that."""
        if self._thread is not None:
            self._thread.join()
        self._raise()
        self._durable &= pieces.keys()
        for _ in range(LOOKS):
            self._put({piece: sums for piece, sums in pieces.items() if piece not in self._durable})
            self._raise()
            # `radarsim clean` may have removed what this run wrote before.
            stored = self.store.pieces()
            if all(piece in stored or any(node in stored for node in piece.above(64)) for piece in pieces):
                return
            self._durable.clear()

    def _put(self, pieces: Mapping[Piece, Sums]) -> None:
        try:
            if pieces:
                self.store.write(pieces)
                self._durable.update(piece for piece in pieces if isinstance(piece, Node))
                self.store.sweep(self._durable)
        except Exception as error:
            self._error = error

    def _raise(self) -> None:
        if self._error is not None:
            raise self._error


# ---- stock -----------------------------------------------------------------------------------------------------------
BY_CHANCE = 0.2  # that what is missing ends where shares do, without being shares


@dataclass(frozen=True)
class Stock:
    """The stored part of `asked` realisations.

    missing: runs (first, last) of missing realisations. loose: whether there are blocks beyond a gap, or blocks that no
    run reported, as from shares or a killed run; shares then says which shares of how many are missing, as far as the
    ends show."""

    asked: int
    stored: int
    missing: tuple[tuple[int, int], ...]
    shares: tuple[tuple[int, ...], int] | None
    loose: bool


def stock(work: Work, realisations: int, store: str | os.PathLike[str] | None, part: tuple[int, int] = (1, 1)) -> Stock:
    """The stored part of N realisations of a work, or of a share of them, as (2, 3) the second of three; nothing
    without a directory."""
    pieces, block = set() if store is None else Store(store, work).pieces(), work.block
    first, stop, rest = share_of(realisations, block, part)
    asked, full = (stop - first) * block + rest, realisations // block
    if Total(realisations) in pieces:
        return Stock(asked, asked, (), None, loose=False)
    nodes = maximal([piece for piece in pieces if isinstance(piece, Node)], full)
    runs, blocks = gaps(nodes, stop, first), full + (realisations % block > 0)
    if rest and Partial(full, rest) not in pieces:
        runs.append((runs.pop()[0] if runs and runs[-1][1] == full else full, blocks))
    missing = tuple((begin * block, min(end * block, realisations) - 1) for begin, end in runs)
    stored = asked - sum(last + 1 - begin for begin, last in missing)
    beyond = bool(runs) and any(node.first >= runs[0][1] for node in nodes)
    loose = beyond or (stored > 0 and not any(isinstance(piece, Total) for piece in pieces))
    return Stock(asked, stored, missing, as_shares(runs, blocks) if loose else None, loose)


def as_shares(missing: Collection[tuple[int, int]], blocks: int) -> tuple[tuple[int, ...], int] | None:
    """Which shares of how many the missing runs (first, stop) of `blocks` blocks are, as ((2,), 3); None for none.

    The fewest shares that fit, unless that is likely by chance: each inner end lies by chance on one of the n − 1
    bounds of n shares."""
    ends = [end for run in missing for end in run if 0 < end < blocks]
    chance, of = 0.0, 1
    while ends and chance <= BY_CHANCE and of < blocks:
        of += 1
        chance += ((of - 1) / blocks) ** len(ends)
        numbers = {share_bound(blocks, number, of): number for number in range(of + 1)}
        if chance <= BY_CHANCE and all(end in numbers for run in missing for end in run):
            return tuple(n for first, stop in missing for n in range(numbers[first] + 1, numbers[stop] + 1)), of
    return None


# ---- audit -----------------------------------------------------------------------------------------------------------
BESIDE = re.compile(r"[0-9a-f]+(-[0-9a-f]+)?\.(same|other)")  # of other sources
LEFT = re.compile(r"\.[\w-]+\.(sums|same|other)\.[0-9a-f]+\.tmp")  # of a run that was killed while writing
ACROSS = 1e-9  # of sums made on several platforms


@dataclass
class Audit:
    """Of one identity: the intact pieces, with headers and sums; stray totals, which are not the sum of the blocks
    beside them; faults, each naming its file; notes."""

    path: Path
    pieces: dict[Piece, tuple[dict, np.ndarray]] = field(default_factory=dict)
    astray: list[Total] = field(default_factory=list)
    faults: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)


def audited(path: Path, reported: int | None = None) -> Audit:
    """Check the blocks of one identity, and that the total of `reported` realisations is among them."""
    found = Audit(path)
    for name in _names(path):
        piece = piece_named(name)
        if piece is not None:
            _read(found, piece)
        elif name.endswith(".damaged"):
            found.notes.append(f"{path / name}: set aside as damaged by an earlier run")
    shapes = {(header["block"], values.size) for header, values in found.pieces.values()}
    if len(shapes) > 1:
        found.faults.append(f"{path}: blocks of several sizes")
        return found
    platforms = {name for header, _ in found.pieces.values() for name in header["platforms"]}
    if len(platforms) > 1:
        found.notes.append(f"{path}: {mixture(platforms)}")
    if reported is not None and Total(reported) not in found.pieces:
        _missing(found, Total(reported))
    _gaps(found)
    for total in sorted((piece for piece in found.pieces if isinstance(piece, Total)), key=lambda piece: piece.count):
        _added_up(found, total)
    return found


def _names(path: Path) -> list[str]:
    try:
        return sorted(os.listdir(path))
    except OSError as error:
        raise StoreError(f"{path}: cannot be listed: {error.strerror}") from error


def _read(found: Audit, piece: Piece) -> None:
    path = found.path / (piece.name + SUFFIX)
    try:
        header, values = decoded(content(path))
        block = header.get("block")
        if not isinstance(block, int) or block < 1:
            raise Damage(f"block: expected a number, got {block}")
        check(header, values, described_piece(found.path, piece, block) | {"size": values.size})
    except OSError as error:
        found.faults.append(f"{path}: cannot be read: {error.strerror}")
    except Damage as damage:
        found.faults.append(f"{path}: damaged: {damage}")
    else:
        found.pieces[piece] = header, values


def _gaps(found: Audit) -> None:
    """A note on missing realisations before stored ones, as where a share was not copied."""
    nodes = [piece for piece in found.pieces if isinstance(piece, Node)]
    end = max((node.stop for node in nodes), default=0)
    for first, stop in gaps(maximal(nodes, end), end):
        block = found.pieces[nodes[0]][0]["block"]
        span = f"realisations {first * block:,} to {stop * block - 1:,}"
        found.notes.append(f"{found.path}: {span} are not stored, but later ones are")


def _missing(found: Audit, piece: Piece) -> None:
    fault = f"{found.path / (piece.name + SUFFIX)}: missing"
    if not any(known.startswith(fault.removesuffix("missing")) for known in found.faults):
        found.faults.append(fault)


def _added_up(found: Audit, total: Total) -> None:
    """Whether the pieces of a total exist, and add up to it."""
    header, values = found.pieces[total]
    block = header["block"]
    full, rest = divmod(total.count, block)
    nodes = [piece for piece in found.pieces if isinstance(piece, Node)]
    forest = Forest(block, values.size)
    inner = maximal(nodes, full)
    for node in inner:
        forest.add(node, Sums(*_sums(found, node)))
    for first, stop in forest.gaps(full):
        if any(node.first <= first and stop <= node.stop for node in nodes):
            continue
        while first < stop:
            _missing(found, node := widest(first, stop, 62))
            first = node.stop
    cut = Partial(full, rest)
    inside = any(node in found.pieces for node in cut.above(64))
    if rest and cut not in found.pieces and not inside:
        _missing(found, cut)
    if forest.gaps(full) or (rest and cut not in found.pieces):
        return  # nothing to add up: a larger run has merged them
    sums = forest.total()
    if rest:
        end = Sums(*_sums(found, cut))
        sums = added(sums, end, 0) if full else end
    used: list[Piece] = [total, *inner, *([cut] if rest else [])]
    platforms = {name for piece in used for name in found.pieces[piece][0]["platforms"]}
    if sums.count != total.count or not agree(sums.values, values, platforms):
        found.astray.append(total)
        found.faults.append(f"{found.path / (total.name + SUFFIX)}: is not the sum of the blocks beside it")


def agree(one: np.ndarray, other: np.ndarray, platforms: set[str]) -> bool:
    """Whether two vectors of the same sums are equal: to the last bit, if all came from one platform."""
    if len(platforms) < 2:
        return one.tobytes() == other.tobytes()
    return bool(np.allclose(one, other, rtol=ACROSS, atol=ACROSS * float(np.abs(other).max(initial=0.0))))


def _sums(found: Audit, piece: Piece) -> tuple[int, np.ndarray]:
    header, values = found.pieces[piece]
    return header["count"], values


def removable(path: Path) -> list[tuple[Path, int]]:
    """The files of one identity that a store makes, and their bytes; never links or foreign files."""
    found = []
    for name in _names(path):
        if piece_named(name.removesuffix(".damaged")) is not None or BESIDE.fullmatch(name) or LEFT.fullmatch(name):
            status = (path / name).lstat()
            if stat.S_ISREG(status.st_mode):
                found.append((path / name, status.st_size))
    return found

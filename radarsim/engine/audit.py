"""An audit of stored blocks, without the work that made them: is each file what its name says, are all the blocks there
that a total was added from, do they add up to it? Nothing is changed."""

import os
import re
import stat
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from radarsim.engine.blocks import Forest, Node, Partial, Piece, Total, added, gaps, maximal, widest
from radarsim.engine.moments import Sums
from radarsim.engine.store import SUFFIX, Damage, check_platforms, content, decoded, mixture, piece_named
from radarsim.errors import StoreError

BESIDE = re.compile(r"[0-9a-f]+(-[0-9a-f]+)?\.(same|other)")  # of other sources
LEFT = re.compile(r"\.[\w-]+\.(sums|same|other)\.[0-9a-f]+\.tmp")  # by a run that was killed while it wrote
ACROSS = 1e-9  # of sums made on several platforms


@dataclass
class Audit:
    """Of one identity: the pieces that are whole, with their headers and sums; faults, each naming its file; notes."""

    path: Path
    pieces: dict[Piece, tuple[dict, np.ndarray]] = field(default_factory=dict)
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
        _check(header, values, piece, found.path.name)
    except OSError as error:
        found.faults.append(f"{path}: cannot be read: {error.strerror}")
    except Damage as damage:
        found.faults.append(f"{path}: damaged: {damage}")
    else:
        found.pieces[piece] = header, values


def _check(header: dict, values: np.ndarray, piece: Piece, identity: str) -> None:
    block = header.get("block")
    if not isinstance(block, int) or block < 1:
        raise Damage(f"block: expected a number, got {block}")
    first, count = piece.realisations(block)
    expected = {"identity": identity, "piece": piece.name, "first": first, "count": count, "size": values.size}
    for key, value in expected.items():
        if header.get(key) != value:
            raise Damage(f"{key}: expected {value}, got {header.get(key)}")
    check_platforms(header)
    if not np.isfinite(values).all():
        raise Damage("not all numbers are finite")


def _gaps(found: Audit) -> None:
    """A note on realisations that are not stored before others that are, as where a share was not copied."""
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
    """Whether the pieces that a total was added from are there, and are its sum."""
    header, values = found.pieces[total]
    block = header["block"]
    full, rest = divmod(total.count, block)
    nodes = [piece for piece in found.pieces if isinstance(piece, Node)]
    forest = Forest(block, values.size)
    inner = maximal(nodes, full)
    for node in inner:
        forest.add(node, Sums(*_sums(found, node)))
    for first, stop in forest.gaps(full):
        if any(_covers(node, (first, stop)) for node in nodes):
            continue
        for node in _widest(first, stop):
            _missing(found, node)
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
    if not agree(sums.values, values, {name for piece in used for name in found.pieces[piece][0]["platforms"]}):
        found.faults.append(f"{found.path / (total.name + SUFFIX)}: is not the sum of the blocks beside it")


def agree(one: np.ndarray, other: np.ndarray, platforms: set[str]) -> bool:
    """Whether two vectors of the same sums are equal: to the last bit, if all came from one platform."""
    if len(platforms) < 2:
        return one.tobytes() == other.tobytes()
    return bool(np.allclose(one, other, rtol=ACROSS, atol=ACROSS * float(np.abs(other).max(initial=0.0))))


def _covers(node: Node, gap: tuple[int, int]) -> bool:
    return node.first <= gap[0] and gap[1] <= node.stop


def _widest(first: int, stop: int) -> Iterator[Node]:
    while first < stop:
        yield (node := widest(first, stop, 62))
        first = node.stop


def _sums(found: Audit, piece: Piece) -> tuple[int, np.ndarray]:
    header, values = found.pieces[piece]
    return header["count"], values


def removable(path: Path) -> list[tuple[Path, int]]:
    """The files of one identity that a store makes, and their bytes; nothing that is a link or somebody else's."""
    found = []
    for name in _names(path):
        if piece_named(name.removesuffix(".damaged")) is not None or BESIDE.fullmatch(name) or LEFT.fullmatch(name):
            status = (path / name).lstat()
            if stat.S_ISREG(status.st_mode):
                found.append((path / name, status.st_size))
    return found

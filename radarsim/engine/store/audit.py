"""An audit of stored blocks without the work that made them: files match their names, totals are the sum of blocks.

Nothing is changed."""

import os
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from radarsim.engine.blocks import Forest, Node, Partial, Piece, Total, add_sums, gaps, maximal_nodes, widest_node
from radarsim.engine.store.block_file import (
    Damage,
    block_path,
    check_block,
    decode,
    piece_header,
    piece_named,
    read_file,
)
from radarsim.engine.store.store import folder_fault, mixture_warning
from radarsim.engine.sums import Sums
from radarsim.errors import StoreError, count_text
from radarsim.system.private_files import UntrustedFileError

ACROSS_PLATFORMS = 1e-9  # relative: sums made on several platforms agree to this


@dataclass
class Audit:
    """Of one identity: the intact pieces, with headers and sums; faults, each naming its file; notes."""

    path: Path
    pieces: dict[Piece, tuple[dict, np.ndarray]] = field(default_factory=dict)
    faults: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    def sums(self, piece: Piece) -> Sums:
        """The sums of an intact piece."""
        header, values = self.pieces[piece]
        return Sums(header["count"], values)

    def nodes(self) -> list[Node]:
        """The intact nodes."""
        return [piece for piece in self.pieces if isinstance(piece, Node)]


def audit_blocks(path: Path, reported: int | None = None) -> Audit:
    """Check the blocks of one identity, and that the total of `reported` realisations is among them."""
    audit = Audit(path)
    if fault := folder_fault(path):
        audit.faults.append(fault)
        return audit
    for name in _file_names(path):
        piece = piece_named(name)
        if piece is not None:
            _read_piece(audit, piece)
        elif name.endswith(".damaged"):
            audit.notes.append(f"{path / name}: set aside as damaged by an earlier run")
    shapes = {(header["block"], values.size) for header, values in audit.pieces.values()}
    if len(shapes) > 1:
        audit.faults.append(f"{path}: blocks of several sizes")
        return audit
    platforms = {name for header, _ in audit.pieces.values() for name in header["platforms"]}
    if len(platforms) > 1:
        audit.notes.append(f"{path}: {mixture_warning(platforms)}")
    if reported is not None and Total(reported) not in audit.pieces:
        _report_missing(audit, Total(reported))
    _note_gaps(audit)
    totals = [piece for piece in audit.pieces if isinstance(piece, Total)]
    for total in sorted(totals, key=lambda piece: piece.count):
        _check_total(audit, total)
    return audit


def _file_names(path: Path) -> list[str]:
    try:
        return sorted(os.listdir(path))
    except OSError as error:
        raise StoreError(f"{path}: cannot be listed: {error.strerror}") from error


def _read_piece(audit: Audit, piece: Piece) -> None:
    path = block_path(audit.path, piece)
    try:
        header, values = decode(read_file(path))
        block = header.get("block")
        if not isinstance(block, int) or block < 1:
            raise Damage(f"block: expected a number, got {block}")
        check_block(header, values, piece_header(audit.path, piece, block) | {"size": values.size})
    except UntrustedFileError as error:
        audit.faults.append(f"{path}: {error.strerror}: not used")
    except OSError as error:
        audit.faults.append(f"{path}: cannot be read: {error.strerror}")
    except Damage as damage:
        audit.faults.append(f"{path}: damaged: {damage}")
    else:
        audit.pieces[piece] = header, values


def _note_gaps(audit: Audit) -> None:
    """Note missing realisations before stored ones, as where a share was not copied."""
    nodes = audit.nodes()
    end = max((node.stop for node in nodes), default=0)
    for first, stop in gaps(maximal_nodes(nodes, end), end):
        block = audit.pieces[nodes[0]][0]["block"]
        span = f"realisations {count_text(first * block)} to {count_text(stop * block - 1)}"
        audit.notes.append(f"{audit.path}: {span} are not stored, but later ones are")


def _report_missing(audit: Audit, piece: Piece) -> None:
    path = block_path(audit.path, piece)
    if not any(fault.startswith(f"{path}: ") for fault in audit.faults):
        audit.faults.append(f"{path}: missing")


def _check_total(audit: Audit, total: Total) -> None:
    """Check that the pieces of a total exist, and add up to it."""
    header, values = audit.pieces[total]
    full, partial = divmod(total.count, header["block"])
    nodes = audit.nodes()
    forest = Forest(header["block"], values.size)
    inner = maximal_nodes(nodes, full)
    for node in inner:
        forest.add(node, audit.sums(node))
    for first, stop in forest.gaps(full):
        if any(node.first <= first and stop <= node.stop for node in nodes):
            continue
        while first < stop:
            _report_missing(audit, node := widest_node(first, stop, 62))
            first = node.stop
    cut = Partial(full, partial)
    if partial and cut not in audit.pieces and not any(node in audit.pieces for node in cut.containing_nodes(64)):
        _report_missing(audit, cut)
    if forest.gaps(full) or (partial and cut not in audit.pieces):
        return  # nothing to add up: a larger run has merged them
    sums = forest.total()
    if partial:
        sums = add_sums(sums, audit.sums(cut), 0) if full else audit.sums(cut)
    parts: list[Piece] = [total, *inner, *([cut] if partial else [])]
    platforms = {name for piece in parts for name in audit.pieces[piece][0]["platforms"]}
    if sums.count != total.count or not agree(sums.values, values, platforms):
        audit.faults.append(f"{block_path(audit.path, total)}: is not the sum of the blocks beside it")


def agree(added_values: np.ndarray, stored_values: np.ndarray, platforms: set[str]) -> bool:
    """Whether two vectors of the same sums are equal: to the last bit, if all came from one platform."""
    if len(platforms) < 2:
        return added_values.tobytes() == stored_values.tobytes()
    scale = float(np.abs(stored_values).max(initial=0.0))
    return bool(np.allclose(added_values, stored_values, rtol=ACROSS_PLATFORMS, atol=ACROSS_PLATFORMS * scale))

"""A file of sums: its name, its bytes and its checksum.

A file is one line of magic, one line of JSON, the sums as little-endian float64 and the SHA-256 of all that. It is
written under a temporary name, synchronised and renamed: it is complete or absent."""

import errno
import hashlib
import json
import os
import re
import stat
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from radarsim.engine.blocks import Node, Partial, Piece, Total
from radarsim.system.private_files import UntrustedFileError, entry_fault

MAGIC = b"radarsim sums 1\n"  # another number if the same realisations are ever added in another order
SUFFIX = ".sums"
DIGEST_BYTES = 32


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


def block_path(folder: Path, piece: Piece) -> Path:
    """The file of a piece in a folder."""
    return folder / (piece.name + SUFFIX)


def piece_header(folder: Path, piece: Piece, block: int) -> dict[str, object]:
    """The header of a piece in a folder, with so many realisations in a block."""
    first, count = piece.realisations(block)
    return {"identity": folder.name, "piece": piece.name, "first": first, "count": count, "block": block}


def encode(header: Mapping, values: np.ndarray) -> bytes:
    """The content of a file."""
    body = MAGIC + json.dumps(header, sort_keys=True).encode() + b"\n" + values.astype("<f8").tobytes()
    return body + hashlib.sha256(body).digest()


def decode(content: bytes) -> tuple[dict, np.ndarray]:
    """Header and sums of a file's content; Damage unless it is exactly as written."""
    body, digest = content[:-DIGEST_BYTES], content[-DIGEST_BYTES:]
    if not body.startswith(MAGIC):
        raise Damage("not a file of sums" if content else "empty")
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


def check_block(header: Mapping, values: np.ndarray, expected: Mapping) -> None:
    """Raise Damage for an unexpected header, and for sums that are not finite."""
    for key, value in expected.items():
        if header.get(key) != value:
            raise Damage(f"{key}: expected {value}, got {header.get(key)}")
    if not np.isfinite(values).all():
        raise Damage("not all numbers are finite")


def read_file(path: Path) -> bytes:
    """The content of a stored file; Damage for a pipe, a device or a directory, which no run writes, and
    UntrustedFileError for a file that another user may have made or changed."""
    descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK)  # or a pipe would wait for a writer
    with open(descriptor, "rb") as file:
        status = os.fstat(descriptor)
        if not stat.S_ISREG(status.st_mode):
            raise Damage("no regular file")
        if fault := entry_fault(path, status):
            raise UntrustedFileError(errno.EPERM, fault, str(path))
        return file.read()

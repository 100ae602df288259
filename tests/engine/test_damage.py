"""Damaged files are found, named and computed again; a full disk leaves the old files as they were."""

import errno
import hashlib
import os
import re
import stat
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from radarsim.engine.blocks import Node
from radarsim.engine.collect import collect, read_stored
from radarsim.engine.store import writer as store_writer
from radarsim.engine.store.audit import audit_blocks
from radarsim.engine.store.block_file import MAGIC, decode, encode
from radarsim.engine.store.store import Store
from radarsim.engine.sums import Sums
from radarsim.errors import StoreError
from tests.engine.fake import NAMES, WORK, Fake, N, contents, names, same


def reforged(path, **changes):
    """A file with a right checksum and a changed header or sums."""
    header, values = decode(path.read_bytes())
    values = changes.pop("values", values)
    path.write_bytes(encode(header | changes, values))


DAMAGE = {
    "empty": lambda path: path.write_bytes(b""),
    "one byte": lambda path: path.write_bytes(b"r"),
    "magic only": lambda path: path.write_bytes(MAGIC),
    "text": lambda path: path.write_bytes(b"hello\n" * 100),
    "half": lambda path: path.write_bytes(path.read_bytes()[: path.stat().st_size // 2]),
    "without its last byte": lambda path: path.write_bytes(path.read_bytes()[:-1]),
    "a byte more": lambda path: path.write_bytes(path.read_bytes() + b"\0"),
    "zeros": lambda path: path.write_bytes(bytes(path.stat().st_size)),
    "another identity": lambda path: reforged(path, identity="cd34"),
    "another piece": lambda path: reforged(path, piece="L00-0"),
    "another place": lambda path: reforged(path, first=1),
    "another count": lambda path: reforged(path, count=1),
    "another block": lambda path: reforged(path, block=32),
    "another size": lambda path: reforged(path, size=6),
    "fewer numbers": lambda path: reforged(path, values=np.ones(4)),
    "not a number": lambda path: reforged(path, values=np.array([1.0, 2.0, np.nan, 4.0, 5.0])),
    "no platforms": lambda path: reforged(path, platforms=None),
    "platforms of another kind": lambda path: reforged(path, platforms=[1]),
    "JSON too deep": lambda path: path.write_bytes(signed(MAGIC + b"[" * 100_000 + b"\n" + bytes(40))),
    "no JSON": lambda path: path.write_bytes(signed(MAGIC + b"{]\n" + bytes(40))),
    "JSON of another kind": lambda path: path.write_bytes(signed(MAGIC + b"[]\n" + bytes(40))),
    "part of a number": lambda path: path.write_bytes(signed(MAGIC + b"{}\n" + bytes(43))),
}


def signed(body):
    return body + hashlib.sha256(body).digest()


@pytest.mark.parametrize("name", ["L08-0.sums", "P312-13.sums", "T5005.sums"])
@pytest.mark.parametrize("kind", DAMAGE)
def test_damage_is_found_named_and_computed_again(tmp_path, blocks, kind, name):
    collect(WORK, N, store=tmp_path)
    DAMAGE[kind](blocks / name)
    assert str(blocks if kind == "another block" else blocks / name) in audit_blocks(blocks, N).faults[0]
    if not name.startswith("T"):
        (blocks / "T5005.sums").unlink()
    result = collect(WORK, N, store=tmp_path)
    assert same(result)
    assert [warning.split(":")[0] for warning in result.warnings] == [str(blocks / name)]
    assert result.computed == {"L08-0.sums": 4096, "P312-13.sums": 13, "T5005.sums": 0}[name]
    assert names(blocks) == sorted([*NAMES, f"{name}.damaged"])
    clean = collect(WORK, N, store=tmp_path)
    assert same(clean)
    assert (clean.warnings, clean.computed) == ((), 0)


def test_every_truncation_is_found(tmp_path, blocks):
    collect(WORK, 16, store=tmp_path)
    good = (blocks / "L00-0.sums").read_bytes()
    for length in range(len(good)):
        (blocks / "L00-0.sums").write_bytes(good[:length])
        assert Store(tmp_path, WORK).read(Node(0, 0)) is None


def test_damage_that_cannot_be_moved_aside_is_not_believed_either(tmp_path, blocks, monkeypatch):
    collect(WORK, N, store=tmp_path)
    (blocks / "T5005.sums").unlink()
    (blocks / "L08-0.sums").write_bytes(b"bad")

    def refuse(*_):
        raise OSError(errno.EROFS, "Read-only file system")

    with monkeypatch.context() as patch:
        patch.setattr(os, "replace", refuse)
        assert read_stored(WORK, N, tmp_path) is None
        reader = Store(tmp_path, WORK)
        assert len(reader.forest(312).nodes) == 3
        assert len(reader.warnings) == 1
    result = collect(WORK, N, store=tmp_path)
    assert same(result)
    assert len(result.warnings) == 1


def test_a_file_appears_whole_and_safe_before_what_it_replaces_goes(tmp_path, blocks, monkeypatch):
    collect(WORK, 32, store=tmp_path)
    events = []

    def recorded(owner, name, describe):
        original = getattr(owner, name)

        def call(*given):
            events.append(describe(*given))
            return original(*given)

        monkeypatch.setattr(owner, name, call)

    def replaced(temporary, path):
        assert decode(Path(temporary).read_bytes())
        assert not path.exists()
        return f"rename {path.name}"

    recorded(os, "fsync", lambda fd: "sync directory" if stat.S_ISDIR(os.fstat(fd).st_mode) else "sync file")
    recorded(os, "replace", replaced)
    recorded(Path, "unlink", lambda path: f"remove {path.name}")
    writer = store_writer.StoreWriter(Store(tmp_path, WORK))
    writer.finish({Node(2, 0): Sums(64, np.ones(5))})
    assert events == ["sync file", "rename L02-0.sums", "sync directory", "remove L01-0.sums"]


def full_disk(monkeypatch, calls_that_work):
    """From some call of fsync on, there is no space left."""
    left = iter(range(calls_that_work))
    fsync = os.fsync

    def limited(descriptor):
        if next(left, None) is None:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        fsync(descriptor)

    monkeypatch.setattr(os, "fsync", limited)


@pytest.mark.parametrize("calls_that_work", [0, 1, 2, 5])
def test_a_full_disk_names_the_file_and_leaves_the_old_ones(tmp_path, blocks, monkeypatch, calls_that_work):
    collect(WORK, N, store=tmp_path)
    before = contents(blocks)
    with monkeypatch.context() as patch:
        patch.setattr(store_writer, "PERIOD_S", float("inf"))  # nothing is written, and merged, before the end
        full_disk(patch, calls_that_work)
        with pytest.raises(StoreError, match=r"\.blocks/ab12/.*: cannot be written: No space left on device") as caught:
            collect(WORK, 100_000, store=tmp_path)
    assert caught.value.exit_code == 4
    after = contents(blocks)
    assert before.items() <= after.items()
    assert not [name for name in after if name.endswith(".tmp")]
    assert len(after) == len(before) + calls_that_work
    resumed = collect(WORK, 100_000, store=tmp_path)
    assert same(resumed, 100_000)
    assert resumed.from_store >= 4_992


def test_a_disk_that_fills_up_while_running_ends_the_run_at_once(tmp_path, blocks, monkeypatch):
    monkeypatch.setattr(store_writer, "PERIOD_S", 0.05)
    full_disk(monkeypatch, 3)
    done = []
    with pytest.raises(StoreError, match="No space left"):
        collect(
            Fake(pause_s=1e-3), 16 * 10_000, store=tmp_path, threads=2, progress=lambda count, *_: done.append(count)
        )
    assert done[-1] < 16 * 5_000
    assert not [name for name in names(blocks) if name.endswith(".tmp")]


LIMITED = """if True:
    import resource, signal
    from radarsim.engine.collect import collect
    from radarsim.errors import StoreError
    from tests.engine.fake import Fake
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (200, 200))
    try:
        collect(Fake(), 1_000, store={store!r})
    except StoreError as error:
        raise SystemExit(error.exit_code)
"""


def test_a_file_that_may_not_grow_is_never_seen_cut_off(tmp_path, blocks):
    """The kernel itself cuts the write short, as a quota does."""
    program = [sys.executable, "-c", LIMITED.format(store=str(tmp_path))]
    assert subprocess.run(program, cwd=Path(__file__).parents[2], check=False).returncode == 4
    assert names(blocks) == []


@pytest.mark.parametrize("obstacle", ["", ".blocks", ".blocks/ab12"])
def test_a_directory_that_cannot_be_made_is_named(tmp_path, obstacle):
    path = tmp_path / "results" / obstacle
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("a file")
    with pytest.raises(StoreError, match=re.escape(str(path))):
        collect(WORK, 100, store=tmp_path / "results")

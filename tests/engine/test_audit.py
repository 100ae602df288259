"""The look over a store: a hundred of a hundred damages found, what is whole left in peace."""

import random

import numpy as np
import pytest

from radarsim.engine.collect import collect, compute_share
from radarsim.engine.store.audit import agree, audit_blocks
from radarsim.engine.store.store import removable_files
from tests.engine.fake import NAMES, WORK, Fake, N, contents
from tests.engine.test_damage import reforged


def damage(path, draw):
    """One of truncation, a flipped bit, deletion; in words."""
    raw = bytearray(path.read_bytes())
    kind = draw.choice(["truncated", "bit flipped", "deleted"])
    if kind == "truncated":
        path.write_bytes(raw[: draw.randrange(len(raw))])
    elif kind == "bit flipped":
        raw[draw.randrange(len(raw))] ^= 1 << draw.randrange(8)
        path.write_bytes(raw)
    else:
        path.unlink()
    return kind


def test_a_hundred_of_a_hundred_damaged_blocks_are_found_and_named(tmp_path, blocks):
    collect(WORK, N, store=tmp_path)
    good, draw = contents(blocks), random.Random(3)
    assert audit_blocks(blocks, N).faults == []
    for _ in range(100):
        name = draw.choice(NAMES)
        kind = damage(blocks / name, draw)
        before = contents(blocks)
        faults = audit_blocks(blocks, N).faults
        assert [fault.split(":")[0] for fault in faults] == [str(blocks / name)], (kind, name, faults)
        assert contents(blocks) == before
        (blocks / name).write_bytes(good[name])


def test_sums_that_were_forged_with_a_right_checksum_do_not_add_up(tmp_path, blocks):
    collect(WORK, N, store=tmp_path)
    reforged(blocks / "L03-38.sums", values=np.ones(5))
    assert audit_blocks(blocks, N).faults == [f"{blocks / 'T5005.sums'}: is not the sum of the blocks beside it"]


@pytest.mark.parametrize("sizes", [(N,), (16, 5, 160, 99), (100, 5_000, 37), (4_096, 4_096 + 7)])
def test_what_runs_of_any_sizes_leave_is_whole(tmp_path, blocks, sizes):
    for size in sizes:
        collect(WORK, size, store=tmp_path)
    for size in sizes:
        assert audit_blocks(blocks, size).faults == []


def test_shares_and_stopped_runs_are_whole(tmp_path, blocks):
    compute_share(WORK, N, (2, 3), store=tmp_path)
    asked = iter([None] * 8)
    cut = collect(Fake(pause_s=1e-3), N, store=tmp_path, threads=2, stop=lambda: next(asked, "enough"))
    assert audit_blocks(blocks, cut.count or None).faults == []
    assert audit_blocks(blocks, N).faults == [f"{blocks / f'T{N}.sums'}: missing"]


def test_what_was_set_aside_is_noted_and_foreign_files_are_none_of_its_business(tmp_path, blocks):
    collect(WORK, 64, store=tmp_path)
    (blocks / "L00-9.sums.damaged").write_bytes(b"x")
    (blocks / "notes.txt").write_text("mine")
    found = audit_blocks(blocks, 64)
    assert found.faults == []
    assert found.notes == [f"{blocks / 'L00-9.sums.damaged'}: set aside as damaged by an earlier run"]


def test_blocks_of_several_sizes_are_told(tmp_path, blocks):
    collect(WORK, 64, store=tmp_path)
    collect(Fake(block=8), 4, store=tmp_path)
    assert f"{blocks}: blocks of several sizes" in audit_blocks(blocks, 64).faults


def test_sums_of_several_machines_agree_to_rounding_those_of_one_to_the_bit():
    one = np.array([1.0, 1e6, -3.0])
    near = one * (1 + 1e-12)
    assert agree(one, one.copy(), {"a"})
    assert not agree(one, near, {"a"})
    assert agree(one, near, {"a", "b"})
    assert not agree(one, one * 1.01, {"a", "b"})


def test_only_what_a_store_makes_is_removable(tmp_path, blocks):
    collect(WORK, N, store=tmp_path)
    for name in ("L00-9.sums.damaged", ".L00-9.sums.0abc.tmp", "notes.txt", ".hidden", ".x.tmp"):
        (blocks / name).write_bytes(b"x")
    (blocks / "T16.sums").symlink_to(blocks / "T5005.sums")
    names = sorted(path.name for path, _ in removable_files(blocks))
    assert names == sorted([*NAMES, "L00-9.sums.damaged", ".L00-9.sums.0abc.tmp"])

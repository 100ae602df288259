"""The store: nothing is computed twice, what was reported stays to be read, several runs share it."""

import hashlib
import json
import os
import shutil
import threading
import time
from itertools import pairwise

import numpy as np
import pytest

from radarsim.engine import executors, machine
from radarsim.engine.blocks import Node, Partial, Total
from radarsim.engine.collect import collect, compute_share, read_stored
from radarsim.engine.store import writer as store_writer
from radarsim.engine.store.block_file import decode, piece_named
from radarsim.engine.store.store import Store
from radarsim.engine.sums import Sums
from radarsim.errors import NonFiniteError, StoreError
from tests.engine.fake import NAMES, WORK, Fake, N, contents, names, same
from tests.engine.tree import decomposition


def test_what_is_stored_is_not_computed_again(tmp_path, blocks):
    first = collect(WORK, N, store=tmp_path)
    assert (first.computed, first.from_store, first.warnings) == (N, 0, ())
    assert names(blocks) == NAMES
    for name in [None, *NAMES]:
        if name:
            (blocks / name).unlink()
        again = collect(WORK, N, store=tmp_path)
        assert same(again)
        assert (again.computed, again.from_store) == ((N, 0) if name == "T5005.sums" else (0, N))


def test_nodes_alone_make_the_total_which_is_then_stored(tmp_path, blocks):
    collect(WORK, N, store=tmp_path)
    (blocks / "T5005.sums").unlink()
    assert same(read_stored(WORK, N, tmp_path))
    assert "T5005.sums" not in names(blocks)
    again = collect(WORK, N, store=tmp_path)
    assert same(again)
    assert again.computed == 0
    assert names(blocks) == NAMES


@pytest.mark.parametrize(("name", "lost"), [("L03-38", 8 * 16), ("L08-0", 256 * 16), ("P312-13", 13)])
def test_only_what_is_lost_is_computed(tmp_path, blocks, name, lost):
    collect(WORK, N, store=tmp_path)
    for gone in (name, "T5005"):
        (blocks / f"{gone}.sums").unlink()
    assert read_stored(WORK, N, tmp_path) is None
    again = collect(WORK, N, store=tmp_path)
    assert same(again)
    assert again.computed == lost
    assert names(blocks) == NAMES


def test_any_history_of_n_gives_the_bytes_of_each_n_at_once(tmp_path, blocks):
    sizes = [10_000, 100_000, 50_000, 7, 100_000, 16, 99_999, 10_000]
    for realisations in sizes:
        assert same(collect(WORK, realisations, store=tmp_path), realisations)
    for realisations in sizes:
        before = contents(blocks)
        assert same(read_stored(WORK, realisations, tmp_path), realisations)
        assert contents(blocks) == before
    assert read_stored(WORK, 4_321, tmp_path) is None


def test_a_larger_run_computes_only_what_is_new_and_the_cut_block_again(tmp_path, blocks):
    collect(WORK, 10_001, store=tmp_path)
    larger = collect(WORK, 100_000, store=tmp_path)
    assert same(larger, 100_000)
    assert larger.from_store == 10_000
    assert larger.computed == 90_000
    nodes = {piece for piece in Store(tmp_path, WORK).pieces() if isinstance(piece, Node)}
    assert nodes == set(decomposition(100_000 // 16))
    assert not [name for name in names(blocks) if name.startswith("P")]


def test_what_lies_inside_a_stored_node_is_removed_and_nothing_else(tmp_path, blocks):
    collect(WORK, 16 * 16, store=tmp_path)
    collect(WORK, 16 * 12, store=tmp_path)
    assert names(blocks) == ["L02-2.sums", "L03-0.sums", "L04-0.sums", "T192.sums", "T256.sums"]
    collect(WORK, 16 * 32, store=tmp_path)
    assert names(blocks) == ["L05-0.sums", "T192.sums", "T256.sums", "T512.sums"]


def test_other_identities_and_block_sizes_share_nothing(tmp_path):
    collect(WORK, N, store=tmp_path)
    assert collect(Fake(identity="cd"), N, store=tmp_path).from_store == 0
    changed = collect(Fake(block=32), N, store=tmp_path)
    assert changed.from_store == 0
    assert len(changed.warnings) > 0


@pytest.mark.parametrize("identity", ["", "../x", "AB", "a/b", "ab\n"])
def test_an_identity_is_no_path(tmp_path, identity):
    with pytest.raises(ValueError, match="identity"):
        Store(tmp_path, Fake(identity=identity))


def test_names_are_read_back_and_foreign_files_left_alone(tmp_path, blocks):
    for piece in (Node(0, 0), Node(12, 3456789), Partial(0, 1), Partial(99, 4095), Total(10**12)):
        assert piece_named(f"{piece.name}.sums") == piece
    for name in ("L1-2.sums", "L01-2.sum", ".L01-2.sums.abc.tmp", "T.sums", "L01--2.sums", "L01-2.sums.damaged", "x"):
        assert piece_named(name) is None
    collect(WORK, 32, store=tmp_path)
    (blocks / "notes.txt").write_text("mine")
    collect(WORK, 64, store=tmp_path)
    assert (blocks / "notes.txt").read_text() == "mine"


@pytest.mark.parametrize("ahead_s", [0, 1e8])
def test_temporary_files_of_a_killed_run_are_removed_once_they_are_old(tmp_path, blocks, monkeypatch, ahead_s):
    """Old beside the other files: the clock may be ahead of theirs."""
    now_s = time.time()
    monkeypatch.setattr(time, "time", lambda: now_s + ahead_s)
    collect(WORK, 32, store=tmp_path)
    fresh, old = blocks / ".L00-9.sums.aa.tmp", blocks / ".L00-9.sums.bb.tmp"
    fresh.write_bytes(b"half")
    old.write_bytes(b"half")
    os.utime(old, (now_s - 3600,) * 2)
    collect(WORK, 64, store=tmp_path)
    assert fresh.exists()
    assert not old.exists()


def test_numbers_that_are_not_finite_are_not_stored_and_the_rest_is(tmp_path, blocks):
    with pytest.raises(NonFiniteError, match="realisations 992 to 1007"):
        collect(Fake(bad=1_000), 10_000, store=tmp_path, threads=2)
    kept = [piece for piece in Store(tmp_path, WORK).pieces() if isinstance(piece, Node)]
    assert kept
    assert not any(node.first <= 62 < node.stop for node in kept)
    mended = collect(WORK, 10_000, store=tmp_path)
    assert same(mended, 10_000)
    assert mended.from_store > 0


def test_an_interruption_in_somebodys_own_program_keeps_what_is_done(tmp_path):
    asked = iter([None] * 8)

    def stop():
        if next(asked, "end") == "end":
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        collect(Fake(pause_s=1e-3), 16 * 200, store=tmp_path, threads=2, stop=stop)
    resumed = collect(WORK, 16 * 200, store=tmp_path)
    assert same(resumed, 16 * 200)
    assert resumed.from_store > 0


def test_a_stopped_run_can_be_reported_after_a_longer_one(tmp_path):
    asked = iter([None] * 8)
    cut = collect(Fake(pause_s=1e-3), 16 * 200, store=tmp_path, threads=2, stop=lambda: next(asked, "enough"))
    assert 0 < cut.count < 16 * 200
    longer = collect(WORK, 16 * 200, store=tmp_path)
    assert same(longer, 16 * 200)
    assert longer.from_store == cut.count
    assert same(read_stored(WORK, cut.count, tmp_path), cut.count)


def test_a_stored_cut_block_counts_only_once_all_before_it_is_done(tmp_path, blocks):
    collect(WORK, N, store=tmp_path)
    for name in NAMES:
        if not name.startswith("P"):
            (blocks / name).unlink()
    result = collect(WORK, N, store=tmp_path, stop=lambda: "at once")
    assert (result.count, result.from_store, result.stopped) == (0, 13, "at once")


def test_instruction_sets_are_recorded_and_mixing_warns(tmp_path, blocks, monkeypatch):
    collect(WORK, N, store=tmp_path)
    header, _ = decode((blocks / "L08-0.sums").read_bytes())
    assert header["platforms"] == [machine.platform_name()]
    assert header["versions"].keys() >= {"python", "numpy"}
    monkeypatch.setattr(executors, "platform_name", lambda: "abacus")
    assert collect(WORK, N, store=tmp_path).warnings == ()
    mixed = collect(WORK, 2 * N, store=tmp_path)
    assert len(mixed.warnings) == 1
    assert "made on 2 platforms" in mixed.warnings[0]
    assert "abacus" in mixed.warnings[0]
    assert collect(WORK, 2 * N, store=tmp_path).warnings == mixed.warnings


@pytest.mark.slow
def test_what_is_new_is_written_about_once_a_period(tmp_path, monkeypatch):
    monkeypatch.setattr(store_writer, "PERIOD_S", 0.2)
    written = []
    write = Store.write

    def noted(self, pieces):
        written.append((time.perf_counter(), sum(sums.count for sums in pieces.values())))
        write(self, pieces)

    monkeypatch.setattr(Store, "write", noted)
    result = collect(Fake(pause_s=1e-3), 16 * 2_000, store=tmp_path, threads=2)
    assert same(result, 16 * 2_000)
    times = [moment for moment, _ in written]
    assert len(written) >= 4
    assert all(later - earlier >= 0.19 for earlier, later in pairwise(times[:-1]))


class Slow(Store):
    """A disk that writes nothing until it is let go, and one writer at a time."""

    writing = False
    free = threading.Event()

    def write(self, pieces):
        assert not self.writing
        self.writing = True
        assert self.free.wait(60)
        super().write(pieces)
        self.writing = False


def test_workers_do_not_wait_for_the_disk_and_one_thing_is_written_at_a_time(tmp_path, monkeypatch):
    monkeypatch.setattr(store_writer, "PERIOD_S", 0.01)
    writer = store_writer.StoreWriter(Slow(tmp_path, WORK))
    for index in (0, 2, 4):
        time.sleep(0.02)
        writer.offer({Node(0, index): Sums(16, np.ones(5))})
    assert not Store(tmp_path, WORK).pieces()
    Slow.free.set()
    writer.finish({Node(0, index): Sums(16, np.ones(5)) for index in (0, 2, 4)})
    assert Store(tmp_path, WORK).pieces() == {Node(0, 0), Node(0, 2), Node(0, 4)}


@pytest.mark.parametrize("sizes", [(20_000, 20_000), (20_000, 9_999, 33_333)])
def test_several_runs_on_one_store_at_once(tmp_path, monkeypatch, sizes):
    monkeypatch.setattr(store_writer, "PERIOD_S", 0.0)
    results = {}

    def run(place, realisations):
        results[place] = collect(WORK, realisations, store=tmp_path, threads=2)

    for _ in range(2):
        runs = [threading.Thread(target=run, args=pair) for pair in enumerate(sizes)]
        for thread in runs:
            thread.start()
        for thread in runs:
            thread.join()
        for place, realisations in enumerate(sizes):
            assert same(results[place], realisations)
            assert results[place].warnings == ()
            assert same(read_stored(WORK, realisations, tmp_path), realisations)


def test_a_node_merged_away_between_listing_and_reading_is_found_in_its_parent(tmp_path, monkeypatch):
    collect(WORK, 16 * 24, store=tmp_path)
    before = Store(tmp_path, WORK).pieces()
    collect(WORK, 16 * 32, store=tmp_path)
    after = Store(tmp_path, WORK).pieces()
    listings = iter([before, after])
    monkeypatch.setattr(Store, "pieces", lambda self: next(listings))
    reader = Store(tmp_path, WORK)
    assert list(reader.forest(32).nodes) == [Node(5, 0)]
    assert reader.warnings == []


def test_nodes_that_were_found_apart_are_stored_together_before_they_go(tmp_path, blocks):
    halves = {Node(0, index): Sums(16, WORK.simulate(16 * index, 16)) for index in (0, 1)}
    Store(tmp_path, WORK).write(halves)
    assert collect(WORK, 16 * 3, store=tmp_path).from_store == 32
    assert names(blocks) == ["L00-2.sums", "L01-0.sums", "T48.sums"]


def test_stores_are_united_by_copying(tmp_path):
    asked = iter([None] * 6)
    collect(Fake(pause_s=1e-3), 16 * 200, store=tmp_path / "a", threads=2, stop=lambda: next(asked, "enough"))
    collect(WORK, 16 * 100, store=tmp_path / "b")
    shutil.copytree(tmp_path / "a", tmp_path / "b", dirs_exist_ok=True)
    assert same(collect(WORK, 16 * 200, store=tmp_path / "b"), 16 * 200)


def test_the_file_is_what_the_description_says(tmp_path, blocks):
    collect(WORK, 16, store=tmp_path)
    raw = (blocks / "L00-0.sums").read_bytes()
    magic, header, rest = raw.split(b"\n", 2)
    assert magic == b"radarsim sums 1"
    assert json.loads(header)["count"] == 16
    assert np.frombuffer(rest[:40], "<f8").tobytes() == WORK.simulate(0, 16).tobytes()
    assert rest[40:] == hashlib.sha256(raw[:-32]).digest()


def test_blocks_that_are_cleaned_away_while_a_run_works_are_written_again(tmp_path, monkeypatch):
    """Whatever is written before the end goes at once, the directory too."""
    monkeypatch.setattr(store_writer, "PERIOD_S", 0.0)
    monkeypatch.setattr("radarsim.engine.dispatch.PROGRESS_S", 0.0)
    removed = []

    def cleaned(done, total, held):
        if done < total and len(removed) < 3 and (tmp_path / ".blocks").exists():
            shutil.rmtree(tmp_path / ".blocks", ignore_errors=True)
            removed.append(done)

    slow = Fake(pause_s=0.001)
    collect(slow, N, store=tmp_path, threads=1, progress=cleaned)
    assert removed
    again = collect(slow, N, store=tmp_path)
    assert again.computed == 0
    assert same(again, N)


def test_a_writer_looks_again_at_what_it_wrote(tmp_path):
    store = Store(tmp_path, WORK)
    writer = store_writer.StoreWriter(store)
    nodes = (Node(0, 0), Node(0, 3))
    pieces = {node: Sums(WORK.block, WORK.simulate(node.first * WORK.block, WORK.block)) for node in nodes}
    writer._put(pieces)
    (store.path / "L00-0.sums").unlink()
    writer.finish(pieces)
    assert store.pieces() == set(pieces)


@pytest.mark.parametrize("umask", [0o000, 0o077, 0o777])
def test_blocks_are_for_the_user_alone_and_results_can_be_written_by_nobody_else(tmp_path, umask):
    before = os.umask(umask)
    try:
        collect(WORK, N, store=tmp_path / "new" / "results")
    finally:
        os.umask(before)
    blocks = tmp_path / "new/results/.blocks"
    assert {path.stat().st_mode & 0o777 for path in (blocks, blocks / WORK.identity)} == {0o700}
    assert {path.stat().st_mode & 0o777 for path in (blocks / WORK.identity).iterdir()} == {0o600}
    assert not (tmp_path / "new/results").stat().st_mode & 0o022


def give_away(path):
    os.chown(path, 4242, 4242)


def open_to_all(path):
    path.chmod(path.stat().st_mode | 0o022)


OTHERS = [open_to_all, pytest.param(give_away, marks=pytest.mark.skipif(os.getuid(), reason="needs root"))]


@pytest.mark.parametrize("change", OTHERS)
@pytest.mark.parametrize("place", [".blocks", ".blocks/ab12"])
def test_a_folder_that_another_user_may_have_filled_is_neither_read_nor_written(tmp_path, blocks, change, place):
    collect(WORK, N, store=tmp_path)
    change(tmp_path / place)
    before = contents(blocks)
    result = collect(WORK, 2 * N, store=tmp_path)
    assert same(result, 2 * N)
    assert result.from_store == 0
    assert len(result.warnings) == 1
    assert str(tmp_path / place) in result.warnings[0]
    assert contents(blocks) == before
    assert read_stored(WORK, N, tmp_path) is None
    with pytest.raises(StoreError, match="not used"):
        compute_share(WORK, N, (1, 2), store=tmp_path)


@pytest.mark.parametrize("change", OTHERS)
def test_a_file_that_another_user_may_have_written_is_computed_again(tmp_path, blocks, change):
    collect(WORK, N, store=tmp_path)
    (blocks / "T5005.sums").unlink()
    change(blocks / "L08-0.sums")
    result = collect(WORK, N, store=tmp_path)
    assert same(result)
    assert result.computed == 256 * 16
    assert str(blocks / "L08-0.sums") in result.warnings[0]
    again = collect(WORK, N, store=tmp_path)
    assert (again.computed, again.warnings) == (0, ())

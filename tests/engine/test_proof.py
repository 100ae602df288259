"""Blocks that other sources made are taken over where their bytes are the same, and never where they are not."""

import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
import pytest

from radarsim.engine import store
from radarsim.engine.blocks import Total
from radarsim.engine.run import collect, share, stored
from radarsim.engine.store import Store, audited, decoded, removable
from tests.engine.fake import Fake, N, contents, same
from tests.engine.test_damage import reforged

QUESTION, OTHER = "ab" * 16, "12" * 16


@dataclass(frozen=True)
class Sourced(Fake):
    """A work of some sources; realisation `moved` gives another last digit, if there is one."""

    identity: str = QUESTION + "00" * 16
    moved: int = -1
    block: int = 16

    def simulate(self, first, count):
        """As the other, with the last digit."""
        sums = super().simulate(first, count)
        return np.nextafter(sums, np.inf) if first <= self.moved < first + count else sums


def of(sources, **more):
    return Sourced(QUESTION + f"{sources:02x}" * 16, **more)


@pytest.fixture(autouse=True)
def settled(monkeypatch):
    """What is found in this test."""
    monkeypatch.setattr(store, "_unkept", {})
    monkeypatch.setattr(store, "settled", found := [])
    return found


def folders(out):
    return sorted(path.name[32:34] for path in (out / ".blocks").iterdir())


def test_sources_that_give_the_same_bytes_take_all_over_and_look_once(tmp_path, settled):
    collect(of(0), N, store=tmp_path)
    again = collect(of(1), N, store=tmp_path)
    assert same(again)
    assert (again.computed, again.kept_as, folders(tmp_path)) == (0, of(0).identity, ["00"])
    (found,) = settled
    assert (found.same, found.again, found.stored, found.identity) == (True, N, N, of(1).identity)
    more = collect(of(1), N + 1600, store=tmp_path)
    assert (more.computed, folders(tmp_path), len(settled)) == (1600 + 13, ["00"], 1)
    assert same(stored(of(0), N, tmp_path))
    assert collect(of(2), N + 1600, store=tmp_path).computed == 0  # marks of both, wherever they were made
    assert [(one.again, one.stored) for one in settled] == [(N, N), (N + 1600, N + 1600)]  # 13 of two tasks count once
    assert audited(tmp_path / ".blocks" / of(0).identity, N).faults == []


@pytest.mark.parametrize("realisation", [0, 17, 2500, N - 14, N - 1])
def test_a_last_digit_of_one_realisation_begins_anew_and_is_remembered(tmp_path, settled, realisation):
    collect(of(0), N, store=tmp_path)
    other = of(1, moved=realisation)
    assert stored(other, N, tmp_path) is None
    again = collect(other, N, store=tmp_path)
    assert (again.computed, again.kept_as, folders(tmp_path)) == (N, other.identity, ["00", "01"])
    assert [one.same for one in settled] == [False]
    assert same(collect(of(0), N, store=tmp_path))
    back = collect(of(2), N, store=tmp_path)  # an edit taken back, under other words
    assert (back.computed, back.kept_as) == (0, of(0).identity)


def test_another_question_is_not_compared(tmp_path, settled):
    collect(of(0), N, store=tmp_path)
    assert collect(Sourced("cd" * 32), N, store=tmp_path).computed == N
    assert settled == []


def test_of_what_is_long_as_much_is_computed_again_as_time_allows(tmp_path, settled, monkeypatch):
    collect(of(0), N, store=tmp_path)
    monkeypatch.setattr(store, "PROOF_S", 0.0)
    assert collect(of(1), N, store=tmp_path).computed == 0
    assert 0 < settled[0].again < N


def test_no_more_is_computed_again_than_is_stored_where_shares_lie_side_by_side(tmp_path, settled):
    for part in ((1, 2), (2, 2)):
        share(of(0), N, part, store=tmp_path)  # whole blocks and the end of a block, without a total
    assert collect(of(1), N, store=tmp_path).computed == 0
    assert [(one.again, one.stored) for one in settled] == [(N, N)]


def test_of_many_tasks_those_of_the_least_hashes_are_marked_however_they_are_merged(tmp_path, monkeypatch):
    monkeypatch.setattr(store, "MOST_MARKS", 8)
    for part in ((2, 3), (1, 3), (3, 3)):
        share(of(0), N, part, store=tmp_path)
    collect(of(0), N, store=tmp_path)
    header, _ = decoded((tmp_path / ".blocks" / of(0).identity / f"T{N}.sums").read_bytes())
    assert len(header["marks"]) == 8
    assert collect(of(1), N, store=tmp_path).computed == 0


def test_blocks_without_marks_or_of_another_length_are_not_taken(tmp_path):
    collect(of(0), N, store=tmp_path)
    assert collect(of(1, block=32), N, store=tmp_path).computed == N
    folder = tmp_path / ".blocks" / of(0).identity
    for path in folder.glob("*.sums"):
        reforged(path, marks={"L00-0": 1, "T5": "x"} if path.name[0] == "T" else None)
    assert collect(of(2), N, store=tmp_path).computed == N


def test_a_damaged_file_does_not_decide(tmp_path):
    collect(of(0), N, store=tmp_path)
    folder = tmp_path / ".blocks" / of(0).identity
    (folder / f"T{N}.sums").write_bytes(b"radarsim")
    again = collect(of(1), N, store=tmp_path)
    assert same(again)
    assert (again.computed, again.kept_as) == (0, of(0).identity)


def test_another_platform_looks_for_itself_where_one_has_other_bytes(tmp_path, settled, monkeypatch):
    collect(of(0), N, store=tmp_path)
    assert stored(of(1, moved=3), N, tmp_path) is None
    monkeypatch.setattr(store, "platform_name", lambda: "elsewhere")
    assert stored(of(1), N, tmp_path) is not None
    assert [one.same for one in settled] == [False, True]


@pytest.mark.parametrize("moved", [-1, 5])
def test_a_store_that_may_only_be_read(tmp_path, settled, monkeypatch, moved):
    collect(of(0), N, store=tmp_path)

    def refuse(path, content):
        raise PermissionError(13, "no")

    monkeypatch.setattr(store, "put", refuse)
    for _ in range(3):
        assert (stored(of(1, moved=moved), N, tmp_path) is None) is (moved >= 0)
    assert len(settled) == 1
    assert not list((tmp_path / ".blocks").rglob("*.same"))


@pytest.mark.parametrize("moved", [-1, 5])
def test_two_at_once_come_to_the_same(tmp_path, moved):
    collect(of(0), N, store=tmp_path)
    with ThreadPoolExecutor(4) as pool:
        made = list(pool.map(lambda _: collect(of(1, moved=moved), N, store=tmp_path, threads=1), range(4)))
    assert len({one.values.tobytes() for one in made}) == 1
    assert {one.kept_as for one in made} == {of(0 if moved < 0 else 1).identity}


KILLED = """
import os, sys
from radarsim.engine import store
from radarsim.engine.run import collect
from tests.engine.test_proof import of, N

def dying(*arguments):
    os.kill(os.getpid(), 9)

collect(of(0), N, store=sys.argv[1])
setattr({at}, dying)
collect(of(1), N, store=sys.argv[1])
"""


@pytest.mark.parametrize("at", ["store, 'mark_of'", "store.os, 'replace'"])
def test_a_kill_while_it_looks_leaves_nothing_decided(tmp_path, settled, at):
    code = subprocess.run([sys.executable, "-c", KILLED.format(at=at), str(tmp_path)], check=False).returncode
    assert code == -9
    folder = tmp_path / ".blocks" / of(0).identity
    assert not [path for path in folder.iterdir() if path.suffix in (".same", ".other")]
    assert collect(of(1), N, store=tmp_path).computed == 0
    assert len(settled) == 1


def test_what_was_found_is_dropped_with_the_blocks(tmp_path):
    collect(of(0), N, store=tmp_path)
    stored(of(1), N, tmp_path)
    stored(of(2, moved=1), N, tmp_path)
    folder = tmp_path / ".blocks" / of(0).identity
    assert {path.name for path, _ in removable(folder)} == set(contents(folder))
    assert len([name for name in contents(folder) if name.endswith((".same", ".other"))]) == 2


def test_a_folder_of_its_own_is_asked_first(tmp_path, settled):
    collect(of(0), N, store=tmp_path)
    os.mkdir(tmp_path / ".blocks" / of(1).identity)
    assert Store(tmp_path, of(1)).pieces() == set()
    assert Total(N) in Store(tmp_path, of(0)).pieces()
    assert settled == []

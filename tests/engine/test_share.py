"""Shares of the blocks: together they are all of them, united by copying; alone they report nothing."""

import random
import shutil

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from radarsim.engine.blocks import Node, Total
from radarsim.engine.collect import collect, compute_share, read_stored
from radarsim.engine.dispatch import Share
from radarsim.engine.store.inventory import CHANCE_LIMIT, Inventory, missing_shares, take_inventory
from radarsim.engine.store.store import Store
from tests.engine.fake import WORK, Fake, N, same


def held(directory):
    """Realisations in the nodes of a store."""
    return sum(16 << piece.level for piece in Store(directory, WORK).pieces() if isinstance(piece, Node))


@given(st.integers(1, 5_000), st.integers(1, 40))
def test_shares_tile_the_blocks_and_the_last_has_the_cut_one(realisations, of):
    shares = [Share(WORK, realisations, (number, of), "unwritten", None) for number in range(1, of + 1)]
    assert [one.first for one in shares] == [0, *(one.stop for one in shares[:-1])]
    assert shares[-1].stop == realisations // 16
    assert [one.partial_size for one in shares] == [0] * (of - 1) + [realisations % 16]
    assert sum(one.requested for one in shares) == realisations
    sizes = [one.stop - one.first + (one.partial_size > 0) for one in shares]
    assert max(sizes) - min(sizes) <= 1


@settings(max_examples=15)
@given(st.integers(1, 3_000), st.integers(1, 9), st.randoms())
def test_united_by_copying_they_give_the_bytes_of_one_run(tmp_path_factory, realisations, of, draw):
    root = tmp_path_factory.mktemp("shares")
    numbers = list(range(1, of + 1))
    draw.shuffle(numbers)
    for number in numbers:
        compute_share(WORK, realisations, (number, of), store=root / str(number), threads=0)
        shutil.copytree(root / str(number), root / "all", dirs_exist_ok=True)
    united = collect(WORK, realisations, store=root / "all", threads=0)
    assert same(united, realisations)
    assert united.computed == 0


def test_a_share_is_stored_without_a_total_and_counted_once(tmp_path):
    first = compute_share(WORK, N, (2, 3), store=tmp_path, threads=2)
    assert (first.requested, first.done, first.computed, first.from_store, first.stopped) == (1664, 1664, 1664, 0, None)
    assert not [piece for piece in Store(tmp_path, WORK).pieces() if isinstance(piece, Total)]
    assert held(tmp_path) == 1664
    again = compute_share(WORK, N, (2, 3), store=tmp_path, threads=2)
    assert (again.done, again.computed, again.from_store) == (1664, 0, 1664)
    assert read_stored(WORK, N, tmp_path) is None


def test_a_share_finds_what_a_whole_run_has_stored(tmp_path):
    collect(WORK, N, store=tmp_path)
    assert compute_share(WORK, N, (2, 5), store=tmp_path).computed == 0


def test_more_shares_than_blocks_leave_some_with_nothing_to_do(tmp_path):
    done = [compute_share(WORK, 20, (number, 7), store=tmp_path, threads=0).done for number in range(1, 8)]
    assert sorted(done) == [0, 0, 0, 0, 0, 4, 16]
    assert same(read_stored(WORK, 20, tmp_path), 20)


@pytest.mark.parametrize("number", [1, 3])
def test_a_stopped_share_keeps_what_it_did_and_goes_on(tmp_path, number):
    asked = iter([None] * 8)
    slow = Fake(pause_s=1e-3)
    cut = compute_share(slow, 16 * 900, (number, 3), store=tmp_path, threads=2, stop=lambda: next(asked, "enough"))
    assert cut.stopped == "enough"
    assert 0 < cut.done < cut.requested == 16 * 300
    assert held(tmp_path) == cut.done
    whole = compute_share(WORK, 16 * 900, (number, 3), store=tmp_path, threads=2)
    assert (whole.done, whole.from_store) == (16 * 300, cut.done)


def test_progress_is_that_of_the_share(tmp_path):
    seen = []
    compute_share(WORK, 1_600, (1, 4), store=tmp_path, progress=lambda *given: seen.append(given))
    assert seen[-1] == (400, 400, 0)


@settings(max_examples=40)
@given(st.integers(1, 3_000), st.integers(2, 9), st.data())
def test_what_is_missing_is_named_by_realisations_and_shares(tmp_path_factory, realisations, of, data):
    """Of a store without some of its shares, by the names of its files: they lie as the shares that were not copied."""
    numbers = range(1, of + 1)
    absent = data.draw(st.sets(st.sampled_from(numbers)))
    root = tmp_path_factory.mktemp("stock")
    for number in set(numbers) - absent:
        compute_share(WORK, realisations, (number, of), store=root, threads=0)
    found = take_inventory(WORK, realisations, root)
    parts = {number: take_inventory(WORK, realisations, root, (number, of)) for number in numbers}
    assert found.requested == realisations == sum(part.requested for part in parts.values())
    assert found.stored == sum(part.stored for part in parts.values())
    for number, part in parts.items():
        assert part.stored == (0 if number in absent else part.requested)
    missing = [i for first, last in found.missing for i in range(first, last + 1)]
    assert missing == [i for part in parts.values() for first, last in part.missing for i in range(first, last + 1)]
    assert found.has_loose_blocks is (found.stored > 0)
    if found.shares is not None:  # 3 and 4 of 4 are 2 of 2
        fewer, total = found.shares
        assert total <= of
        bounds = [min((realisations + 15) // 16 * number // total * 16, realisations) for number in range(total + 1)]
        assert missing == [i for n in fewer for i in range(bounds[n - 1], bounds[n])]


def test_a_share_that_lacks_is_named(tmp_path):
    for absent, shares in (({2}, ((2,), 3)), ({1}, ((1,), 3)), ({3}, ((3,), 3)), ({1, 3}, ((1, 3), 3))):
        root = tmp_path / "".join(map(str, absent))
        for number in {1, 2, 3} - absent:
            compute_share(WORK, N, (number, 3), store=root, threads=0)
        found = take_inventory(WORK, N, root)
        assert (found.shares, found.has_loose_blocks) == (shares, True)
        assert collect(WORK, N, store=root, threads=0).computed == N - found.stored
        assert take_inventory(WORK, N, root) == Inventory(N, N, (), None, has_loose_blocks=False)


def test_of_a_run_that_ended_nothing_is_loose(tmp_path):
    collect(WORK, 1000, store=tmp_path, threads=0)
    larger = take_inventory(WORK, N, tmp_path)
    assert (larger.stored, larger.missing, larger.has_loose_blocks) == (992, ((992, N - 1),), False)
    assert take_inventory(WORK, N, None) == Inventory(N, 0, ((0, N - 1),), None, has_loose_blocks=False)
    assert take_inventory(WORK, N, tmp_path / "nowhere") == take_inventory(WORK, N, None)
    assert take_inventory(WORK, 1000, tmp_path).missing == ()


def test_ends_that_lie_by_chance_are_no_shares():
    """Of 3000 runs of missing blocks wherever, as a killed run leaves them, few are taken for shares."""
    draw, blocks, n = random.Random(1), 300, 3000
    taken = sum(missing_shares([sorted(draw.sample(range(1, blocks), 2))], blocks) is not None for _ in range(n))
    assert 0 < taken < CHANCE_LIMIT * n
    taken = sum(missing_shares([(draw.randrange(1, blocks), blocks)], blocks) is not None for _ in range(n))
    assert 0 < taken < CHANCE_LIMIT * n

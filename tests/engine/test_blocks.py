"""Laws of the binary tree: where it is cut, and that neither order nor grouping changes a byte."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from radarsim.engine.blocks import Forest, Node, Partial, Total, maximal_nodes, simulate_piece, widest_node
from radarsim.engine.sums import Sums
from radarsim.errors import NonFiniteError
from tests.engine.fake import Fake, textbook
from tests.engine.tree import decomposition

WORK = Fake()


def bytes_of(sums):
    return sums.count, sums.values.tobytes()


@given(st.integers(1, 10**10))
def test_the_decomposition_tiles_the_blocks_with_falling_powers_of_two(blocks):
    nodes = decomposition(blocks)
    assert [node.first for node in nodes] == [0, *(node.stop for node in nodes[:-1])]
    assert nodes[-1].stop == blocks
    levels = [node.level for node in nodes]
    assert levels == sorted(set(levels), reverse=True)


def test_no_blocks_no_nodes():
    assert decomposition(0) == []
    assert Forest(16, 5).total().count == 0


@given(st.integers(0, 10**6), st.integers(1, 10**6), st.integers(0, 20))
def test_the_widest_node_is_aligned_and_cannot_grow(first, blocks, highest):
    node = widest_node(first, first + blocks, highest)
    assert node.first == first
    assert node.stop <= first + blocks
    grown = Node(node.level + 1, node.index // 2)
    assert node.level == highest or grown.first != first or grown.stop > first + blocks


@given(st.integers(0, 12), st.integers(0, 1000))
def test_what_is_above_contains(level, index):
    node = Node(level, index)
    for above in node.containing_nodes(20):
        assert above.first <= node.first < node.stop <= above.stop
    assert len(list(node.containing_nodes(20))) == 20 - level
    assert Node(3, 5) in set(Partial(40, 7).containing_nodes(8))
    assert Partial(40, 7).containing_nodes(8).__next__() == Node(0, 40)
    assert list(Total(40).containing_nodes(8)) == []


@st.composite
def shuffled_cuts(draw):
    """Blocks 0 … n-1 cut into aligned nodes at random, in random order."""
    blocks = draw(st.integers(1, 70))
    nodes, first = [], 0
    while first < blocks:
        nodes.append(widest_node(first, blocks, draw(st.integers(0, 7))))
        first = nodes[-1].stop
    return blocks, draw(st.permutations(nodes))


@given(shuffled_cuts())
def test_any_cut_in_any_order_gives_the_bytes_of_the_textbook(case):
    blocks, nodes = case
    forest = Forest(WORK.block, WORK.size)
    for node in nodes:
        forest.add(node, simulate_piece(WORK, node))
    assert forest.prefix() == decomposition(blocks)
    assert sorted(forest.nodes) == sorted(decomposition(blocks))
    assert bytes_of(forest.total()) == (blocks * WORK.block, textbook(WORK, blocks * WORK.block).tobytes())


@given(shuffled_cuts(), st.data())
def test_gaps_and_nodes_tile_the_blocks_and_the_prefix_ends_at_the_first_gap(case, data):
    blocks, nodes = case
    kept = data.draw(st.lists(st.sampled_from(nodes), unique=True))
    forest = Forest(WORK.block, WORK.size)
    for node in kept:
        forest.add(node, simulate_piece(WORK, node))
    held = [block for node in forest.nodes for block in range(node.first, node.stop)]
    missing = [block for first, stop in forest.gaps(blocks) for block in range(first, stop)]
    assert sorted(held + missing) == list(range(blocks))
    until = min(missing, default=blocks)
    assert forest.prefix() == decomposition(until)
    assert forest.total().count == until * WORK.block
    if until:
        assert forest.total().values.tobytes() == textbook(WORK, until * WORK.block).tobytes()


@given(st.lists(st.builds(Node, st.integers(0, 5), st.integers(0, 20))), st.integers(0, 100))
def test_maximal_nodes_cover_what_all_cover_and_overlap_nowhere(nodes, stop):
    top = maximal_nodes(nodes, stop)
    covered = [block for node in top for block in range(node.first, node.stop)]
    assert covered == sorted({b for node in nodes if node.stop <= stop for b in range(node.first, node.stop)})


@given(*[st.lists(st.integers(-(2**40), 2**40), min_size=3, max_size=3)] * 3)
def test_sums_are_a_commutative_monoid_where_addition_is_exact(a, b, c):
    a, b, c = (Sums(abs(x[0]), np.array(x, dtype=float)) for x in (a, b, c))
    zero = Sums(0, np.zeros(3))
    assert bytes_of((a + b) + c) == bytes_of(a + (b + c))
    assert bytes_of(a + b) == bytes_of(b + a)
    assert bytes_of(a + zero) == bytes_of(zero + a) == bytes_of(Sums(a.count, a.values + 0.0))


@pytest.mark.parametrize("given_back", [[1.0] * 5, np.ones(4), np.ones((1, 5)), np.ones(5, dtype=np.float32), 1.0])
def test_sums_of_another_shape_or_type_are_refused(given_back):
    class Wrong(Fake):
        def simulate(self, first, count):
            return given_back

    with pytest.raises(ValueError, match=r"simulate\(48, …\): expected sums float64 \(5,\)"):
        simulate_piece(Wrong(), Node(0, 3))


def test_numbers_that_are_not_finite_are_named_by_their_block():
    class Explaining(Fake):
        def explain(self, first, count):
            return [f"looked at {first}, {count}"]

    with pytest.raises(NonFiniteError) as caught:
        simulate_piece(Explaining(bad=100), Node(3, 0))
    assert caught.value.lines == ("realisations 96 to 111: the sums are not finite", "looked at 96, 16")
    with pytest.raises(NonFiniteError, match=r"^realisations 96 to 100: the sums are not finite$"):
        simulate_piece(Fake(bad=100), Partial(6, 5))


def test_an_overflow_between_blocks_is_no_result():
    class Huge(Fake):
        def simulate(self, first, count):
            return np.full(5, 1.5e308)

    with pytest.raises(NonFiniteError, match="realisations 0 to 31: the sums overflow"):
        simulate_piece(Huge(), Node(1, 0))
    forest = Forest(16, 5)
    forest.add(Node(0, 2), simulate_piece(Huge(), Node(0, 2)))
    with pytest.raises(NonFiniteError, match="realisations 32 to 63: the sums overflow"):
        forest.add(Node(0, 3), simulate_piece(Huge(), Node(0, 3)))

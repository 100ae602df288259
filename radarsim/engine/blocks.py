"""Realisations cut into blocks, blocks merged in a fixed binary tree.

Block b holds the realisations [b·size, (b+1)·size); the last one of a run may be cut short. A node is an aligned run of
2^level blocks, and its sums are always those of its two halves added. The total of N realisations is the sum of the
largest nodes that fill the full blocks, from left to right, and of the cut block at the end. So the bytes of a total
depend on N and on the block alone: not on threads, on the order in which work was finished, or on where a run was
interrupted."""

from collections.abc import Collection, Iterator
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from radarsim.engine.sums import Sums
from radarsim.errors import NonFiniteError

REQUEST_DIGITS = 32  # of an identity, for the request; the others are for the sources that compute


class Work(Protocol):
    """A work to simulate. `identity` (hex digits) names all that changes a number, `block` is the number of
    realisations in a block, `size` the length of the vector of sums. A work may also have `explain(first, count)`,
    which gives lines on the origin of numbers that are not finite."""

    @property
    def identity(self) -> str: ...
    @property
    def block(self) -> int: ...
    @property
    def size(self) -> int: ...

    def simulate(self, first: int, count: int) -> np.ndarray:
        """Sums (size,), float64, over realisations first … first+count-1; called from several threads at once."""


@dataclass(frozen=True, order=True, slots=True)
class Node:
    """Blocks index·2^level … (index+1)·2^level - 1."""

    level: int
    index: int

    @property
    def first(self) -> int:
        """Its first block."""
        return self.index << self.level

    @property
    def stop(self) -> int:
        """The block after its last."""
        return (self.index + 1) << self.level

    @property
    def name(self) -> str:
        return f"L{self.level:02d}-{self.index}"

    def realisations(self, block: int) -> tuple[int, int]:
        """First realisation and how many, for blocks of `block`."""
        return self.first * block, block << self.level

    def containing_nodes(self, highest: int) -> Iterator["Node"]:
        """The nodes that contain it, excluding itself, up to the given level."""
        for level in range(self.level + 1, highest + 1):
            yield Node(level, self.index >> (level - self.level))


@dataclass(frozen=True, slots=True)
class Partial:
    """The first `count` realisations of a block: the end of a run whose N is not a multiple of the block."""

    index: int
    count: int

    @property
    def first(self) -> int:
        """Its block."""
        return self.index

    @property
    def name(self) -> str:
        return f"P{self.index}-{self.count}"

    def realisations(self, block: int) -> tuple[int, int]:
        """First realisation and how many, for blocks of `block`."""
        return self.index * block, self.count

    def containing_nodes(self, highest: int) -> Iterator[Node]:
        """The nodes that contain its block, up to the given level."""
        for level in range(highest + 1):
            yield Node(level, self.index >> level)


@dataclass(frozen=True, slots=True)
class Total:
    """Realisations 0 … count-1, in the order of addition that the module describes."""

    count: int

    @property
    def name(self) -> str:
        return f"T{self.count}"

    def realisations(self, block: int) -> tuple[int, int]:
        """First realisation and how many; the block does not matter."""
        return 0, self.count

    def containing_nodes(self, highest: int) -> Iterator[Node]:
        """Nothing contains a total."""
        return iter(())


Piece = Node | Partial | Total


def widest_node(first: int, stop: int, highest: int) -> Node:
    """The largest node of at most level `highest` that starts at block `first` and ends by block `stop`."""
    level = min(highest, (stop - first).bit_length() - 1)
    if first:
        level = min(level, (first & -first).bit_length() - 1)
    return Node(level, first >> level)


def maximal_nodes(nodes: Collection[Node], stop: int) -> list[Node]:
    """Those of the nodes that end by block `stop` and are not contained in another such node, from left to right."""
    inside = {node for node in nodes if node.stop <= stop}
    highest = max((node.level for node in inside), default=0)
    top = (node for node in inside if not any(larger in inside for larger in node.containing_nodes(highest)))
    return sorted(top, key=lambda node: node.first)


def gaps(nodes: Collection[Node], stop: int, start: int = 0) -> list[tuple[int, int]]:
    """Runs (first, stop) of the blocks start … stop − 1 outside all of the nodes, which do not overlap."""
    runs, first = [], start
    for node in sorted(nodes, key=lambda node: node.first):
        if first < min(node.first, stop):
            runs.append((first, min(node.first, stop)))
        first = max(first, node.stop)
    return [*runs, (first, stop)] if first < stop else runs


def share_of(realisations: int, block: int, part: tuple[int, int]) -> tuple[int, int, int]:
    """A share, as (2, 3) the second of three: its full blocks first … stop − 1, the realisations of its partial one."""
    full, partial = divmod(realisations, block)
    first, stop = (min(share_bound(full + (partial > 0), bound, part[1]), full) for bound in (part[0] - 1, part[0]))
    return first, stop, partial if part[0] == part[1] else 0


def share_bound(blocks: int, number: int, shares: int) -> int:
    """The block after the last one of share `number` of so many shares."""
    return blocks * number // shares


def add_sums(first_sums: Sums, second_sums: Sums, first: int) -> Sums:
    """Sum of neighbouring sums; NonFiniteError if it overflows. `first`, the first realisation, is for the message."""
    with np.errstate(over="ignore", invalid="ignore"):
        total = first_sums + second_sums
    if not np.isfinite(total.values).all():
        raise NonFiniteError(f"{_span(first, total.count)}: the sums overflow")
    return total


def simulate_piece(work: Work, piece: Node | Partial) -> Sums:
    """The sums of a node or of a partial block. ValueError if the work gives a vector of another shape or type,
    NonFiniteError naming the realisations if it gives numbers that are not finite."""
    first, count = piece.realisations(work.block)
    with np.errstate(over="ignore", invalid="ignore"):
        values = _merge_blocks(work, first, count)
        # NaN and infinity survive addition, so one check at the end finds them all.
        if np.isfinite(values).all():
            return Sums(count, values)
        for start in range(first, first + count, work.block):
            size = min(work.block, first + count - start)
            if not np.isfinite(work.simulate(start, size)).all():
                raise NonFiniteError(f"{_span(start, size)}: the sums are not finite", *_explain(work, start, size))
    raise NonFiniteError(f"{_span(first, count)}: the sums overflow")


def _merge_blocks(work: Work, first: int, count: int) -> np.ndarray:
    """Sums of one block or less, or of 2^q blocks, merging the odd one of each level with the pending even one."""
    block, shape = work.block, (work.size,)
    waiting: list[np.ndarray] = []
    for number, start in enumerate(range(first, first + count, block)):
        values = work.simulate(start, min(block, count))
        if not isinstance(values, np.ndarray) or values.dtype != np.float64 or values.shape != shape:
            received = f"{values.dtype} {values.shape}" if isinstance(values, np.ndarray) else type(values).__name__
            raise ValueError(f"simulate({start}, …): expected sums float64 {shape}, got {received}")
        while number & 1:
            values = waiting.pop() + values
            number >>= 1
        waiting.append(values)
    return waiting[0]


def _explain(work: Work, first: int, count: int) -> tuple[str, ...]:
    explain = getattr(work, "explain", None)
    return tuple(explain(first, count)) if explain else ()


def _span(first: int, count: int) -> str:
    return f"realisations {first} to {first + count - 1}"


class Forest:
    """Finished nodes, merged with their siblings as soon as both exist; so it holds few, however many were added."""

    def __init__(self, block: int, size: int):
        self.nodes: dict[Node, Sums] = {}
        self._block, self._size = block, size

    def add(self, node: Node, sums: Sums) -> None:
        """Add a node that overlaps no other, and merge upwards as long as siblings exist."""
        while (sibling := self.nodes.pop(Node(node.level, node.index ^ 1), None)) is not None:
            node = Node(node.level + 1, node.index >> 1)
            sums = add_sums(sibling, sums, node.first * self._block)
        self.nodes[node] = sums

    def prefix(self) -> list[Node]:
        """The nodes from block 0 on without a gap; they are the largest that fill it."""
        nodes, stop = [], 0
        for node in sorted(self.nodes, key=lambda node: node.first):
            if node.first != stop:
                break
            nodes.append(node)
            stop = node.stop
        return nodes

    def gaps(self, stop: int) -> list[tuple[int, int]]:
        """Runs (first, stop) of blocks below `stop` that no node holds."""
        return gaps(self.nodes, stop)

    def total(self) -> Sums:
        """The sums of the prefix, added from left to right; zeros if block 0 is not done."""
        nodes = self.prefix()
        if not nodes:
            return Sums(0, np.zeros(self._size))
        sums = self.nodes[nodes[0]]
        for node in nodes[1:]:
            sums = add_sums(sums, self.nodes[node], 0)
        return sums

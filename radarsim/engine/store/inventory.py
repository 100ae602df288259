"""Which part of a run or of a share is stored, by the names of files alone."""

import os
from collections.abc import Collection
from dataclasses import dataclass, field

from radarsim.engine.blocks import Node, Partial, Total, Work, gaps, maximal_nodes, share_bound, share_of
from radarsim.engine.store.store import Store

MAX_MISSING_SHARES = 4  # more that are not copied are a single one that was interrupted
CHANCE_LIMIT = 0.2  # probability at which missing blocks that end where shares do may do so by chance


@dataclass(frozen=True)
class Inventory:
    """The stored part of `requested` realisations.

    missing: runs (first, last) of missing realisations. loose: whether there are blocks beyond a gap, or blocks that no
    run reported, as from shares or a killed run; shares then says which shares of how many are missing, as far as the
    ends show. part: the share that was asked for, (2, 3) the second of three; (1, 1) the whole. blocks, missing_blocks:
    how many it has, and lacks."""

    requested: int
    stored: int
    missing: tuple[tuple[int, int], ...]
    shares: tuple[tuple[int, ...], int] | None
    has_loose_blocks: bool
    part: tuple[int, int] = field(default=(1, 1), compare=False)
    blocks: int = field(default=0, compare=False)
    missing_blocks: int = field(default=0, compare=False)


def take_inventory(
    work: Work, realisations: int, store: str | os.PathLike[str] | None, part: tuple[int, int] = (1, 1)
) -> Inventory:
    """The stored part of N realisations of a work, or of a share of them, as (2, 3) the second of three; nothing
    without a directory."""
    pieces, block = set() if store is None else Store(store, work).pieces(), work.block
    first, stop, partial = share_of(realisations, block, part)
    requested, full = (stop - first) * block + partial, realisations // block
    part_blocks = stop - first + (partial > 0)
    if Total(realisations) in pieces:
        return Inventory(requested, requested, (), None, has_loose_blocks=False, part=part, blocks=part_blocks)
    nodes = maximal_nodes([piece for piece in pieces if isinstance(piece, Node)], full)
    runs, blocks = gaps(nodes, stop, first), full + (realisations % block > 0)
    if partial and Partial(full, partial) not in pieces:
        runs.append((runs.pop()[0] if runs and runs[-1][1] == full else full, blocks))
    missing = tuple((begin * block, min(end * block, realisations) - 1) for begin, end in runs)
    stored = requested - sum(last + 1 - begin for begin, last in missing)
    beyond_gap = bool(runs) and any(node.first >= runs[0][1] for node in nodes)
    loose = beyond_gap or (stored > 0 and not any(isinstance(piece, Total) for piece in pieces))
    shares = missing_shares(runs, blocks) if loose and part == (1, 1) else None
    return Inventory(
        requested, stored, missing, shares, loose, part, part_blocks, sum(end - begin for begin, end in runs)
    )


def missing_shares(missing: Collection[tuple[int, int]], blocks: int) -> tuple[tuple[int, ...], int] | None:
    """Which shares of how many the missing runs (first, stop) of `blocks` blocks are, as ((2,), 3); None for none.

    The fewest shares that fit, unless that is likely by chance: each inner end lies by chance on one of the n − 1
    bounds of n shares."""
    ends = [end for run in missing for end in run if 0 < end < blocks]
    chance, shares = 0.0, 1
    while ends and chance <= CHANCE_LIMIT and shares < blocks:
        shares += 1
        chance += ((shares - 1) / blocks) ** len(ends)
        numbers = {share_bound(blocks, number, shares): number for number in range(shares + 1)}
        if chance <= CHANCE_LIMIT and all(end in numbers for run in missing for end in run):
            lacking = tuple(n for first, stop in missing for n in range(numbers[first] + 1, numbers[stop] + 1))
            return (lacking, shares) if len(lacking) <= MAX_MISSING_SHARES else None
    return None

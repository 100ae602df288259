"""What of a run or a share is stored, by the names of files alone; only what other sources made is computed again."""

import os
from collections.abc import Collection
from dataclasses import dataclass

from radarsim.engine.blocks import Node, Partial, Total, Work, gaps, maximal, share_bound, share_of
from radarsim.engine.store import Store

BY_CHANCE = 0.2  # that what is missing ends where shares do, without being shares


@dataclass(frozen=True)
class Stock:
    """What is stored of `asked` realisations.

    missing are runs (first, last) of realisations that are not. loose: whether there are blocks beyond a gap, or none
    that a run reported, as shares leave them, or a run that was killed; shares then says which shares of how many are
    missing, as far as the ends tell.
    """

    asked: int
    stored: int
    missing: tuple[tuple[int, int], ...]
    shares: tuple[tuple[int, ...], int] | None
    loose: bool


def stock(work: Work, realisations: int, store: str | os.PathLike[str] | None, part: tuple[int, int] = (1, 1)) -> Stock:
    """What a results directory holds of N realisations of a work, or of a share of them, as (2, 3) the second of three;
    nothing where no directory is given."""
    pieces, block = set() if store is None else Store(store, work).pieces(), work.block
    first, stop, rest = share_of(realisations, block, part)
    asked, full = (stop - first) * block + rest, realisations // block
    if Total(realisations) in pieces:
        return Stock(asked, asked, (), None, loose=False)
    nodes = maximal([piece for piece in pieces if isinstance(piece, Node)], full)
    runs, blocks = gaps(nodes, stop, first), full + (realisations % block > 0)
    if rest and Partial(full, rest) not in pieces:
        runs.append((runs.pop()[0] if runs and runs[-1][1] == full else full, blocks))
    missing = tuple((begin * block, min(end * block, realisations) - 1) for begin, end in runs)
    stored = asked - sum(last + 1 - begin for begin, last in missing)
    beyond = bool(runs) and any(node.first >= runs[0][1] for node in nodes)
    loose = beyond or (stored > 0 and not any(isinstance(piece, Total) for piece in pieces))
    return Stock(asked, stored, missing, as_shares(runs, blocks) if loose else None, loose)


def as_shares(missing: Collection[tuple[int, int]], blocks: int) -> tuple[tuple[int, ...], int] | None:
    """Which shares of how many the missing runs (first, stop) of `blocks` blocks are, as ((2,), 3); None for none.

    The fewest shares that fit, as long as it is no more than likely by chance: each end within lies by chance on one of
    the n − 1 bounds of n shares.
    """
    ends = [end for run in missing for end in run if 0 < end < blocks]
    chance, of = 0.0, 1
    while ends and chance <= BY_CHANCE and of < blocks:
        of += 1
        chance += ((of - 1) / blocks) ** len(ends)
        numbers = {share_bound(blocks, number, of): number for number in range(of + 1)}
        if chance <= BY_CHANCE and all(end in numbers for run in missing for end in run):
            return tuple(n for first, stop in missing for n in range(numbers[first] + 1, numbers[stop] + 1)), of
    return None

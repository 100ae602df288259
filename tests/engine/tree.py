"""The binary tree over blocks, written down once more."""

from radarsim.engine.blocks import Node, widest_node


def decomposition(blocks: int) -> list[Node]:
    """The largest nodes that fill blocks 0 … blocks-1, from left to right.

    >>> decomposition(6)
    [Node(level=2, index=0), Node(level=1, index=2)]
    """
    nodes, first = [], 0
    while first < blocks:
        nodes.append(widest_node(first, blocks, blocks.bit_length()))
        first = nodes[-1].stop
    return nodes

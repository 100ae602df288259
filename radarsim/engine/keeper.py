"""Puts finished sums into the store about once a second, in a thread of its own, so that no worker waits for a disk."""

import threading
import time
from collections.abc import Mapping

from radarsim.engine.blocks import Node, Piece
from radarsim.engine.moments import Sums
from radarsim.engine.store import Store

PERIOD_S = 1.0
SMALLEST = 64
LOOKS = 4  # at the end of a run, at what is on disk


class Keeper:
    """Remembers which nodes are on disk, and writes those that are not."""

    def __init__(self, store: Store):
        self.store = store
        self._durable: set[Node] = set()
        self._thread: threading.Thread | None = None
        self._error: Exception | None = None
        self._due = time.monotonic() + PERIOD_S

    def found(self, nodes: Mapping[Node, Sums]) -> None:
        """These were read; a merger of several is not among the files, and is written like any other."""
        stored = self.store.pieces()
        self._durable.update(node for node in nodes if node in stored)

    def offer(self, nodes: Mapping[Node, Sums]) -> None:
        """Start to write those that are new, if a second has passed. Raises the error of the writing before.

        A node of less than 1/64 of the largest new one is left out: it will soon be part of another, and would cost as
        much to write. All of them together are a thirtieth of what a kill would lose anyway.
        """
        if time.monotonic() < self._due or (self._thread is not None and self._thread.is_alive()):
            return
        self._raise()
        self._durable &= nodes.keys()
        fresh = {node: sums for node, sums in nodes.items() if node not in self._durable}
        largest = max((sums.count for sums in fresh.values()), default=0)
        fresh = {node: sums for node, sums in fresh.items() if sums.count * SMALLEST >= largest}
        self._thread = threading.Thread(target=self._put, args=(fresh,), name="keeper", daemon=True)
        self._thread.start()
        self._due = time.monotonic() + PERIOD_S

    def finish(self, pieces: Mapping[Piece, Sums]) -> None:
        """Write all that is not yet on disk, and wait until it is."""
        if self._thread is not None:
            self._thread.join()
        self._raise()
        self._durable &= pieces.keys()
        for _ in range(LOOKS):
            self._put({piece: sums for piece, sums in pieces.items() if piece not in self._durable})
            self._raise()
            # `radarsim clean` may have removed what this run wrote before.
            stored = self.store.pieces()
            if all(piece in stored or any(node in stored for node in piece.above(64)) for piece in pieces):
                return
            self._durable.clear()

    def _put(self, pieces: Mapping[Piece, Sums]) -> None:
        try:
            if pieces:
                self.store.write(pieces)
                self._durable.update(piece for piece in pieces if isinstance(piece, Node))
                self.store.sweep(self._durable)
        except Exception as error:
            self._error = error

    def _raise(self) -> None:
        if self._error is not None:
            raise self._error

"""Finished sums are written about once a second, in a thread of its own, so that no worker waits for a disk."""

import threading
import time
from collections.abc import Mapping

from radarsim.engine.blocks import Node, Piece
from radarsim.engine.store.store import ATTEMPTS, Store
from radarsim.engine.sums import Sums
from radarsim.system.threads import forbidden

PERIOD_S = 1.0
SMALLEST_SHARE = 1 / 64  # of the largest new node


class StoreWriter:
    """Knows which nodes are on disk, and writes the others."""

    def __init__(self, store: Store):
        self.store = store
        self._durable: set[Node] = set()
        self._thread: threading.Thread | None = None
        self._error: Exception | None = None
        self._due = time.monotonic() + PERIOD_S

    def note_stored(self, nodes: Mapping[Node, Sums]) -> None:
        """These were read; a merged node is not among the files, and is written like any other."""
        stored = self.store.pieces()
        self._durable.update(node for node in nodes if node in stored)

    def offer(self, nodes: Mapping[Node, Sums]) -> None:
        """Start to write the new nodes, if a second has passed. Raises the error of the writing before.

        A node of less than SMALLEST_SHARE of the largest new one is left out: it will soon be part of another, and
        would cost as much to write. All of them together are a thirtieth of what a kill would lose anyway."""
        if (
            not self.store.trusted
            or time.monotonic() < self._due
            or (self._thread is not None and self._thread.is_alive())
        ):
            return
        self._raise_error()
        self._durable &= nodes.keys()
        fresh: dict[Piece, Sums] = {node: sums for node, sums in nodes.items() if node not in self._durable}
        largest = max((sums.count for sums in fresh.values()), default=0)
        fresh = {node: sums for node, sums in fresh.items() if sums.count >= SMALLEST_SHARE * largest}
        if forbidden():
            self._put(fresh)
        else:
            self._thread = threading.Thread(target=self._put, args=(fresh,), name="store-writer", daemon=True)
            self._thread.start()
        self._due = time.monotonic() + PERIOD_S

    def finish(self, pieces: Mapping[Piece, Sums]) -> None:
        """Write all nodes not yet on disk, and wait for that. Nothing is written to a store that is not trusted."""
        if not self.store.trusted:
            return
        if self._thread is not None:
            self._thread.join()
        self._raise_error()
        self._durable &= pieces.keys()
        for _ in range(ATTEMPTS):
            self._put({piece: sums for piece, sums in pieces.items() if piece not in self._durable})
            self._raise_error()
            # `radarsim clean` may have removed what this run wrote before.
            stored = self.store.pieces()
            if all(piece in stored or any(node in stored for node in piece.containing_nodes(64)) for piece in pieces):
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

    def _raise_error(self) -> None:
        if self._error is not None:
            raise self._error

"""One chunk of realisations, each with filters of its own covariances: its arrays, and their rows as eight lanes.

Covariances are packed, p = (00, 01, 02, 11, 12, 22).
"""

from typing import NamedTuple

import numpy as np

from radarsim.kernels.compile import aligned_zeros, inline
from radarsim.kernels.lanes import WIDTH, address, row

CHUNK = 512  # realisations; a row is 4 KB; fewer, and the calls of its parts cost as much as their work
EIGHTS = CHUNK // WIDTH


class Work(NamedTuple):
    """Arrays of one chunk of n realisations, or, inside the kernels, their addresses.

    plots (2, n) range and velocity; detected (n,) 1 where the scan has a plot; other (n,) for the pair of numbers drawn
    with it; count (n,) plots so far; first (n,) the scan of the first; offset (2, n) the biases; state (3, n) the drawn
    difference of the truth, moved on; shift (6, n) the displacement that is drawn of a flight; x (F, 3, n) and
    p (F, 6, n) of filters that have started; normal (F, 9, n) the sums of the starts in the making, six of the matrix
    and three of the right-hand side; e (F, 3, n) errors, zero where there is no estimate; has (F, 3, n) 1 where there
    is one.
    """

    plots: np.ndarray
    detected: np.ndarray
    other: np.ndarray
    count: np.ndarray
    first: np.ndarray
    offset: np.ndarray
    state: np.ndarray
    shift: np.ndarray
    x: np.ndarray
    p: np.ndarray
    normal: np.ndarray
    e: np.ndarray
    has: np.ndarray


def work(filters: int) -> Work:
    """Arrays of one chunk."""
    rows = ((2,), (), (), (), (), (2,), (3,), (6,), (filters, 3), (filters, 6), (filters, 9), *[(filters, 3)] * 2)
    return Work(*(aligned_zeros(*row, CHUNK) for row in rows))


@inline
def places(made):
    """The addresses of the work arrays: parts that are called with arrays count references to each, at every call."""
    return Work(
        address(made.plots),
        address(made.detected),
        address(made.other),
        address(made.count),
        address(made.first),
        address(made.offset),
        address(made.state),
        address(made.shift),
        address(made.x),
        address(made.p),
        address(made.normal),
        address(made.e),
        address(made.has),
    )


@inline
def of_filter(rows, f, each):
    """The address of filter f's rows (each, n) in those of all filters (F, each, n)."""
    return row(rows, f * each * EIGHTS)

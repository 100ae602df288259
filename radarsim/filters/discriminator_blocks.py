"""How a burst is cut into blocks, and the blocks of every window in terms of those drawn."""

import itertools
import math

import numpy as np

from radarsim.kernels.discriminator_lanes import COLUMNS, END, RATIO, SHIFT, W0, W1, W2, WEIGHTS, Z2, M, S
from radarsim.kernels.discriminator_scoring import CENTRE, HALF, SIZE
from radarsim.kernels.discriminator_scoring import W0 as SUM_W
from radarsim.kernels.discriminator_scoring import Z0 as SUM_Z


def block_edges(windows: list[int], per_window: int, whole: int = 1) -> np.ndarray:
    """Pulses (B + 1,) where B blocks begin and end: every window ends one, none longer than its time over per_window.

    Long ones are multiples of `whole`: with 8, demodulation fills its registers, at the price of a third more blocks.
    """
    edges = [0]
    for end in sorted(set(windows)):
        begin = edges[-1]
        while begin < end:
            longest = max(1, max(begin, windows[0]) // per_window)
            # Equal parts of what is left, so that no sliver remains before the window's end.
            length = math.ceil((end - begin) / math.ceil((end - begin) / longest))
            begin += length if length < 2 * whole else length // whole * whole
            edges.append(begin)
    return np.array(edges)


def merged(edges: np.ndarray, pulses: int, per_window: int) -> list[int]:
    """Indices in edges (B + 1,) where a window's blocks end: as few as may be, none longer than it over per_window.

    A block that was drawn longer stays alone.
    """
    last = int(np.searchsorted(edges, pulses))
    ends, begin = [], 0
    for i in range(1, last + 1):
        if i == last or edges[i + 1] - edges[begin] > max(1, pulses / per_window):
            ends.append(i)
            begin = i
    return ends


def moments(sums: np.ndarray, row: int, shift: np.ndarray) -> np.ndarray:
    """Sums over blocks of a quantity times 1, s, s² (3,), s now from a centre `shift` before theirs; rows as drawn."""
    z0, z1, z2 = (sums[row + 2 * n] + 1j * sums[row + 2 * n + 1] for n in range(3))
    return np.array([z0.sum(), (z1 + shift * z0).sum(), (z2 + 2.0 * shift * z1 + shift**2 * z0).sum()])


class Tables:
    """Tables of the windows' blocks for `kernels.discriminator_lanes`: flat arrays `table` and `weights`."""

    def __init__(self, edges: np.ndarray, sums: np.ndarray, per_window: int):
        self.edges, self.sums, self.per_window = edges, sums, per_window
        self.pulses = int(edges[-1])
        self.rows, self.parts = [], []
        self.known: dict[int, tuple[int, int, int]] = {}

    def window(self, pulses: int) -> tuple[int, int, int]:
        """First row in the table, first weight and number of blocks of a window; rows are made where they are new."""
        if pulses not in self.known:
            ends = merged(self.edges, pulses, self.per_window)
            self.known[pulses] = len(self.rows), len(self.parts), len(ends)
            for begin, end in itertools.pairwise([0, *ends]):
                self._add(begin, end, pulses / self.pulses)
        return self.known[pulses]

    def drawn(self, pulses: int) -> tuple[int, int, int]:
        """As `window` where blocks are used as drawn and no tables are needed."""
        return 0, 0, int(np.searchsorted(self.edges, pulses))

    def _add(self, begin: int, end: int, share: float) -> None:
        part = self.sums[:, begin:end]
        count = np.diff(self.edges[begin : end + 1])
        centre = np.average(part[CENTRE], weights=count)
        shift = part[CENTRE] - centre
        square = np.average(2.0 * part[HALF] + shift**2, weights=count)
        rms = math.sqrt(square)
        ratio = 1.0 / rms if rms > 0.0 else 0.0  # a block of one sample has no slope
        t, orders, row = centre / share, np.arange(1, SIZE), np.zeros(COLUMNS)
        bend = np.where(orders > 1, orders * (orders - 1) * t ** np.maximum(orders - 2, 0), 0.0)
        row[M : M + SIZE - 1] = t**orders + 0.5 * bend * square / share**2  # the mean of τ^j over the block
        row[S : S + SIZE - 1] = orders * t ** (orders - 1) * rms / share
        echo, image = moments(part, SUM_Z, shift), moments(part, SUM_W, shift)
        image = image * ratio ** np.arange(3)
        for column, value in ((Z2, echo[2] * ratio**2), (W0, image[0]), (W1, image[1]), (W2, image[2])):
            row[column : column + 2] = value.real, value.imag
        row[END] = end
        self.rows.append(row)
        self.parts += [self._weight(ratio, s) for s in shift]

    @staticmethod
    def _weight(ratio: float, shift: float) -> np.ndarray:
        weight = np.zeros(WEIGHTS)
        weight[RATIO], weight[SHIFT] = ratio, shift * ratio
        return weight

    def arrays(self) -> tuple[np.ndarray, np.ndarray]:
        """Both tables, flat."""
        return np.array(self.rows).ravel(), np.array(self.parts).ravel()

"""Sums over short blocks of pulses that stand for the samples.

A burst is cut into blocks; the blocks of every window are sums of those that are drawn."""

import math

import numpy as np

from radarsim.bursts.kernels.scoring import CENTRE, HALF, SIZE
from radarsim.bursts.kernels.scoring import W0 as SUM_W
from radarsim.bursts.kernels.scoring import Z0 as SUM_Z
from radarsim.bursts.kernels.scoring_lanes import COLUMNS, END, RATIO, SHIFT, W0, W1, W2, WEIGHTS, Z2, M, S


def block_edges(windows: list[int], per_window: int, multiple: int = 1) -> np.ndarray:
    """Pulses (B + 1,) where B blocks begin and end: every window ends one, none longer than its time over per_window.
    Long ones are multiples of `multiple`: with 8, demodulation fills its registers, at the price of a third more
    blocks."""
    edges = [0]
    for end in sorted(set(windows)):
        begin = edges[-1]
        while begin < end:
            longest = max(1, max(begin, windows[0]) // per_window)
            # Equal parts of what is left, so that no sliver remains before the window's end.
            length = math.ceil((end - begin) / math.ceil((end - begin) / longest))
            begin += length if length < 2 * multiple else length // multiple * multiple
            edges.append(begin)
    return np.array(edges)


def merged_block_ends(edges: np.ndarray, pulses: int, per_window: int) -> list[int]:
    """Indices in edges (B + 1,) where a window's blocks end: as few as may be, none longer than it over per_window. A
    block that was drawn longer stays alone."""
    last = int(np.searchsorted(edges, pulses))
    ends, begin = [], 0
    for i in range(1, last + 1):
        if i == last or edges[i + 1] - edges[begin] > max(1, pulses / per_window):
            ends.append(i)
            begin = i
    return ends


def moments(sums: np.ndarray, row: int, shift: np.ndarray, starts: np.ndarray) -> np.ndarray:
    """Sums of a quantity times 1, s, s² over joined blocks (3, joined), from those over the blocks drawn.

    s is now counted from a centre `shift` before theirs; joined blocks begin at starts."""
    z0, z1, z2 = (sums[row + 2 * n] + 1j * sums[row + 2 * n + 1] for n in range(3))
    return np.add.reduceat([z0, z1 + shift * z0, z2 + 2.0 * shift * z1 + shift**2 * z0], starts, axis=1)


class WindowTables:
    """Tables of the windows' blocks for `kernels.lanes`: flat arrays `table` and `weights`."""

    def __init__(self, edges: np.ndarray, sums: np.ndarray, per_window: int):
        self.edges, self.sums, self.per_window = edges, sums, per_window
        self.pulses = int(edges[-1])
        self.rows, self.weights = [np.zeros((0, COLUMNS))], [np.zeros((0, WEIGHTS))]
        self.known: dict[int, tuple[int, int, int]] = {}

    def window(self, pulses: int) -> tuple[int, int, int]:
        """First row in the table, first weight and number of blocks of a window; rows are made where they are new."""
        if pulses not in self.known:
            ends = merged_block_ends(self.edges, pulses, self.per_window)
            self.known[pulses] = sum(map(len, self.rows)), sum(map(len, self.weights)), len(ends)
            self._add(np.array(ends), pulses / self.pulses)
        return self.known[pulses]

    def window_of_drawn_blocks(self, pulses: int) -> tuple[int, int, int]:
        """As `window` where blocks are used as drawn and no tables are needed."""
        return 0, 0, int(np.searchsorted(self.edges, pulses))

    def _add(self, ends: np.ndarray, share: float) -> None:
        starts, block_sums = np.append(0, ends[:-1]), self.sums[:, : ends[-1]]
        count = np.diff(self.edges[: ends[-1] + 1])

        def mean(x: np.ndarray) -> np.ndarray:
            return np.add.reduceat(count * x, starts) / np.add.reduceat(count, starts)

        joined = np.repeat(np.arange(len(ends)), ends - starts)
        centre = mean(block_sums[CENTRE])
        shift = block_sums[CENTRE] - centre[joined]
        rms = np.sqrt(mean(2.0 * block_sums[HALF] + shift**2))
        ratio = 1.0 / np.where(rms > 0.0, rms, np.inf)  # a block of one sample has no slope
        t, width, orders, rows = centre / share, rms / share, np.arange(1, SIZE), np.zeros((len(ends), COLUMNS))
        bend = np.where(orders > 1, orders * (orders - 1) * t[:, None] ** np.maximum(orders - 2, 0), 0.0)
        rows[:, M : M + SIZE - 1] = t[:, None] ** orders + 0.5 * bend * width[:, None] ** 2  # means of τ^j
        rows[:, S : S + SIZE - 1] = orders * t[:, None] ** (orders - 1) * width[:, None]
        echo, image = (moments(block_sums, row, shift, starts) for row in (SUM_Z, SUM_W))
        image = image * ratio ** np.arange(3)[:, None]
        for column, value in ((Z2, echo[2] * ratio**2), (W0, image[0]), (W1, image[1]), (W2, image[2])):
            rows[:, column], rows[:, column + 1] = value.real, value.imag
        rows[:, END] = ends
        weights = np.zeros((len(joined), WEIGHTS))
        weights[:, RATIO], weights[:, SHIFT] = ratio[joined], shift * ratio[joined]
        self.rows.append(rows)
        self.weights.append(weights)

    def arrays(self) -> tuple[np.ndarray, np.ndarray]:
        """Both tables, flat."""
        return np.concatenate(self.rows).ravel(), np.concatenate(self.weights).ravel()

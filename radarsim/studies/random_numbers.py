"""Random numbers for user filters, by counter: a realisation has the same in any batch, a scan others than the last.

A filter that draws from a seeded generator of its own starts it anew in each block of realisations: the blocks are then
copies of each other in part, and intervals, which count realisations as independent, are too narrow."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from radarsim.errors import ConfigError

if TYPE_CHECKING:
    import numpy as np

SCAN_BITS = 40  # of a counter: below are the calls within a scan, above is the scan
NORMALS_PER_CALL, UNIFORMS_PER_CALL = 4, 2  # of the generator's two words of 64 bits


@dataclass
class RandomSource:
    """The key (2,) uint64 of the numbers that go with the plots of a case, and whether a generator was taken."""

    key: "np.ndarray"
    generator_used: bool = False


@dataclass
class RandomNumbers:
    """The numbers of n realisations from number `first` on at some scans, of which each call gives further ones.

    leading: the axes of the plots, (n,) at one scan, (n, K), or (K,) of one realisation; scans: their numbers from
    0."""

    source: RandomSource
    first: int
    n: int
    scans: Sequence[int]
    leading: tuple[int, ...]
    calls: int = field(default=0, init=False)

    def normals(self, m: int | tuple[int, ...]) -> "np.ndarray":
        """Unit normals (*leading, m), independent; m may be a shape."""
        from radarsim.kernels.random import fill_normal_rows

        return self._filled(fill_normal_rows, m, NORMALS_PER_CALL)

    def uniforms(self, m: int | tuple[int, ...]) -> "np.ndarray":
        """Uniform numbers in (0, 1), as `normals`."""
        from radarsim.kernels.random import fill_uniform_rows

        return self._filled(fill_uniform_rows, m, UNIFORMS_PER_CALL)

    def generator(self) -> "np.random.Generator":
        """A generator of NumPy's for these realisations and scans; each call gives another one."""
        import numpy as np

        self.source.generator_used = True
        self.calls += 1
        words = [int(word) for word in self.source.key]
        return np.random.default_rng([*words, self.first, self.scans[0], self.calls])

    def _filled(self, fill: "object", m: int | tuple[int, ...], per_call: int) -> "np.ndarray":
        import numpy as np

        shape = m if isinstance(m, tuple) else (m,)
        if not all(isinstance(length, int | np.integer) and length >= 0 for length in shape):
            raise ConfigError(f"m: must be a whole number >= 0, or a shape, got {m!r}")
        realisations = np.repeat(np.arange(self.first, self.first + self.n, dtype=np.uint64), len(self.scans))
        starts = (np.asarray(self.scans, dtype=np.uint64) << np.uint64(SCAN_BITS)) + np.uint64(self.calls)
        numbers = np.empty((realisations.size, math.prod(shape)))
        fill(self.source.key, realisations, np.tile(starts, self.n), numbers)  # type: ignore[operator]
        self.calls += -(-numbers.shape[1] // per_call)
        return numbers.reshape(*self.leading, *shape)

"""The sums of a block of realisations: a count and a vector. Sums add; the engine needs no more."""

import math
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Sums:
    """Sums over `count` realisations; values (size,). `a + b` is the union of two disjoint sets of realisations."""

    count: int
    values: np.ndarray

    def __add__(self, other: "Sums") -> "Sums":
        return Sums(self.count + other.count, self.values + other.values)


class Layout:
    """Names and shapes of the arrays concatenated in a vector of sums.

    >>> layout = Layout(error=(2, 15, 3, 4), paired=(2, 15, 3))
    >>> layout.size
    450
    """

    def __init__(self, **shapes: tuple[int, ...]):
        self.shapes = shapes
        self.size = sum(math.prod(shape) for shape in shapes.values())

    def pack(self, **arrays: np.ndarray) -> np.ndarray:
        """One vector (size,) of the named arrays; raises ValueError where names or shapes differ from the layout."""
        if arrays.keys() != self.shapes.keys():
            raise ValueError(f"expected {sorted(self.shapes)}, got {sorted(arrays)}")
        for name, shape in self.shapes.items():
            if arrays[name].shape != tuple(shape):
                raise ValueError(f"{name}: expected shape {shape}, got {arrays[name].shape}")
        return np.concatenate([np.asarray(arrays[name], dtype=float).ravel() for name in self.shapes])

    def unpack(self, values: np.ndarray) -> dict[str, np.ndarray]:
        """The named arrays as views into values (size,)."""
        arrays, start = {}, 0
        for name, shape in self.shapes.items():
            stop = start + math.prod(shape)
            arrays[name] = values[start:stop].reshape(shape)
            start = stop
        return arrays

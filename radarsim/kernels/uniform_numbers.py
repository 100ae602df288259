"""Uniform numbers of a realisation from its normals."""

import math
from collections.abc import Sequence
from typing import Any

from radarsim.kernels.formula_functions import atan2, exp


def uniform_pairs(normals: Sequence[Any]) -> list[Any]:
    """Independent numbers, even from 0 to 1, of as many independent unit normals, whose number is even: the two polar
    coordinates of each pair, in probability."""
    uniforms = []
    for a, b in zip(normals[::2], normals[1::2], strict=True):
        uniforms += [exp(-(a * a + b * b) / 2), atan2(b, a) / math.tau + 0.5]
    return uniforms

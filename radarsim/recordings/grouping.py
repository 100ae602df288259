"""Rows grouped by name."""

from collections.abc import Hashable, Sequence
from typing import TypeVar

import numpy as np

Name = TypeVar("Name", bound=Hashable)


def rows_by_name(names: "Sequence[Name]") -> "dict[Name, np.ndarray]":
    """The indices of the rows of each name, in the order in which the names first appear."""
    if len(set(names)) == 1:
        return {names[0]: np.arange(len(names))}
    rows: dict[Name, list[int]] = {}
    for i, name in enumerate(names):
        rows.setdefault(name, []).append(i)
    return {name: np.array(indices) for name, indices in rows.items()}

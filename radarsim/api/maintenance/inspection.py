"""Findings about a stored result."""

from dataclasses import dataclass, field
from pathlib import Path


@dataclass
class Inspection:
    """Findings about a result: how much was checked, faults that each name a file, notes, and what was not checked.

    total: the realisations of all cases in the tables; realisations: of these, how many were computed again, in the
    stored pieces `recomputed`, or from the config in the cases `from_config`. tables: those made again from the sums,
    and compared. not_checked: what could not be checked, and why, a sentence each."""

    folder: Path
    outputs: int = 0
    pieces: int = 0
    total: int = 0
    realisations: int = 0
    recomputed: list[str] = field(default_factory=list)
    from_config: list[str] = field(default_factory=list)
    tables: list[str] = field(default_factory=list)
    faults: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    not_checked: list[str] = field(default_factory=list)

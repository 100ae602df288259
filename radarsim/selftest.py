"""The self-test of `radarsim doctor`: a small case of every study, its tables compared with known ones.

radarsim/known holds for each study a config and the tables that it gave on the platform of platform.json. There the
bytes must be the same. Elsewhere (another instruction set, another compiler) the last bits may differ, and numbers are
compared to 10⁻¹² of the σ, or of the percentage, that they belong to. `make known` makes the tables anew, after a
change that is meant to change numbers.
"""

import csv
import io
import json
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path

from radarsim import experiment, studies
from radarsim.engine.machine import instruction_set

KNOWN = Path(__file__).parent / "known"
TABLES = ("curves", "gains")
CLOSE = 1e-12
FIRST_NUMBER = {"curves": "sigma", "gains": "gain_percent"}  # columns before it are labels and counts


@dataclass(frozen=True)
class Verdict:
    """How a study's case came out: in words, and whether that is as it should be."""

    study: str
    good: bool
    words: str


def platform() -> dict[str, str]:
    """What decides the last bits: instruction set and the versions of what compiles and computes."""
    versions = {name: metadata.version(name) for name in ("numba", "llvmlite", "numpy")}
    return {"instruction_set": instruction_set()} | versions


def tables(study: str) -> dict[str, bytes]:
    """The tables of a study's known case, as computed here: CSV by name."""
    from radarsim.report.tables import to_csv

    result = experiment.run(KNOWN / f"{study}.yaml", threads=1)
    return {name: to_csv(result.tables[name]) for name in TABLES}


def verdicts() -> list[Verdict]:
    """One for each study."""
    same_platform = platform() == json.loads((KNOWN / "platform.json").read_text())
    return [verdict(study, tables(study), same_platform) for study in studies.STUDIES]


def verdict(study: str, made: dict[str, bytes], same_platform: bool) -> Verdict:
    """Compare tables with the known ones."""
    known = {name: (KNOWN / f"{study}.{name}.csv").read_bytes() for name in TABLES}
    if made == known:
        return Verdict(study, True, "the known bytes")
    off = max(distance(name, made[name], known[name]) for name in TABLES)
    if off > CLOSE:
        return Verdict(study, False, f"differs from the known answer by {off:.1e} of sigma")
    words = f"the known numbers to {off:.1e} of sigma"
    return Verdict(study, not same_platform, words + (", not the known bytes" if same_platform else ""))


def distance(table: str, one: bytes, other: bytes) -> float:
    """The largest difference of two tables' numbers, in units of σ or of 100 %; infinite where labels differ."""
    first, second = (list(csv.DictReader(io.StringIO(text.decode()))) for text in (one, other))
    if len(first) != len(second):
        return float("inf")
    farthest = 0.0
    for a, b in zip(first, second, strict=True):
        columns = list(b)
        numbers = columns[columns.index(FIRST_NUMBER[table]) :]
        if any(a.get(name) != b[name] for name in columns if name not in numbers):
            return float("inf")
        scale = float(b["sigma"] or 1) if table == "curves" else 100.0  # ends of intervals may lie far above σ
        for name in numbers:
            if (a.get(name) or "") == b[name]:
                continue
            if not (a.get(name) and b[name]):
                return float("inf")
            difference = abs(float(a[name]) - float(b[name]))
            farthest = max(farthest, difference / max(scale, abs(float(b[name]))))
    return farthest


def write() -> None:
    """Make the known tables anew, of this platform."""
    for study in studies.STUDIES:
        for name, content in tables(study).items():
            (KNOWN / f"{study}.{name}.csv").write_bytes(content)
    (KNOWN / "platform.json").write_text(json.dumps(platform(), indent=2) + "\n")


if __name__ == "__main__":
    write()

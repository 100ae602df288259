"""What a planted fault is."""

from typing import NamedTuple


class Mutant(NamedTuple):
    """In the file `path`, the text `original`, there once, becomes `mutated`; one of `tests` must then fail."""

    path: str
    original: str
    mutated: str
    tests: tuple[str, ...]


def mutants(path: str, *faults: tuple[str, str, str]) -> list[Mutant]:
    """Faults (original, mutated, tests after tests/, separated by blanks) of one file."""
    return [Mutant(path, a, b, tuple(f"tests/{test}" for test in tests.split())) for a, b, tests in faults]

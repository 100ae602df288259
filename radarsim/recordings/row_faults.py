"""Faults in the rows of a file, one line for each kind."""

from collections.abc import Iterator

MAX_NAMED_LINES = 3  # rows listed of those with the same fault


class Faults:
    """Faults in the rows of a file: one line for each kind of fault, with its first place, further rows that have it,
    and a remedy for all."""

    def __init__(self, path: str):
        self.path = path
        self.kinds: dict[str, tuple[str, str, bool, list[int]]] = {}

    def __bool__(self) -> bool:
        return bool(self.kinds)

    def add(self, line: int, where: str, must: str, got: object, cure: str = "", always: bool = False) -> None:
        """where: the column's number and name with their separator, or nothing. always: the cure is named for a single
        row too."""
        first = f"{self.path}:{line}:{where} {must}, got {got}"
        self.kinds.setdefault(where + must, (first, cure and f"; {cure}", always, []))[3].append(line)

    def lines(self) -> Iterator[str]:
        for first, cure, always, (_, *further_lines) in self.kinds.values():
            if not further_lines:
                yield first + cure * always
                continue
            line_numbers = ", ".join(map(str, further_lines[:MAX_NAMED_LINES])) + (
                ", …" if len(further_lines) > MAX_NAMED_LINES else ""
            )
            noun = "lines" if len(further_lines) > 1 else "line"
            yield f"{first} (and {len(further_lines)} more, in {noun} {line_numbers}){cure}"

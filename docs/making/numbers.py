"""Numbers in the pages, written by `make docs-numbers` from what `make reproduce-figures` left in results/.

    <!-- table: NAME -->      a table on the lines between
    <!-- end -->
    <!-- value: NAME -->12.3 %<!-- end -->      a number within a sentence

NAME is a function of a file measured_*.py beside this one, which takes the results and gives the rows, the first of
them the heads, or the text. A page's numbers change in no other way.
"""

import math
import re
import sys
from collections.abc import Callable
from functools import cache
from importlib import import_module
from pathlib import Path

import pandas as pd

from radarsim.language.numerals import group_digits

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
MARK = re.compile(r"<!-- (table|value): (\w+) -->(.*?)<!-- end -->", re.DOTALL)


class Missing(Exception):
    """A table that no run has left."""


class Results:
    """The tables of a results folder."""

    def __init__(self, folder: Path):
        self.folder = folder
        self.table = cache(self._table)

    def _table(self, stem: str, name: str) -> pd.DataFrame:
        """One CSV file; Missing, with the command that makes it, where it is not there."""
        path = self.folder / stem / f"{name}.csv"
        if not path.is_file():
            raise Missing(f"{path}: missing; `radarsim run {stem} --out {self.folder}` makes it")
        return pd.read_csv(path)


def measured() -> dict[str, Callable[[Results], object]]:
    """All tables and values that there are, by name."""
    modules = [import_module(f"making.{path.stem}") for path in sorted(HERE.glob("measured_*.py"))]
    return {name: make for module in modules for name, make in module.MEASURED.items()}


def marks(page: str) -> list[tuple[str, str, str]]:
    """Kind, name and present text of each mark of a page."""
    return MARK.findall(page)


def filled(page: str, results: Results) -> str:
    """A page with its numbers as the results have them; KeyError for a mark that nothing makes."""
    makers = measured()

    def filled_mark(mark: re.Match) -> str:
        kind, name = mark[1], mark[2]
        value = makers[name](results)
        inner = group_digits(f"\n{table(value)}\n" if kind == "table" else value)
        return f"<!-- {kind}: {name} -->{inner}<!-- end -->"

    return MARK.sub(filled_mark, page)


def table(rows: list[tuple]) -> str:
    """A Markdown table."""
    lines = ["| " + " | ".join(str(cell) for cell in row) + " |" for row in rows]
    return "\n".join([lines[0], "|" + "---|" * len(rows[0]), *lines[1:]])


def with_bounds(value: float, low: float, high: float) -> str:
    """A value with the half-width of its interval, to the first figure of that; its ends where uneven.

    Half-widths of a hundred and more are rounded to two figures, and the value with them.
    """
    half = (high - low) / 2
    if half >= 100:
        place = 10 ** (math.floor(math.log10(half)) - 1)
        value, low, high = (round(bound / place) * place for bound in (value, low, high))
        half = round(half / place) * place
    digits = max(0, -math.floor(math.log10(half))) if half > 0 else 1
    if abs((high + low) / 2 - value) > half / 5:
        return signed(f"{value:.{digits}f} [{low:.{digits}f}, {high:.{digits}f}]")
    return signed(f"{value:.{digits}f} ± {half:.{digits}f}")


def signed(text: str) -> str:
    """Numbers with a minus sign in place of a hyphen, and none before zero."""
    return re.sub(r"-(?=0\.?0*(?![\d.]))", "", text).replace("-", "−")


def pages() -> list[Path]:
    """The pages that hold numbers."""
    all_pages = [page for page in sorted((ROOT / "docs").rglob("*.md")) if "_build" not in page.parts]
    return [page for page in all_pages if MARK.search(page.read_text(encoding="utf-8"))]


def main(folder: str) -> None:
    """Fill all pages; ends with 1 and the command that is wanting where results are missing."""
    results = Results(Path(folder))
    for page in pages():
        old = page.read_text(encoding="utf-8")
        try:
            new = filled(old, results)
        except Missing as missing:
            sys.exit(f"{page.relative_to(ROOT)}: {missing}")
        if new != old:
            page.write_text(new, encoding="utf-8")
        sys.stdout.write(f"{page.relative_to(ROOT)}: {'changed' if new != old else 'as it was'}\n")


if __name__ == "__main__":
    main(sys.argv[1])

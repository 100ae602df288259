"""How many words of docs/ and benchmarks/ are written by hand: `PYTHONPATH=docs python -m making.words`.

A word has a letter or a digit. What the program fills in between marks is not counted: captions, tables, values.
"""

import re
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]
FILLED = re.compile(r"<!-- (?:picture|table|value)\b.*?<!-- (?:drawn|end) -->", re.DOTALL)


def count(page: str) -> int:
    """The words of a page."""
    return sum(bool(re.search(r"\w", word)) for word in FILLED.sub(" ", page).split())


def by_page() -> dict[str, int]:
    """The words of each page, the longest first."""
    pages = [
        page for room in ("docs", "benchmarks") for page in (ROOT / room).rglob("*.md") if "_build" not in page.parts
    ]
    counts = {str(page.relative_to(ROOT)): count(page.read_text(encoding="utf-8")) for page in pages}
    return dict(sorted(counts.items(), key=lambda item: -item[1]))


if __name__ == "__main__":
    counts = by_page()
    lines = [f"{words:6,} {page}" for page, words in counts.items()]
    sys.stdout.write("\n".join([*lines, f"{sum(counts.values()):6,} in all"]) + "\n")

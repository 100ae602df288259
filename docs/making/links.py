"""Links between the repository's Markdown pages: files that must be there, headings that must stand in them."""

import re
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

from making.generated import filled

LINK = re.compile(r"(?<!!)\[(?:[^\[\]]|\[[^\]]*\])*\]\(([^)\s]+)\)|!\[[^\]]*\]\(([^)\s]+)\)")
OUTSIDE = re.compile(r"[a-z]+:")


def prose(page: str) -> str:
    """A page without its code, where brackets mean nothing."""
    return re.sub(r"`[^`\n]*`", "", re.sub(r"^```.*?^```$", "", page, flags=re.MULTILINE | re.DOTALL))


def anchors(page: str) -> set[str]:
    """What `#…` may name in a page, made of its headings as GitHub does."""
    counts: Counter = Counter()
    slugs = set()
    for heading in re.findall(r"^#{1,6} +(.+?) *$", re.sub(r"^```.*?^```$", "", page, flags=re.M | re.S), re.MULTILINE):
        words = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading).lower()
        slug = re.sub(r"[^\w\- ]", "", words).replace(" ", "-")
        slugs.add(f"{slug}-{counts[slug]}" if counts[slug] else slug)
        counts[slug] += 1
    return slugs


def broken(path: Path) -> Iterator[str]:
    """Links of a page that lead nowhere, each with the reason."""
    for match in LINK.finditer(prose(path.read_text(encoding="utf-8"))):
        link = match[1] or match[2]
        if OUTSIDE.match(link):
            continue
        file, _, anchor = link.partition("#")
        target = (path.parent / file).resolve() if file else path
        if not target.exists():
            yield f"{link}: no such file"
        elif anchor and anchor not in anchors(filled(target.read_text(encoding="utf-8"))):
            yield f"{link}: no such heading"
